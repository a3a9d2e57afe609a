"""Error of modal reduction in the rotation of a body under moments at its joints.

Modes of a body in its frame are free of moments where the frame does not clamp it: with the pinned frame, at both ends.
Their series converges to the rotation of an end under a moment with the first power of 1/modes only, while the
deflection under forces converges with the third. A beam clamped by a weld is too stiff by the same error.
"""

from collections.abc import Iterator
from dataclasses import replace
from typing import NamedTuple

import numpy as np

from paraflex.mechanism import AppliedTorque, Mechanism, PointRef, grouped, joints_named
from .coordinates import BodyCoordinates, PlacedBodies
from .system import System

# Missing fractions of a rotation below this are not reported.
_MISSED = 0.05


class MissingRotation(NamedTuple):
    """A point of a reduced body whose rotation under a moment is too small.

    Attributes
    ----------
    point : PointRef
        Point of the body.
    cause : str
        Member that exerts a moment there.
    modes : int
        Number of modes kept of the body.
    part : float
        Fraction missing from the static rotation against the body frame under a moment there.
    """

    point: PointRef
    cause: str
    modes: int
    part: float


def missing_rotations(system: System) -> list[MissingRotation]:
    """Return the points at which reduced bodies rotate over five per cent too little under a moment, body by body.

    Bases chosen for a motion (`Mechanism.bases`) are not examined: their runs show their error.
    """
    found: dict[PointRef, MissingRotation] = {}
    for point, cause in _moments(system.mechanism):
        body = system.body(point.body)
        chosen, reduced = body.name in system.mechanism.bases, 0 < body.nf < body.shape.integrals.nf
        if chosen or not reduced or point in found:
            continue
        part = _missed(body, system, point)
        if part > _MISSED:
            found[point] = MissingRotation(point, cause, body.nf, part)
    return sorted(found.values(), key=lambda one: system.index[one.point.body])


def _missed(body: BodyCoordinates, system: System, point: PointRef) -> float:
    whole = body.shape.integrals
    unreduced = PlacedBodies(system.mechanism, (replace(body, integrals=whole, points=None),))
    slope = unreduced.marker(point).slope
    turn = float(slope @ np.linalg.solve(whole.K, slope))
    kept = float(np.sum((system.marker(point).slope / body.modes.omega) ** 2))
    return 1.0 - kept / turn if turn > 0.0 else 0.0


def _moments(mechanism: Mechanism) -> Iterator[tuple[PointRef, str]]:
    """Yield the points of bodies at which joints or loads apply moments, with their descriptions."""
    causes = [
        (f"the {'rail' if joint.slides else joint.kind} {joint.name}", joint)
        for joint in mechanism.joints
        if "angle" in joint.holds
    ]
    causes += [
        (f"the {group.noun} {one.name}", joint)
        for group, members in grouped(mechanism)
        for one in (() if group.measures else members)
        for _, name, _ in joints_named(one)
        if not (joint := mechanism.joint(name)).slides
    ]
    for cause, joint in causes:
        for point in (joint.a, joint.b):
            if not point.on_ground:
                yield point, cause
    for load in mechanism.loads:
        if isinstance(load, AppliedTorque):
            yield from ((point, f"the load {load.name}") for point in load.points)
