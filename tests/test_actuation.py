"""Inverse dynamics and allocation: efforts, modes, singularities, and torques as functions of time."""

from __future__ import annotations

from dataclasses import replace
from itertools import pairwise
from math import factorial

import numpy as np
import pytest
import scipy.optimize
from scipy.interpolate import make_interp_spline

import twins
from conftest import make_five_bar
from paraflex.actuation import actuation_condition, allocate, required_effort
from paraflex.actuation.quintic import quintic_splines
from paraflex.dynamics import build_system, constant_signals, pack_signals, piecewise_quintic
from paraflex.errors import ActuationError, InputError, SingularActuationError
from paraflex.kernel.signals import evaluate_signal
from paraflex.mechanism import (
    Assembly,
    EndEffector,
    Mechanism,
    Motor,
    PointRef,
    RevoluteJoint,
    RigidBody,
    mode_of_motors,
    mode_of_signs,
    parse_mode,
)
from paraflex.paths import Circle, Line, follow_path
from paraflex.tracking import plan_tracking

# Table 1 of the paper (published): signs of tau1, tau2, tau5, tau6.
TABLE_1 = ("+-+-", "-+-+", "+--+", "-++-", "+++-", "++-+", "+-++", "-+++", "++++")


@pytest.fixture(scope="module")
def effort(tracking):
    return tracking.effort


def kinetic_energy(system, q, v):
    return sum(twins.kinetic_energy(body.integrals, q[body.all], v[body.all]) for body in system.bodies)


def motor_speeds(system, v):
    """Turning rate of side b of each motor's joint against side a."""
    return np.array([twins.joint_angle(system, motor.joint, v) for motor in system.mechanism.motors])


# --- Efforts -------------------------------------------------------------------------------------------------------


def test_torques_of_an_arm_of_two_links_are_the_textbooks():
    # Closed form (any textbook on robots, Spong's among them); the second motor turns link 2 against link 1.
    m1, m2, l1, c1, c2, J1, J2 = 1.3, 0.9, 0.4, 0.17, 0.14, 0.02, 0.011
    arm = Mechanism(
        "arm",
        {"O": (0.0, 0.0)},
        (
            RigidBody("one", m1, J1, (c1, 0.0), {"a": (0.0, 0.0), "b": (l1, 0.0)}),
            RigidBody("two", m2, J2, (c2, 0.0), {"a": (0.0, 0.0), "b": (0.35, 0.0)}),
        ),
        (
            RevoluteJoint("shoulder", PointRef("ground", "O"), PointRef("one", "a")),
            RevoluteJoint("elbow", PointRef("one", "b"), PointRef("two", "a")),
        ),
        (Motor("t1", "shoulder"), Motor("t2", "elbow")),
        end_effector=EndEffector(PointRef("two", "b")),
        assemblies=(Assembly("down", {"one": 0.2, "two": 1.4}),),
    )
    path = Circle((0.4, 0.35), 0.1, 3.0)
    motion = follow_path(arm, path, np.linspace(0.0, path.duration, 41))
    torques = allocate(required_effort(motion), parse_mode(arm, "++"))
    (q1, q2), (w1, w2), (e1, e2) = ((x[:, 2], x[:, 5] - x[:, 2]) for x in (motion.q, motion.v, motion.a))
    M12 = m2 * (c2**2 + l1 * c2 * np.cos(q2)) + J2
    M11 = m1 * c1**2 + m2 * (l1**2 + l1 * c2 * np.cos(q2)) + J1 + M12
    M22 = m2 * c2**2 + J2
    h = -m2 * l1 * c2 * np.sin(q2)
    expected = np.column_stack([M11 * e1 + M12 * e2 + h * w2 * (2 * w1 + w2), M12 * e1 + M22 * e2 - h * w1**2])
    assert np.max(np.abs(q1)) > 0.1
    np.testing.assert_allclose(torques, expected, rtol=0, atol=1e-11 * np.max(np.abs(expected)))


