"""Process that runs models for a `Runner`: requests come by its standard input, events leave by its standard output.

It ends when standard input is closed, as by the end of the process that started it.
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

# All that takes long to import is imported after the thread that reads requests has started.
from paraflex.interrupts import end_with_parent

# Number of no request, and states of events for the host alone.
NO_REQUEST, READY, BEGUN, ENDED = 0, "ready", "begun", "ended"
# Times between two reports of progress, of a coarse run which is not worth showing, and of a run before which none is
# made; and times of the last runs by mechanism and modes [s].
_OFTEN, _QUICK, _SHORT = 0.1, 0.25, 0.6
_taken: dict[Any, float] = {}
# Library mechanisms whose coarse runs load the kernels of each geometry.
_WARMING = ("five_bar", "raparm_i")

Send = Callable[[dict[str, Any]], None]
Stale = Callable[[], bool]


class Inbox:
    """Newest request of the host, read by a thread that also ends the process with the host."""

    def __init__(self, stream: BinaryIO) -> None:
        self.number: int = NO_REQUEST
        self._request: dict[str, Any] | None = None
        self._stream, self._arrived = stream, threading.Condition()
        threading.Thread(target=self._read, daemon=True, name="paraflex-requests").start()

    def next(self, after: int) -> tuple[int, dict[str, Any] | None]:
        """Wait for a request with another number; return its number, and None if the last one is only cancelled."""
        with self._arrived:
            self._arrived.wait_for(lambda: self.number != after)
            return self.number, self._request

    def _read(self) -> None:
        with suppress(Exception):
            while True:
                number, request = pickle.load(self._stream)
                with self._arrived:
                    self.number, self._request = number, request
                    self._arrived.notify_all()
        # Nobody waits for what is under way.
        os._exit(0)


def main() -> None:
    """Answer requests until standard input is closed."""
    end_with_parent()
    stream, lock = os.fdopen(os.dup(1), "wb"), threading.Lock()
    # What libraries print must not get between the events.
    os.dup2(2, 1)
    inbox = Inbox(sys.stdin.buffer)

    def send(number: int, event: dict[str, Any]) -> None:
        with lock, suppress(OSError):
            stream.write(pickle.dumps((number, event)))
            stream.flush()

    warnings.simplefilter("ignore")
    _warm_up(inbox, lambda event: send(NO_REQUEST, event))
    send(NO_REQUEST, {"state": READY})
    number = NO_REQUEST
    while True:
        number, request = inbox.next(number)
        send(number, {"state": BEGUN})
        if request is not None:
            answer(request, lambda event, n=number: send(n, event), lambda n=number: inbox.number != n)
        send(number, {"state": ENDED})


def _warm_up(inbox: Inbox, send: Send) -> None:
    """Import all modules and load all kernels, as long as no request waits for it."""
    from paraflex.files import library_text

    def announce(event: dict[str, Any]) -> None:
        # Kernels that are compiled now are those that a request waits for.
        if event["state"] == "running" and "modes" not in event:
            send(event)

    for name in _WARMING:
        if inbox.number == NO_REQUEST:
            answer({"text": library_text(name)}, announce, lambda: inbox.number != NO_REQUEST, only_coarse=True)
    # The garbage collector need not look at modules again.
    gc.collect()
    gc.freeze()


def answer(request: dict[str, Any], send: Send, stale: Stale, *, only_coarse: bool = False) -> None:
    """Run the model of a request, and send its events: see `runs.Runner.start`.

    Parameters
    ----------
    request : dict
        Request.
    send, stale : callable
        Functions that take each event, and return whether the host no longer asks for the run.
    only_coarse : bool
        Whether to end after the coarse run.
    """
    from paraflex.errors import ParaflexError
    from .shown import error_of

    try:
        _answer(request, send, stale, only_coarse=only_coarse)
    except KeyboardInterrupt:
        return
    except Exception as error:
        parts = error_of(error)
        if not isinstance(error, ParaflexError | MemoryError):
            # A defect of the program: the page shows one line, and the next request is answered.
            parts["text"] = f"the run failed unexpectedly: {parts['kind']}: {parts['text'].partition(chr(10))[0]}"
        send({"state": "error", "text": parts["text"], "error": parts})


def _answer(request: dict[str, Any], send: Send, stale: Stale, *, only_coarse: bool) -> None:
    from paraflex.compilation import compile_kernels_for
    from paraflex.files import allowing_outside
    from paraflex.formatting import output_units
    from paraflex.reports.packing import quickly
    from .computing import computed, model_of
    from .shown import shown

    began, folder = time.perf_counter(), request.get("folder")
    with allowing_outside() if request.get("outside") else nullcontext():
        model = model_of(request["text"], Path(folder) if folder else None, request.get("source") or "model")
    compile_kernels_for(model.mechanism, lambda text: send({"state": "running", "doing": text, "share": 0.0}))
    modes, path = tuple(request.get("modes") or ()), request.get("path") or None
    of = request.get("source"), len(model.mechanism.bodies), modes or model.study.modes
    is_long = request.get("preview", True) and _taken.get(of, _SHORT) >= _SHORT
    for coarse in [True] if only_coarse else [True, False] if is_long else [False]:
        started, watch = time.perf_counter(), _watching(send, stale, "a first look" if coarse else "the run")
        found = computed(model, modes, path, coarse=coarse, on_progress=watch)
        if coarse and not only_coarse and time.perf_counter() - started < _QUICK:
            continue
        with quickly(), output_units(model.parameters.get("units", {}).values()):
            event = {"state": "preview" if coarse else "done"} | ({} if stale() else shown(found, charts=not coarse))
        if stale():
            return
        if not coarse:
            _taken[of] = time.perf_counter() - started
        accuracy = {"coarse": coarse, "tolerance": found.tolerance, "samples": found.samples}
        send(event | {"accuracy": accuracy, "seconds": time.perf_counter() - began})


def _watching(send: Send, stale: Stale, doing: str) -> Callable[[Any], None]:
    """Return a function that reports the progress of runs now and then, and stops them when nobody asks for them."""
    reached, last = dict[str, float](), time.monotonic()

    def watch(at: Any) -> None:
        nonlocal last
        if stale():
            # Runs stop at it, as at Ctrl-C.
            raise KeyboardInterrupt
        reached[at.doing] = at.done
        if time.monotonic() > last + _OFTEN:
            last, modes = time.monotonic(), dict(reached)
            share = sum(modes.values()) / (len(modes) * at.total)
            send({"state": "running", "doing": doing, "modes": modes, "end": at.total, "share": share})

    return watch
