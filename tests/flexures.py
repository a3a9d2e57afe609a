"""Flexures of spring steel for tests: leaves 0.5 x 20 x 100 mm, E 2.1e11, EI = 0.04375 N m^2."""

from __future__ import annotations

import itertools
import math

import numpy as np
from scipy.integrate import solve_ivp
from scipy.optimize import root

import paraflex as pf

E, WIDTH, THICKNESS, LENGTH = 2.1e11, 0.02, 0.0005, 0.1
EI = E * WIDTH * THICKNESS**3 / 12.0
STEEL = pf.Material(E, 7850.0)
LEAF = pf.Section.rectangle(WIDTH, THICKNESS)


def leaf(name: str, length: float = LENGTH, elements: int = 2, **more) -> pf.FlexibleBeam:
    return pf.FlexibleBeam(name, length, LEAF, STEEL, {"A": 0.0, "B": length}, elements, **more)


def chain(name: str, beams: int, elements: int = 1) -> tuple[list[pf.FlexibleBeam], list[pf.WeldJoint]]:
    """A leaf of so many beams welded end to end: NAME1.A is its root, NAMEk.B its tip."""
    parts = [leaf(f"{name}{k + 1}", LENGTH / beams, elements) for k in range(beams)]
    welds = [
        pf.WeldJoint(f"{name}_{k}", pf.PointRef(a.name, "B"), pf.PointRef(b.name, "A"))
        for k, (a, b) in enumerate(itertools.pairwise(parts), 1)
    ]
    return parts, welds


def cantilever(beams: int) -> pf.Mechanism:
    """A leaf of so many beams along x, its root leaf1.A clamped to ground."""
    parts, welds = chain("leaf", beams)
    root = pf.WeldJoint("root", pf.PointRef("ground", "O"), pf.PointRef("leaf1", "A"))
    return pf.Mechanism(
        name="cantilever", ground={"O": (0.0, 0.0)}, bodies=tuple(parts), joints=(root, *welds),
        assemblies=(pf.Assembly("flat", {beam.name: 0.0 for beam in parts}),), gravity=(0.0, 0.0),
    )  # fmt: skip


def column(lower: str, upper: str, elements: int = 4) -> pf.Mechanism:
    """A leaf upright between "clamped", "pinned", "guided" or "free" ends; a heavy load comes to its top B."""
    beam = leaf("column", elements=elements)
    foot, top = pf.PointRef("ground", "foot"), pf.PointRef("ground", "top")
    joints = {
        "clamped": lambda: pf.WeldJoint("lower", foot, pf.PointRef("column", "A"), angle=math.pi / 2),
        "pinned": lambda: pf.RevoluteJoint("lower", foot, pf.PointRef("column", "A")),
    }[lower]()
    above = {
        "free": lambda: (),
        # Pinned or clamped to a slide that goes up and down on the ground.
        "pinned": lambda: (pf.SlotJoint("upper", top, pf.PointRef("column", "B"), direction=math.pi / 2),),
        "clamped": lambda: (
            pf.PrismaticJoint("upper", top, pf.PointRef("column", "B"), direction=math.pi / 2, angle=math.pi / 2),
        ),
    }[upper]()
    return pf.Mechanism(
        name="column",
        ground={"foot": (0.0, 0.0), "top": (0.0, LENGTH)},
        bodies=(beam,),
        joints=(joints, *above),
        assemblies=(pf.Assembly("upright", {"column": math.pi / 2}),),
        gravity=(0.0, 0.0),
    )


