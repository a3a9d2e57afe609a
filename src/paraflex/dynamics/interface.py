"""Interface of a body: the coordinates of its points that joints, motors, springs, loads and lumps act on."""

from __future__ import annotations

from collections.abc import Callable, Iterator, Sequence

import numpy as np

from paraflex.arrays import Numbers
from paraflex.dynamics.constraints import Constraint
from paraflex.dynamics.coordinates import BodyCoordinates, Marker, make_marker
from paraflex.dynamics.held import place_rows, slope_rows
from paraflex.errors import InputError
from paraflex.kernel.packed import ANGLE, POINT
from paraflex.mechanism import AppliedTorque, ComponentModes, FlexibleBeam, Mechanism, PointRef

Rows = Callable[[Marker], Numbers]


def interface_rows(
    mechanism: Mechanism,
    bodies: Sequence[BodyCoordinates],
    constraints: Sequence[Constraint],
    name: str,
) -> Numbers:
    """Return rows on (r, phi, u) of a body: positions and rotations of its points that members act on, each once.

    Rows for joints, prescribed motions, gears, springs, dampers and friction follow from their constraints. Motors,
    loads and lumps add to these, and so does the position of the end-effector, which paths refer to.

    Parameters
    ----------
    mechanism : Mechanism
        Mechanism of the body.
    bodies : sequence of BodyCoordinates
        Coordinates of all bodies.
    constraints : sequence of Constraint
        Constraints of the mechanism.
    name : str
        Name of the body.

    Raises
    ------
    InputError
        A member slides along the body, which therefore has no fixed interface.
    """
    acting = dict.fromkeys((ref.point, rows) for ref, rows in _acting(mechanism, constraints) if ref.body == name)
    index = {body.name: i for i, body in enumerate(bodies)}
    rows = [np.zeros((0, 3 + bodies[index[name]].nf))]
    for point, of_marker in acting:
        rows.append(of_marker(make_marker(mechanism, tuple(bodies), index, PointRef(name, point))))
    return np.concatenate(rows)


def _acting(mechanism: Mechanism, constraints: Sequence[Constraint]) -> Iterator[tuple[PointRef, Rows]]:
    """Yield points and the rows of the loads there: forces act on positions, moments on rotations."""
    for term in (term for constraint in constraints for term in constraint.terms):
        if term.carrier in ("frame", "track"):
            beam = None if term.a.on_ground else mechanism.body(term.a.body)
            if isinstance(beam, FlexibleBeam) and beam.reduction is ComponentModes.CRAIG_BAMPTON:
                raise InputError(
                    "a joint slides along it, so that static shapes are not sufficient",
                    field=f"body.{beam.name}.reduction", value=beam.reduction.value,
                    remedy='leave it out, or write "modal"',
                )  # fmt: skip
        if term.kind != ANGLE:
            yield from ((term.a, place_rows), (term.b, place_rows))
        # A member that slides along an axis exerts its force off the point that carries the axis.
        if term.kind != POINT and term.carrier != "nothing":
            yield term.a, slope_rows
        if term.kind == ANGLE:
            yield term.b, slope_rows
    for motor in mechanism.motors:
        joint = mechanism.joint(motor.joint)
        for ref in (joint.a, joint.b):
            if joint.slides:
                yield ref, place_rows
            if not joint.slides or ref is joint.a:
                yield ref, slope_rows
    for load in mechanism.loads:
        yield load.point, slope_rows if isinstance(load, AppliedTorque) else place_rows
    for spring in mechanism.linear_springs:
        yield from ((spring.a, place_rows), (spring.b, place_rows))
    for body in mechanism.bodies:
        for lump in body.lumps if isinstance(body, FlexibleBeam) else ():
            yield PointRef(body.name, lump.point), place_rows
            if lump.inertia > 0.0:
                yield PointRef(body.name, lump.point), slope_rows
    if mechanism.end_effector is not None:
        yield mechanism.end_effector.point, place_rows
