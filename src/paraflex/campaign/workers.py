"""Who computes: threads of this process, other processes, or the workers of a Dask cluster.

Each runs any function of a task, and what comes back does not depend on which of them it was.
"""

from __future__ import annotations

import logging
import math
import multiprocessing
import os
import sys
import threading
import time
from collections.abc import Callable, Iterable, Iterator
from concurrent.futures import (
    BrokenExecutor,
    CancelledError,
    Future,
    ProcessPoolExecutor,
    ThreadPoolExecutor,
)
from importlib import import_module
from itertools import islice
from typing import Any, TypeVar

from paraflex.errors import InputError, ParaflexError, suggestion
from paraflex.interrupts import Calls, end_with_parent, starting_processes, uninterrupted

THREADS = "threads"
PROCESSES = "processes"
DASK = "dask"
WORKER_ENGINES = (THREADS, PROCESSES, DASK)
# Tasks given out for each worker: one it works on and one that waits, so that memory does not grow with the sweep.
_AHEAD = 2
# Workers that may die of a task that has one to itself before it is given up.
_DEATHS = 2
# Seconds in which a scheduler must answer, and between two counts of a cluster's workers.
_REACHED_WITHIN, _RECOUNT = 10.0, 5.0
_GONE = "the cluster no longer answers; run the same command again: it goes on from there"
# How long a thread waits for another's Python before it asks for its turn [s]: runs leave Python and come back often.
_SWITCH = 2e-4

T = TypeVar("T")
R = TypeVar("R")


class LostWorker(ParaflexError):
    """Every worker that took a task died."""


class LostCluster(ParaflexError):
    """The cluster went away; what is written stays."""


class Engine:
    """Takes calls and gives futures for them; itself from a pool of this machine.

    As a context it is closed at the end, and its workers do not finish what they have if that was an error or Ctrl-C.
    """

    _pool: Any

    def __init__(self, workers: int) -> None:
        self._workers = workers

    def __enter__(self) -> Engine:
        return self

    def __exit__(self, kind: type[BaseException] | None, *_: object) -> None:
        self.close(abandon=kind is not None)

    @property
    def workers(self) -> int:
        """How many tasks run at once."""
        return self._workers

    def submit(self, function: Callable[..., Any], *arguments: Any) -> Future[Any]:
        """Call a function with arguments elsewhere."""
        return self._pool.submit(function, *arguments)

    def restart(self) -> None:
        """Be ready again after a worker died and took the others with it."""

    def close(self, *, abandon: bool = False) -> None:
        """Let go of the workers; abandon tells them not to finish what they have."""
        self._pool.shutdown(cancel_futures=True)


class Threads(Engine):
    """Threads of this process: the kernels release the GIL."""

    def __init__(self, workers: int) -> None:
        super().__init__(workers)
        self._stop = threading.Event()
        self._pool = ThreadPoolExecutor(workers)
        self._switching = sys.getswitchinterval()
        sys.setswitchinterval(_SWITCH)

    def submit(self, function: Callable[..., Any], *arguments: Any) -> Future[Any]:
        """See `Engine`; the function is given what it tells the time reached, too."""
        return super().submit(function, *arguments, self._watch)

    def close(self, *, abandon: bool = False) -> None:
        """See `Engine`."""
        if abandon:
            self._stop.set()
        with uninterrupted():
            self._pool.shutdown(wait=False, cancel_futures=True)
        self._pool.shutdown()
        sys.setswitchinterval(self._switching)

    def _watch(self, _: float) -> None:
        if self._stop.is_set():
            raise KeyboardInterrupt


