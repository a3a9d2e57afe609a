"""Threads, processes and Dask give the same table to the last bit; killed workers lose nothing."""

import json
import os
import shutil
import signal
import sys
import threading
import time
import urllib.error
import urllib.request
from concurrent.futures import Future, ProcessPoolExecutor, ThreadPoolExecutor
from contextlib import contextmanager
from multiprocessing import get_context

import pandas as pd
import psutil
import pytest

from journals import rows_in
from paraflex.campaign import LostCluster, Workers, open_engine, outcomes
from paraflex.campaign.workers import Engine, LostWorker
from paraflex.designs.run import Outcome, run_task
from paraflex.errors import InputError, ResultWarning
from paraflex.studies import load_sweep, sweep
from processes import started

distributed = pytest.importorskip("distributed")

STUDY = """
mechanism = "raparm_i"
paths = ["line"]
modes = ["++++", "+-+-"]
duration = 0.05
samples = 26

[sampling]
kind = "sobol"
number = 6
seed = 5

[integration]
method = "esdirk5"
tolerance = 1e-3

[vary.thickness]
fields = ["section.bar.thickness"]
low = 0.005
high = 0.007
scale = "log"
"""


@pytest.fixture(scope="module")
def study(tmp_path_factory):
    file = tmp_path_factory.mktemp("study") / "study.toml"
    file.write_text(STUDY, encoding="utf-8")
    return load_sweep(file)


@pytest.fixture(scope="module")
def table(study, tmp_path_factory):
    """Of one thread."""
    return sweep(study, tmp_path_factory.mktemp("one") / "out", workers=1).table.read_bytes()


def slow(setting, task):
    """Time enough to be killed in."""
    time.sleep(0.3)
    return run_task(setting, task)


def deadly(setting, task):
    """The third task kills whoever takes it, as running out of memory does."""
    if task.number == 2:
        os.kill(os.getpid(), signal.SIGKILL)
    return instant(setting, task)


def instant(setting, task):
    rows = [{"run": 2 * task.number + k, "id": "", "status": "complete", "reason": ""} for k in range(2)]
    return Outcome(task, rows)


@pytest.mark.parametrize("workers", [2, 3])
def test_threads(study, table, tmp_path, workers):
    assert sweep(study, tmp_path / "out", workers=workers).table.read_bytes() == table


def test_processes(study, table, tmp_path):
    assert sweep(study, tmp_path / "out", workers=Workers("processes", 2)).table.read_bytes() == table


def test_a_task_that_kills_its_process_is_a_row(study, tmp_path):
    """The task that waits for the same worker is lost with it, and is tried again as that of another one would be."""
    result = sweep(study, tmp_path / "out", workers=Workers("processes", 1), run=deadly)
    assert result.counts == {"complete": 10, "failed": 2}
    data = pd.read_parquet(result.table).set_index("run")
    assert "workers died running it" in data.loc[4, "reason"]
    assert data.loc[3, "status"] == data.loc[6, "status"] == "complete"


def test_dask_with_a_worker_killed_in_the_middle(study, table, tmp_path):
    """Several worker processes; one is killed while it has a task: all rows are there, the same as ever."""
    with distributed.LocalCluster(
        n_workers=2, threads_per_worker=1, dashboard_address=None, silence_logs=50
    ) as cluster:
        first = [worker.pid for worker in cluster.workers.values()]
        killed = []

        def kill_one(progress):
            if not killed:
                killed.append(first[0])
                os.kill(first[0], signal.SIGKILL)

        result = sweep(
            study,
            tmp_path / "out",
            workers=Workers("dask", cluster=cluster.scheduler_address),
            run=slow,
            on_progress=kill_one,
        )
        pids = set(distributed.Client(cluster, set_as_default=False).run(os.getpid).values())
    assert killed
    assert killed[0] not in pids
    assert result.counts == {"complete": 12}
    assert result.table.read_bytes() == table


