"""Beams divided into as many beams, welded end to end, or into rigid segments with springs.

Floating frames: deflections are relative to each frame, so slopes remain small when the whole beam has large
deflections. Segments: the virtual prototype (section 6.1) that verifies the beams.
"""

from bisect import bisect_right
from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass, replace
from itertools import pairwise
from math import ceil
from typing import Any, TypeVar

from paraflex.arguments import checked_arguments
from paraflex.errors import InputError
from paraflex.fem import SpanProperties
from paraflex.limits import SEGMENTS, at_most
from .bodies import Body, FlexibleBeam, RigidBody, given_shapes
from .cut import Cut
from .damping import stiffness_damping
from .groups import groups_of
from .joints import Joint, PointRef, RevoluteJoint, WeldJoint, points_named
from .loads import AppliedTorque, LinearSpring, PointForce, TorsionalDamper, TorsionalSpring
from .mechanism import Mechanism
from .members import Assembly
from .poses import approximate_poses
from .quantities import known
from .sensors import Sensor

T = TypeVar("T")

# Points at which segments are connected.
FIRST_END = "_first"
LAST_END = "_last"


@dataclass(frozen=True)
class SegmentedMechanism:
    """Mechanism of finite segments and the positions of the segments on the beams.

    Attributes
    ----------
    mechanism : Mechanism
        Mechanism with segments in place of flexible beams.
    carriers : mapping
        Original body of each body of the mechanism, and the distance along it at which that body starts [m].
    """

    mechanism: Mechanism
    carriers: Mapping[str, tuple[str, float]]


@checked_arguments()
def proportional_segments(mechanism: Mechanism, longest: int = 8) -> dict[str, int]:
    """Return numbers of segments in proportion to the lengths of the flexible beams.

    Parameters
    ----------
    mechanism : Mechanism
        Mechanism with flexible beams.
    longest : int
        Number of segments of the longest beam; the default of 8 gives the paper's 56 segments of RAParM-I.
    """
    lengths = {body.name: body.length for body in mechanism.bodies if isinstance(body, FlexibleBeam) and body.flexible}
    # Rounding of the ratio of lengths must not add a segment.
    most = max(lengths.values(), default=0.0)
    return {name: ceil(longest * length / most - 1e-9) for name, length in lengths.items()}


@checked_arguments()
def finite_segments(mechanism: Mechanism, segments: int | Mapping[str, int] = 8) -> SegmentedMechanism:
    """Replace each flexible beam by n equal rigid segments in a row, connected by hinges with springs of n E I / L.

    A hinge represents the bending of the two adjacent half segments: k = E I / (L / n), or the reciprocal of
    int dx / E I over the two halves where the stiffness varies. Lumped masses move with their segment. The model is
    another discretisation of the same beam, without elongation and without shape functions. Sensors of strain and
    deflection in a segmented beam, and sensors along axes of its frame, are removed.

    Parameters
    ----------
    mechanism : Mechanism
        Mechanism with flexible beams.
    segments : int or mapping of str to int
        Number of segments of each flexible beam: one for all (8 by default), or one by name.

    Returns
    -------
    SegmentedMechanism
        Mechanism of segments, which are named like "link1_1", and their positions.

    Raises
    ------
    InputError
        A number is less than one or too large, a beam has no number, a name is not that of a flexible beam, a flexible
        body has user-defined shapes, or a joint slides along a flexible beam.
    """
    check_segmentable(mechanism)
    beams = [body for body in mechanism.bodies if isinstance(body, FlexibleBeam) and body.flexible]
    counts = _counts([beam.name for beam in beams], segments)
    bodies: list[Body] = []
    joints: list[RevoluteJoint] = []
    springs: list[TorsionalSpring] = []
    dampers: list[TorsionalDamper] = []
    carriers: dict[str, tuple[str, float]] = {}
    places: dict[PointRef, PointRef] = {}
    for body in mechanism.bodies:
        if body not in beams:
            bodies.append(body)
            carriers[body.name] = (body.name, 0.0)
            continue
        assert isinstance(body, FlexibleBeam)
        # Hinges can only have stiffness-proportional damping.
        n, lag = counts[body.name], stiffness_damping(body.damping, "finite segments", f"body.{body.name}.damping")
        length = body.length / n
        names = [f"{body.name}_{i + 1}" for i in range(n)]
        owners = {point: min(int(x / length + 1e-9), n - 1) for point, x in body.points.items()}
        for i, name in enumerate(names):
            bodies.append(_segment(body, name, i, length, owners))
            carriers[name] = (body.name, i * length)
        for i, (a, b) in enumerate(pairwise(names)):
            hinge = f"{a}-{b}"
            joints.append(RevoluteJoint(hinge, PointRef(a, LAST_END), PointRef(b, FIRST_END)))
            # The bending between the centres of the segments, pieces in series.
            pieces = _pieces(body, (i + 0.5) * length, (i + 1.5) * length)
            stiffness = 1.0 / sum((end - start) / span.bending_stiffness for start, end, span in pieces)
            springs.append(TorsionalSpring(hinge, hinge, stiffness))
            if lag:
                dampers.append(TorsionalDamper(hinge, hinge, lag * stiffness))
        places |= {PointRef(body.name, point): PointRef(names[i], point) for point, i in owners.items()}

    segmented = rebuilt(
        replace(mechanism, sensors=tuple(one for one in mechanism.sensors if one.location.frame not in counts)),
        bodies, joints, Cut(mechanism, carriers, places),
        name=f"{mechanism.name}, finite segments",
        springs=(*mechanism.springs, *springs), dampers=(*mechanism.dampers, *dampers),
    )  # fmt: skip
    return SegmentedMechanism(segmented, carriers)


