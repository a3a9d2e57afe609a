"""Workers: threads of this process, other processes, or the workers of a Dask cluster.

All of them run any function of a task, and the results do not depend on the kind of workers.
"""

import logging
import math
import multiprocessing
import os
import sys
import threading
import time
from collections.abc import Callable, Iterable, Iterator, Sequence
from concurrent.futures import BrokenExecutor, CancelledError, Executor, Future, ProcessPoolExecutor, ThreadPoolExecutor
from contextlib import contextmanager, suppress
from importlib import import_module
from itertools import chain, islice
from queue import Empty, SimpleQueue
from typing import Any, TypeVar

from paraflex.errors import InputError, ParaflexError, optional_package, suggestion
from paraflex.interrupts import end_with_parent, starting_processes, uninterrupted

THREADS = "threads"
PROCESSES = "processes"
DASK = "dask"
WORKER_ENGINES = (THREADS, PROCESSES, DASK)
# Tasks submitted per worker, one running and one waiting, so that memory does not grow with the number of tasks.
_AHEAD = 2
# Duration of the calls in which short tasks are submitted together, where a call is costly [s].
_BUNDLE = 0.5
# Number of workers that a task, run alone, may kill before it is given up.
_DEATHS = 2
# Time limit for the answer of a scheduler, and interval between two counts of a cluster's workers [s].
_REACHED_WITHIN, _RECOUNT = 10.0, 5.0
_GONE = "the cluster no longer answers; run the same command again: it goes on from there"
_ENDED = "the executor no longer takes calls; run the study again with a new one: it goes on from there"
# Switch interval of Python's threads [s], short because runs release the GIL and request it again often.
_SWITCH = 2e-4
_shared: list[Callable[[], object]] = []  # Calls of `share_out`, for copies of this process.

T = TypeVar("T")
R = TypeVar("R")


class Calls:
    """Calls submitted to a pool of threads or processes by a thread that signals may interrupt at any time.

    Pools and futures acquire their locks in Python code. An exception raised there by a signal handler would leave a
    lock acquired, and the workers and their caller would wait for ever. Signals are therefore deferred while a call is
    submitted, and results are awaited with a queue that does not leave its lock acquired.
    """

    def __init__(self) -> None:
        self._done: SimpleQueue[Future[Any]] = SimpleQueue()

    def submit(self, submit: Callable[..., Future[Any]], *arguments: Any) -> Future[Any]:
        """Submit a call with signals deferred, and return the future that `submit` returns."""
        with uninterrupted():
            future = submit(*arguments)
            future.add_done_callback(self._done.put)
        return future

    def done(self) -> set[Future[Any]]:
        """Return the futures that ended since the last call; wait at most 1 s for one, so that Ctrl-C gets through."""
        ended = set()
        with suppress(Empty):
            ended.add(self._done.get(timeout=1.0))
            while True:
                ended.add(self._done.get_nowait())
        return ended


class LostWorker(ParaflexError):
    """Error of a task whose workers all died."""


class LostCluster(ParaflexError):
    """Error raised if the cluster no longer answers; results written before are kept."""


class Engine:
    """Executor of function calls, which returns futures; base class for pools of this machine and for clusters.

    As a context manager it is closed at the end. After an error or Ctrl-C, the workers do not finish their tasks.

    Attributes
    ----------
    most : int
        Largest number of tasks in a call.
    """

    most = 1
    _pool: Any

    def __init__(self, workers: int) -> None:
        self._workers = workers

    def __enter__(self) -> "Engine":
        return self

    def __exit__(self, kind: type[BaseException] | None, *_: object) -> None:
        self.close(abandon=kind is not None)

    @property
    def workers(self) -> int:
        """Number of tasks that run at once."""
        return self._workers

    def submit(self, function: Callable[..., Any], *arguments: Any) -> Future[Any]:
        """Submit a function call to the workers, and return its future."""
        return self._pool.submit(function, *arguments)

    def restart(self) -> None:
        """Restart the pool after the death of a worker has broken it."""

    def close(self, *, abandon: bool = False) -> None:
        """Shut down the workers; if `abandon` is True, they do not finish their tasks."""
        self._pool.shutdown(cancel_futures=True)


