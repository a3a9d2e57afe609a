"""Rigid mechanisms of variable size: a row of four-bar linkages and a hanging chain."""

from math import pi

from paraflex.arguments import checked_arguments
from paraflex.errors import InputError
from .bodies import RigidBody
from .joints import PointRef, RevoluteJoint
from .loads import TorsionalSpring
from .mechanism import Mechanism
from .members import Assembly

GRAVITY = (0.0, -9.81)


@checked_arguments()
def four_bars_in_a_row(n: int) -> Mechanism:
    """Build a row of n four-bar linkages in which neighbours share a crank: benchmark A02 of the IFToMM library.

    Cranks A_i B_i, i = 0 to n, are on pins 1 m apart, and couplers connect B_i-1 with B_i. All links are uniform rods
    of 1 kg and 1 m; gravity is 9.81 m/s^2. There is one degree of freedom. In the benchmark the cranks start upright,
    with a velocity of B0 of +1 m/s in x: `mechanism.Start(angular={"crank0": -1.0})`; the joints determine the rest.

    The mechanism passes singular configurations with all links in line, where n constraints depend on the others.

    Parameters
    ----------
    n : int
        Number of loops.

    Raises
    ------
    InputError
        The number is less than one.
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
    """Build a hanging cable: a chain of n equal rigid segments with springs between them, fixed to the ground by a pin.

    The chain has no loops and n degrees of freedom. Each spring of stiffness n EI / length represents the bending of
    two half segments.

    Parameters
    ----------
    n : int
        Number of segments.
    length, mass : float
        Total length [m] and mass [kg], 1 by default.
    bending_stiffness : float
        Bending stiffness EI [N m^2], 0.02 by default.
    angle : float
        Initial angle of all segments to the x axis [rad], 0 by default.

    Raises
    ------
    InputError
        There is less than one segment, or a number is not admissible.
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
    """Return a uniform rod along the x axis of its frame."""
    points = {first: (0.0, 0.0), last: (length, 0.0)}
    return RigidBody(name, mass, mass * length**2 / 12.0, (0.5 * length, 0.0), points)
