"""Answers to the messages of a page: each request has a method that reads its fields and returns the reply."""

import tempfile
import threading
import traceback
from collections.abc import Callable
from contextlib import nullcontext
from pathlib import Path
from typing import Any

from paraflex.errors import InputError, ParaflexError, suggestion
from paraflex.files.library import library_names, library_text
from paraflex.mechanism.checks import loose_bodies
from .actions import apply, what_goes
from .bench import Bench, library
from .bending import drag_force, linear
from .document import EMPTY, Document
from .items import fields, outline
from .leaving import figures, film, link, report, text_of_link
from .messages import Message, described, field, finite, keys, numbers, one_of, table
from .picture import looks
from .programs import program
from .readiness import checked
from .runs import Runner
from .turning import turning

# Actions that name no places on the sheet.
_WITHOUT_PLACES = ("set", "unset", "rename", "delete", "pose")
# Requests that take seconds, and do not hold others up.
SLOW = ("leave", "check")


def _names_places(action: Any) -> bool:
    return not isinstance(action, dict) or action.get("kind") not in _WITHOUT_PLACES


class EditSession:
    """State behind all pages that show one document.

    Parameters
    ----------
    document : Document
        Text that is edited.
    send : callable
        Function that sends an event to all pages, from any thread.
    """

    def __init__(self, document: Document, send: Callable[[Message], None]) -> None:
        self.document: Document = document
        self.bench: Bench = Bench(document)
        self._send, self._lock = send, threading.RLock()
        self._made: list[Path] = []
        self._folder: tempfile.TemporaryDirectory[str] | None = None
        self._revision = 0
        self._live: Any = None
        self._runner: Runner | None = None
        self._requests = {
            name.removeprefix("_do_"): getattr(self, name) for name in dir(type(self)) if name.startswith("_do_")
        }

    def answer(self, message: Any) -> Message:
        """Return the reply to a message: "ok" with what was asked for, or "error" in one line; it never raises."""
        number = message.get("id") if isinstance(message, dict) else None
        number = number if isinstance(number, int) else None
        try:
            asked = field(message, "do", str)
            with nullcontext() if asked in SLOW else self._lock, loose_bodies():
                if asked not in self._requests:
                    remedy = suggestion(asked, [*self._requests])
                    raise InputError("unknown request", field="do", value=asked[:60], remedy=remedy)
                return {"id": number, "ok": finite(self._requests[asked](message))}
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

    def warm_up(self) -> None:
        """Start the process of runs before the first one."""
        if self._runner is None:
            self._runner = Runner()

    def close(self) -> None:
        """End what runs in the background, and delete what was made for pages."""
        if self._runner is not None:
            self._runner.close()
        if self._folder is not None:
            self._folder.cleanup()

    # The text and its history.

    def _do_open(self, _: Message) -> Message:
        return {"looks": looks(), "recovered": self.document.recovered, **self._state()}

    def _do_text(self, message: Message) -> Message:
        return self._changed(field(message, "text", str))

    def _do_act(self, message: Message) -> Message:
        """Apply an action, or several `actions` as one step, in which "@" is what the one before has made."""
        actions = field(message, "actions", list) if "actions" in message else [field(message, "action", dict)]
        text, selected, notes = self.document.text, "", []
        if self.bench.is_moved and any(_names_places(one) for one in actions):
            # Places on the page are those of the pose that it shows.
            text = self._posed()
        for action in actions:
            given = {key: selected if value == "@" else value for key, value in table(action, "actions").items()}
            edited = apply(text, given, self.document.folder)
            text, selected = edited.text, edited.selected
            notes += [edited.note] if edited.note else []
        # What a slider changes while it is moved is one step.
        live, self._live = self._live, message.get("live")
        self.document.change(text, same=live is not None and live == self._live)
        return {**self._renewed(), "selected": selected, "note": "; ".join(notes)}

    def _posed(self) -> str:
        """Return the text with the present pose as the assembly."""
        mover = self.bench.mover
        action = {
            "kind": "pose", "assembly": self.bench.assembly, "angles": mover.angles(), "points": mover.places(),
            "travels": mover.travels(),
        }  # fmt: skip
        return apply(self.document.text, action, self.document.folder).text

    def _do_goes(self, message: Message) -> Message:
        return {"goes": what_goes(self.document.text, field(message, "names", list))}

    def _do_fields(self, message: Message) -> Message:
        return fields(self.document.text, keys(message, "place"))

    def _do_undo(self, _: Message) -> Message:
        self.document.undo()
        return self._renewed()

    def _do_redo(self, _: Message) -> Message:
        self.document.redo()
        return self._renewed()

    def _do_save(self, message: Message) -> Message:
        name = None if message.get("name") is None else field(message, "name", str)
        if name is None and self.document.take_up():
            note = "Not saved: another program has just changed the file. Its text is shown; Undo returns to yours."
            return {**self._renewed(), "note": note}
        self.document.save(name)
        return self._renewed()

    def _do_start(self, message: Message) -> Message:
        """Begin with a library mechanism, an empty sheet or the model of a link: a step that can be undone."""
        if "link" in message:
            return self._changed(text_of_link(field(message, "link", str)))
        name = field(message, "name", str)
        return self._changed(library_text(name) if name else EMPTY)

    def _do_library(self, _: Message) -> Message:
        return {"mechanisms": library(library_names())}

    # The pose.

    def _do_view(self, message: Message) -> Message:
        self.bench.show(numbers(message, "limits", 4))
        return {"picture": self.bench.picture()}

    def _do_drag(self, message: Message) -> Message:
        to = numbers(message, "to", 2)
        if "point" in message:
            body, _, point = field(message, "point", str).partition(".")
            return self.bench.drag(body, point, to)
        return self.bench.drag(field(message, "body", str), numbers(message, "local", 2), to)

    def _do_drop(self, _: Message) -> Message:
        return self.bench.drop()

    def _do_back(self, _: Message) -> Message:
        return self.bench.back()

    def _do_pose(self, _: Message) -> Message:
        return self._changed(self._posed())

    def _do_assemblies(self, _: Message) -> Message:
        return self.bench.found_assemblies()

    def _do_assembly(self, message: Message) -> Message:
        return self.bench.take_assembly(field(message, "number", int))

    def _do_mode(self, message: Message) -> Message:
        return self.bench.choose_mode(field(message, "name", str))

    def _do_reach(self, _: Message) -> Message:
        return self.bench.reach()

    def _do_turn(self, message: Message) -> Message:
        given = {name: message[name] for name in ("drive", "speed") if message.get(name) is not None}
        return turning(self.bench.known_model, assembly=self.bench.assembly, **given)

    # What is computed of the flexible mechanism.

    def _do_run(self, message: Message) -> Message:
        self.warm_up()
        assert self._runner is not None
        request = {"text": self.document.text, "folder": self.document.folder, "source": self.document.name}
        request |= {name: field(message, name, list) for name in ("modes",) if message.get(name)}
        return {"run": self._runner.start(request, lambda event: self._send(finite({"event": "run", **event})))}

    def _do_check(self, _: Message) -> Message:
        return checked(self.bench.known_model)

    def _do_cancel(self, _: Message) -> Message:
        if self._runner is not None:
            self._runner.cancel()
        return {}

    def _do_force(self, message: Message) -> Message:
        ref, force = field(message, "ref", str), numbers(message, "force", 2) if message.get("force") else []
        model, q = self.bench.known_model, self.bench.mover.q
        return drag_force(model, q, ref, force, buckling=message.get("buckling") is not False)

    def _do_linear(self, _: Message) -> Message:
        return linear(self.bench.known_model, self.bench.mover.q, self.bench.mode)

    # What a person takes away.

    def _do_leave(self, message: Message) -> Message:
        what, text, folder = field(message, "what", str), self.document.text, self.document.folder
        source = Path(self.document.name).stem
        if what == "link":
            return {"text": link(text)}
        if what == "program":
            return {"text": program(text)}
        out = one_of(what, ("report", "svg", "pdf", "png", "film"))
        place = self._out() / str(len(self._made))
        if out == "report":
            return self._address(report(text, folder, place, source=source))
        if out == "film":
            return self._address(film(text, folder, place / f"{source}.gif", source=source))
        return self._address(figures(text, folder, place / source, source=source, kinds=[out])[0])

    def _out(self) -> Path:
        if self._folder is None:
            self._folder = tempfile.TemporaryDirectory(prefix="paraflex-")
        return Path(self._folder.name)

    def _address(self, made: Path) -> Message:
        self._made.append(made)
        return {"address": f"made/{len(self._made) - 1}/{made.name}", "file": str(made)}

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
        try:
            things = outline(document.text)
        except ParaflexError:
            things = []
        return {
            "revision": self._revision, "text": document.text, "name": document.name,
            "file": None if document.file is None else str(document.file), "saved": document.saved,
            "undo": document.can_undo, "redo": document.can_redo, "outline": things, "selected": "", "note": "",
            **self.bench.state(),
        }  # fmt: skip
