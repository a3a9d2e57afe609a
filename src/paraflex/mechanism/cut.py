"""Link from a mechanism derived for computation, with divided beams or added members, to the one described."""

from collections.abc import Mapping
from dataclasses import dataclass
from functools import cached_property
from typing import Any

from paraflex.arrays import Brief
from .joints import PointRef


@dataclass(frozen=True)
class Cut(Brief):
    """Mechanism as described by the user, and the map from its bodies to those of a derived mechanism.

    Attributes
    ----------
    whole : Mechanism
        Mechanism as described.
    carriers : mapping
        Original body of each body of the derived mechanism, and the distance along it at which that body starts [m];
        empty if members were only added.
    points : mapping of PointRef to PointRef
        Points of divided bodies in the derived mechanism, by their points in the described one.
    """

    whole: Any
    carriers: Mapping[str, tuple[str, float]]
    points: Mapping[PointRef, PointRef]

    @cached_property
    def parts(self) -> dict[str, tuple[str, ...]]:
        """Parts of each body of the described mechanism, from the first end on; the body itself if it is undivided."""
        found: dict[str, list[str]] = {body.name: [] for body in self.whole.bodies}
        for part, (body, _) in self.carriers.items():
            found[body].append(part)
        return {body: tuple(parts) or (body,) for body, parts in found.items()}
