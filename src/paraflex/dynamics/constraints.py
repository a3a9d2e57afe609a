"""What joints, springs, dampers, friction and prescribed motions hold, part by part, and in which order."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import numpy as np
import scipy

from paraflex.kernel.packed import ANGLE, AXIS, CONSTRAINT, DAMPER, FRICTION, POINT, SPRING
from paraflex.mechanism import Joint, Mechanism, PointRef


@dataclass(frozen=True)
class Constraint:
    """A joint or part of one, a prescribed motion, a spring, damper or friction before packing.

    A spring is a compliant constraint: value - rest = compliance * multiplier; so is a damper, of the value's rate.

    Attributes
    ----------
    name : str
    joint : str
        The joint that it is of or acts in.
    kind : int
        Of its ports: POINT, ANGLE or AXIS.
    a, b : PointRef
    labels : tuple of str
        One a row.
    signal : int
        Where it is driven in time, else -1.
    row : int
        Kind of its rows: CONSTRAINT, SPRING, DAMPER or FRICTION.
    compliance, limit : float
    rest : float
        What the value is compared with: of a spring at rest, of an angle held.
    direction : float
        Of an axis against body a [rad].
    carrier : str
        What carries an axis: the "material" at point a, the body's "frame" there, or its "track", from the frame's
        origin on.
    """

    name: str
    joint: str
    kind: int
    a: PointRef
    b: PointRef
    labels: tuple[str, ...]
    signal: int = -1
    row: int = CONSTRAINT
    compliance: float = 0.0
    limit: float = 0.0
    rest: float = 0.0
    direction: float = 0.0
    carrier: str = "material"


def _joint_constraints(joint: Joint) -> list[Constraint]:
    """What a joint holds."""
    name, a, b = joint.name, joint.a, joint.b
    normal, carrier = joint.direction + 0.5 * np.pi, "track" if joint.follows_beam else "material"
    parts = {
        "points": Constraint(name, name, POINT, a, b, (f"{name} x", f"{name} y")),
        "axis": Constraint(name, name, AXIS, a, b, (f"{name} normal",), direction=normal, carrier=carrier),
        "angle": Constraint(name, name, ANGLE, a, b, (f"{name} angle",), rest=joint.angle),
    }
    return [parts[held] for held in joint.holds]


def axis_of(joint: Joint) -> dict[str, Any]:
    """Direction and carrier of the axis that a joint's travel is measured on."""
    return {"direction": joint.direction, "carrier": "frame" if joint.follows_beam else "material"}


def _along(joint: Joint, name: str, **keywords) -> Constraint:
    """A compliant or driven row of a joint's coordinate."""
    if joint.slides:
        keywords |= axis_of(joint)
        return Constraint(name, joint.name, AXIS, joint.a, joint.b, (f"{name} travel",), **keywords)
    return Constraint(name, joint.name, ANGLE, joint.a, joint.b, (f"{name} angle",), **keywords)


def _constraints(mechanism: Mechanism) -> list[Constraint]:
    constraints = [part for joint in mechanism.joints for part in _joint_constraints(joint)]
    # Signals are the motors' torques first, then the prescribed motions.
    at_joints: list[tuple[Any, dict[str, Any]]] = [
        *((one, {"signal": len(mechanism.motors) + k}) for k, one in enumerate(mechanism.prescribed)),
        *((one, {"row": SPRING, "compliance": 1.0 / one.stiffness, "rest": one.rest}) for one in mechanism.springs),
        *((one, {"row": DAMPER, "compliance": 1.0 / one.coefficient}) for one in mechanism.dampers),
        *((one, {"row": FRICTION, "compliance": 1.0 / (one.limit / one.speed), "limit": one.limit})
          for one in mechanism.frictions),
    ]  # fmt: skip
    return constraints + [_along(mechanism.joint(one.joint), one.name, **keywords) for one, keywords in at_joints]


def constraint_count(mechanism: Mechanism) -> int:
    """How many constraints joints and prescribed motions are, redundant ones included."""
    return sum(len(one.labels) for one in _constraints(mechanism) if one.row == CONSTRAINT)


def row_order(mechanism: Mechanism, index: dict[str, int]) -> list[Constraint]:
    """Constraints in an order that keeps the envelope of the Schur complement small (reverse Cuthill-McKee)."""
    constraints = _constraints(mechanism)
    if not constraints:
        return []
    touched = [
        (i, index[ref.body])
        for i, constraint in enumerate(constraints)
        for ref in (constraint.a, constraint.b)
        if not ref.on_ground
    ]
    rows, columns = zip(*touched, strict=True)
    incidence = scipy.sparse.csr_matrix((np.ones(len(touched)), (rows, columns)), (len(constraints), len(index)))
    graph = scipy.sparse.csr_matrix(incidence @ incidence.T)
    order = scipy.sparse.csgraph.reverse_cuthill_mckee(graph, symmetric_mode=True)
    return [constraints[i] for i in order]