class Threads(Engine):
    """Threads of this process, which run in parallel because the kernels release the GIL."""

    def __init__(self, workers: int) -> None:
        super().__init__(workers)
        self._stop = threading.Event()
        self._pool = ThreadPoolExecutor(workers)
        self._switching = sys.getswitchinterval()
        sys.setswitchinterval(_SWITCH)

    def submit(self, function: Callable[..., Any], *arguments: Any) -> Future[Any]:
        """Submit a function call; see `Engine`. Its last argument is a callable that takes the time reached [s]."""
        return super().submit(function, *arguments, self._watch)

    def close(self, *, abandon: bool = False) -> None:
        """Shut down the workers; see `Engine`."""
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
    """Processes on this machine, spawned or, if `copies` is True, forked."""

    def __init__(self, workers: int, *, copies: bool = False) -> None:
        super().__init__(workers)
        self._method = "fork" if copies else "spawn"
        self._pool = self._start()

    def submit(self, function: Callable[..., Any], *arguments: Any) -> Future[Any]:
        """Submit a function call; see `Engine`. Processes are started at the first calls."""
        with starting_processes():
            return super().submit(function, *arguments)

    def restart(self) -> None:
        """Restart the pool; see `Engine`."""
        self._pool.shutdown(wait=False, cancel_futures=True)
        self._pool = self._start()

    def close(self, *, abandon: bool = False) -> None:
        """Shut down the workers; see `Engine`."""
        if not abandon:
            super().close()
            return
        for process in list((self._pool._processes or {}).values()):
            process.kill()
        # The shutdown does not wait, because threads of the pool may wait forever for workers that were killed.
        self._pool.shutdown(wait=False, cancel_futures=True)

    def _start(self) -> ProcessPoolExecutor:
        context = multiprocessing.get_context(self._method)
        with starting_processes():
            # The constructor starts a process that tracks locks.
            return ProcessPoolExecutor(self.workers, mp_context=context, initializer=end_with_parent)


class Dask(Engine):
    """Workers of a Dask cluster, which reassigns the tasks of a worker that died."""

    most = 256

    def __init__(self, workers: int, address: str | None) -> None:
        super().__init__(1)
        remedy = "pip install 'paraflex[cluster]'"
        with optional_package("Dask is not installed", field="--engine", value=DASK, remedy=remedy):
            distributed: Any = import_module("distributed")
        self._cluster: Any = None
        self._started = workers
        if address is None:
            # Only this process has the TLS keys, and no dashboard port is open.
            alone = {"security": distributed.Security.temporary(), "protocol": "tls://", "host": "127.0.0.1",
                     "dashboard_address": "127.0.0.1:0", "worker_dashboard_address": None,
                     "scheduler_kwargs": {"dashboard": False}, "silence_logs": logging.CRITICAL}  # fmt: skip
            silent = {f"distributed.{each}.http.routes": [] for each in ("scheduler", "worker")}
            try:
                with import_module("dask").config.set(silent):
                    self._cluster = _apart(
                        lambda: distributed.LocalCluster(n_workers=workers, threads_per_worker=1, **alone)
                    )
            except RuntimeError as error:
                raise LostCluster(f"workers died while they started ({error}); run the same command again") from None
        try:
            if address is not None:
                _apart(lambda: _reach(address))  # in a thread, because a notebook has an event loop of its own
            self._client = distributed.Client(address or self._cluster, timeout=_REACHED_WITHIN, set_as_default=False)
        except (OSError, ValueError, TypeError) as error:
            reason = str(error).partition("\n")[0] or type(error).__name__
            remedy = "start it with dask scheduler, and give the address it prints"
            raise InputError(f"cannot be reached ({reason})", field="--cluster", value=address, remedy=remedy) from None
        self._pool = self._client.get_executor(pure=False)
        self._counted = -math.inf

    @property
    def workers(self) -> int:
        """Number of tasks that run at once, counted anew at intervals because workers may come and go."""
        now = time.monotonic()
        if now - self._counted > _RECOUNT:
            try:
                self._counted, self._workers = now, sum(self._client.nthreads().values())
            except OSError:
                raise LostCluster(_GONE) from None
            if self._cluster is not None and self._workers < self._started:
                self._restore()
        return max(1, self._workers)

    def _restore(self) -> None:
        """Start workers of the own cluster that Dask has given up, because they died while they started."""
        for name, worker in list(self._cluster.workers.items()):
            if worker.status.name in ("failed", "closed"):
                self._cluster.workers.pop(name, None)
        self._cluster.scale(self._started)

    def restart(self) -> None:
        """Raise `LostCluster`: broken or cancelled calls mean that the cluster no longer answers."""
        raise LostCluster(_GONE)

    def close(self, *, abandon: bool = False) -> None:
        """Shut down the workers; see `Engine`. An abandoned local cluster takes seconds and is closed in a thread."""
        if abandon and self._cluster is not None:
            # Closing the cluster re-enables its logs while connections are still being broken off.
            logging.getLogger("distributed").setLevel(logging.CRITICAL)
            threading.Thread(target=self._release, args=[True], daemon=True).start()
        else:
            self._release(abandon)

    def _release(self, abandon: bool) -> None:
        self._pool.shutdown(wait=not abandon)
        self._client.close(timeout=5)
        if self._cluster is not None:
            self._cluster.close(timeout=5)


