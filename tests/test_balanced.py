"""A balanced start with drives in motion: closed form, consistency, and how little vibrates from there."""

import dataclasses
import json

import numpy as np
import pytest

import paraflex as pf
import paraflex.dynamics.quasi_static as equilibria
from paraflex.cli.commands.models import InfoRequest
from paraflex.cli.inspect import describe
from paraflex.dynamics import (
    balanced_state,
    build_system,
    consistent_state,
    joint_coordinate,
    moment_signals,
    projection,
    static_equilibrium,
)
from paraflex.errors import AssemblyError, ModelWarning
from paraflex.fem import ReferenceCondition
from paraflex.fem.element import AXIAL
from paraflex.files import library_file, library_names, load
from paraflex.integrators import IntegrationOptions
from paraflex.kernel.packed import CONSTRAINT, INDEX_1
from paraflex.kernel.stage import equations
from paraflex.mechanism import (
    Assembly,
    ConstantSpeed,
    FlexibleBeam,
    Geometry,
    JointFriction,
    LumpedMass,
    Material,
    Mechanism,
    PointForce,
    PointRef,
    PrescribedAngle,
    RevoluteJoint,
    SampledAngle,
    Section,
    TabulatedProfile,
    TorsionalDamper,
    finite_segments,
    raparm_i,
)
from paraflex.motion import simulate_motion
from paraflex.paths.paths import PathMotion
from paraflex.tracking import plan_tracking
from shell import paraflex

SPEED, LENGTH, MODULUS, DENSITY, TIP = 60.0, 0.5, 70e9, 2700.0, 0.2
SECTION = Section.rectangle(0.02, 0.002)


def turning_crank(speed=SPEED, gravity=(0.0, 0.0), geometry=Geometry.SECOND_ORDER):
    beam = FlexibleBeam(
        "crank", LENGTH, SECTION, Material(MODULUS, DENSITY), {"O": 0.0, "P": LENGTH}, 3,
        lumps=(LumpedMass("P", TIP),), reference=ReferenceCondition.CANTILEVER,
    )  # fmt: skip
    return Mechanism(
        "turning crank",
        {"O": (0.0, 0.0)},
        (beam,),
        (RevoluteJoint("O", PointRef("ground", "O"), PointRef("crank", "O")),),
        prescribed=(PrescribedAngle("drive", "O", ConstantSpeed(0.3, speed)),),
        assemblies=(Assembly("start", {"crank": 0.3}),),
        gravity=gravity,
        geometry=geometry,
    )


def start_of(mechanism, driven=None):
    system = build_system(mechanism)
    undeformed = consistent_state(system, mechanism.assembly())
    return system, undeformed, balanced_state(system, undeformed, driven or {})


def violations(system, state):
    """Largest |Phi|, |Phi'| at a state, and |Phi''| with the accelerations a run starts with, beside their size."""
    signals = moment_signals(system.mechanism, state.time)
    phi, rate = system.constraints(signals, state.time, state.q, state.v)
    run = simulate_motion(system.mechanism, 1e-3, samples=2, start=state)
    a, ws = run.solution.a[0], system.workspace()
    torques = np.zeros(len(system.mechanism.motors))
    equations(system.packed, signals, state.time, INDEX_1, state.q, state.v, a, np.zeros(system.m), torques, ws)
    fixed = system.packed.rows["kind"] == CONSTRAINT
    return [float(np.max(np.abs(x[fixed]))) for x in (phi, rate, ws.rows)], float(np.max(np.abs(a)))


@pytest.mark.parametrize("geometry", list(Geometry))
def test_a_turning_crank_starts_as_long_as_its_speed_makes_it(geometry):
    """E A u' = int_x^L rho A Omega^2 s ds + m Omega^2 L, so u(L) = rho Omega^2 L^3 / 3 E + m Omega^2 L^2 / E A."""
    system, _, state = start_of(turning_crank(geometry=geometry))
    body = system.bodies[0]
    tip = body.integrals.D[body.mesh.column(-1, AXIAL)] @ state.q[body.flexible]
    bar = DENSITY * SPEED**2 * LENGTH**3 / (3.0 * MODULUS)
    bob = TIP * SPEED**2 * LENGTH**2 / (MODULUS * SECTION.area)
    # The stretched bar is longer by the strain, 3e-4, and a linear element shares its mass out to second order.
    assert tip == pytest.approx(bar + bob, rel=1e-3)
    assert joint_coordinate(system, "O", state.q[None], state.v[None]).rate[0] == pytest.approx(SPEED, rel=1e-14)


