"""Gravity, constant forces and torques, dampers: closed forms, work and energy, inverse dynamics, model files."""

import dataclasses

import numpy as np
import pytest
import scipy.special

from conftest import make_five_bar
from paraflex.dynamics import State, build_system, consistent_state, pack_signals
from paraflex.dynamics.state import point_position
from paraflex.errors import InputError
from paraflex.fem import ReferenceCondition
from paraflex.fem.element import TRANSVERSE
from paraflex.files import library_file, load
from paraflex.integrators import IntegrationOptions, integrate
from paraflex.kernel.bodies import body_terms, motion_forces, weight_work
from paraflex.kernel.packed import make_scratch
from paraflex.mechanism import (
    AppliedTorque,
    Assembly,
    Curvature,
    FlexibleBeam,
    Geometry,
    LinearSpring,
    LumpedMass,
    Material,
    Mechanism,
    PointForce,
    PointRef,
    RevoluteJoint,
    RigidBody,
    Section,
    TorsionalDamper,
    TorsionalSpring,
    raparm_i,
)
from paraflex.paths import Line
from paraflex.results import tracking_dataset
from paraflex.tracking import plan_tracking
from test_second_order import chain, random_state

MASS, INERTIA, REACH, G = 1.3, 0.02, 0.4, 9.81
# Of loads in time, at one instant.
NO_LOADS = np.zeros((1, 0))


def pendulum(**changes):
    body = RigidBody("arm", MASS, INERTIA, (REACH, 0.0), {"A": (0.0, 0.0), "B": (2 * REACH, 0.1)})
    values = {
        "name": "pendulum",
        "ground": {"O": (0.2, 0.1)},
        "bodies": (body,),
        "joints": (RevoluteJoint("pin", PointRef("ground", "O"), PointRef("arm", "A")),),
        "assemblies": (Assembly("start", {"arm": 0.5}),),
    }
    return Mechanism(**(values | changes))


def run(mechanism, end, *, tolerance=1e-6, state=None, samples=201):
    system = build_system(mechanism)
    state = consistent_state(system, mechanism.assembly()) if state is None else state
    signals, _ = pack_signals(mechanism, [], end)
    times = np.linspace(0.0, end, samples)
    return system, integrate(system, signals, state, times, options=IntegrationOptions(tolerance=tolerance))


def test_a_pendulum_swings_with_the_period_of_the_elliptic_integral():
    mechanism = pendulum(gravity=(0.0, -G), assemblies=(Assembly("start", {"arm": -np.pi / 2 + 2.0}),))
    pace = np.sqrt(MASS * G * REACH / (INERTIA + MASS * REACH**2))
    # From rest at two radians off: a quarter of the period is K(sin^2(1)) / pace.
    quarter = scipy.special.ellipk(np.sin(1.0) ** 2) / pace
    _, solution = run(mechanism, 4 * quarter, samples=5)
    angles = solution.q[:, 2] + np.pi / 2
    np.testing.assert_allclose(angles, [2.0, 0.0, -2.0, 0.0, 2.0], rtol=0, atol=3e-5)
    # From the start to the lowest place, all work is gravity's.
    assert solution.work[1] == pytest.approx(MASS * G * REACH * (1 - np.cos(2.0)), rel=1e-5)
    assert solution.kinetic_energy[1] == pytest.approx(solution.work[1], rel=1e-5)
    assert solution.energy_balance_max < 1e-4 * solution.kinetic_energy[1]


@pytest.mark.parametrize("geometry", list(Geometry))
def test_a_free_beam_falls_without_bending(geometry):
    beam = FlexibleBeam("beam", 0.5, Section.rectangle(0.03, 0.002), Material(5e6, 1100.0), {"A": 0.0}, 2)
    mechanism = Mechanism("falling", {}, (beam,), (), geometry=geometry, gravity=(1.0, -2.0))
    system = build_system(mechanism)
    _, solution = run(mechanism, 1.0, state=State(0.0, np.zeros(system.n), np.zeros(system.n)), samples=3)
    np.testing.assert_allclose(solution.q[:, :2], 0.5 * solution.t[:, None] ** 2 * [1.0, -2.0], rtol=0, atol=1e-12)
    np.testing.assert_allclose(solution.q[:, 2:], 0.0, atol=1e-12)
    np.testing.assert_allclose(solution.kinetic_energy, solution.work, rtol=0, atol=1e-12)


