"""Static equilibria: closed forms, elastica by shooting, limit points, buckling, stiffness, errors."""

from __future__ import annotations

import math
from dataclasses import replace

import numpy as np
import pytest
from scipy.integrate import simpson
from scipy.special import ellipe, ellipk

import paraflex as pf
from flexures import (
    EI,
    LEAF,
    LENGTH,
    STEEL,
    THICKNESS,
    WIDTH,
    E,
    cantilever,
    chain,
    column,
    cranks,
    exact_guide,
    guide,
    lee_frame,
    pivot,
    toggle,
    truss,
    wedge,
)
from paraflex.designs.measure import coarseness, measure
from paraflex.errors import EquilibriumError, LimitPointError, ValidityWarning
from paraflex.results import load_results, save_results, statics_summary

UP = math.pi / 2


# Closed forms of buckling


@pytest.mark.parametrize(
    ("lower", "upper", "factor"),
    [
        ("clamped", "free", 0.25),
        ("pinned", "pinned", 1.0),
        ("clamped", "pinned", 2.0457478),
        ("clamped", "clamped", 4.0),
    ],
)
def test_columns_of_euler_buckle_at_their_loads(lower: str, upper: str, factor: float) -> None:
    # The third number squares the first root of tan x = x, over pi^2.
    wanted = factor * math.pi**2 * EI / LENGTH**2
    found = pf.statics(column(lower, upper), loads={"column.B.y": -0.5 * wanted}, steps=1)
    assert found.buckling[:, 0] == pytest.approx([2.0, 2.0], rel=1e-5)
    assert found.stable.all()


@pytest.mark.parametrize(("tip", "steps"), [(60.0, 3), (120.0, 7), (120.0, 3)])
def test_a_column_pushed_across_its_load_bends_as_the_elastica(tip: float, steps: int) -> None:
    """It leaves its axis within a small part of the load, and no factor of the straight column is left."""
    modulus = math.sin(math.radians(tip / 2.0)) ** 2
    K, whole = ellipk(modulus), ellipe(modulus)
    load = K**2 * EI / LENGTH**2
    loads = {"leaf16.B.x": -load, "leaf16.B.y": 1e-4 * load}
    found = pf.statics(cantilever(16), loads=loads, steps=steps, warning=False)
    assert found.stable.all()
    place = [found.place(name)[-1] / LENGTH for name in ("leaf16.B.x", "leaf16.B.y")]
    assert place == pytest.approx([2.0 * whole / K - 1.0, 2.0 * math.sqrt(modulus) / K], abs=1e-3)
    assert np.isnan(found.buckling[0, 0])
    assert "contradicts" in found.equilibria[0].buckling.reason


def test_travel_along_a_column_buckles_it_at_the_shortening_of_its_load() -> None:
    shortening = math.pi**2 * EI / LENGTH**2 * LENGTH / (E * WIDTH * THICKNESS)
    found = pf.statics(column("pinned", "pinned"), moved={"column.B.y": -2.5 * shortening}, steps=4, warning=False)
    assert found.buckling[0, 0] == pytest.approx(0.4, rel=1e-4)
    assert found.stable.tolist() == [True, True, False, False, False]


def test_beyond_its_load_a_column_is_unstable_and_the_motion_that_grows_is_told() -> None:
    load = 1.2 * math.pi**2 * EI / LENGTH**2
    with pytest.warns(pf.ResultWarning, match=r"unstable, the first at load factor 1: column"):
        found = pf.statics(column("pinned", "pinned"), loads={"column.B.y": -load}, steps=4)
    assert found.stable.tolist() == [True, True, True, True, False]
    assert found.buckling[0, 0] == pytest.approx(1.0 / 1.2, rel=1e-5)
    assert found.findings[0].code == "equilibrium-unstable"


def test_buckling_shapes_are_those_of_euler() -> None:
    found = pf.statics(column("pinned", "pinned", elements=4), loads={"column.B.y": -1.0}, steps=1, buckling=3)
    assert found.buckling[0] * EI**-1 * LENGTH**2 / math.pi**2 == pytest.approx([1.0, 4.0, 9.0], rel=1e-4)


