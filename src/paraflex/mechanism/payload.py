"""Payload at the end-effector, and bodies with additional mass and moment of inertia."""

from collections.abc import Sequence
from dataclasses import dataclass, field, replace
from typing import Any

import numpy as np

from paraflex.arguments import CheckedFields, with_fields
from paraflex.errors import InputError
from .bodies import Body, LumpedMass, RigidBody
from .modal import ModalBody
from .quantities import check_numbers, field_metadata, finite, not_negative, optional


@dataclass(frozen=True)
class Payload(CheckedFields):
    """Mass fixed to the point of the end-effector.

    Attributes
    ----------
    mass : float
        Mass [kg].
    inertia : float
        Moment of inertia about the payload's centre of mass [kg m^2]; 0 by default.
    offset : (x, y)
        Vector from the end-effector's point to the payload's centre of mass in the frame of the body [m]; 0 by default.
    """

    _table = "payload"

    mass: float = field(metadata=field_metadata("the mass in kg", not_negative))
    inertia: float = optional(0.0, "the moment of inertia about its centre of mass in kg m^2", not_negative)
    offset: tuple[float, float] = optional(
        (0.0, 0.0),
        "[x, y] in m from the end-effector's point to its centre of mass, in the frame of the body that carries it",
        finite,
    )

    def __post_init__(self) -> None:
        super().__post_init__()
        check_numbers(self, "payload")


def together(one: Payload | None, other: Payload) -> Payload:
    """Combine two payloads into one, about their common centre of mass."""
    if one is None or not one.mass + other.mass:
        return other
    return Payload(*_as_one((one.mass, other.mass), (one.inertia, other.inertia), (one.offset, other.offset)))


def loaded(body: Body, point: str, payload: Payload) -> Body:
    """Return a body with a payload at one of its points, in addition to the mass that it has.

    Raises
    ------
    InputError
        The payload has an offset, and the body is a beam or given by matrices.
    """
    if any(payload.offset) and not isinstance(body, RigidBody):
        raise InputError(
            f'"{body.name}" bends, and has no lumps beside its points', field="payload.offset", value=payload.offset,
            remedy="leave it out, or weld a rigid body of that mass to the point",
        )  # fmt: skip
    return replace(with_lump(body, point, payload.mass, payload.inertia, payload.offset))


def with_lump(
    body: Body, point: str, mass: float, inertia: float = 0.0, offset: tuple[float, float] = (0.0, 0.0)
) -> Body:
    """Return a body with an additional mass and moment of inertia at one of its points, without checks.

    Parameters
    ----------
    body : Body
        Body to which the mass is added.
    point : str
        Name of a point of the body.
    mass, inertia : float
        Additional mass [kg], and its moment of inertia about its own centre of mass [kg m^2].
    offset : (x, y)
        Vector from the point to that centre in the frame of a rigid body [m]; ignored for other bodies.
    """
    if isinstance(body, RigidBody):
        places = (body.centre_of_mass, np.add(body.points[point], offset))
        mass, inertia, centre = _as_one((body.mass, mass), (body.inertia, inertia), places)
        return with_fields(body, mass=mass, inertia=inertia, centre_of_mass=centre)
    if isinstance(body, ModalBody):
        return _with_point_mass(body, point, mass, inertia)
    there = [lump for lump in body.lumps if lump.point == point]
    others = [lump for lump in body.lumps if lump.point != point]
    mass, inertia = mass + sum(lump.mass for lump in there), inertia + sum(lump.inertia for lump in there)
    return with_fields(body, lumps=(*others, with_fields(LumpedMass(point, 0.0), mass=mass, inertia=inertia)))


def _as_one(masses: Sequence[float], inertias: Sequence[float], places: Sequence[Any]) -> tuple[Any, Any, Any]:
    """Return mass, moment of inertia and centre of mass of two bodies combined, by the parallel axis theorem."""
    m, at = np.array(masses), np.array(places)
    centre = m @ at / m.sum()
    inertia = np.array(sum(inertias) + m @ np.sum((at - centre) ** 2, axis=1))
    return m.sum().item(), inertia.item(), tuple(centre.tolist())


def _with_point_mass(body: ModalBody, point: str, mass: float, inertia: float) -> ModalBody:
    """Return a body given by matrices with the terms of a point mass and a lumped moment of inertia added."""
    (x, y), (along, across), slope = body.point(point)
    shape = np.array([along, across])
    translation = mass * shape.T @ shape
    mass_matrix = np.array(body.mass_matrix)
    skew = np.outer(along, across)
    return with_fields(
        body,
        mass=body.mass + mass,
        first_moment=np.array(body.first_moment) + mass * np.array([x, y]),
        inertia=body.inertia + mass * (x**2 + y**2) + inertia,
        mass_matrix=mass_matrix + translation + inertia * np.outer(slope, slope),
        S2=np.array(body.S2) + mass * shape,
        I1=np.array(body.I1) + mass * (x * along + y * across),
        G1=np.array(body.G1) + mass * (x * across - y * along) + inertia * slope,
        G2=np.array(body.G2) + mass * (skew - skew.T),
        I2=(mass_matrix if body.I2 is None else np.array(body.I2)) + translation,
    )
