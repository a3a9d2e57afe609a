"""Constraints that depend on one another, agree, or contradict one another: at the start, in a run, in its results."""

from dataclasses import replace

import numpy as np
import pytest
import scipy.sparse

import twins
from conftest import make_linkage
from paraflex.dynamics import (
    State,
    build_system,
    consistent_state,
    constant_signals,
    dependence,
    pack_signals,
    redundant_rows,
)
from paraflex.dynamics.sparse import Saddle, sparse_jacobian, sparse_mass
from paraflex.dynamics.state import mass_matrix
from paraflex.errors import AssemblyError, ConstraintDriftError, InconsistentConstraintsError, IntegrationError
from paraflex.integrators import IntegrationOptions, integrate
from paraflex.mechanism import (
    Assembly,
    Mechanism,
    Motor,
    PointRef,
    PrescribedAngle,
    RevoluteJoint,
    RigidBody,
    SampledAngle,
)


def ground(point: str) -> PointRef:
    return PointRef("ground", point)


def joint(name: str, a: str, b: str) -> RevoluteJoint:
    return RevoluteJoint(name, PointRef.parse(a), PointRef.parse(b))


def arm(*laws, name="arm") -> Mechanism:
    """A bar on a pin, its angle prescribed by each of the laws."""
    return Mechanism(
        name=name,
        ground={"O": (0.0, 0.0)},
        bodies=(RigidBody("arm", 2.0, 0.1, (0.5, 0.0), {"O": (0.0, 0.0), "P": (1.0, 0.0)}),),
        joints=(joint("pin", "ground.O", "arm.O"),),
        prescribed=tuple(PrescribedAngle(f"law{k}", "pin", law) for k, law in enumerate(laws)),
        gravity=(0.0, -9.81),
        assemblies=(Assembly("level", {"arm": 0.0}),),
    )


def polynomial(c0=0.0, c1=0.0, c2=0.0, c3=0.0) -> SampledAngle:
    return SampledAngle(
        lambda t: c0 + c1 * t + c2 * t**2 + c3 * t**3,
        lambda t: c1 + 2 * c2 * t + 3 * c3 * t**2,
        lambda t: 2 * c2 + 6 * c3 * t,
    )


def parallelogram(rods=3, angle=1.0, lengths=None) -> Mechanism:
    """A platform on parallel rods of length 0.5 from the ground: with three of them the classical redundant one."""
    lengths = lengths or [0.5] * rods
    places = [0.3 * k for k in range(rods)]
    bodies = [
        RigidBody(f"rod{k}", 0.4, 0.01, (0.25, 0.0), {"G": (0.0, 0.0), "P": (length, 0.0)})
        for k, length in enumerate(lengths)
    ]
    platform = RigidBody("platform", 3.0, 0.2, (0.2, 0.05), {f"P{k}": (x, 0.0) for k, x in enumerate(places)})
    joints = [joint(f"G{k}", f"ground.G{k}", f"rod{k}.G") for k in range(rods)]
    joints += [joint(f"P{k}", f"rod{k}.P", f"platform.P{k}") for k in range(rods)]
    return Mechanism(
        name="parallelogram",
        ground={f"G{k}": (x, 0.0) for k, x in enumerate(places)},
        bodies=(*bodies, platform),
        joints=tuple(joints),
        motors=(Motor("drive", "G0"),),
        gravity=(0.0, -9.81),
        assemblies=(Assembly("up", {**{f"rod{k}": angle for k in range(rods)}, "platform": 0.0}),),
    )


def simulate(mechanism, end, *, torques=(), tolerance=1e-6):
    system = build_system(mechanism)
    state = consistent_state(system, mechanism.assembly())
    values = list(torques) or [0.0] * len(mechanism.motors)
    signals, knots = pack_signals(mechanism, constant_signals(values, end), end)
    options = IntegrationOptions(tolerance=tolerance)
    return system, integrate(system, signals, state, np.linspace(0.0, end, 51), knots=np.array(knots), options=options)


# --- Sparse matrices -----------------------------------------------------------------------------------------------


def many(count: int) -> Mechanism:
    """A row of four-bars over the ground, so many cranks, every other coupler a little longer or shorter."""
    bodies, joints, angles = [], [], {}
    for k in range(count):
        bodies.append(RigidBody(f"crank{k}", 1.0, 0.01, (0.15, 0.0), {"O": (0.0, 0.0), "P": (0.3, 0.0)}))
        joints.append(joint(f"G{k}", f"ground.G{k}", f"crank{k}.O"))
        angles[f"crank{k}"] = 1.0
    for k in range(count - 1):
        length = 0.5 + (0.01, 0.0, -0.01, 0.0)[k % 4]
        bodies.append(RigidBody(f"coupler{k}", 1.0, 0.01, (0.25, 0.0), {"A": (0.0, 0.0), "B": (length, 0.0)}))
        joints.append(joint(f"A{k}", f"crank{k}.P", f"coupler{k}.A"))
        joints.append(joint(f"B{k}", f"coupler{k}.B", f"crank{k + 1}.P"))
        angles[f"coupler{k}"] = 0.0
    return Mechanism(
        name="row",
        ground={f"G{k}": (0.5 * k, 0.0) for k in range(count)},
        bodies=tuple(bodies),
        joints=tuple(joints),
        motors=(Motor("drive", "G0"),),
        assemblies=(Assembly("up", angles),),
    )