def test_a_guide_pushed_sideways_buckles_in_a_leaf_whatever_the_frames() -> None:
    """The push presses one leaf with P L / (2 apart); both its ends are clamped: 4 pi^2 EI / L^2."""
    wanted = 4.0 * math.pi**2 * EI / LENGTH**2 / (10.5 * LENGTH / (2.0 * 0.05))
    found = [pf.statics(guide(frames, elements=2), loads={"stage.T.x": 10.5}, steps=1) for frames in (1, 4, 8)]
    assert [one.buckling[0, 0] for one in found] == pytest.approx([wanted] * 3, rel=1e-3)
    assert found[1].buckling[-1, 0] == pytest.approx(found[2].buckling[-1, 0], rel=3e-3)
    assert all((one.buckling > one.fraction[:, None]).all() for one in found)


@pytest.mark.parametrize("frames", [1, 4, 16])
def test_a_cantilever_under_a_load_across_does_not_buckle(frames: int) -> None:
    loads = {f"leaf{frames}.B.y": 2.0 * EI / LENGTH**2}
    found = pf.statics(cantilever(frames), loads=loads, steps=4, warning=False)
    assert np.isnan(found.buckling).all()
    assert "full turn" in found.equilibria[0].buckling.reason


@pytest.mark.parametrize(("frames", "load"), [(4, 18.0), (12, 18.0), (4, 20.0)])
def test_the_factor_of_a_frame_is_that_of_its_limit_point(frames: int, load: float) -> None:
    """On the branch or a little beyond what is given, where linear estimates are off by up to a factor of four."""
    frame, unit = lee_frame(frames)
    found = pf.statics(frame, loads={"beam.P.y": -load * unit}, steps=6, warning=False)
    until = int(np.flatnonzero(~found.stable)[0]) if load > 18.55 else len(found.fraction)
    assert load * found.buckling[:until, 0] == pytest.approx([18.55] * until, rel=1e-3)


@pytest.mark.filterwarnings("ignore::paraflex.ModelWarning")
@pytest.mark.parametrize("scale", [1e-4, 1e2])
def test_factors_and_frequencies_do_not_depend_on_the_size(scale: float) -> None:
    """Stresses alike: forces grow with the square of the size, frequencies fall with it."""
    changes = {
        "parameters.length": 0.1 * scale, "parameters.apart": 0.05 * scale, "section.leaf.width": WIDTH * scale,
        "section.leaf.thickness": THICKNESS * scale, "body.stage.mass": 0.2 * scale**3,
        "body.stage.inertia": 1e-4 * scale**5, "body.left.frames": 4, "body.right.frames": 4,
    }  # fmt: skip
    small = pf.statics(pf.load("leaf_spring_guide", set=changes), loads={"stage.T.x": 10.5 * scale**2}, steps=1)
    frames = {name: 4 for name in changes if name.endswith("frames")}
    own = pf.statics(pf.load("leaf_spring_guide", set=frames), loads={"stage.T.x": 10.5}, steps=1)
    assert small.buckling == pytest.approx(own.buckling, rel=1e-4)
    assert scale * small.frequencies[:, :5] == pytest.approx(own.frequencies[:, :5], rel=1e-4)


def test_many_frames_and_several_factors_of_a_column() -> None:
    """More coordinates than have all their vibrations computed."""
    found = pf.statics(cantilever(80), loads={"leaf80.B.x": -0.1}, steps=1, buckling=2)
    assert not found.equilibria[0].vibrations.complete
    euler = 0.25 * math.pi**2 * EI / LENGTH**2 / 0.1
    assert found.buckling == pytest.approx(np.array([[euler, 9.0 * euler]] * 2), rel=1e-3)


# A truss that snaps


def truss_force(height: float, stiffness: float = 1000.0, half: float = 1.0, rise: float = 0.3) -> float:
    """Force downwards at a height of the apex."""
    free, length = math.hypot(half, rise), math.hypot(half, height)
    return 2.0 * stiffness * (free - length) / length * height


def snap_height(half: float = 1.0, rise: float = 0.3) -> float:
    """Height of the limit point: length^3 = free length * half^2."""
    return math.sqrt((math.hypot(half, rise) * half**2) ** (2 / 3) - half**2)


def test_a_truss_snaps_at_the_load_of_its_closed_form_and_both_branches_are_found() -> None:
    limit = truss_force(snap_height())
    found = pf.statics(truss(), loads={"apex.T.y": -1.5 * limit}, held=["apex.T.angle"], steps=10, warning=False)
    assert 1.5 * found.fraction[found.limit] == pytest.approx([1.0, -1.0], rel=1e-9)
    assert found.place("apex.T.y")[found.limit] == pytest.approx([snap_height(), -snap_height()], rel=1e-6)
    assert 1.5 * found.buckling[:3, 0] == pytest.approx([1.0] * 3, rel=1e-9)
    heights, forces = found.place("apex.T.y"), -found.effort("apex.T.y")
    assert forces == pytest.approx([truss_force(y) for y in heights], abs=1e-9 * limit)
    # Above, between the limit points, below.
    first, second = np.flatnonzero(found.limit)
    stable = found.stable
    assert stable[:first].all()
    assert not stable[first : second + 1].any()
    assert stable[second + 1 :].all()
    assert heights[-1] < -0.3


