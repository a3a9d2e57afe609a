"""Plausibility of the numbers of a mechanism: wrong units, signs and positions that no check of form can detect.

Each bound is wide: values beyond it are hardly ever intended, and if they are, the finding does no harm.
"""

import math
from collections.abc import Iterable, Iterator, Mapping, Sequence
from itertools import combinations

import numpy as np

from paraflex.arrays import Array
from paraflex.errors import InputError
from paraflex.findings import Finding
from paraflex.mechanism import AssumedModesBeam, FlexibleBeam, Mechanism, ModalBody, Rectangle, RigidBody, Section
from paraflex.mechanism.bodies import Body, Material
from paraflex.mechanism.poses import local_points
from paraflex.mechanism.tracks import longest_element, too_long, tracks
from .actions import implausible_actions

Place = tuple[float, float]
Beam = FlexibleBeam | AssumedModesBeam

# Thickness over length of beams: limits of beam theory, and of tapes and foils.
THICK, THIN = 0.25, 5e-4
# Thickness in the plane over width out of it above which a rectangle bends out of the plane first.
TURNED = 3.0
# Young's modulus [Pa]: below the softest rubber and above diamond.
MODULUS = (1e5, 2e12)
# Density [kg/m^3]: of light foam and of osmium.
DENSITY = (10.0, 2.3e4)
# No solid denser than the first [kg/m^3] has a modulus below the second [Pa].
HEAVY, SOFT = 2000.0, 1e9
# Number of points up to which all distances between them are computed.
_MANY_POINTS = 50
# Lengths of a mechanism [m]: of micromechanics and of the largest machines.
SIZE = (1e-5, 100.0)
# Largest ratio of the longest to the shortest link of a mechanism.
SPREAD = 500.0
# Radius of gyration of a rigid body relative to the mechanism's size.
GYRATION = 5.0
# Total mass over the cube of the mechanism's size, above that of a solid block of light metal [kg/m^3].
MASSIVE = 5000.0
# Largest ratio of the total length of all bodies to the size of a mechanism.
_FOLDED = 4.0
# Mass of a body relative to the mass of all others together, above which the others hardly matter.
HEAVIEST = 200.0
# Equal lumped masses on several bodies relative to the rest of all bodies: hinges weigh less than what they join.
HINGES = 20.0
# Distance of a centre of mass from its body's points relative to the mechanism's size.
OFF_CENTRE = 5.0
# Standard gravity, and its variation on Earth [m/s^2].
STANDARD_GRAVITY, ON_EARTH = 9.81, 0.05
# Points nearer to one another than this fraction of the mechanism's size coincide.
APART = 1e-9
# Speed of a body above that of any mechanism [m/s].
FAST = 300.0
# Length of a beam beyond its last point relative to the whole.
OVERHANG = 0.5
_TURN = 2.0 * math.pi
# Number of instants at which a profile is evaluated.
_LOOKS = 201


def implausible_numbers(mechanism: Mechanism, duration: float | None = None) -> list[Finding]:
    """Return findings about a mechanism's own numbers, from its description alone.

    Parameters
    ----------
    mechanism : Mechanism
        Mechanism as described.
    duration : float, optional
        Time up to which profiles in time are evaluated [s]; at the start alone by default.

    Returns
    -------
    list of Finding
        Doubtful numbers, each with its place, text and remedy.
    """
    size = mechanism_size(mechanism)
    found = [*_lengths(mechanism, size), *_gravity(mechanism.gravity), *_angles(mechanism), *_drives(mechanism)]
    times = np.linspace(0.0, duration or 0.0, _LOOKS)
    found += _profiles(mechanism, size, times)
    for body in mechanism.bodies:
        if isinstance(body, Beam):
            found += _beam(body, size)
        elif isinstance(body, RigidBody):
            found += _rigid(body, size)
    found += [*_masses(mechanism, size), *_hinges(mechanism), *_one_place(mechanism, size), *_meshes(mechanism)]
    return _shared([*found, *implausible_actions(mechanism, size, mechanism_mass(mechanism), times)])


def _meshes(mechanism: Mechanism) -> Iterator[Finding]:
    """Yield beams whose elements are too long for joints that slide along them."""
    for beam in tracks(mechanism):
        if too_long(beam):
            part = longest_element(beam)
            yield Finding(
                "elements-few", f"body.{beam.name}.elements",
                f"a joint slides along {beam.name}, and its longest element is {part:.2g} of it: under the joint it "
                "bends too little, which makes torques, forces and stresses wrong, with one element by up to a fifth",
                "leave elements out, or give so many that none is longer than a third of the beam",
            )  # fmt: skip


