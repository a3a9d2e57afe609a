"""Paths: the profile of section 6, derivatives that belong together, and rest where there should be rest."""

from __future__ import annotations

from itertools import pairwise
from math import pi, sqrt

import numpy as np
import pytest

from paraflex.arguments import with_fields
from paraflex.errors import InputError
from paraflex.paths import (
    Circle,
    CruiseProfile,
    Line,
    Path,
    PointPath,
    Polygon,
    SequencePath,
    TabulatedPath,
    TrapezoidalProfile,
)

WAVE = tuple((0.05 * k, 0.1 * float(np.sin(0.9 * k))) for k in range(9))
PATHS = {
    "square": Polygon(((0.05, 0.314), (-0.05, 0.314), (-0.05, 0.214), (0.05, 0.214)), 40.0),
    "open polygon": Polygon(((0.0, 0.0), (0.3, 0.1), (0.1, 0.4)), 7.0, closed=False),
    "line": Line((0.1, -0.2), (-0.4, 0.5), 3.0),
    "circle": Circle((0.2, 0.3), 0.15, 5.0),
    "arc": Circle((0.2, 0.3), 0.15, 5.0, start_angle=1.1, sweep=-2.5),
    "points": PointPath(((0.0, 0.0), (0.1, 0.2), (0.3, 0.1), (0.35, -0.2), (0.5, 0.0)), 0.8),
    "two points": PointPath(((0.1, 0.2), (0.4, -0.3)), 0.5),
    "sequence": SequencePath((Line((0.1, 0.2), (0.4, -0.3), 3.0), Circle((0.3, -0.3), 0.1, 5.0, sweep=1.0)), 0.1),
}

# Of a spline of fifth degree: the third derivative of the acceleration jumps at every point.
TABLES = {
    "acceleration": TabulatedPath(WAVE, max_acceleration=4.0),
    "time": TabulatedPath(WAVE[:5], motion_time=0.7),
    "speed": TabulatedPath(WAVE, max_acceleration=20.0, max_speed=0.4),
    "times": TabulatedPath(WAVE, times=tuple(1.0 + 0.1 * k + 0.002 * k**2 for k in range(len(WAVE)))),
}


@pytest.fixture(scope="module", params=list(PATHS))
def path(request):
    return PATHS[request.param]


# --- The profile ------------------------------------------------------------------------------------------------


@pytest.mark.parametrize(("length", "max_acceleration"), [(0.1, 40.0), (2.0, 0.3)])
def test_profile_covers_its_length_in_three_halves_of_a_period(length, max_acceleration):
    profile = TrapezoidalProfile(length, max_acceleration)
    T = sqrt(pi * length / max_acceleration)
    assert profile.duration == pytest.approx(1.5 * T, rel=1e-15)
    assert profile.knots == pytest.approx((0.0, T / 2, T, 1.5 * T), rel=1e-15)
    # Eq. 63 as corrected: length a_max T^2/pi, cruise speed a_max T/pi.
    assert max_acceleration * T**2 / pi == pytest.approx(length, rel=1e-14)
    s, speed, rate = profile.evaluate(np.array([0.0, T / 4, T / 2, 0.7 * T, T, 1.25 * T, 1.5 * T]))
    cruise = max_acceleration * T / pi
    rising = max_acceleration * T / (2 * pi)
    np.testing.assert_allclose(speed, [0, rising, cruise, cruise, cruise, rising, 0], rtol=0, atol=1e-14 * cruise)
    np.testing.assert_allclose(
        rate, [0, max_acceleration, 0, 0, 0, -max_acceleration, 0], rtol=0, atol=1e-14 * max_acceleration
    )
    # Half of the period at the mean of rest and cruise speed covers a quarter of the length.
    np.testing.assert_allclose(s[[0, 2, 4, 6]], [0.0, length / 4, 3 * length / 4, length], rtol=0, atol=1e-14 * length)


