"""Interface of a body: the coordinates of its points that joints, motors, springs, loads and lumps act on."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from enum import Enum

import numpy as np

from paraflex.arrays import Numbers
from paraflex.dynamics.constraints import Constraint
from paraflex.dynamics.coordinates import BodyCoordinates, make_marker
from paraflex.dynamics.held import place_rows, slope_row
from paraflex.errors import InputError
from paraflex.kernel.packed import ANGLE, POINT
from paraflex.mechanism import AppliedTorque, BodyReduction, FlexibleBeam, Mechanism, PointRef


class Acting(Enum):
    """What acts at a point: forces, at its place, or moments, at its turn."""

    FORCE = "force"
    MOMENT = "moment"


def interface_rows(
    mechanism: Mechanism,
    bodies: Sequence[BodyCoordinates],
    constraints: Sequence[Constraint],
    name: str,
) -> Numbers:
    """Rows on the coordinates (r, phi, u) of a body: places and turns of its points that something acts on, each once.

    Those of joints, prescribed motions, gears, springs, dampers and friction follow from the constraints they make;
    motors, loads and lumps come to these, and the place of the end-effector, which paths are for.

    Raises
    ------
    InputError
        Something slides along the body: it acts everywhere.
    """
    acting = dict.fromkeys((ref.point, what) for ref, what in _acting(mechanism, constraints) if ref.body == name)
    index = {body.name: i for i, body in enumerate(bodies)}
    rows = [np.zeros((0, 3 + bodies[index[name]].nf))]
    for point, what in acting:
        marker = make_marker(mechanism, tuple(bodies), index, PointRef(name, point))
        rows.append(place_rows(marker) if what is Acting.FORCE else slope_row(marker)[None])
    return np.concatenate(rows)


def _acting(mechanism: Mechanism, constraints: Sequence[Constraint]) -> Iterator[tuple[PointRef, Acting]]:
    for term in (term for constraint in constraints for term in constraint.terms):
        if term.carrier != "material":
            _refuse_sliding(mechanism, term.a)
        if term.kind != ANGLE:
            yield from ((term.a, Acting.FORCE), (term.b, Acting.FORCE))
        # What slides along an axis pushes beside the point that carries it.
        if term.kind != POINT:
            yield term.a, Acting.MOMENT
        if term.kind == ANGLE:
            yield term.b, Acting.MOMENT
    for motor in mechanism.motors:
        joint = mechanism.joint(motor.joint)
        for ref in (joint.a, joint.b):
            if joint.slides:
                yield ref, Acting.FORCE
            if not joint.slides or ref is joint.a:
                yield ref, Acting.MOMENT
    for load in mechanism.loads:
        yield load.point, Acting.MOMENT if isinstance(load, AppliedTorque) else Acting.FORCE
    for spring in mechanism.linear_springs:
        yield from ((spring.a, Acting.FORCE), (spring.b, Acting.FORCE))
    for body in mechanism.bodies:
        for lump in body.lumps if isinstance(body, FlexibleBeam) else ():
            yield PointRef(body.name, lump.point), Acting.FORCE
            if lump.inertia > 0.0:
                yield PointRef(body.name, lump.point), Acting.MOMENT
    if mechanism.end_effector is not None:
        yield mechanism.end_effector.point, Acting.FORCE


def _refuse_sliding(mechanism: Mechanism, ref: PointRef) -> None:
    beam = None if ref.on_ground else mechanism.body(ref.body)
    if isinstance(beam, FlexibleBeam) and beam.reduction is BodyReduction.CRAIG_BAMPTON:
        raise InputError(
            "something slides along it, so that no static shapes are all it needs", field=f"body.{ref.body}.reduction",
            value=beam.reduction.value, remedy='leave it out, or say "modal"',
        )  # fmt: skip