@pytest.mark.parametrize("signs", TABLE_1)
def test_torques_meet_the_required_effort(effort, signs):
    mode = parse_mode(effort.motion.mechanism, signs)
    torques = allocate(effort, mode)
    active = effort.active(mode)
    assert list(active) == [sign == "+" for sign in signs]
    np.testing.assert_array_equal(torques[:, ~active], 0.0)
    # Near its singularity +-+- multiplies rounding by the condition number, a few hundred here.
    error = np.einsum("kij,kj->ki", effort.matrix, torques) - effort.required
    np.testing.assert_allclose(error, 0.0, atol=1e-12 * np.max(np.abs(effort.required)))


@pytest.mark.parametrize("signs", [signs for signs in TABLE_1 if signs.count("+") > 2])
def test_torques_have_the_least_norm(effort, signs):
    mode = parse_mode(effort.motion.mechanism, signs)
    torques = allocate(effort, mode)
    active = effort.active(mode)
    for B, tau in zip(effort.matrix[:, :, active], torques[:, active], strict=True):
        null = np.linalg.svd(B)[2][2:]
        np.testing.assert_allclose(null @ tau, 0.0, atol=1e-12 * np.max(np.abs(torques)))
    # Redundant torques are no larger than those of any mode they contain.
    for other in TABLE_1[:4]:
        if all(a == "+" or b == "-" for a, b in zip(signs, other, strict=True)):
            smaller = allocate(effort, parse_mode(effort.motion.mechanism, other))
            norms, bounds = np.linalg.norm(torques, axis=1), np.linalg.norm(smaller, axis=1)
            assert np.all(norms <= bounds * (1 + 1e-12) + 1e-14)
            assert np.max(bounds - norms) > 1e-3


@pytest.mark.parametrize("signs", TABLE_1)
def test_power_of_the_motors_is_the_rate_of_kinetic_energy(effort, signs):
    motion = effort.motion
    system = motion.system
    torques = allocate(effort, parse_mode(motion.mechanism, signs))
    power = np.array([tau @ motor_speeds(system, v) for tau, v in zip(torques, motion.v, strict=True)])
    rates = np.array(
        [
            twins.along(lambda x: kinetic_energy(system, *np.split(x, 2)), np.concatenate(state), np.concatenate(rate))
            for state, rate in zip(
                zip(motion.q, motion.v, strict=True), zip(motion.v, motion.a, strict=True), strict=True
            )
        ]
    )
    np.testing.assert_allclose(power, rates, rtol=0, atol=1e-11 * np.max(np.abs(rates)))


def test_columns_of_the_actuation_matrix_are_motor_speeds(effort):
    # B^T x' = speeds of the motors.
    motion = effort.motion
    expected = np.array([motor_speeds(motion.system, v) for v in motion.v])
    speeds = np.einsum("kij,ki->kj", effort.matrix, motion.desired.velocity)
    np.testing.assert_allclose(speeds, expected, rtol=0, atol=1e-12 * np.max(np.abs(expected)))


def test_condition_is_that_of_the_active_columns(effort):
    mode = parse_mode(effort.motion.mechanism, "+-++")
    expected = [np.linalg.cond(B[:, [0, 2, 3]]) for B in effort.matrix]
    np.testing.assert_allclose(actuation_condition(effort, mode), expected, rtol=1e-12)
    single = mode_of_signs(effort.motion.mechanism, "+---")
    assert np.all(np.isinf(actuation_condition(effort, single)))


# --- Modes ---------------------------------------------------------------------------------------------------------


def test_the_nine_modes_are_those_of_table_1(raparm):
    assert tuple(mode.name for mode in raparm.modes) == TABLE_1
    assert [motor.name for motor in raparm.motors] == ["tau1", "tau2", "tau5", "tau6"]
    # A1B1, D1E1, A2B2, D2E2 are the links on the ground of joints A1, D1, A2, D2.
    assert [raparm.joint(motor.joint).b.body for motor in raparm.motors] == ["link1", "link2", "link5", "link6"]


@pytest.mark.parametrize("text", ["+-+-", "⊕⊖⊕⊖", "+−+−", " +-+- ", "tau1,tau5", "tau5, tau1"])
def test_a_mode_by_signs_circled_signs_and_motor_names_is_the_same(tracking, text):
    mode = parse_mode(tracking.mechanism, text)
    assert (mode.name, mode.motors) == ("+-+-", ("tau1", "tau5"))
    np.testing.assert_array_equal(allocate(tracking.effort, mode), allocate(tracking.effort, tracking.mode("+-+-")))