def guide(beams: int, apart: float = 0.05, elements: int = 1) -> pf.Mechanism:
    """Two upright leaves of so many beams each, clamped to ground and to a stage of 0.2 kg above, with T at mid-top."""
    left, welds_left = chain("left", beams, elements)
    right, welds_right = chain("right", beams, elements)
    stage = pf.RigidBody(
        "stage", 0.2, 1e-4, (0.5 * apart, 0.0), {"L": (0.0, 0.0), "R": (apart, 0.0), "T": (0.5 * apart, 0.0)}
    )
    up = math.pi / 2
    joints = [
        pf.WeldJoint("root_left", pf.PointRef("ground", "L"), pf.PointRef("left1", "A"), angle=up),
        pf.WeldJoint("root_right", pf.PointRef("ground", "R"), pf.PointRef("right1", "A"), angle=up),
        *welds_left,
        *welds_right,
        pf.WeldJoint("tip_left", pf.PointRef(f"left{beams}", "B"), pf.PointRef("stage", "L"), angle=-up),
        pf.WeldJoint("tip_right", pf.PointRef(f"right{beams}", "B"), pf.PointRef("stage", "R"), angle=-up),
    ]
    pose = {beam.name: up for beam in (*left, *right)} | {"stage": 0.0}
    return pf.Mechanism(
        name="guide",
        ground={"L": (0.0, 0.0), "R": (apart, 0.0)},
        bodies=(*left, *right, stage),
        joints=tuple(joints),
        assemblies=(pf.Assembly("straight", pose),),
        gravity=(0.0, 0.0),
    )


def pivot(beams: int, elements: int = 1) -> pf.Mechanism:
    """Two leaves at +-45 degrees that cross at mid-length, on a stage whose point C is at the crossing."""
    left, welds_left = chain("left", beams, elements)
    right, welds_right = chain("right", beams, elements)
    half = 0.5 * LENGTH / math.sqrt(2.0)
    stage = pf.RigidBody("stage", 0.2, 1e-4, (0.0, 0.0), {"C": (0.0, 0.0), "L": (half, half), "R": (-half, half)})
    angles = {"left": math.pi / 4, "right": 3 * math.pi / 4}
    joints = [
        pf.WeldJoint("root_left", pf.PointRef("ground", "L"), pf.PointRef("left1", "A"), angle=angles["left"]),
        pf.WeldJoint("root_right", pf.PointRef("ground", "R"), pf.PointRef("right1", "A"), angle=angles["right"]),
        *welds_left,
        *welds_right,
        pf.WeldJoint("tip_left", pf.PointRef(f"left{beams}", "B"), pf.PointRef("stage", "L"), angle=-angles["left"]),
        pf.WeldJoint("tip_right", pf.PointRef(f"right{beams}", "B"), pf.PointRef("stage", "R"), angle=-angles["right"]),
    ]
    pose = {beam.name: angles[beam.name[:-1].rstrip("0123456789")] for beam in (*left, *right)} | {"stage": 0.0}
    return pf.Mechanism(
        name="pivot",
        ground={"L": (-half, -half), "R": (half, -half)},
        bodies=(*left, *right, stage),
        joints=tuple(joints),
        assemblies=(pf.Assembly("straight", pose),),
        gravity=(0.0, 0.0),
    )


def truss(stiffness: float = 1000.0, half: float = 1.0, rise: float = 0.3) -> pf.Mechanism:
    """Two springs from the ground to the point T of a small mass: von Mises' truss. Hold "apex.T.angle"."""
    length = math.hypot(half, rise)
    springs = tuple(
        pf.LinearSpring(name, pf.PointRef("ground", name), pf.PointRef("apex", "T"), stiffness, length)
        for name in ("left", "right")
    )
    return pf.Mechanism(
        name="truss",
        ground={"left": (-half, 0.0), "right": (half, 0.0)},
        bodies=(pf.RigidBody("apex", 0.1, 1e-5, (0.0, 0.0), {"T": (0.0, 0.0)}),),
        joints=(),
        linear_springs=springs,
        assemblies=(pf.Assembly("up", {"apex": 0.0}, {"apex.T": (0.0, rise)}),),
        gravity=(0.0, 0.0),
    )