def test_nobody_else_is_let_into_the_own_cluster():
    """Keys are its own, all ports those of this machine, and none says what runs."""
    engine = open_engine("dask", 1)
    try:
        address = engine._cluster.scheduler_address
        assert address.startswith("tls://127.0.0.1:")
        with pytest.raises(OSError, match=r"Timed out|closed|connect"):
            distributed.Client(address.replace("tls://", "tcp://"), timeout=2, set_as_default=False)
        own = psutil.Process()
        open_ports = [one.laddr for each in (own, *own.children(recursive=True)) for one in each.net_connections()
                      if one.status == psutil.CONN_LISTEN]  # fmt: skip
        assert {place.ip for place in open_ports} <= {"127.0.0.1", "::1"}
        with pytest.raises(urllib.error.HTTPError, match="404"):
            urllib.request.urlopen(engine._cluster.dashboard_link, timeout=10)
    finally:
        engine.close()


def test_a_cluster_that_goes_away_leaves_what_is_written(study, table, tmp_path):
    file = tmp_path / "scheduler.json"
    dask = [sys.executable, "-m", "dask"]
    scheduler = [*dask, "scheduler", "--port", "0", "--no-dashboard", "--host", "127.0.0.1", "--scheduler-file", file]
    with started(*scheduler) as child:
        child.until(lambda: file.exists() and file.read_text().strip().endswith("}"))
        address = json.loads(file.read_text())["address"]
        cluster = Workers("dask", cluster=address)
        with (
            started(*dask, "worker", address, "--nthreads", "1", "--no-dashboard"),
            pytest.raises(LostCluster, match="run the same command again"),
        ):
            sweep(study, tmp_path / "out", workers=cluster, on_progress=lambda _: child.send(signal.SIGKILL))
    made = []

    def counted(setting, task, watch=None):
        made.append(task.number)
        return run_task(setting, task, watch)

    again = sweep(study, tmp_path / "out", run=counted)
    assert 0 < len(made) < 6
    assert again.table.read_bytes() == table


def test_an_unreachable_cluster(study, tmp_path, monkeypatch):
    from paraflex.campaign import workers as engines

    monkeypatch.setattr(engines, "_REACHED_WITHIN", 1.0)
    with pytest.raises(InputError, match=r"--cluster: cannot be reached .*127.0.0.1:9.*; start it with dask scheduler"):
        sweep(study, tmp_path / "out", workers=Workers("dask", cluster="tcp://127.0.0.1:9"))
    # Without certificates Dask makes a client that cannot end.
    with pytest.raises(InputError, match=r"--cluster: cannot be reached \(TLS expects"):
        sweep(study, tmp_path / "out", workers=Workers("dask", cluster="tls://127.0.0.1:9"))


@pytest.mark.parametrize(
    ("asked", "says"),
    [
        ({"workers": Workers("dusk")}, "--engine: unknown engine"),
        ({"workers": 0}, "--workers: must be positive"),
        ({"workers": Workers(cluster="tcp://a:1")}, "--cluster: only the engine dask takes a cluster"),
        ({"workers": Workers("dask", 2, "tcp://a:1")}, "--workers: the cluster has workers of its own"),
        ({"limit": 0}, "--limit: must be positive"),
    ],
)
def test_bad_engines_say_what_to_do(study, tmp_path, asked, says):
    with pytest.raises(InputError, match=says):
        sweep(study, tmp_path / "out", **asked)