def test_a_turning_crank_does_not_ring_from_there():
    mechanism = turning_crank()
    _, undeformed, balanced = start_of(mechanism)
    ringing = [
        np.ptp(simulate_motion(mechanism, 0.02, start=state, samples=201).solution.strain_energy)
        for state in (undeformed, balanced)
    ]
    # What is left is the finite weight that keeps the shape of links, 1e-6 of the speed: its Coriolis forces.
    assert ringing[1] < 1e-4 * ringing[0]


def test_a_four_bar_starts_in_motion_and_hardly_vibrates():
    """The pose of balance at 20 rad/s: rows to rounding, the profile's rate, and strain energy near that of balance."""
    mechanism = load("four_bar").mechanism
    system, undeformed, state = start_of(mechanism)
    (position, velocity, acceleration), size = violations(system, state)
    assert position < 1e-14
    assert velocity < 1e-12
    assert acceleration < 1e-11 * size
    assert joint_coordinate(system, "O", state.q[None], state.v[None]).rate[0] == pytest.approx(20.0, rel=1e-13)
    at_rest = static_equilibrium(system, undeformed)
    assert not at_rest.v.any()
    steps = [simulate_motion(mechanism, 0.05, start=s, samples=11).solution.steps for s in (undeformed, state)]
    assert steps[1] < 0.5 * steps[0]


def test_the_motion_from_there_is_that_of_balance():
    """A little later the four-bar is where the balanced pose of that time is; undeformed it is 20 times as far off."""
    mechanism = load("four_bar").mechanism
    system, undeformed, state = start_of(mechanism)
    exact = IntegrationOptions(tolerance=1e-8)
    ends = [simulate_motion(mechanism, 0.01, start=s, samples=2, options=exact) for s in (undeformed, state)]
    later = dataclasses.replace(state, time=0.01, q=ends[1].solution.q[-1])
    expected = balanced_state(system, later, {}).q
    off = [np.linalg.norm((run.solution.q[-1] - expected)[system.body("coupler").all]) for run in ends]
    assert off[1] < 0.05 * off[0]


def test_segments_of_a_moving_link_start_in_line():
    """Springs of finite segments do not begin to wind: no link starts as if struck, balanced or undeformed."""
    mechanism = finite_segments(load("four_bar").mechanism, 4).mechanism
    whole = load("four_bar").mechanism
    system, undeformed, balanced = start_of(mechanism)
    of_beams = consistent_state(build_system(whole), whole.assembly())
    for name in ("coupler", "rocker"):
        rate = of_beams.v[build_system(whole).body(name).angle]
        rates = [undeformed.v[system.body(f"{name}_{i}").angle] for i in (1, 2, 3, 4)]
        np.testing.assert_allclose(rates, rate, rtol=1e-6)
    assert violations(system, balanced)[0][1] < 1e-12
    strain = [
        simulate_motion(mechanism, 0.03, start=s, samples=61).solution.strain_energy for s in (undeformed, balanced)
    ]
    assert np.max(strain[1]) < 0.8 * np.max(strain[0])


def test_segments_start_in_line_with_sparse_matrices_too(monkeypatch):
    mechanism = finite_segments(load("four_bar").mechanism, 4).mechanism
    system = build_system(mechanism)
    dense = consistent_state(system, mechanism.assembly())
    monkeypatch.setattr(projection, "DENSE_ROWS", 0)
    sparse = consistent_state(system, mechanism.assembly())
    np.testing.assert_allclose(sparse.q, dense.q, rtol=0, atol=1e-9)
    np.testing.assert_allclose(sparse.v, dense.v, rtol=0, atol=1e-6)


def test_large_systems_find_the_same_balance(monkeypatch):
    """Sparse and dense matrices, with a damper and friction at joints that the motion loads."""
    mechanism = dataclasses.replace(
        load("four_bar").mechanism,
        dampers=(TorsionalDamper("oil", "Q", 0.2),),
        frictions=(JointFriction("dry", "B", 0.3, 1e-2),),
    )
    _, _, dense = start_of(mechanism)
    monkeypatch.setattr(equilibria, "_MOST_DENSE", 0)
    monkeypatch.setattr(projection, "DENSE_ROWS", 0)
    _, _, sparse = start_of(mechanism)
    np.testing.assert_allclose(sparse.q, dense.q, rtol=0, atol=1e-11)
    np.testing.assert_allclose(sparse.v, dense.v, rtol=0, atol=1e-6)
    _, _, free = start_of(load("four_bar").mechanism)
    assert np.max(np.abs(free.q - dense.q)) > 1e-6