def test_travel_passes_the_limit_of_the_load() -> None:
    found = pf.statics(truss(), moved={"apex.T.y": -0.6}, held=["apex.T.angle"], steps=12)
    heights = 0.3 - np.arange(13) * 0.05
    assert found.place("apex.T.y") == pytest.approx(heights, abs=1e-12)
    assert -found.effort("apex.T.y") == pytest.approx([truss_force(y) for y in heights], abs=1e-9)
    # Stiffness of the closed form, negative between the limit points; with the travel given all are stable.
    slope = [(truss_force(y - 1e-6) - truss_force(y + 1e-6)) / 2e-6 for y in heights]
    assert found.stiffness("apex.T.y") == pytest.approx(slope, rel=1e-6, abs=1e-5)
    assert found.stable.all()
    assert (found.stiffness("apex.T.y")[5:8] < 0.0).all()


def test_buckling_factors_take_the_turn_of_links_with_them():
    """Two bars in an arch turn as they are pressed down, so that the directions their joints allow turn too.

    The force is F = 4 k L (cos a - cos a0) tan a; near its largest value the stiffness falls with the root of what is
    left of the load, and its tangent ends as much beyond the limit as the load is below it.
    """
    angles = np.linspace(0.0, 0.4, 400_001)
    largest = float(np.max(4.0 * 1000.0 * 0.5 * (np.cos(angles) - np.cos(0.4)) * np.tan(angles)))
    for left in (1e-3, 1e-4):
        found = pf.statics(toggle(), loads={"left.P.y": -(1.0 - left) * largest}, steps=4)
        factor = float(found.buckling[-1, 0]) * (1.0 - left)
        assert factor - 1.0 == pytest.approx(left, rel=0.1)


@pytest.mark.parametrize(("load", "buckles"), [(6.0, True), (40.0, False)])
def test_estimates_with_a_stiffening_law_are_those_of_its_tangent(load, buckles):
    """A rigid arm on a spring of torque -20 (x - 0.3) - 30 x^3 is turned by a force across.

    The stiffness 20 + 90 x^2 - F l sin x first decreases and then increases, so that nothing buckles.
    """
    arm = pf.RigidBody("arm", mass=1.0, inertia=0.02, centre_of_mass=(0.0, 0.0), points={"O": (0, 0), "E": (0.5, 0)})
    mechanism = pf.Mechanism(
        name="arm", ground={"O": (0.0, 0.0)}, bodies=(arm,), joints=(pf.RevoluteJoint("O", "ground.O", "arm.O"),),
        springs=(pf.TorsionalSpring("coil", "O", torque=pf.ForceLaw("-20 * (O.angle - 0.3) - 30 * O.angle**3")),),
        assemblies=(pf.Assembly("up", {"arm": 0.2}),),
    )  # fmt: skip
    found = pf.statics(mechanism, loads={"arm.E.y": -load}, held=[], steps=4)
    x, force = found.q[:, 2], -load * found.fraction
    assert 20.0 * (x - 0.3) + 30.0 * x**3 == pytest.approx(0.5 * force * np.cos(x), abs=1e-8)
    tangent = 20.0 + 90.0 * x**2 + 0.5 * force * np.sin(x)
    assert found.frequencies[:, 0] ** 2 * 0.02 == pytest.approx(tangent, rel=1e-8)
    turn = -0.5 * load * np.cos(x) / tangent
    change = 180.0 * x * turn - 0.5 * load * np.sin(x) + 0.5 * force * np.cos(x) * turn
    if buckles:
        assert (change < 0.0).all()
        assert found.buckling[:, 0] == pytest.approx(found.fraction - tangent / change, rel=1e-5)
    else:
        assert change[0] < 0.0 < change[-1]
        assert np.isnan(found.buckling).all()
        assert "as seen from which nothing buckles" in found.equilibria[0].buckling.reason


