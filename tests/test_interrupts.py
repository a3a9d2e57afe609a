"""Signals end any command at any time with a line and its exit code; workers end with their parent."""

import importlib
import os
import re
import signal
import sys
import time

import pyarrow as pa
import pytest
import xarray as xr

from journals import rows_in
from paraflex.interrupts import uninterrupted
from paraflex.results.storage import write_results
from paraflex.results.tables import write_parquet
from processes import started, wait_until

if os.name != "posix":
    pytest.skip("signals", allow_module_level=True)
PARAFLEX = (sys.executable, "-m", "paraflex")
# A sweep that writes every row at once, not those of two seconds together: signals need not wait for it.
AT_ONCE = """
import runpy
from paraflex.campaign import journal
journal._SECONDS = 0.0
runpy.run_module("paraflex", run_name="__main__", alter_sys=True)
"""
SWEEP = (sys.executable, "-c", AT_ONCE, "sweep")
STUDY = """
mechanism = "raparm_i"
paths = ["line"]
modes = ["++++", "+-+-"]
duration = 0.05
samples = 26

[sampling]
kind = "sobol"
number = 8192
seed = 5

[integration]
method = "esdirk5"
tolerance = 1e-3

[vary.thickness]
fields = ["section.bar.thickness"]
low = 0.005
high = 0.007
"""
# A command that is still being imported, of which this says so.
IMPORTING = """
import sys
sys.argv = ["paraflex", "info"]
class Slow:
    def find_spec(self, name, *_):
        if name == "paraflex.cli.app":
            print("importing", flush=True)
            __import__("time").sleep(600)
sys.meta_path.insert(0, Slow())
from paraflex.__main__ import main
main()
"""
# What stands in for `paraflex info`: without all that the command imports.
ANSWER = """
import sys, types
def answer(work):
    sys.modules["paraflex.cli.inspect"] = types.SimpleNamespace(info_command=work)
"""
# One that imports while it works, and what it imports does not like to be left alone.
LATE = """
import sys
class Slow:
    def find_spec(self, name, *_):
        if name == "paraflex.not_there":
            print("importing", flush=True)
            try:
                __import__("time").sleep(0.5)
            except KeyboardInterrupt:
                print("cut short", flush=True)
                raise
            print("imported", flush=True)
sys.meta_path.insert(0, Slow())
def work(request):
    try:
        import paraflex.not_there
    except ImportError:
        pass
    __import__("time").sleep(600)
"""
# One in llvmlite, whose code must not be left with two owners.
OWNED = """
import sys
from llvmlite.binding import linker
class Source:
    def detach(self):
        print("owned", flush=True)
def link(*_):
    print("linking", flush=True)
    try:
        __import__("time").sleep(0.5)
    except KeyboardInterrupt:
        print("cut short", flush=True)
        raise
def work(request):
    lib = types.SimpleNamespace(LLVMPY_LinkModules=link)
    linker.ffi = types.SimpleNamespace(OutputString=__import__("contextlib").nullcontext, lib=lib)
    linker.link_modules(None, Source())
    __import__("time").sleep(600)
"""
# A library in which an interrupt is lost: nothing can be raised where an object goes.
LOST = """
import sys
class Gone:
    def __del__(self):
        print("going", flush=True)
        __import__("time").sleep(600)
def work(request):
    Gone()
    __import__("time").sleep(600)
"""
# One that makes an error of its own of an interrupt.
OTHER = """
import sys
def work(request):
    try:
        print("working", flush=True)
        __import__("time").sleep(600)
    except KeyboardInterrupt:
        raise ImportError("a library was left half imported")
"""
# One that was interrupted when its numbers were written.
WRITTEN = """
import sys
def work(request):
    try:
        print("drawing", flush=True)
        __import__("time").sleep(600)
    except KeyboardInterrupt as interrupt:
        interrupt.args = ("the numbers are in out",)
        raise
"""
# What all of them end with.
CALLED = """
answer(work)
sys.argv = ["paraflex", "info"]
from paraflex.__main__ import main
main()
"""
ENDING = [(signal.SIGINT, 130), (signal.SIGTERM, 143), (signal.SIGHUP, 129)]


