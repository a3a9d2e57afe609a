"""Constraints of joints and compliant members, part by part, and their order."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from typing import Any, NamedTuple

import numpy as np
import scipy

from paraflex.dynamics.inputs import inputs_of
from paraflex.kernel.packed import ANGLE, AXIS, CONSTRAINT, DAMPER, FRICTION, POINT, SPRING
from paraflex.mechanism import Joint, Mechanism, PointRef, Relation


@dataclass(frozen=True)
class Term:
    """A part of a joint's constraint: a quantity of point b less that of point a, times a weight.

    Attributes
    ----------
    joint : str
    kind : int
        The quantity: POINT, both coordinates; ANGLE; or AXIS, the place of b along an axis that a carries.
    a, b : PointRef
    weight : float
    direction : float
        Of an axis against body a [rad].
    carrier : str
        What carries an axis: the "material" at point a, the body's "frame" there, its "track", from the frame's
        origin on, or "nothing": then it points from a to b.
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
    """A joint or part of one, a prescribed motion, a spring, damper or friction before packing.

    Its value is a sum of terms. A spring is a compliant constraint: value - rest = compliance * multiplier; so is a
    damper, of the value's rate.

    Attributes
    ----------
    name : str
    terms : tuple of Term
        The first says what the value is: a length or an angle.
    labels : tuple of str
        One a row.
    signal : int
        Where it is driven in time, else -1.
    row : int
        Kind of its rows: CONSTRAINT, SPRING, DAMPER or FRICTION.
    compliance, limit : float
    rest : float
        What the value is compared with: of a spring at rest, of an angle held.
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
    """Constraints of a joint."""
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
    """A joint's coordinate times a weight."""
    if joint.slides:
        carrier = "frame" if joint.follows_beam else "material"
        return Term(joint.name, AXIS, joint.a, joint.b, weight, joint.direction, carrier)
    return Term(joint.name, ANGLE, joint.a, joint.b, weight)


def coordinate_kind(joint: Joint) -> str:
    """Kind of a joint's coordinate."""
    return "travel" if joint.slides else "angle"


def _along(joint: Joint, name: str, **keywords) -> Constraint:
    """A compliant or driven row of a joint's coordinate."""
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
    """Sum of joints' coordinates times their weights less the phase, over the first of these weights."""
    joints, (scale, *_) = [mechanism.joint(name) for name in one.shares], one.shares.values()
    assert one.phase is not None
    terms = tuple(coordinate(joint, one.shares[joint.name] / scale) for joint in joints)
    return Constraint(one.name, terms, (f"{one.name} {coordinate_kind(joints[0])}",), rest=one.phase / scale)


def constraint_count(mechanism: Mechanism) -> int:
    """Number of constraint rows of joints, prescribed motions and gears, redundant ones included."""
    return sum(len(one.labels) for one in _constraints(mechanism) if one.row == CONSTRAINT)


class RowTerm(NamedTuple):
    """A term of constraint rows, and the numbers of these rows."""

    rows: list[int]
    term: Term


def terms_by_joint(constraints: Sequence[Constraint]) -> dict[str, list[RowTerm]]:
    """Terms of constraints, which are in the order of their rows, by the joints that they are of."""
    found, row = {}, 0
    for constraint in constraints:
        rows = list(range(row, row := row + len(constraint.labels)))
        for term in constraint.terms:
            found.setdefault(term.joint, []).append(RowTerm(rows, term))
    return found


def row_order(mechanism: Mechanism, index: dict[str, int]) -> list[Constraint]:
    """An order of constraints with a small envelope of the Schur complement (reverse Cuthill-McKee)."""
    constraints = _constraints(mechanism)
    if not constraints:
        return []
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