def test_below_the_limit_the_branch_ends_with_what_is_given() -> None:
    limit = truss_force(snap_height())
    found = pf.statics(truss(), loads={"apex.T.y": -0.9 * limit}, held=["apex.T.angle"], steps=3)
    assert found.fraction == pytest.approx([0.0, 1 / 3, 2 / 3, 1.0])
    assert not found.limit.any()
    assert found.stable.all()


# Leaf springs


def test_the_stiffness_of_a_guide_under_a_weight() -> None:
    straight = guide(1, elements=4)
    none = pf.statics(straight, loads={"stage.T.y": -1e-3}, steps=1, stiffness=["stage.T.x"])
    assert none.stiffness("stage.T.x")[0] == pytest.approx(24.0 * EI / LENGTH**3, rel=1e-4)
    slope = np.diff(none.stiffness("stage.T.x"))[0] / 1e-3
    assert slope == pytest.approx(-1.2 / LENGTH, rel=1e-3)
    assert none.buckling[0, 0] * 1e-3 == pytest.approx(2.0 * math.pi**2 * EI / LENGTH**2, rel=1e-4)


@pytest.mark.parametrize("tension", [-5.0, 0.0, 5.0])
def test_vertical_displacement_of_the_beam_constraint_model(tension: float) -> None:
    # Leaves far apart, so that the stage does not turn: per leaf a tension, y = 0.05 L.
    y = 0.05 * LENGTH
    found = pf.statics(
        guide(2), moved={"stage.T.x": y}, loads={"stage.T.y": 2.0 * tension}, held=["stage.T.angle"], steps=1
    )
    area = WIDTH * THICKNESS
    wanted = -0.6 * y**2 / LENGTH + tension * LENGTH / (E * area) + tension * LENGTH * y**2 / (700.0 * EI)
    assert found.travel("stage.T.y")[-1] == pytest.approx(wanted, rel=0.01)


# Loads sideways and upwards, travel along x and y, turn of the stage, and how far it is off in four frames a leaf.
PUSHED = ((10.5, 0.0), (9.913448e-3, -0.591614e-3), -1.559236e-4, 2e-4)
WEIGHED = ((1.05, -80.0), (12.751017e-3, -1.008472e-3), -3.617455e-4, 4e-4)


@pytest.mark.parametrize(("load", "travel", "turn", "_"), [PUSHED, WEIGHED])
def test_exact_numbers_of_a_guide_are_those_of_shooting(
    load: tuple[float, float], travel: tuple[float, float], turn: float, _: float
) -> None:
    assert exact_guide(*load) == pytest.approx((*travel, turn), rel=1e-6)


@pytest.mark.parametrize(("load", "travel", "turn", "off"), [PUSHED, WEIGHED])
def test_a_guide_of_two_leaves_moves_as_the_exact_elastica(
    load: tuple[float, float], travel: tuple[float, float], turn: float, off: float
) -> None:
    loads = dict(zip(("stage.T.x", "stage.T.y"), load, strict=True))
    # The turn is a difference of what the leaves sink: 1.6e-4 and 3.9e-4 off in four frames, 1.5e-5 in eight; more
    # elements in a frame change nothing.
    given = {"loads": loads, "stiffness": ["stage.T.angle"], "steps": 1}
    coarse, fine, finer = (pf.statics(each, **given) for each in (guide(4), guide(8), guide(4, elements=2)))
    for found, places, angle in ((coarse, 1e-4, off), (fine, 1e-5, 2e-5)):
        assert [found.travel(f"stage.T.{axis}")[-1] for axis in "xy"] == pytest.approx(travel, rel=places)
        assert found.travel("stage.T.angle")[-1] == pytest.approx(turn, rel=angle)
    assert finer.travel("stage.T.angle")[-1] == pytest.approx(coarse.travel("stage.T.angle")[-1], rel=5e-6)


@pytest.mark.parametrize(
    ("moment", "angle", "crossing"),
    [
        (0.219911486, 0.248788363, (-0.089993e-3, 0.719717e-3)),
        (0.467311907, 0.512592381, (-0.766623e-3, 2.925378e-3)),
    ],
)
def test_a_cross_spring_pivot_turns_as_the_exact_elastica(
    moment: float, angle: float, crossing: tuple[float, float]
) -> None:
    found = pf.statics(
        pivot(4), loads={"stage.C.angle": moment}, steps=2, stiffness=["stage.C.x", "stage.C.y"], warning=False
    )
    assert found.travel("stage.C.angle")[-1] == pytest.approx(angle, rel=1e-4)
    moved = [found.travel(f"stage.C.{axis}")[-1] for axis in "xy"]
    assert moved == pytest.approx(crossing, rel=1e-4)


