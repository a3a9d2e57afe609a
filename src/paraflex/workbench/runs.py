"""Runs of models in a process of their own: the newest request replaces the one before, and a spare process is warm."""

import pickle
import subprocess
import sys
import threading
import traceback
from collections.abc import Callable
from contextlib import suppress
from typing import Any

from paraflex.errors import InputError
from paraflex.files.outside import may_be_outside
from paraflex.interrupts import starting_processes
from .worker import BEGUN, ENDED, NO_REQUEST, READY

OnEvent = Callable[[dict[str, Any]], None]

_CHILD = "import sys; sys.path[:] = {path!r}; from paraflex.workbench.worker import main; main()"
# Time after which a process that does not stop its run is replaced, and in which one ends by itself [s].
_PATIENCE, _LEAVING = 0.3, 2.0
# Events after which nothing more follows.
_LAST = ("done", "error")


class Runner:
    """Process that runs models, kept warm, with another one that takes over if a run does not stop.

    Processes end with this one, however it ends. A Runner is used from any thread, and closed at the end.

    Parameters
    ----------
    spare : bool
        Whether a second process is kept ready.
    """

    def __init__(self, *, spare: bool = True) -> None:
        self._lock = threading.RLock()
        self._number, self._on_event = NO_REQUEST, _ignore
        self._request: dict[str, Any] | None = None
        self._wants_spare, self._closed = spare, False
        self._spare: _Process | None = None
        self._active: _Process | None = _Process(self)

    def __enter__(self) -> "Runner":
        return self

    def __exit__(self, *_: object) -> None:
        self.close()

    def start(self, request: dict[str, Any], on_event: OnEvent) -> int:
        """Run a model in place of the run before, which is stopped and sends no more events.

        Parameters
        ----------
        request : dict
            `text` of the model file; optionally `folder`, to which names of files in it are relative, `source`, its
            name in errors, `modes`, `path`, and `preview` (True by default): whether the results of a coarse run are
            sent first if they take a while.
        on_event : callable
            Function that takes each event, called from another thread. Events are dicts with `event`, "run"; `run`, the
            number that this method returns; and `state`: "running" with `doing` and `share`, "preview" and "done" with
            the results (`shown.shown`), their `accuracy`, and `seconds` since the start, "error" with `text`, one line,
            and `error`, its parts, or "cancelled".

        Returns
        -------
        int
            Number of the run.

        Raises
        ------
        InputError
            The runner is closed, or the request has no text.
        """
        if not isinstance(request.get("text"), str):
            raise InputError("has no text of a model", field="request", remedy="give it as text")
        with self._lock:
            if self._closed:
                raise InputError("is closed", field="runner", remedy="make another Runner")
            self._number += 1
            self._on_event, self._request = on_event, {"outside": may_be_outside(), **request}
            self._hand_over()
            return self._number

    def cancel(self) -> None:
        """Stop the run, if there is one; its last event has the state "cancelled"."""
        with self._lock:
            if self._request is None or self._closed:
                return
            number, on_event, self._request = self._number, self._on_event, None
            self._number += 1
            self._hand_over()
        _deliver(on_event, number, {"state": "cancelled"})

    def close(self) -> None:
        """End the processes; a run under way sends no more events."""
        with self._lock:
            self._closed, self._request = True, None
            self._number += 1
            left = [one for one in (self._active, self._spare) if one is not None]
            self._active = self._spare = None
        for one in left:
            one.close()

    def _hand_over(self) -> None:
        """Give the newest request to the process, and see to it later whether it has begun."""
        if self._active is None:
            self._active, self._spare = self._spare or _Process(self), None
        self._active.send(self._number, self._request)
        if self._active.running != NO_REQUEST:
            timer = threading.Timer(_PATIENCE, self._replace, [self._number])
            timer.daemon = True
            timer.start()

    def _replace(self, number: int) -> None:
        """Let the spare process take over if it is ready and the other one still runs what is no longer wanted."""
        with self._lock:
            active, spare = self._active, self._spare
            overdue = active is not None and active.running not in (NO_REQUEST, self._number)
            if self._closed or number != self._number or not overdue or spare is None or not spare.ready:
                return
            assert active is not None
            self._active, self._spare = spare, None
            spare.send(self._number, self._request)
            active.kill()
            self._spare = _Process(self)

    def _taken(self, process: "_Process", number: int, event: dict[str, Any]) -> None:
        """Take an event of a process: pass it on if it belongs to the newest request."""
        with self._lock:
            state = event["state"]
            if state == READY:
                process.ready = True
                if self._wants_spare and self._spare is None and process is self._active and not self._closed:
                    self._spare = _Process(self)
                self._replace(self._number)
                return
            if state in (BEGUN, ENDED):
                process.running = number if state == BEGUN else NO_REQUEST
                return
            newest = number in (self._number, NO_REQUEST)
            if not newest or process is not self._active or self._request is None:
                return
            number, on_event = self._number, self._on_event
            if state in _LAST:
                self._request = None
        _deliver(on_event, number, event)

    def _lost(self, process: "_Process", code: int) -> None:
        """Replace a process that has ended by itself, and report the run that it did not finish."""
        with self._lock:
            if process is self._spare:
                self._spare = None
            if process is not self._active or self._closed:
                return
            self._active, self._spare = self._spare, None
            if self._active is not None and self._active.ready and self._wants_spare:
                self._spare = _Process(self)
            if self._request is None:
                return
            number, on_event, self._request = self._number, self._on_event, None
        why = f"signal {-code}: out of memory, or killed" if code < 0 else f"exit code {code}"
        text = f"the process of the run ended before it ({why}); run it again"
        error = {"text": text, "kind": "LostWorker", "field": "", "remedy": "run it again", "time": None}
        _deliver(on_event, number, {"state": "error", "text": text, "error": error})


