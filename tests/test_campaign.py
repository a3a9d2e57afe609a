"""Journals and workers: killed, damaged, of an earlier release or held by another; any function in any engine."""

import json
import math
import os
import shutil
import signal
import sqlite3
import sys
import warnings
from contextlib import suppress

import pytest

from journals import rows_in
from paraflex.campaign import open_engine, outcomes, read_table, tables_of
from paraflex.campaign.journal import JOURNAL, read_journal, write_journal
from paraflex.designs.run import run_task
from paraflex.errors import InputError, OutputError, ResultWarning
from paraflex.folders import lock_folder
from paraflex.studies import load_sweep, sweep
from paraflex.studies.sweeps.report import study_page
from paraflex.writing import read_json
from processes import started

STUDY = """
mechanism = "raparm_i"
paths = ["line"]
modes = ["++++", "+-+-"]
duration = 0.05
samples = 26

[sampling]
kind = "sobol"
number = 8
seed = 5

[integration]
method = "esdirk5"
tolerance = 1e-3

[vary.thickness]
fields = ["section.bar.thickness"]
low = 0.005
high = 0.007
"""
# Every row is written at once, and there is time to be killed in.
SLOWLY = """
import sys, time

from paraflex.campaign import journal
from paraflex.studies import load_sweep, sweep
from paraflex.designs.run import run_task

journal._SECONDS = 0.0


def slow(setting, task, watch=None):
    time.sleep(600 if task.number == 3 else 0)
    return run_task(setting, task, watch)


sweep(load_sweep(sys.argv[1]), sys.argv[2], workers=1, run=slow)
"""
HOLDS = """
import sys, time
from pathlib import Path

from paraflex.folders import lock_folder

with lock_folder(Path(sys.argv[1])):
    print("held", flush=True)
    time.sleep(60)
"""
# So small a cache that rows of a transaction are in the file before it is committed.
HALF_A_COMMIT = """
import sys, time
from pathlib import Path

from paraflex.campaign.journal import write_journal

with write_journal(Path(sys.argv[1])) as journal:
    journal.add([{"run": k, "id": "a"} for k in range(10)])
    journal.commit()
    journal._connection.execute("PRAGMA cache_size = 10")
    more = [(k, "b", "x" * 1000, "") for k in range(10_000)]
    journal._connection.executemany("INSERT INTO runs VALUES (?, ?, ?, ?)", more)
    print("half", flush=True)
    time.sleep(60)
"""
kills = pytest.mark.skipif(os.name != "posix", reason="SIGKILL")


@pytest.fixture(scope="module")
def file(tmp_path_factory):
    file = tmp_path_factory.mktemp("study") / "study.toml"
    file.write_text(STUDY, encoding="utf-8")
    return file


@pytest.fixture(scope="module")
def whole(file):
    """The study done in one go."""
    return sweep(file, file.parent / "whole", workers=2)


@pytest.fixture
def counted():
    def run(setting, task, watch=None):
        run.made.append(task.number)
        return run_task(setting, task, watch)

    run.made = []
    return run


def kill(child):
    child.send(signal.SIGKILL)
    assert child.end().returncode == -signal.SIGKILL


@kills
def test_a_killed_sweep_goes_on_to_the_same_table(file, whole, counted, tmp_path):
    out = tmp_path / "out"
    with started(sys.executable, "-c", SLOWLY, file, out) as child:
        child.until(lambda: rows_in(out))
        kill(child)
    kept = rows_in(out)
    assert 0 < kept < 16
    # No table was made, but the rows are there for reports and figures.
    assert tables_of(out) == [out / JOURNAL]
    assert read_table(out / JOURNAL).schema.equals(read_table(whole.table).schema, check_metadata=True)
    assert study_page(out).title
    result = sweep(file, out, run=counted)
    assert len(counted.made) == 8 - kept // 2
    assert result.fresh == 16 - kept
    assert result.table.read_bytes() == whole.table.read_bytes()


@kills
def test_a_process_killed_in_a_commit_leaves_what_was_committed(tmp_path):
    with started(sys.executable, "-c", HALF_A_COMMIT, tmp_path) as child:
        child.until(lambda: child.out == "half\n")
        kill(child)
    assert (tmp_path / f"{JOURNAL}-journal").stat().st_size > 0
    assert (tmp_path / JOURNAL).stat().st_size > 1_000_000
    assert rows_in(tmp_path) == 10
    with write_journal(tmp_path) as journal:
        assert [row["run"] for row in journal.rows()] == list(range(10))


