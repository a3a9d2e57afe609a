"""Damaged files of results are named, not read: a bit flipped in every kind; old folders with rows twice or foreign."""

import json
import os
import shutil
import sqlite3
import sys
from collections import Counter
from pathlib import Path

import numpy as np
import pyarrow as pa
import pyarrow.parquet as pq
import pytest
import xarray as xr

import paraflex as pf
from made_up import STUDY, made_up, write_study
from paraflex.campaign import read_table, read_tables, tables_of
from paraflex.campaign.journal import JOURNAL, read_journal, write_journal
from paraflex.errors import InputError, OutputError, ResultWarning
from paraflex.plots.sources import open_source
from paraflex.results import open_results
from paraflex.results.tables import read_parquet
from paraflex.seals import check_seal, seal
from paraflex.studies import load_sweep, sweep
from paraflex.writing import read_json, write_json
from shell import paraflex

sys.path.append(str(Path(__file__).parents[1] / "benchmarks"))

import bit_flips

SWEEP = STUDY + '\n[sampling]\nkind = "sobol"\nnumber = 8\n'
METRICS = {"tracking_rms": lambda mode, x, y: x, "peak_torque_max": lambda mode, x, y: y, "total_mass": lambda *_: 3.0}


@pytest.fixture
def study(tmp_path):
    return load_sweep(write_study(tmp_path, SWEEP))


@pytest.fixture
def whole(study, tmp_path):
    """A finished sweep, made without running anything."""
    return sweep(study, tmp_path / "whole", workers=1, run=made_up(**METRICS))


def flip(file, place, bit=1):
    content = bytearray(file.read_bytes())
    content[place] ^= bit
    file.write_bytes(content)


def test_no_flipped_bit_is_read_as_other_numbers(tmp_path, monkeypatch):
    """The short form of benchmarks/bit_flips.py: of each file that numbers are read from some bits."""
    # Of an unfinished one four are done: whoever goes on with it has one left to do.
    monkeypatch.setattr(bit_flips, "SOBOL", bit_flips.SOBOL.replace("6", "5"))
    (tmp_path / "files").mkdir()
    cases = list(bit_flips.flips(tmp_path, 50, 3, bit_flips.kinds(tmp_path / "files")))
    assert [case for case in cases if case.outcome in ("raw", "silent")] == []
    # Files without a digest would be read as if nothing were.
    found = Counter(case.file.rpartition(".")[2] for case in cases if case.outcome == "found")
    assert {"nc", "parquet", "json", "sqlite"} <= set(found)
    assert all(case.outcome == "found" for case in cases if case.file.endswith((".nc", ".parquet")))


@pytest.mark.parametrize("name", ["data.nc", "data.parquet"])
def test_a_seal_finds_every_flipped_bit_and_others_read_the_file(tmp_path, name):
    file = tmp_path / name
    values = np.arange(40.0)
    if name == "data.nc":
        xr.Dataset({"x": ("t", values)}).to_netcdf(file)
    else:
        pq.write_table(pa.table({"x": values}), file)
    before = file.stat().st_size
    seal(file)
    assert file.stat().st_size == before + 32
    read = xr.load_dataset(file)["x"].values if name == "data.nc" else pq.read_table(file)["x"].to_numpy()
    np.testing.assert_array_equal(read, values)
    sealed, passed = file.read_bytes(), []
    check_seal(file, "make it again")
    with file.open("r+b", buffering=0) as opened:
        for place, byte in enumerate(sealed):
            # In place: the file is not written anew thousands of times.
            os.pwrite(opened.fileno(), bytes([byte ^ (1 << place % 8)]), place)
            try:
                check_seal(file, "make it again")
                passed.append(place)
            except InputError:
                pass
            os.pwrite(opened.fileno(), bytes([byte]), place)
    assert file.read_bytes() == sealed
    if name == "data.nc":
        assert passed == []
        return
    # Bytes that say that it is Parquet, and sealed: no numbers. Without the last of them pyarrow finds none.
    mark = sealed.index(b"paraflex")
    assert passed == [*range(4), *range(mark, mark + 8), *range(len(sealed) - 8, len(sealed) - 4)]
    for place in passed:
        flip(file, place, 1 << place % 8)
        if place >= len(sealed) - 8:
            with pytest.raises(InputError, match="damaged: cut short, or not a readable table"):
                read_parquet(file)
        else:
            np.testing.assert_array_equal(read_parquet(file)["x"], values)
        file.write_bytes(sealed)


