"""Response of a command to Ctrl-C, SIGTERM, and SIGHUP of a closing terminal: the same except for the exit code.

Before its work has begun and after it has ended, the process exits at once. During the work, the signal is raised as a
KeyboardInterrupt, as Python does for Ctrl-C alone: finished results are kept and reported.
"""

import os
import signal
import sys
import threading
import time
from collections.abc import Iterator
from contextlib import contextmanager, suppress
from types import FrameType, TracebackType
from typing import Any

from paraflex.interrupts import ENDING

# Signals within this time of the last one raised are repetitions [s]: a terminal that closes may send two.
_ONCE = 1.0
# Longest delay of a signal during an import, as a half-imported module cannot be imported again, or during a step of
# llvmlite, between whose calls compiled code may have two owners; and time between two attempts to raise it [s].
_DELAY, _AGAIN = 1.5, 0.02
_IMPORTING, _OWNING = "<frozen importlib._bootstrap>", os.path.join("llvmlite", "binding", "")


class _Taken:
    """Signal being handled: its number, and the monotonic times of the first one and of the last one raised [s].

    `usual` is set by a command that Ctrl-C ends as intended.
    """

    number: int | None = None
    usual: bool = False
    first: float = 0.0
    raised: float = 0.0


def exit_code() -> int:
    """Return the exit code of an interrupted command: 130 after Ctrl-C, 143 after SIGTERM, 129 after SIGHUP."""
    number = _Taken.number or signal.SIGINT
    return 0 if _Taken.usual and number == signal.SIGINT else 128 + number


def end_by_ctrl_c() -> None:
    """Make Ctrl-C the usual end of the command: its exit code is then that of success."""
    _Taken.usual = True


def is_taken() -> bool:
    """Return whether a signal has arrived during the work."""
    return _Taken.number is not None


def leave_when_signalled() -> None:
    """Make signals end the process at once from now on, with a line and their exit code."""
    for number in _answered():
        signal.signal(number, _end_process)


@contextmanager
def raised() -> Iterator[None]:
    """Raise signals as KeyboardInterrupt in the main thread within the context."""
    _Taken.number, _Taken.usual = None, False
    if threading.current_thread() is not threading.main_thread():
        yield
        return
    before = {number: signal.signal(number, _raise) for number in _answered()}
    hooks = sys.unraisablehook, sys.excepthook
    # Compiled libraries pass exceptions that they cannot raise to these hooks, which print them by default.
    sys.unraisablehook, sys.excepthook = _reraise, _print_others
    try:
        yield
    finally:
        sys.unraisablehook, sys.excepthook = hooks
        for number, answer in before.items():
            signal.signal(number, answer)


def _answered() -> list[signal.Signals]:
    """Return the signals to handle: those neither ignored, as under `nohup`, nor handled outside Python."""
    return [number for number in ENDING if signal.getsignal(number) not in (signal.SIG_IGN, None)]


def _end_process(number: int, _: FrameType | None) -> None:
    with suppress(OSError):
        os.write(2, b"interrupted\n")
    os._exit(128 + (_Taken.number or number))


def _raise(number: int, frame: FrameType | None) -> None:
    now = time.monotonic()
    if _Taken.number is None:
        _Taken.number, _Taken.first, _Taken.raised = number, now, 0.0
    if now - _Taken.first < _DELAY and _is_delaying(frame):
        _resend_later(number)
    elif now - _Taken.raised > _ONCE:
        _Taken.raised = now
        raise KeyboardInterrupt


def _is_delaying(frame: FrameType | None) -> bool:
    while frame is not None:
        file = frame.f_code.co_filename
        if file == _IMPORTING or _OWNING in file:
            return True
        frame = frame.f_back
    return False


def _reraise(lost: Any) -> None:
    """Raise an interrupt again that was lost in a callback of a library, where exceptions cannot be raised.

    After an interrupt, errors in the deletion of incomplete objects are not printed.
    """
    if _Taken.number is None:
        sys.__unraisablehook__(lost)
    elif issubclass(lost.exc_type, KeyboardInterrupt):
        _Taken.raised = 0.0
        _resend_later(_Taken.number)


def _print_others(kind: type[BaseException], error: BaseException, trace: TracebackType | None) -> None:
    if not issubclass(kind, KeyboardInterrupt):
        sys.__excepthook__(kind, error, trace)


def _resend_later(number: int) -> None:
    timer = threading.Timer(_AGAIN, _send, [number])
    timer.daemon = True
    timer.start()


def _send(number: int) -> None:
    main = threading.main_thread().ident
    if hasattr(signal, "pthread_kill") and main is not None:
        # This also wakes a main thread that waits in a system call.
        signal.pthread_kill(main, number)
    else:
        signal.raise_signal(number)
