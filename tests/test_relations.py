"""Relations of two joints and more: closed forms of belts and differentials, studies, files, engines, refusals."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

import paraflex as pf
from paraflex.cli.inspect import describe
from paraflex.designs.sweep import load_sweep
from paraflex.dynamics import build_system, consistent_state, natural_frequencies
from paraflex.dynamics.joint_coordinates import joint_coordinate
from paraflex.dynamics.soundness import mobility
from paraflex.engines.common import check_engine
from paraflex.errors import InputError
from paraflex.mechanism import (
    AppliedTorque,
    Assembly,
    FlexibleBeam,
    Gear,
    Material,
    Mechanism,
    Motor,
    PointRef,
    RevoluteJoint,
    RigidBody,
    Section,
    SumRelation,
    TorsionalSpring,
    WeldJoint,
    finite_segments,
)
from paraflex.motion import simulate_motion
from paraflex.plots.marks import moving_marks
from paraflex.plots.scene import scene
from paraflex.results import motion_dataset

ref = PointRef.parse
EXACT = pf.IntegrationOptions(tolerance=1e-9, step=2e-3)

# Carriage and gantry of a plotter, whose belts run over two motors: r A = X + Y, r B = X - Y.
COREXY = """
name = "corexy"

[ground]
O = [0, 0]
A = [-0.3, -0.2]
B = [0.3, -0.2]

[body.gantry]
type = "rigid"
mass = 0.9
inertia = 0.01
points = {C = [0, 0]}

[body.carriage]
type = "rigid"
mass = 0.4
inertia = 0.001
points = {T = [0, 0]}

[body.left]
type = "rigid"
mass = 0.1
inertia = 2e-5
points = {O = [0, 0]}

[body.right]
type = "rigid"
mass = 0.1
inertia = 2e-5
points = {O = [0, 0]}

[joint]
Y = {type = "prismatic", points = ["ground.O", "gantry.C"], direction = "pi / 2"}
X = {type = "prismatic", points = ["gantry.C", "carriage.T"]}
A = ["ground.A", "left.O"]
B = ["ground.B", "right.O"]

[relation.one]
weights = {A = 0.012, X = -1.0, Y = -1.0}

[relation.two]
weights = {B = 0.012, X = -1.0, Y = 1.0}

[motor]
left = "A"
right = "B"

[end_effector]
point = "carriage.T"
coordinates = ["x", "y"]

[mode]
"++" = ["left", "right"]

[path.line]
type = "line"
start = [0.0, 0.0]
end = [0.1, 0.04]
max_acceleration = 5.0

