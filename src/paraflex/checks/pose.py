"""Checks of the pose a mechanism starts from: closure, special poses, freedoms, vibrations, loose points."""

import math
from collections.abc import Iterator
from dataclasses import dataclass
from functools import cached_property
from itertools import product
from math import cos, sin

import numpy as np

from paraflex.arrays import Array
from paraflex.dynamics import (
    Closure,
    DrivenFreedoms,
    Mobility,
    System,
    Vibration,
    build_system,
    closure_of,
    driven_freedoms,
    joint_coordinate,
    mobility,
    natural_frequencies,
    undeformed,
)
from paraflex.dynamics.linearise import BALANCED as BALANCED, LOWEST
from paraflex.dynamics.state import point_position
from paraflex.dynamics.stiffness import laws_without_energy
from paraflex.errors import NumericalError, ProportionError
from paraflex.findings import Finding
from paraflex.limits import OUT_OF_PROPORTION
from paraflex.mechanism import GROUND, FlexibleBeam, Mechanism, PointRef, standing
from paraflex.validity import large_rotations, mechanism_size, stiff_modes
from paraflex.validity.actions import numbered_alike

# Natural frequency below that of any link [Hz].
SLOWEST_LINK = 0.1
# Sine of the angle between an axis and its beam below which the axis is along the beam.
_ALONG = 1e-6
# Distance of two such points relative to the mechanism's size: without its joint an assembly closes only roughly.
NEAR_POINTS = 0.2


@dataclass(frozen=True)
class Examination:
    """Results of examining a mechanism at the pose of one of its assemblies.

    Attributes
    ----------
    system, rigid : System
        Flexible system, and the system with rigid bodies.
    starts : tuple of Closure
        Closure of every assembly.
    chosen : Closure or None
        Closure of the chosen assembly; None if there is no assembly.
    mobility : Mobility or None
        Degrees of freedom at the pose; None if the assembly does not close.
    reach : DrivenFreedoms or None
        Degrees of freedom driven by motors; None if the assembly does not close.
    problem : str
        Reason why mobility and reach of a closed assembly could not be computed; empty for none.
    """

    system: System
    rigid: System
    starts: tuple[Closure, ...]
    chosen: Closure | None
    mobility: Mobility | None
    reach: DrivenFreedoms | None
    problem: str = ""

    @cached_property
    def held(self) -> Vibration:
        """Lowest vibrations about the undeformed pose of the chosen assembly, which closes, motors held."""
        assert self.chosen is not None
        assert self.chosen.state is not None
        motors = list(dict.fromkeys(motor.joint for motor in self.system.mechanism.motors))
        state = undeformed(self.system, self.rigid, self.chosen.state)
        return natural_frequencies(self.system, state, motors, count=LOWEST)


def examine(mechanism: Mechanism, assembly: str | None = None, system: System | None = None) -> Examination:
    """Close every assembly, and compute degrees of freedom and reach of the motors for the chosen one, or the first.

    Parameters
    ----------
    mechanism : Mechanism
        Mechanism as described.
    assembly : str, optional
        Name of the chosen assembly; the first by default.
    system : System, optional
        System of the mechanism if it is known, otherwise it is built.

    Raises
    ------
    InputError
        The assembly is unknown.
    """
    mechanism = standing(mechanism, assembly)
    system, rigid = system or build_system(mechanism), build_system(mechanism.rigid())
    starts = tuple(closure_of(_begun_at(rigid, one.name), one) for one in mechanism.assemblies)
    if not mechanism.assemblies:
        return Examination(system, rigid, starts, None, None, None)
    requested = mechanism.assembly(assembly)
    chosen = next(start for start in starts if start.assembly == requested.name)
    if chosen.state is None:
        return Examination(system, rigid, starts, chosen, None, None)
    try:
        free = mobility(rigid, chosen.state)
        return Examination(system, rigid, starts, chosen, free, driven_freedoms(rigid, chosen.state, free.freedoms))
    except ProportionError as error:
        return Examination(system, rigid, starts, chosen, None, None, str(error))


def _begun_at(rigid: System, assembly: str) -> System:
    """Return the system with prescribed motions that begin at an assembly, the given one if none does."""
    mechanism = standing(rigid.mechanism, assembly)
    return rigid if mechanism is rigid.mechanism else build_system(mechanism)


def pose_findings(seen: Examination, *, at_rest: bool = True) -> Iterator[Finding]:
    """Yield findings about the pose; `at_rest` adds whether a mechanism at rest there would stay."""
    if not seen.starts:
        yield Finding(
            "assembly-missing", "assembly", "no assembly: it is unknown whether the loops close",
            "add an [assembly.NAME] table with an approximate angle of each body, in rad",
        )  # fmt: skip
    for start in seen.starts:
        if not start.closes:
            yield Finding("assembly-open", f"assembly.{start.assembly}", start.problem, start.remedy)
        else:
            assert start.state is not None
            yield from large_rotations(seen.rigid, seen.rigid.mechanism.assembly(start.assembly), start.state.q)
    if seen.problem:
        yield Finding("out-of-proportion", "assembly", seen.problem, OUT_OF_PROPORTION)
    if seen.mobility is not None and seen.reach is not None:
        yield from _mobility(seen.mobility, seen.reach)
        if seen.reach.all_motors < seen.mobility.freedoms and seen.chosen is not None and seen.chosen.state is not None:
            yield from loose_points(seen.rigid, seen.chosen.state.q)
    yield from stiff_modes(seen.system)
    if seen.chosen is not None and seen.chosen.state is not None:
        yield from axes_along_beams(seen.system.described, seen.rigid, seen.chosen.state.q)
    yield from _vibration(seen, at_rest)


