"""Gears and other relations, in which one joint's coordinate follows another's."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field

from paraflex.arguments import CheckedFields
from paraflex.mechanism.quantities import finite, not_zero, optional, said

PHASE = said(
    "the coordinate of the second joint where that of the first is zero in rad, or m; by default as the first assembly "
    "stands",
    finite,
)


class Relation(CheckedFields):
    """A weighted sum of joints' coordinates is the phase; of two joints: second = transmission * first + phase.

    A kind of relation is a dataclass derived from this one. It has these fields, in its own words, and says what its
    transmission is; all else asks that.

    Attributes
    ----------
    name : str
    first_joint, second_joint : str
        Their coordinates are those of body b against body a, slopes of beams included.
    phase : float, optional
        Coordinate of the second joint where that of the first is zero [rad or m]. By default as the first assembly
        stands; a mechanism has the number.
    """

    name: str
    first_joint: str
    second_joint: str
    phase: float | None

    @property
    def transmission(self) -> float:
        """Derivative of the second joint's coordinate by the first's: without unit, in m/rad or in rad/m."""
        raise NotImplementedError

    @property
    def joints(self) -> tuple[str, ...]:
        """Names of the joints, the first before the second."""
        return tuple(reversed(self.shares))

    @property
    def shares(self) -> dict[str, float]:
        """Weights of the joints' coordinates in the sum; the row is in the unit of the first of these."""
        return {self.second_joint: 1.0, self.first_joint: -self.transmission}


@dataclass(frozen=True)
class Gear(Relation):
    """The coordinate of the second joint is ratio times that of the first, plus phase.

    Of two wheels with fixed centres the ratio is -r1/r2 where they mesh outside, r1/r2 where one lies within the other,
    or where a belt or a chain joins them. A joint that slides has a travel: of a pinion and its rack the ratio is the
    pinion's radius [m/rad]. Angles count turns. Like a motor a gear acts on the material at the joints, by torques
    about them (a force along the axis where a joint slides); what teeth press on the bearings besides is not in it.

    Attributes
    ----------
    name : str
    first_joint, second_joint : str
        Their coordinates are those of body b against body a, slopes of beams included.
    ratio : float
        By the kinds of the joints without unit, in m/rad or in rad/m.
    phase : float, optional
        Coordinate of the second joint where that of the first is zero [rad or m]. By default as the first assembly
        stands; a mechanism has the number.
    """

    _table = "gear"

    name: str
    first_joint: str = field(metadata=said("first joint", joint="moves"))
    second_joint: str = field(metadata=said("second joint", joint="moves"))
    ratio: float = field(
        metadata=said(
            "the second joint's angle by the first's, negative where wheels mesh outside; of a rack the radius of its "
            "pinion",
            not_zero,
            "as the second joint's angle or travel by the first's",
        )
    )
    phase: float | None = field(default=None, metadata=PHASE)

    @property
    def transmission(self) -> float:
        """The ratio."""
        return self.ratio


def _weigh(weights: Mapping[str, float], field: str) -> None:
    for name, weight in weights.items():
        not_zero(weight, f"{field}.{name}", "as a weight of the joint's angle or travel, or leave the joint out")


@dataclass(frozen=True)
class SumRelation(Relation):
    """The sum of joints' coordinates, each times its weight, is constant: of belts, differentials, planetary gears.

    Attributes
    ----------
    name : str
    weights : mapping of str to float
        By joint; their units are such that the products have one. The row's multiplier is the torque or force on the
        joint of largest weight, less; that on each other is as its weight to this one.
    phase : float, optional
        The sum, by default as the first assembly stands; a mechanism has the number.
    """

    _table = "relation"

    name: str
    weights: Mapping[str, float] = field(metadata=said("weights of joints' angles and travels", _weigh, joint="moves"))
    phase: float | None = optional(None, "the sum, by default that of the first assembly", finite)

    @property
    def shares(self) -> dict[str, float]:
        """The weights, the largest first."""
        return dict(sorted(self.weights.items(), key=lambda one: -abs(one[1])))
