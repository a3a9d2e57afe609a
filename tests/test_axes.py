"""Prismatic joints, slots and welds, and what acts along them: kernels against the complex step, and closed forms."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
import scipy.integrate

import twins
from conftest import RUBBER
from paraflex.dynamics import (
    State,
    build_system,
    consistent_state,
    joint_coordinate,
    project_position,
    project_velocity,
    static_equilibrium,
)
from paraflex.errors import InputError
from paraflex.fem import ReferenceCondition
from paraflex.integrators import IntegrationOptions
from paraflex.kernel.constraints import note_friction
from paraflex.kernel.linear import factor_system, solve_system
from paraflex.kernel.packed import CONSTRAINT
from paraflex.kernel.stage import equations
from paraflex.mechanism import (
    Assembly,
    AtEnd,
    Curvature,
    DistanceJoint,
    FlexibleBeam,
    Gear,
    Geometry,
    JointFriction,
    LossFactor,
    LumpedMass,
    Material,
    Mechanism,
    ModalDamping,
    Motor,
    PointRef,
    PrescribedAngle,
    PrismaticJoint,
    RayleighDamping,
    RevoluteJoint,
    RigidBody,
    SampledAngle,
    Section,
    SlidingJoint,
    SlotJoint,
    TorsionalDamper,
    TorsionalSpring,
    WeldJoint,
)
from paraflex.motion import simulate_motion
from paraflex.results import motion_dataset

TIME = 0.37
G = 9.81


def ref(text):
    return PointRef.parse(text)


def make_sliders(geometry=Geometry.LINEAR):
    """One of everything that slides: axes on a beam, on a rigid body and on the ground, on side a and on side b.

    And rods without mass: between beams, and to the ground on either side.
    """
    crank = FlexibleBeam(
        "crank",
        0.3,
        Section.rectangle(width=0.02, thickness=0.01),
        RUBBER,
        points={"O": 0.0, "M": 0.2, "P": 0.3},
        lumps=(LumpedMass("P", 0.05, 4e-5),),
        damping=RayleighDamping(0.7, 2e-4),
        reference=ReferenceCondition.CANTILEVER,
        curvature=Curvature.SHARED,
    )
    rod = FlexibleBeam(
        "rod",
        0.5,
        Section.rectangle(width=0.03, thickness=0.012),
        RUBBER,
        points={"R": 0.0, "W": 0.5},
        elements=2,
        damping=ModalDamping((0.1, 0.03)),
        reference=ReferenceCondition.CANTILEVER,
        curvature=Curvature.SHARED,
    )
    block = RigidBody("block", 0.2, 3e-3, (0.1, 0.04), {"B": (-0.02, 0.01), "S": (0.03, -0.05)})
    plate = RigidBody("plate", 0.1, 1e-3, (-0.05, 0.02), {"W": (0.0, 0.1), "T": (0.2, 0.03)})
    bob = RigidBody("bob", 0.05, 2e-4, (0.01, 0.0), {"C": (0.02, -0.01)})
    swing = SampledAngle(lambda t: 0.2 * t**2 - t, lambda t: 0.4 * t - 1, lambda t: 0.4 + 0 * t)
    return Mechanism(
        name="sliders",
        ground={"O": (-0.2, 0.1), "G": (0.5, -0.15)},
        bodies=(crank, rod, block, plate, bob),
        joints=(
            RevoluteJoint("O", ref("ground.O"), ref("crank.O")),
            PrismaticJoint("guide", ref("crank.M"), ref("block.B"), direction=0.4, angle=0.2),
            SlotJoint("slot", ref("block.S"), ref("rod.R"), direction=-0.7),
            WeldJoint("weld", ref("rod.W"), ref("plate.W"), angle=0.3),
            SlotJoint("rail", ref("ground.G"), ref("plate.T"), direction=1.1),
            SlotJoint("pin", ref("plate.W"), ref("ground.G"), direction=0.3),
            # Equations that hold together are asked for, not whether the beams are long enough.
            SlidingJoint("bead", ref("rod.R"), ref("bob.C"), at_end=AtEnd.IGNORE),
            SlidingJoint("trolley", ref("crank.P"), ref("ground.G"), at_end=AtEnd.IGNORE),
            DistanceJoint("strut", ref("crank.P"), ref("rod.W"), 0.4),
            DistanceJoint("stay", ref("ground.O"), ref("rod.R"), 0.3),
            DistanceJoint("tie", ref("block.S"), ref("ground.G"), 0.7),
        ),
        motors=(Motor("screw", "guide"), Motor("turn", "O"), Motor("push", "pin"), Motor("pull", "bead")),
        prescribed=(PrescribedAngle("drive", "slot", swing),),
        springs=(TorsionalSpring("soft", "guide", 30.0, 0.1), TorsionalSpring("twist", "O", 3.0, 0.2)),
        dampers=(TorsionalDamper("oil", "rail", 2.0),),
        frictions=(JointFriction("dry", "pin", 4.0, 0.5), JointFriction("rub", "O", 0.3, 0.8)),
        # Of travels and angles, with two ends on one body, of one kind and of two.
        gears=(
            Gear("lead", "guide", "slot", -0.4, 0.1),
            Gear("rack", "O", "guide", 0.3, 0.05),
            Gear("pinion", "bead", "O", 4.0, 0.2),
            Gear("cable", "trolley", "pin", 0.7, 0.0),
        ),
        geometry=geometry,
    )


@pytest.fixture(scope="module", params=list(Geometry), ids=lambda g: g.value)
def sliders(request):
    return build_system(make_sliders(request.param))


# --- Definitions, written out for the complex step ------------------------------------------------------------------


def place(system, point, q):
    marker = system.marker(point)
    if point.on_ground:
        return marker.x0
    x = q[system.body(point.body).all]
    s = marker.x0 + marker.N @ x[3:]
    if marker.bending is not None:
        s = s - 0.5 * np.array([x[3:] @ marker.bending @ x[3:], 0.0])
    return x[:2] + twins.rotation(x[2]) @ s


def angle(system, point, q):
    return 0.0 if point.on_ground else twins.angle_row(system.marker(point)) @ q[system.body(point.body).all]


def in_frame(system, joint, q):
    """Point b of a sliding joint in the frame of its beam."""
    body = system.body(joint.a.body)
    return twins.rotation(q[body.angle]).T @ (place(system, joint.b, q) - q[body.position])


def above_beam(system, joint, q):
    """How far point b of a sliding joint is above the bent beam, by the shape functions where it stands."""
    body = system.body(joint.a.body)
    s = in_frame(system, joint, q)
    return s[1] - twins.beam_shape(body.mesh.nodes, s[0])[1] @ body.integrals.D @ q[body.flexible]


def along_axis(system, joint, q, turned=0.0):
    """Component of p_b - p_a along the joint's axis, or along the axis turned."""
    theta = angle(system, joint.a, q) + joint.direction + turned
    gap = place(system, joint.b, q) - place(system, joint.a, q)
    return np.cos(theta) * gap[0] + np.sin(theta) * gap[1]