@pytest.fixture
def study(tmp_path):
    file = tmp_path / "study.toml"
    file.write_text(STUDY, encoding="utf-8")
    return file


# Workers are kept from SIGINT and SIGHUP by one mask, which SIGTERM passes; of threads `test_sweep_engines` has Ctrl-C.
@pytest.mark.parametrize(
    ("engine", "workers", "number"),
    [
        ("threads", 2, signal.SIGHUP),
        ("processes", 1, signal.SIGHUP),
        ("processes", 2, signal.SIGTERM),
        ("dask", 1, signal.SIGINT),
        ("dask", 2, signal.SIGTERM),
    ],
)
def test_a_sweep_ends_with_its_rows_and_all_its_processes(study, tmp_path, engine, workers, number):
    out = tmp_path / "out"
    with started(*SWEEP, study, "--output", out, "--engine", engine, "--workers", workers) as child:
        child.until(lambda: rows_in(out))
        child.send(number, group=True)
        done = child.end()
        wait_until(lambda: not child.descendants(), within=30.0, what="the end of workers")
    assert done.returncode == 128 + number, done.stderr
    assert "interrupted; " in done.stderr
    assert "the same command continues from there" in done.stderr
    assert "Traceback" not in done.stderr
    assert "resource_tracker" not in done.stderr
    assert rows_in(out) > 0


@pytest.mark.parametrize("engine", ["processes", "dask"])
def test_workers_end_with_a_parent_that_was_killed(study, tmp_path, engine):
    """Each sees to it by itself: one is enough, beside the process that keeps count of locks."""
    out = tmp_path / "out"
    with started(*SWEEP, study, "--output", out, "--engine", engine, "--workers", 1) as child:
        child.until(lambda: rows_in(out))
        assert len(child.descendants()) >= 2
        child.send(signal.SIGKILL)
        child.end()
        wait_until(lambda: not child.descendants(), within=30.0, what="the end of workers")
        assert "Traceback" not in child.err


# SIGINT and SIGHUP are one case here: the same mask keeps both from the processes.
@pytest.mark.parametrize(("number", "code"), [*ENDING[:2], (signal.SIGKILL, -9)])
def test_processes_that_compile_end_with_the_command(tmp_path, number, code):
    kernels = {"NUMBA_CACHE_DIR": str(tmp_path / "kernels")}
    with started(*PARAFLEX, "run", "raparm_i", "--out", tmp_path / "out", env=kernels) as child:
        child.until(lambda: len(child.descendants()) >= 2)
        child.send(number, group=number != signal.SIGKILL)
        done = child.end()
        wait_until(lambda: not child.descendants(), within=30.0, what="the end of compiling")
        done.stderr = child.err
    assert done.returncode == code
    assert "Traceback" not in done.stderr
    if code > 0:
        assert done.stderr.splitlines()[-1] == "interrupted; the same command starts over"


@pytest.mark.parametrize(("number", "code"), ENDING)
def test_imports_before_the_command_begins_end_at_once(number, code):
    with started(sys.executable, "-c", IMPORTING) as child:
        child.until(lambda: "importing" in child.out)
        child.send(number)
        done = child.end()
    assert (done.returncode, done.stderr) == (code, "interrupted\n")


@pytest.mark.parametrize(
    ("script", "when", "last"),
    [
        (LATE, "importing", "imported"),
        (OWNED, "linking", "owned"),
        (LOST, "going", "going"),
        (OTHER, "working", "working"),
    ],
)
def test_libraries_do_not_keep_a_command_from_ending(script, when, last):
    with started(sys.executable, "-c", ANSWER + script + CALLED) as child:
        child.until(lambda: when in child.out)
        child.send(signal.SIGTERM)
        done = child.end()
    assert (done.returncode, done.stderr) == (143, "interrupted; the same command starts over\n")
    # An import is brought to its end: half of one can be neither used nor begun again.
    assert done.stdout.split()[-1] == last


