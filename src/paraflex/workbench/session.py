"""Answers to the messages of a page: the text and its history, the pose, and what is computed of both."""

import threading
import traceback
from collections.abc import Callable
from pathlib import Path
from typing import Any

from paraflex.errors import InputError, ParaflexError, suggestion
from paraflex.files.library import library_names, library_text
from .bench import Bench
from .document import EMPTY, Document
from .messages import field, finite, numbers
from .picture import looks

Message = dict[str, Any]


class Session:
    """State behind all pages that show one document.

    Parameters
    ----------
    document : Document
        Text that is edited.
    send : callable
        Function that sends an event to all pages.
    """

    def __init__(self, document: Document, send: Callable[[Message], None]) -> None:
        self.document = document
        self.bench = Bench(document)
        self._send, self._lock = send, threading.RLock()
        self._made: list[Path] = []
        self._revision = 0

    def answer(self, message: Any) -> Message:
        """Return the reply to a message: "ok" with what was asked for, or "error" in one line; it never raises."""
        number = message.get("id") if isinstance(message, dict) else None
        number = number if isinstance(number, int) else None
        try:
            with self._lock:
                asked = field(message, "do", str)
                known = {name.removeprefix("_do_"): name for name in dir(self) if name.startswith("_do_")}
                if asked not in known:
                    raise InputError("unknown request", field="do", value=asked, remedy=suggestion(asked, [*known]))
                return {"id": number, "ok": finite(getattr(self, known[asked])(message))}
        except ParaflexError as error:
            return {"id": number, "error": described(error)}
        except Exception as error:
            # No message may end the page; this is a fault of paraflex, whose trace goes to the terminal.
            traceback.print_exc()
            text = f"a fault of paraflex itself ({type(error).__name__}); the text is as it was"
            return {"id": number, "error": {"text": text, "field": "", "remedy": ""}}

    def take_up(self) -> None:
        """Take up a file that another program has changed."""
        with self._lock:
            if self.document.take_up():
                self._renewed()

    def made(self, number: int) -> Path | None:
        """Return a file that was made for a page."""
        return self._made[number] if 0 <= number < len(self._made) else None

    def close(self) -> None:
        """End what runs in the background."""

    def _do_open(self, _: Message) -> Message:
        return {"looks": looks(), "recovered": self.document.recovered, **self._state()}

    def _do_view(self, message: Message) -> Message:
        self.bench.show(numbers(message, "limits", 4))
        return {"picture": self.bench.picture()}

    def _do_text(self, message: Message) -> Message:
        return self._changed(field(message, "text", str))

    def _do_undo(self, _: Message) -> Message:
        self.document.undo()
        return self._renewed()

    def _do_redo(self, _: Message) -> Message:
        self.document.redo()
        return self._renewed()

    def _do_save(self, message: Message) -> Message:
        name = message.get("name")
        self.document.save(None if name is None else field(message, "name", str))
        return self._renewed()

    def _do_start(self, message: Message) -> Message:
        """Begin with a library mechanism or an empty sheet: a step that can be undone."""
        name = field(message, "name", str)
        return self._changed(library_text(name) if name else EMPTY)

    def _do_library(self, _: Message) -> Message:
        return {"mechanisms": self.bench.library(library_names())}

    def _changed(self, text: str) -> Message:
        self.document.change(text)
        return self._renewed()

    def _renewed(self) -> Message:
        self.bench.renew()
        self._revision += 1
        state = self._state()
        self._send({"event": "state", "state": finite(state)})
        return state

    def _state(self) -> Message:
        document = self.document
        return {
            "revision": self._revision, "text": document.text, "name": document.name, "file": None if document.file is None else str(document.file),
            "saved": document.saved, "undo": document.can_undo, "redo": document.can_redo, **self.bench.state(),
        }  # fmt: skip


def described(error: ParaflexError) -> Message:
    """Return an error for the page: its line, the field at fault and the remedy."""
    return {"text": str(error), "field": getattr(error, "field", ""), "remedy": getattr(error, "remedy", "")}