def coordinate(system, name, q):
    joint = system.mechanism.joint(name)
    if isinstance(joint, SlidingJoint):
        return in_frame(system, joint, q)[0] - system.mechanism.body(joint.a.body).points[joint.a.point]
    if isinstance(joint, PrismaticJoint | SlotJoint):
        return along_axis(system, joint, q)
    return angle(system, joint.b, q) - angle(system, joint.a, q)


def row_values(system, t, q):
    """What every row compares with zero or with its multiplier: values of joints, less profiles and rest values."""
    out = {}
    for joint in system.mechanism.joints:
        gap = place(system, joint.b, q) - place(system, joint.a, q)
        turn = angle(system, joint.b, q) - angle(system, joint.a, q) - getattr(joint, "angle", 0.0)
        out |= {f"{joint.name} x": gap[0], f"{joint.name} y": gap[1], f"{joint.name} angle": turn}
        if isinstance(joint, SlidingJoint):
            out[f"{joint.name} normal"] = above_beam(system, joint, q)
        elif isinstance(joint, DistanceJoint):
            out[f"{joint.name} length"] = np.sqrt(gap @ gap) - joint.length
        elif hasattr(joint, "direction"):
            out[f"{joint.name} normal"] = along_axis(system, joint, q, np.pi / 2)
    mechanism = system.mechanism
    for member in (*mechanism.prescribed, *mechanism.springs, *mechanism.dampers, *mechanism.frictions):
        value = coordinate(system, member.joint, q) - getattr(member, "rest", 0.0)
        if hasattr(member, "profile"):
            value = value - member.profile.evaluate(np.array([t]))[0][0]
        out[f"{member.name} travel"] = out[f"{member.name} angle"] = value
    for gear in mechanism.gears:
        first, second = (coordinate(system, name, q) for name in gear.joints)
        out[f"{gear.name} travel"] = out[f"{gear.name} angle"] = second - gear.ratio * first - gear.phase
    return np.array([out[row] for row in system.rows])


