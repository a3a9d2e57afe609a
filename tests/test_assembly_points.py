"""Assemblies given by places of points: angles that follow, bodies that stay open, segments, files."""

import dataclasses

import numpy as np
import pytest

from paraflex.dynamics import build_system, consistent_state, reference_pose
from paraflex.errors import InputError
from paraflex.files import library_file, load
from paraflex.mechanism import (
    Assembly,
    Mechanism,
    PointRef,
    RevoluteJoint,
    RigidBody,
    approximate_poses,
    finite_segments,
)


def by_points(mechanism, points, angles=None):
    places = {PointRef.parse(text): place for text, place in points.items()}
    return dataclasses.replace(mechanism, assemblies=(Assembly("home", angles or {}, places),))


def exact_points(mechanism, names):
    system = build_system(mechanism)
    q = consistent_state(system, mechanism.assembly()).q
    found = {}
    for name in names:
        ref = PointRef.parse(name)
        body = system.body(ref.body)
        x, y, phi = q[body.offset : body.offset + 3]
        local = dataclasses.replace(mechanism.body(ref.body)).points[ref.point]
        lx, ly = local if isinstance(local, tuple) else (local, 0.0)
        found[name] = (x + np.cos(phi) * lx - np.sin(phi) * ly, y + np.sin(phi) * lx + np.cos(phi) * ly)
    return found


def test_two_pins_place_a_four_bar():
    mechanism = load("four_bar").mechanism.rigid()
    points = exact_points(mechanism, ["crank.A", "rocker.B"])
    placed = by_points(mechanism, points)
    poses = approximate_poses(placed, placed.assembly())
    given = mechanism.assembly().angles
    assert set(poses) == set(given)
    q = consistent_state(build_system(mechanism), mechanism.assembly()).q
    p = consistent_state(build_system(placed), placed.assembly()).q
    np.testing.assert_allclose(p, q, rtol=0, atol=1e-10)


def test_rough_places_choose_the_assembly_and_the_loop_is_closed():
    mechanism = load("four_bar").mechanism.rigid()
    points = exact_points(mechanism, ["coupler.A", "coupler.B"])
    rough = {name: (x + 0.01, y - 0.015) for name, (x, y) in points.items()}
    below = {"coupler.A": rough["coupler.A"], "coupler.B": (rough["coupler.B"][0], -rough["coupler.B"][1])}
    system = build_system(mechanism)
    expected = consistent_state(system, mechanism.assembly()).q
    for points_given, same in ((rough, True), (below, False)):
        placed = by_points(mechanism, points_given)
        q = consistent_state(build_system(placed), placed.assembly()).q
        # The crank's angle is prescribed: there are two ways to close the rest.
        assert bool(np.max(np.abs(q - expected)) < 1e-9) is same


def test_angles_and_points_complete_each_other():
    """A chain: the first link's angle is given, the second's end, the third's angle: everything has a place."""
    body = {"a": (0.0, 0.0), "b": (1.0, 0.0)}
    links = tuple(RigidBody(name, 1.0, 0.1, (0.5, 0.0), body) for name in ("one", "two", "three"))
    pins = (("ground", "O", "one", "a"), ("one", "b", "two", "a"), ("two", "b", "three", "a"))
    joints = tuple(RevoluteJoint(f"J{k}", PointRef(*p[:2]), PointRef(*p[2:])) for k, p in enumerate(pins))
    mechanism = Mechanism(
        "chain",
        {"O": (0.0, 0.0)},
        links,
        joints,
        assemblies=(Assembly("home", {"one": 0.5, "three": -0.3}, {PointRef("two", "b"): (1.5, 1.4)}),),
    )
    poses = approximate_poses(mechanism, mechanism.assembly())
    assert poses["one"].angle == 0.5
    assert poses["two"].angle == pytest.approx(np.arctan2(1.4 - np.sin(0.5), 1.5 - np.cos(0.5)))
    # The link is as long as it is: its ends come as near to their places as they can.
    middle = 0.5 * np.array([np.cos(0.5) + 1.5, np.sin(0.5) + 1.4])
    np.testing.assert_allclose(
        np.array(poses["two"].position) + 0.5 * np.array([np.cos(poses["two"].angle), np.sin(poses["two"].angle)]),
        middle,
        atol=1e-12,
    )
    assert poses["three"].position == pytest.approx((1.5, 1.4))