def test_a_clamped_beam_sags_as_the_textbook_says():
    EI, length, per_length, tip = 5.0, 0.5, 0.27, 3.0
    beam = FlexibleBeam(
        "beam", length, Section(1e-4, EI / 70e9), Material(70e9, per_length / 1e-4), {"A": 0.0, "B": length}, 2,
        reference=ReferenceCondition.CANTILEVER, curvature=Curvature.SHARED,
    )  # fmt: skip
    end = PointRef("beam", "B")
    for acting, deflection, within in (
        ({"gravity": (0.0, -G)}, -per_length * G * length**4 / (8 * EI), 2e-5),
        ({"loads": (PointForce("P", end, (0.0, -tip)),)}, -tip * length**3 / (3 * EI), 1e-9),
        # A torque bends the tip, where the paper's element has no curvature.
        ({"loads": (AppliedTorque("M", end, tip),)}, tip * length**2 / (2 * EI), 0.03),
    ):
        system = build_system(Mechanism("clamped", {}, (beam,), (), **acting))
        forces, still = np.zeros((1, system.n)), np.zeros((1, system.n))
        motion_forces(system.packed, still, still, still, NO_LOADS, forces, make_scratch(system.packed))
        body = system.bodies[0]
        u = -forces[0, body.flexible] / body.modes.omega**2
        found = body.integrals.D[body.mesh.column(-1, TRANSVERSE)] @ u
        assert found == pytest.approx(deflection, rel=within)


@pytest.mark.parametrize("geometry", list(Geometry))
def test_generalised_weights_and_loads_are_derivatives_of_their_work(geometry):
    force, torque = np.array([20.0, -35.0]), 4.0
    mechanism = dataclasses.replace(
        chain(geometry=geometry),
        gravity=(3.0, -G),
        loads=(
            PointForce("push", PointRef("two", "C"), tuple(force)),
            AppliedTorque("twist", PointRef("one", "B"), torque),
        ),
        linear_springs=(
            LinearSpring("rope", PointRef("one", "B"), PointRef("two", "C"), 130.0, 0.2),
            LinearSpring("stay", PointRef("block", "P"), PointRef("ground", "O"), 70.0, 0.1),
        ),
    )
    plain = build_system(dataclasses.replace(mechanism, gravity=(0.0, 0.0), loads=(), linear_springs=()))
    system = build_system(mechanism)
    q, _, _ = random_state(system, 5)
    scratch, still = make_scratch(system.packed), np.zeros((1, system.n))

    def forces(built):
        out = np.zeros((1, built.n))
        motion_forces(built.packed, q[None], still, still, NO_LOADS, out, scratch)
        return out[0]

    slope = system.marker(PointRef("one", "B")).slope

    def at(q, name, point):
        return point_position(system, q, PointRef(name, point))

    def work(q):
        one = system.body("one")
        turn = q[one.angle] + slope @ q[one.flexible]
        rope = np.linalg.norm(at(q, "two", "C") - at(q, "one", "B")) - 0.2
        stay = np.linalg.norm(at(q, "block", "P") - [0.1, -0.2]) - 0.1
        done = weight_work(system.packed, q, scratch) + force @ at(q, "two", "C") + torque * turn
        return done - 0.5 * 130.0 * rope**2 - 0.5 * 70.0 * stay**2

    h = 1e-6
    expected = [(work(q + h * unit) - work(q - h * unit)) / (2 * h) for unit in np.eye(system.n)]
    np.testing.assert_allclose(forces(plain) - forces(system), expected, rtol=0, atol=1e-7 * np.max(np.abs(expected)))
    # And the work of gravity is that of a sum of masses.
    total = 0.0
    for i, body in enumerate(system.bodies):
        base, lifted = np.zeros((2, system.n))
        unit = np.zeros(system.n)
        unit[body.position] = 1.0, 0.0
        body_terms(plain.packed, i, q, still[0], still[0], base, scratch)
        body_terms(plain.packed, i, q, still[0], unit, lifted, scratch)
        total += (lifted - base)[body.offset]
    assert total == pytest.approx(system.total_mass, rel=1e-12)