[assembly.start]
gantry = 0
carriage = 0
left = 0
right = 0
points = {"gantry.C" = [0, 0], "carriage.T" = [0, 0]}
"""
RADIUS, J, CARRIAGE, GANTRY = 0.012, 2e-5, 0.4, 0.9


@pytest.fixture
def corexy(tmp_path):
    (tmp_path / "corexy.toml").write_text(COREXY)
    return pf.load(tmp_path / "corexy.toml")


WEIGHTS, INERTIAS = np.array([20.0, 60.0, -80.0]), np.array([1e-3, 4e-3, 2e-3])


def planetary(scale=1.0, **more):
    """Sun, ring and arm about one centre: Willis, 20 sun + 60 ring = 80 arm."""
    names = ("sun", "ring", "arm")
    wheels = tuple(RigidBody(n, 0.5, J, (0.0, 0.0), {"O": (0.0, 0.0)}) for n, J in zip(names, INERTIAS, strict=True))
    return Mechanism(
        name="planetary",
        ground={"O": (0.0, 0.0)},
        bodies=wheels,
        joints=tuple(RevoluteJoint(name, ref("ground.O"), ref(f"{name}.O")) for name in names),
        motors=tuple(Motor(f"drive {name}", name) for name in names),
        sums=(SumRelation("mesh", dict(zip(names, scale * WEIGHTS, strict=True))),),
        assemblies=(Assembly("start", {"sun": 0.4, "ring": -0.1, "arm": 0.2}),),
        **more,
    )


def test_two_motors_move_a_carriage_by_belts(corexy):
    torques = {"left": 0.05, "right": -0.02}
    run = simulate_motion(corexy, 0.5, samples=11, torques=torques, options=EXACT)
    rotor = 2.0 * J / RADIUS**2
    x = 0.5 * (0.03 / RADIUS) / (CARRIAGE + rotor) * run.times**2
    y = 0.5 * (0.07 / RADIUS) / (CARRIAGE + GANTRY + rotor) * run.times**2
    data = motion_dataset(run)
    found = data["point_position"].sel(point="carriage.T").values
    np.testing.assert_allclose(found, np.column_stack([x, y]), rtol=0, atol=1e-7)
    for joint, travel in (("A", x + y), ("B", x - y)):
        angle = joint_coordinate(run.system, joint, run.solution.q).value
        np.testing.assert_allclose(angle, travel / RADIUS, rtol=0, atol=1e-5)
    # Belts pull the carriage along X and turn the rotors back: rows have the unit of the largest weight, a travel.
    acceleration = np.array([0.03, 0.07]) / RADIUS / (np.array([CARRIAGE, CARRIAGE + GANTRY]) + rotor)
    belts = np.column_stack([data["multiplier"].sel(row=f"{name} travel").values for name in ("one", "two")])
    pulls = [CARRIAGE * acceleration[0], (CARRIAGE + GANTRY) * acceleration[1]]
    expected = [-0.5 * (pulls[0] + pulls[1]), -0.5 * (pulls[0] - pulls[1])]
    np.testing.assert_allclose(belts, np.tile(expected, (11, 1)), rtol=1e-6)
    np.testing.assert_allclose(data["joint_force"].sel(joint="X").values[:, 0], pulls[0], rtol=1e-6)
    turning = data["joint_moment"].sel(joint="A").values
    np.testing.assert_allclose(turning, J * acceleration.sum() / RADIUS, rtol=1e-6)
    assert run.solution.energy_balance_max < 1e-9
    assert run.findings == ()


def test_a_plan_shares_torques_between_the_belts(corexy):
    task = corexy.plan("line", duration=0.5, samples=51)
    motion = task.motion
    a = motion.a
    ax, ay = a[:, task.motion.system.body("carriage").position].T
    wheels = np.column_stack([ax + ay, ax - ay]) / RADIUS
    force = np.column_stack([CARRIAGE * ax, (CARRIAGE + GANTRY) * ay])
    expected = J * wheels + 0.5 * RADIUS * np.column_stack([force[:, 0] + force[:, 1], force[:, 0] - force[:, 1]])
    run = task.simulate("++", options=EXACT)
    np.testing.assert_allclose(run.applied, expected, rtol=0, atol=1e-9 * np.max(np.abs(expected)))
    assert pf.tracking_dataset([run])["tracking_rms"].item() < 1e-6


@pytest.mark.parametrize("scale", [1.0, -1.0, 1e-9, 1e9])
def test_a_planetary_gear_shares_torques_as_willis_has_it(scale):
    torques = np.array([0.02, -0.01, 0.03])
    mechanism = planetary(scale)
    assert mechanism.sums[0].phase == pytest.approx(scale * (20 * 0.4 - 60 * 0.1 - 80 * 0.2), rel=1e-12)
    given = {f"drive {name}": torque for name, torque in zip(("sun", "ring", "arm"), torques, strict=True)}
    run = simulate_motion(mechanism, 0.5, samples=6, torques=given, options=EXACT)
    inverse = 1.0 / INERTIAS
    force = (WEIGHTS @ (inverse * torques)) / (WEIGHTS @ (inverse * WEIGHTS))
    acceleration = inverse * (torques - force * WEIGHTS)
    found = run.solution.q[:, 2::3] - [0.4, -0.1, 0.2]
    np.testing.assert_allclose(found, 0.5 * acceleration * run.times[:, None] ** 2, rtol=0, atol=1e-7)
    # The multiplier is the torque on the arm, whose weight is the largest, less, however weights are scaled.
    multiplier = motion_dataset(run)["multiplier"].sel(row="mesh angle").values
    np.testing.assert_allclose(multiplier, -80.0 * force, rtol=1e-7)


def test_a_sum_of_two_joints_is_a_gear():
    wheels = replace(planetary(), sums=())
    runs = [
        simulate_motion(replace(wheels, **one), 0.3, samples=4, torques={"drive sun": 0.02}, options=EXACT)
        for one in ({"gears": (Gear("mesh", "sun", "ring", -0.5),)},
                    {"sums": (SumRelation("mesh", {"sun": 0.5, "ring": 1.0}),)})
    ]  # fmt: skip
    np.testing.assert_array_equal(runs[0].solution.q, runs[1].solution.q)


def test_a_differential_in_equilibrium_and_its_frequencies():
    springs = tuple(TorsionalSpring(f"coil {n}", n, k, rest)
                    for n, k, rest in (("sun", 2.0, 0.4), ("ring", 5.0, -0.1)))  # fmt: skip
    mechanism = planetary(springs=springs, loads=(AppliedTorque("load", ref("arm.O"), 0.3),))
    mechanism = replace(mechanism, motors=())
    found = pf.statics_dataset(pf.statics(mechanism))
    # Sun and ring turn so that k turn = 20/80 and 60/80 of the torque.
    turned = found["joint_coordinate"].isel(step=-1).values - [0.4, -0.1, 0.2]
    expected = np.array([0.25 * 0.3 / 2.0, 0.75 * 0.3 / 5.0, 0.0])
    expected[2] = 0.25 * expected[0] + 0.75 * expected[1]
    np.testing.assert_allclose(turned, expected, rtol=0, atol=1e-10)
    system = build_system(mechanism)
    state = consistent_state(system, mechanism.assembly())
    assert mobility(build_system(mechanism.rigid()), state).freedoms == 2
    share = np.array([0.25, 0.75])
    mass = np.diag(INERTIAS[:2]) + INERTIAS[2] * np.outer(share, share)
    omega = np.sqrt(np.linalg.eigvals(np.linalg.solve(mass, np.diag([2.0, 5.0]))))
    np.testing.assert_allclose(natural_frequencies(system, state).frequencies, np.sort(omega), rtol=1e-9)


def test_a_phase_given_moves_the_assembly():
    mechanism = planetary()
    moved = replace(mechanism, sums=(replace(mechanism.sums[0], phase=0.0),))
    system = build_system(moved)
    q = consistent_state(system, moved.assembly()).q
    assert WEIGHTS @ q[2::3] == pytest.approx(0.0, abs=1e-10)
    assert abs(WEIGHTS @ [0.4, -0.1, 0.2]) > 1.0


def test_energy_is_kept_where_a_sum_turns_bending_beams():
    """Three beams on one axis, in segments too: each feels the others by its weight."""
    section, nylon = Section.rectangle(width=0.02, thickness=0.004), Material(2e9, 1100.0)
    beams = tuple(
        FlexibleBeam(name, 0.3, section, nylon, points={"O": 0.0, "P": 0.3}, elements=2) for name in ("a", "b", "c")
    )
    mechanism = Mechanism(
        name="fan",
        ground={"O": (0.0, 0.0)},
        bodies=beams,
        joints=tuple(RevoluteJoint(one.name, ref("ground.O"), ref(f"{one.name}.O")) for one in beams),
        sums=(SumRelation("mesh", {"a": 1.0, "b": 2.0, "c": -1.5}),),
        assemblies=(Assembly("start", {"a": 0.1, "b": 1.0, "c": 2.0}),),
        gravity=(0.0, -9.81),
    )
    run = simulate_motion(mechanism, 0.4, samples=9, options=pf.IntegrationOptions(tolerance=1e-7))
    solution = run.solution
    assert solution.energy_balance_max < 1e-4 * np.max(solution.kinetic_energy)
    angles = [joint_coordinate(run.system, name, solution.q).value for name in "abc"]
    np.testing.assert_allclose(np.array([1.0, 2.0, -1.5]) @ angles, 0.1 + 2.0 - 3.0, rtol=0, atol=1e-6)
    tip = motion_dataset(run)["point_position"].sel(point="b.P").values
    away = []
    for number in (10, 20):
        other = simulate_motion(finite_segments(mechanism, number).mechanism, 0.4, samples=9)
        away.append(np.max(np.abs(motion_dataset(other)["point_position"].sel(point="b.P").values - tip)))
    # 2.5 mm and 0.7 mm of a tip that moves by some 0.3 m.
    assert away[1] < 0.5 * away[0] < 4e-3


# --- Files, studies, drawings, engines ------------------------------------------------------------------------------


def test_info_files_and_drawings_have_the_sums(corexy, tmp_path):
    facts = describe(corexy)
    assert facts["relations"] == ["one: +0.012 A -1 X -1 Y = 0", "two: +0.012 B -1 X +1 Y = 0"]
    assert facts["degrees_of_freedom"] == 2
    corexy.save(tmp_path / "saved.toml")
    assert pf.load(tmp_path / "saved.toml").mechanism == corexy.mechanism
    data = motion_dataset(simulate_motion(corexy, 0.1, samples=3, torques={"left": 0.01}))
    shown = scene(data, data["time"].values)
    names = [mark.name for mark in moving_marks(shown, shown.limits) if mark.look == "gear"]
    assert names == ["one A-Y", "one Y-X", "two B-Y", "two Y-X"]


def test_derivatives_by_weights_and_phase(corexy, tmp_path):
    text = """