class _Process:
    """Process of `worker.main`, with a thread that reads its events."""

    def __init__(self, runner: Runner) -> None:
        self.ready, self.running = False, NO_REQUEST
        self._runner = runner
        with starting_processes():
            command = [sys.executable, "-c", _CHILD.format(path=sys.path)]
            self.process: subprocess.Popen[bytes] = subprocess.Popen(
                command, stdin=subprocess.PIPE, stdout=subprocess.PIPE
            )
        threading.Thread(target=self._read, daemon=True, name="paraflex-runs").start()

    def send(self, number: int, request: dict[str, Any] | None) -> None:
        """Send a request; if the process has ended, the reading thread finds out."""
        assert self.process.stdin is not None
        with suppress(OSError, ValueError):
            self.process.stdin.write(pickle.dumps((number, request)))
            self.process.stdin.flush()

    def kill(self) -> None:
        """End the process at once."""
        self.process.kill()

    def close(self) -> None:
        """Close its standard input, at which it ends."""
        assert self.process.stdin is not None
        with suppress(OSError, ValueError):
            self.process.stdin.close()
        try:
            self.process.wait(_LEAVING)
        except subprocess.TimeoutExpired:
            self.process.kill()

    def _read(self) -> None:
        assert self.process.stdin is not None and self.process.stdout is not None
        with suppress(EOFError, OSError, ValueError, pickle.UnpicklingError):
            while True:
                self._runner._taken(self, *pickle.load(self.process.stdout))
        self.process.kill()
        code = self.process.wait()
        for stream in (self.process.stdin, self.process.stdout):
            # What was written to a process that has ended is lost.
            with suppress(OSError):
                stream.close()
        self._runner._lost(self, code)


def _ignore(_: dict[str, Any]) -> None:
    """Take an event of no request."""


def _deliver(on_event: OnEvent, number: int, event: dict[str, Any]) -> None:
    """Pass an event on; what goes wrong there must not end the thread that reads events."""
    try:
        on_event({"event": "run", "run": number, **event})
    except Exception:
        traceback.print_exc()
