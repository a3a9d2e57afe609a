"""Plans, distances and statics of large mechanisms with sparse factors, against dense ones and closed forms."""

import tracemalloc
from dataclasses import replace

import numpy as np
import pytest

from paraflex.actuation import required_effort
from paraflex.dynamics import build_system, consistent_state, joint_coordinate
from paraflex.dynamics.joint_coordinates import own_coordinate
from paraflex.dynamics.rank import dependence
from paraflex.errors import UnreachablePathError
from paraflex.mechanism import (
    Assembly,
    EndEffector,
    Gear,
    Mechanism,
    Motor,
    PointRef,
    RevoluteJoint,
    RigidBody,
    SlotJoint,
    TorsionalDamper,
    chain_of_segments,
    four_bars_in_a_row,
)
from paraflex.paths import follow_path, path_follower
from paraflex.paths.paths import Line
from paraflex.tracking import plan_tracking
from paraflex.validity.numbers import mechanism_size

DENSE = "paraflex.paths.loops.DENSE_ROWS", "paraflex.paths.reach.DENSE_ROWS"
# Dense and sparse results differ by rounding errors, which long rows of loops multiply by up to a thousand.
SAME = 1e-10


def row(n):
    """A row of four-bars with a motor at each end, and the place of its last crank as the task."""
    last = PointRef(f"crank{n}", "B")
    motors = Motor("first", "A0"), Motor("last", f"A{n}")
    return replace(four_bars_in_a_row(n), motors=motors, end_effector=EndEffector(last, ("x",)))


def geared_chain(n):
    """A chain with equal angles between its links by gears, springs and a damper; two degrees of freedom."""
    chain = chain_of_segments(n)
    return replace(
        chain,
        gears=tuple(Gear(f"G{i}", f"J{i - 1}", f"J{i}", 1.0) for i in range(3, n + 1)),
        dampers=(TorsionalDamper("damper", f"J{n}", 0.1),),
        motors=(Motor("first", "J1"), Motor("second", "J2")),
        assemblies=(Assembly("curved", {f"segment{i}": i / n for i in range(1, n + 1)}),),
        end_effector=EndEffector(PointRef(f"segment{n}", "Q"), ("x", "y")),
    )


def tongs(n):
    """Lazy tongs of n cells: bars of 1 m crossed at their middles at +-0.6 rad, the first cell on a pin and a slot."""
    bars = {f"{name}{i}": sign * 0.6 for i in range(n) for name, sign in (("up", 1.0), ("down", -1.0))}
    points = {"L": (0.0, 0.0), "M": (0.5, 0.0), "R": (1.0, 0.0)}
    joints = [RevoluteJoint(f"M{i}", PointRef(f"up{i}", "M"), PointRef(f"down{i}", "M")) for i in range(n)]
    for i in range(1, n):
        joints.append(RevoluteJoint(f"T{i}", PointRef(f"up{i - 1}", "R"), PointRef(f"down{i}", "L")))
        joints.append(RevoluteJoint(f"B{i}", PointRef(f"down{i - 1}", "R"), PointRef(f"up{i}", "L")))
    ground = PointRef("ground", "O")
    held = RevoluteJoint("O", ground, PointRef("up0", "L")), SlotJoint("S", ground, PointRef("down0", "L"), np.pi / 2)
    return Mechanism(
        f"tongs of {n} cells", ground={"O": (0.0, 0.0)},
        bodies=tuple(RigidBody(name, 0.1, 0.01, (0.5, 0.0), points) for name in bars), joints=(*joints, *held),
        motors=(Motor("tau", "O"),), gravity=(0.0, -9.81), assemblies=(Assembly("open", bars),),
        end_effector=EndEffector(PointRef(f"up{n - 1}", "R"), ("x",)),
    )  # fmt: skip


def path_of(mechanism, move, acceleration=20.0):
    """A straight path from the first assembly."""
    follower = path_follower(mechanism, Line((0.0, 0.0), (1.0, 0.0), 1.0), 1.0)
    at = follower.closure.task(follower.assembled)
    start = np.append(at, 0.0)[:2]
    return Line(tuple(start), tuple(start + move), acceleration)


def densely(monkeypatch, call):
    """Return the result of a call with sparse closure, and with dense closure."""
    found = []
    for limit in (0, 10**9):
        for name in DENSE:
            monkeypatch.setattr(name, limit)
        found.append(call())
    return found


@pytest.mark.parametrize(
    ("mechanism", "move"), [(row(6), (0.3, 0.0)), (geared_chain(12), (-0.2, 0.1)), (tongs(9), (-0.5, 0.0))]
)
def test_sparse_and_dense_plans_agree(mechanism, move, monkeypatch):
    path = path_of(mechanism, np.array(move))

    def plan():
        return plan_tracking(mechanism, path, samples=21, warning=False)

    sparse, dense = densely(monkeypatch, plan)
    for name in ("q", "v", "a", "basis"):
        one, other = getattr(sparse.motion, name), getattr(dense.motion, name)
        assert np.max(np.abs(one - other)) <= SAME * np.max(np.abs(other))
    mode = ",".join(motor.name for motor in mechanism.motors)
    one, other = (task.torques(mode).evaluate(task.motion.t) for task in (sparse, dense))
    assert np.max(np.abs(one - other)) <= SAME * np.max(np.abs(other))