def test_a_file_that_others_changed_is_read_unchecked(tmp_path):
    netCDF4 = pytest.importorskip("netCDF4")
    file = tmp_path / "data.nc"
    xr.Dataset({"x": ("t", np.arange(40.0))}, attrs={"schema": 3, "paraflex_version": "1"}).to_netcdf(file)
    seal(file)
    with netCDF4.Dataset(file, "a") as opened:
        opened["x"][3] = 7.0
    assert open_results(file)["x"][3] == 7.0


def test_a_table_of_json_is_checked_and_one_without_a_digest_is_read(tmp_path):
    file = tmp_path / "values.json"
    write_json(file, {"peak": 1.5, "mode": "++", 3: [float("inf"), None]})
    assert read_json(file) == {"peak": 1.5, "mode": "++", "3": [float("inf"), None]}
    file.write_text(file.read_text().replace("1.5", "1.7"))
    with pytest.raises(InputError, match=r"values.json: damaged: not as it was written; run the same command again"):
        read_json(file)
    file.write_text('{"peak": 1.7}')
    assert read_json(file) == {"peak": 1.7}
    file.write_text("[1]")
    with pytest.raises(InputError, match="not a file that paraflex wrote"):
        read_json(file)


def test_a_damaged_table_is_read_from_the_journal_beside_it(study, whole):
    rows = read_table(whole.table)
    flip(whole.table, 200)
    with pytest.warns(ResultWarning, match=r"results.parquet: damaged: .*read from journal.sqlite beside it; run the"):
        assert read_table(whole.table).equals(rows)
    with pytest.warns(ResultWarning, match="damaged"):
        assert open_source(whole.folder).data.run.size == 8
    (whole.folder / JOURNAL).unlink()
    with pytest.raises(InputError, match=r"results.parquet: damaged: not as it was written; delete it and run"):
        open_source(whole.folder)
    with pytest.raises(InputError, match=r"results.parquet: damaged"):
        sweep(study, whole.folder, run=pytest.fail)


def test_rows_that_an_index_leaves_out_are_missed_and_found_again(study, whole):
    """A row that the index does not know, and then one that is gone."""
    file, table = whole.folder / JOURNAL, whole.table.read_bytes()
    connection = sqlite3.connect(file)
    connection.execute("PRAGMA writable_schema = ON")
    with connection:
        connection.execute("UPDATE sqlite_master SET rootpage = 2 WHERE name = 'sqlite_autoindex_runs_1'")
    connection.close()
    with pytest.raises(OutputError, match=r"journal.sqlite: damaged: .*run the same command again"):
        read_table(file)
    with pytest.warns(ResultWarning, match="8 rows are whole"):
        assert sweep(study, whole.folder, run=pytest.fail).table.read_bytes() == table
    connection = sqlite3.connect(file)
    with connection:
        connection.execute("DELETE FROM runs WHERE run = 3")
    connection.close()
    with pytest.raises(OutputError, match=r"journal.sqlite: damaged: 7 of 8 rows are found"):
        read_table(file)
    run = made_up(**METRICS)
    with pytest.warns(ResultWarning, match="7 rows are whole, and runs without one are made again"):
        assert sweep(study, whole.folder, workers=1, run=run).table.read_bytes() == table
    assert len(run.designs) == 1


def test_a_journal_that_is_not_readable_from_its_first_page_on_keeps_its_rows(study, whole):
    table, file = whole.table.read_bytes(), whole.folder / JOURNAL
    for place in (3, 59, file.read_bytes().index(b"CREATE TABLE runs")):
        flip(file, place, 2)
        with pytest.raises(OutputError, match=r"journal.sqlite: damaged"), read_journal(file) as journal:
            list(journal.rows())
        with pytest.warns(ResultWarning, match="8 rows are whole"):
            assert sweep(study, whole.folder, run=pytest.fail).table.read_bytes() == table


def test_a_row_replaced_counts_once(tmp_path):
    with write_journal(tmp_path) as journal:
        for peak in (1.0, 2.0):
            journal.add([{"run": 0, "id": "a", "peak": peak}, {"run": 0, "id": "a", "peak": peak + 0.5}])
            journal.commit()
            journal.add([{"run": 1, "id": "b", "peak": peak}])
        assert [row["peak"] for row in journal.rows()] == [2.5, 2.0]


def old_folder(whole, folder):
    """A folder as releases before the journal left it: parts of rows."""
    (folder / "parts").mkdir(parents=True)
    shutil.copy(whole.folder / "study.json", folder)
    rows = pq.read_table(whole.table)
    for k in range(4):
        pq.write_table(rows.slice(2 * k, 2), folder / "parts" / f"part-{k:06d}.parquet")
    return rows