def numeric_jacobian(system, q):
    return np.column_stack([twins.along(lambda q: row_values(system, TIME, q), q, e) for e in np.eye(system.n)])


def kinds(system, *wanted):
    return np.isin(system.packed.rows["kind"], wanted)


def terms(system, q, v, a, lam, torques, weights=(1.0, 0.0, 0.0), noted=None):
    """f and rows of the equations of motion."""
    ws = system.workspace()
    note_friction(system.packed, q, v if noted is None else noted, ws.mu, ws.compliance)
    signals = twins.still_signals(system, torques)
    equations(system.packed, signals, TIME, weights, q, v, a, lam, np.zeros(len(torques)), ws)
    return ws.f.copy(), ws.rows.copy()


def random_state(system, seed):
    """Far from rest, but with sliding points within the lengths of their beams."""
    q, v, a = twins.random_state(system, seed)
    for name, stand in (("trolley", (0.17, 0.02)), ("bead", (0.31, -0.03))):
        joint = system.mechanism.joint(name)
        miss = np.array(stand) - in_frame(system, joint, q)
        shift = twins.rotation(q[system.body(joint.a.body).angle]) @ miss
        if joint.b.on_ground:
            q[system.body(joint.a.body).position] -= shift
        else:
            q[system.body(joint.b.body).position] += shift
    return q, v, a


# --- Kernels --------------------------------------------------------------------------------------------------------


def test_rows_are_named_by_joint_and_what_they_hold(sliders):
    joints = ["O x", "O y", "guide normal", "guide angle", "slot normal", "weld x", "weld y", "weld angle"]
    joints += [
        "rail normal",
        "pin normal",
        "bead normal",
        "trolley normal",
        "strut length",
        "stay length",
        "tie length",
    ]
    others = ["drive travel", "soft travel", "twist angle", "oil travel", "dry travel", "rub angle"]
    gears = ["lead travel", "rack travel", "pinion angle", "cable travel"]
    assert sorted(sliders.rows) == sorted(joints + others + gears)


def test_constraints_their_rate_and_jacobian(sliders):
    q, v, _ = random_state(sliders, 41)
    phi, rate = sliders.constraints(twins.still_signals(sliders), TIME, q, v)
    rigid = kinds(sliders, CONSTRAINT)
    np.testing.assert_allclose(phi[rigid], row_values(sliders, TIME, q)[rigid], rtol=0, atol=1e-12)
    expected = numeric_jacobian(sliders, q)
    scale = np.max(np.abs(expected))
    np.testing.assert_allclose(sliders.jacobian(q)[rigid], expected[rigid], rtol=0, atol=1e-13 * scale)
    profile = np.zeros(sliders.m)
    profile[sliders.rows.index("drive travel")] = 0.4 * TIME - 1
    np.testing.assert_allclose(rate[rigid], (expected @ v - profile)[rigid], rtol=0, atol=1e-9)


def test_acceleration_rows_are_second_derivatives_along_a_motion(sliders):
    q0, v0, a0 = random_state(sliders, 42)
    weight_a, weight_v, weight_q = 0.7, 40.0, 400.0
    torques = np.zeros(4)
    _, rows = terms(sliders, q0, v0, a0, np.zeros(sliders.m), torques, (weight_a, weight_v, weight_q))

    def value(t):
        return row_values(sliders, TIME, q0 + np.sin(t) * v0 + (1 - np.cos(t)) * a0)

    first = np.imag(value(1e-30j)) / 1e-30
    # Fourth-order differences of the exact first derivative.
    h = 1e-4
    d = {k: np.imag(value(k * h + 1e-30j)) / 1e-30 for k in (-2, -1, 1, 2)}
    second = (d[-2] - 8 * d[-1] + 8 * d[1] - d[2]) / (12 * h)
    profile = np.zeros((2, sliders.m))
    profile[:, sliders.rows.index("drive travel")] = 0.4 * TIME - 1, 0.4
    expected = weight_a * (second - profile[1]) + weight_v * (first - profile[0]) + weight_q * value(0.0)
    rigid = kinds(sliders, CONSTRAINT)
    np.testing.assert_allclose(rows[rigid], expected[rigid], rtol=1e-8, atol=1e-7)


