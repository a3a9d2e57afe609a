"""Gears and other linear relations between joint coordinates."""

from collections.abc import Mapping
from dataclasses import dataclass, field

from paraflex.arguments import CheckedFields
from .quantities import field_metadata, finite, not_zero, optional

PHASE = field_metadata(
    "the coordinate of the second joint where that of the first is zero in rad, or m; by default that of the "
    "first assembly",
    finite,
)


class Relation(CheckedFields):
    """Linear relation between joint coordinates: their weighted sum equals the phase.

    For two joints, second = transmission * first + phase. A kind of relation is a dataclass derived from this class
    that declares these fields and defines `transmission` or `shares`, on which all other code relies.

    Attributes
    ----------
    name : str
        Name of the relation.
    first_joint, second_joint : str
        Names of the joints; their coordinates are those of body b relative to body a, slopes of beams included.
    phase : float, optional
        Coordinate of the second joint where that of the first is zero [rad or m]; by default its value in the first
        assembly, which a mechanism fills in.
    """

    name: str
    first_joint: str
    second_joint: str
    phase: float | None

    @property
    def transmission(self) -> float:
        """Derivative of the second joint coordinate with respect to the first: dimensionless, in m/rad or in rad/m."""
        raise NotImplementedError

    @property
    def joints(self) -> tuple[str, ...]:
        """Names of the joints, the first before the second."""
        return tuple(reversed(self.shares))

    @property
    def shares(self) -> dict[str, float]:
        """Weights of the joint coordinates by joint; the constraint row has the unit of the first."""
        return {self.second_joint: 1.0, self.first_joint: -self.transmission}


@dataclass(frozen=True)
class Gear(Relation):
    """Gear: the coordinate of the second joint is ratio times that of the first, plus phase.

    The ratio of two wheels with fixed centres is -r1/r2 for external meshing, and r1/r2 for internal meshing, a belt or
    a chain. The coordinate of a joint that slides is its travel: the ratio of a pinion and its rack is the pinion's
    radius [m/rad]. Angles are not limited to one turn. A gear acts on the material at the joints, as a motor does, by
    torques about them (a force along the axis where a joint slides). Forces of the teeth on the bearings are neglected.

    Attributes
    ----------
    name : str
        Name of the gear.
    first_joint, second_joint : str
        Names of the joints; their coordinates are those of body b relative to body a, slopes of beams included.
    ratio : float
        Transmission ratio: dimensionless, in m/rad or in rad/m, depending on the joints.
    phase : float, optional
        Coordinate of the second joint where that of the first is zero [rad or m]; by default its value in the first
        assembly, which a mechanism fills in.
    """

    _table = "gear"

    name: str
    first_joint: str = field(metadata=field_metadata("first joint", joint="moves"))
    second_joint: str = field(metadata=field_metadata("second joint", joint="moves"))
    ratio: float = field(
        metadata=field_metadata(
            "the second joint's angle over the first's, negative for external meshing; of a rack the radius of its "
            "pinion",
            not_zero,
            "as the second joint's angle or travel over the first's",
        )
    )
    phase: float | None = field(default=None, metadata=PHASE)

    @property
    def transmission(self) -> float:
        """Transmission ratio, `ratio`."""
        return self.ratio


def _weigh(weights: Mapping[str, float], field: str) -> None:
    for name, weight in weights.items():
        not_zero(weight, f"{field}.{name}", "as a weight of the joint's angle or travel, or leave the joint out")


@dataclass(frozen=True)
class SumRelation(Relation):
    """Constant weighted sum of joint coordinates, as for belts, differentials and planetary gears.

    Attributes
    ----------
    name : str
        Name of the relation.
    weights : mapping of str to float
        Weights by joint, with units such that all products have the same unit. The multiplier of the constraint row is
        the negative torque or force on the joint of largest weight; that on another joint is in the ratio of weights.
    phase : float, optional
        Value of the sum; by default its value in the first assembly, which a mechanism fills in.
    """

    _table = "relation"

    name: str
    weights: Mapping[str, float] = field(
        metadata=field_metadata("weights of joints' angles and travels", _weigh, joint="moves")
    )
    phase: float | None = optional(None, "the sum, by default that of the first assembly", finite)

    @property
    def shares(self) -> dict[str, float]:
        """Weights by joint, the largest in magnitude first."""
        return dict(sorted(self.weights.items(), key=lambda one: -abs(one[1])))