def test_a_command_says_where_its_numbers_are():
    with started(sys.executable, "-c", ANSWER + WRITTEN + CALLED) as child:
        child.until(lambda: "drawing" in child.out)
        child.send(signal.SIGINT)
        done = child.end()
    assert (done.returncode, done.stderr) == (130, "interrupted: the numbers are in out\n")


@pytest.mark.parametrize("after", [0.05, 0.2, 0.5, 1.0, 2.0])
def test_a_signal_at_any_time_is_one_line(study, tmp_path, after):
    """Once Python itself has started, which takes a few hundredths of a second."""
    with started(*PARAFLEX, "sweep", study, "--output", tmp_path / "out") as child:
        child.until(lambda: child.process.poll() is None and sys_modules_are_loaded(child.process.pid))
        time.sleep(after)
        child.send(signal.SIGINT)
        done = child.end()
    assert done.returncode == 130
    assert "Traceback" not in done.stderr
    assert "interrupted" in done.stderr


def sys_modules_are_loaded(pid):
    """Whether a process answers SIGTERM itself, as the command does from its first line on."""
    with open(f"/proc/{pid}/status", encoding="ascii") as status:
        caught = int(re.search(r"SigCgt:\s*([0-9a-f]+)", status.read())[1], 16)
    return bool(caught >> (signal.SIGTERM - 1) & 1)


def test_nohup_is_respected(study, tmp_path):
    """A signal that is ignored when the command starts is ignored by it."""
    deaf = (
        "import os, signal, sys; signal.signal(signal.SIGHUP, signal.SIG_IGN); os.execv(sys.executable, sys.argv[1:])"
    )
    out = tmp_path / "out"
    with started(sys.executable, "-c", deaf, *SWEEP, study, "--output", out, "--limit", 8, "--no-report") as child:
        child.until(lambda: rows_in(out))
        child.send(signal.SIGHUP)
        assert child.end().returncode == 0
    assert rows_in(out) == 8


def test_what_must_not_be_interrupted_is_not():
    done = []

    def work():
        with uninterrupted() as arrived:
            signal.raise_signal(signal.SIGINT)
            signal.raise_signal(signal.SIGINT)
            done.append(len(arrived))

    with pytest.raises(KeyboardInterrupt):
        work()
    assert done == [2]
    assert signal.getsignal(signal.SIGINT) is signal.default_int_handler


@pytest.mark.parametrize(
    ("library", "name", "write"),
    [
        ("xarray.Dataset", "to_netcdf", lambda file: write_results(xr.Dataset({"a": ("x", [1.0])}), file)),
        ("pyarrow.parquet.ParquetWriter", "write_table", lambda file: write_parquet(pa.table({"a": [1.0]}), file)),
        ("pyarrow.parquet.ParquetWriter", "close", lambda file: write_parquet(pa.table({"a": [1.0]}), file)),
    ],
)
def test_signals_wait_until_numbers_are_written(tmp_path, monkeypatch, library, name, write):
    """Libraries take locks in Python, which an exception between would leave taken for ever."""
    place, _, kind = library.rpartition(".")
    owner = getattr(importlib.import_module(place), kind)
    plain, ended = getattr(owner, name), []

    def interrupted(*arguments, **options):
        signal.raise_signal(signal.SIGINT)
        plain(*arguments, **options)
        ended.append(1)

    monkeypatch.setattr(owner, name, interrupted)
    with pytest.raises(KeyboardInterrupt):
        write(tmp_path / "file")
    assert ended
    assert not list(tmp_path.iterdir())