@pytest.mark.skipif(os.name != "posix", reason="Ctrl-C of a terminal as a signal")
def test_ctrl_c_keeps_what_is_done_and_says_how_to_go_on(study, tmp_path):
    file, out = tmp_path / "study.toml", tmp_path / "out"
    file.write_text(STUDY.replace("number = 6", "number = 4096"), encoding="utf-8")
    # Every row is written at once, not those of two seconds together.
    at_once = (
        "import runpy; from paraflex.campaign import journal; journal._SECONDS = 0.0; "
        "runpy.run_module('paraflex', run_name='__main__', alter_sys=True)"
    )
    with started(sys.executable, "-W", "error", "-c", at_once, "sweep", file, "--output", out) as child:
        child.until(lambda: rows_in(out))
        child.send(signal.SIGINT, group=True)
        done = child.end()
    assert done.returncode == 130
    assert "of 8192 runs:" in done.stdout
    assert "the same command continues from there" in done.stderr
    assert "Traceback" not in done.stderr
    assert 0 < len(pd.read_parquet(out / "unfinished.parquet")) < 8192


# --- Executors, and parts in processes of their own ----------------------------------------------------------------


@contextmanager
def changed_file(file, text):
    """A file with another text for a while."""
    whole = file.read_bytes()
    file.write_text(text, encoding="utf-8")
    yield
    file.write_bytes(whole)


def test_an_executor_of_ones_own_gives_the_same_table_and_lives_on(study, table, tmp_path):
    with ThreadPoolExecutor(2) as executor:
        found = sweep(study, tmp_path / "out", workers=Workers(executor))
        assert found.table.read_bytes() == table
        assert executor.submit(pow, 2, 3).result() == 8
    with pytest.raises(LostCluster, match="run the study again"):
        sweep(study, tmp_path / "shut", workers=Workers(executor))


def test_processes_of_an_executor_that_broke_are_named(study, tmp_path):
    with ProcessPoolExecutor(1, mp_context=get_context("spawn")) as executor:
        engine = open_engine(executor)
        assert engine.workers == 1
        with pytest.raises(LostCluster, match="executor no longer takes calls"):
            list(outcomes(engine, os._exit, [1]))


def test_shards_are_joined_to_the_same_table(study, table, tmp_path):
    folder = tmp_path / "out"
    first = sweep(study, folder, shard="1/4")
    assert (first.folder, first.total, first.complete) == (folder / "shard-1-of-4", 4, True)
    # One is left unfinished, one is not begun: what is missing is run when they are joined.
    sweep(study, folder, shard="2/4", limit=2)
    third = sweep(study, folder, shard="3/4")
    assert third.fresh == third.total == 2
    joined = sweep(study, folder)
    assert joined.table.read_bytes() == table
    assert joined.fresh == 12 - 4 - 2 - 2
    # More parts than tasks: some have nothing to do.
    assert sweep(study, tmp_path / "more", shard="8/8").complete


@pytest.mark.parametrize("shard", ["0/4", "5/4", "1", "1/0", "-1/4", "1/4/4", "", "one/two"])
def test_shards_that_are_none_are_refused(study, tmp_path, shard):
    with pytest.raises(InputError, match="--shard: not a part of a study"):
        sweep(study, tmp_path / "out", shard=shard)
    assert not (tmp_path / "out").exists()


@pytest.mark.parametrize("change", [("seed = 5", "seed = 6"), ("samples = 26", 'samples = 26\nmetrics = ["work"]')])
def test_shards_of_another_study_are_left_out(study, table, tmp_path, change):
    other = tmp_path / "other.toml"
    other.write_text(STUDY.replace(*change), encoding="utf-8")
    sweep(load_sweep(other), tmp_path / "out", shard="1/2")
    # A process that was killed at once, and something else of a similar name.
    (tmp_path / "out" / "shard-2-of-2").mkdir()
    with pytest.warns(ResultWarning, match="shard-1-of-2: of another study"):
        joined = sweep(study, tmp_path / "out")
    assert joined.fresh == joined.total
    assert joined.table.read_bytes() == table
    with pytest.raises(InputError, match="results of another study"):
        sweep(load_sweep(other), tmp_path / "out", shard="2/2")


