"""`paraflex draw --watch`: a page that draws a model again when its file is saved, with sliders for its parameters."""

import json
import math
import secrets
import threading
import time
import warnings
from collections.abc import Sequence
from contextlib import suppress
from contextvars import copy_context
from dataclasses import replace
from http.server import BaseHTTPRequestHandler, ThreadingHTTPServer
from importlib.resources import files
from pathlib import Path
from typing import Any
from urllib.parse import parse_qs

import typer

from paraflex.checks.drawing import pose_of
from paraflex.errors import ParaflexError, ParaflexWarning
from paraflex.files.read import parse_toml
from paraflex.plots.model_drawing import model_drawing
from paraflex.plots.style import figure_svg
from paraflex.units import quantities_in
from .commands.models import DrawRequest
from .request import requested_model

# Longest wait for a change in one answer, and time between two looks at the file [s].
_LONGEST, _LOOK = 20.0, 0.1


def sliders(text: str) -> list[dict[str, Any]]:
    """Return name, number, unit and range of the parameters in a file's text that are numbers and not expressions."""
    found = []
    for name, given in parse_toml(text).get("parameters", {}).items():
        value = str(given)
        # A number with a unit is all of the value.
        unit = next((one.unit for one in quantities_in(value) if (one.start, one.end) == (0, len(value))), "")
        with suppress(ValueError):
            number = float(value.removesuffix(unit))
            reach = 0.5 * abs(number) or 1.0
            if math.isfinite(number):
                ends = {"low": number - reach, "high": number + reach}
                found.append({"name": name, "number": number, "unit": unit, **ends})
    return found


class WatchServer(ThreadingHTTPServer):
    """Server of the page on this machine alone; its address has a token that other programs and pages do not know."""

    daemon_threads = True

    def __init__(self, request: DrawRequest) -> None:
        super().__init__(("127.0.0.1", 0), _Answers)
        self.place: str = f"/{secrets.token_urlsafe(16)}/"
        self.address: str = f"http://127.0.0.1:{self.server_port}{self.place}"
        self._request, self._printed = request, ""
        self._lock, self._context = threading.Lock(), copy_context()

    def _stamp(self) -> str:
        """Return a text that changes when the model's file is saved; empty while there is no file."""
        with suppress(OSError):
            state = Path(self._request.model.name).stat()
            return f"{state.st_mtime_ns} {state.st_size} {state.st_ino}"
        return "none"

    def changed(self, after: str) -> dict[str, Any]:
        """Return the state of the file as soon as it is not `after`, at the latest after `_LONGEST`."""
        end = time.monotonic() + _LONGEST
        while self._stamp() == after and time.monotonic() < end:
            time.sleep(_LOOK)
        return {"stamp": self._stamp()}

    def drawing(self, settings: Sequence[str]) -> dict[str, Any]:
        """Return the drawing with values of --set, or the error, which is also printed if it is a new one."""
        with self._lock:  # Matplotlib has one state for all threads.
            try:
                found = self._context.run(self._drawn, settings)
            except ParaflexError as error:
                found = {"error": str(error)}
            before, self._printed = self._printed, found.get("error", "")
            if self._printed != before:
                typer.echo(f"error: {self._printed}" if self._printed else "drawn again", err=bool(self._printed))
        return found

    def _drawn(self, settings: Sequence[str]) -> dict[str, Any]:
        request = self._request
        with warnings.catch_warnings(record=True) as given:
            warnings.simplefilter("always", ParaflexWarning)
            model = requested_model(replace(request.model, settings=[*request.model.settings, *settings]))
            shown = pose_of(model, assembly=request.assembly, path=request.path)
        svg = figure_svg(model_drawing(shown, theme_name=request.theme))
        problems = [*(str(one.message) for one in given), *shown.problems]
        return {"name": shown.mechanism.name, "svg": svg, "problems": problems, "parameters": sliders(model.text)}


class _Answers(BaseHTTPRequestHandler):
    """Answers to the page; a request without the token finds nothing."""

    def do_GET(self) -> None:
        """Answer with the page, with a drawing, or when the file has changed."""
        server: Any = self.server
        place, _, query = self.path.partition("?")
        given = parse_qs(query, keep_blank_values=True)
        if not secrets.compare_digest(place[: len(server.place)].encode(), server.place.encode()):
            self.send_error(404)
        elif place == f"{server.place}drawing":
            self._send(server.drawing(given.get("set", [])))
        elif place == f"{server.place}changed":
            self._send(server.changed(given.get("after", [""])[0]))
        else:
            self._send((files("paraflex.reports") / "assets" / "watch.html").read_bytes())

    def _send(self, found: dict[str, Any] | bytes) -> None:
        """Send JSON, or a page; the browser may have left by now."""
        content = found if isinstance(found, bytes) else json.dumps(found).encode()
        with suppress(ConnectionError):
            self.send_response(200)
            self.send_header("Content-Type", "text/html; charset=utf-8" if content is found else "application/json")
            self.send_header("Cache-Control", "no-store")
            self.end_headers()
            self.wfile.write(content)

    def log_message(self, format: str, *args: Any) -> None:
        """Print no line for a request."""