class Processes(Engine):
    """Processes on this machine."""

    def __init__(self, workers: int) -> None:
        super().__init__(workers)
        self._pool = self._start()

    def submit(self, function: Callable[..., Any], *arguments: Any) -> Future[Any]:
        """See `Engine`; processes are started here."""
        with starting_processes():
            return super().submit(function, *arguments)

    def restart(self) -> None:
        """See `Engine`."""
        self._pool.shutdown(wait=False, cancel_futures=True)
        self._pool = self._start()

    def close(self, *, abandon: bool = False) -> None:
        """See `Engine`."""
        if not abandon:
            super().close()
            return
        for process in list((self._pool._processes or {}).values()):
            process.kill()
        # Threads of the pool may wait for ever for workers that are gone.
        self._pool.shutdown(wait=False, cancel_futures=True)

    def _start(self) -> ProcessPoolExecutor:
        # Not forked: threads of this process may hold locks.
        context = multiprocessing.get_context("spawn")
        with starting_processes():
            # It starts one that keeps count of locks.
            return ProcessPoolExecutor(self.workers, mp_context=context, initializer=end_with_parent)


class Dask(Engine):
    """Workers of a Dask cluster, which gives the tasks of one that died to others."""

    def __init__(self, workers: int, address: str | None) -> None:
        super().__init__(1)
        try:
            distributed: Any = import_module("distributed")
        except ImportError:
            remedy = "pip install 'paraflex[cluster]'"
            raise InputError("Dask is not installed", field="--engine", value=DASK, remedy=remedy) from None
        self._cluster = None
        if address is None:
            # Only this process has the keys, and no port shows what runs.
            alone = {"security": distributed.Security.temporary(), "protocol": "tls://", "host": "127.0.0.1",
                     "dashboard_address": "127.0.0.1:0", "worker_dashboard_address": None,
                     "scheduler_kwargs": {"dashboard": False}, "silence_logs": logging.CRITICAL}  # fmt: skip
            silent = {f"distributed.{each}.http.routes": [] for each in ("scheduler", "worker")}
            with import_module("dask").config.set(silent):
                self._cluster = _apart(
                    lambda: distributed.LocalCluster(n_workers=workers, threads_per_worker=1, **alone)
                )
        try:
            if address is not None:
                _apart(lambda: _reach(address))  # a notebook has a loop of its own
            self._client = distributed.Client(address or self._cluster, timeout=_REACHED_WITHIN, set_as_default=False)
        except (OSError, ValueError, TypeError) as error:
            reason = str(error).partition("\n")[0] or type(error).__name__
            remedy = "start it with dask scheduler, and give the address it prints"
            raise InputError(f"cannot be reached ({reason})", field="--cluster", value=address, remedy=remedy) from None
        self._pool = self._client.get_executor(pure=False)
        self._counted = -math.inf

    @property
    def workers(self) -> int:
        """See `Engine`; workers may come and go."""
        now = time.monotonic()
        if now - self._counted > _RECOUNT:
            try:
                self._counted, self._workers = now, max(1, sum(self._client.nthreads().values()))
            except OSError:
                raise LostCluster(_GONE) from None
        return self._workers

    def restart(self) -> None:
        """See `Engine`."""
        raise LostCluster(_GONE)

    def close(self, *, abandon: bool = False) -> None:
        """See `Engine`; workers of our own that are told to stop need seconds for it, which nobody waits for."""
        if abandon and self._cluster is not None:
            # Its end takes back that its logs are silent, while connections still break off.
            logging.getLogger("distributed").setLevel(logging.CRITICAL)
            threading.Thread(target=self._let_go, args=[True], daemon=True).start()
        else:
            self._let_go(abandon)

    def _let_go(self, abandon: bool) -> None:
        self._pool.shutdown(wait=not abandon)
        self._client.close(timeout=5)
        if self._cluster is not None:
            self._cluster.close(timeout=5)


def _reach(address: str) -> None:
    """Connect to a scheduler: a client that cannot would wait long for its own end, and complain."""
    import asyncio

    from distributed import Security
    from distributed.comm.core import connect

    async def reach() -> None:
        comm = await connect(address, timeout=_REACHED_WITHIN, **Security().get_connection_args("client"))
        comm.abort()

    asyncio.run(reach())