def test_acceleration_of_the_profile_is_the_sine_of_equation_62():
    profile = TrapezoidalProfile(0.1, 40.0)
    T = profile.period
    t = np.linspace(0.0, 1.5 * T, 31)
    sine = 40.0 * np.sin(2 * pi * t / T)
    expected = np.where(t < T / 2, sine, np.where(t < T, 0.0, -sine))
    np.testing.assert_allclose(profile.evaluate(t)[2], expected, rtol=0, atol=1e-13 * 40.0)


def test_the_papers_square_takes_0_532_seconds():
    square = PATHS["square"]
    # Published: 0.532 s. Exactly: four sides of 0.1 m at 40 m/s^2.
    assert square.duration == pytest.approx(0.532, abs=5e-4)
    assert square.duration == pytest.approx(4 * 1.5 * sqrt(pi * 0.1 / 40.0), rel=1e-14)
    side = square.duration / 4
    corners = [(0.05, 0.314), (-0.05, 0.314), (-0.05, 0.214), (0.05, 0.214), (0.05, 0.314)]
    found = square.evaluate(np.arange(5) * side)
    np.testing.assert_allclose(found.position, corners, rtol=0, atol=1e-15)
    np.testing.assert_allclose(found.velocity, 0.0, atol=1e-12)
    assert len(square.knots) == 13


# --- Derivatives ---------------------------------------------------------------------------------------------------


def test_velocities_and_accelerations_integrate_to_what_they_are_derivatives_of(path):
    # Twenty Gauss points between neighbouring knots, and quarters of that: exact for what is smooth there, even the
    # quintic spline, whose fifth derivative jumps at its inner points, to the accuracy asked for.
    knots = np.array([*path.knots, *_inner_points(path)])
    knots = np.unique(knots)
    z, w = np.polynomial.legendre.leggauss(20)
    for a, b in pairwise(knots):
        ends = path.evaluate(np.array([a, b]))
        inside = path.evaluate(a + (b - a) * (1 + z) / 2)
        weights = (b - a) * w / 2
        moved = ends.position[1] - ends.position[0]
        gained = ends.velocity[1] - ends.velocity[0]
        np.testing.assert_allclose(weights @ inside.velocity, moved, rtol=0, atol=1e-14)
        # Speeds are some m/s.
        np.testing.assert_allclose(weights @ inside.acceleration, gained, rtol=0, atol=1e-13)


def _inner_points(path):
    if not isinstance(path, PointPath):
        return []
    chords = np.linalg.norm(np.diff(path.points, axis=0), axis=1)
    return path.motion_time * np.cumsum(chords)[:-1] / chords.sum()


def test_derivatives_agree_with_differences_inside_the_pieces(path):
    rng = np.random.default_rng(41)
    h = 1e-5 * path.duration
    a, b = np.array(path.knots[:-1]), np.array(path.knots[1:])
    t = np.concatenate([a + (b - a) * rng.uniform(0.05, 0.95, a.size) for _ in range(3)])
    here, after, before = (path.evaluate(t + k * h) for k in (0, 1, -1))
    # Central differences: h^2/6 of the third derivative, (2 pi/T)^2 of the first, with 6 periods T in the duration:
    # 1e-10 (12 pi)^2/6 = 2e-8.
    for exact, high, low in ((here.velocity, after[0], before[0]), (here.acceleration, after[1], before[1])):
        np.testing.assert_allclose((high - low) / (2 * h), exact, rtol=0, atol=2e-7 * np.max(np.abs(exact)))


def test_position_velocity_and_acceleration_are_continuous_at_knots(path):
    for knot in path.knots:
        before, after = path.evaluate(np.array([knot - 1e-10])), path.evaluate(np.array([knot + 1e-10]))
        # The jerk, some 1e4 m/s^3, over 2e-10 s.
        for x, y in zip(before, after, strict=True):
            np.testing.assert_allclose(x, y, rtol=0, atol=1e-5)