def test_a_mode_of_motors_is_named_by_its_signs(raparm):
    assert mode_of_motors(raparm, ["tau6", "tau1"]) == mode_of_signs(raparm, "+--+")
    named = replace(raparm, modes=(replace(raparm.modes[0], name="base"),))
    assert parse_mode(named, "base").motors == ("tau1", "tau5")


@pytest.mark.parametrize("text", ["", "+-+", "+-+-+", "+-*-", "tau1,tau9", "tau1,tau1", "tau1,"])
def test_a_mode_that_is_none_is_refused(raparm, text):
    with pytest.raises(InputError) as caught:
        parse_mode(raparm, text)
    assert caught.value.field == "mode"


def test_an_unknown_motor_is_named(raparm):
    with pytest.raises(InputError, match="tau9") as caught:
        mode_of_motors(raparm, ["tau1", "tau9"])
    assert "tau1, tau2, tau5, tau6" in caught.value.remedy


@pytest.mark.parametrize("text", ["", "link1", "link1.", ".B1", "."])
def test_a_point_that_is_none_is_refused(text):
    with pytest.raises(InputError) as caught:
        PointRef.parse(text, "joint.B1")
    assert caught.value.field == "joint.B1"


def test_a_point_reads_as_it_is_written():
    ref = PointRef.parse("link1.B1")
    assert ref == PointRef("link1", "B1")
    assert str(ref) == "link1.B1"
    assert not ref.on_ground
    assert PointRef.parse("ground.A1").on_ground


@pytest.mark.parametrize("signs", ["----", "+---", "---+"])
def test_too_few_motors_cannot_drive(tracking, signs):
    mode = mode_of_signs(tracking.mechanism, signs)
    for attempt in (lambda: allocate(tracking.effort, mode), lambda: tracking.torques(mode)):
        with pytest.raises(ActuationError, match=f"{signs.count('+')} active") as caught:
            attempt()
        assert not isinstance(caught.value, SingularActuationError)


def test_two_motors_on_one_joint_never_reach_every_direction():
    five_bar = make_five_bar()
    twice = replace(five_bar, motors=(Motor("left", "A1"), Motor("again", "A1")))
    motion = follow_path(twice, Line((0.0, 0.35), (0.05, 0.3), 5.0), np.linspace(0.0, 0.1, 5))
    with pytest.raises(
        ActuationError, match="nowhere on the path do its motors control all 2 degrees of freedom; choose"
    ) as caught:
        allocate(required_effort(motion), parse_mode(twice, "++"))
    assert not isinstance(caught.value, SingularActuationError)


# --- Type II singularities -----------------------------------------------------------------------------------------

DOWN = Line((0.0, 0.264), (0.0, -0.06), 5.0)
ASKEW = Line((0.05, 0.264), (-0.04, -0.06), 5.0)


def free_links(signs):
    """The links of the two arms that the motors leave free: the singular position has them parallel."""
    return tuple(1 if sign == "+" else 0 for sign in (signs[0], signs[2]))


def first_singular(path, signs):
    """Time at which the free links first are parallel, from the closed form: (time, position)."""
    left, right = free_links(signs)

    def parallel(t):
        state = [x[0] for x in path.evaluate(t)]
        one, two = (
            twins.arm(base, *state, side)[0, k]
            for base, side, k in zip(twins.BASES, (1, -1), (left, right), strict=True)
        )
        return np.sin(one - two)

    times = np.linspace(0.0, path.duration, 400)
    signs_of = np.sign([parallel(t) for t in times])
    k = int(np.argmax(signs_of[1:] != signs_of[:-1]))
    root = scipy.optimize.brentq(parallel, times[k], times[k + 1], xtol=1e-14)
    return root, path.evaluate(root).position[0]


@pytest.mark.parametrize(
    ("signs", "height"),
    [
        # On the axis of symmetry the free links are parallel where both lie level (links 4 and 8, B_i beside C) or
        # upright (links 1 and 5, B_i above A_i), and mixed ones at the height of the base.
        ("+-+-", np.sqrt(0.25**2 - (0.25 - 0.1) ** 2)),
        ("-+-+", 0.25 - np.sqrt(0.25**2 - 0.1**2)),
        ("+--+", 0.0),
        ("-++-", 0.0),
    ],
)
def test_singular_positions_on_the_axis_are_where_geometry_has_them(signs, height):
    np.testing.assert_allclose(first_singular(DOWN, signs)[1], [0.0, height], rtol=0, atol=1e-12)