@pytest.mark.parametrize("geometry", ["linear", "second-order"])
def test_sparse_matrices_are_those_of_the_theory(raparm, geometry):
    for mechanism in (raparm, make_linkage()):
        system = build_system(mechanism.with_geometry(geometry))
        q, _, _ = twins.random_state(system, 5)
        jacobian = system.jacobian(q)
        scale = np.max(np.abs(jacobian))
        np.testing.assert_allclose(sparse_jacobian(system, q).toarray(), jacobian, rtol=0, atol=1e-14 * scale)
        if geometry == "linear":
            M = twins.system_mass_matrix(system, q)
            np.testing.assert_allclose(mass_matrix(system, q), M, rtol=0, atol=1e-12 * np.max(np.abs(M)))
            np.testing.assert_allclose(sparse_mass(system, q).toarray(), M, rtol=0, atol=1e-12 * np.max(np.abs(M)))


def test_saddle_solves_with_dependent_rows():
    # A row twice and one that is the sum of two others.
    rng = np.random.default_rng(0)
    A, C = rng.normal(size=(9, 9)), rng.normal(size=(3, 9))
    W, C = A @ A.T + np.eye(9), np.vstack([C, C[0], C[1] + C[2]])
    right, f = C @ rng.normal(size=9), rng.normal(size=9)
    x, mu = Saddle(scipy.sparse.csr_matrix(W), scipy.sparse.csr_matrix(C)).solve(f, right)
    np.testing.assert_allclose(C @ x, right, rtol=0, atol=1e-12)
    np.testing.assert_allclose(W @ x + C.T @ mu, f, rtol=0, atol=1e-12)


def test_loops_of_many_bodies_close_by_sparse_matrices_as_by_dense_ones(monkeypatch):
    mechanism = many(40)
    system = build_system(mechanism)
    dense = consistent_state(system, mechanism.assembly())
    monkeypatch.setattr("paraflex.dynamics.projection.DENSE_ROWS", 10)
    monkeypatch.setattr("paraflex.dynamics.rank.DENSE_ROWS", 10)
    sparse = consistent_state(system, mechanism.assembly())
    np.testing.assert_allclose(sparse.q, dense.q, rtol=0, atol=1e-11)
    assert dependence(system, sparse.q).rank == system.m
    assert system.n - system.m == 1


@pytest.mark.parametrize("limit", [0, 400])
def test_a_dependence_names_the_rows_it_is_among(monkeypatch, limit):
    """By either factorisation the third rod's rows follow from those of the loop, and of nothing else."""
    monkeypatch.setattr("paraflex.dynamics.rank.DENSE_ROWS", limit)
    extra = parallelogram()
    # Besides a pendulum that has no part in it.
    bob = RigidBody("bob", 1.0, 0.1, (0.3, 0.0), {"O": (0.0, 0.0)})
    hanging = replace(
        extra,
        bodies=(*extra.bodies, bob),
        joints=(*extra.joints, joint("H", "platform.P0", "bob.O")),
        assemblies=(Assembly("up", {**extra.assembly().angles, "bob": -1.0}),),
    )
    system = build_system(hanging)
    q = consistent_state(system, hanging.assembly()).q
    found = dependence(system, q)
    assert (found.rank, found.dropped.size) == (system.m - 1, 1)
    jacobian = system.jacobian(q)
    np.testing.assert_allclose(jacobian[found.dropped], found.coefficients.T @ jacobian[found.kept], rtol=0, atol=1e-12)
    rows = {system.rows[k] for k in (*found.dropped, *found.sources(0))}
    assert not any(row.startswith("H") for row in rows)
    assert {row.split()[0] for row in rows} == {"G0", "G1", "G2", "P0", "P1", "P2"}
    assert len(redundant_rows(system, q)) == 1


# --- What contradicts itself ----------------------------------------------------------------------------------------


@pytest.mark.parametrize(
    ("other", "error", "says"),
    [
        ({"c0": 0.2}, AssemblyError, r"a gap of 0\.1 rad remains in law. and law. at"),
        (
            {"c1": 0.2},
            InconsistentConstraintsError,
            r"velocities of constraints contradict one another, by 0\.2 m/s or rad/s: law",
        ),
        (
            {"c2": 0.2},
            InconsistentConstraintsError,
            r"accelerations .* contradict one another, by 0\.4 m/s\^2 or rad/s\^2: law",
        ),
    ],
    ids=["position", "velocity", "acceleration"],
)
def test_two_laws_on_one_joint_that_disagree_are_refused_at_the_start(other, error, says):
    mechanism = arm(polynomial(c3=1.0), polynomial(**other))
    with pytest.raises(error, match=says):
        consistent_state(build_system(mechanism), mechanism.assembly())