mechanism = "corexy.toml"
paths = ["line"]
modes = ["++"]
duration = 0.4
samples = 41
metrics = ["peak_torque_max"]

[integration]
tolerance = 1e-8

[vary.one]
fields = ["relation.one.weights.A"]
low = 0.01199
high = 0.01201
"""
    (tmp_path / "study.toml").write_text(text)
    found = pf.sensitivities(tmp_path / "study.toml").derivatives.item()
    (tmp_path / "sweep.toml").write_text(text + "number = 2\n")
    low, high = load_sweep(tmp_path / "sweep.toml").run(tmp_path / "runs").data["peak_torque_max"].values
    assert abs(found) > 1e-2
    assert found == pytest.approx((high - low) / 2e-5, rel=1e-4)


@pytest.mark.parametrize("name", ["exudyn", "mujoco"])
def test_engines_refuse_sums_by_name(name):
    with pytest.raises(InputError, match="cannot express a relation") as caught:
        check_engine(name, planetary())
    assert caught.value.field == "relation.mesh"


@pytest.mark.parametrize(
    ("weights", "says"),
    [
        ("{A = 0.012}", r"relation\.one\.joints: a relation needs two different joints \(got 'A'\)"),
        ("{}", r"relation\.one\.joints: a relation needs two different joints"),
        ("{A = 0.012, X = 0.0}", r"relation\.one\.weights\.X: must be a finite number other than zero"),
        ("{A = 0.012, X = nan}", r"relation\.one\.weights\.X: "),
        ("{A = 0.012, X = 1e30}", r"relation\.one\.weights\.X: "),
        ("{A = 0.012, Z = 1.0}", r"relation\.one\.weights: unknown joint \(got 'Z'\)"),
        ('{A = 0.012, X = "fast"}', r"relation\.one\.weights\.X: "),
        ('["A", "X"]', r"relation\.one\.weights: "),
        ("{A = 0.012, X = 1.0}\nphase = nan", r"relation\.one\.phase: "),
        ("{A = 0.012, X = 1.0}\nratio = 1.0", r"relation\.one\.ratio: "),
    ],
)
def test_bad_sums_are_refused(tmp_path, weights, says):
    (tmp_path / "bad.toml").write_text(COREXY.replace("{A = 0.012, X = -1.0, Y = -1.0}", weights))
    with pytest.raises(InputError, match=says):
        pf.load(tmp_path / "bad.toml")


def test_a_sum_needs_joints_that_move_and_a_phase_or_an_assembly():
    with pytest.raises(InputError, match="there is no assembly to take it from") as caught:
        replace(planetary(), assemblies=(), sums=(SumRelation("mesh", {"sun": 1.0, "arm": 2.0}),))
    assert caught.value.field == "relation.mesh.phase"
    for weight in (np.nan, np.inf, 0.0):
        with pytest.raises(InputError, match="finite number other than zero") as caught:
            replace(planetary(), sums=(SumRelation("mesh", {"sun": 1.0, "arm": weight}),))
        assert caught.value.field == "relation.mesh.weights.arm"
    fixed = planetary()
    welds = (*fixed.joints[:2], WeldJoint("arm", ref("ground.O"), ref("arm.O")))
    with pytest.raises(InputError, match="a weld does not move") as caught:
        replace(fixed, joints=welds, motors=())
    assert caught.value.field == "relation.mesh.weights"
