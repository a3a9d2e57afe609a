"""Joints along beams: straight axes where the pin seems to slide along a beam that bends."""

from __future__ import annotations

from collections.abc import Iterator
from math import cos, sin

from paraflex.arrays import Array
from paraflex.dynamics import System, joint_coordinate
from paraflex.findings import Finding
from paraflex.mechanism import FlexibleBeam, Mechanism

# Sine of the angle between an axis and its beam below which the axis is along the beam.
_ALONG = 1e-6


def axes_along_beams(mechanism: Mechanism, rigid: System, q: Array) -> Iterator[Finding]:
    """Yield slots and prismatic joints whose axis is along a flexible beam and whose pin is on it, at rigid q (n,)."""
    for joint in mechanism.joints:
        beam = None if joint.a.on_ground else mechanism.body(joint.a.body)
        if not joint.slides or joint.follows_beam or not isinstance(beam, FlexibleBeam) or not beam.flexible:
            continue
        start = beam.points[joint.a.point]
        place = start + cos(joint.direction) * joint_coordinate(rigid, joint.name, q[None]).value[0]
        if abs(sin(joint.direction)) < _ALONG and 0.0 < place < beam.length:
            yield Finding(
                "axis-along-beam", f"joint.{joint.name}",
                f"its axis is a straight line through {joint.a}, which turns with the slope there: {joint.b}, at "
                f"{place:.3g} m along {beam.name}, presses on it with a force and a moment at {joint.a}, not there",
                f'if {joint.b} runs along {beam.name} as it bends, use type = "sliding"',
            )  # fmt: skip