@kills
def test_a_killed_process_holds_nothing(tmp_path):
    with started(sys.executable, "-c", HOLDS, tmp_path) as child:
        child.until(lambda: child.out == "held\n")
        says = r"another process writes to it .*wait for it, or stop it"
        with pytest.raises(InputError, match=says), lock_folder(tmp_path):
            pass
        kill(child)
    with lock_folder(tmp_path) as locks:
        assert locks
    assert [each.name for each in tmp_path.iterdir()] == [".lock"]


@pytest.mark.skipif(os.name != "posix", reason="elsewhere files that are open cannot be deleted")
def test_a_folder_that_is_deleted_in_the_middle(file, whole, tmp_path):
    out, told = tmp_path / "out", []

    def delete(progress):
        told.append(progress)
        if len(told) == 1:
            shutil.rmtree(out)

    with pytest.raises(OutputError, match=r"journal.sqlite: was deleted while it was written; run the same command"):
        sweep(file, out, on_progress=delete)
    assert sweep(file, out).table.read_bytes() == whole.table.read_bytes()


def test_a_folder_of_others_keeps_its_files(file, tmp_path):
    """Also those that are called as what we have not yet written; a first write that was broken off is no file."""
    (tmp_path / "film.part").touch()
    with pytest.raises(InputError, match="the folder holds other files"):
        sweep(file, tmp_path)
    assert (tmp_path / "film.part").exists()
    (tmp_path / "film.part").rename(tmp_path / "study.json.part")
    assert sweep(file, tmp_path).complete


def test_a_file_system_without_locks_is_written_without(file, whole, tmp_path, monkeypatch):
    connect, opened = sqlite3.connect, []

    class Lockless(sqlite3.Connection):
        def executescript(self, script, /):
            if "EXCLUSIVE" in script:
                error = sqlite3.OperationalError("disk I/O error")
                error.sqlite_errorcode = sqlite3.SQLITE_IOERR_LOCK
                raise error
            return super().executescript(script)

    def lockless(name, **options):
        opened.append(str(name))
        return connect(name, factory=Lockless, **options)

    monkeypatch.setattr(sqlite3, "connect", lockless)
    assert sweep(file, tmp_path / "out").table.read_bytes() == whole.table.read_bytes()
    assert opened[1].endswith("?mode=rwc&nolock=1")


def test_a_damaged_row_is_noticed_and_made_again(file, whole, counted, tmp_path):
    out = tmp_path / "out"
    sweep(file, out)
    content = bytearray((out / JOURNAL).read_bytes())
    content[content.index(b'{"run": 5,') + 100] = 0xFF
    (out / JOURNAL).write_bytes(content)
    with pytest.raises(OutputError, match=r"journal.sqlite: damaged: the row of run 5 .*run the same command again"):
        rows_in(out)
    with pytest.warns(ResultWarning, match="damaged .*15 rows are whole, and runs without one are made again"):
        result = sweep(file, out, run=counted)
    assert counted.made == [2]
    assert result.table.read_bytes() == whole.table.read_bytes()


def test_a_folder_of_the_last_release_is_gone_on_with(file, whole, counted, tmp_path):
    """It has parts and no journal while it is unfinished, and a table alone when it is finished."""
    import pyarrow.parquet as pq

    rows = pq.read_table(whole.table)
    parts = tmp_path / "parts"
    parts.mkdir()
    (tmp_path / "study.json").write_bytes((whole.folder / "study.json").read_bytes())
    pq.write_table(rows.slice(8, 4), parts / "part-000001.parquet")
    pq.write_table(rows.slice(0, 6), parts / "part-000002.parquet")
    assert sum(read_table(each).num_rows for each in tables_of(tmp_path)) == 10
    assert sweep(file, tmp_path, run=counted).table.read_bytes() == whole.table.read_bytes()
    assert len(counted.made) == 3
    assert not parts.exists()
    (tmp_path / JOURNAL).unlink()
    assert tables_of(tmp_path) == [tmp_path / "results.parquet"]
    assert sweep(file, tmp_path, run=pytest.fail).table.read_bytes() == whole.table.read_bytes()


