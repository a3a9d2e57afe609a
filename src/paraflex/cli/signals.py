"""What the command does on Ctrl-C, SIGTERM, and SIGHUP of a terminal that closes: the same, but for its exit code.

Before its work has begun and after it has ended the process leaves at once. While it works, the signal is raised as a
KeyboardInterrupt, as Python does with Ctrl-C alone: what is done is kept, and said.
"""

from __future__ import annotations

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

# Those that follow the first so soon are the same wish [s]: a terminal that closes may send two.
_ONCE = 1.0
# How long an import may go on: what is imported by half cannot be imported again; and how often that is looked at [s].
_IMPORTS, _AGAIN = 1.5, 0.02
_IMPORTING = "<frozen importlib._bootstrap>"


class _Taken:
    """The signal that is being answered."""

    number: int | None = None
    first: float = 0.0
    raised: float = 0.0


def exit_code() -> int:
    """Of a command that was interrupted: 130 after Ctrl-C, 143 after SIGTERM, 129 after SIGHUP."""
    return 128 + (_Taken.number or signal.SIGINT)


def is_taken() -> bool:
    """Whether a signal has been raised in the work."""
    return _Taken.number is not None


def leave_when_signalled() -> None:
    """From now on a signal ends the process at once, with a line and its exit code."""
    for number in _answered():
        signal.signal(number, _leave)


@contextmanager
def raised() -> Iterator[None]:
    """Meanwhile a signal is raised as a KeyboardInterrupt in the main thread."""
    _Taken.number = None
    if threading.current_thread() is not threading.main_thread():
        yield
        return
    before = {number: signal.signal(number, _raise) for number in _answered()}
    hooks = sys.unraisablehook, sys.excepthook
    # Compiled libraries print first what they cannot raise.
    sys.unraisablehook, sys.excepthook = _raise_again, _print_others
    try:
        yield
    finally:
        sys.unraisablehook, sys.excepthook = hooks
        for number, answer in before.items():
            signal.signal(number, answer)


def _answered() -> list[signal.Signals]:
    """Signals that the process was not told to ignore, as `nohup` does, and that nobody else answers."""
    return [number for number in ENDING if signal.getsignal(number) not in (signal.SIG_IGN, None)]


def _leave(number: int, _: FrameType | None) -> None:
    with suppress(OSError):
        os.write(2, b"interrupted\n")
    os._exit(128 + (_Taken.number or number))


def _raise(number: int, frame: FrameType | None) -> None:
    now = time.monotonic()
    if _Taken.number is None:
        _Taken.number, _Taken.first, _Taken.raised = number, now, 0.0
    if now - _Taken.first < _IMPORTS and _is_importing(frame):
        _send_later(number)
    elif now - _Taken.raised > _ONCE:
        _Taken.raised = now
        raise KeyboardInterrupt


def _is_importing(frame: FrameType | None) -> bool:
    while frame is not None:
        if frame.f_code.co_filename == _IMPORTING:
            return True
        frame = frame.f_back
    return False


def _raise_again(lost: Any) -> None:
    """Raise an interrupt again that was lost where nothing can be raised: in a callback of a library.

    Afterwards objects that were half made may not go in peace: of these nothing is said.
    """
    if _Taken.number is None:
        sys.__unraisablehook__(lost)
    elif issubclass(lost.exc_type, KeyboardInterrupt):
        _Taken.raised = 0.0
        _send_later(_Taken.number)


def _print_others(kind: type[BaseException], error: BaseException, trace: TracebackType | None) -> None:
    if not issubclass(kind, KeyboardInterrupt):
        sys.__excepthook__(kind, error, trace)


def _send_later(number: int) -> None:
    timer = threading.Timer(_AGAIN, _send, [number])
    timer.daemon = True
    timer.start()


def _send(number: int) -> None:
    main = threading.main_thread().ident
    if hasattr(signal, "pthread_kill") and main is not None:
        # Wakes it where it waits.
        signal.pthread_kill(main, number)
    else:
        signal.raise_signal(number)