def check_singular(error, path, root, spacing):
    """Found at the first instant of a grid behind the root."""
    moment = error.moment
    assert root < moment.time <= root + spacing * (1 + 1e-9)
    np.testing.assert_allclose(moment.position, path.evaluate(moment.time).position[0], rtol=0, atol=1e-14)
    assert f"{moment.time:.6g} s" in str(error)


@pytest.mark.parametrize("path", [DOWN, ASKEW], ids=["axis", "askew"])
@pytest.mark.parametrize("signs", TABLE_1[:4])
def test_a_singularity_on_the_path_is_found_where_the_free_links_are_parallel(raparm, path, signs):
    task = plan_tracking(raparm, path, samples=251)
    root, _ = first_singular(path, signs)
    spacing = task.motion.t[1]
    with pytest.raises(SingularActuationError) as caught:
        allocate(task.effort, task.mode(signs))
    check_singular(caught.value, path, root, spacing)
    assert caught.value.moment.step == np.searchsorted(task.motion.t, root)
    assert signs in str(caught.value)
    # The feed-forward has a grid of its own, 2 ms at most.
    with pytest.raises(SingularActuationError) as caught:
        task.torques(signs)
    check_singular(caught.value, path, root, 2e-3)


def test_a_traditional_five_bar_is_singular_where_its_distal_links_are_in_line():
    five_bar = make_five_bar()
    times = np.linspace(0.0, DOWN.duration, 2001)
    effort = required_effort(follow_path(five_bar, DOWN, times))
    with pytest.raises(SingularActuationError) as caught:
        allocate(effort, parse_mode(five_bar, "left,right"))
    root, _ = first_singular(DOWN, "+-+-")
    check_singular(caught.value, DOWN, root, times[1])
    # Before it all is well.
    before = times[times < root - 1e-3]
    allocate(required_effort(follow_path(five_bar, DOWN, before)), parse_mode(five_bar, "left,right"))


@pytest.mark.parametrize("signs", ["+++-", "++++"])
def test_redundant_modes_pass_the_singularities_of_others(raparm, signs):
    task = plan_tracking(raparm, DOWN, samples=101)
    torques = allocate(task.effort, task.mode(signs))
    error = np.einsum("kij,kj->ki", task.effort.matrix, torques) - task.effort.required
    np.testing.assert_allclose(error, 0.0, atol=1e-12 * np.max(np.abs(task.effort.required)))
    assert np.max(actuation_condition(task.effort, task.mode(signs))) < 100.0


def test_condition_is_large_near_a_singularity(raparm):
    root, _ = first_singular(DOWN, "+-+-")
    effort = required_effort(follow_path(raparm, DOWN, [root - 0.1, root - 1e-6]))
    far, near = actuation_condition(effort, parse_mode(raparm, "+-+-"))
    # A micrometre away with links of a quarter of a metre.
    assert near > 1e4
    assert far < 10.0


# --- Torques in time -----------------------------------------------------------------------------------------------


def test_quintic_splines_are_those_of_scipy():
    """Each by itself, the shortest possible among them; unevenly spaced, where the ends have no knots."""
    generator, sizes = np.random.default_rng(5), np.array([6, 7, 12, 40])
    x = np.cumsum(generator.uniform(0.5, 1.5, sizes.sum()))
    y = generator.standard_normal((x.size, 3))
    starts, coefficients = quintic_splines(x, y, sizes)
    for end, size in zip(np.cumsum(sizes), sizes, strict=True):
        spline = make_interp_spline(x[end - size : end], y[end - size : end], k=5)
        places = np.unique(spline.t)[:-1]
        first = np.searchsorted(starts, places[0])
        np.testing.assert_array_equal(starts[first : first + places.size], places)
        for order, found in enumerate(coefficients[:, first : first + places.size]):
            expected = spline(places, order) / factorial(order)
            # Rounding, times the condition of the equations for the basis.
            np.testing.assert_allclose(found, expected, rtol=0.0, atol=1e-12 * np.max(np.abs(expected)))