def test_the_stiffness_of_a_cross_spring_pivot_under_a_vertical_load() -> None:
    found = pf.statics(pivot(1, elements=4), loads={"stage.C.y": 1e-2}, steps=1, stiffness=["stage.C.angle"])
    none, loaded = found.stiffness("stage.C.angle")
    assert none == pytest.approx(2.0 * EI / LENGTH, rel=1e-5)
    wanted = 2.0 / 15.0 * (9.0 / 4.0 - 9.0 / 2.0 + 1.0) * LENGTH / math.cos(math.pi / 4)
    assert (loaded - none) / 1e-2 == pytest.approx(wanted, rel=1e-3)


def test_a_strip_under_an_end_moment_rolls_to_a_circle() -> None:
    parts, welds = chain("strip", 16)
    strip = pf.Mechanism(
        name="strip", ground={"O": (0.0, 0.0)}, bodies=tuple(parts),
        joints=(pf.WeldJoint("root", pf.PointRef("ground", "O"), pf.PointRef("strip1", "A")), *welds),
        assemblies=(pf.Assembly("straight", {part.name: 0.0 for part in parts}),), gravity=(0.0, 0.0),
    )  # fmt: skip
    found = pf.statics(
        strip, loads={"strip16.B.angle": 2.0 * math.pi * EI / LENGTH}, steps=8, warning=False,
        stiffness=["strip16.B.x", "strip16.B.y"],
    )  # fmt: skip
    turn = 2.0 * math.pi * found.fraction[1:]
    assert found.travel("strip16.B.angle")[1:] == pytest.approx(turn, rel=1e-6)
    assert found.place("strip16.B.x")[1:] == pytest.approx(LENGTH * np.sin(turn) / turn, abs=1e-5 * LENGTH)
    assert found.place("strip16.B.y")[1:] == pytest.approx(LENGTH * (1 - np.cos(turn)) / turn, abs=1e-5 * LENGTH)


# What follows from one another


def test_load_and_travel_find_the_same_equilibria_and_stiffness_is_their_slope() -> None:
    pushed = pf.statics(guide(1), moved={"stage.T.x": 0.01}, steps=4)
    force = pushed.effort("stage.T.x")
    pulled = pf.statics(guide(1), loads={"stage.T.x": force[-1]}, steps=1)
    assert pulled.travel("stage.T.x")[-1] == pytest.approx(0.01, rel=1e-9)
    assert pulled.q[-1] == pytest.approx(pushed.q[-1], abs=1e-9)
    assert pulled.stiffness("stage.T.x")[-1] == pytest.approx(pushed.stiffness("stage.T.x")[-1], rel=1e-7)
    ahead = pf.statics(guide(1), moved={"stage.T.x": 0.01 + 1e-5}, steps=1).effort("stage.T.x")[-1]
    behind = pf.statics(guide(1), moved={"stage.T.x": 0.01 - 1e-5}, steps=1).effort("stage.T.x")[-1]
    assert pushed.stiffness("stage.T.x")[-1] == pytest.approx((ahead - behind) / 2e-5, rel=1e-5)


def test_the_strain_energy_is_the_work_of_what_moves_it() -> None:
    found = pf.statics(guide(1), moved={"stage.T.x": 0.01}, steps=6)
    work = simpson(found.effort("stage.T.x"), found.travel("stage.T.x"))
    assert found.solution.strain_energy[-1] == pytest.approx(work, rel=1e-4)


def test_equilibria_and_frequencies_are_those_of_the_linear_model_and_of_a_run() -> None:
    robot = pf.load("raparm_i").mechanism.with_geometry("second-order")
    found = pf.statics(robot, stiffness=["link4.C.x"])
    model = pf.linearise(robot, balanced=True)
    assert found.frequencies[0][:3] == pytest.approx(model.held_frequencies()[:3], rel=1e-6)
    # The end-effector's stiffness with the motors held, by a push.
    push = pf.statics(robot, loads={"link4.C.x": 1e-3}, steps=1)
    assert 1e-3 / push.travel("link4.C.x")[-1] == pytest.approx(found.stiffness("link4.C.x")[0], rel=1e-5)


