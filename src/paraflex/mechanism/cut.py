"""What the user described, where a mechanism for computing has been made of it: beams cut up, members added."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from functools import cached_property
from typing import Any

from paraflex.mechanism.joints import PointRef


@dataclass(frozen=True)
class Cut:
    """The mechanism as described, and where the bodies of the one made of it are on its bodies.

    Attributes
    ----------
    whole : Mechanism
    carriers : mapping
        Of each body of the other mechanism the body it is a part of, and how far along that it starts [m]; empty where
        members were added only.
    points : mapping of PointRef to PointRef
        Points of bodies that were cut, and where they are now.
    """

    whole: Any
    carriers: Mapping[str, tuple[str, float]]
    points: Mapping[PointRef, PointRef]

    @cached_property
    def parts(self) -> dict[str, tuple[str, ...]]:
        """Parts of each body of the mechanism as described, first end first; itself if it was not cut."""
        found: dict[str, list[str]] = {body.name: [] for body in self.whole.bodies}
        for part, (body, _) in self.carriers.items():
            found[body].append(part)
        return {body: tuple(parts) or (body,) for body, parts in found.items()}