@pytest.mark.parametrize("signs", TABLE_1)
def test_the_feed_forward_is_exact_between_its_points(raparm, square, tracking, signs):
    torques = tracking.torques(signs)
    times = np.sort(np.random.default_rng(61).uniform(0.0, 0.7, 300))
    exact = allocate(required_effort(follow_path(raparm, square, times)), torques.mode)
    peak = np.max(np.abs(exact))
    assert peak > 1.0
    np.testing.assert_allclose(torques.evaluate(times), exact, rtol=0, atol=1e-7 * peak)
    # Passive motors give none, and nothing is left to do in the dwell.
    assert all(np.all(s.coefficients == 0.0) for s, sign in zip(torques.signals, signs, strict=True) if sign == "-")
    np.testing.assert_allclose(torques.evaluate(np.array([0.55, 0.6, 0.7])), 0.0, atol=1e-7 * peak)


def test_the_feed_forward_is_refined_where_torques_are_steep(raparm):
    # Stopping 0.1 mm short of the singularity of +-+-: the first grid alone leaves 2e-7 of the peak, 550 N m.
    path = Line((0.0, 0.264), (0.0, 0.2001), 5.0)
    torques = plan_tracking(raparm, path, samples=11).torques("+-+-")
    times = np.sort(np.random.default_rng(63).uniform(0.0, path.duration, 400))
    exact = allocate(required_effort(follow_path(raparm, path, times)), torques.mode)
    # What the plan promises: 1e-8 of the peak.
    np.testing.assert_allclose(torques.evaluate(times), exact, rtol=0, atol=1e-8 * np.max(np.abs(exact)))


def test_work_of_the_feed_forward_is_the_kinetic_energy_gained(raparm, square, tracking):
    # Twenty Gauss points between neighbouring knots of the path.
    torques = tracking.torques("++++")
    z, w = np.polynomial.legendre.leggauss(20)
    for a, b in pairwise(square.knots[:4]):
        inside = a + (b - a) * (1 + z) / 2
        motion = follow_path(raparm, square, np.concatenate([[a], inside, [b]]))
        speeds = np.array([motor_speeds(motion.system, v) for v in motion.v[1:-1]])
        work = (b - a) / 2 * w @ np.sum(torques.evaluate(inside) * speeds, axis=1)
        start, end = (kinetic_energy(motion.system, motion.q[k], motion.v[k]) for k in (0, -1))
        # Torques to 1e-8 of their peak, as the plan asks for; energies are some joules.
        assert work == pytest.approx(end - start, abs=1e-7)


def test_kernels_read_the_torques_as_they_are(raparm, tracking):
    torques = tracking.torques("+++-")
    signals, _ = pack_signals(raparm, torques.signals, 0.7)
    times = np.linspace(0.0, 0.7, 501)
    found = [[evaluate_signal(signals, k, t)[0] for k in range(signals.start.size - 1)] for t in times]
    np.testing.assert_allclose(found, torques.evaluate(times), rtol=0, atol=1e-13)


def test_signals_are_quintics_with_two_derivatives():
    # Hermite pieces reproduce a quintic whatever their lengths; the first two derivatives are the kernel's.
    p = np.polynomial.Polynomial(np.random.default_rng(62).normal(size=6))
    breaks = np.array([0.0, 0.3, 0.4, 1.0])
    quintic = piecewise_quintic(breaks, p(breaks), p.deriv(1)(breaks), p.deriv(2)(breaks))
    arm = make_five_bar()
    signals, knots = pack_signals(arm, [*constant_signals([4.0], 1.0), quintic], 1.0)
    assert knots == []
    for t in (0.0, 0.1, 0.3, 0.35, 0.4, 0.9, 1.0):
        # Second derivatives divide rounding by the square of the shortest piece.
        np.testing.assert_allclose(
            evaluate_signal(signals, 1, t), [p(t), p.deriv(1)(t), p.deriv(2)(t)], rtol=0, atol=1e-11
        )
        assert evaluate_signal(signals, 0, t) == (4.0, 0.0, 0.0)


def test_the_rigid_motion_of_a_task_is_that_of_the_rigid_mechanism(raparm, tracking):
    assert tracking.motion.system.n_flexible == 0
    assert tracking.system.n_flexible == 80
    assert build_system(raparm).total_mass == pytest.approx(tracking.motion.system.total_mass, rel=1e-14)