def _shared(found: Iterable[Finding]) -> list[Finding]:
    """Merge findings that are the same for several places, for example for bodies that share a section."""
    places: dict[tuple[str, str, str], list[str]] = {}
    for one in found:
        places.setdefault((one.code, one.text, one.remedy), []).append(one.place)
    return [
        Finding(code, at[0], f"{text} (and so of {', '.join(at[1:])})" if len(at) > 1 else text, remedy)
        for (code, text, remedy), at in places.items()
    ]


def mechanism_size(mechanism: Mechanism) -> float:
    """Return the largest length in a mechanism's description, of a body or between ground points [m]; zero if none."""
    return max([*map(body_length, mechanism.bodies), _extent(mechanism.ground.values())], default=0.0)


def mechanism_mass(mechanism: Mechanism) -> float:
    """Return the mass of all bodies [kg]."""
    return sum(body.mass if isinstance(body, ModalBody) else _mass(body) for body in mechanism.bodies)


def body_length(body: Body) -> float:
    """Return the length of a beam, or the largest distance between a body's named points [m].

    For a body with one point it is the distance from the centre of mass.
    """
    if isinstance(body, Beam):
        return body.length
    if isinstance(body, ModalBody):
        return _extent([point.position for point in body.points.values()])
    places = list(body.points.values())
    return _extent(places if len(places) > 1 else [*places, body.centre_of_mass])


def _extent(places: Iterable[Sequence[float]]) -> float:
    points = list(places)
    if len(points) > _MANY_POINTS:
        # A point nearer to all corners of the box around them than the box is long is no end of the largest distance.
        x = np.array(points)
        low, high = x.min(axis=0), x.max(axis=0)
        points = x[np.hypot(*np.maximum(x - low, high - x).T) >= (1.0 - 1e-9) * np.max(high - low)].tolist()
    return max((math.dist(a, b) for a, b in combinations(points, 2)), default=0.0)


def _lengths(mechanism: Mechanism, size: float) -> Iterator[Finding]:
    least, most = SIZE
    if size and not least <= size <= most:
        yield Finding(
            "size", "body" if size in map(body_length, mechanism.bodies) else "ground",
            f"the mechanism is {size:.3g} m large", "lengths are in m: is it in mm, or in another unit?",
        )  # fmt: skip
    lengths = {body.name: body_length(body) for body in mechanism.bodies if isinstance(body, Beam)}
    if lengths:
        longest, shortest = max(lengths, key=lengths.__getitem__), min(lengths, key=lengths.__getitem__)
        if lengths[longest] > SPREAD * lengths[shortest]:
            yield Finding(
                "size", f"body.{longest}.length",
                f"{lengths[longest]:.3g} m, where {shortest} has {lengths[shortest]:.3g} m",
                "lengths are in m: is one of them in another unit?",
            )  # fmt: skip
    ground = _extent(mechanism.ground.values())
    reach = sum(map(body_length, mechanism.bodies))
    if reach and ground > SPREAD * reach:
        yield Finding(
            "size", "ground", f"ground points {ground:.3g} m apart, and bodies of {reach:.3g} m together",
            "lengths are in m: is one of them in another unit?",
        )  # fmt: skip


def _gravity(gravity: Place) -> Iterator[Finding]:
    strength = math.hypot(*gravity)
    if not strength:
        return
    text = f"({gravity[0]:g}, {gravity[1]:g}) m/s^2"
    if abs(strength - STANDARD_GRAVITY) > ON_EARTH:
        yield Finding("gravity", "gravity", f"{text} is {strength:.4g} m/s^2", "on Earth it is 9.81, in m/s^2")
    elif 0.0 not in gravity:
        yield Finding("gravity", "gravity", f"{text} is along no axis", "does the mechanism lie on a slope?")
    elif max(gravity) > 0.0:
        yield Finding("gravity", "gravity", f"{text} pulls towards positive {'xy'[gravity[1] > 0.0]}", "is it -9.81?")


def _angles(mechanism: Mechanism) -> Iterator[Finding]:
    given = {f"joint.{j.name}.{name}": getattr(j, name) for j in mechanism.joints for name in ("direction", "angle")}
    turning = [one for one in mechanism.springs if not mechanism.slides(one.joint)]
    given |= {f"spring.{one.name}.rest": one.rest for one in turning}
    given |= {
        f"assembly.{assembly.name}.{body}": angle
        # Angles of gears and similar relations count turns.
        for assembly in (() if mechanism.relations else mechanism.assemblies)
        for body, angle in assembly.angles.items()
    }
    for place, angle in given.items():
        if abs(angle) > _TURN:
            turn = math.remainder(angle, _TURN)
            yield Finding(
                "angle", place, f"{angle:g} rad is more than a turn, and the same as {turn:.4g} rad",
                f"angles are in radians: {angle:g} degrees are {math.radians(angle):.4g} rad",
            )  # fmt: skip