def test_motors_hold_with_torques_that_balance_a_load() -> None:
    bar = pf.FlexibleBeam("bar", 0.5, LEAF, STEEL, {"A": 0.0, "B": 0.5}, 2)
    arm = pf.Mechanism(
        name="arm", ground={"O": (0.0, 0.0)}, bodies=(bar,),
        joints=(pf.RevoluteJoint("O", pf.PointRef("ground", "O"), pf.PointRef("bar", "A")),),
        motors=(pf.Motor("m", "O"),), assemblies=(pf.Assembly("flat", {"bar": 0.0}),), gravity=(0.0, 0.0),
    )  # fmt: skip
    held = pf.statics(arm, loads={"bar.B.y": 0.01}, steps=1, stiffness=["bar.B.x"])
    lever = held.place("bar.B.x")[-1]
    assert held.effort("O")[-1] == pytest.approx(-0.01 * lever, rel=1e-9)
    data = pf.statics_dataset(held)
    assert data["torque"].values[-1] == pytest.approx([-0.01 * lever], rel=1e-9)
    assert data["joint_moment"].sel(joint="O").values[-1] == pytest.approx(-0.01 * lever, rel=1e-9)
    assert data["joint_force"].sel(joint="O").values[-1] == pytest.approx([0.0, -0.01], abs=1e-10)
    assert data["frame_force"].values[-1] == pytest.approx([0.0, 0.01], abs=1e-10)
    # The section at the root carries what the motor does, and a torque in its place holds the same pose.
    assert abs(data["section_moment"].values[-1]).max() == pytest.approx(0.01 * lever, rel=1e-3)
    lifted = held.travel("bar.B.y")[-1]
    turned = pf.statics(arm, torques={"m": held.effort("O")[-1]}, moved={"bar.B.y": lifted}, steps=1)
    assert turned.effort("bar.B.y")[-1] == pytest.approx(0.01, rel=1e-8)


def test_an_own_weight_acts_in_full_from_the_start() -> None:
    heavy = replace(guide(1), gravity=(0.0, -9.81))
    found = pf.statics(heavy, stiffness=["stage.T.x"])
    light = pf.statics(guide(1), stiffness=["stage.T.x"])
    weight = 9.81 * (0.2 + 7850.0 * WIDTH * THICKNESS * LENGTH)
    assert found.fraction.tolist() == [0.0]
    change = found.stiffness("stage.T.x")[0] - light.stiffness("stage.T.x")[0]
    assert change == pytest.approx(-1.2 * weight / LENGTH, rel=0.01)


def test_free_frequencies_are_those_under_the_force_that_moves_it() -> None:
    moved = pf.statics(guide(1), moved={"stage.T.x": 0.01}, steps=1)
    loaded = pf.statics(guide(1), loads={"stage.T.x": moved.effort("stage.T.x")[-1]}, steps=1)
    assert moved.free_frequencies[-1, :5] == pytest.approx(loaded.frequencies[-1, :5], rel=1e-5)
    # 13/35 of the leaves' mass moves with the stage.
    mass = 0.2 + 2.0 * 13.0 / 35.0 * 7850.0 * WIDTH * THICKNESS * LENGTH
    assert moved.free_frequencies[0, 0] == pytest.approx(math.sqrt(24.0 * EI / LENGTH**3 / mass), rel=2e-3)
    assert moved.frequencies[0, 0] > 10.0 * moved.free_frequencies[0, 0]
    data = pf.statics_dataset(moved)
    assert data["free_frequency"].values[:, 0] == pytest.approx(moved.free_frequencies[:, 0] / (2.0 * math.pi))


# Redundant constraints


def test_moments_of_three_slides_in_a_loop_are_not_determined_and_their_forces_are() -> None:
    with pytest.warns(pf.ResultWarning, match="moments in flat, slope, upright are not determined"):
        found = pf.statics(wedge(), held=["upright"])
    data = pf.statics_dataset(found).isel(step=-1)
    assert np.isnan(data["joint_moment"].values).all()
    # The slope takes 50 N sideways, and as its normal says; weights of 2 and 3 kg come to the others.
    normal = 50.0 * np.array([-1.0, math.sqrt(3.0)])
    assert data["joint_force"].sel(joint="slope").values == pytest.approx(normal, rel=1e-9)
    assert data["joint_force"].sel(joint="flat").values == pytest.approx([0.0, 2.0 * 9.81 + normal[1]], abs=1e-8)
    assert found.known_effort("upright")[-1] == pytest.approx(3.0 * 9.81 - normal[1], rel=1e-9)


