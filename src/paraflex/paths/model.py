"""Base class of models, which functions accept in place of a mechanism: a mechanism, and paths by name."""

from typing import Protocol

from paraflex.mechanism import Mechanism, Start
from .paths import Path


class ModelWithPaths(Protocol):
    """A mechanism with named paths and a start of its own, as `paraflex.load` returns it."""

    @property
    def mechanism(self) -> Mechanism:
        """Mechanism of the model."""
        ...

    @property
    def start(self) -> Start | None:
        """Start of a run without a path; None for a start undeformed and at rest."""
        ...

    def path(self, name: str | None = None) -> Path:
        """Return a path by its name."""
        ...