@pytest.mark.parametrize("geometry", list(Geometry))
def test_energy_is_work_under_all_loads(geometry):
    mechanism = dataclasses.replace(
        chain(geometry=geometry),
        gravity=(0.0, -G),
        loads=(
            PointForce("push", PointRef("block", "P"), (2.0, 1.0)),
            AppliedTorque("twist", PointRef("two", "B"), 0.3),
        ),
        springs=(TorsionalSpring("soft", "elbow", 2.0, 0.1),),
        dampers=(TorsionalDamper("oil", "elbow", 0.05), TorsionalDamper("grease", "tip", 0.01)),
        linear_springs=(
            LinearSpring("rope", PointRef("one", "B"), PointRef("block", "P"), 20.0, 0.3, 0.4),
            LinearSpring("stay", PointRef("ground", "O"), PointRef("two", "C"), 10.0, 0.5, 0.2),
        ),
    )
    worst = []
    for tolerance in (1e-3, 1e-5):
        _, solution = run(mechanism, 0.3, tolerance=tolerance)
        worst.append(solution.energy_balance_max / np.max(solution.kinetic_energy + solution.strain_energy))
    assert worst[1] < 1e-5
    assert worst[1] < 0.1 * worst[0]


def test_a_damped_oscillator_follows_the_closed_form():
    stiffness, coefficient = 30.0, 0.4
    mechanism = pendulum(
        springs=(TorsionalSpring("spring", "pin", stiffness, 0.2),),
        dampers=(TorsionalDamper("damper", "pin", coefficient),),
    )
    system, solution = run(mechanism, 1.0)
    J = INERTIA + MASS * REACH**2
    decay, pace = coefficient / (2 * J), np.sqrt(stiffness / J)
    damped = np.sqrt(pace**2 - decay**2)
    t = solution.t
    shape = np.cos(damped * t) + decay / damped * np.sin(damped * t)
    np.testing.assert_allclose(solution.q[:, 2], 0.2 + 0.3 * np.exp(-decay * t) * shape, rtol=0, atol=3e-5)
    torque = solution.multipliers[:, system.rows.index("damper angle")]
    np.testing.assert_allclose(torque, coefficient * solution.v[:, 2], rtol=0, atol=1e-3)
    # Negative work: what the damper has taken.
    assert solution.work[-1] < -0.5 * solution.strain_energy[0]
    assert solution.energy_balance_max < 1e-3 * solution.strain_energy[0]


def test_a_very_strong_damper_does_not_dictate_the_step():
    """From a push the arm creeps on by J w / c."""
    mechanism = pendulum(dampers=(TorsionalDamper("tar", "pin", 1e6),))
    system = build_system(mechanism)
    start = consistent_state(system, mechanism.assembly(), velocity=np.array([0.0, 0.0, 2.0]))
    w = start.v[2]
    _, solution = run(mechanism, 1.0, state=start, samples=3)
    assert solution.q[-1, 2] - 0.5 == pytest.approx((INERTIA + MASS * REACH**2) * w / 1e6, abs=1e-6)
    assert solution.steps < 1000


def test_a_force_off_the_centre_of_mass_turns_a_free_body():
    body = RigidBody("puck", MASS, INERTIA, (0.1, 0.0), {"P": (0.1, 0.2)})
    mechanism = Mechanism("puck", {}, (body,), (), loads=(PointForce("push", PointRef("puck", "P"), (0.5, 0.0)),))
    _, solution = run(mechanism, 0.01, state=State(0.0, np.zeros(3), np.zeros(3)), samples=2)
    assert solution.a[0, 2] == pytest.approx(-0.5 * 0.2 / INERTIA, rel=1e-12)


def five_bar(**changes):
    return dataclasses.replace(make_five_bar(), **changes)


@pytest.mark.parametrize("gravity", [(0.0, -G), (4.0, 0.0)])
def test_torques_of_the_rigid_mechanism_carry_weight_loads_springs_and_dampers(gravity):
    mechanism = five_bar(
        gravity=gravity,
        loads=(
            PointForce("tool", PointRef("distal2", "C"), (3.0, -5.0)),
            AppliedTorque("drag", PointRef("distal1", "C"), 0.4),
        ),
        springs=(TorsionalSpring("return", "B1", 2.0, -1.0), TorsionalSpring("base", "A2", 1.5)),
        dampers=(TorsionalDamper("oil", "C", 0.02), TorsionalDamper("base oil", "A1", 0.05)),
        linear_springs=(LinearSpring("stay", PointRef("ground", "A1"), PointRef("distal2", "C"), 40.0, 0.2, 3.0),),
    )
    task = plan_tracking(mechanism, Line((0.0, 0.30), (0.04, 0.27), 20.0), duration=0.2, samples=41)
    run = task.simulate("++", options=IntegrationOptions(tolerance=1e-7))
    data = tracking_dataset([run])
    assert float(data["tracking_rms"][0]) < 1e-7
    assert run.solution.energy_balance_max < 1e-5
    still = plan_tracking(five_bar(), Line((0.0, 0.30), (0.04, 0.27), 20.0), duration=0.2, samples=41)
    difference = np.abs(data["torque"][0] - still.torques("++").evaluate(still.motion.t)).max("time")
    assert np.all(difference > 0.1)