def test_rows_in_parts_and_in_the_table_made_of_them_are_there_once(study, whole, tmp_path):
    """What a process leaves that is killed before it removes the parts."""
    rows = old_folder(whole, tmp_path / "old")
    shutil.copy(tmp_path / "old" / "parts" / "part-000001.parquet", tmp_path / "old" / "parts" / "part-000009.parquet")
    assert read_tables(tables_of(tmp_path / "old")).equals(rows)
    shutil.copy(whole.table, tmp_path / "old")
    assert open_source(tmp_path / "old").data.run.tolist() == list(range(8))
    assert sweep(study, tmp_path / "old", run=pytest.fail).table.read_bytes() == whole.table.read_bytes()


def test_a_part_of_another_study_is_not_taken_over(study, whole, tmp_path):
    old = tmp_path / "old"
    old_folder(whole, old)
    other = load_sweep(write_study(tmp_path, SWEEP.replace("0.15", "0.16"), "other.toml"))
    foreign = sweep(other, tmp_path / "other", workers=1, run=made_up(**METRICS))
    pq.write_table(pq.read_table(foreign.table).slice(4, 2), old / "parts" / "part-000009.parquet")
    with pytest.raises(InputError, match=r"part-000009.parquet: rows of another study .*run 4 has two identities"):
        open_source(old)
    run = made_up(**METRICS)
    (old / "parts" / "part-000003.parquet").unlink()
    with pytest.warns(ResultWarning, match="part-000009.parquet: 2 of its 2 rows are of another study"):
        result = sweep(study, old, workers=1, run=run)
    assert len(run.designs) == 2
    assert result.table.read_bytes() == whole.table.read_bytes()


def test_a_damaged_metric_of_a_part_is_called_so(study, whole, tmp_path):
    rows = old_folder(whole, tmp_path / "old")
    at = rows.column_names.index("tracking_rms")
    part = tmp_path / "old" / "parts" / "part-000000.parquet"
    pq.write_table(rows.slice(0, 2).set_column(at, "tracking_rms", pa.array(["x", "y"])), part)
    with pytest.raises(InputError, match=r"part-000000.parquet: damaged: tracking_rms holds string; delete it and run"):
        sweep(study, tmp_path / "old", run=pytest.fail)


def test_a_trajectory_that_was_deleted_is_made_again(tmp_path):
    more = {"end": bit_flips.SOBOL.replace("6", "3"), "more": "trajectories = true"}
    study = load_sweep(bit_flips._file(tmp_path, "sweep", **more))
    result = sweep(study, tmp_path / "out", workers=1)
    kept = sorted((tmp_path / "out" / "trajectories").iterdir())
    numbers, table = open_results(kept[2]), result.table.read_bytes()
    flip(kept[2], 9000)
    with pytest.raises(InputError, match=r"\.nc: damaged: .*delete it and run the same command again"):
        open_results(kept[2])
    kept[2].unlink()
    again = sweep(study, tmp_path / "out", workers=1)
    assert (again.fresh, again.table.read_bytes()) == (1, table)
    assert open_results(kept[2]).drop_attrs().identical(numbers.drop_attrs())
    # Whoever deletes all of them wants none.
    shutil.rmtree(tmp_path / "out" / "trajectories")
    assert sweep(study, tmp_path / "out", run=pytest.fail).complete


def test_a_report_that_cannot_be_written_does_not_hide_the_table(tmp_path):
    file = bit_flips._file(tmp_path, "sweep", bit_flips.SOBOL)
    command = ["sweep", file, "--output", tmp_path / "out", "--workers", "1"]
    assert paraflex(*command, "--no-report").returncode == 0
    (tmp_path / "out" / "report.html").mkdir()
    done = paraflex(*command, "--json")
    assert done.returncode == 2
    assert json.loads(done.stdout)["status"] == {"complete": 6}
    assert "report.html: cannot be written (a folder of that name is there)" in done.stderr


def test_a_run_whose_figures_cannot_be_written_tells_its_numbers(tmp_path):
    (tmp_path / "figures").write_text("in the way")
    done = paraflex("run", "five_bar", "--path", "line", "--duration", "0.02", "--samples", "5", "--out", tmp_path)
    assert done.returncode == 2
    assert "++" in done.stdout.split("peak torques")[1]
    assert "figures" in done.stderr.splitlines()[-1]
    assert pf.open_results(tmp_path).sizes["time"] == 5