def with_clamps(segmented: Mechanism, joints: Iterable[str]) -> Mechanism:
    """Return finite segments whose beams bend up to the joints that hold them; other mechanisms are returned unchanged.

    The spring of a hinge represents the bending between the centres of its segments. A joint that clamps a segment ends
    that bending at its own point, so that the springs beside it have the bending up to there.
    """
    cut = segmented.cut
    if cut is None:
        return segmented
    springs = {one.name: one for one in segmented.springs}
    dampers = {one.name: one for one in segmented.dampers}
    for ref in (ref for joint in map(segmented.joint, joints) for ref in (joint.a, joint.b)):
        name, start = cut.carriers.get(ref.body, ("", 0.0))
        parts = cut.parts.get(name, ())
        if len(parts) < 2:
            continue
        beam, number = cut.whole.body(name), parts.index(ref.body)
        centre, place = start + 0.5 * beam.length / len(parts), beam.points[ref.point]
        pieces = _pieces(beam, *sorted((centre, place)))
        bending = sum((b - a) / span.bending_stiffness for a, b, span in pieces) * (1.0 if place > centre else -1.0)
        for hinge, more in (("-".join(parts[max(number - 1, 0) : number + 1]), bending),
                            ("-".join(parts[number : number + 2]), -bending)):  # fmt: skip
            if hinge not in springs:
                continue
            softer = 1.0 / (1.0 + more * springs[hinge].stiffness)
            springs[hinge] = replace(springs[hinge], stiffness=softer * springs[hinge].stiffness)
            if hinge in dampers:
                dampers[hinge] = replace(dampers[hinge], coefficient=softer * dampers[hinge].coefficient)
    return replace(segmented, springs=tuple(springs.values()), dampers=tuple(dampers.values()))


def moved(member: T, points: Mapping[PointRef, PointRef]) -> T:
    """Return a member with its points replaced by the new ones, where `points` has them."""
    member = member.moved(points) if isinstance(member, PointForce | AppliedTorque | LinearSpring) else member
    return replace(member, **{field: points.get(ref, ref) for field, ref in points_named(member).items()})  # type: ignore[type-var]


