"""Folders of somebody hostile: the short form of `benchmarks/foreign_folders.py`, and what it found."""

import csv
import json
import os
import signal
import sqlite3
import sys
import warnings
from pathlib import Path
from xml.etree import ElementTree

import pandas as pd
import pyarrow as pa
import pyarrow.parquet as pq
import pytest
import xarray as xr

import paraflex as pf
from journals import tally
from made_up import STUDY, made_up, write_study
from paraflex.campaign.journal import JOURNAL, _digest, read_journal
from paraflex.campaign.tables import read_table
from paraflex.cli.collected import collecting
from paraflex.designs.reopen import open_study
from paraflex.errors import InputError, OutputError
from paraflex.files import library_text
from paraflex.folders import RUN, finish_change, hold_folder, read_manifest
from paraflex.formatting import NO_VALUE, labelled, number
from paraflex.plots.labels import plain
from paraflex.plots.sources import open_source
from paraflex.plots.svg import sketch
from paraflex.results.export import _write_table, export, export_table
from paraflex.results.tables import spreadsheet_table
from paraflex.studies import load_sweep, sweep
from paraflex.writing import read_json, write_json
from processes import run, started
from shell import paraflex

SWEEP = STUDY + '\n[sampling]\nkind = "sobol"\nnumber = 4\n'
# Readers are forked, from a process without threads; of results there is one kind.
SHORT = """
import os, sys, tempfile
from pathlib import Path

os.environ["OPENBLAS_NUM_THREADS"] = "1"
sys.path.insert(0, sys.argv[1])
import foreign_folders

foreign_folders._import_once()
with tempfile.TemporaryDirectory() as place:
    foreign_folders.make_results(Path(place), ["sweep"])
    for case in foreign_folders.cases(Path(place), 12, 3, foreign_folders.ATTACKS):
        print(*case[:5], case.detail if case.outcome in foreign_folders.FAILURES else "", sep="; ")
"""
posix = pytest.mark.skipif(os.name != "posix", reason="pipes, and processes that are forked")


@pytest.fixture
def whole(tmp_path):
    """A finished sweep, made without running anything."""
    study = load_sweep(write_study(tmp_path, SWEEP))
    return sweep(study, tmp_path / "whole", workers=1, run=made_up(tracking_rms=lambda mode, x, y: x))


@posix
def test_readers_of_hostile_folders_refuse_them_or_read_what_is_true():
    with started(sys.executable, "-c", SHORT, Path(__file__).parents[1] / "benchmarks") as child:
        done = child.end()
    assert done.returncode == 0, done.stderr
    outcomes = [line.split("; ")[4] for line in done.stdout.splitlines()]
    assert len(outcomes) == 12
    assert set(outcomes) <= {"refused", "read"}, done.stdout


@pytest.mark.parametrize("name", ["a\0b", "a\0b/c", "\ud800", "\ud800/x"])
def test_names_that_no_file_has_are_passed_over(tmp_path, name):
    with hold_folder(tmp_path, RUN) as held, held.replaced() as new:
        write_json(new / "summary.json", {"a": 1})
    (tmp_path / ".ready").mkdir()
    (tmp_path / ".ready" / "manifest.json").write_bytes((tmp_path / "manifest.json").read_bytes())
    write_json(tmp_path / ".ready" / "removed.json", [name])
    finish_change(tmp_path)
    assert not (tmp_path / ".ready").exists()
    assert list(read_manifest(tmp_path).files) == ["summary.json"]
    write_json(tmp_path / "manifest.json", {"kind": RUN, "identity": "", "files": {name: ""}})
    with pytest.raises(InputError, match="not a list of the folder's files"):
        read_manifest(tmp_path)