def test_tongs_of_two_hundred_cells():
    """x = n cos phi gives all angles of a plan beyond the size up to which closure is dense."""
    n = 200
    mechanism = tongs(n)
    path = path_of(mechanism, np.array([-2.0, 0.0]))
    motion = follow_path(mechanism, path, np.linspace(0.0, 0.1, 5))
    assert motion.system.m > 1000
    turn = np.arccos(motion.desired.position[:, 0] / n)
    rate = -motion.desired.velocity[:, 0] / (n * np.sin(turn))
    for body in motion.system.bodies:
        sign = 1.0 if body.name.startswith("up") else -1.0
        # Rounding errors of places grow with the cube of the number of cells.
        np.testing.assert_allclose(motion.q[:, body.angle], sign * turn, rtol=0, atol=1e-9)
        np.testing.assert_allclose(motion.v[:, body.angle], sign * rate, rtol=0, atol=1e-8)


def test_a_path_through_a_singular_position_is_refused_alike(monkeypatch):
    """All links of the row come in line at x = n + 1."""
    mechanism = row(2)
    path = path_of(mechanism, np.array([1.2, 0.0]))

    def refused():
        with pytest.raises(UnreachablePathError) as error:
            follow_path(mechanism, path, np.linspace(0.0, path.duration, 11))
        return error.value

    sparse, dense = densely(monkeypatch, refused)
    assert sparse.cause == dense.cause
    assert sparse.shortfall == pytest.approx(dense.shortfall, rel=1e-6) == pytest.approx(0.2, rel=1e-6)
    assert sparse.moment.time == pytest.approx(dense.moment.time, abs=1e-3)


def test_memory_of_a_plan_grows_with_the_number_of_bodies():
    peaks = []
    for n in (70, 210):
        mechanism = row(n)
        path = path_of(mechanism, np.array([0.002, 0.0]))
        tracemalloc.start()
        plan_tracking(mechanism, path, samples=5, warning=False)
        peaks.append(tracemalloc.get_traced_memory()[1])
        tracemalloc.stop()
    assert peaks[1] < 3.6 * peaks[0]


def test_a_joint_of_many_bodies_by_its_own_coordinates():
    mechanism = geared_chain(160)
    system = build_system(mechanism)
    random = np.random.default_rng(2)
    q, v = random.standard_normal((2, 3, system.n))
    for name in ("J1", "J7", "J160"):
        known, (found, own) = joint_coordinate(system, name, q, v), own_coordinate(system, name, q, v)
        assert own.size <= 6
        np.testing.assert_allclose(found.value, known.value, rtol=0, atol=1e-14)
        np.testing.assert_allclose(found.rate, known.rate, rtol=0, atol=1e-14)
        np.testing.assert_array_equal(found.rows, known.rows[:, own])
        assert np.count_nonzero(found.rows) == np.count_nonzero(known.rows)


def test_effort_of_many_springs(monkeypatch):
    mechanism = geared_chain(140)
    motion = follow_path(mechanism, path_of(mechanism, np.array([-0.002, 0.001])), np.linspace(0.0, 0.02, 3))
    found = required_effort(motion)
    monkeypatch.setattr("paraflex.dynamics.joint_coordinates.DENSE_ROWS", 10**9)
    known = required_effort(motion)
    np.testing.assert_allclose(found.required, known.required, rtol=1e-12)


def test_independent_rows_among_others_need_no_dense_matrix():
    system = build_system(row(80))
    q = consistent_state(system, None).q
    assert system.m > 400
    found = dependence(system, q, acting=np.arange(450))
    assert found.dropped.size == 0
    np.testing.assert_array_equal(found.kept, np.arange(450))


@pytest.mark.parametrize("shape", ["line", "circle", "cloud"])
def test_the_largest_distance_of_many_points(shape):
    random = np.random.default_rng(4)
    turns = random.uniform(0.0, 2.0 * np.pi, 90)
    points = {
        "line": np.column_stack([np.arange(90.0), np.zeros(90)]),
        "circle": np.column_stack([np.cos(turns), np.sin(turns)]),
        "cloud": random.standard_normal((90, 2)),
    }[shape]
    known = np.max(np.linalg.norm(points[:, None] - points, axis=2))
    ground = {f"P{i}": (float(x), float(y)) for i, (x, y) in enumerate(points)}
    assert mechanism_size(replace(chain_of_segments(2), ground=ground | {"O": (0.0, 0.0)})) == pytest.approx(
        max(known, np.max(np.linalg.norm(points, axis=1))), rel=1e-14
    )
