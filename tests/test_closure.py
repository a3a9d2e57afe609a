"""Closure along a path against closed-form inverse kinematics: RAParM-I, a four-bar, an arm of three links."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
import scipy.optimize

import paraflex as pf
import twins
from conftest import SQUARE
from paraflex.errors import AssemblyError, InputError, UnreachablePathError
from paraflex.mechanism import (
    Assembly,
    EndEffector,
    Mechanism,
    Motor,
    PointRef,
    PrescribedAngle,
    RevoluteJoint,
    RigidBody,
    SampledAngle,
)
from paraflex.paths import Circle, Line, Polygon, TrapezoidalProfile, follow_path, pose_at

# Both links of an arm of RAParM-I, stretched [m].
REACH = twins.L1 + twins.L2


# --- RAParM-I in closed form ---------------------------------------------------------------------------------------


def test_the_closed_form_has_the_derivatives_it_claims():
    rng = np.random.default_rng(51)
    C, dC, ddC = np.array([0.03, 0.28]), *rng.normal(size=(2, 2))

    def elbows_of(C):
        return np.concatenate([twins.elbow(base, C, side) for base, side in zip(twins.BASES, (1, -1), strict=True)])

    q, v, a = twins.raparm_coordinates(C, dC, ddC, (1, -1))
    # Origins of links 4 and 8 are the elbows.
    B = [9, 10, 21, 22]
    np.testing.assert_allclose(q[B], elbows_of(C), rtol=1e-14)
    np.testing.assert_allclose(v[B], twins.along(elbows_of, C, dC), rtol=1e-12)
    # Accelerations: the derivative of the velocities along the motion, by central differences, h^2 = 1e-10.
    h = 1e-5
    ahead, behind = (
        twins.raparm_coordinates(C + k * dC + k * k / 2 * ddC, dC + k * ddC, ddC, (1, -1))[1] for k in (h, -h)
    )
    np.testing.assert_allclose(a, (ahead - behind) / (2 * h), rtol=0, atol=1e-7 * np.max(np.abs(a)))


@pytest.mark.parametrize("assembly", list(twins.ELBOWS))
def test_raparm_follows_the_square_as_in_closed_form(raparm, square, assembly):
    times = np.linspace(0.0, 0.6, 97)
    motion = follow_path(raparm, square, times, assembly=assembly)
    np.testing.assert_array_equal(motion.t, times)
    desired = square.evaluate(times)
    expected = np.array(
        [twins.raparm_coordinates(*state, twins.ELBOWS[assembly]) for state in zip(*desired, strict=True)]
    )
    # Coordinates of position are far below pi: wrapping is for the angles.
    error = twins.wrapped(motion.q - expected[:, 0])
    # Newton stops at moves of 1e-13; velocities and accelerations carry that times the condition of the Jacobian, which
    # multiplies their own sizes.
    np.testing.assert_allclose(error, 0.0, atol=1e-12)
    for found, exact in ((motion.v, expected[:, 1]), (motion.a, expected[:, 2])):
        np.testing.assert_allclose(found, exact, rtol=0, atol=1e-11 * np.max(np.abs(exact)))
    np.testing.assert_array_equal(motion.desired.position, desired.position)


@pytest.mark.parametrize("assembly", list(twins.ELBOWS))
@pytest.mark.parametrize(
    "path",
    [Line((-0.2, 0.3), (0.2, 0.3), 20.0), Line((0.0, 0.4), (0.0, 0.05), 20.0), Circle((0.0, 0.25), 0.15, 30.0)],
    ids=["across", "down", "round"],
)
def test_the_assembly_stays_the_same_all_along_the_path(raparm, path, assembly):
    # Few and many samples: the walk between them is fine enough on its own. Type II singularities, which the line down
    # passes, are no matter of kinematics.
    for samples in (3, 200):
        times = np.linspace(0.0, path.duration, samples)
        motion = follow_path(raparm, path, times, assembly=assembly)
        desired = path.evaluate(times)
        for k, C in enumerate(desired.position):
            for base, side, link in zip(twins.BASES, twins.ELBOWS[assembly], ("link4", "link8"), strict=True):
                B = motion.q[k, motion.system.body(link).position]
                np.testing.assert_allclose(B, twins.elbow(base, C, side), rtol=0, atol=1e-12)


def test_a_path_through_a_type_i_singularity_is_refused(raparm):
    # C passes over A1, where arm 1 is folded and may leave with its elbow on either side.
    path = Line((-0.3, 0.0), (0.09, 0.0), 5.0)
    with pytest.raises(UnreachablePathError):
        follow_path(raparm, path, np.linspace(0.0, path.duration, 201))


def test_basis_spans_the_null_space_of_the_constraints_in_task_coordinates(tracking):
    motion = tracking.motion
    system, C = motion.system, motion.mechanism.end_effector.point
    body, marker = system.body(C.body), system.marker(C)
    for k in (0, 40, 77):
        np.testing.assert_allclose(twins.constraint_jacobian(system, motion.q[k]) @ motion.basis[k], 0.0, atol=1e-12)
        task = twins.point_jacobian(marker, motion.q[k][body.all]) @ motion.basis[k][body.all]
        np.testing.assert_allclose(task, np.eye(2), rtol=0, atol=1e-12)
        np.testing.assert_allclose(motion.basis[k] @ motion.desired.velocity[k], motion.v[k], rtol=0, atol=1e-10)


def test_one_time_is_enough(raparm, square):
    motion = follow_path(raparm, square, [0.3])
    expected = twins.raparm_coordinates(*(x[0] for x in square.evaluate(0.3)), twins.ELBOWS["outward"])
    np.testing.assert_allclose(twins.wrapped(motion.q[0] - expected[0]), 0.0, atol=1e-12)


# --- A four-bar ----------------------------------------------------------------------------------------------------

CRANK, COUPLER, ROCKER, GROUND = 0.1, 0.3, 0.25, 0.32
TRACER = np.array([0.2, 0.12])


def four_bar(coordinates):
    """Crank, coupler and rocker; the crank at the origin, the rocker at (GROUND, 0)."""

    def bar(name, length, **points):
        return RigidBody(name, 1.0, 0.01, (length / 2, 0.0), {"a": (0.0, 0.0), "b": (length, 0.0), **points})

    return Mechanism(
        "four-bar",
        {"O": (0.0, 0.0), "D": (GROUND, 0.0)},
        (bar("crank", CRANK), bar("coupler", COUPLER, tracer=tuple(TRACER)), bar("rocker", ROCKER)),
        (
            RevoluteJoint("O", PointRef("ground", "O"), PointRef("crank", "a")),
            RevoluteJoint("A", PointRef("crank", "b"), PointRef("coupler", "a")),
            RevoluteJoint("B", PointRef("coupler", "b"), PointRef("rocker", "b")),
            RevoluteJoint("D", PointRef("ground", "D"), PointRef("rocker", "a")),
        ),
        end_effector=EndEffector(PointRef("coupler", "tracer"), coordinates),
        assemblies=(Assembly("open", {"crank": 1.2, "coupler": 0.5, "rocker": 1.9}),),
    )


def four_bar_angles(crank):
    """Angles of crank, coupler and rocker in the open assembly: B on the circles about A and D, on the left of A D."""
    A, D = CRANK * twins.unit(crank), np.array([GROUND, 0.0])
    d = D - A
    along = (COUPLER**2 - ROCKER**2 + d @ d) / (2 * d @ d)
    B = A + along * d + np.sqrt(COUPLER**2 / (d @ d) - along**2) * (twins.E @ d)
    return np.array([crank, np.arctan2(*(B - A)[::-1]), np.arctan2(*(B - D)[::-1])])


def turning_ratios(angles):
    """Rates of all three per rate of the crank (textbook)."""
    th2, th3, th4 = angles
    return np.array(
        [
            1.0 + 0 * th2,
            -CRANK * np.sin(th2 - th4) / (COUPLER * np.sin(th3 - th4)),
            CRANK * np.sin(th2 - th3) / (ROCKER * np.sin(th4 - th3)),
        ]
    )


def tracer_slope(angles):
    """dx/d(crank) of the tracer."""
    return (
        -CRANK * np.sin(angles[0])
        - (TRACER[0] * np.sin(angles[1]) + TRACER[1] * np.cos(angles[1])) * turning_ratios(angles)[1]
    )


def tracer_x(crank):
    angles = four_bar_angles(crank)
    return CRANK * np.cos(crank) + (twins.rotation(angles[1]) @ TRACER)[0]


def test_a_four_bar_whose_tracer_has_its_x_prescribed():
    start, end = tracer_x(1.0), tracer_x(2.4)
    path = Line((start, 0.0), (end, 0.0), 2.0)
    times = np.linspace(0.0, path.duration, 41)
    motion = follow_path(four_bar(("x",)), path, times)
    turning = [motion.system.body(name).angle for name in ("crank", "coupler", "rocker")]
    desired = path.evaluate(times)
    for k in range(times.size):
        x, dx, ddx = (value[k, 0] for value in desired)
        crank = scipy.optimize.brentq(lambda crank, x=x: tracer_x(crank) - x, 0.9, 2.5, xtol=1e-15)
        angles = four_bar_angles(crank)
        slope, ratios = tracer_slope(angles), turning_ratios(angles)
        rates = ratios * dx / slope
        # x'' = slope crank'' + slope' crank', and so for the other two.
        rate2 = (ddx - twins.along(tracer_slope, angles, rates) * rates[0]) / slope
        expected = ratios * rate2 + twins.along(turning_ratios, angles, rates) * rates[0]
        np.testing.assert_allclose(motion.q[k, turning], angles, rtol=0, atol=1e-12)
        np.testing.assert_allclose(motion.v[k, turning], rates, rtol=0, atol=1e-11)
        # Accelerations of 1e2 rad/s^2 at rates of 10 rad/s.
        np.testing.assert_allclose(motion.a[k, turning], expected, rtol=0, atol=1e-10)


@pytest.mark.parametrize("angle", [0.52, 0.7])
def test_a_four_bar_held_at_an_angle_of_its_coupler(angle):
    motion = follow_path(four_bar(("angle",)), Line((0, 0), (1, 0), 1.0), [0.0, 0.5], orientation=angle)
    # A is on the circle about O, and B = A + b e(angle) on that about D: two solutions, of which the crank is at one.
    centre = np.array([GROUND, 0.0]) - COUPLER * twins.unit(angle)
    reach = (CRANK**2 - ROCKER**2 + centre @ centre) / (2 * centre @ centre)
    across = np.sqrt(CRANK**2 / (centre @ centre) - reach**2)
    candidates = [reach * centre + side * across * (twins.E @ centre) for side in (1, -1)]
    cranks = [np.arctan2(A[1], A[0]) for A in candidates]
    crank = motion.q[0, motion.system.body("crank").angle]
    assert min(abs(twins.wrapped(crank - other)) for other in cranks) < 1e-12
    np.testing.assert_allclose(
        motion.q[0, [motion.system.body(name).angle for name in ("coupler", "rocker")]],
        [angle, four_bar_angles(crank)[2]],
        rtol=0,
        atol=1e-12,
    )
    np.testing.assert_allclose(motion.q[1], motion.q[0], rtol=0, atol=1e-12)
    np.testing.assert_allclose(motion.v, 0.0, atol=1e-12)


# --- An arm of three links -----------------------------------------------------------------------------------------


def test_an_arm_of_three_links_carries_its_tool_upright():
    # Task of three coordinates: closed form of the wrist point, two links of 0.4 and 0.3 m, the tool 0.1 m.
    lengths = {"upper": 0.4, "lower": 0.3, "tool": 0.1}
    bodies = tuple(
        RigidBody(name, 1.0, 0.01, (length / 2, 0.0), {"a": (0.0, 0.0), "b": (length, 0.0)})
        for name, length in lengths.items()
    )
    joints = (
        RevoluteJoint("O", PointRef("ground", "O"), PointRef("upper", "a")),
        RevoluteJoint("E", PointRef("upper", "b"), PointRef("lower", "a")),
        RevoluteJoint("W", PointRef("lower", "b"), PointRef("tool", "a")),
    )
    arm3 = Mechanism(
        "arm",
        {"O": (0.0, 0.0)},
        bodies,
        joints,
        end_effector=EndEffector(PointRef("tool", "b"), ("x", "y", "angle")),
        assemblies=(Assembly("down", {"upper": 0.2, "lower": 1.2, "tool": 1.5}),),
    )
    path = Polygon(((0.3, 0.4), (0.45, 0.35), (0.4, 0.5)), 5.0)
    times = np.linspace(0.0, path.duration, 31)
    motion = follow_path(arm3, path, times, orientation=1.3)
    for k, tip in enumerate(path.evaluate(times).position):
        W = tip - 0.1 * twins.unit(1.3)
        D = np.hypot(*W)
        upper = np.arctan2(W[1], W[0]) - np.arccos((0.4**2 + D**2 - 0.3**2) / (2 * 0.4 * D))
        lower = np.arctan2(*(W - 0.4 * twins.unit(upper))[::-1])
        np.testing.assert_allclose(motion.q[k, [2, 5, 8]], [upper, lower, 1.3], rtol=0, atol=1e-12)


def test_a_joint_driven_in_time_moves_the_rest_along():
    # Two links: the first turned by a law, the tip at a given height; th2 = asin((y - l1 sin th1)/l2).
    l1, l2 = 0.4, 0.3
    law = SampledAngle(
        lambda t: 0.6 + 0.4 * np.sin(9 * t), lambda t: 3.6 * np.cos(9 * t), lambda t: -32.4 * np.sin(9 * t)
    )
    arm2 = Mechanism(
        "arm",
        {"O": (0.1, 0.0)},
        tuple(
            RigidBody(name, 1.0, 0.01, (0.1, 0.0), {"a": (0.0, 0.0), "b": (length, 0.0)})
            for name, length in (("upper", l1), ("lower", l2))
        ),
        (
            RevoluteJoint("O", PointRef("ground", "O"), PointRef("upper", "a")),
            RevoluteJoint("E", PointRef("upper", "b"), PointRef("lower", "a")),
        ),
        prescribed=(PrescribedAngle("drive", "O", law),),
        end_effector=EndEffector(PointRef("lower", "b"), ("y",)),
        assemblies=(Assembly("right", {"upper": 0.6, "lower": 0.2}),),
    )
    path = Line((0.0, 0.25), (0.0, 0.4), 2.0)
    times = np.linspace(0.0, path.duration, 21)
    motion = follow_path(arm2, path, times)
    for k, (y, dy, ddy) in enumerate(np.array(path.evaluate(times))[:, :, 1].T):
        th1, w1, e1 = law.evaluate(times[k])
        th2 = np.arcsin((y - l1 * np.sin(th1)) / l2)
        w2 = (dy - l1 * np.cos(th1) * w1) / (l2 * np.cos(th2))
        e2 = (ddy - l1 * (np.cos(th1) * e1 - np.sin(th1) * w1**2) + l2 * np.sin(th2) * w2**2) / (l2 * np.cos(th2))
        # The law reaches the solver as quintic pieces that take their one-sided limits 1e-12 of the run inside
        # its ends: 4 rad/s times that. Derivatives have rounding errors of 1e-16/h^2, h some 5e-4 s.
        np.testing.assert_allclose(motion.q[k, [2, 5]], [th1, th2], rtol=0, atol=2e-11)
        np.testing.assert_allclose(motion.v[k, [2, 5]], [w1, w2], rtol=0, atol=1e-10)
        np.testing.assert_allclose(motion.a[k, [2, 5]], [e1, e2], rtol=0, atol=1e-7)


# --- Errors --------------------------------------------------------------------------------------------------------


@pytest.mark.parametrize("end", [(0.0, 0.6), (0.05, 0.6), (-0.35, 0.45)])
def test_a_path_out_of_reach_says_when_and_where_and_keeps_what_was_reached(raparm, end):
    start = np.array([0.0, 0.3])
    path = Line(start, end, 5.0)
    times = np.linspace(0.0, path.duration, 201)
    with pytest.raises(UnreachablePathError) as caught:
        follow_path(raparm, path, times)
    # C is as far from one of the bases as its arm is long, found on the path without the code.
    direction = np.array(end) - start
    s = np.linspace(0.0, 1.0, 2001)
    far = np.max([np.linalg.norm(start + s[:, None] * direction - base, axis=1) for base in twins.BASES], axis=0)
    first = int(np.argmax(far > REACH))
    reach = s[first - 1] + (REACH - far[first - 1]) / (far[first] - far[first - 1]) * (s[1] - s[0])
    law = TrapezoidalProfile(float(np.linalg.norm(direction)), 5.0)
    limit = scipy.optimize.brentq(lambda t: law.evaluate(np.array([t]))[0][0] / law.length - reach, 0, law.duration)
    moment, partial = caught.value.moment, caught.value.partial
    # The walk notices at its first point beyond, and takes a millisecond at most between two; linear interpolation of
    # the distance is good to 1e-6 of the path.
    assert limit - 1e-5 < moment.time < limit + 1e-3 + 1e-5
    np.testing.assert_allclose(moment.position, path.evaluate(moment.time).position[0], rtol=0, atol=1e-14)
    for piece in (f"{moment.time:.6g} s", "out of reach", f"{moment.position[1]:.4g}"):
        assert piece in str(caught.value)
    # All samples before are kept, and closed.
    np.testing.assert_array_equal(partial.t, times[times < moment.time])
    k = partial.t.size - 1
    expected = twins.raparm_coordinates(*(x[k] for x in partial.desired), twins.ELBOWS["outward"])
    np.testing.assert_allclose(twins.wrapped(partial.q[k] - expected[0]), 0.0, atol=1e-11)


def test_a_path_that_starts_out_of_reach_says_so(raparm):
    with pytest.raises(UnreachablePathError, match="start is out of reach") as caught:
        follow_path(raparm, Line((0.0, 0.55), (0.0, 0.3), 5.0), [0.0, 0.1])
    assert caught.value.moment.time == 0.0
    assert caught.value.moment.position == (0.0, 0.55)


@pytest.mark.parametrize("coordinates", [("x",), ("angle",), ("x", "y", "angle")])
def test_as_many_task_coordinates_as_degrees_of_freedom(raparm, square, coordinates):
    wrong = replace(raparm, end_effector=replace(raparm.end_effector, coordinates=coordinates))
    with pytest.raises(InputError, match="2 degrees of freedom") as caught:
        follow_path(wrong, square, [0.0, 0.1])
    assert caught.value.field == "end_effector.coordinates"


def test_a_path_needs_an_end_effector_and_a_known_assembly(raparm, square):
    with pytest.raises(InputError) as caught:
        follow_path(replace(raparm, end_effector=None), square, [0.0, 0.1])
    assert caught.value.field == "end_effector"
    with pytest.raises(InputError, match="outward, inward, left, right") as caught:
        follow_path(raparm, square, [0.0, 0.1], assembly="upward")
    assert caught.value.field == "assembly"


def test_an_assembly_that_cannot_close_says_which_joint_is_open():
    # A rocker that cannot reach: 0.1 + 0.3 + 0.25 m of links over 0.8 m.
    wide = replace(four_bar(("x",)), ground={"O": (0.0, 0.0), "D": (0.8, 0.0)})
    # Stretched out, put together from the ground on, all of what is missing is open at the joint that closes the loop.
    with pytest.raises(AssemblyError, match=r"do not close: a gap of 0\.15 m remains in D at"):
        follow_path(wide, Line((0.0, 0.0), (0.1, 0.0), 1.0), [0.0])


def test_the_square_is_the_one_of_the_paper(square):
    np.testing.assert_array_equal(square.corners, SQUARE)


def test_what_is_held_twice_is_counted_once():
    """A parallelogram with a third crank between its two moves, though constraints are as many as coordinates."""
    cranks = [RigidBody(f"crank{k}", 0.1, 1e-4, points={"A": (0.0, 0.0), "B": (0.1, 0.0)}) for k in range(3)]
    rail = RigidBody("rail", 0.1, 1e-4, points={f"B{k}": (0.1 * k, 0.0) for k in range(3)})
    joints = [
        RevoluteJoint(f"{side}{k}", PointRef(*low), PointRef(*high))
        for k in range(3)
        for side, low, high in (
            ("A", ("ground", f"A{k}"), (f"crank{k}", "A")), ("B", (f"crank{k}", "B"), ("rail", f"B{k}")),
        )
    ]  # fmt: skip
    mechanism = Mechanism(
        "parallelogram",
        {f"A{k}": (0.1 * k, 0.0) for k in range(3)},
        (*cranks, rail),
        tuple(joints),
        motors=(Motor("tau", "A0"),),
        end_effector=EndEffector(PointRef("rail", "B0"), ("x",)),
        assemblies=(Assembly("up", {**{f"crank{k}": 1.0 for k in range(3)}, "rail": 0.0}),),
    )
    start = (0.1 * np.cos(1.0), 0.1 * np.sin(1.0))
    line, times = Line(start, (0.06, start[1]), 1.0), [0.0, 0.05, 0.1]
    motion = follow_path(mechanism, line, times)
    angles = np.arccos(line.evaluate(np.array(times)).position[:, 0] / 0.1)
    np.testing.assert_allclose(motion.q[:, 2::3], np.outer(angles, [1.0, 1.0, 1.0, 0.0]), atol=1e-12)
    both = replace(mechanism, end_effector=EndEffector(PointRef("rail", "B0"), ("x", "y")))
    with pytest.raises(InputError, match="has 1 degrees of"):
        follow_path(both, line, times)


def test_a_pose_at_a_position_is_that_at_the_start_of_a_path():
    model = pf.load("five_bar")
    place = tuple(model.path().evaluate(np.array([0.0])).position[0])
    pose = pose_at(model.mechanism, place)
    assert pose == pytest.approx(follow_path(model.mechanism, model.path(), [0.0]).q[0], abs=1e-9)
    with pytest.raises(UnreachablePathError, match="out of reach"):
        pose_at(model.mechanism, (5.0, 0.0))