@posix
def test_pipes_in_place_of_files_are_not_waited_for(whole, tmp_path):
    os.mkfifo(tmp_path / "pipe.nc")
    for read in (read_json, pf.open_results, open_source):
        with pytest.raises(InputError, match=r"pipe\.nc: cannot be read \(a pipe or a device"):
            read(tmp_path / "pipe.nc")
    (whole.folder / ".ready").mkdir()
    (whole.folder / ".ready" / "manifest.json").write_bytes((whole.folder / "manifest.json").read_bytes())
    os.mkfifo(whole.folder / ".ready" / "removed.json")
    with pytest.raises(InputError, match=r"removed\.json: cannot be read \(a pipe or a device"):
        finish_change(whole.folder)


def noted(folder, name, value):
    connection = sqlite3.connect(folder / JOURNAL)
    with connection:
        connection.execute("REPLACE INTO notes VALUES (?, ?, ?)", (name, value, _digest(name, value.hex())))
    connection.close()


@pytest.mark.parametrize(
    ("name", "value", "says"),
    [
        ("rows", b"many", "does not hold the number of rows"),
        ("rows", b"1 2 3", "does not hold the number of rows"),
        ("schema", b"", "its columns are not recorded"),
        ("schema", b"\xff" * 100, "its columns are not recorded"),
        (
            "schema",
            pa.schema([("run", pa.list_(pa.int8()))]).serialize().to_pybytes(),
            "a row does not fit its columns",
        ),
    ],
)
def test_notes_of_a_journal_that_hold_their_digest_and_nothing_of_ours_are_damage(whole, name, value, says):
    noted(whole.folder, name, value)
    with pytest.raises(OutputError, match=rf"journal\.sqlite: damaged: .*{says}"):
        read_table(whole.folder / JOURNAL)


@pytest.mark.parametrize(
    "statements",
    [
        ["CREATE TRIGGER sqlitex AFTER INSERT ON notes BEGIN DELETE FROM runs; END"],
        ["CREATE VIEW [sqlite.x] AS SELECT 1"],
        [
            "CREATE TRIGGER t AFTER INSERT ON notes BEGIN DELETE FROM runs; END",
            "PRAGMA writable_schema = 1",
            "UPDATE sqlite_master SET name = 'sqlite_t' WHERE name = 't'",
        ],
    ],
)
def test_triggers_and_views_of_any_name_are_damage(whole, statements):
    connection = sqlite3.connect(whole.folder / JOURNAL)
    with connection:
        for statement in statements:
            connection.execute(statement)
    connection.close()
    with pytest.raises(OutputError, match=r"it holds other things than the tables|malformed database schema"):
        read_table(whole.folder / JOURNAL)


@pytest.mark.parametrize(
    "content", ["[]", "null", "{", "[" * 100_000, '{"run": "0", "id": "x"}', '{"run": 0, "id": 1}']
)
def test_rows_that_hold_their_digest_and_no_run_are_damage(whole, content):
    connection = sqlite3.connect(whole.folder / JOURNAL)
    with connection:
        run, identity = connection.execute("SELECT run, id FROM runs").fetchone()
        entry = (run, identity, content, _digest(run, identity, content))
        connection.execute("REPLACE INTO runs VALUES (?, ?, ?, ?)", entry)
        tally(connection)
    connection.close()
    with pytest.raises(OutputError, match="a row does not describe a run"), read_journal(
        whole.folder / JOURNAL
    ) as journal:  # fmt: skip
        list(journal.rows())


@pytest.mark.parametrize(
    ("column", "values"),
    [("tracking_rms", ["x"] * 4), ("tracking_rms", [[1.0]] * 4), ("run", [None] * 4), ("design", ["<b>"] * 4)],
)
def test_tables_of_other_things_than_numbers_are_refused(whole, column, values):
    rows = pq.read_table(whole.table)
    (whole.folder / "manifest.json").unlink()
    pq.write_table(rows.set_column(rows.column_names.index(column), column, pa.array(values)), whole.table)
    with pytest.raises(InputError, match=r"results\.parquet: damaged: not a table of numbers"):
        open_source(whole.folder)


def test_what_csv_does_not_hold_is_told(whole, tmp_path):
    file = tmp_path / "nested.parquet"
    pq.write_table(pa.table({"x": [[1.0]]}), file)
    with pytest.raises(InputError, match="CSV cannot hold all values of the table"):
        export_table(file, tmp_path / "out.csv", "csv")
    assert not (tmp_path / "out.csv").exists()


