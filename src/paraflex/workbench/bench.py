"""The model of the text as far as it can be read, its pose, and the picture of both."""

from typing import Any

from paraflex.errors import ParaflexError
from paraflex.files import Model
from paraflex.files.library import library_text
from paraflex.files.model import model_of_text
from paraflex.plots.scene import Limits
from paraflex.plots.svg import sketch
from paraflex.results.posed import Posed, posed
from .document import Document
from .picture import picture


class Bench:
    """What a document describes: its last readable model, and the pose that is shown."""

    def __init__(self, document: Document) -> None:
        self._document = document
        self.model: Model | None = None
        self.shown: Posed | None = None
        self.problem: ParaflexError | None = None
        self._view: Limits | None = None
        self.renew()

    def read(self) -> Model:
        """Return the model of the text; InputError if it cannot be read."""
        return model_of_text(self._document.text, self._document.name, self._document.folder)

    def renew(self) -> None:
        """Read the text again; the last pose stays if it cannot be read."""
        self.problem = None
        try:
            self.model = self.read()
            self.shown = posed(self.model.mechanism, self.model.study.assembly)
        except ParaflexError as error:
            self.problem = error

    def show(self, limits: list[float]) -> None:
        """Take the part of the plane that a page shows: left, bottom, right, top [m]."""
        left, bottom, right, top = limits
        self._view = Limits(left, right, bottom, top) if right > left and top > bottom else None

    def picture(self) -> dict[str, Any] | None:
        """Return the picture of the pose; None if no pose is known."""
        return None if self.shown is None else picture(self.shown, self._view)

    def state(self) -> dict[str, Any]:
        """Return what a page shows of the model."""
        from .session import described

        problem = None if self.problem is None else described(self.problem)
        return {"picture": self.picture(), "problem": problem}

    def library(self, names: list[str]) -> list[dict[str, Any]]:
        """Return names, descriptions and sketches of library mechanisms."""
        found = []
        for name in names:
            mechanism = model_of_text(library_text(name), name, self._document.folder).mechanism
            found.append({"name": name, "title": mechanism.name, "about": mechanism.description, "svg": sketch(mechanism)})
        return found
