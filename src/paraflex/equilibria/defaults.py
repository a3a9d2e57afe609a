"""Statics that a model proposes: what `statics` finds of it unless asked otherwise."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field
from typing import Any, Protocol

from paraflex.kinematics import ModelWithPaths

# Fields that say what is given. Who chooses one of them chooses all.
GIVEN = ("loads", "torques", "moved")
STEPS, FACTORS = 10, 1


@dataclass(frozen=True)
class StaticsDefaults:
    """Arguments of `statics` that are not given, as a model has them; see there.

    Attributes
    ----------
    loads, torques, moved : mapping of str to float
    held : tuple of str, optional
    steps : int
    stiffness : tuple of str, optional
    buckling : int
    """

    loads: Mapping[str, float] = field(default_factory=dict)
    torques: Mapping[str, float] = field(default_factory=dict)
    moved: Mapping[str, float] = field(default_factory=dict)
    held: tuple[str, ...] | None = None
    steps: int = STEPS
    stiffness: tuple[str, ...] | None = None
    buckling: int = FACTORS

    def filled(self, **chosen: Any) -> StaticsDefaults:
        """These with what a caller chooses that is not None; see `chosen_over` of loads, torques and travel."""
        given = {name: value for name, value in chosen.items() if value is not None}
        return StaticsDefaults(**chosen_over(vars(self), given))


class ModelWithStatics(ModelWithPaths, Protocol):
    """A model that proposes its statics: what `paraflex.load` reads."""

    @property
    def statics(self) -> StaticsDefaults:
        """What is given unless asked otherwise."""
        ...


def chosen_over(own: Mapping[str, Any], chosen: Mapping[str, Any]) -> dict[str, Any]:
    """Fields by name with others in their place: a load, torque or travel that is chosen replaces all of these."""
    replaced = GIVEN if any(name in chosen for name in GIVEN) else ()
    return {name: value for name, value in own.items() if name not in replaced} | dict(chosen)