def test_what_drives_leave_free_starts_at_rest_below_them():
    """A rod hung on a turning crank: its motion is not given, so the pose is that of weight alone."""
    from test_loads import pendulum

    base = pendulum(gravity=(0.0, -9.81))
    crank = turning_crank(4.0).bodies[0]
    mechanism = Mechanism(
        "hung",
        {"O": (0.0, 0.0)},
        (crank, base.bodies[0]),
        (
            RevoluteJoint("O", PointRef("ground", "O"), PointRef("crank", "O")),
            RevoluteJoint("hook", PointRef("crank", "P"), PointRef("arm", "A")),
        ),
        prescribed=(PrescribedAngle("drive", "O", ConstantSpeed(0.3, 4.0)),),
        assemblies=(Assembly("start", {"crank": 0.3, "arm": -1.2}),),
        gravity=(0.0, -9.81),
    )
    system, _, state = start_of(mechanism)
    assert state.q[system.body("arm").angle] == pytest.approx(-np.pi / 2, abs=1e-9)
    assert joint_coordinate(system, "O", state.q[None], state.v[None]).rate[0] == pytest.approx(4.0, rel=1e-12)


def test_drives_too_fast_for_soft_links_are_refused(tmp_path):
    source = library_file("four_bar").read_text(encoding="utf-8").replace("speed = 20.0", "speed = 3000.0")
    file = tmp_path / "fast.toml"
    file.write_text(source)
    with pytest.warns(ModelWarning, match=r"prescribed\.drive: it turns at 3000 rad/s"):
        model = load(file)
    with pytest.raises(AssemblyError, match="the drives are too fast for links this soft"):
        start_of(model.mechanism)
    done = paraflex("run", "-m", str(file), "--balanced", "--out", str(tmp_path / "out"))
    assert done.returncode == 2
    assert "--balanced: no equilibrium of links" in done.stderr
    assert "Traceback" not in done.stderr


@dataclasses.dataclass(frozen=True)
class Turning:
    """A point on a circle at constant speed, in motion from the start."""

    duration: float = 0.1
    knots: tuple[float, ...] = ()
    radius: float = 0.02
    speed: float = 10.0

    def evaluate(self, t):
        angle = self.speed * t
        e = np.column_stack([np.cos(angle), np.sin(angle)])
        n = np.column_stack([-e[:, 1], e[:, 0]])
        r, w = self.radius, self.speed
        return PathMotion((0.0, 0.264) + r * e, r * w * n, -r * w**2 * e)


def test_a_path_that_starts_in_motion_starts_balanced():
    mechanism = dataclasses.replace(raparm_i(), gravity=(0.0, -9.81))
    task = plan_tracking(mechanism, Turning(), samples=51)
    balanced = task.balanced("++++")
    steps = [one.simulate("++++").solution.steps for one in (task, balanced)]
    assert steps[1] < 0.7 * steps[0]
    for motor in mechanism.motors:
        planned = joint_coordinate(task.system, motor.joint, task.start.q[None], task.start.v[None])
        found = joint_coordinate(task.system, motor.joint, balanced.start.q[None], balanced.start.v[None])
        assert found.value[0] == pytest.approx(planned.value[0], abs=1e-10)
        assert found.rate[0] == pytest.approx(planned.rate[0], abs=1e-9)
    signals = moment_signals(mechanism, 0.0)
    rates = task.system.constraints(signals, 0.0, balanced.start.q, balanced.start.v)
    assert np.max(np.abs(rates)) < 1e-12


@pytest.mark.parametrize("name", library_names())
def test_where_info_recommends_a_balanced_start_there_is_one(name, tmp_path):
    model = load(name)
    found = describe(model)["frequencies"]
    assert found["equilibrium_nearby"]
    assert describe(model, InfoRequest(balanced=True))["frequencies"]["is_equilibrium"]
    if model.start is not None and model.start.places:
        return
    done = paraflex(
        "run", "-m", name, "--balanced", "--duration", "0.01", "--samples", "3", "--no-report", "--json",
        "--no-figures", "--tol", "1e-4", "--out", str(tmp_path / "out"),
    )  # fmt: skip
    assert done.returncode == 0, done.stderr
    json.loads(done.stdout)