def test_rows_of_springs_dampers_and_friction(sliders):
    q, v, a = random_state(sliders, 43)
    lam = np.random.default_rng(44).normal(size=sliders.m)
    _, rows = terms(sliders, q, v, a, lam, np.zeros(4))
    value = row_values(sliders, TIME, q)
    rate = numeric_jacobian(sliders, q) @ v
    row = {name: i for i, name in enumerate(sliders.rows)}
    for name, stiffness in (("soft travel", 30.0), ("twist angle", 3.0)):
        i = row[name]
        assert rows[i] == pytest.approx(value[i] - lam[i] / stiffness, abs=1e-12)
    i = row["oil travel"]
    assert rows[i] == pytest.approx(rate[i] - lam[i] / 2.0, abs=1e-12)
    for name, limit, speed in (("dry travel", 4.0, 0.5), ("rub angle", 0.3, 0.8)):
        i = row[name]
        force = limit * np.tanh(rate[i] / speed)
        slope = limit / speed / np.cosh(rate[i] / speed) ** 2
        assert rows[i] == pytest.approx((force - lam[i]) / slope, rel=1e-9)


def test_forces_are_the_transposed_jacobian_times_multipliers_and_motor_forces(sliders):
    q, v, a = random_state(sliders, 45)
    rng = np.random.default_rng(46)
    lam, torques = rng.normal(size=sliders.m), rng.normal(size=4)
    f, _ = terms(sliders, q, v, a, lam, torques)
    free, _ = terms(sliders, q, v, a, np.zeros(sliders.m), np.zeros(4))
    expected = numeric_jacobian(sliders, q).T @ lam
    for motor, torque in zip(sliders.mechanism.motors, torques, strict=True):
        rows = [twins.along(lambda q, j=motor.joint: coordinate(sliders, j, q), q, e) for e in np.eye(sliders.n)]
        expected -= torque * np.array(rows)
    np.testing.assert_allclose(f - free, expected, rtol=0, atol=1e-11 * np.max(np.abs(expected)))


def test_joint_coordinates_with_their_rates_and_rows(sliders):
    q, v, _ = random_state(sliders, 47)
    for name in ("O", "guide", "slot", "rail", "pin", "bead", "trolley"):
        found = joint_coordinate(sliders, name, q[None], v[None])
        assert found.value[0] == pytest.approx(coordinate(sliders, name, q), abs=1e-12)
        rows = np.array([twins.along(lambda q, j=name: coordinate(sliders, j, q), q, e) for e in np.eye(sliders.n)])
        np.testing.assert_allclose(found.rows[0], rows, rtol=0, atol=1e-12)
        assert found.rate[0] == pytest.approx(rows @ v, abs=1e-11)


@pytest.mark.parametrize("g", [1e-4, 1e-2])
def test_the_factored_system_solves_the_dense_one(g):
    # Linear geometry: M has a closed form in the twins.
    system = build_system(make_sliders())
    q, v, _ = random_state(system, 48)
    rng = np.random.default_rng(49)
    ws = system.workspace()
    note_friction(system.packed, q, v, ws.mu, ws.compliance)
    assert factor_system(system.packed, g * g, q, ws) == 0
    matrix = twins.system_mass_matrix(system, q)
    for body in system.bodies:
        j = np.arange(body.flexible.start, body.flexible.stop)
        matrix[np.ix_(j, j)] += g * body.damping + g * g * np.diag(body.modes.omega**2)
    J = numeric_jacobian(system, q)
    rate, row = J @ v, {name: i for i, name in enumerate(system.rows)}
    corner = np.zeros(system.m)
    for name, stiffness in (("soft travel", 30.0), ("twist angle", 3.0)):
        corner[row[name]] = 1.0 / (stiffness * g * g)
    corner[row["oil travel"]] = 1.0 / (2.0 * g)
    for name, limit, speed in (("dry travel", 4.0, 0.5), ("rub angle", 0.3, 0.8)):
        corner[row[name]] = np.cosh(rate[row[name]] / speed) ** 2 * speed / limit / g
    A = np.block([[matrix, J.T], [J, -np.diag(corner)]])
    x, mu = rng.normal(size=system.n), rng.normal(size=system.m)
    expected = np.linalg.solve(A, np.concatenate([x, mu]))
    solve_system(system.packed, ws, x, mu)
    np.testing.assert_allclose(x, expected[: system.n], rtol=0, atol=1e-9 * np.max(np.abs(expected[: system.n])))
    np.testing.assert_allclose(mu, expected[system.n :], rtol=0, atol=1e-9 * np.max(np.abs(expected[system.n :])))