def test_three_places_turn_a_platform_by_the_best_fit():
    corners = {"A": (0.0, 0.0), "B": (0.4, 0.0), "C": (0.1, 0.3)}
    disturbance = np.random.default_rng(5).normal(scale=0.01, size=(3, 2))
    c, s = np.cos(2.5), np.sin(2.5)
    places = {name: (c * x - s * y + 1.0, s * x + c * y - 2.0) for name, (x, y) in corners.items()}
    noisy = {PointRef("plate", name): tuple(np.add(place, d)) for (name, place), d in zip(places.items(), disturbance,
                                                                                        strict=True)}  # fmt: skip
    plate = RigidBody("plate", 1.0, 0.1, (0.2, 0.1), corners)
    mechanism = Mechanism("free", {}, (plate,), (), assemblies=(Assembly("home", {}, noisy),))
    pose = approximate_poses(mechanism, mechanism.assembly())["plate"]

    def misfit(angle, x, y):
        c, s = np.cos(angle), np.sin(angle)
        misses = [np.array([c * a - s * b + x, s * a + c * b + y]) - noisy[PointRef("plate", name)]
                  for name, (a, b) in corners.items()]  # fmt: skip
        return np.sum(np.square(misses))

    assert pose.angle == pytest.approx(2.5, abs=0.1)
    least = misfit(pose.angle, *pose.position)
    for step in 1e-4 * np.vstack([np.eye(3), -np.eye(3)]):
        assert misfit(pose.angle + step[0], pose.position[0] + step[1], pose.position[1] + step[2]) > least
    # It floats free: there is no ground joint to place it from.
    system = build_system(mechanism)
    q = reference_pose(system, mechanism.assembly())
    np.testing.assert_allclose(q, [*pose.position, pose.angle], rtol=0, atol=0)


def test_segments_lie_as_the_beams_that_points_place():
    mechanism = load("four_bar").mechanism
    placed = by_points(mechanism, exact_points(mechanism, ["crank.A", "rocker.B"]))
    cut = finite_segments(placed, 3)
    poses = approximate_poses(placed, placed.assembly())
    for name, (carrier, _) in cut.carriers.items():
        assert cut.mechanism.assembly().angles[name] == poses[carrier].angle
    consistent_state(build_system(cut.mechanism), cut.mechanism.assembly())


FOUR_BAR = library_file("four_bar").read_text(encoding="utf-8")
ANGLES = "crank = 1.0\ncoupler = 0.4\nrocker = 1.6\n"


def test_points_from_a_file(tmp_path):
    file = tmp_path / "four.toml"
    assert ANGLES in FOUR_BAR
    file.write_text(FOUR_BAR.replace(ANGLES, 'crank = 1.0\npoints = { "coupler.B" = [0.39, "rocker"] }\n'))
    assembly = load(file).mechanism.assembly()
    assert assembly == Assembly("open", {"crank": 1.0}, {PointRef("coupler", "B"): (0.39, 0.25)})


@pytest.mark.parametrize(
    ("text", "says"),
    [
        (
            'points = { "crank.A" = [0.05, 0.08] }',
            "assembly.open: no angle for a body (got 'coupler'); give its approximate angle in rad, or the places",
        ),
        ("crank = 1.0", "assembly.open: no angle for a body (got 'coupler')"),
        ('points = { "crank.Z" = [0, 0] }', "assembly.open.points: unknown point (got 'crank.Z')"),
        ('points = { "crnk.A" = [0, 0] }', "assembly.open.points: unknown body (got 'crnk'); did you mean \"crank\"?"),
        ('points = { "crank" = [0, 0] }', "assembly.open.points: not a point (got 'crank')"),
        ('points = { "crank.A" = [0] }', "assembly.open.points.crank.A: list should have at least 2 items"),
        ('points = { "crank.A" = [0, inf] }', "assembly.open.points.crank.A.1: should be a finite number"),
        (
            'points = { "ground.O" = [0, 0] }',
            "assembly.open.points: the places of ground points are given in [ground] (got 'ground.O')",
        ),
        ("points = 3", "assembly.open.points: should be a table (got 3)"),
        ('crank = "up"', "assembly.open.crank: unknown parameter \"up\" (got 'up')"),
        ("crank = [1.0]", "assembly.open.crank: should be a valid number (got [1.0])"),
    ],
)
def test_points_that_make_no_sense_are_named(tmp_path, text, says):
    file = tmp_path / "four.toml"
    file.write_text(FOUR_BAR.replace(ANGLES, text + "\n"))
    with pytest.raises(InputError) as caught:
        load(file)
    assert says in str(caught.value)
    assert str(caught.value).startswith(f"{file}: ")
