"""Terminating signals: deferred in critical sections, and blocked in child processes, which this process ends itself.

The signals are Ctrl-C, SIGTERM, and SIGHUP from a closing terminal. Their handlers are set by the application, for the
command line in `cli/signals.py`.
"""

import multiprocessing
import os
import signal
import sys
import threading
from collections.abc import Iterator
from contextlib import contextmanager
from typing import Any

# Windows has no SIGHUP, but SIGBREAK for Ctrl-Break.
ENDING = tuple(
    signal.Signals[name] for name in ("SIGINT", "SIGTERM", "SIGHUP", "SIGBREAK") if name in signal.Signals.__members__
)


@contextmanager
def uninterrupted() -> Iterator[list[int]]:
    """Defer signals with Python handlers to the end of the block; the yielded list holds those that arrived within."""
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
            # A signal arrived while the handlers were being restored: restore the rest.
            _answer(answered)
            raise
        for number in arrived[:1]:
            signal.raise_signal(number)


def _answer(how: dict[signal.Signals, Any]) -> None:
    for number, answer in how.items():
        signal.signal(number, answer)


@contextmanager
def starting_processes() -> Iterator[None]:
    """Provide a context in which started processes ignore Ctrl-C and SIGHUP, which a terminal sends to all processes.

    This process ends them; see `end_with_parent`.
    """
    with uninterrupted():
        if not hasattr(signal, "pthread_sigmask"):
            yield
            return
        # Child processes inherit the mask. Unlike an ignored signal, a blocked one is not lost to this process.
        kept = {signal.SIGINT, signal.SIGHUP}
        before = signal.pthread_sigmask(signal.SIG_BLOCK, kept)
        try:
            # Starting the tracker unblocks SIGINT, which is therefore blocked again.
            _start_tracker()
            signal.pthread_sigmask(signal.SIG_BLOCK, kept)
            yield
        finally:
            signal.pthread_sigmask(signal.SIG_SETMASK, before)


def _start_tracker() -> None:
    """Start Python's resource tracker, the single process that removes unused locks of multiprocessing."""
    from multiprocessing import resource_tracker

    # Its warnings about leaked locks are expected: workers are stopped while they hold some.
    sys.warnoptions.append("ignore:resource_tracker")
    try:
        resource_tracker.ensure_running()
    finally:
        sys.warnoptions.pop()


def end_with_parent(pipe: int | None = None) -> None:
    """End this process when its parent process has ended for whatever reason.

    Parameters
    ----------
    pipe : int, optional
        File descriptor of a pipe whose other end the parent holds open without writing to it; not needed by processes
        of `multiprocessing`.
    """
    from multiprocessing.connection import wait

    signal.signal(signal.SIGINT, signal.SIG_IGN)
    parent = multiprocessing.parent_process()

    def watch() -> None:
        if pipe is not None:
            os.read(pipe, 1)
        elif parent is not None:
            wait([parent.sentinel])
        # `sys.exit` would end this thread alone; no clean-up is needed, and no process reads the exit code.
        os._exit(1)

    if pipe is not None or parent is not None:
        threading.Thread(target=watch, name="paraflex-parent", daemon=True).start()
