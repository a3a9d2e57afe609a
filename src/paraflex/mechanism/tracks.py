"""Beams that a joint slides along, and the mesh that such beams need."""

from collections.abc import Iterator
from dataclasses import replace
from math import ceil

import numpy as np

from .bodies import Body, FlexibleBeam
from .members import Members

# Longest element relative to the beam. With it, the driving torque of a crank shaper and the stress in its lever differ
# from those with 16 elements by less than 0.4 %; with elements of half a beam by 1.5 %, with a single element by 18 %.
LONGEST_ELEMENT = 1.0 / 3.0
# Allowance for the rounding of lengths, relative.
_ROUNDING = 1e-9


def tracks(mechanism: Members) -> Iterator[FlexibleBeam]:
    """Return the beams along which a joint slides."""
    names = {joint.a.body for joint in mechanism.joints if joint.follows_beam}
    return (body for body in mechanism.bodies if isinstance(body, FlexibleBeam) and body.name in names)


def longest_element(beam: FlexibleBeam) -> float:
    """Return the length of the longest element of a beam relative to the length of the beam."""
    nodes = np.real(beam.mesh.nodes)
    return float(np.max(np.diff(nodes)) / nodes[-1])


def with_meshes(mechanism: Members) -> tuple[Body, ...]:
    """Return the bodies of a mechanism, with default meshes of beams that a joint slides along set explicitly."""
    meshed = {beam.name: replace(beam, elements=_elements(beam)) for beam in tracks(mechanism) if beam.elements is None}
    return tuple(meshed.get(body.name, body) for body in mechanism.bodies)


def _elements(beam: FlexibleBeam) -> tuple[int, ...]:
    """Return the least number of elements per span with which none exceeds `LONGEST_ELEMENT`."""
    knots = np.real(beam.mesh.knots)
    return tuple(ceil(part / LONGEST_ELEMENT - _ROUNDING) for part in np.diff(knots) / knots[-1])


def too_long(beam: FlexibleBeam) -> bool:
    """Return whether a flexible beam has an element too long for a joint that slides along it."""
    return beam.flexible and longest_element(beam) > LONGEST_ELEMENT * (1.0 + _ROUNDING)