def rebuilt(
    mechanism: Mechanism, bodies: Sequence[Body], joints: Sequence[Joint], cut: Cut, **changed: Any
) -> Mechanism:
    """Return a mechanism of other bodies and additional joints, with all members moved to the new points."""
    kept = {
        name: tuple(moved(one, cut.points) for one in getattr(mechanism, name))
        for name, group in groups_of(Mechanism).items()
        if group.kinds
    }
    effector = mechanism.end_effector
    return replace(
        mechanism,
        bodies=tuple(bodies),
        joints=(*(moved(joint, cut.points) for joint in mechanism.joints), *joints),
        end_effector=None if effector is None else moved(effector, cut.points),
        assemblies=tuple(_assembly(mechanism, assembly, cut.carriers) for assembly in mechanism.assemblies),
        cut=cut,
        **kept | changed,
    )


def is_hinge(joint: Joint) -> bool:
    """Return whether a joint connects two segments or two parts of a beam."""
    return (joint.a.point, joint.b.point) == (LAST_END, FIRST_END)


def check_segmentable(mechanism: Mechanism) -> None:
    """Check that every flexible body can be divided into segments.

    Raises
    ------
    InputError
        A flexible body has user-defined shapes, or a joint slides along a flexible beam, beyond any single segment.
    """
    for joint in mechanism.joints:
        if joint.follows_beam and getattr(mechanism.body(joint.a.body), "flexible", False):
            raise InputError(
                "a beam that a joint slides along cannot be cut into segments", field=f"joint.{joint.name}",
                value=str(joint.a), remedy="make the beam rigid, or leave out finite segments",
            )  # fmt: skip
    for name in given_shapes(mechanism.bodies):
        raise InputError(
            "a body of given shapes cannot be cut into segments",
            field=f"body.{name}",
            remedy='make it a flexible beam (type = "beam") or rigid, or leave out finite segments',
        )


def _assembly(mechanism: Mechanism, assembly: Assembly, carriers: Mapping[str, tuple[str, float]]) -> Assembly:
    """Return an assembly with the segments along the undeformed beams, after angles were computed from points."""
    poses = approximate_poses(mechanism, assembly)
    return replace(assembly, angles={name: poses[carrier].angle for name, (carrier, _) in carriers.items()}, points={})


def _counts(names: list[str], segments: int | Mapping[str, int]) -> dict[str, int]:
    counts = dict.fromkeys(names, segments) if isinstance(segments, int) else dict(segments)
    for name, count in counts.items():
        known(name, names, "segments", "beam", "no flexible beam")
        if count < 1:
            raise InputError("a beam needs at least one segment", field=f"segments.{name}", value=count, remedy="say 8")
        at_most(count, SEGMENTS, f"segments.{name}")
    for name in names:
        if name not in counts:
            raise InputError(
                "the number of segments of this beam is missing",
                field="segments",
                value=name,
                remedy="give one for every beam",
            )
    return counts


def _pieces(beam: FlexibleBeam, start: float, end: float) -> list[tuple[float, float, SpanProperties]]:
    """Return the pieces of a beam between two positions, each within a span: start, end [m], span properties."""
    pieces = []
    for (a, b), span in zip(pairwise(beam.mesh.knots.tolist()), beam.spans, strict=True):
        if min(b, end) > max(a, start):
            pieces.append((max(a, start), min(b, end), span))
    return pieces


def _segment(beam: FlexibleBeam, name: str, i: int, length: float, owners: Mapping[str, int]) -> RigidBody:
    """Return segment i: its part of the bar and the lumps on it, about their common centre of mass."""
    start = i * length
    parts = []
    for a, b, span in _pieces(beam, start, start + length):
        bar = span.mass_per_length * (b - a)
        parts.append((bar, 0.5 * (a + b) - start, bar * (b - a) ** 2 / 12.0))
    for lump in beam.lumps:
        if owners[lump.point] == i:
            parts.append((lump.mass, beam.points[lump.point] - start, lump.inertia))
    mass = sum(m for m, _, _ in parts)
    centre = sum(m * x for m, x, _ in parts) / mass
    points = {point: (beam.points[point] - start, 0.0) for point, owner in owners.items() if owner == i}
    return RigidBody(
        name=name,
        mass=mass,
        inertia=sum(J + m * (x - centre) ** 2 for m, x, J in parts),
        centre_of_mass=(centre, 0.0),
        points={FIRST_END: (0.0, 0.0), LAST_END: (length, 0.0), **points},
    )


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