def test_paths_start_and_end_at_rest_and_dwell_there(path):
    T = path.duration
    t = np.array([-0.3, 0.0, T, T + 1e-3, T + 5.0])
    motion = path.evaluate(t)
    ends = motion.position[[0, 2]]
    np.testing.assert_allclose(motion.position, ends[[0, 0, 1, 1, 1]], rtol=0, atol=1e-15)
    # Sines of whole turns are zero up to rounding, times the largest acceleration; the spline's derivatives are sums
    # of large terms.
    np.testing.assert_allclose(motion.velocity, 0.0, atol=1e-12)
    np.testing.assert_allclose(motion.acceleration, 0.0, atol=1e-10)
    np.testing.assert_array_equal(motion.velocity[[0, 4]], 0.0)
    assert path.knots[0] == 0.0
    assert path.knots[-1] == pytest.approx(T, rel=1e-15)
    assert isinstance(path, Path)


# --- Shapes --------------------------------------------------------------------------------------------------------


def test_segments_are_straight_and_take_their_own_time():
    corners = np.array([(0.0, 0.0), (0.3, 0.1), (0.1, 0.4)])
    path = PATHS["open polygon"]
    lengths = np.linalg.norm(np.diff(corners, axis=0), axis=1)
    times = np.concatenate([[0.0], np.cumsum(1.5 * np.sqrt(pi * lengths / 7.0))])
    assert path.duration == pytest.approx(times[-1], rel=1e-15)
    for k in range(2):
        t = np.linspace(times[k], times[k + 1], 11)
        motion = path.evaluate(t)
        direction = (corners[k + 1] - corners[k]) / lengths[k]
        s = (motion.position - corners[k]) @ direction
        assert np.all(np.diff(s) > 0.0)
        for x in (motion.position - corners[k], motion.velocity, motion.acceleration):
            # A velocity of m/s and an acceleration of 7 m/s^2 have rounding errors of 1e-15 across.
            np.testing.assert_allclose(x - np.outer(x @ direction, direction), 0.0, atol=1e-14)
        np.testing.assert_allclose(s[[0, -1]], [0.0, lengths[k]], rtol=0, atol=1e-14)
    # A closed one comes back; two corners closed go there and back.
    np.testing.assert_allclose(
        Polygon(((0.0, 0.0), (1.0, 0.0)), 2.0).evaluate(np.array([1e3])).position, [[0.0, 0.0]], atol=1e-15
    )


def test_a_line_is_a_polygon_of_one_segment():
    line = PATHS["line"]
    assert line == Polygon(((0.1, -0.2), (-0.4, 0.5)), 3.0, closed=False)
    np.testing.assert_allclose(line.evaluate(line.duration / 2).position, [[-0.15, 0.15]], rtol=0, atol=1e-15)


@pytest.mark.parametrize(("name", "start", "sweep"), [("circle", 0.0, 2 * pi), ("arc", 1.1, -2.5)])
def test_circles_keep_their_radius_and_sense(name, start, sweep):
    path = PATHS[name]
    t = np.linspace(0.0, path.duration, 41)
    motion = path.evaluate(t)
    arm = motion.position - np.array([0.2, 0.3])
    np.testing.assert_allclose(np.linalg.norm(arm, axis=1), 0.15, rtol=1e-14)
    turned = np.unwrap(np.arctan2(arm[:, 1], arm[:, 0]))
    np.testing.assert_allclose(turned[[0, -1]], [start, start + sweep], rtol=0, atol=1e-13)
    assert np.all(np.diff(turned) * np.sign(sweep) > 0.0)
    # Speed and the acceleration along the path are the profile's, that across v^2/r towards the centre.
    s, speed, rate = TrapezoidalProfile(0.15 * abs(sweep), 5.0).evaluate(t)
    tangent = np.sign(sweep) * np.column_stack([-arm[:, 1], arm[:, 0]]) / 0.15
    np.testing.assert_allclose(np.abs(turned - start) * 0.15, s, rtol=0, atol=1e-14)
    np.testing.assert_allclose(np.sum(motion.velocity * tangent, axis=1), speed, rtol=0, atol=1e-13)
    np.testing.assert_allclose(np.sum(motion.acceleration * tangent, axis=1), rate, rtol=0, atol=1e-12)
    np.testing.assert_allclose(np.sum(motion.acceleration * arm, axis=1), -(speed**2), rtol=0, atol=1e-12)


