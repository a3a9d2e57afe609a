"""How far a path lies from what a mechanism can reach, against annuli and triangles in closed form."""

from dataclasses import replace

import numpy as np
import pytest

from paraflex.errors import AssemblyError, UnreachablePathError
from paraflex.files import load
from paraflex.mechanism import (
    Assembly,
    EndEffector,
    Mechanism,
    PointRef,
    PrescribedAngle,
    PrismaticJoint,
    RevoluteJoint,
    RigidBody,
    SampledAngle,
)
from paraflex.paths import Circle, Line, PointPath, follow_path, path_follower

UPPER, LOWER, BASE = 0.4, 0.3, np.array([0.1, 0.0])
# Of distances: the nearest pose is a minimum, found to the root of rounding; of a second-order difference besides.
CLOSE = {"rtol": 0, "atol": 1e-9}


def bar(name, length):
    return RigidBody(name, 1.0, 0.01, (length / 2, 0.0), {"a": (0.0, 0.0), "b": (length, 0.0)})


def arm(coordinates=("x", "y"), **changes):
    return Mechanism(
        "arm",
        {"O": tuple(BASE)},
        (bar("upper", UPPER), bar("lower", LOWER)),
        (
            RevoluteJoint("O", PointRef("ground", "O"), PointRef("upper", "a")),
            RevoluteJoint("E", PointRef("upper", "b"), PointRef("lower", "a")),
        ),
        end_effector=EndEffector(PointRef("lower", "b"), coordinates),
        assemblies=(Assembly("right", {"upper": 0.3, "lower": 1.2}),),
        **changes,
    )


def shortfall(mechanism, path):
    """Distance of a path from the workspace, as errors of paths have it."""
    follower = path_follower(mechanism, path, path.duration)
    return follower.closure.shortfall(path, 0.0, path.duration, follower.assembled)


def refused(mechanism, path, samples=101, **keywords):
    with pytest.raises(UnreachablePathError) as caught:
        follow_path(mechanism, path, np.linspace(0.0, path.duration, samples), **keywords)
    return caught.value


def test_an_arm_reaches_an_annulus():
    path = Line((0.5, 0.3), (0.9, 0.9), 2.0)
    found = shortfall(arm(), path)
    r = np.linalg.norm(path.evaluate(found.t).position - BASE, axis=1)
    np.testing.assert_allclose(found.distance, np.maximum(r - UPPER - LOWER, 0.0), **CLOSE)
    error = refused(arm(), path)
    np.testing.assert_allclose(error.shortfall, r[-1] - UPPER - LOWER, **CLOSE)
    assert error.problem.endswith("its furthest point, (0.9, 0.9) m, lies 0.504 m beyond reach")
    assert "the path goes out of reach at t = " in str(error)


def test_the_hole_in_the_middle_counts():
    # Past the base, at some distance: out of reach on the way only.
    path = Line((0.4, 0.05), (-0.3, 0.05), 2.0)
    found = shortfall(arm(), path)
    r = np.linalg.norm(path.evaluate(found.t).position - BASE, axis=1)
    np.testing.assert_allclose(found.distance, np.maximum(UPPER - LOWER - r, 0.0), **CLOSE)
    # The nearest place to the base is 0.05 m off it; instants looked at are a hundredth of the path apart there.
    np.testing.assert_allclose(refused(arm(), path).shortfall, 0.05, rtol=1e-2)


@pytest.mark.parametrize("name", ["five_bar", "raparm_i"])
@pytest.mark.parametrize(("end", "nearest"), [((0.05, 0.6), None), ((0.0, 0.6), (0.0, np.sqrt(0.5**2 - 0.1**2)))])
def test_two_arms_reach_what_both_annuli_hold(name, end, nearest):
    mechanism, path = load(name).mechanism, Line((0.0, 0.3), end, 5.0)
    # Beyond one arm only the end-effector comes as near as that arm; beyond both as near as both together.
    expected = np.hypot(end[0] + 0.1, end[1]) - 0.5 if nearest is None else end[1] - nearest[1]
    if nearest is None:
        on_arm = np.array([-0.1, 0.0]) + 0.5 * np.array([end[0] + 0.1, end[1]]) / np.hypot(end[0] + 0.1, end[1])
        assert np.linalg.norm(on_arm - [0.1, 0.0]) < 0.5
    np.testing.assert_allclose(refused(mechanism, path).shortfall, expected, **CLOSE)
    assert not np.any(shortfall(mechanism, Circle((0.0, 0.3), 0.05, 5.0)).out)


def test_a_start_out_of_reach_says_how_far():
    error = refused(arm(), Line((0.9, 0.0), (0.5, 0.0), 2.0))
    assert str(error) == f"{error.problem}; move the path or the bases, or choose another assembly"
    assert error.problem == (
        "the path's start is out of reach at t = 0 s (step 0), end-effector at (0.9, 0) m: 0.1 m beyond reach"
    )
    np.testing.assert_allclose(error.shortfall, 0.1, **CLOSE)
    further = refused(arm(), Line((0.9, 0.0), (1.2, 0.0), 2.0))
    assert further.problem.endswith(": 0.1 m beyond reach; its furthest point, (1.2, 0) m, lies 0.4 m beyond reach")


