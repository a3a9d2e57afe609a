"""The virtual prototype (section 6.1): a mechanism whose flexible beams become rigid segments joined by springs."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, replace
from itertools import pairwise
from math import ceil

from paraflex.errors import InputError, suggestion
from paraflex.mechanism.bodies import Body, FlexibleBeam, RigidBody
from paraflex.mechanism.joints import PointRef, RevoluteJoint
from paraflex.mechanism.loads import TorsionalSpring
from paraflex.mechanism.mechanism import Assembly, Mechanism
from paraflex.mechanism.poses import approximate_poses

# Points at which segments hang together.
FIRST_END, LAST_END = "_first", "_last"


@dataclass(frozen=True)
class Segmented:
    """A mechanism of finite segments and where they lie.

    Attributes
    ----------
    mechanism : Mechanism
    carriers : mapping
        For each of its bodies the name of the body it comes from, and how far along that it starts [m].
    """

    mechanism: Mechanism
    carriers: Mapping[str, tuple[str, float]]


def proportional_segments(mechanism: Mechanism, longest: int = 8) -> dict[str, int]:
    """Numbers of segments of about one length: so many on the longest flexible beam, others by their length.

    Eight make the paper's 56 segments of RAParM-I.
    """
    lengths = {body.name: body.length for body in mechanism.bodies if isinstance(body, FlexibleBeam) and body.flexible}
    # Rounding of a length's share must not make one segment more.
    most = max(lengths.values(), default=0.0)
    return {name: ceil(longest * length / most - 1e-9) for name, length in lengths.items()}


def finite_segments(mechanism: Mechanism, segments: int | Mapping[str, int] = 8) -> Segmented:
    """Replace each flexible beam by n equal rigid segments, hinged in a row with springs of n E I / L between them.

    A joint of two half segments bends as they do together: k = E I / (L / n). Lumped masses move with the segment they
    lie on. The model is another discretisation of the same beam, without stretch, and knows nothing of shape functions.

    Parameters
    ----------
    mechanism : Mechanism
    segments : int or mapping of str to int
        Per flexible beam, one number for all or one for each.

    Returns
    -------
    Segmented
        Segment i of a beam is called like "link1_1".

    Raises
    ------
    InputError
        Fewer than one segment, a beam without a number, or a name that is no flexible beam's.
    """
    beams = [body for body in mechanism.bodies if isinstance(body, FlexibleBeam) and body.flexible]
    counts = _counts([beam.name for beam in beams], segments)
    bodies: list[Body] = []
    joints: list[RevoluteJoint] = []
    springs: list[TorsionalSpring] = []
    carriers: dict[str, tuple[str, float]] = {}
    places: dict[tuple[str, str], str] = {}
    for body in mechanism.bodies:
        if body not in beams:
            bodies.append(body)
            carriers[body.name] = (body.name, 0.0)
            continue
        assert isinstance(body, FlexibleBeam)
        n = counts[body.name]
        length = body.length / n
        stiffness = body.material.youngs_modulus * body.section.second_moment / length
        names = [f"{body.name}_{i + 1}" for i in range(n)]
        owners = {point: min(int(x / length + 1e-9), n - 1) for point, x in body.points.items()}
        for i, name in enumerate(names):
            bodies.append(_segment(body, name, i, length, owners))
            carriers[name] = (body.name, i * length)
        for a, b in pairwise(names):
            hinge = f"{a}-{b}"
            joints.append(RevoluteJoint(hinge, PointRef(a, LAST_END), PointRef(b, FIRST_END)))
            springs.append(TorsionalSpring(hinge, hinge, stiffness))
        places |= {(body.name, point): names[i] for point, i in owners.items()}

    def moved(ref: PointRef) -> PointRef:
        return replace(ref, body=places.get((ref.body, ref.point), ref.body))

    effector = mechanism.end_effector
    segmented = replace(
        mechanism,
        name=f"{mechanism.name}, finite segments",
        bodies=tuple(bodies),
        joints=(*(replace(joint, a=moved(joint.a), b=moved(joint.b)) for joint in mechanism.joints), *joints),
        springs=(*mechanism.springs, *springs),
        linear_springs=tuple(
            replace(spring, a=moved(spring.a), b=moved(spring.b)) for spring in mechanism.linear_springs
        ),
        loads=tuple(replace(load, point=moved(load.point)) for load in mechanism.loads),
        end_effector=None if effector is None else replace(effector, point=moved(effector.point)),
        assemblies=tuple(_assembly(mechanism, assembly, carriers) for assembly in mechanism.assemblies),
    )
    return Segmented(segmented, carriers)


def _assembly(mechanism: Mechanism, assembly: Assembly, carriers: Mapping[str, tuple[str, float]]) -> Assembly:
    """Segments lie as their beams do; angles that follow from points follow before beams are cut."""
    poses = approximate_poses(mechanism, assembly)
    return replace(assembly, angles={name: poses[carrier].angle for name, (carrier, _) in carriers.items()}, points={})


def _counts(names: list[str], segments: int | Mapping[str, int]) -> dict[str, int]:
    counts = dict.fromkeys(names, segments) if isinstance(segments, int) else dict(segments)
    for name, count in counts.items():
        if name not in names:
            raise InputError("no flexible beam", field="segments", value=name, remedy=suggestion(name, names))
        if count < 1:
            raise InputError("a beam needs at least one segment", field=f"segments.{name}", value=count, remedy="say 8")
    for name in names:
        if name not in counts:
            raise InputError("no number of segments", field="segments", value=name, remedy="give one for every beam")
    return counts


def _segment(beam: FlexibleBeam, name: str, i: int, length: float, owners: Mapping[str, int]) -> RigidBody:
    """Segment i: its part of the bar and the lumps on it, about their common centre of mass."""
    bar = beam.material.density * beam.section.area * length
    parts = [(bar, 0.5 * length, bar * length**2 / 12.0)]
    for lump in beam.lumps:
        if owners[lump.point] == i:
            parts.append((lump.mass, beam.points[lump.point] - i * length, lump.inertia))
    mass = sum(m for m, _, _ in parts)
    centre = sum(m * x for m, x, _ in parts) / mass
    points = {point: (beam.points[point] - i * length, 0.0) for point, owner in owners.items() if owner == i}
    return RigidBody(
        name=name,
        mass=mass,
        inertia=sum(J + m * (x - centre) ** 2 for m, x, J in parts),
        centre_of_mass=(centre, 0.0),
        points={FIRST_END: (0.0, 0.0), LAST_END: (length, 0.0), **points},
    )
