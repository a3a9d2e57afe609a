"""Base class of models, which functions take in place of a mechanism: a mechanism, and paths by name."""

from __future__ import annotations

from typing import Protocol

from paraflex.kinematics.paths import Path
from paraflex.mechanism import Mechanism, Start


class ModelWithPaths(Protocol):
    """A mechanism with paths by name and a start of its own: what `paraflex.load` reads."""

    @property
    def mechanism(self) -> Mechanism:
        """The mechanism."""
        ...

    @property
    def start(self) -> Start | None:
        """The start of a run without a path; None for a start undeformed and at rest."""
        ...

    def path(self, name: str | None = None) -> Path:
        """A path by its name."""
        ...