def test_laws_that_agree_are_no_contradiction():
    law = polynomial(0.1, 0.4, -0.3, 0.2)
    _, solution = simulate(arm(law, law), 1.0)
    np.testing.assert_allclose(solution.q[:, 2], law.evaluate(solution.t)[0], rtol=0, atol=1e-6)


def test_laws_that_part_later_end_the_run_and_are_named():
    # They agree in position, velocity and acceleration at the start, and part as t^3.
    with pytest.raises(
        ConstraintDriftError, match=r"positions of constraints contradict one another, by .*: law., law., at t ="
    ) as caught:
        simulate(arm(polynomial(), polynomial(c3=1.0)), 2.0, tolerance=1e-5)
    error = caught.value
    assert isinstance(error, IntegrationError)
    # 1e-3 times the radius of gyration about the pin are reached after a twelfth of a second; a look is taken every
    # 200 steps or at the end.
    assert error.partial.status == "failed"
    assert error.partial.constraint_position_max > 1e-3 * np.sqrt(0.1 / 2.0 + 0.25)
    assert 0.0 < error.moment.time <= 2.0
    assert error.partial.t.size >= 2
    assert "contradict" in error.partial.message


def test_a_start_with_an_open_joint_ends_the_run_and_says_which():
    mechanism = arm()
    system = build_system(mechanism)
    signals, _ = pack_signals(mechanism, [], 0.1)
    start = State(0.0, np.array([0.05, 0.0, 0.0]), np.zeros(3))
    options = IntegrationOptions(alpha=0.0, beta=0.0)
    with pytest.raises(
        ConstraintDriftError,
        match=r"joints come apart, by 0\.05 m in pin, at t = .*; choose a finer tolerance, .*larger Baumgarte",
    ):
        integrate(system, signals, start, np.array([0.0, 0.1]), options=options)


def test_loops_that_contradict_a_law_are_refused_at_the_start():
    # The crank of a parallelogram turns one way, its rocker the other.
    linkage = parallelogram(2)
    laws = (
        PrescribedAngle("left", "G0", polynomial(1.0, 1.0)),
        PrescribedAngle("right", "G1", polynomial(1.0, -1.0)),
    )
    mechanism = replace(linkage, motors=(), prescribed=laws)
    with pytest.raises(InconsistentConstraintsError, match="velocities") as caught:
        consistent_state(build_system(mechanism), mechanism.assembly())
    assert "left" in str(caught.value)
    assert "right" in str(caught.value)


# --- Multipliers of least norm -------------------------------------------------------------------------------------


def test_a_pin_driven_twice_shares_its_force():
    single = arm()
    double = replace(single, joints=(*single.joints, joint("again", "ground.O", "arm.O")))
    (_, one), (system, two) = simulate(single, 0.5), simulate(double, 0.5)
    np.testing.assert_allclose(two.q, one.q, rtol=0, atol=1e-9)
    for axis in "xy":
        first, second = (two.multipliers[:, system.rows.index(f"{name} {axis}")] for name in ("pin", "again"))
        np.testing.assert_allclose(first, second, rtol=0, atol=1e-10)
        np.testing.assert_allclose(first + second, one.multipliers[:, "xy".index(axis)], rtol=0, atol=1e-6)
    assert np.max(np.abs(first)) > 1.0


def test_multipliers_of_a_redundant_platform_are_those_of_the_pseudo_inverse():
    """Three parallel rods: of all multipliers that give the motion's accelerations, the least."""
    # Between steps multipliers and accelerations are interpolated.
    system, solution = simulate(parallelogram(), 0.3, torques=(0.5,), tolerance=1e-8)
    _, basic = simulate(parallelogram(2), 0.3, torques=(0.5,), tolerance=1e-8)
    assert solution.status == basic.status == "complete"
    moved = 0.0
    for q, v, a, lam in zip(solution.q, solution.v, solution.a, solution.multipliers, strict=True):
        J = system.jacobian(q)
        null = np.linalg.svd(J)[0][:, -1]
        assert np.linalg.norm(null @ J) < 1e-6
        assert abs(null @ lam) < 1e-6 * np.linalg.norm(lam)
        # The forces they exert are still those the motion needs; weights by hand.
        weight = np.zeros(system.n)
        for body, rigid in zip(system.bodies, system.mechanism.bodies, strict=True):
            c, s = np.cos(q[body.angle]), np.sin(q[body.angle])
            x = c * rigid.centre_of_mass[0] - s * rigid.centre_of_mass[1]
            weight[body.offset + 1] = -9.81 * rigid.mass
            weight[body.angle] = -9.81 * rigid.mass * x
        weight[system.body("rod0").angle] += 0.5
        inertia = twins.system_mass_matrix(system, q) @ a + twins.system_forces(system, q, v)
        moved = max(moved, np.max(np.abs(v)))
        np.testing.assert_allclose(J.T @ lam, weight - inertia, rtol=0, atol=5e-4)
    assert moved > 0.3