def test_damaged_shards_are_named_with_what_helps(study, table, tmp_path):
    folder = tmp_path / "out"
    shard = sweep(study, folder, shard="2/3").folder
    with (
        changed_file(shard / "study.json", "{}"),
        pytest.raises(InputError, match="damaged, or of other results") as error,
    ):
        sweep(study, folder)
    assert error.value.remedy == f"run it again with --shard 2/3, or delete {shard}"
    journal = shard / "journal.sqlite"
    shard.joinpath("results.parquet").unlink()
    journal.write_bytes(journal.read_bytes().replace(b"complete", b"completE"))
    with pytest.raises(InputError, match="damaged") as error:
        sweep(study, folder)
    assert "--shard 2/3" in error.value.remedy
    shutil.rmtree(shard)
    assert sweep(study, folder).table.read_bytes() == table


def test_trajectories_of_shards_are_joined(tmp_path):
    file = tmp_path / "study.toml"
    file.write_text(STUDY.replace("samples = 26", "samples = 26\ntrajectories = true"), encoding="utf-8")
    first = sweep(load_sweep(file), tmp_path / "out", shard="1/2")
    joined = sweep(load_sweep(file), tmp_path / "out")
    kept = {each.name: each.read_bytes() for each in (first.folder / "trajectories").iterdir()}
    assert len(kept) == first.total
    assert joined.fresh == joined.total - first.total
    found = {each.name: each.read_bytes() for each in (tmp_path / "out" / "trajectories").iterdir()}
    assert len(found) == joined.total
    assert kept.items() <= found.items()


class KilledWorker(Exception):
    """What Dask raises for a call whose workers died."""


class Short(Engine):
    """Makes each call at once; those with an unlucky task among several others find their worker dead."""

    most = 16

    def __init__(self, unlucky):
        super().__init__(2)
        self.unlucky, self.calls = unlucky, []

    def submit(self, function, *arguments):
        self.calls.append(tuple(arguments[1]))
        future = Future()
        if self.unlucky in self.calls[-1]:
            future.set_exception(KilledWorker("it died"))
        else:
            future.set_result(function(*arguments))
        return future


def square(task):
    return task * task


def test_short_tasks_are_submitted_together():
    engine = Short(unlucky=None)
    assert dict(outcomes(engine, square, range(300))) == {k: k * k for k in range(300)}
    sizes = [len(call) for call in engine.calls]
    assert sizes[:4] == [1] * 4
    assert max(sizes) == engine.most
    assert sum(sizes) == 300


def test_only_the_task_that_kills_workers_is_lost_of_those_submitted_together():
    engine = Short(unlucky=200)
    found = dict(outcomes(engine, square, range(300)))
    assert isinstance(found.pop(200), LostWorker)
    assert found == {k: k * k for k in range(300) if k != 200}
    assert max(len(call) for call in engine.calls if 200 in call) > 1


def test_long_tasks_are_submitted_one_by_one():
    engine = Short(unlucky=None)
    dict(outcomes(engine, sleep_long, range(6)))
    assert [len(call) for call in engine.calls] == [1] * 6


def sleep_long(task):
    time.sleep(0.3)


@pytest.mark.parametrize("kept", [False, True])
def test_workers_that_dask_has_given_up_are_started_again(kept):
    """As after a death while it started: Dask closes the worker's supervisor, and may keep its name."""
    with open_engine("dask", 1) as engine:
        cluster = engine._cluster
        supervisor = cluster.workers[0] if kept else cluster.workers.pop(0)
        cluster.sync(supervisor.close)
        found = {}
        computing = threading.Thread(target=lambda: found.update(outcomes(engine, abs, [-3])), daemon=True)
        computing.start()
        computing.join(60.0)
        assert found == {-3: 3}


def test_a_cluster_whose_workers_die_while_it_starts_is_reported(monkeypatch):
    def dying(**_):
        raise RuntimeError("Nanny failed to start.")

    monkeypatch.setattr(distributed, "LocalCluster", dying)
    with pytest.raises(LostCluster, match=r"died while they started \(Nanny failed to start.\); run the same command"):
        open_engine("dask", 1)