def test_a_point_path_passes_its_points_in_proportion_to_the_chords():
    path = PATHS["points"]
    points = np.array(path.points)
    times = np.array([0.0, *_inner_points(path), 0.8])
    np.testing.assert_allclose(path.evaluate(times).position, points, rtol=0, atol=1e-13)
    # Twice as slow: the same places, half the speed, a quarter of the acceleration.
    slow = PointPath(path.points, 1.6)
    t = np.linspace(0.0, 0.8, 17)
    for factor, quick, late in zip((1, 2, 4), path.evaluate(t), slow.evaluate(2 * t), strict=True):
        np.testing.assert_allclose(late * factor, quick, rtol=0, atol=1e-11)


def test_a_motion_between_two_points_is_the_rest_to_rest_quintic():
    # 10 x^3 - 15 x^4 + 6 x^5 along the chord (textbook).
    t = np.linspace(0.0, 0.5, 11)
    x = t / 0.5
    start, end = np.array([0.1, 0.2]), np.array([0.4, -0.3])
    expected = start + np.outer(10 * x**3 - 15 * x**4 + 6 * x**5, end - start)
    np.testing.assert_allclose(PATHS["two points"].evaluate(t).position, expected, rtol=0, atol=1e-14)


# --- Errors --------------------------------------------------------------------------------------------------------

P, Q = (0.0, 0.0), (0.1, 0.0)


@pytest.mark.parametrize(
    ("make", "field"),
    [
        (lambda: Polygon((P,), 1.0), "corners"),
        (lambda: Polygon((P, (0.1,)), 1.0), "corners"),
        (lambda: Polygon((P, (0.1, 0.2, 0.3)), 1.0), "corners"),
        (lambda: Polygon((P, (np.nan, 0.0)), 1.0), "corners"),
        (lambda: Polygon((P, ("a", "b")), 1.0), "corners"),
        (lambda: Polygon((P, Q, Q), 1.0), "corners"),
        (lambda: Polygon((P, Q, P), 1.0), "corners"),
        (lambda: Polygon((P, Q), 0.0), "max_acceleration"),
        (lambda: Polygon((P, Q), -1.0), "max_acceleration"),
        (lambda: Polygon((P, Q), np.inf), "max_acceleration"),
        (lambda: Line(P, (0.1, 0.2, 0.3), 1.0), "end"),
        (lambda: Line((0.1, np.inf), Q, 1.0), "start"),
        (lambda: Circle((0.1,), 0.2, 1.0), "centre"),
        (lambda: Circle(P, 0.0, 1.0), "radius"),
        (lambda: Circle(P, -0.2, 1.0), "radius"),
        (lambda: Circle(P, 0.2, 1.0, start_angle=np.nan), "start_angle"),
        (lambda: Circle(P, 0.2, 1.0, sweep=0.0), "sweep"),
        (lambda: Circle(P, 0.2, np.nan), "max_acceleration"),
        (lambda: PointPath((P,), 1.0), "points"),
        (lambda: PointPath((P, Q, Q), 1.0), "points"),
        (lambda: PointPath((P, Q), 0.0), "motion_time"),
        (lambda: PointPath((P, Q), np.nan), "motion_time"),
    ],
)
def test_a_path_that_cannot_be_made_names_the_field(make, field):
    with pytest.raises(InputError) as caught:
        make()
    assert caught.value.field == field


# --- Curves and sequences -----------------------------------------------------------------------------------------