@pytest.mark.parametrize("kind", [pa.string(), pa.large_string()])
def test_labels_are_no_formulas_whatever_kind_of_text_pandas_makes_of_them(kind):
    """Pandas makes text of the second kind since 3.0."""
    table = pa.table({"mode": pa.array(["=1+1", "+-"], kind)})
    assert spreadsheet_table(table)["mode"].to_pylist() == ["'=1+1", "+-"]


def test_exported_labels_are_no_formulas(tmp_path):
    data = xr.Dataset({"peak": ("mode", [1.0])}, {"mode": ["=1+1"]}, {"schema": 3, "paraflex_version": "1"})
    export(data, tmp_path, "csv")
    cells = [cell for row in csv.reader((tmp_path / "figures.csv").read_text().splitlines()) for cell in row]
    assert "'=1+1" in cells


@posix
def test_a_signal_while_a_folder_is_tried_leaves_nothing(tmp_path, monkeypatch):
    plain = Path.mkdir

    def interrupted(path, *arguments, **options):
        plain(path, *arguments, **options)
        if path.name == ".new":
            signal.raise_signal(signal.SIGINT)

    monkeypatch.setattr(Path, "mkdir", interrupted)
    with pytest.raises(KeyboardInterrupt), hold_folder(tmp_path / "out", RUN):
        pytest.fail("it was not interrupted")
    assert not list(tmp_path.iterdir())


def test_unfinished_files_are_not_removed_through_a_link(whole, tmp_path):
    (tmp_path / "others").mkdir()
    (tmp_path / "others" / "x.part").write_text("theirs")
    (whole.folder / "trajectories").symlink_to(tmp_path / "others")
    study = load_sweep(tmp_path / "study.toml")
    with pytest.raises(OutputError, match="a link leads out of"):
        sweep(study, whole.folder, run=pytest.fail)
    assert (tmp_path / "others" / "x.part").read_text() == "theirs"


def test_a_copy_by_hard_links_stays_as_it_is(whole, tmp_path):
    study, copy = load_sweep(tmp_path / "study.toml"), tmp_path / "copy.sqlite"
    connection = sqlite3.connect(whole.folder / JOURNAL)
    with connection:
        connection.execute("DELETE FROM runs WHERE run = 1")
        digests = [int(each, 16) for (each,) in connection.execute("SELECT digest FROM runs")]
    connection.close()
    noted(whole.folder, "rows", f"{len(digests)} {sum(digests) % (1 << 128)}".encode())
    os.link(whole.folder / JOURNAL, copy)
    before = copy.read_bytes()
    run = made_up(tracking_rms=lambda mode, x, y: x)
    assert sweep(study, whole.folder, workers=1, run=run).fresh == 1
    assert copy.read_bytes() == before


@posix
def test_pipes_beside_a_journal_are_not_waited_for(whole):
    os.mkfifo(whole.folder / f"{JOURNAL}-journal")
    with pytest.raises(OutputError, match="a link or not a regular file, or one beside it"):
        read_table(whole.folder / JOURNAL)


@pytest.mark.parametrize("value", [b"[" * 100_000, b"1", b"\xff", b'{"content": "x", "versions": 1}'])
def test_a_journal_of_no_study_is_of_another(whole, tmp_path, value):
    noted(whole.folder, "study", value)
    with pytest.raises(InputError, match="results of another study"):
        sweep(load_sweep(tmp_path / "study.toml"), whole.folder, run=pytest.fail)


def test_a_table_without_identities_is_not_taken_over(whole, tmp_path):
    rows = pq.read_table(whole.table)
    for name in (JOURNAL, "manifest.json"):
        (whole.folder / name).unlink()
    pq.write_table(rows.drop_columns(["status"]), whole.table)
    with pytest.raises(InputError, match=r"results\.parquet: damaged: not a table of runs"):
        sweep(load_sweep(tmp_path / "study.toml"), whole.folder, run=pytest.fail)


