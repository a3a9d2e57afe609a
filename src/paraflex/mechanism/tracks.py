"""Beams that a joint slides along, and the mesh that they need under it."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import replace
from math import ceil

import numpy as np

from paraflex.mechanism.bodies import Body, FlexibleBeam
from paraflex.mechanism.members import Members

# The longest element over its beam: with it the torque that drives a crank shaper and the stress of its lever are
# within 0.4 % of those of 16 elements; with half of the beam they are 1.5 % off, with the whole of it 18 %.
LONGEST_ELEMENT = 1.0 / 3.0
# Rounding of lengths.
_ROUNDING = 1e-9


def tracks(mechanism: Members) -> Iterator[FlexibleBeam]:
    """The beams along which a joint slides."""
    names = {joint.a.body for joint in mechanism.joints if joint.follows_beam}
    return (body for body in mechanism.bodies if isinstance(body, FlexibleBeam) and body.name in names)


def longest_element(beam: FlexibleBeam) -> float:
    """The longest element of a beam as a part of the beam."""
    nodes = np.real(beam.mesh.nodes)
    return float(np.max(np.diff(nodes)) / nodes[-1])


def with_meshes(mechanism: Members) -> tuple[Body, ...]:
    """The bodies of a mechanism, with elements for the beams along which a joint slides where none are given."""
    meshed = {beam.name: replace(beam, elements=_elements(beam)) for beam in tracks(mechanism) if beam.elements is None}
    return tuple(meshed.get(body.name, body) for body in mechanism.bodies)


def _elements(beam: FlexibleBeam) -> tuple[int, ...]:
    """As few elements a span as keep each within the longest."""
    knots = np.real(beam.mesh.knots)
    return tuple(ceil(part / LONGEST_ELEMENT - _ROUNDING) for part in np.diff(knots) / knots[-1])


def too_long(beam: FlexibleBeam) -> bool:
    """Whether an element is longer than what is right under a joint that slides along."""
    return beam.flexible and longest_element(beam) > LONGEST_ELEMENT * (1.0 + _ROUNDING)