def test_three_cranks_share_forces_along_them_in_any_way() -> None:
    slanted = pf.statics(cranks(1.0), held=["A0"], warning=False)
    data = pf.statics_dataset(slanted).isel(step=-1)
    assert np.isnan(data["joint_force"].values).all()
    assert data["joint_moment"].values[1:] == pytest.approx(np.zeros(5), abs=1e-9)
    torque = 9.81 * (3.0 * 0.25 + 2.0 * 0.5) * math.cos(1.0)
    assert slanted.known_effort("A0")[-1] == pytest.approx(torque, rel=1e-9)
    assert data["frame_force"].values == pytest.approx([0.0, -5.0 * 9.81], abs=1e-8)
    # Upright cranks push upwards alone; two that are held share the torque.
    upright = pf.statics_dataset(pf.statics(cranks(math.pi / 2), held=["A0"], warning=False))["joint_force"].values[-1]
    assert upright[:, 0] == pytest.approx(np.zeros(6), abs=1e-9)
    assert np.isnan(upright[:, 1]).all()
    assert math.isnan(measure(slanted, ["joint_force_max"])["joint_force_max"])
    assert "forces in A0, B0" in coarseness(slanted, ["joint_force_max"])
    assert coarseness(slanted, ["strain_energy_max"]) == ""
    both = pf.statics(cranks(1.0), held=["A0", "A1"], warning=False)
    assert np.isnan([both.known_effort("A0")[-1], both.known_effort("A1")[-1]]).all()
    assert both.effort("A0")[-1] + both.effort("A1")[-1] == pytest.approx(torque, rel=1e-9)
    assert np.isnan(pf.statics_dataset(both)["effort"].values).all()


def test_a_run_marks_what_redundant_constraints_share() -> None:
    with pytest.warns(pf.ResultWarning, match="loads-undetermined"):
        run = pf.simulate_motion(wedge(), 0.1, samples=5)
    data = pf.motion_dataset(run)
    assert np.isnan(data["joint_moment"].values).all()
    # 2 x'' = -50 + N / 2, 3 y'' = N sqrt(3) / 2 - 3 g, y'' = -x'' / sqrt(3).
    force = 3.0 * (9.81 + 25.0 / math.sqrt(3.0)) / (0.5 * math.sqrt(3.0) + 0.75 / math.sqrt(3.0))
    wanted = force * np.array([-0.5, 0.5 * math.sqrt(3.0)])
    assert data["joint_force"].sel(joint="slope").values == pytest.approx(np.array([wanted] * 5), rel=1e-8)


def test_two_drives_of_one_freedom_share_its_torque() -> None:
    standing = cranks(1.0)
    drives = [pf.PrescribedAngle(name, name, pf.ConstantSpeed(1.0, 2.0)) for name in ("A0", "A1")]
    one, both = (replace(standing, prescribed=tuple(drives[:n]), motors=(), modes=()) for n in (1, 2))
    data = pf.motion_dataset(pf.simulate_motion(one, 0.1, samples=5, warning=False))
    assert np.isfinite(data["drive_torque"].values).all()
    with pytest.warns(pf.ResultWarning, match="torques or forces of prescribed.A0, prescribed.A1 are not determined"):
        run = pf.simulate_motion(both, 0.1, samples=5)
    assert np.isnan(pf.motion_dataset(run)["drive_torque"].values).all()
    assert math.isnan(measure(run, ["drive_torque_max"])["drive_torque_max.A0"])
    assert "prescribed.A0" in coarseness(run, ["drive_torque_max"])


# Errors


def test_more_load_than_any_equilibrium_carries_is_a_limit_point_error_with_the_steps_until_then() -> None:
    # A torque lifts a weight on an arm no further than to the horizontal.
    heavy = pf.RigidBody("arm", 2.0, 1e-3, (0.3, 0.0), {"O": (0.0, 0.0), "P": (0.3, 0.0)})
    pendulum = pf.Mechanism(
        name="pendulum", ground={"O": (0.0, 0.0)}, bodies=(heavy,),
        joints=(pf.RevoluteJoint("O", pf.PointRef("ground", "O"), pf.PointRef("arm", "O")),),
        assemblies=(pf.Assembly("down", {"arm": -UP}),), gravity=(0.0, -9.81),
    )  # fmt: skip
    most = 2.0 * 9.81 * 0.3
    with pytest.raises(LimitPointError, match=r"no equilibrium beyond load factor 0\.8 ") as caught:
        pf.statics(pendulum, loads={"O": 1.25 * most}, steps=4)
    found = caught.value.partial
    assert found.status == "failed"
    assert found.fraction[0] == 0.0
    assert found.fraction[found.limit] == pytest.approx([0.8, -0.8], rel=1e-12)
    assert found.place("O")[found.limit] == pytest.approx([0.0, math.pi], abs=1e-6)
    assert found.stable.tolist() == [abs(x) < UP - 1e-5 for x in np.angle(np.exp(1j * (found.place("O") + UP)))]


