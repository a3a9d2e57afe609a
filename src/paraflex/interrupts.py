"""Signals that end a process: put off where they must not fall, kept from processes that this one starts and ends.

Ctrl-C, SIGTERM, and SIGHUP of a terminal that closes. What they do is up to whoever runs the process: the command says
so in `cli/signals.py`.
"""

from __future__ import annotations

import multiprocessing
import os
import signal
import sys
import threading
from collections.abc import Callable, Iterator
from concurrent.futures import Future
from contextlib import contextmanager, suppress
from queue import Empty, SimpleQueue
from typing import Any

# Windows has no SIGHUP, and SIGBREAK for Ctrl-Break.
ENDING = tuple(
    signal.Signals[name] for name in ("SIGINT", "SIGTERM", "SIGHUP", "SIGBREAK") if name in signal.Signals.__members__
)
# Of a process whose parent is gone: nobody asks for it.
_ORPHANED = 1


@contextmanager
def uninterrupted() -> Iterator[list[int]]:
    """Signals that Python answers are answered when the block is left; within, those that came are in a list."""
    arrived: list[int] = []
    if threading.current_thread() is not threading.main_thread():
        yield arrived
        return
    before = {number: signal.getsignal(number) for number in ENDING}
    answered = {number: answer for number, answer in before.items() if callable(answer)}
    try:
        for number in answered:
            signal.signal(number, lambda number, _: arrived.append(number))
        yield arrived
    finally:
        try:
            _answer(answered)
        except BaseException:
            # One came when it was answered again, and others were not yet.
            _answer(answered)
            raise
        for number in arrived[:1]:
            signal.raise_signal(number)


def _answer(how: dict[signal.Signals, Any]) -> None:
    for number, answer in how.items():
        signal.signal(number, answer)


class Calls:
    """Calls handed to a pool of threads or processes by a thread that signals may interrupt at any moment.

    Pools and futures take their locks in Python: what is raised between leaves one taken, and a worker that ends, and
    whoever waits for it, wait for ever. So signals are put off while a call is handed over, and the wait is for a
    queue, whose lock is not left behind.
    """

    def __init__(self) -> None:
        self._done: SimpleQueue[Future[Any]] = SimpleQueue()

    def hand(self, submit: Callable[..., Future[Any]], *arguments: Any) -> Future[Any]:
        """What `submit` gives of the arguments."""
        with uninterrupted():
            future = submit(*arguments)
            future.add_done_callback(self._done.put)
        return future

    def done(self) -> set[Future[Any]]:
        """Those that ended since the last call, waited for; none at times, for Ctrl-C to be heard everywhere."""
        ended = set()
        with suppress(Empty):
            ended.add(self._done.get(timeout=1.0))
            while True:
                ended.add(self._done.get_nowait())
        return ended


@contextmanager
def starting_processes() -> Iterator[None]:
    """Processes started within never hear of Ctrl-C or a closed terminal, which reach all of a terminal at once.

    This process ends them; see `end_with_parent`.
    """
    with uninterrupted():
        if not hasattr(signal, "pthread_sigmask"):
            yield
            return
        # Handed on to them. Unlike an ignored signal, one that comes meanwhile is not lost to this process.
        kept = {signal.SIGINT, signal.SIGHUP}
        before = signal.pthread_sigmask(signal.SIG_BLOCK, kept)
        try:
            # It lets SIGINT through again.
            _start_tracker()
            signal.pthread_sigmask(signal.SIG_BLOCK, kept)
            yield
        finally:
            signal.pthread_sigmask(signal.SIG_SETMASK, before)


def _start_tracker() -> None:
    """Start the process, one for all, by which Python does away with locks that nobody uses any more."""
    from multiprocessing import resource_tracker

    # What it would warn of is its task: locks of workers that were stopped.
    sys.warnoptions.append("ignore:resource_tracker")
    try:
        resource_tracker.ensure_running()
    finally:
        sys.warnoptions.pop()


def end_with_parent(pipe: int | None = None) -> None:
    """End this process when the one that started it has ended, however it did.

    Parameters
    ----------
    pipe : int, optional
        Descriptor of one that the parent holds the other end of, and writes nothing to; processes of `multiprocessing`
        have their own.
    """
    from multiprocessing.connection import wait

    signal.signal(signal.SIGINT, signal.SIG_IGN)
    parent = multiprocessing.parent_process()

    def watch() -> None:
        if pipe is not None:
            os.read(pipe, 1)
        elif parent is not None:
            wait([parent.sentinel])
        # Not `sys.exit`, which ends this thread alone: nothing is left to clean up for.
        os._exit(_ORPHANED)

    if pipe is not None or parent is not None:
        threading.Thread(target=watch, name="paraflex-parent", daemon=True).start()