def _mobility(free: Mobility, drives: DrivenFreedoms) -> Iterator[Finding]:
    if free.special:
        yield Finding(
            "special-pose", "assembly",
            f"a special pose: {free.freedoms} degrees of freedom at this instant, "
            + (f"{free.nearby_freedoms} a little further along" if free.nearby_freedoms else
               "but no continuation from it was found"),
            "rounding decides how the mechanism continues from there: start elsewhere",
        )  # fmt: skip
    for name, reached in drives.modes.items():
        if reached < drives.freedoms:
            yield Finding(
                "mode-short", f"mode.{name}", f"it reaches {reached} of {drives.freedoms} degrees of freedom",
                "add motors to the mode",
            )  # fmt: skip


def _vibration(seen: Examination, at_rest: bool) -> Iterator[Finding]:
    """Yield vibrations too slow for a link, and unstable motions with motors held if these drive all freedoms."""
    if seen.chosen is None or seen.chosen.state is None or seen.mobility is None or seen.reach is None:
        return
    for body in seen.system.bodies:
        name = seen.system.carrier(body.name)[0]
        slowest = float(np.min(body.modes.omega, initial=math.inf)) / (2.0 * math.pi)
        if slowest < SLOWEST_LINK:
            yield Finding(
                "frequency-low", f"body.{name}", f"its natural frequency is {slowest:.2g} Hz, too low for a link",
                f"look at Young's modulus, section and length of {name}: Pa and m",
            )  # fmt: skip
    try:
        vibration = seen.held
    except ProportionError as error:
        yield Finding("out-of-proportion", "assembly", str(error), OUT_OF_PROPORTION)
        return
    except NumericalError:
        return
    if seen.chosen is not None and seen.chosen.state is not None:
        state = undeformed(seen.system, seen.rigid, seen.chosen.state)
        yield from laws_without_energy(seen.system, state.time, state.q)
    growing = int(np.sum(vibration.squares < 0.0))
    # A mechanism released out of balance moves off anyway.
    holds = seen.reach.all_motors == seen.mobility.freedoms
    if growing and (holds or (at_rest and vibration.acceleration < BALANCED)):
        held = " with the motors held" if seen.system.mechanism.motors else ""
        yield Finding(
            "motions-grow", "assembly",
            f"{growing} {'motion grows' if growing == 1 else 'motions grow'} about the pose{held} instead of vibrating",
            "should it be unstable there? look at gravity's sign, springs and loads, or start from --balanced",
        )  # fmt: skip


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


def loose_points(rigid: System, q: Array) -> Iterator[Finding]:
    """Yield unused points close to a point of the same name on another body, at coordinates q of the rigid mechanism.

    B and B3 count as the same name if both points are unused.
    """
    mechanism = rigid.mechanism
    unused = _unused(mechanism)
    ground = [PointRef(GROUND, name) for name in mechanism.ground]
    known = [*ground, *(PointRef(body.name, name) for body in mechanism.bodies for name in body.points)]
    direct = {frozenset((one.a.body, one.b.body)) for one in mechanism.joints}
    # An assembly by angles leaves the travels of sliding joints open.
    sliding = {end.body for joint in mechanism.joints if joint.slides for end in (joint.a, joint.b)}
    sliding.discard(GROUND)
    reported: set[PointRef] = set()
    size = mechanism_size(mechanism)
    pairs: list[tuple[bool, float, PointRef, PointRef]] = []
    for one, other in product(unused, known):
        apart = one.body != other.body and frozenset((one.body, other.body)) not in direct
        if apart and (one.point == other.point or (other in unused and numbered_alike(one, other))):
            gap = float(np.linalg.norm(point_position(rigid, q, one) - point_position(rigid, q, other)))
            if gap < size * (1.0 if {one.body, other.body} & sliding else NEAR_POINTS):
                pairs.append((other not in unused, gap, one, other))
    # Pairs with both points unused come first, then the nearest.
    for _, gap, one, other in sorted(pairs, key=lambda pair: pair[:2]):
        if not reported & {one, other}:
            reported |= {one, other}
            yield Finding(
                "joint-missing", "joint", f"nothing holds {one} and {other}, which lie {gap:.3g} m apart",
                "is a joint of the two missing?",
            )  # fmt: skip


def _unused(mechanism: Mechanism) -> list[PointRef]:
    """Return the points of bodies that no joint, spring, load, lump or end-effector refers to."""
    used = mechanism.points_used
    named = [PointRef(body.name, name) for body in mechanism.bodies for name in body.points]
    return [point for point in named if point not in used]