def _profiles(mechanism: Mechanism, size: float, times: Array) -> Iterator[Finding]:
    """Yield profiles likely in degrees, which start beyond one turn or swing over two, and large speeds."""
    for one in mechanism.prescribed:
        if mechanism.slides(one.joint):
            continue
        try:
            angle, rate, _ = one.profile.evaluate(times)
        except InputError:
            # A profile may be undefined beyond an earlier end of the run; otherwise the run reports the error.
            continue
        place = one.place
        swing = float(np.ptp(angle)) if np.any(rate > 0.0) and np.any(rate < 0.0) else 0.0
        if abs(angle[0]) > _TURN or swing > 2.0 * _TURN:
            what = f"it swings over {swing:.4g} rad" if swing > 2.0 * _TURN else f"it starts at {angle[0]:.4g} rad"
            yield Finding("angle", place, f"{what}, more than a turn", "angles are in radians: are they in degrees?")
        fastest = float(np.max(np.abs(rate)))
        if fastest * size > FAST:
            yield Finding(
                "speed-large", place, f"it turns at {fastest:.4g} rad/s, in a mechanism of {size:.3g} m",
                "speeds are in rad/s: one turn a minute is 0.105 of them, a degree a second 0.0175",
            )  # fmt: skip


def _drives(mechanism: Mechanism) -> Iterator[Finding]:
    driven = {one.joint: one.place for one in mechanism.prescribed}
    shared: dict[str, list[str]] = {}
    for motor in mechanism.motors:
        shared.setdefault(motor.joint, []).append(motor.name)
        if motor.joint in driven:
            yield Finding(
                "motor-prescribed", f"motor.{motor.name}",
                f"its joint {motor.joint} follows {driven[motor.joint]} whatever the motor does",
                "leave one of them out",
            )  # fmt: skip
    for joint, names in shared.items():
        if len(names) > 1:
            yield Finding(
                "motor-shared", f"motor.{names[1]}", f"it acts at joint {joint}, as {names[0]} does",
                "name another joint, or leave one of them out",
            )  # fmt: skip


def _beam(body: Beam, size: float) -> Iterator[Finding]:
    place = f"body.{body.name}"
    sections: tuple[Section, ...] = body.section if isinstance(body.section, tuple) else (body.section,)
    materials: tuple[Material, ...] = body.material if isinstance(body.material, tuple) else (body.material,)
    for section in dict.fromkeys(sections):
        yield from _section(f"{place}.section", body.length, section)
    for material in dict.fromkeys(materials):
        yield from _material(f"{place}.material", material)
    for lump in body.lumps:
        yield from _gyration(f"{place}.lumps.{lump.point}", lump.mass, lump.inertia, size)
    places = list(body.points.values())
    if len(places) > 1 and max(places) - min(places) < OVERHANG * body.length:
        yield Finding(
            "beam-overhang", f"{place}.length",
            f"{body.length:.3g} m, where its points lie between {min(places):.3g} and {max(places):.3g} m",
            "is the length that of the beam between its joints?",
        )  # fmt: skip


def _section(place: str, length: float, section: Section) -> Iterator[Finding]:
    # Thickness of a rectangle of the same area and second moment.
    thickness = math.sqrt(12.0 * section.second_moment / section.area) if section.second_moment > 0.0 else 0.0
    if thickness > THICK * length:
        yield Finding(
            "beam-thick", place, f"{thickness:.3g} m thick in the plane and {length:.3g} m long: not a beam",
            "sections are in m, m^2 and m^4: is it in mm?",
        )  # fmt: skip
    elif 0.0 < thickness < THIN * length:
        yield Finding(
            "beam-thin", place,
            f"{thickness:.3g} m thick in the plane and {length:.3g} m long: {length / thickness:.3g} times",
            "lengths are in m, sections in m, m^2 and m^4: are all of them?",
        )  # fmt: skip
    shape = section.shape
    if isinstance(shape, Rectangle) and shape.thickness > TURNED * shape.width:
        yield Finding(
            "section-turned", place,
            f"{shape.thickness:.3g} m thick in the plane and only {shape.width:.3g} m wide out of it: "
            "it bends out of the plane first, which no planar model shows",
            "width counts out of the plane of motion, thickness in it: is the section turned by 90 degrees?",
        )  # fmt: skip