def test_damping_forces_are_those_of_the_damping_matrix(sliders):
    q, v, a = random_state(sliders, 50)
    slow = np.zeros_like(v)
    f, _ = terms(sliders, q, v, a, np.zeros(sliders.m), np.zeros(4), noted=slow)
    undamped = build_system(make_sliders(sliders.mechanism.geometry).with_bodies(
        [replace(sliders.mechanism.body(name), damping=None) for name in ("crank", "rod")]
    ))  # fmt: skip
    free, _ = terms(undamped, q, v, a, np.zeros(sliders.m), np.zeros(4), noted=slow)
    expected = np.zeros(sliders.n)
    for name in ("crank", "rod"):
        body = sliders.body(name)
        # The frames are held otherwise than the beams: their modes are coupled.
        assert np.any(body.damping != np.diag(np.diag(body.damping)))
        expected[body.flexible] = body.damping @ v[body.flexible]
    np.testing.assert_allclose(f - free, expected, rtol=0, atol=1e-9 * np.max(np.abs(expected)))


# --- Mechanisms with closed forms -----------------------------------------------------------------------------------

EXACT = IntegrationOptions(tolerance=1e-7)


def block_on_incline(slope=0.5, **keywords):
    block = RigidBody("block", 2.0, 0.01, points={"B": (0.0, 0.0)})
    return Mechanism(
        name="incline",
        ground={"O": (0.3, 0.2)},
        bodies=(block,),
        joints=(PrismaticJoint("rail", ref("ground.O"), ref("block.B"), direction=-slope, angle=-slope),),
        assemblies=(Assembly("top", {"block": -slope}),),
        gravity=(0.0, -G),
        **keywords,
    )


def test_a_block_slides_down_an_incline():
    run = simulate_motion(block_on_incline(), 0.8, samples=5, options=EXACT)
    way = 0.5 * G * np.sin(0.5) * run.times**2
    travel = joint_coordinate(run.system, "rail", run.solution.q).value
    np.testing.assert_allclose(travel, way, rtol=0, atol=1e-6)
    force = motion_dataset(run)["joint_force"].sel(joint="rail").values
    normal = np.array([np.sin(0.5), np.cos(0.5)])
    np.testing.assert_allclose(force, np.tile(2.0 * G * np.cos(0.5) * normal, (5, 1)), rtol=0, atol=1e-6)


def test_dry_friction_brakes_a_block_and_holds_it_below_its_limit():
    # Once it slides, the drive less the limit is left; below the limit it creeps at the speed that balances.
    drive = 2.0 * G * np.sin(0.5)

    def profile(t, state):
        return [state[1], (drive - 4.0 * np.tanh(state[1] / 1e-3)) / 2.0]

    sliding = block_on_incline(frictions=(JointFriction("dry", "rail", 4.0, 1e-3),))
    run = simulate_motion(sliding, 0.5, samples=11, options=EXACT)
    travel = joint_coordinate(run.system, "rail", run.solution.q).value
    exact = scipy.integrate.solve_ivp(profile, (0, 0.5), [0, 0], "LSODA", run.times, rtol=1e-11, atol=1e-13).y
    np.testing.assert_allclose(travel, exact[0], rtol=0, atol=1e-6)
    np.testing.assert_allclose(exact[0], 0.5 * (drive - 4.0) / 2.0 * run.times**2, rtol=0, atol=3e-4)
    assert run.solution.work[-1] == pytest.approx(0.5 * 2.0 * exact[1, -1] ** 2, rel=1e-4)
    assert run.solution.energy_balance_max < 1e-3 * run.solution.work[-1]
    held = block_on_incline(frictions=(JointFriction("dry", "rail", 2.0 * drive, 1e-3),))
    run = simulate_motion(held, 0.5, samples=11, options=EXACT)
    rate = joint_coordinate(run.system, "rail", run.solution.q, run.solution.v).rate
    assert rate[-1] == pytest.approx(1e-3 * np.arctanh(0.5), rel=1e-6)


def test_a_spring_and_a_damper_along_a_rail():
    stiffness, damping, mass = 200.0, 4.0, 2.0
    mechanism = block_on_incline(
        0.0,
        springs=(TorsionalSpring("coil", "rail", stiffness, 0.1),),
        dampers=(TorsionalDamper("oil", "rail", damping),),
    )
    run = simulate_motion(mechanism, 1.0, samples=21, options=EXACT)
    decay, t = damping / (2 * mass), run.times
    w = np.sqrt(stiffness / mass - decay**2)
    expected = 0.1 - 0.1 * np.exp(-decay * t) * (np.cos(w * t) + decay / w * np.sin(w * t))
    travel = joint_coordinate(run.system, "rail", run.solution.q).value
    np.testing.assert_allclose(travel, expected, rtol=0, atol=1e-5)


