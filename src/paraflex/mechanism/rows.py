"""Rigid mechanisms of any size: a row of four-bars side by side, and a hanging chain."""

from __future__ import annotations

from math import pi

from paraflex.arguments import checked_arguments
from paraflex.errors import InputError
from paraflex.mechanism.bodies import RigidBody
from paraflex.mechanism.joints import PointRef, RevoluteJoint
from paraflex.mechanism.loads import TorsionalSpring
from paraflex.mechanism.mechanism import Mechanism
from paraflex.mechanism.members import Assembly

GRAVITY = (0.0, -9.81)


@checked_arguments()
def four_bars_in_a_row(n: int) -> Mechanism:
    """Build n four-bars side by side, neighbours sharing a crank: benchmark A02 of the IFToMM library.

    Cranks A_i B_i, i = 0 to n, on pins 1 m apart; couplers from B_i-1 to B_i. All links are uniform rods of 1 kg and
    1 m under weight of 9.81 m/s^2. One degree of freedom. In the benchmark the cranks start upright, with B0 moving at
    +1 m/s in x: `mechanism.Start(angular={"crank0": -1.0})`, the joints give the rest.

    The mechanism passes positions with all links in line, where n constraints depend on the others.

    Parameters
    ----------
    n : int
        Loops.

    Raises
    ------
    InputError
        Fewer than one.
    """
    _check_number(n, "loops")
    cranks = [_rod(f"crank{i}", "A", "B") for i in range(n + 1)]
    couplers = [_rod(f"coupler{i}", "L", "R") for i in range(1, n + 1)]
    joints = [RevoluteJoint("A0", PointRef("ground", "A0"), PointRef("crank0", "A"))]
    for i in range(1, n + 1):
        joints += [
            RevoluteJoint(f"L{i}", PointRef(f"crank{i - 1}", "B"), PointRef(f"coupler{i}", "L")),
            RevoluteJoint(f"A{i}", PointRef("ground", f"A{i}"), PointRef(f"crank{i}", "A")),
            RevoluteJoint(f"R{i}", PointRef(f"coupler{i}", "R"), PointRef(f"crank{i}", "B")),
        ]
    angles = {crank.name: 0.5 * pi for crank in cranks} | {coupler.name: 0.0 for coupler in couplers}
    return Mechanism(
        name=f"{n} four-bars in a row",
        description="Uniform rods of 1 kg and 1 m under weight, one degree of freedom.",
        ground={f"A{i}": (float(i), 0.0) for i in range(n + 1)},
        bodies=(*cranks, *couplers),
        joints=tuple(joints),
        gravity=GRAVITY,
        assemblies=(Assembly("upright", angles),),
    )


@checked_arguments()
def chain_of_segments(
    n: int, *, length: float = 1.0, mass: float = 1.0, bending_stiffness: float = 0.02, angle: float = 0.0
) -> Mechanism:
    """Build a chain of n equal rigid segments that hangs from the ground, with springs between them: a cable.

    No loops and n degrees of freedom. Springs of n EI / length stand for the bending of two half segments each.

    Parameters
    ----------
    n : int
        Segments.
    length, mass : float
        Of the whole [m, kg].
    bending_stiffness : float
        EI [N m^2].
    angle : float
        Of all segments at the start, from the x axis [rad].

    Raises
    ------
    InputError
        Fewer than one segment, or numbers that make no sense.
    """
    _check_number(n, "segments")
    part = length / n
    segments = [_rod(f"segment{i}", "P", "Q", mass / n, part) for i in range(1, n + 1)]
    joints = [RevoluteJoint("J1", PointRef("ground", "O"), PointRef("segment1", "P"))]
    joints += [
        RevoluteJoint(f"J{i}", PointRef(f"segment{i - 1}", "Q"), PointRef(f"segment{i}", "P")) for i in range(2, n + 1)
    ]
    return Mechanism(
        name=f"chain of {n} segments",
        description="A cable that falls from the horizontal: rigid segments with torsional springs, held at one end.",
        ground={"O": (0.0, 0.0)},
        bodies=tuple(segments),
        joints=tuple(joints),
        springs=tuple(TorsionalSpring(joint.name, joint.name, bending_stiffness / part) for joint in joints[1:]),
        gravity=GRAVITY,
        assemblies=(Assembly("straight", {segment.name: angle for segment in segments}),),
    )


def _check_number(n: int, field: str) -> None:
    if n < 1:
        raise InputError("at least one is needed", field=field, value=n, remedy="say 3")


def _rod(name: str, first: str, last: str, mass: float = 1.0, length: float = 1.0) -> RigidBody:
    """A uniform rod along the x axis of its frame."""
    points = {first: (0.0, 0.0), last: (length, 0.0)}
    return RigidBody(name, mass, mass * length**2 / 12.0, (0.5 * length, 0.0), points)