def toggle(stiffness: float = 1000.0, bar: float = 0.5, angle: float = 0.4) -> pf.Mechanism:
    """Two rigid bars in a shallow arch: hinged at O and to one another at P, on a rail against a spring at Q."""
    half, height = bar * math.cos(angle), bar * math.sin(angle)
    return pf.Mechanism(
        name="toggle",
        ground={"O": (0.0, 0.0), "R": (2.0 * half, 0.0), "S": (2.0 * half + 0.5, 0.0)},
        bodies=(
            pf.RigidBody("left", 0.1, 1e-3, (0.5 * bar, 0.0), {"O": (0.0, 0.0), "P": (bar, 0.0)}),
            pf.RigidBody("right", 0.1, 1e-3, (0.5 * bar, 0.0), {"P": (0.0, 0.0), "Q": (bar, 0.0)}),
        ),
        joints=(
            pf.RevoluteJoint("O", pf.PointRef("ground", "O"), pf.PointRef("left", "O")),
            pf.RevoluteJoint("P", pf.PointRef("left", "P"), pf.PointRef("right", "P")),
            pf.SlotJoint("rail", pf.PointRef("ground", "R"), pf.PointRef("right", "Q")),
        ),
        linear_springs=(
            pf.LinearSpring("spring", pf.PointRef("ground", "S"), pf.PointRef("right", "Q"), stiffness, 0.5),
        ),
        assemblies=(pf.Assembly("up", {"left": angle, "right": -angle}, {"left.P": (half, height)}),),
        gravity=(0.0, 0.0),
    )


def lee_frame(frames: int) -> tuple[pf.Mechanism, float]:
    """Two beams of length L at a right angle, hinged at both far ends, and EI / L^2; its load is at L / 5 on the beam.

    Lee, Manuel and Rossow (1968): the branch turns back at 18.55 EI / L^2.
    """
    length, section, steel = 1.2, pf.Section.rectangle(0.03, 0.02), pf.Material(7.2e10, 2700.0)
    points = {"column": {"A": 0.0, "B": length}, "beam": {"A": 0.0, "P": 0.2 * length, "B": length}}
    parts = tuple(pf.FlexibleBeam(name, length, section, steel, at, 1, frames=frames) for name, at in points.items())
    joints = (
        pf.RevoluteJoint("foot", pf.PointRef("ground", "O"), pf.PointRef("column", "A")),
        pf.WeldJoint("corner", pf.PointRef("column", "B"), pf.PointRef("beam", "A"), -0.5 * math.pi),
        pf.RevoluteJoint("end", pf.PointRef("beam", "B"), pf.PointRef("ground", "C")),
    )
    frame = pf.Mechanism(
        name="Lee's frame", ground={"O": (0.0, 0.0), "C": (length, length)}, bodies=parts, joints=joints,
        assemblies=(pf.Assembly("up", {"column": 0.5 * math.pi, "beam": 0.0}),), gravity=(0.0, 0.0),
    )  # fmt: skip
    return frame.with_geometry("second-order"), 7.2e10 * 0.03 * 0.02**3 / 12.0 / length**2


def wedge() -> pf.Mechanism:
    """Two wedges on three slides in a loop: angles are held once more than needed. 50 N push the first to the left."""
    parts = (
        pf.RigidBody("first", 2.0, 0.1, (0.0, 0.0), {"P": (0.0, 0.0), "S": (1.0, 0.0)}),
        pf.RigidBody("second", 3.0, 0.1, (0.0, 0.0), {"P": (0.0, 0.0)}),
    )
    joints = (
        pf.PrismaticJoint("flat", pf.PointRef("ground", "O"), pf.PointRef("first", "P")),
        pf.PrismaticJoint("slope", pf.PointRef("first", "S"), pf.PointRef("second", "P"), direction=math.pi / 6),
        pf.PrismaticJoint("upright", pf.PointRef("ground", "V"), pf.PointRef("second", "P"), direction=math.pi / 2),
    )
    return pf.Mechanism(
        name="wedge", ground={"O": (0.0, 0.0), "V": (1.0, 0.0)}, bodies=parts, joints=joints,
        loads=(pf.PointForce("push", pf.PointRef("first", "P"), (-50.0, 0.0)),),
        assemblies=(pf.Assembly("home", {"first": 0.0, "second": 0.0}),), gravity=(0.0, -9.81),
    )  # fmt: skip