def test_flexible_raparm_under_gravity_sags_where_it_stands():
    task = plan_tracking(
        dataclasses.replace(raparm_i(), gravity=(0.0, -G)), Line((0.0, 0.264), (0.01, 0.264), 1.0), samples=51
    )
    data = tracking_dataset([task.simulate("++++")])
    assert 1e-5 < float(data["tracking_rms"][0]) < 5e-3


TOML = """
gravity = [0.0, -9.81]
[damper.oil]
joint = "B1"
coefficient = 0.1
[linear_spring.rope]
points = ["ground.A1", "link4.C"]
stiffness = 50.0
length = 0.3
damping = 0.5
[load.push]
type = "force"
point = "link4.C"
force = [1.0, 2.0]
[load.twist]
type = "torque"
point = "link1.B1"
torque = -0.5
"""


def in_file(tmp_path, text):
    head, rest = library_file("raparm_i").read_text(encoding="utf-8").split("\n[", 1)
    gravity, _, tables = text.strip().partition("\n")
    file = tmp_path / "loads.toml"
    file.write_text(f"{head}\n{gravity}\n[{rest}\n{tables}\n", encoding="utf-8")
    return file


def test_a_model_file_may_have_all_of_them(tmp_path):
    mechanism = load(in_file(tmp_path, TOML)).mechanism
    assert mechanism == dataclasses.replace(
        raparm_i(),
        gravity=(0.0, -9.81),
        dampers=(TorsionalDamper("oil", "B1", 0.1),),
        linear_springs=(LinearSpring("rope", PointRef("ground", "A1"), PointRef("link4", "C"), 50.0, 0.3, 0.5),),
        loads=(
            PointForce("push", PointRef("link4", "C"), (1.0, 2.0)),
            AppliedTorque("twist", PointRef("link1", "B1"), -0.5),
        ),
    )


@pytest.mark.parametrize(
    ("old", "new", "says"),
    [
        ('joint = "B1"', 'joint = "B9"', "damper.oil.joint: unknown joint (got 'B9')"),
        ("coefficient = 0.1", "coefficient = -0.1", "damper.oil.coefficient: must be positive"),
        ('point = "link4.C"', 'point = "link4.D"', "load.push.point: unknown point (got 'link4.D')"),
        ('point = "link4.C"', 'point = "ground.A1"', "load.push.point: the ground does not move"),
        ('"link4.C"]', '"link9.C"]', "linear_spring.rope.points: unknown body (got 'link9')"),
        ('"link4.C"]', '"ground.A2"]', "linear_spring.rope.points: a spring between points needs two different bodies"),
        ("stiffness = 50.0", "stiffness = -50.0", "linear_spring.rope.stiffness: must not be negative"),
        ("force = [1.0, 2.0]", "force = [1.0]", "load.push"),
        ('type = "torque"', 'type = "moment"', "load.twist"),
        ("torque = -0.5", "torque = nan", "load.twist"),
        ("[0.0, -9.81]", "[0.0, inf]", "gravity"),
        ("[0.0, -9.81]", "-9.81", "gravity"),
    ],
)
def test_loads_that_make_no_sense_are_named(tmp_path, old, new, says):
    assert old in TOML
    with pytest.raises(InputError) as caught:
        load(in_file(tmp_path, TOML.replace(old, new)))
    assert says in str(caught.value)
    assert "loads.toml" in str(caught.value)


def test_lumps_weigh_too():
    beam = FlexibleBeam(
        "beam", 0.5, Section(1e-4, 1e-9), Material(70e9, 1e-3), {"A": 0.0, "B": 0.25}, lumps=(LumpedMass("B", 2.0),)
    )
    system = build_system(Mechanism("lump", {}, (beam,), (), gravity=(0.0, -G)))
    forces = np.zeros((1, system.n))
    still = np.zeros_like(forces)
    motion_forces(system.packed, still, still, still, NO_LOADS, forces, make_scratch(system.packed))
    np.testing.assert_allclose(forces[0, :3], [0.0, 2.0 * G, 0.5 * G], rtol=1e-6, atol=1e-12)
