"""Constraints of joints and compliant members as sums of terms, and their order."""

from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from typing import Any, NamedTuple

import numpy as np
import scipy

from paraflex.kernel.packed import ANGLE, AXIS, CONSTRAINT, DAMPER, FRICTION, POINT, SPRING
from paraflex.mechanism import Joint, Mechanism, PointRef, Relation
from .inputs import inputs_of


@dataclass(frozen=True)
class Term:
    """A term of a constraint: a quantity of point b less that of point a, times a weight.

    Attributes
    ----------
    joint : str
        Joint that the term belongs to.
    kind : int
        Quantity: POINT for both coordinates; ANGLE; or AXIS for the position of b along an axis carried by a.
    a, b : PointRef
        Points of the joint.
    weight : float
        Weight of the term in the constraint.
    direction : float
        Direction of the axis relative to body a [rad].
    carrier : str
        Carrier of the axis: the "material" at point a, the body's "frame" there, its "track", measured from the frame's
        origin, or "nothing", in which case the axis points from a to b.
    """

    joint: str
    kind: int
    a: PointRef
    b: PointRef
    weight: float = 1.0
    direction: float = 0.0
    carrier: str = "material"


@dataclass(frozen=True)
class Constraint:
    """A joint or part of one, a prescribed motion, a spring, a damper or friction, before packing.

    Its value is a sum of terms. A spring is a compliant constraint: value - rest = compliance * multiplier; a damper is
    the same in the rate of the value.

    Attributes
    ----------
    name : str
        Name of the joint or member.
    terms : tuple of Term
        Terms of the value; the kind of the first decides whether the value is a length or an angle.
    labels : tuple of str
        Row names, one per row.
    signal : int
        Number of the signal that prescribes the value in time, -1 for none.
    row : int
        Kind of its rows: CONSTRAINT, SPRING, DAMPER or FRICTION.
    compliance, limit : float
        Compliance of a spring, damper or friction, and limit of the friction force or torque; zero for constraints.
    rest : float
        Reference for the value: that of an unloaded spring, or of a fixed angle or length.
    """

    name: str
    terms: tuple[Term, ...]
    labels: tuple[str, ...]
    signal: int = -1
    row: int = CONSTRAINT
    compliance: float = 0.0
    limit: float = 0.0
    rest: float = 0.0

    @property
    def points(self) -> Iterator[PointRef]:
        """Points of all terms."""
        return (ref for term in self.terms for ref in (term.a, term.b))


def _joint_constraints(joint: Joint) -> list[Constraint]:
    """Return the constraints of a joint."""
    name, a, b = joint.name, joint.a, joint.b
    normal, carrier = joint.direction + 0.5 * np.pi, "track" if joint.follows_beam else "material"
    axis = Term(name, AXIS, a, b, direction=normal, carrier=carrier)
    between = Term(name, AXIS, a, b, carrier="nothing")
    parts = {
        "points": Constraint(name, (Term(name, POINT, a, b),), (f"{name} x", f"{name} y")),
        "axis": Constraint(name, (axis,), (f"{name} normal",)),
        "angle": Constraint(name, (Term(name, ANGLE, a, b),), (f"{name} angle",), rest=joint.angle),
        "distance": Constraint(name, (between,), (f"{name} length",), rest=joint.length or 0.0),
    }
    return [parts[held] for held in joint.holds]


def coordinate(joint: Joint, weight: float = 1.0) -> Term:
    """Return the term of a joint's coordinate, times a weight."""
    if joint.slides:
        carrier = "frame" if joint.follows_beam else "material"
        return Term(joint.name, AXIS, joint.a, joint.b, weight, joint.direction, carrier)
    return Term(joint.name, ANGLE, joint.a, joint.b, weight)


def coordinate_kind(joint: Joint) -> str:
    """Return the kind of a joint's coordinate: "travel" or "angle"."""
    return "travel" if joint.slides else "angle"


def _along(joint: Joint, name: str, **keywords) -> Constraint:
    """Return a compliant or driven row on a joint's coordinate."""
    return Constraint(name, (coordinate(joint),), (f"{name} {coordinate_kind(joint)}",), **keywords)


def _constraints(mechanism: Mechanism) -> list[Constraint]:
    constraints = [part for joint in mechanism.joints for part in _joint_constraints(joint)]
    at_joints: list[tuple[Any, dict[str, Any]]] = [
        *((one, {"signal": k}) for k, one in zip(inputs_of(mechanism).prescribed, mechanism.prescribed, strict=True)),
        *((one, {"row": SPRING, "compliance": 1.0 / one.stiffness, "rest": one.rest}) for one in mechanism.springs),
        *((one, {"row": DAMPER, "compliance": 1.0 / one.coefficient}) for one in mechanism.dampers),
        *((one, {"row": FRICTION, "compliance": 1.0 / (one.limit / one.speed), "limit": one.limit})
          for one in mechanism.frictions),
    ]  # fmt: skip
    constraints += [_along(mechanism.joint(one.joint), one.name, **keywords) for one, keywords in at_joints]
    return constraints + [_relation_constraint(mechanism, one) for one in mechanism.relations]


def _relation_constraint(mechanism: Mechanism, one: Relation) -> Constraint:
    """Return a relation's constraint: weighted sum of joint coordinates less the phase, over the first weight."""
    joints, (scale, *_) = [mechanism.joint(name) for name in one.shares], one.shares.values()
    assert one.phase is not None
    terms = tuple(coordinate(joint, one.shares[joint.name] / scale) for joint in joints)
    return Constraint(one.name, terms, (f"{one.name} {coordinate_kind(joints[0])}",), rest=one.phase / scale)


def constraint_count(mechanism: Mechanism) -> int:
    """Return the number of constraint rows of joints, prescribed motions and gears, redundant ones included."""
    return sum(len(one.labels) for one in _constraints(mechanism) if one.row == CONSTRAINT)


class RowTerm(NamedTuple):
    """A term of constraint rows, and the numbers of these rows."""

    rows: list[int]
    term: Term


def terms_by_joint(constraints: Sequence[Constraint]) -> dict[str, list[RowTerm]]:
    """Group the terms of constraints, given in the order of their rows, by joint."""
    found, row = {}, 0
    for constraint in constraints:
        rows = list(range(row, row := row + len(constraint.labels)))
        for term in constraint.terms:
            found.setdefault(term.joint, []).append(RowTerm(rows, term))
    return found


def row_order(mechanism: Mechanism) -> list[Constraint]:
    """Order the constraints for a small envelope of the Schur complement (reverse Cuthill-McKee)."""
    constraints = _constraints(mechanism)
    if not constraints:
        return []
    index = {body.name: i for i, body in enumerate(mechanism.bodies)}
    touched = [
        (i, index[ref.body])
        for i, constraint in enumerate(constraints)
        for ref in constraint.points
        if not ref.on_ground
    ]
    rows, columns = zip(*touched, strict=True)
    incidence = scipy.sparse.csr_matrix((np.ones(len(touched)), (rows, columns)), (len(constraints), len(index)))
    graph = scipy.sparse.csr_matrix(incidence @ incidence.T)
    order = scipy.sparse.csgraph.reverse_cuthill_mckee(graph, symmetric_mode=True)
    return [constraints[i] for i in order]
