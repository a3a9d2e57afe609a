"""KED: elastic response to a prescribed rigid motion, against closed forms, statics and the full model."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
import scipy.integrate
import scipy.interpolate
import scipy.optimize

import twins
from paraflex import elastodynamics
from paraflex.dynamics import build_system, constant_signals, pack_signals
from paraflex.elastodynamics import simulate_ked
from paraflex.errors import ActuationError, InputError, IntegrationError
from paraflex.fem import ReferenceCondition
from paraflex.integrators import IntegrationOptions, integrate
from paraflex.integrators.methods import GeneralisedAlpha
from paraflex.mechanism import (
    Assembly,
    EndEffector,
    FlexibleBeam,
    Geometry,
    Material,
    Mechanism,
    Motor,
    PointRef,
    PrescribedAngle,
    RevoluteJoint,
    SampledAngle,
    Section,
)
from paraflex.paths import Line, PointPath
from paraflex.results import tracking_dataset
from paraflex.results.links import tip_deflection
from paraflex.tracking import plan_tracking

LENGTH, WIDTH, THICKNESS = 0.4, 0.02, 0.004
ALUMINIUM = Material(youngs_modulus=70e9, density=2700.0)
# The end of the arm from an angle of 0.4 rad to one of 1.4, then dwell; only x is its task.
SWING = PointPath(((LENGTH * np.cos(0.4), 0.0), (LENGTH * np.cos(1.4), 0.0)), 0.15)
SHORT = PointPath(((0.0, 0.264), (0.03, 0.284)), 0.06)


def make_arm(reference=ReferenceCondition.CANTILEVER):
    """One flexible link turned by a motor at its root."""
    link = FlexibleBeam(
        "link",
        LENGTH,
        Section.rectangle(WIDTH, THICKNESS),
        ALUMINIUM,
        {"root": 0.0, "tip": LENGTH},
        elements=3,
        reference=reference,
    )
    return Mechanism(
        "arm",
        {"O": (0.0, 0.0)},
        (link,),
        (RevoluteJoint("shoulder", PointRef("ground", "O"), PointRef("link", "root")),),
        (Motor("torque", "shoulder"),),
        end_effector=EndEffector(PointRef("link", "tip"), ("x",)),
        assemblies=(Assembly("up", {"link": 0.4}),),
    )


def swing(t):
    """Angle, rate and acceleration of the rigid arm: x = L cos phi."""
    (x, dx, ddx) = (values[:, 0] for values in SWING.evaluate(t))
    phi = np.arccos(x / LENGTH)
    w = -dx / (LENGTH * np.sin(phi))
    return phi, w, -(ddx + x * w**2) / (LENGTH * np.sin(phi))


def clamped_beam(times, modes=6):
    """Tip deflection of a clamped Euler-Bernoulli beam whose root turns as the arm does: mode by mode, closed form.

    w = sum W_k eta_k, eta_k'' + omega_k^2 eta_k = -2 alpha / (beta_k^2 L), W_k(L) = -2 (-1)^k, for the modes of
    cos(beta L) cosh(beta L) = -1 with the mean square 1.
    """
    roots = [
        scipy.optimize.brentq(lambda z: np.cos(z) + 1 / np.cosh(z), (k - 1) * np.pi + 1e-9, k * np.pi)
        for k in range(1, modes + 1)
    ]
    beta = np.array(roots) / LENGTH
    bending = ALUMINIUM.youngs_modulus * THICKNESS**2 / 12 / ALUMINIUM.density
    omega = beta**2 * np.sqrt(bending)

    def rates(t, state):
        eta, rate = np.split(state, 2)
        return np.concatenate([rate, -(omega**2) * eta - 2 * swing(np.array([t]))[2][0] / (beta**2 * LENGTH)])

    states = scipy.integrate.solve_ivp(
        rates, (0.0, times[-1]), np.zeros(2 * modes), method="DOP853", t_eval=times, rtol=1e-9, atol=1e-12
    ).y
    return -2 * (-1.0) ** np.arange(1, modes + 1) @ states[:modes]


def nominal(task, system=None):
    """The rigid motion at the samples in the coordinates of a flexible system."""
    system = system or task.system
    out = np.zeros((3, task.motion.t.size, system.n))
    for body in system.bodies:
        rigid = task.motion.system.body(body.name).all
        target = slice(body.offset, body.offset + 3)
        for values, source in zip(out, (task.motion.q, task.motion.v, task.motion.a), strict=True):
            values[:, target] = source[:, rigid]
    return out


def stiffened(mechanism, factor):
    bodies = [
        replace(body, material=replace(body.material, youngs_modulus=factor * body.material.youngs_modulus))
        for body in mechanism.bodies
    ]
    return mechanism.with_bodies(bodies)


def largest(x):
    return float(np.max(np.abs(x)))


@pytest.fixture(scope="module")
def arm():
    return plan_tracking(make_arm(), SWING, duration=0.25, samples=126)


@pytest.fixture(scope="module")
def short(raparm):
    return plan_tracking(raparm, SHORT, duration=0.08, samples=41)


@pytest.fixture(scope="module")
def short_run(short):
    return simulate_ked(short, "++++")


# --- Closed forms --------------------------------------------------------------------------------------------------


def test_a_link_turned_at_its_root_is_a_clamped_beam(arm):
    run = simulate_ked(arm, "+", step=5e-5)
    tip = tip_deflection(run.task.system, "link", run.solution.q)
    expected = clamped_beam(arm.motion.t)
    assert largest(expected) > 5e-3
    # What is left is the phase of 5 periods at (omega h)^2 = 4e-5.
    np.testing.assert_allclose(tip[:, 1], expected, rtol=0, atol=5e-4 * largest(expected))
    # Centrifugal stretch is static, rho w^2 L^3 / 3 E: the first axial mode is at 2e4 rad/s.
    stretch = ALUMINIUM.density * swing(arm.motion.t)[1] ** 2 * LENGTH**3 / (3 * ALUMINIUM.youngs_modulus)
    np.testing.assert_allclose(tip[:, 0], stretch, rtol=0, atol=5e-3 * largest(stretch))
    np.testing.assert_allclose(run.solution.q[:, 2], swing(arm.motion.t)[0], rtol=0, atol=1e-10)


def test_the_response_does_not_depend_on_the_reference_condition(arm, condition):
    # A linear change of coordinates in the body frame: deflection of the tip against the nominal pose, and forces.
    def seen(task):
        run = simulate_ked(task, "+", step=1e-4)
        body, marker = task.system.bodies[0], task.system.marker(PointRef("link", "tip"))
        xi = run.solution.q - nominal(task)[0]
        phi = task.motion.q[:, 2]
        across = np.cos(phi) * xi[:, 1] - np.sin(phi) * xi[:, 0] + LENGTH * xi[:, 2]
        return across + xi[:, body.flexible] @ marker.N[1], run.solution.multipliers

    other = plan_tracking(make_arm(condition), SWING, duration=0.25, samples=126)
    for a, b in zip(seen(arm), seen(other), strict=True):
        np.testing.assert_allclose(b, a, rtol=0, atol=1e-7 * largest(a))


@pytest.mark.parametrize("mode", ["++++", "+-+-"])
def test_a_slow_motion_gives_static_deflections(raparm, mode):
    # [K C^T; C 0] [xi; mu] = [-(M a + h); 0] by the plain formulas of the twins, in the ground frame.
    task = plan_tracking(stiffened(raparm, 400), PointPath(((0.0, 0.264), (0.03, 0.284)), 1.5), samples=16)
    run = simulate_ked(task, mode, step=1e-3, spectral_radius=0.3)
    solution, system, (q, v, a) = run.solution, task.system, nominal(task)
    active = [k for k, motor in enumerate(raparm.motors) if motor.name in task.mode(mode).motors]
    held = [
        twins.joint_angle_row(system, motor.joint) for motor in raparm.motors if motor.name in task.mode(mode).motors
    ]
    K = np.zeros(system.n)
    for body in system.bodies:
        K[body.flexible] = body.modes.omega**2
    expected, forces, torques = np.zeros_like(q), np.zeros_like(solution.multipliers), np.zeros_like(run.holding)
    for k in range(len(q)):
        C = np.vstack([twins.constraint_jacobian(system, q[k]), held])
        load = -twins.system_mass_matrix(system, q[k]) @ a[k] - twins.system_forces(system, q[k], v[k])
        matrix = np.block([[np.diag(K), C.T], [C, np.zeros((len(C), len(C)))]])
        both = np.linalg.solve(matrix, np.concatenate([load, np.zeros(len(C))]))
        expected[k], forces[k] = both[: system.n], both[system.n :][: system.m]
        torques[k, active] = -both[system.n + system.m :]
    assert largest(expected) > 1e-7
    # The jerk at the start leaves a vibration of 1 / omega T, about 1e-3, and more where the path is steep.
    np.testing.assert_allclose(solution.q - q, expected, rtol=0, atol=0.02 * largest(expected))
    np.testing.assert_allclose(solution.multipliers, forces, rtol=0, atol=0.02 * largest(forces))
    np.testing.assert_allclose(run.holding, torques, rtol=0, atol=0.02 * largest(torques))


def test_a_rigid_mechanism_moves_as_planned_and_its_joints_carry_the_planned_torques(raparm):
    task = plan_tracking(raparm.rigid(), SHORT, duration=0.08, samples=9)
    run = simulate_ked(task, "+--+", step=1e-3)
    solution, (q, v, a) = run.solution, nominal(task)
    for values, expected in zip((solution.q, solution.v, solution.a), (q, v, a), strict=True):
        np.testing.assert_allclose(values, expected, rtol=0, atol=1e-9 * largest(expected))
    torques = task.torques("+--+").evaluate(task.motion.t)
    rows = np.array([twins.joint_angle_row(task.system, motor.joint) for motor in raparm.motors])
    for k in range(len(q)):
        inertia = twins.system_mass_matrix(task.system, q[k]) @ a[k] + twins.system_forces(task.system, q[k], v[k])
        balance = inertia + twins.constraint_jacobian(task.system, q[k]).T @ solution.multipliers[k]
        np.testing.assert_allclose(balance, rows.T @ torques[k], rtol=0, atol=1e-6 * largest(torques))
    np.testing.assert_allclose(run.holding, torques, rtol=0, atol=1e-6 * largest(torques))
    np.testing.assert_array_equal(tracking_dataset([run])["torque"][0], run.holding)


def test_dependent_rows_of_redundant_motors_do_no_harm(raparm):
    # Rigid links and four motors: 26 rows for 24 coordinates.
    task = plan_tracking(raparm.rigid(), SHORT, duration=0.08, samples=9)
    solution = simulate_ked(task, "++++", step=1e-3).solution
    np.testing.assert_allclose(solution.q, nominal(task)[0], rtol=0, atol=1e-10)
    assert solution.constraint_position_max < 1e-10


# --- Against the full model ----------------------------------------------------------------------------------------


def deviation_from_the_full_model(mechanism, mode):
    """Largest deviation from the nominal motion, of KED and of the full model driven by the nominal motor angles."""
    task = plan_tracking(mechanism, SHORT, duration=0.08, samples=41)
    active = [motor for motor in mechanism.motors if motor.name in task.mode(mode).motors]
    t = np.linspace(0.0, 0.08, 801)
    motion = task.plan.follow(t)
    profiles = []
    for motor in active:
        phi = motion.q[:, motion.system.body(mechanism.joint(motor.joint).b.body).angle]
        spline = scipy.interpolate.make_interp_spline(t, phi, k=5)
        profile = SampledAngle(spline, spline.derivative(1), spline.derivative(2), SHORT.knots[1:])
        profiles.append(PrescribedAngle(f"{motor.name} profile", motor.joint, profile))
    driven = build_system(replace(mechanism, prescribed=tuple(profiles)))
    signals, knots = pack_signals(driven.mechanism, constant_signals([0.0] * 4, 0.08), 0.08)
    full = integrate(
        driven, signals, task.start, task.motion.t, knots=np.array(knots), options=IntegrationOptions(tolerance=1e-6)
    )
    rigid = nominal(task)[0]
    ked = simulate_ked(task, mode, step=1e-4).solution.q - rigid
    return largest(full.q - rigid - ked), largest(ked)


@pytest.mark.parametrize("mode", ["++++", "-+-+"])
def test_it_agrees_with_the_full_model_driven_by_the_motor_angles_the_better_the_stiffer(raparm, mode):
    errors, sizes = zip(
        *(deviation_from_the_full_model(stiffened(raparm, factor), mode) for factor in (4, 16)), strict=True
    )
    assert errors[0] < 0.04 * sizes[0]
    # The terms left out are of the order of the ratio of the speed of turning to the lowest frequency.
    assert errors[1] / sizes[1] < 0.5 * errors[0] / sizes[0]


# --- The method ----------------------------------------------------------------------------------------------------


@pytest.mark.parametrize("radius", [0.0, 0.5, 0.8, 1.0])
def test_parameters_are_those_of_chung_and_hulbert(radius):
    scheme = GeneralisedAlpha(spectral_radius=radius).numbers
    # Amplification of x'' + w^2 x = 0 at w -> infinity, in (x, h x', h^2 a, h^2 x''): all eigenvalues of this size.
    stiff = 1e12
    am, af, gamma, beta, b = scheme.alpha_m, scheme.alpha_f, scheme.gamma, scheme.beta, scheme.weight(1.0)
    assert gamma == pytest.approx(0.5 + af - am)
    columns = []
    for x, v, a, dd in np.eye(4):
        carried = (af * dd - am * a) / (1 - am)
        predicted = x + v + (0.5 - beta) * a + beta * carried
        new = -stiff * predicted / (1 + stiff * b)
        after = carried + (1 - af) / (1 - am) * new
        columns.append([predicted + b * new, v + (1 - gamma) * a + gamma * after, after, new])
    sizes = np.abs(np.linalg.eigvals(np.array(columns).T))
    # A triple eigenvalue spreads by the cube root of rounding.
    assert np.max(sizes) == pytest.approx(radius, abs=2e-3)


def test_it_is_of_second_order_in_displacements_velocities_and_forces(short):
    exact, *rest = (simulate_ked(short, "++++", step=step).solution for step in (2.5e-5, 4e-4, 2e-4, 1e-4))
    for name in ("q", "v", "multipliers"):
        errors = [np.sqrt(np.mean((getattr(one, name) - getattr(exact, name)) ** 2)) for one in rest]
        orders = np.log2(np.divide(errors[:-1], errors[1:]))
        assert np.all((orders > 1.7) & (orders < 2.5)), (name, orders)


def test_velocities_and_accelerations_are_derivatives_of_the_coordinates(raparm):
    task = plan_tracking(raparm, SHORT, samples=601)
    solution = simulate_ked(task, "++++").solution
    assert np.all(solution.steps == 600)
    inside = slice(30, -30)
    for low, high in (("q", "v"), ("v", "a")):
        rate = scipy.interpolate.make_interp_spline(solution.t, getattr(solution, low), k=5).derivative()(solution.t)
        error = (rate - getattr(solution, high))[inside]
        # Rigid coordinates turn and move by as much as they bend, and a tenth of that is bending.
        assert largest(error) < 2e-3 * largest(getattr(solution, high))


def test_the_step_divides_the_samples_evenly(short):
    for step, substeps in ((2e-3, 1), (1.0, 1), (1.999e-3, 2), (1e-3, 2), (2e-3 / 3, 3)):
        solution = simulate_ked(short, "++++", step=step).solution
        assert solution.steps == 40 * substeps
        assert solution.factorisations == solution.steps + 1
        np.testing.assert_array_equal(solution.t, short.motion.t)


# --- What KED is ---------------------------------------------------------------------------------------------------


def test_motor_angles_hold_and_joints_close_in_the_linear_sense(short, short_run):
    system, (q, *_) = short.system, nominal(short)
    xi = short_run.solution.q - q
    assert largest(xi) > 1e-3
    for motor in short.mechanism.motors:
        assert largest(xi @ twins.joint_angle_row(system, motor.joint)) < 1e-12
    gaps = [twins.constraint_jacobian(system, pose) @ change for pose, change in zip(q, xi, strict=True)]
    assert largest(gaps) < 1e-12
    assert short_run.solution.constraint_position_max > 1e-8


def test_a_motor_between_two_links_holds_the_one_against_the_other():
    one, two = (replace(make_arm().bodies[0], name=name) for name in ("one", "two"))
    joints = (
        RevoluteJoint("shoulder", PointRef("ground", "O"), PointRef("one", "root")),
        RevoluteJoint("elbow", PointRef("one", "tip"), PointRef("two", "root")),
    )
    mechanism = Mechanism(
        "arm of two links",
        {"O": (0.0, 0.0)},
        (one, two),
        joints,
        (Motor("t1", "shoulder"), Motor("t2", "elbow")),
        end_effector=EndEffector(PointRef("two", "tip")),
        assemblies=(Assembly("down", {"one": 0.2, "two": 1.4}),),
    )
    task = plan_tracking(mechanism, PointPath(((0.5, 0.4), (0.4, 0.5)), 0.3), samples=31)
    xi = simulate_ked(task, "++").solution.q - nominal(task)[0]
    assert largest(xi @ twins.joint_angle_row(task.system, "elbow")) < 1e-12
    # The end of the first link turns, and the second one with it.
    assert largest(xi[:, task.system.body("two").angle]) > 1e-3


@pytest.mark.parametrize("mode", ["+-+-", "+-++"])
def test_passive_motors_turn_freely(short, mode):
    xi = simulate_ked(short, mode).solution.q - nominal(short)[0]
    for motor, sign in zip(short.mechanism.motors, mode, strict=True):
        turn = largest(xi @ twins.joint_angle_row(short.system, motor.joint))
        assert turn < 1e-12 if sign == "+" else turn > 1e-3


def test_joints_open_with_the_square_of_the_displacements(raparm):
    sizes, gaps = [], []
    for factor in (100, 400):
        task = plan_tracking(stiffened(raparm, factor), PointPath(((0.0, 0.264), (0.03, 0.284)), 0.2), samples=21)
        solution = simulate_ked(task, "++++").solution
        sizes.append(largest(solution.q - nominal(task)[0]))
        gaps.append(solution.constraint_position_max)
    assert sizes[0] / sizes[1] == pytest.approx(4.0, rel=0.1)
    assert gaps[0] / gaps[1] == pytest.approx(16.0, rel=0.2)


def test_twice_the_load_is_twice_the_response(short, short_run, monkeypatch):
    # Nothing comes back from the displacements to the motion: the response is linear in the load to rounding.
    forces = elastodynamics.motion_forces

    def doubled(packed, q, v, a, loads, f, points):
        forces(packed, q, v, a, loads, f, points)
        f *= 2.0

    monkeypatch.setattr(elastodynamics, "motion_forces", doubled)
    twice = simulate_ked(short, "++++")
    q = nominal(short)[0]
    xi = short_run.solution.q - q
    np.testing.assert_allclose(twice.solution.q - q, 2 * xi, rtol=0, atol=1e-11 * largest(xi) + 1e-14)


def test_second_order_geometry_is_taken_as_linear(raparm, short, short_run):
    task = plan_tracking(raparm.with_geometry(Geometry.SECOND_ORDER), SHORT, duration=0.08, samples=41)
    run = simulate_ked(task, "++++")
    assert run.task.mechanism.geometry is Geometry.LINEAR
    np.testing.assert_array_equal(run.solution.q, short_run.solution.q)
    assert task.mechanism.geometry is Geometry.SECOND_ORDER


def test_a_run_is_told_as_others_are(short, short_run):
    data = tracking_dataset([short_run])
    solution = short_run.solution
    assert (short_run.method, solution.status) == ("KED, generalised-alpha", "complete")
    assert float(data["tracking_rms"][0]) > 1e-4
    for k in (0, 20, 40):
        energies = (
            sum(
                twins.kinetic_energy(b.integrals, solution.q[k, b.all], solution.v[k, b.all])
                for b in short.system.bodies
            ),
            sum(twins.strain_energy(b.integrals, solution.q[k, b.all]) for b in short.system.bodies),
        )
        np.testing.assert_allclose(
            (solution.kinetic_energy[k], solution.strain_energy[k]), energies, rtol=1e-6, atol=1e-12
        )
    assert np.all(np.isnan(solution.work))
    gap = max(largest(twins.constraints(short.system, 0.0, q)) for q in solution.q)
    assert solution.constraint_position_max == pytest.approx(gap, rel=1e-9)


def test_one_segment_a_link_is_the_rigid_mechanism(short):
    run = simulate_ked(short.in_segments(1), "++++", step=1e-3)
    effector = tracking_dataset([run])["end_effector"][0]
    np.testing.assert_allclose(effector, short.motion.desired.position, rtol=0, atol=1e-10)


# --- Input and ends ------------------------------------------------------------------------------------------------


@pytest.mark.parametrize(
    ("options", "field"),
    [
        ({"step": 0.0}, "step"),
        ({"step": -1e-4}, "step"),
        ({"step": np.nan}, "step"),
        ({"step": np.inf}, "step"),
        ({"spectral_radius": -0.1}, "spectral_radius"),
        ({"spectral_radius": 1.1}, "spectral_radius"),
        ({"spectral_radius": np.nan}, "spectral_radius"),
    ],
)
def test_options_that_cannot_be_used_are_refused(short, options, field):
    with pytest.raises(InputError) as caught:
        simulate_ked(short, "++++", **options)
    assert caught.value.field == field


def test_springs_are_refused_by_name(short):
    with pytest.raises(InputError, match="springs") as caught:
        simulate_ked(short.in_segments(2), "++++")
    assert caught.value.field == "spring"
    assert caught.value.value in [spring.name for spring in short.in_segments(2).mechanism.springs]


def test_a_mode_that_cannot_drive_is_refused(short):
    with pytest.raises(ActuationError):
        simulate_ked(short, "+---")


def test_progress_is_told_and_an_interrupted_run_keeps_what_is_there(short, short_run):
    seen = []
    simulate_ked(short, "++++", on_progress=seen.append)
    assert seen == sorted(seen)
    assert seen[-1] == pytest.approx(0.08)

    def stop(t):
        if t > 0.031:
            raise KeyboardInterrupt

    solution = simulate_ked(short, "++++", on_progress=stop).solution
    assert solution.status == "interrupted"
    assert "interrupted at t = 0.0" in solution.message
    assert solution.t[-1] == pytest.approx(0.032)
    np.testing.assert_array_equal(solution.q, short_run.solution.q[: solution.t.size])
    assert len(solution.multipliers) == len(solution.kinetic_energy) == solution.t.size


def test_a_pose_in_which_the_constraints_lose_rank_is_an_error(raparm):
    # Planning never lets such a motion through, so one is put in its place: it ends in the singularity of +-+-.
    rigid = raparm.rigid()
    down = plan_tracking(rigid, Line((0.0, 0.264), (0.0, 0.2), 5.0), samples=11)
    slow = PointPath(((0.0, 0.264), (0.02, 0.264)), float(down.motion.t[-1]))
    task = plan_tracking(rigid, slow, samples=11)
    task = replace(task, plan=replace(task.plan, follow=down.plan.follow))
    with pytest.raises(IntegrationError, match="1 of the constraints depend on others") as caught:
        simulate_ked(task, "+-+-", step=1e-3)
    moment, partial = caught.value.moment, caught.value.partial
    assert moment.time == pytest.approx(down.motion.t[-1], rel=0.01)
    assert partial.solution.status == "failed"
    assert partial.solution.t[-1] < moment.time
    assert partial.solution.steps == moment.step - 1


def test_what_it_cannot_describe_is_not_sent_to_an_option_that_it_refuses(short):
    """KED has no geometry to choose: `--ked` and `--geometry` exclude one another."""
    worst = simulate_ked(short, "++++").validity.worst
    assert "--geometry" not in worst.remedy
    assert "without --ked" in worst.remedy