def test_equilibrium_with_a_spring_and_with_a_motor_that_holds():
    mechanism = block_on_incline(springs=(TorsionalSpring("coil", "rail", 500.0),), motors=(Motor("screw", "rail"),))
    system = build_system(mechanism)
    start = consistent_state(system, mechanism.assembly())
    rest = static_equilibrium(system, start)
    sag = 2.0 * G * np.sin(0.5) / 500.0
    assert joint_coordinate(system, "rail", rest.q[None]).value[0] == pytest.approx(sag, abs=1e-9)
    held = static_equilibrium(system, rest, ["rail"])
    np.testing.assert_allclose(held.q, rest.q, rtol=0, atol=1e-9)


def test_a_motor_pushes_along_its_axis_and_against_what_carries_it():
    # A cart and a block on it, no ground in between: momentum stays zero.
    cart = RigidBody("cart", 3.0, 0.1, points={"C": (0.0, 0.0), "D": (0.2, 0.1)})
    block = RigidBody("block", 1.0, 0.01, points={"B": (0.0, 0.0)})
    mechanism = Mechanism(
        name="cart",
        ground={"O": (0.0, 0.0)},
        bodies=(cart, block),
        joints=(
            PrismaticJoint("rail", ref("ground.O"), ref("cart.C")),
            PrismaticJoint("bed", ref("cart.D"), ref("block.B")),
        ),
        motors=(Motor("screw", "bed"),),
        assemblies=(Assembly("start", {"cart": 0.0, "block": 0.0}),),
    )
    run = simulate_motion(mechanism, 0.5, samples=3, torques={"screw": 1.5}, options=EXACT)
    q = run.solution.q
    relative = 1.5 * (1.0 / 3.0 + 1.0)
    travel = joint_coordinate(run.system, "bed", q).value
    np.testing.assert_allclose(travel, 0.5 * relative * run.times**2, rtol=0, atol=1e-6)
    np.testing.assert_allclose(3.0 * q[:, 0] + (q[:, 3] - 0.2), 0.0, rtol=0, atol=1e-7)
    assert run.solution.work[-1] == pytest.approx(1.5 * travel[-1], rel=1e-4)


def test_a_scotch_yoke_moves_as_the_cosine_of_its_crank():
    speed, radius = 9.0, 0.2
    spin = SampledAngle(lambda t: speed * t, lambda t: speed + 0 * t, lambda t: 0 * t)
    crank = RigidBody("crank", 0.5, 0.01, points={"O": (0.0, 0.0), "P": (radius, 0.0)})
    yoke = RigidBody("yoke", 0.7, 0.02, points={"Y": (0.0, 0.0)})
    mechanism = Mechanism(
        name="yoke",
        ground={"O": (0.0, 0.0)},
        bodies=(crank, yoke),
        joints=(
            RevoluteJoint("O", ref("ground.O"), ref("crank.O")),
            PrismaticJoint("rail", ref("ground.O"), ref("yoke.Y")),
            SlotJoint("slot", ref("yoke.Y"), ref("crank.P"), direction=np.pi / 2),
        ),
        prescribed=(PrescribedAngle("spin", "O", spin),),
        assemblies=(Assembly("start", {"crank": 0.0, "yoke": 0.0}),),
    )
    run = simulate_motion(mechanism, 1.0, samples=41, options=EXACT)
    x = joint_coordinate(run.system, "rail", run.solution.q).value
    np.testing.assert_allclose(x, radius * np.cos(speed * run.times), rtol=0, atol=1e-6)
    # The slot pushes the yoke, and the crank's pin feels it.
    force = motion_dataset(run)["joint_force"].sel(joint="slot").values
    expected = 0.7 * radius * speed**2 * np.cos(speed * run.times)
    np.testing.assert_allclose(force[:, 0], expected, rtol=0, atol=1e-3 * np.max(np.abs(expected)))
    np.testing.assert_allclose(force[:, 1], 0.0, rtol=0, atol=1e-4)


