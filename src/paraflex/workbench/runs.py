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
# Times after which a process that does not stop its run is replaced by the spare one if it is ready, and by any; and in
# which a process ends by itself [s].
_PATIENCE, _LONGEST, _LEAVING = 0.6, 3.0, 2.0


class Runner:
    """Process that runs models, kept warm, with a second one that takes over if a run does not stop.

    Both end with this process, however it ends. A Runner may be used from any thread, and is closed at the end.

    Parameters
    ----------
    spare : bool
        Whether there is a second process.
    """

    def __init__(self, *, spare: bool = True) -> None:
        self._lock, self._closed, self._wants_spare = threading.RLock(), False, spare
        # The newest request, None if it is answered or cancelled.
        self._number: int = NO_REQUEST
        self._request: dict[str, Any] | None = None
        self._on_event: OnEvent = lambda _: None
        self._active: _Process | None = _Process(self)
        self._spare: _Process | None = None

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
            number of the run; and `state`: "running" with `doing` and `share`; "preview" and "done" with the results
            (`shown.shown`), their `accuracy`, and `seconds` since the start; "error" with `text`, one line, and
            `error`, its parts; or "cancelled".

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
            self._on_event = on_event
            return self._hand_over({**request, "outside": may_be_outside()})

    def cancel(self) -> None:
        """Stop the run, if there is one; its last event has the state "cancelled"."""
        with self._lock:
            number, waiting, on_event = self._number, self._request is not None, self._on_event
            if waiting:
                self._hand_over(None)
        if waiting:
            _deliver(on_event, number, {"state": "cancelled"})

    def close(self) -> None:
        """End the processes; a run under way sends no more events."""
        with self._lock:
            self._closed, self._request = True, None
            left, self._active, self._spare = (self._active, self._spare), None, None
        for one in left:
            if one is not None:
                one.close()

    def _hand_over(self, request: dict[str, Any] | None) -> int:
        """Give the newest request to the process, and see to it later that it has begun; return its number."""
        self._number, self._request = self._number + 1, request
        if self._active is None:
            self._active, self._spare = self._spare or _Process(self), None
        self._active.send(self._number, request)
        for after, by_any in ((_PATIENCE, False), (_LONGEST, True)) if self._active.ready else ():
            timer = threading.Timer(after, self._replace, [by_any])
            timer.daemon = True
            timer.start()
        return self._number

    def _replace(self, by_any: bool = False) -> None:
        """Let the spare process, if it is ready, or any take over from one that does not begin the newest request."""
        with self._lock:
            active, spare = self._active, self._spare
            if active is None or not active.ready or active.begun == self._number:
                return
            if by_any or (spare is not None and spare.ready):
                self._active, self._spare = spare or _Process(self), None
                self._active.send(self._number, self._request)
                active.process.kill()

    def take(self, process: "_Process", number: int, event: dict[str, Any]) -> None:
        """Take an event of a process: pass it on if it belongs to the newest request."""
        state = event["state"]
        with self._lock:
            if state == READY:
                process.ready = True
                self._replace()
            elif state in (BEGUN, ENDED):
                process.begun, process.busy = number, state == BEGUN
            self._fill()
            newest = number in (self._number, NO_REQUEST) and process is self._active and self._request is not None
            if state in (READY, BEGUN, ENDED) or not newest:
                return
            number, on_event = self._number, self._on_event
            self._request = None if state in ("done", "error") else self._request
        _deliver(on_event, number, event)

    def lose(self, process: "_Process", code: int) -> None:
        """Replace a process that has ended by itself, and report the run that it did not finish."""
        with self._lock:
            self._spare = None if process is self._spare else self._spare
            if process is not self._active:
                return
            self._active, self._spare = self._spare, None
            number, waiting, on_event = self._number, self._request is not None, self._on_event
            self._request = None
            self._fill()
        why = f"signal {-code}: out of memory, or killed" if code < 0 else f"exit code {code}"
        text = f"the process of the run ended before it ({why}); run it again"
        if waiting:
            error = {"text": text, "kind": "LostWorker", "field": "", "remedy": "run it again", "time": None}
            _deliver(on_event, number, {"state": "error", "text": text, "error": error})

    def _fill(self) -> None:
        """Start the spare process when the other one is ready and has nothing to do, as it would slow it down."""
        idle = self._active is not None and self._active.ready and not self._active.busy and self._request is None
        if idle and self._wants_spare and self._spare is None:
            self._spare = _Process(self)


def _deliver(on_event: OnEvent, number: int, event: dict[str, Any]) -> None:
    """Pass an event on; what goes wrong there must not end the thread that reads events."""
    try:
        on_event({"event": "run", "run": number, **event})
    except Exception:
        traceback.print_exc()


class _Process:
    """Process of `worker.main`, with a thread that reads its events."""

    def __init__(self, runner: Runner) -> None:
        self.ready: bool = False
        self.busy: bool = False
        self.begun: int = NO_REQUEST
        self._runner = runner
        command = [sys.executable, "-c", _CHILD.format(path=sys.path)]
        with starting_processes():
            self.process: Any = subprocess.Popen(command, stdin=subprocess.PIPE, stdout=subprocess.PIPE)
        threading.Thread(target=self._read, daemon=True, name="paraflex-runs").start()

    def send(self, number: int, request: dict[str, Any] | None) -> None:
        """Send a request; if the process has ended, the reading thread finds out."""
        with suppress(OSError, ValueError):
            self.process.stdin.write(pickle.dumps((number, request)))
            self.process.stdin.flush()

    def close(self) -> None:
        """Close its standard input, at which it ends."""
        with suppress(OSError, ValueError):
            self.process.stdin.close()
        try:
            self.process.wait(_LEAVING)
        except subprocess.TimeoutExpired:
            self.process.kill()

    def _read(self) -> None:
        with suppress(EOFError, OSError, ValueError, pickle.UnpicklingError):
            while True:
                self._runner.take(self, *pickle.load(self.process.stdout))
        self.process.kill()
        code = self.process.wait()
        for stream in (self.process.stdin, self.process.stdout):
            # What was written to a process that has ended is lost.
            with suppress(OSError):
                stream.close()
        self._runner.lose(self, code)