def open_engine(engine: str | Engine, workers: int | None = None, cluster: str | None = None) -> Engine:
    """An engine by name.

    Parameters
    ----------
    engine : str or Engine
        "threads", "processes" or "dask"; an engine is given back.
    workers : int, optional
        As many as there are processors by default.
    cluster : str, optional
        Address of a Dask scheduler, "tcp://host:8786"; a cluster on this machine by default.

    Raises
    ------
    InputError
        Unknown name, no workers, a cluster that does not answer, or a package that is missing.
    """
    if isinstance(engine, Engine):
        return engine
    if engine not in WORKER_ENGINES:
        raise InputError("unknown engine", field="--engine", value=engine, remedy=suggestion(engine, WORKER_ENGINES))
    if cluster is not None and engine != DASK:
        remedy = "say --engine dask, or leave it out"
        raise InputError("only the engine dask takes a cluster", field="--cluster", value=cluster, remedy=remedy)
    if cluster is not None and workers is not None:
        remedy = "leave it out with --cluster"
        raise InputError("the cluster has workers of its own", field="--workers", value=workers, remedy=remedy)
    if workers is not None and workers < 1:
        raise InputError("must be positive", field="--workers", value=workers, remedy="say 2")
    # Those this process may use, not all the machine has: batch systems give out a part.
    own = len(os.sched_getaffinity(0)) if hasattr(os, "sched_getaffinity") else os.cpu_count()
    count = workers or own or 1
    if engine == THREADS:
        return Threads(count)
    return Processes(count) if engine == PROCESSES else Dask(count, cluster)


def outcomes(engine: Engine, function: Callable[..., R], tasks: Iterable[T]) -> Iterator[tuple[T, R | LostWorker]]:
    """Results of a function for all tasks, as they come; no more tasks are given out than workers can soon take.

    Parameters
    ----------
    engine : Engine
    function : callable
        Of a task; from threads, of a task and of what is told the time reached.
    tasks : iterable
        Taken from as workers become free.

    Yields
    ------
    task, result
        The result is a LostWorker where every worker that took the task died.
    """
    waiting, running, calls = iter(tasks), {}, Calls()
    while True:
        more = islice(waiting, max(0, _AHEAD * engine.workers - len(running)))
        running |= {calls.hand(_submit, engine, function, task): task for task in more}
        if not running:
            return
        done = calls.done()
        suspects = []
        # In the order they were given out, which a set has not.
        for future in [each for each in running if each in done]:
            task = running.pop(future)
            try:
                result = future.result()
            except (BrokenExecutor, CancelledError):
                suspects.append(task)
                continue
            except Exception as error:
                # Dask gives a task up because its workers died.
                if type(error).__name__ != "KilledWorker":
                    raise
                result = LostWorker(f"every worker that took it died: {error}")
            yield task, result
        if suspects:
            suspects += running.values()
            running = {}
            engine.restart()
            yield from _one_by_one(engine, function, suspects)


def _one_by_one(engine: Engine, function: Callable[..., R], tasks: list[T]) -> Iterator[tuple[T, R | LostWorker]]:
    """Results of tasks of which one killed a worker: each alone, so that only that one is given up."""
    calls = Calls()
    for task in tasks:
        result: R | LostWorker = LostWorker(f"{_DEATHS + 1} workers died of it: out of memory, or killed")
        for _ in range(_DEATHS):
            future = calls.hand(_submit, engine, function, task)
            while future not in calls.done():
                pass
            try:
                result = future.result()
                break
            except (BrokenExecutor, CancelledError):
                engine.restart()
        yield task, result


def _apart(start: Callable[[], T]) -> T:
    """What a function gives that starts processes for seconds: in a thread, which Ctrl-C does not wait for."""
    started: Future[T] = Future()

    def run() -> None:
        with starting_processes():
            try:
                started.set_result(start())
            except BaseException as error:
                started.set_exception(error)

    threading.Thread(target=run, daemon=True).start()
    return started.result()


def _submit(engine: Engine, function: Callable[..., Any], task: object) -> Future[Any]:
    try:
        return engine.submit(function, task)
    except BrokenExecutor as error:
        broken: Future[Any] = Future()
        broken.set_exception(error)
        return broken
