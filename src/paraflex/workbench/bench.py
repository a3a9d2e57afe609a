"""The model of the text as far as it can be read, the pose that a person has moved it to, and the picture of both."""

from collections.abc import Mapping
from dataclasses import replace
from functools import cache
from pathlib import Path
from typing import Any

import numpy as np

from paraflex.errors import InputError, NumericalError, ParaflexError
from paraflex.files import Model
from paraflex.files.library import library_text
from paraflex.files.model import model_of_text
from paraflex.mechanism.checks import check_connected, loose_bodies
from paraflex.mechanism.quantities import known
from paraflex.plots.scene import Limits
from paraflex.plots.svg import sketch
from paraflex.results.posed import Posed, posed, posed_at
from .assembling import assemblies
from .document import Document
from .messages import Message, described
from .moving import Mover
from .picture import ground_picture, picture
from .readiness import readiness
from .seeing import Seeing
from .sheet import Sheet


class Bench:
    """Model of a document, its pose, and the numbers of the pose.

    Attributes
    ----------
    model : Model or None
        Model of the newest text that could be read; None if there was none.
    problem : ParaflexError or None
        Reason why the text cannot be read, or its pose not be found.
    mode : str
        Name of the chosen actuation mode; empty for none.
    """

    def __init__(self, document: Document) -> None:
        self._document = document
        self.model: Model | None = None
        self.problem: ParaflexError | None = None
        self.mode: str = ""
        self._open: Posed | None = None
        self._mover: Mover | None = None
        self._seeing: Seeing | None = None
        self._seen: dict[str, Any] | None = None
        self._found: list[Any] = []
        self._moved, self._assembly = False, ""
        self._view: Limits | None = None
        self.renew()

    def read(self) -> Model:
        """Return the model of the text; InputError if it cannot be read."""
        document = self._document
        sheet = Sheet(document.text, document.folder)
        if not sheet.data.get("body"):
            # Refused with the reason, which is not only that there are no bodies.
            return model_of_text(document.text, document.name, document.folder)
        return replace(sheet.model, source=document.name)

    def renew(self) -> None:
        """Read the text again; the picture stays if it cannot be read, and the pose is near the one before."""
        with loose_bodies():
            self._renew()

    def _renew(self) -> None:
        self.problem = None
        try:
            model = self.read()
        except ParaflexError as error:
            self.problem = error
            # A sheet without bodies is not one that cannot be read.
            if getattr(error, "field", "") == "body":
                self.model, self._mover, self._seeing, self._open = None, None, None, None
            return
        self.model = model
        if self.mode not in [mode.name for mode in model.mechanism.modes]:
            self.mode = next(iter(model.study.modes), next((one.name for one in model.mechanism.modes), ""))
        self._pose(model)
        try:
            check_connected(model.mechanism)
        except InputError as error:
            self.problem = self.problem or error

    def _pose(self, model: Model) -> None:
        """Move to the pose nearest to the present one in the changed mechanism; open loops are drawn as given."""
        before, self._open = self._mover, None
        try:
            fresh = Mover(model.mechanism, model.study.assembly)
            self._assembly = model.mechanism.assembly(model.study.assembly).name
            same = before is not None and before.mechanism.assemblies == model.mechanism.assemblies
            if before is not None and same and self._moved:
                before.redraw(model.mechanism)
                fresh = before
            else:
                self._moved = False
            self._mover = fresh
            self._seeing = Seeing(model, self._seeing)
        except (InputError, NumericalError) as error:
            self._mover, self._seeing = None, None
            try:
                self._open = posed(model.mechanism, model.study.assembly)
                if not self._open.problems:
                    self.problem = error
            except ParaflexError as other:
                self.problem = other

    @property
    def is_moved(self) -> bool:
        """Whether a person has moved the mechanism away from its assembly."""
        return self._moved

    @property
    def assembly(self) -> str:
        """Name of the assembly of the pose; empty without a pose."""
        return self._assembly

    def show(self, limits: list[float]) -> None:
        """Take the part of the plane that a page shows: left, bottom, right, top [m]."""
        left, bottom, right, top = limits
        self._view = (
            Limits(left, right, bottom, top) if 1e-9 < right - left < 1e9 and 1e-9 < top - bottom < 1e9 else None
        )

    @property
    def mover(self) -> Mover:
        """Pose that can be moved; InputError if there is none."""
        if self._mover is None:
            text = "the mechanism has no pose" if self.problem is None else str(self.problem)
            raise InputError(text, field="assembly", remedy="draw links first, or correct the text")
        return self._mover

    def picture(self) -> dict[str, Any] | None:
        """Return the picture of the pose; None if no pose is known."""
        if self._mover is not None and self.model is not None:
            shown = posed_at(self.model.mechanism, self._mover.system, self._assembly, self._mover.q[None])
            return picture(shown, self._view)
        if self._open is not None:
            return picture(self._open, self._view)
        return ground_picture(self._document.text, self._view) if self.model is None else None

    def seen(self, *, quick: bool = False) -> dict[str, Any] | None:
        """Return the numbers of the pose, those that are computed fast or all; None without a pose."""
        if self._seeing is None or self._mover is None:
            return None
        q = self._mover.q
        if quick:
            return self._seeing.quick(q, self.mode)
        self._seen = self._seeing.full(q, self.mode)
        return self._seen

    def state(self) -> Message:
        """Return what a page shows of the model."""
        mechanism, seen = None if self.model is None else self.model.mechanism, self.seen()
        return {
            "picture": self.picture(),
            "problem": None if self.problem is None else described(self.problem),
            "assemblies": [] if mechanism is None else [one.name for one in mechanism.assemblies],
            "assembly": self._assembly,
            "moved": self._moved,
            "mode": self.mode,
            "seen": seen,
            "ready": self._ready(seen),
        }

    def _ready(self, seen: dict[str, Any] | None) -> Message:
        return readiness(self.model, self.problem, seen, {} if self._open is None else dict(self._open.gaps))

    def reach(self) -> Message:
        """Return where the path is reached, which takes longer than other numbers, and whether a run may begin."""
        if self._seeing is None or self._seen is None:
            return {"path": [], "ready": self._ready(None)}
        path = self._seeing.reach(self.mode)
        return {"path": path, "ready": self._ready({**self._seen, "path": path})}

    def choose_mode(self, name: str) -> Message:
        """Choose the mode whose motors hold and drive."""
        known(name, [one.name for one in self.known_model.mechanism.modes], "mode", "mode")
        self.mode = name
        return {"mode": self.mode, "seen": self.seen()}

    @property
    def known_model(self) -> Model:
        """Model of the text; InputError if it cannot be read."""
        if self.model is None or self.problem is not None:
            self.model = self.read()
        return self.model

    def drag(self, body: str, local: list[float] | str, to: list[float]) -> Message:
        """Drag a point of a body to a place [m]."""
        moved = self.mover.drag(body, local, to)
        self._moved = True
        return {**self._now(quick=True), "reached": moved.reached, "stop": moved.stop, "problem": moved.problem}

    def drop(self) -> Message:
        """End a drag."""
        self.mover.release()
        return self._now()

    def back(self) -> Message:
        """Return to the pose of the file."""
        self.mover.to_assembly(self._assembly)
        self._moved = False
        return self._now()

    def found_assemblies(self) -> Message:
        """Search for all poses with the same place of the end-effector or drives."""
        mover = self.mover
        model = self.model
        assert model is not None
        self._found = assemblies(mover)
        shown = [posed_at(model.mechanism, mover.system, "", q[None]) for q in self._found]
        return {"assemblies": [{"name": "", "picture": picture(one)} for one in shown]}

    def take_assembly(self, number: int) -> Message:
        """Move to one of the poses that were found last."""
        if not 0 <= number < len(self._found):
            raise InputError("no such pose was found", field="number", value=number, remedy="search again")
        self.mover.at(np.asarray(self._found[number]))
        self._moved = True
        return self._now()

    def _now(self, *, quick: bool = False) -> Message:
        return {"picture": self.picture(), "seen": self.seen(quick=quick)}


def library(names: list[str]) -> list[dict[str, Any]]:
    """Return names, descriptions and sketches of library mechanisms."""
    return [dict(_card(name)) for name in names]


@cache
def _card(name: str) -> Mapping[str, Any]:
    mechanism = model_of_text(library_text(name), name, Path()).mechanism
    return {"name": name, "title": mechanism.name, "about": mechanism.description, "svg": sketch(mechanism)}