def test_a_mass_hung_on_a_beam_slides_where_the_beam_bends():
    """A bead on a stiff beam that its own weight bends: it stays on the static deflection line to first order."""
    section, material = Section.rectangle(width=0.02, thickness=0.004), Material(70e9, 2700.0)
    beam = FlexibleBeam("beam", 1.0, section, material, points={"A": 0.0, "B": 1.0}, elements=4)
    bead = RigidBody("bead", 0.2, 1e-5, points={"C": (0.0, 0.0)})
    mechanism = Mechanism(
        name="bead",
        ground={"A": (0.0, 0.0), "B": (1.0, 0.0)},
        bodies=(beam, bead),
        joints=(
            RevoluteJoint("A", ref("ground.A"), ref("beam.A")),
            SlotJoint("B", ref("ground.B"), ref("beam.B")),
            SlidingJoint("wire", ref("beam.A"), ref("bead.C")),
        ),
        prescribed=(PrescribedAngle("haul", "wire", SampledAngle(
            lambda t: 0.1 + 0.08 * t, lambda t: 0.08 + 0 * t, lambda t: 0 * t)),),
        assemblies=(Assembly("start", {"beam": 0.0, "bead": 0.0}),),
        gravity=(0.0, -G),
    )  # fmt: skip
    system = build_system(mechanism)
    start = static_equilibrium(system, consistent_state(system, mechanism.assembly()))
    EI, line = 70e9 * 0.02 * 0.004**3 / 12.0, 2700.0 * 0.02 * 0.004 * G

    def sag(x):
        # A simply supported beam under a load W at x, where it stands, and its own weight.
        return 0.2 * G * x**2 * (1 - x) ** 2 / (3 * EI) + line * x * (1 - 2 * x**2 + x**3) / (24 * EI)

    data = motion_dataset(simulate_motion(mechanism, 10.0, samples=21, start=start))
    C = data["point_position"].sel(point="bead.C").values
    np.testing.assert_allclose(C[:, 0], 0.1 + 0.08 * data["time"], rtol=0, atol=2e-4)
    np.testing.assert_allclose(C[:, 1], -sag(C[:, 0]), rtol=0, atol=0.02 * sag(0.5))


def test_a_prescribed_travel_is_kept():
    profile = SampledAngle(
        lambda t: 0.1 * np.sin(7 * t), lambda t: 0.7 * np.cos(7 * t), lambda t: -4.9 * np.sin(7 * t)
    )  # fmt: skip
    mechanism = block_on_incline(prescribed=(PrescribedAngle("wave", "rail", profile),))
    run = simulate_motion(mechanism, 1.0, samples=31, options=EXACT)
    travel = joint_coordinate(run.system, "rail", run.solution.q).value
    np.testing.assert_allclose(travel, 0.1 * np.sin(7 * run.times), rtol=0, atol=1e-6)
    multiplier = motion_dataset(run)["multiplier"].sel(row="wave travel").values
    expected = 2.0 * (-4.9 * np.sin(7 * run.times) - G * np.sin(0.5))
    np.testing.assert_allclose(-multiplier, expected, rtol=0, atol=1e-3)


def bar(name, length, points, **keywords):
    section, material = Section.rectangle(width=0.02, thickness=0.004), Material(70e9, 2700.0)
    return FlexibleBeam(name, length, section, material, points=points, elements=2, **keywords)


def clamped(bodies, joints, **keywords):
    return Mechanism(
        name="clamped",
        ground={"O": (0.0, 0.0)},
        bodies=bodies,
        joints=(WeldJoint("clamp", ref("ground.O"), ref(f"{bodies[0].name}.A")), *joints),
        assemblies=(Assembly("straight", {body.name: 0.0 for body in bodies}),),
        gravity=(0.0, -0.01 * G),
        **keywords,
    )


def test_two_welded_beams_swing_as_one():
    # A weld carries a moment: curvature must be free at the end it holds.
    free = {"curvature": Curvature.SEPARATE}
    whole = clamped((bar("beam", 0.6, {"A": 0.0, "M": 0.3, "B": 0.6}),), ())
    halves = clamped(
        (bar("left", 0.3, {"A": 0.0, "M": 0.3}, **free), bar("right", 0.3, {"M": 0.0, "B": 0.3}, **free)),
        (WeldJoint("weld", ref("left.M"), ref("right.M")),),
    )
    options = IntegrationOptions(tolerance=1e-8)
    tips = []
    for mechanism, point in ((whole, "beam.B"), (halves, "right.B")):
        data = motion_dataset(simulate_motion(mechanism, 0.3, samples=31, options=options))
        tips.append(data["point_position"].sel(point=point).values)
    sag = np.max(np.abs(tips[0][:, 1]))
    np.testing.assert_allclose(tips[1], tips[0], rtol=0, atol=1e-3 * sag)