@pytest.mark.parametrize(("scale", "asked"), [(1e3, True), (10.0, False)])
def test_a_path_in_millimetres_is_asked_about(scale, asked):
    path = Line((0.3 * scale, 0.2 * scale), (0.3 * scale, 0.3 * scale), 10.0)
    assert ("is the path in mm?" in str(refused(arm(), path))) == asked


def test_prescribed_motions_move_what_can_be_reached():
    law = SampledAngle(
        lambda t: 0.6 + 0.4 * np.sin(9 * t), lambda t: 3.6 * np.cos(9 * t), lambda t: -32.4 * np.sin(9 * t)
    )
    driven, path = arm(("y",), prescribed=(PrescribedAngle("drive", "O", law),)), Line((0.0, 0.4), (0.0, 0.9), 2.0)
    found = shortfall(driven, path)
    highest = UPPER * np.sin(law.evaluate(found.t)[0]) + LOWER
    np.testing.assert_allclose(
        found.distance, np.maximum(path.evaluate(found.t).position[:, 1] - highest, 0.0), **CLOSE
    )


def test_a_slider_reaches_as_far_as_crank_and_rod():
    crank, rod = 0.1, 0.3
    mechanism = Mechanism(
        "slider-crank",
        {"O": (0.0, 0.0), "rail": (0.0, 0.0)},
        (bar("crank", crank), bar("rod", rod), RigidBody("block", 1.0, 1e-3, (0.0, 0.0), {"P": (0.0, 0.0)})),
        (
            RevoluteJoint("O", PointRef("ground", "O"), PointRef("crank", "a")),
            RevoluteJoint("A", PointRef("crank", "b"), PointRef("rod", "a")),
            RevoluteJoint("B", PointRef("rod", "b"), PointRef("block", "P")),
            PrismaticJoint("slide", PointRef("ground", "rail"), PointRef("block", "P")),
        ),
        end_effector=EndEffector(PointRef("block", "P"), ("x",)),
        assemblies=(Assembly("up", {"crank": 1.0, "rod": -0.3, "block": 0.0}),),
    )
    path = Line((0.3, 0.0), (0.45, 0.0), 2.0)
    found = shortfall(mechanism, path)
    wanted = path.evaluate(found.t).position[:, 0]
    np.testing.assert_allclose(found.distance, np.maximum(wanted - crank - rod, 0.0), **CLOSE)
    error = refused(mechanism, path)
    assert error.moment.position == (pytest.approx(0.4, abs=1e-3),)


def rocker(angle):
    """Crank-rocker whose task is the angle of the rocker."""
    lengths = {"crank": 0.1, "coupler": 0.3, "rocker": 0.25}
    return Mechanism(
        "crank-rocker",
        {"O": (0.0, 0.0), "D": (0.35, 0.0)},
        tuple(bar(name, length) for name, length in lengths.items()),
        (
            RevoluteJoint("O", PointRef("ground", "O"), PointRef("crank", "a")),
            RevoluteJoint("A", PointRef("crank", "b"), PointRef("coupler", "a")),
            RevoluteJoint("B", PointRef("coupler", "b"), PointRef("rocker", "b")),
            RevoluteJoint("D", PointRef("ground", "D"), PointRef("rocker", "a")),
        ),
        end_effector=EndEffector(PointRef("rocker", "b"), ("angle",)),
        assemblies=(Assembly("open", {"crank": 1.2, "coupler": 0.5, "rocker": angle}),),
    )


def limit(reach):
    """Angle of the rocker where crank and coupler are in line, over `reach`: by the law of cosines."""
    return np.pi - np.arccos((0.35**2 + 0.25**2 - reach**2) / (2 * 0.35 * 0.25))


def test_an_angle_out_of_reach_is_counted_in_radians():
    lowest, highest = limit(0.4), limit(0.2)
    path = PointPath(((0.0, 0.0, 0.5 * (lowest + highest)), (1.0, 0.0, highest + 0.2)), 1.0)
    error = refused(rocker(1.9), path)
    np.testing.assert_allclose((error.shortfall, error.shortfall_angle), (0.0, 0.2), **CLOSE)
    assert error.problem.endswith("its furthest point, at t = 1 s, lies 0.2 rad beyond reach")


def test_what_another_assembly_reaches_is_no_matter_of_distance():
    lowest, highest = limit(0.4), limit(0.2)
    mirrored = PointPath(((0.0, 0.0, -0.5 * (lowest + highest)), (1.0, 0.0, -highest + 0.1)), 1.0)
    error = refused(rocker(1.9), mirrored)
    assert error.shortfall_angle == 0.0
    assert "only past a Type I singularity or in another assembly" in str(error)


def test_a_way_through_the_base_passes_a_singular_position():
    same = replace(arm(), bodies=(bar("upper", UPPER), bar("lower", UPPER)))
    error = refused(same, Line((0.4, 0.0), (-0.3, 0.0), 2.0))
    assert "the path passes a Type I singularity at t = " in str(error)
    assert error.shortfall == 0.0


def test_an_assembly_out_of_reach_says_how_far_apart_its_joints_stay():
    wide = replace(rocker(1.9), ground={"O": (0.0, 0.0), "D": (0.8, 0.0)})
    with pytest.raises(AssemblyError, match=r"the loops do not close: a gap of 0\.15 m remains in D at"):
        shortfall(wide, PointPath(((0.0, 0.0, 1.0), (1.0, 0.0, 1.5)), 1.0))