@pytest.mark.parametrize(("length", "cruises"), [(0.5, True), (0.05, False)])
def test_a_profile_of_limited_speed_takes_the_time_of_its_ramps_and_its_cruise(length, cruises):
    a, v = 2.0, 0.4
    profile = CruiseProfile(length, a, v)
    t = np.linspace(0.0, profile.duration, 4001)
    s, speed, rate = profile.evaluate(t)
    assert s[-1] == pytest.approx(length, rel=1e-12)
    assert np.max(np.abs(rate)) == pytest.approx(a, rel=1e-5)
    # A half sine of acceleration gives 2 a R / pi.
    ramp = np.pi * v / (2 * a) if cruises else np.sqrt(np.pi * length / (2 * a))
    assert np.max(speed) == pytest.approx(2 * a * ramp / np.pi, rel=1e-6)
    assert np.max(speed) <= v * (1 + 1e-12)
    assert profile.duration == pytest.approx(2 * ramp + (length / v - ramp if cruises else 0.0), rel=1e-12)
    np.testing.assert_allclose(np.gradient(s, t)[1:-1], speed[1:-1], rtol=0, atol=1e-6)
    np.testing.assert_allclose(np.gradient(speed, t)[1:-1], rate[1:-1], rtol=0, atol=2e-3)


EVEN = np.linspace(0.0, 1.0, 60)
UNEVEN = np.sort(np.concatenate([[0.0, 1.0], np.random.default_rng(3).uniform(0.005, 0.995, 200)]))


@pytest.mark.parametrize(("places", "within"), [(EVEN, (1e-7, 1e-5, 1e-3, 1e-8)), (UNEVEN, (1e-6, 1e-4, 1e-2, 1e-6))])
def test_a_curve_through_points_of_a_circle_is_followed_as_the_circle(places, within):
    circle = Circle((0.2, 0.3), 0.15, 5.0, start_angle=0.3, sweep=4.0)
    points = [0.2, 0.3] + 0.15 * np.column_stack([np.cos(0.3 + 4.0 * places), np.sin(0.3 + 4.0 * places)])
    table = TabulatedPath(points, max_acceleration=5.0)
    assert table.duration == pytest.approx(circle.duration, rel=within[0])
    t = np.linspace(0.0, circle.duration, 301)
    for found, expected, limit in zip(table.evaluate(t), circle.evaluate(t), within, strict=False):
        np.testing.assert_allclose(found, expected, rtol=0, atol=limit)
    # The profile is one along the length: the speed is the profile's, whatever the points' distances.
    speed = np.linalg.norm(table.evaluate(t).velocity, axis=1)
    np.testing.assert_allclose(speed, TrapezoidalProfile(0.6, 5.0).evaluate(t)[1], rtol=0, atol=within[3])


@pytest.mark.parametrize("name", ["acceleration", "speed", "times"])
def test_tables_are_at_their_points_at_their_knots(name):
    table = TABLES[name]
    places = table.evaluate(np.array(table.knots)).position
    gaps = np.min(np.linalg.norm(places[None] - np.array(WAVE)[:, None], axis=2), axis=1)
    np.testing.assert_allclose(gaps, 0.0, atol=1e-9)


@pytest.mark.parametrize("speed", [None, 0.4])
def test_knots_of_a_table_have_derivatives(speed):
    def knots(a):
        return np.array(TabulatedPath(WAVE, max_acceleration=a, max_speed=speed).knots)

    path = TabulatedPath(WAVE, max_acceleration=20.0, max_speed=speed)
    moved = np.array(with_fields(path, max_acceleration=20.0 + 1e-30j).knots)
    np.testing.assert_allclose(moved.real, knots(20.0), rtol=1e-12)
    slope = (knots(20.0 + 1e-4) - knots(20.0 - 1e-4)) / 2e-4
    np.testing.assert_allclose(moved.imag / 1e-30, slope, rtol=0, atol=1e-6 * np.max(np.abs(slope)))