def _material(place: str, material: Material) -> Iterator[Finding]:
    modulus, density = material.youngs_modulus, material.density
    if not MODULUS[0] <= modulus <= MODULUS[1]:
        yield Finding(
            "modulus", f"{place}.youngs_modulus", f"no solid has a modulus of {modulus:.3g} Pa",
            "it is in Pa: steel has 210e9, aluminium 70e9",
        )  # fmt: skip
    if not DENSITY[0] <= density <= DENSITY[1]:
        yield Finding(
            "density", f"{place}.density", f"no solid has a density of {density:.3g} kg/m^3",
            "it is in kg/m^3: steel has 7850, aluminium 2700",
        )  # fmt: skip
    elif density > HEAVY and MODULUS[0] <= modulus < SOFT:
        yield Finding(
            "material", place, f"a modulus of {modulus:.3g} Pa and a density of {density:.3g} kg/m^3 fit no solid",
            "modulus in Pa, density in kg/m^3: steel has 210e9 and 7850",
        )  # fmt: skip


def _rigid(body: RigidBody, size: float) -> Iterator[Finding]:
    away = min((math.dist(body.centre_of_mass, at) for at in body.points.values()), default=0.0)
    if size and away > OFF_CENTRE * size:
        yield Finding(
            "size", f"body.{body.name}.centre_of_mass",
            f"{away:.3g} m from the nearest of its points, in a mechanism of {size:.3g} m",
            "it is in m, in the body's own frame: is it in mm?",
        )  # fmt: skip
    yield from _gyration(f"body.{body.name}.inertia", body.mass, body.inertia, size)


def _gyration(place: str, mass: float, inertia: float, size: float) -> Iterator[Finding]:
    if mass > 0.0 and inertia > mass * (GYRATION * size) ** 2 > 0.0:
        yield Finding(
            "mass", place,
            f"{inertia:.3g} kg m^2 at {mass:.3g} kg is a radius of gyration of {math.sqrt(inertia / mass):.3g} m, "
            f"in a mechanism of {size:.3g} m",
            "inertia is in kg m^2, about the centre of mass",
        )  # fmt: skip


def _masses(mechanism: Mechanism, size: float) -> Iterator[Finding]:
    masses = {body.name: _mass(body) for body in mechanism.bodies if not isinstance(body, ModalBody)}
    total = sum(masses.values())
    # A chain of many short links is larger than any of them.
    reach = max(size, sum(map(body_length, mechanism.bodies)) / _FOLDED)
    if size and total > MASSIVE * reach**3:
        heaviest = max(masses, key=masses.__getitem__)
        yield Finding(
            "mass", f"body.{heaviest}",
            f"{masses[heaviest]:.3g} kg, in a mechanism of {size:.3g} m and {total:.3g} kg: more than a massive block "
            "of metal",
            "mass is in kg, density in kg/m^3, sections in m: are all of them?",
        )  # fmt: skip
    for name, mass in masses.items():
        if len(masses) > 1 and mass > HEAVIEST * (total - mass) > 0.0:
            yield Finding(
                "mass", f"body.{name}", f"its {mass:.3g} kg are {mass / (total - mass):.3g} times all others together",
                "mass is in kg, density in kg/m^3: are all of them?",
            )  # fmt: skip


def _hinges(mechanism: Mechanism) -> Iterator[Finding]:
    """Yield lumped masses on several bodies, as of joints or motors, that outweigh all the rest."""
    beams = [body for body in mechanism.bodies if isinstance(body, Beam)]
    total = sum(_mass(body) for body in mechanism.bodies if not isinstance(body, ModalBody))
    carriers: dict[float, list[str]] = {}
    for body in beams:
        for lump in body.lumps:
            carriers.setdefault(lump.mass, []).append(body.name)
    for mass, names in carriers.items():
        rest = total - mass * len(names)
        if len(set(names)) > 1 and mass * len(names) > HINGES * rest > 0.0:
            yield Finding(
                "mass", f"body.{names[0]}.lumps",
                f"{len(names)} lumps of {mass:.3g} kg, {mass * len(names) / rest:.3g} times all the rest together",
                "mass is in kg: is it in g?",
            )  # fmt: skip


def _mass(body: RigidBody | Beam) -> float:
    if isinstance(body, RigidBody):
        return body.mass
    lumps = sum(lump.mass for lump in body.lumps)
    if isinstance(body, FlexibleBeam):
        lengths = map(float, np.diff(body.mesh.knots))
        return lumps + sum(one.mass_per_length * length for one, length in zip(body.spans, lengths, strict=True))
    return lumps + body.material.density * body.section.area * body.length


def _one_place(mechanism: Mechanism, size: float) -> Iterator[Finding]:
    points: dict[str, Mapping[str, Place]] = {"ground": mechanism.ground}
    points |= {f"body.{body.name}.points": local_points(body) for body in mechanism.bodies}
    for table, places in points.items():
        for (one, a), (other, b) in combinations(places.items(), 2):
            if math.dist(a, b) <= APART * size:
                where = ", ".join(f"{x:g}" for x in a)
                yield Finding(
                    "same-place", f"{table}.{other}", f"it lies where {one} does, at ({where}) m",
                    "one name is enough, or one of the places is wrong",
                )  # fmt: skip