def test_info_recommends_no_balanced_start_where_there_is_none(tmp_path):
    """A bar hung on a slider that falls along a rail: its weight has nothing to balance it."""
    file = tmp_path / "fall.toml"
    file.write_text(
        """
name = "fall"
gravity = [0.0, -9.81]
[ground]
O = [0.0, 0.0]
[body.slider]
type = "rigid"
mass = 1.0
inertia = 0.1
points = { S = [0.0, 0.0] }
[joint.rail]
type = "prismatic"
points = ["ground.O", "slider.S"]
direction = 1.5707963267948966
angle = 0.0
[assembly.start]
slider = 0.0
[study]
duration = 0.1
"""
    )
    out = paraflex("info", str(file)).stdout.replace("\n", " ")
    assert "9.81 m/s^2" in out
    assert "--balanced takes" not in out
    assert "there is none nearby" in out
    done = paraflex("run", "-m", str(file), "--balanced", "--out", str(tmp_path / "out"))
    assert done.returncode == 2
    assert "--balanced: no static equilibrium is found near the start" in done.stderr


def test_a_four_bar_runs_balanced_to_its_end(tmp_path):
    done = paraflex("run", "-m", "four_bar", "--balanced", "--no-report", "--json", "--out", str(tmp_path / "out"))
    assert done.returncode == 0, done.stderr
    summary = json.loads(done.stdout)
    assert summary["status"] == "complete"
    assert summary["constraint_position_max"] < 1e-5


@pytest.mark.parametrize("interpolation", ["linear", "spline"])
def test_a_moving_balanced_start_takes_a_load_table_that_begins_with_the_run(interpolation):
    """A force that grows linearly, as a table from t = 0 on and as functions of any time."""
    table = TabulatedProfile((0.0, 1.0), (2.0, 12.0), interpolation)
    anytime = SampledAngle(lambda t: 2.0 + 10.0 * t, lambda t: 10.0 + 0.0 * t, lambda t: 0.0 * t)
    tip = PointRef("crank", "P")
    found, same = (
        start_of(dataclasses.replace(turning_crank(4.0), loads=(PointForce("push", tip, (0.0, profile)),)))[2]
        for profile in (table, anytime)
    )
    assert found.q == pytest.approx(same.q, rel=1e-9, abs=1e-12)
    assert found.v == pytest.approx(same.v, rel=1e-6, abs=1e-9)
    unloaded = start_of(turning_crank(4.0))[2]
    assert np.max(np.abs(found.q - unloaded.q)) > 1e-4


def test_a_reduced_run_from_equilibrium_begins_from_its_own(tmp_path):
    """A level arm under its weight, held by a drive that stands still: nothing moves."""
    material, section = pf.Material(70e9, 2700.0), pf.Section.rectangle(0.02, 0.004)
    arm = pf.FlexibleBeam("arm", 0.5, section, material, {"A": 0.0, "B": 0.5}, elements=3)
    held = pf.Mechanism(
        name="held", ground={"O": (0.0, 0.0)}, bodies=(arm,), gravity=(0.0, -9.81),
        joints=(pf.RevoluteJoint("hub", PointRef("ground", "O"), PointRef("arm", "A")),),
        prescribed=(pf.PrescribedAngle("drive", "hub", pf.ConstantSpeed(0.0, 0.0)),),
        assemblies=(pf.Assembly("level", {"arm": 0.0}),),
    )  # fmt: skip
    held.save(tmp_path / "held.toml")
    more = ("--duration", "0.05", "--samples", "26", "--no-report", "--out", str(tmp_path / "out"))
    done = paraflex("run", str(tmp_path / "held.toml"), "--balanced", "--reduced", "1", *more)
    assert done.returncode == 0, done.stderr
    with pf.open_results(tmp_path / "out") as data:
        torque = data["drive_torque"].values.ravel()
    assert torque == pytest.approx(np.full(26, 2700.0 * 0.02 * 0.004 * 0.5 * 9.81 * 0.25), rel=1e-4)