class Given(Engine):
    """Executor of the user, which is not shut down; calls that have not begun are cancelled at the end."""

    def __init__(self, executor: Executor, workers: int) -> None:
        super().__init__(workers)
        self._pool, self._calls = executor, set[Future[Any]]()

    def submit(self, function: Callable[..., Any], *arguments: Any) -> Future[Any]:
        """Submit a function call; see `Engine`."""
        try:
            call = super().submit(function, *arguments)
        except RuntimeError:
            # It is broken, or was shut down.
            raise LostCluster(_ENDED) from None
        self._calls.add(call)
        call.add_done_callback(self._calls.discard)
        return call

    def restart(self) -> None:
        """Raise `LostCluster`: an executor that is broken cannot be restarted here."""
        raise LostCluster(_ENDED)

    def close(self, *, abandon: bool = False) -> None:
        """Cancel the calls that have not begun."""
        for call in list(self._calls):
            call.cancel()


def _reach(address: str) -> None:
    """Check that a scheduler can be reached; a client that cannot connect closes slowly and logs errors."""
    import asyncio

    from distributed import Security
    from distributed.comm.core import connect

    async def reach() -> None:
        comm = await connect(address, timeout=_REACHED_WITHIN, **Security().get_connection_args("client"))
        comm.abort()

    asyncio.run(reach())


def open_engine(engine: str | Engine | Executor, workers: int | None = None, cluster: str | None = None) -> Engine:
    """Start an engine by name.

    Parameters
    ----------
    engine : str, Engine or Executor
        Name of the engine: "threads", "processes" or "dask"; or an executor. An Engine is returned unchanged.
    workers : int, optional
        Number of workers; by default the executor's, or the number of processors available to this process.
    cluster : str, optional
        Address of a Dask scheduler, "tcp://host:8786"; by default a cluster is started on this machine.

    Raises
    ------
    InputError
        Unknown name, number of workers below one, incompatible arguments, cluster that does not answer, or missing
        package.
    """
    if isinstance(engine, Engine):
        return engine
    if not isinstance(engine, Executor) and engine not in WORKER_ENGINES:
        raise InputError("unknown engine", field="--engine", value=engine, remedy=suggestion(engine, WORKER_ENGINES))
    if cluster is not None and engine != DASK:
        remedy = "write --engine dask, or leave it out"
        raise InputError("only the engine dask takes a cluster", field="--cluster", value=cluster, remedy=remedy)
    if cluster is not None and workers is not None:
        remedy = "leave it out with --cluster"
        raise InputError("the cluster has workers of its own", field="--workers", value=workers, remedy=remedy)
    if workers is not None and workers < 1:
        raise InputError("must be positive", field="--workers", value=workers, remedy="give 2")
    count = workers or getattr(engine, "_max_workers", None) or _processors()
    if isinstance(engine, Executor):
        return Given(engine, count)
    if engine == THREADS:
        return Threads(count)
    return Processes(count) if engine == PROCESSES else Dask(count, cluster)


def _processors() -> int:
    """Return the number of processors that this process may use: batch systems assign only a part of the machine."""
    return len(os.sched_getaffinity(0)) if hasattr(os, "sched_getaffinity") else os.cpu_count() or 1