def cranks(angle: float) -> pf.Mechanism:
    """A platform of 2 kg on three parallel cranks of 1 kg and 0.5 m: one holds it once more than needed."""
    rods = tuple(
        pf.RigidBody(f"crank{k}", 1.0, 0.01, (0.25, 0.0), {"A": (0.0, 0.0), "B": (0.5, 0.0)}) for k in range(3)
    )
    platform = pf.RigidBody("platform", 2.0, 0.1, (0.5, 0.0), {f"B{k}": (0.5 * k, 0.0) for k in range(3)})
    joints = [
        pf.RevoluteJoint(f"{name}{k}", a, b)
        for k in range(3)
        for name, a, b in (
            ("A", pf.PointRef("ground", f"O{k}"), pf.PointRef(f"crank{k}", "A")),
            ("B", pf.PointRef(f"crank{k}", "B"), pf.PointRef("platform", f"B{k}")),
        )
    ]
    return pf.Mechanism(
        name="cranks", ground={f"O{k}": (0.5 * k, 0.0) for k in range(3)}, bodies=(*rods, platform),
        joints=tuple(joints), gravity=(0.0, -9.81),
        assemblies=(pf.Assembly("up", {f"crank{k}": angle for k in range(3)} | {"platform": 0.0}),),
    )  # fmt: skip


def exact_guide(sideways: float, upwards: float, apart: float = 0.05) -> tuple[float, float, float]:
    """Travel of T along x and y [m] and turn of the stage [rad] of `guide` as extensible elastica, by shooting.

    Each leaf is integrated from its root with a constant force; forces, root moments and the pose of the stage are such
    that the tips are on the stage and it is in equilibrium. The load comes in steps, each solved from the one before.
    """
    area, size = E * WIDTH * THICKNESS, np.array([10.0, 100.0, 0.5, 10.0, 100.0, 0.5, 1e-2, 1e-3, 1e-3])

    def tip(force: np.ndarray, moment: float) -> np.ndarray:
        def slopes(_: float, at: np.ndarray) -> list[float]:
            _, _, angle, bending = at
            along = np.array([math.cos(angle), math.sin(angle)])
            dx, dy = (1.0 + float(force @ along) / area) * along
            return [dx, dy, bending / EI, dy * force[0] - dx * force[1]]

        start = [0.0, 0.0, 0.5 * math.pi, moment]
        return solve_ivp(slopes, (0.0, LENGTH), start, method="DOP853", rtol=1e-12, atol=1e-16).y[:, -1]

    def pose(unknown: np.ndarray) -> np.ndarray:
        x, y, turn = unknown[6:]
        half = 0.5 * apart * np.array([math.cos(turn), math.sin(turn)])
        return np.array([x + half[0] - 0.5 * apart, y + half[1], turn])

    def residual(scaled: np.ndarray, share: float) -> np.ndarray:
        unknown = scaled * size
        left, right, (x, y, turn) = unknown[:3], unknown[3:6], unknown[6:]
        across = apart * np.array([math.cos(turn), math.sin(turn)])
        load = share * np.array([sideways, upwards])
        ends = [tip(each[:2], each[2]) for each in (left, right)]
        places = [ends[0][:2] - [x, LENGTH + y], ends[1][:2] + [apart, 0.0] - [x, LENGTH + y] - across]
        turns = [end[2] - 0.5 * math.pi - turn for end in ends]
        moment = 0.5 * _cross(across, load) - ends[0][3] - ends[1][3] - _cross(across, right[:2])
        return np.concatenate([1e3 * np.ravel(places), 1e3 * np.array(turns), (load - left[:2] - right[:2]) / 10.0,
                               [10.0 * moment]])  # fmt: skip

    found = np.array([0.5, 0.0, 0.5, 0.5, 0.0, 0.5, 0.1, 0.0, 0.0])
    for share in (0.2, 0.5, 0.8, 1.0):
        found = root(residual, found, args=(share,), tol=1e-13).x
    assert np.max(np.abs(residual(found, 1.0))) < 1e-10
    x, y, turn = pose(found * size)
    return float(x), float(y), float(turn)


def _cross(a: np.ndarray, b: np.ndarray) -> float:
    return float(a[0] * b[1] - a[1] * b[0])
