"""Beams with several floating frames, which are divided into as many beams, welded end to end.

Deflections are relative to each frame, so slopes remain small when the whole beam has large deflections.
"""

from bisect import bisect_right
from collections.abc import Mapping, Sequence
from dataclasses import replace
from itertools import pairwise
from typing import Any

from paraflex.errors import InputError
from .bodies import Body, FlexibleBeam
from .cut import Cut
from .joints import PointRef, WeldJoint
from .mechanism import Mechanism
from .segments import FIRST_END, LAST_END, moved, rebuilt
from .sensors import Sensor

# Positions closer than this fraction of the beam coincide.
_SAME = 1e-9


def in_frames(mechanism: Mechanism) -> Mechanism:
    """Return the mechanism with one beam for each floating frame; the given mechanism if every beam has one frame.

    Raises
    ------
    InputError
        A sensor that is not a `StrainGauge` measures in the frame of a divided beam, or a joint slides along it.
    """
    beams = {body.name: body for body in mechanism.bodies
             if isinstance(body, FlexibleBeam) and body.flexible and body.frames > 1}  # fmt: skip
    if not beams:
        return mechanism
    _check(mechanism, set(beams))
    bodies: list[Body] = []
    welds: list[WeldJoint] = []
    places: dict[PointRef, PointRef] = {}
    carriers: dict[str, tuple[str, float]] = {}
    for body in mechanism.bodies:
        if body.name not in beams:
            bodies.append(body)
            carriers[body.name] = (body.name, 0.0)
            continue
        beam = beams[body.name]
        parts = _parts(beam)
        bodies += parts
        carriers |= {part.name: (beam.name, k * beam.length / beam.frames) for k, part in enumerate(parts)}
        welds += [WeldJoint(f"{a.name}-{b.name}", PointRef(a.name, LAST_END), PointRef(b.name, FIRST_END))
                  for a, b in pairwise(parts)]  # fmt: skip
        places |= {PointRef(beam.name, point): PointRef(part.name, point) for part in parts for point in part.points}
    cut = Cut(mechanism, carriers, places)
    sensors = tuple(moved(_on_part(one, beams), places) for one in mechanism.sensors)
    return rebuilt(mechanism, bodies, welds, cut, sensors=sensors)


def _check(mechanism: Mechanism, beams: set[str]) -> None:
    for joint in mechanism.joints:
        if joint.follows_beam and joint.a.body in beams:
            raise InputError(
                "a joint slides along it, which requires one frame", field=f"body.{joint.a.body}.frames",
                value=getattr(mechanism.body(joint.a.body), "frames", None), remedy="leave it out, or give it elements",
            )  # fmt: skip
    for sensor in mechanism.sensors:
        frame = sensor.location.frame
        if frame in beams and sensor.location.at is None:
            raise InputError(
                f"reads in the frame of {frame}, which has several", field=f"sensor.{sensor.name}",
                remedy=f"measure in the ground frame, or give {frame} one frame",
            )  # fmt: skip


def _on_part(sensor: Sensor, beams: Mapping[str, FlexibleBeam]) -> Sensor:
    """Return a sensor in a section of a beam, moved to the right part; at a cut to the part nearer to the last end."""
    location = sensor.location
    if location.at is None or location.frame not in beams:
        return sensor
    beam = beams[location.frame]
    place = location.along(beam.points)
    number = _part_at(beam, place)
    return sensor.on_part(_name(beam, number), place - number * beam.length / beam.frames)


def _name(beam: FlexibleBeam, number: int) -> str:
    return f"{beam.name}_{number + 1}"


def _part_at(beam: FlexibleBeam, place: float) -> int:
    """Return the number of the part at a distance from the first end [m]; at a cut the part that begins there."""
    return min(int(place / beam.length * beam.frames + _SAME), beam.frames - 1)


def _parts(beam: FlexibleBeam) -> list[FlexibleBeam]:
    """Divide a beam into one beam per frame, each with the sections, materials and elements of its spans."""
    knots = [0.0, *sorted({x for x in beam.points.values() if _SAME < x / beam.length < 1.0 - _SAME}), beam.length]
    knots = [knots[0], *(b for a, b in pairwise(knots) if b - a > _SAME * beam.length)]
    length = beam.length / beam.frames
    parts = []
    for number in range(beam.frames):
        start = number * length
        points = {name: _near(x - start, length) for name, x in beam.points.items() if _part_at(beam, x) == number}
        ends = [0.0, *sorted({x for x in points.values() if 0.0 < x < length}), length]
        spans = [bisect_right(knots, start + 0.5 * (a + b)) - 1 for a, b in pairwise(ends)]
        parts.append(replace(
            beam, name=_name(beam, number), length=length, frames=1,
            section=_of_spans(beam.section, spans), material=_of_spans(beam.material, spans),
            elements=_of_spans(beam.elements, spans),
            points={FIRST_END: 0.0, LAST_END: length, **points},
            lumps=tuple(lump for lump in beam.lumps if lump.point in points),
        ))  # fmt: skip
    return parts


def _near(x: float, length: float) -> float:
    """Return a position [m], moved to an end (0 or `length`) from which it differs by rounding only."""
    return 0.0 if abs(x) < _SAME * length else length if abs(x - length) < _SAME * length else x


def _of_spans(values: Any, spans: Sequence[int]) -> Any:
    """Select the values of the given spans, if there is one value per span of the whole beam."""
    return tuple(values[span] for span in spans) if isinstance(values, tuple) else values