@pytest.mark.parametrize("name", list(TABLES))
def test_tables_move_from_rest_to_rest_with_derivatives_that_are_those_of_their_places(name):
    path, h = TABLES[name], 1e-5
    t = np.linspace(0.0, path.duration, 41)[1:-1]
    for order in range(2):
        low, high, exact = path.evaluate(t - h)[order], path.evaluate(t + h)[order], path.evaluate(t)[order + 1]
        np.testing.assert_allclose((high - low) / (2 * h), exact, rtol=0, atol=2e-6 * np.max(np.abs(exact)))
    ends = path.evaluate(np.array([0.0, path.duration, path.duration + 1.0]))
    np.testing.assert_allclose(ends.position, [path.points[0], path.points[-1], path.points[-1]], rtol=0, atol=1e-13)
    np.testing.assert_allclose(ends.velocity, 0.0, rtol=0, atol=1e-12)
    np.testing.assert_allclose(ends.acceleration, 0.0, rtol=0, atol=1e-9)


def test_a_curve_may_take_a_time_and_passes_its_points_when_they_say():
    assert TabulatedPath(WAVE, motion_time=0.8).duration == pytest.approx(0.8, rel=1e-14)
    timed = TABLES["times"]
    np.testing.assert_allclose(timed.evaluate(np.array(timed.times) - 1.0).position, WAVE, rtol=0, atol=1e-13)


def test_a_sequence_is_its_paths_with_rest_between():
    first, second = PATHS["sequence"].paths
    joined, t = PATHS["sequence"], np.linspace(0.0, 0.2, 7)
    assert joined.duration == pytest.approx(first.duration + 0.1 + second.duration, rel=1e-15)
    for part, start in ((first, 0.0), (second, first.duration + 0.1)):
        for found, expected in zip(joined.evaluate(start + t), part.evaluate(t), strict=True):
            np.testing.assert_allclose(found, expected, rtol=0, atol=1e-12)
    resting = joined.evaluate(np.array([first.duration + 0.05]))
    np.testing.assert_allclose(resting.position, [[0.4, -0.3]], rtol=0, atol=1e-15)
    assert not np.any(resting.velocity)
    turned = PointPath(((0.4, -0.3, 0.1), (0.2, 0.0, 0.5)), 0.3)
    whole = SequencePath((turned, PointPath(((0.2, 0.0, 0.5), (0.0, 0.0, 0.0)), 0.3)))
    assert whole.turning(np.array([0.0, 0.3, 0.6]))[0] == pytest.approx([0.1, 0.5, 0.0])
    assert joined.turning(t) is None


@pytest.mark.parametrize(
    ("make", "says"),
    [
        (lambda: TabulatedPath(WAVE[:3], motion_time=1.0), "points: not a list of points"),
        (lambda: TabulatedPath((*WAVE, WAVE[-1]), motion_time=1.0), "points: points 9 and 10 coincide"),
        (lambda: TabulatedPath(WAVE), "max_acceleration: its motion profile is not given"),
        (lambda: TabulatedPath(WAVE, motion_time=1.0, max_acceleration=1.0), "max_acceleration: its motion profile is"),
        (lambda: TabulatedPath(WAVE, motion_time=1.0, max_speed=1.0), "max_speed: a largest speed needs"),
        (lambda: TabulatedPath(WAVE, times=(0.0, 1.0)), "times: there are 9 points and 2 times"),
        (lambda: TabulatedPath(WAVE, times=(0, 1, 2, 2, 3, 4, 5, 6, 7)), "times: its times must ascend, but that of"),
        (lambda: TabulatedPath(np.zeros((10_001, 2)), motion_time=1.0), "points: too many"),
        (lambda: SequencePath((PATHS["line"],)), "paths: a sequence needs two paths"),
        (lambda: SequencePath((PATHS["line"], PATHS["circle"])), "paths: path 2 starts .* m from where the one before"),
        (lambda: SequencePath((PATHS["line"], PATHS["line"]), -1.0), "dwell: must not be negative"),
        (
            lambda: SequencePath((PointPath(((0, 0, 1), (1, 0, 1)), 1.0), Line((1, 0), (2, 0), 1.0))),
            "paths: some of its paths give angles",
        ),
    ],
)  # fmt: skip
def test_curves_and_sequences_that_make_no_sense_are_refused(make, says):
    with pytest.raises(InputError, match=says) as caught:
        make()
    assert caught.value.remedy