def test_what_nothing_holds_is_said() -> None:
    with pytest.raises(EquilibriumError, match="hold joints that turn or slide freely"):
        pf.statics(truss(), moved={"apex.T.y": -0.1})


@pytest.mark.parametrize(
    ("arguments", "message"),
    [
        ({"loads": {"stage.T.z": 1.0}}, r"loads\.stage\.T\.z: is neither a joint nor a coordinate"),
        ({"loads": {"stage.T.x": math.nan}}, r"loads\.stage\.T\.x: not a finite number .* give it in N"),
        ({"moved": {"tip_left": 1.0}}, r"moved\.tip_left: holds its angle"),
        ({"moved": {"stage.T.x": 0.01}, "held": ["stage.T.x"]}, "held: is given twice"),
        ({"loads": {"stage.T.x": 1.0}, "steps": 0}, r"steps: no such number of steps .*got 0"),
        ({"torques": {"m": 1.0}}, "torques: unknown motor"),
        ({"stiffness": ["stage"]}, "stiffness: is neither a joint nor"),
    ],
)
def test_bad_input_is_named(arguments: dict, message: str) -> None:
    with pytest.raises(pf.InputError, match=message):
        pf.statics(guide(1), **arguments)


def test_bending_beyond_the_geometry_warns_with_the_step() -> None:
    with pytest.warns(ValidityWarning, match="at step 2"):
        pf.statics(guide(1), loads={"stage.T.x": 40.0}, steps=2)


# The dataset


def test_a_dataset_names_and_keeps_everything(tmp_path) -> None:
    found = pf.statics(guide(2), loads={"stage.T.x": 10.5}, held=[], steps=4, stiffness=["stage.T.x", "stage.T.y"])
    data = pf.statics_dataset(found)
    save_results(data, tmp_path / "statics.nc")
    again = load_results(tmp_path / "statics.nc")
    assert again["travel"].sel(named="stage.T.x").values == pytest.approx(found.travel("stage.T.x"))
    assert again["compliance"].values == pytest.approx(1.0 / again["stiffness"].values)
    assert again["effort_unit"].values.tolist() == ["N", "N"]
    assert again["role"].values.tolist() == ["loaded", "free"]
    # Leaves bend to 6 E I y / L^2 at their ends.
    assert float(again["bending_stress_max"].max()) == pytest.approx(
        0.5 * THICKNESS * E * 6.0 * found.travel("stage.T.x")[-1] / LENGTH**2, rel=0.1
    )
    assert again["frame_force"].values[-1] == pytest.approx([10.5, 0.0], abs=1e-8)
    summary = statics_summary(again)
    assert summary["last"]["stage.T.x"]["effort"] == pytest.approx(10.5)
    assert summary["stable"]
    assert summary["steps"] == 4
    for name in again.data_vars:
        assert "time" not in again[name].dims
        assert again[name].attrs.get("long_name"), name


@pytest.mark.parametrize("angle", ["pi/2", "0.0", "1.0"])
def test_a_bar_on_a_spring_stands_in_any_direction(tmp_path, angle):
    """It does not move but for rounding, which counted as its displacement: upright no step led on."""
    (tmp_path / "bar.toml").write_text(f"""
name = "bar"
gravity = [0.0, 0.0]
ground = {{ O = [0.0, 0.0] }}
[body.bar]
type = "rigid"
mass = 1.0
inertia = 1.0
points = {{ A = [0.0, 0.0], B = [1.0, 0.0] }}
[joint]
O = ["ground.O", "bar.A"]
[spring.s]
joint = "O"
stiffness = 1000.0
rest = "{angle}"
[assembly.a]
bar = "{angle}"
""")
    turn = {"pi/2": np.pi / 2.0, "0.0": 0.0, "1.0": 1.0}[angle]
    loads = {"bar.B.x": -300.0 * np.cos(turn), "bar.B.y": -300.0 * np.sin(turn)}
    found = pf.statics(pf.load(tmp_path / "bar.toml"), loads=loads, steps=2)
    assert found.buckling[-1, 0] == pytest.approx(1000.0 / 300.0, rel=1e-9)
    assert found.stable.all()