def test_ctrl_c_in_a_commit_loses_no_row(tmp_path, monkeypatch):
    def interrupted(*_):
        raise KeyboardInterrupt

    def write():
        with write_journal(tmp_path) as journal, monkeypatch.context() as patch:
            patch.setattr("paraflex.campaign.journal._digest", interrupted)
            journal.add([{"run": 0, "id": "a"}])
            journal.commit()

    with pytest.raises(KeyboardInterrupt):
        write()
    assert rows_in(tmp_path) == 1


def test_what_a_study_is_stands_in_the_journal(file, whole, tmp_path):
    """Without `study.json` another study is still refused, and the file is made again."""
    said = (whole.folder / "study.json").read_text()
    (whole.folder / "study.json").unlink()
    other = tmp_path / "other.toml"
    other.write_text(STUDY.replace("seed = 5", "seed = 6"), encoding="utf-8")
    with pytest.raises(InputError, match=r"results of another study.*name a new folder"):
        sweep(load_sweep(other), whole.folder)
    sweep(file, whole.folder, run=pytest.fail)
    assert (whole.folder / "study.json").read_text() == said
    with read_journal(whole.folder / JOURNAL) as journal:
        assert json.loads(journal.noted("study") or b"") == read_json(whole.folder / "study.json")


def squared(number, watch=None):
    return number**2


# Of a module that processes import in no time.
@pytest.mark.parametrize(("name", "function"), [("threads", squared), ("processes", math.factorial)])
def test_workers_take_any_function(name, function):
    with open_engine(name, 2) as engine:
        assert open_engine(engine) is engine
        assert dict(outcomes(engine, function, range(20))) == {n: function(n) for n in range(20)}


HOSTILE = [
    "CREATE TRIGGER more AFTER INSERT ON runs BEGIN UPDATE runs SET content = '{}'; END",
    "CREATE VIEW seen AS SELECT * FROM runs",
    "CREATE TABLE other (a)",
]


@pytest.mark.parametrize("statement", HOSTILE)
def test_a_journal_with_more_than_its_tables_is_damaged(tmp_path, statement):
    with write_journal(tmp_path) as journal:
        journal.add([{"run": 1, "id": "a", "x": 2.0}])
    with sqlite3.connect(tmp_path / JOURNAL) as connection:
        connection.execute(statement)
    connection.close()
    with pytest.raises(OutputError, match="other things than the tables"):
        rows_in(tmp_path)
    with pytest.warns(ResultWarning, match="1 rows are whole"), write_journal(tmp_path) as journal:
        journal.add([{"run": 2, "id": "b", "x": 3.0}])
    assert rows_in(tmp_path) == 2


@pytest.mark.skipif(os.name == "nt", reason="links need a privilege")
@pytest.mark.parametrize("end", ["", "-journal", "-wal"])
def test_a_journal_that_is_a_link_is_not_followed(tmp_path, end):
    (tmp_path / "theirs").write_text("theirs")
    folder = tmp_path / "out"
    folder.mkdir()
    with write_journal(folder) as journal:
        journal.add([{"run": 1, "id": "a", "x": 2.0}])
    if not end:
        (folder / JOURNAL).unlink()
    (folder / f"{JOURNAL}{end}").symlink_to(tmp_path / "theirs")
    with pytest.raises(OutputError, match="it is a link"), read_journal(folder / JOURNAL):
        pass
    with suppress(OutputError), warnings.catch_warnings():
        warnings.simplefilter("ignore")
        with write_journal(folder) as journal:
            journal.add([{"run": 2, "id": "b", "x": 2.0}])
    assert (tmp_path / "theirs").read_text() == "theirs"


def test_a_rollback_journal_that_names_another_file_is_not_used(tmp_path):
    with write_journal(tmp_path) as journal:
        journal.add([{"run": 1, "id": "a", "x": 2.0}])
    (tmp_path / f"{JOURNAL}-journal").write_bytes(bytes(512) + bytes.fromhex("d9d505f920a163d7"))
    with pytest.raises(OutputError, match="names another file"):
        rows_in(tmp_path)