def outcomes(engine: Engine, function: Callable[..., R], tasks: Iterable[T]) -> Iterator[tuple[T, R | LostWorker]]:
    """Yield the results of a function for all tasks in order of completion.

    Parameters
    ----------
    engine : Engine
        Workers.
    function : callable
        Function of a task. In threads it receives a second argument, a callable to report the time reached.
    tasks : iterable
        Tasks; they are drawn from the iterable as workers become free.

    Yields
    ------
    task, result
        Task and its result, which is a LostWorker if every worker that ran the task died.
    """
    waiting, calls, size = iter(tasks), Calls(), 1
    running: dict[Future[Any], tuple[T, ...]] = {}
    while True:
        while len(running) < _AHEAD * engine.workers and (bundle := tuple(islice(waiting, size))):
            running[calls.submit(_submit, engine, _each, function, bundle)] = bundle
        if not running:
            return
        done = calls.done()
        suspects: list[T] = []
        # Futures are processed in the order of submission, which the set `done` does not keep.
        for future in [each for each in running if each in done]:
            bundle = running.pop(future)
            try:
                seconds, results = future.result()
            except (BrokenExecutor, CancelledError):
                suspects += bundle
                continue
            except Exception as error:
                # Dask gives up a call after several of its workers have died.
                if type(error).__name__ != "KilledWorker":
                    raise
                lost = LostWorker(f"every worker that took it died: {error}")
                yield from outcomes(engine, function, bundle) if len(bundle) > 1 else ((task, lost) for task in bundle)
                continue
            yield from zip(bundle, results, strict=True)
            size = max(1, min(2 * len(bundle), engine.most, int(_BUNDLE * len(bundle) / seconds)))
        if suspects:
            suspects += chain.from_iterable(running.values())
            running = {}
            engine.restart()
            yield from _one_by_one(engine, function, suspects)


def _each(function: Callable[..., R], tasks: Iterable[T], *more: object) -> tuple[float, list[R]]:
    """Return the time that a function takes for several tasks [s], and its results."""
    began = time.perf_counter()
    results = [function(task, *more) for task in tasks]
    return max(time.perf_counter() - began, 1e-9), results


def share_out(calls: Sequence[Callable[[], object]]) -> None:
    """Make independent calls that write files, in forked copies of this process unless it has several threads."""
    with sharing_out(calls) as finish:
        finish()


@contextmanager
def sharing_out(calls: Sequence[Callable[[], object]]) -> Iterator[Callable[[], None]]:
    """Make calls as `share_out` does while the block runs, which calls the function yielded to wait for them."""
    left = set(range(len(calls)))

    def make() -> None:
        for k in sorted(left):
            calls[k]()

    # Threads may hold locks, and libraries of macOS do not survive a fork.
    if len(calls) < 2 or sys.platform != "linux" or threading.active_count() > 1:
        yield make
        return
    _shared[:], watched = calls, Calls()
    with Processes(min(len(calls), _processors()), copies=True) as engine:
        number = {watched.submit(_submit, engine, _make, k): k for k in left}

        def finish() -> None:
            while not all(one.done() for one in number):
                watched.done()
            left.difference_update(k for one, k in number.items() if not one.exception() and one.result())
            make()

        yield finish
    _shared.clear()


def _make(k: int) -> bool:
    """Make a shared call in a copy of this process; if it fails, this process makes it again and raises its error."""
    with suppress(Exception):
        _shared[k]()
        return True
    return False


def _one_by_one(engine: Engine, function: Callable[..., R], tasks: list[T]) -> Iterator[tuple[T, R | LostWorker]]:
    """Run tasks one at a time after one of them killed a worker, so that only that task is given up."""
    calls = Calls()
    for task in tasks:
        result: R | LostWorker = LostWorker(f"{_DEATHS + 1} workers died running it: out of memory, or killed")
        for _ in range(_DEATHS):
            future = calls.submit(_submit, engine, function, task)
            while future not in calls.done():
                pass
            try:
                result = future.result()
                break
            except (BrokenExecutor, CancelledError):
                engine.restart()
        yield task, result


def _apart(start: Callable[[], T]) -> T:
    """Call a function that starts processes in a thread, so that Ctrl-C need not wait for it, and return its result."""
    started: Future[T] = Future()

    def run() -> None:
        with starting_processes():
            try:
                started.set_result(start())
            except BaseException as error:
                started.set_exception(error)

    threading.Thread(target=run, daemon=True).start()
    return started.result()


def _submit(engine: Engine, function: Callable[..., Any], *arguments: object) -> Future[Any]:
    try:
        return engine.submit(function, *arguments)
    except BrokenExecutor as error:
        broken: Future[Any] = Future()
        broken.set_exception(error)
        return broken