def test_a_name_that_is_none_is_text_in_a_report(whole):
    account = read_json(whole.folder / "study.json")
    (whole.folder / "manifest.json").unlink()
    write_json(whole.folder / "study.json", account | {"name": {"<b>": 1}})
    assert open_study(whole.folder).name == "{'<b>': 1}"


def test_warnings_of_others_do_not_move_the_terminal():
    said = []
    with warnings.catch_warnings():
        warnings.simplefilter("always")
        warnings.showwarning = lambda message, *_: said.append(message)
        with collecting():
            warnings.warn("Glyph 27 (\x1b) missing", stacklevel=1)
    assert said == ["Glyph 27 (\\x1b) missing"]


def test_numbers_beyond_all_in_their_unit_are_none_in_reports():
    assert number(-1e308, factor=1e6) == number(float("nan")) == NO_VALUE


def test_what_results_without_a_seal_lead_to_is_one_line(tmp_path):
    """Others' programs write results anew, and anything may stand in them then."""
    data = pf.motion_dataset(pf.simulate_motion(pf.load("pendulum"), 0.1, samples=5, warning=False))
    pf.save_results(data, tmp_path / "whole.nc")
    data.assign_coords(time=data.time[::-1].to_numpy()).to_netcdf(tmp_path / "turned.nc", engine="netcdf4")
    done = paraflex("compare", str(tmp_path / "whole.nc"), str(tmp_path / "turned.nc"))
    assert done.returncode == 2
    assert done.stderr.splitlines() == [
        f"error: {tmp_path / 'turned.nc'}: holds something other than what paraflex writes (ValueError); "
        "repeat the command that wrote it"
    ]


def test_what_plain_numbers_without_a_digest_lead_to_is_one_line(tmp_path):
    numbers = {"parameters": ["a"], "units": {}, "runs": [{"mode": [None]}]}
    (tmp_path / "sensitivity.json").write_text(json.dumps(numbers))
    done = paraflex("plot", str(tmp_path), "all")
    assert done.returncode == 2
    assert done.stderr.startswith(f"error: {tmp_path / 'sensitivity.json'}: holds something other than what paraflex")


def test_control_characters_in_names_and_endless_names_leave_pictures_whole(tmp_path):
    text = library_text("pendulum").replace('name = "', 'name = "a\\u0008b ', 1)
    (tmp_path / "own.toml").write_text(text)
    done = paraflex("draw", str(tmp_path / "own.toml"), "--no-open", "--output", str(tmp_path / "own.svg"))
    assert done.returncode == 0, done.stderr
    ElementTree.parse(tmp_path / "own.svg")
    ElementTree.fromstring(sketch(pf.load(tmp_path / "own.toml").mechanism))
    assert len(plain("x" * 10**6)) < 1000
    assert len(labelled("time", "s" * 10**6)) < 1000


class Counted(dict):
    copies = 0

    def __deepcopy__(self, _):
        Counted.copies += 1
        return self


def test_units_of_tables_are_not_copied_with_every_column(tmp_path):
    """As pandas copies the attributes of a table whenever a column is looked at: thousands of them took minutes."""
    table = pd.DataFrame({f"c{k}": [0.0] for k in range(50)})
    table.attrs = {name: Counted.fromkeys(table.columns, "m") for name in ("units", "meanings")}
    _write_table(table, tmp_path / "table.csv", "csv", {})
    assert Counted.copies < 10
    assert (tmp_path / "table.csv").read_text().startswith('"c0 [m]","c1 [m]"')


def test_what_a_terminal_cannot_show_ends_no_command(tmp_path):
    command = (sys.executable, "-m", "paraflex", "run", "pendulum", "--duration", "0.05", "--samples", "6")
    done = run(*command, env={"PYTHONIOENCODING": "ascii"}, cwd=tmp_path)
    assert done.returncode == 0, done.stderr
    assert "?" in done.stdout
