"""Process that runs models for a `Runner`: it reads requests from its standard input and writes events to its output.

It ends with the process that started it, whose end closes its standard input.
"""

import gc
import os
import pickle
import sys
import threading
import time
import warnings
from collections.abc import Callable
from contextlib import nullcontext, suppress
from pathlib import Path
from typing import Any, BinaryIO

# The reading thread starts before the imports that take long, in `_Work`.
from paraflex.interrupts import end_with_parent

# Events without a request, and words of the events that the host uses itself.
NO_REQUEST, READY, BEGUN, ENDED = 0, "ready", "begun", "ended"
# Time between two reports of progress, and of a coarse run below which the whole one follows without showing it [s].
_OFTEN, _QUICK = 0.1, 0.25
# Library mechanisms whose coarse runs load the kernels of each geometry.
_WARMING = ("five_bar", "raparm_i")

Send = Callable[[int, dict[str, Any]], None]


class Superseded(Exception):
    """End of a run for which the host no longer asks."""


class Inbox:
    """Newest request of the host, read by a thread that also ends the process with the host."""

    def __init__(self, stream: BinaryIO) -> None:
        self._stream, self._arrived = stream, threading.Condition()
        self._number, self._request = NO_REQUEST, None
        threading.Thread(target=self._read, daemon=True, name="paraflex-requests").start()

    @property
    def number(self) -> int:
        """Number of the newest request."""
        return self._number

    def next(self, after: int) -> tuple[int, dict[str, Any] | None]:
        """Wait for a request with another number; return its number, and None if the last one is only cancelled."""
        with self._arrived:
            self._arrived.wait_for(lambda: self._number != after)
            return self._number, self._request

    def _read(self) -> None:
        with suppress(Exception):
            while True:
                number, request = pickle.load(self._stream)
                with self._arrived:
                    self._number, self._request = number, request
                    self._arrived.notify_all()
        # The host has ended, or has closed its end: nobody waits for anything that is under way.
        os._exit(0)


def main() -> None:
    """Answer requests until the host closes standard input."""
    end_with_parent()
    stream = os.fdopen(os.dup(1), "wb")
    # What libraries print must not get between the events.
    os.dup2(2, 1)
    inbox, lock = Inbox(sys.stdin.buffer), threading.Lock()

    def send(number: int, event: dict[str, Any]) -> None:
        data = pickle.dumps((number, event))
        with lock, suppress(OSError):
            stream.write(data)
            stream.flush()

    warnings.simplefilter("ignore")
    _warm_up(inbox, send)
    # The garbage collector need not look at modules again.
    gc.collect()
    gc.freeze()
    send(NO_REQUEST, {"state": READY})
    number = NO_REQUEST
    while True:
        number, request = inbox.next(number)
        send(number, {"state": BEGUN})
        if request is not None:
            answer(
                request, lambda event, number=number: send(number, event), lambda number=number: inbox.number != number
            )
        send(number, {"state": ENDED})


def _warm_up(inbox: Inbox, send: Send) -> None:
    """Import all modules and load all kernels, as far as no request waits for it."""
    from paraflex.files import library_text

    def announce(event: dict[str, Any]) -> None:
        # Kernels that are compiled now are those that a request waits for.
        if event["state"] == "running" and "modes" not in event:
            send(NO_REQUEST, event)

    for name in _WARMING:
        if inbox.number == NO_REQUEST:
            with suppress(Exception):
                answer({"text": library_text(name)}, announce, lambda: inbox.number != NO_REQUEST, only_coarse=True)


def answer(
    request: dict[str, Any],
    send: Callable[[dict[str, Any]], None],
    stale: Callable[[], bool],
    *,
    only_coarse: bool = False,
) -> None:
    """Run the model of a request, and send its events: see `runs.Runner.start`.

    Parameters
    ----------
    request : dict
        Request.
    send : callable
        Function that takes each event.
    stale : callable
        Function that returns whether the host no longer asks for the run.
    only_coarse : bool
        Whether to end after the coarse run.
    """
    from paraflex.errors import ParaflexError
    from .shown import error_of

    try:
        _answer(request, send, stale, only_coarse=only_coarse)
    except (Superseded, KeyboardInterrupt):
        return
    except (ParaflexError, MemoryError) as error:
        send({"state": "error", "error": error_of(error), "text": error_of(error)["text"]})
    except Exception as error:
        # A defect of the program; the page shows one line, and the next request is answered.
        line = f"the run failed unexpectedly: {type(error).__name__}: {str(error).partition(chr(10))[0]}"
        send({"state": "error", "error": error_of(error) | {"text": line}, "text": line})


def _answer(
    request: dict[str, Any], send: Callable[[dict[str, Any]], None], stale: Callable[[], bool], *, only_coarse: bool
) -> None:
    from paraflex.compilation import compile_kernels_for
    from paraflex.files import allowing_outside
    from paraflex.formatting import output_units
    from .computing import computed, model_of

    began = time.perf_counter()
    folder = request.get("folder")
    with allowing_outside() if request.get("outside") else nullcontext():
        model = model_of(request["text"], Path(folder) if folder else None, request.get("source") or "model")
    chosen = {"modes": tuple(request.get("modes") or ()), "path": request.get("path") or None}
    compile_kernels_for(model.mechanism, lambda text: send({"state": "running", "doing": text, "share": 0.0}))
    units = model.parameters.get("units", {}).values()
    with output_units(units) if units else nullcontext():
        for coarse in (True, False) if request.get("preview", True) or only_coarse else (False,):
            started = time.perf_counter()
            found = computed(model, **chosen, coarse=coarse, on_progress=_Reports(send, stale, coarse=coarse))
            if coarse and not only_coarse and time.perf_counter() - started < _QUICK:
                continue
            _send_results(found, send, stale, coarse=coarse, began=began)
            if only_coarse:
                return


def _send_results(
    found: Any, send: Callable[[dict[str, Any]], None], stale: Callable[[], bool], *, coarse: bool, began: float
) -> None:
    from .shown import shown

    if stale():
        raise Superseded
    event = shown(found, charts=not coarse)
    if stale():
        raise Superseded
    accuracy = {"coarse": coarse, "tolerance": found.tolerance, "samples": found.samples}
    state = {"state": "preview" if coarse else "done", "accuracy": accuracy, "seconds": time.perf_counter() - began}
    send(state | event)


class _Reports:
    """Progress of a run, reported as events; it stops the run when the host no longer asks for it."""

    def __init__(self, send: Callable[[dict[str, Any]], None], stale: Callable[[], bool], *, coarse: bool) -> None:
        self._send, self._stale, self._coarse = send, stale, coarse
        self._reached: dict[str, float] = {}
        self._next = time.monotonic() + _OFTEN

    def __call__(self, at: Any) -> None:
        if self._stale():
            # Runs stop at it, as at Ctrl-C.
            raise KeyboardInterrupt
        self._reached[at.doing] = at.done
        if time.monotonic() < self._next:
            return
        self._next = time.monotonic() + _OFTEN
        reached = dict(self._reached)
        self._send({"state": "running", "doing": "a first look" if self._coarse else "the run", "modes": reached,
                    "end": at.total, "share": sum(reached.values()) / (len(reached) * at.total)})  # fmt: skip