def test_a_damped_cantilever_decays_by_its_ratio():
    ratio = 0.02
    mechanism = clamped((bar("beam", 0.6, {"A": 0.0, "B": 0.6}, modes=1, damping=ModalDamping((ratio,)),
                             reference=ReferenceCondition.CANTILEVER),), ())  # fmt: skip
    run = simulate_motion(mechanism, 0.5, samples=2001, options=IntegrationOptions(tolerance=1e-9))
    omega = run.system.body("beam").modes.omega[0]
    eta = run.solution.q[:, run.system.body("beam").flexible][:, 0]
    # Let go under its weight: 1 - exp(-z w t) (cos w_d t + ...), about where it comes to rest.
    w, t = omega * np.sqrt(1 - ratio**2), run.times
    rest = eta[-1] / (1 - np.exp(-ratio * omega * t[-1]) * (np.cos(w * t[-1]) + ratio * omega / w * np.sin(w * t[-1])))
    expected = rest * (1 - np.exp(-ratio * omega * t) * (np.cos(w * t) + ratio * omega / w * np.sin(w * t)))
    np.testing.assert_allclose(eta, expected, rtol=0, atol=2e-3 * abs(rest))
    assert run.solution.energy_balance_max < 2e-3 * np.max(run.solution.kinetic_energy)


def sliders_put_together(geometry=Geometry.LINEAR):
    """The sliders, their beams of nylon, in a closed pose in motion, with one gear that holds there."""
    mechanism = make_sliders(geometry)
    nylon = Material(youngs_modulus=2e9, density=1100.0)
    mechanism = mechanism.with_bodies(replace(mechanism.body(name), material=nylon) for name in ("crank", "rod"))
    # Rods besides would hold all of it.
    mechanism = replace(mechanism, joints=tuple(one for one in mechanism.joints if one.kind != "distance"))
    free = build_system(replace(mechanism, gears=()))
    q = np.zeros(free.n)
    for name, turn in {"crank": 0.9, "rod": -0.4, "block": 1.1, "plate": -0.1}.items():
        q[free.body(name).angle] = turn
    q = project_position(free, twins.still_signals(free), 0.0, q)
    phase = coordinate(free, "guide", q) - 0.3 * coordinate(free, "O", q)
    mechanism = replace(mechanism, gears=(Gear("rack", "O", "guide", 0.3, phase),))
    system = build_system(mechanism)
    v = project_velocity(system, twins.still_signals(system), 0.0, q, np.zeros(system.n), 1e3)
    return mechanism, State(0.0, q, v)


def test_everything_at_once_keeps_its_energy_balance():
    mechanism, start = sliders_put_together()
    torques = {"screw": 0.5, "turn": 0.05, "push": 0.3}
    run = simulate_motion(mechanism, 0.2, samples=11, torques=torques, start=start, options=EXACT)
    solution = run.solution
    scale = np.max(solution.kinetic_energy + solution.strain_energy)
    assert solution.energy_balance_max < 1e-4 * scale
    assert solution.constraint_position_max < 1e-5


# --- What makes no sense --------------------------------------------------------------------------------------------


def test_a_weld_has_no_motor():
    with pytest.raises(InputError, match="a weld does not move"):
        clamped((bar("beam", 0.6, {"A": 0.0}),), (), motors=(Motor("drive", "clamp"),))


@pytest.mark.parametrize(
    ("keywords", "field"),
    [
        ({"frictions": (JointFriction("dry", "rail", 0.0, 1.0),)}, "friction.dry.limit"),
        ({"frictions": (JointFriction("dry", "rail", 1.0, -1.0),)}, "friction.dry.speed"),
        ({"frictions": (JointFriction("dry", "roil", 1.0, 1.0),)}, "friction.dry.joint"),
    ],
)
def test_friction_is_checked(keywords, field):
    with pytest.raises(InputError) as caught:
        block_on_incline(**keywords)
    assert caught.value.field == field


@pytest.mark.parametrize(
    "damping",
    [
        RayleighDamping(-1.0, 0.0),
        ModalDamping(()),
        ModalDamping((0.1, -0.2)),
        LossFactor(-0.1, 5.0),
        LossFactor(0.1, 0.0),
    ],
)
def test_damping_is_checked(damping):
    with pytest.raises(InputError) as caught:
        clamped((bar("beam", 0.6, {"A": 0.0}, damping=damping),), ())
    assert caught.value.field.startswith("body.beam.damping")
