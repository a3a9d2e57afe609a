"""Natural frequencies of assembled mechanisms: closed forms, textbook roots, differences of the accelerations."""

from dataclasses import replace

import numpy as np
import pytest
import scipy.linalg

import twins
from paraflex.dynamics import State, build_system, consistent_state, natural_frequencies, static_equilibrium
from paraflex.dynamics.state import mass_matrix
from paraflex.fem import ReferenceCondition
from paraflex.mechanism import (
    Assembly,
    Curvature,
    FlexibleBeam,
    LinearSpring,
    Material,
    Mechanism,
    Motor,
    PointForce,
    PointRef,
    RevoluteJoint,
    RigidBody,
    Section,
    TorsionalSpring,
)

# Roots of 1 + cos x cosh x = 0 and of tan x = tanh x.
CLAMPED_FREE = np.array([1.8751040687119611, 4.694091132974175, 7.854757438237613])
HINGED_FREE = np.array([3.9266023120479185, 7.068582745628732])
G = 9.81


def joint(name: str, a: str, b: str) -> RevoluteJoint:
    return RevoluteJoint(name, PointRef.parse(a), PointRef.parse(b))


def chain(angles=(0.0, 0.0), *, offset=0.0, gravity=(0.0, 0.0), springs=(3.0, 2.0), loads=()) -> Mechanism:
    """Two bars of unit length on a pin, springs at both joints at rest where all lies along x.

    The origin of each body frame lies so far along the bar: where it does cannot matter.
    """
    masses = (2.0, 1.5)
    bars = tuple(
        RigidBody(f"bar{k}", m, m / 12.0, (0.5 - offset, 0.0), {"A": (-offset, 0.0), "B": (1.0 - offset, 0.0)})
        for k, m in enumerate(masses)
    )
    return Mechanism(
        name="chain",
        ground={"O": (0.0, 0.0)},
        bodies=bars,
        joints=(joint("O", "ground.O", "bar0.A"), joint("P", "bar0.B", "bar1.A")),
        motors=(Motor("m0", "O"), Motor("m1", "P")),
        springs=tuple(
            TorsionalSpring(f"s{k}", at, c) for k, (at, c) in enumerate(zip("OP", springs, strict=True)) if c
        ),
        loads=loads,
        gravity=gravity,
        assemblies=(Assembly("out", dict(zip(("bar0", "bar1"), angles, strict=True))),),
    )


def vibration(mechanism, held=(), **options):
    system = build_system(mechanism)
    return natural_frequencies(system, consistent_state(system, mechanism.assembly()), held, **options)


def chain_matrices(angles, springs, gravity):
    """Mass and stiffness of the chain in its two absolute angles, by hand, about a pose held by constant torques."""
    (m0, m1), (a0, a1) = (2.0, 1.5), angles
    coupling = 0.5 * m1 * np.cos(a1 - a0)
    M = np.array([[m0 / 3.0 + m1, coupling], [coupling, m1 / 3.0]])
    K = np.array([[springs[0] + springs[1], -springs[1]], [-springs[1], springs[1]]])
    # Potential energy of weight: g (m0 sin a0 / 2 + m1 (sin a0 + sin a1 / 2)), gravity along -y.
    K -= gravity * np.diag([(0.5 * m0 + m1) * np.sin(a0), 0.5 * m1 * np.sin(a1)])
    return M, K


@pytest.mark.parametrize("offset", [0.0, 0.5, -0.3])
@pytest.mark.parametrize("gravity", [0.0, G])
@pytest.mark.parametrize("angles", [(0.0, 0.0), (-1.3, -0.4), (0.7, 2.0)])
def test_two_bars_on_springs_have_the_frequencies_of_their_two_equations(angles, gravity, offset):
    mechanism = chain(angles, gravity=(0.0, -gravity), offset=offset)
    found = vibration(mechanism, torque_at=("O", "P"))
    M, K = chain_matrices(angles, (3.0, 2.0), gravity)
    expected = scipy.linalg.eigh(K, M, eigvals_only=True)
    np.testing.assert_allclose(found.squares, expected, rtol=1e-9)
    # Torques hold the pose: nothing is left unbalanced.
    assert found.acceleration < 1e-12


def test_forces_left_unbalanced_are_told_by_the_acceleration():
    """A level bar let go: the centre falls with 3 g / 4, the bar turns with 3 g / (2 l)."""
    bar = chain(springs=(0.0, 0.0), gravity=(0.0, -G))
    alone = replace(
        bar, bodies=bar.bodies[:1], joints=bar.joints[:1], motors=bar.motors[:1],
        assemblies=(Assembly("out", {"bar0": 0.0}),),
    )  # fmt: skip
    # Root mean square of 1.5 g x / l along a uniform bar.
    assert vibration(alone).acceleration == pytest.approx(1.5 * G / np.sqrt(3.0), rel=1e-12)
    assert vibration(alone, torque_at=("O",)).acceleration < 1e-12


def test_an_upright_bar_falls_and_a_free_one_moves_freely():
    upright = chain((np.pi / 2, np.pi / 2), springs=(0.0, 0.0), gravity=(0.0, -G))
    found = vibration(upright)
    M, K = chain_matrices((np.pi / 2, np.pi / 2), (0.0, 0.0), G)
    np.testing.assert_allclose(found.squares, scipy.linalg.eigh(K, M, eigvals_only=True), rtol=1e-9)
    assert np.all(found.squares < 0.0)
    assert np.all(found.frequencies == 0.0)
    assert np.all(vibration(chain((0.3, 1.0), springs=(0.0, 0.0))).squares == 0.0)


def test_a_load_has_a_stiffness_of_its_own():
    """A pull along a bar straightens it like gravity: omega^2 = F l / (m l^2 / 3)."""
    pull = PointForce("pull", PointRef("bar1", "B"), (6.0, 0.0))
    found = vibration(chain(springs=(0.0, 0.0), loads=(pull,)), held=("O",))
    assert found.squares == pytest.approx([6.0 / (1.5 / 3.0)], rel=1e-9)
    assert found.acceleration < 1e-12


def test_a_mass_between_two_springs():
    """Along the stretched springs 2 k, across them 2 T / l with T the tension, turning about the middle none."""
    k, free, length, m = 50.0, 0.3, 0.5, 2.0
    block = RigidBody("block", m, 0.1, (0.0, 0.0), {"C": (0.0, 0.0)})
    mechanism = Mechanism(
        name="block",
        ground={"L": (-length, 0.0), "R": (length, 0.0)},
        bodies=(block,),
        joints=(),
        linear_springs=tuple(
            LinearSpring(side, PointRef("ground", side), PointRef("block", "C"), k, free) for side in "LR"
        ),
        assemblies=(Assembly("middle", {"block": 0.0}),),
    )
    system = build_system(mechanism)
    found = natural_frequencies(system, State(0.0, np.zeros(3), np.zeros(3)))
    tension = k * (length - free)
    np.testing.assert_allclose(found.squares, [0.0, 2 * tension / length / m, 2 * k / m], rtol=1e-9, atol=0)


def test_a_spring_between_two_bodies_ties_them():
    """Two upright bars on pins, a stretched spring across at height h: its stretch, and its pull as both lean."""
    k, free, apart, h = 80.0, 0.3, 0.5, 0.6
    bars = tuple(
        RigidBody(name, m, m / 12.0, (0.5, 0.0), {"A": (0.0, 0.0), "C": (h, 0.0)})
        for name, m in (("a", 1.0), ("b", 3.0))
    )
    mechanism = Mechanism(
        name="pair",
        ground={"L": (0.0, 0.0), "R": (apart, 0.0)},
        bodies=bars,
        joints=(joint("L", "ground.L", "a.A"), joint("R", "ground.R", "b.A")),
        motors=(Motor("left", "L"), Motor("right", "R")),
        linear_springs=(LinearSpring("s", PointRef("a", "C"), PointRef("b", "C"), k, free),),
        assemblies=(Assembly("up", {"a": np.pi / 2, "b": np.pi / 2}),),
    )
    found = vibration(mechanism, torque_at=("L", "R"))
    # Side by side they lean against the spring; how far apart their ends are in height is of second order.
    K = k * h**2 * np.array([[1.0, -1.0], [-1.0, 1.0]])
    M = np.diag([1.0 / 3.0, 1.0])
    np.testing.assert_allclose(found.squares, scipy.linalg.eigh(K, M, eigvals_only=True), rtol=1e-9, atol=1e-9)
    # Leaning to begin with, the pull turns with the bars: K from the energy by differences.
    leaning = replace(mechanism, assemblies=(Assembly("out", {"a": np.pi / 2 + 0.4, "b": np.pi / 2 - 0.3}),))

    def energy(x, y):
        span = np.array([apart - h * np.sin(y) + h * np.sin(x), h * (np.cos(y) - np.cos(x))])
        return 0.5 * k * (np.linalg.norm(span) - free) ** 2

    d, at = 1e-4, (0.4, -0.3)
    hessian = np.array(
        [
            [
                sum(
                    s * t * energy(*(np.array(at) + d * (s * np.eye(2)[i] + t * np.eye(2)[j])))
                    for s in (1, -1)
                    for t in (1, -1)
                )
                / (4 * d**2)
                for j in range(2)
            ]
            for i in range(2)
        ]
    )
    found = vibration(leaning, torque_at=("L", "R"))
    np.testing.assert_allclose(found.squares, scipy.linalg.eigh(hessian, M, eigvals_only=True), rtol=1e-5)


def beam_on_a_motor(condition, elements=6) -> Mechanism:
    beam = FlexibleBeam(
        "beam",
        0.8,
        Section.rectangle(0.03, 0.004),
        Material(70e9, 2700.0),
        points={"A": 0.0, "B": 0.8},
        elements=elements,
        reference=condition,
        curvature=Curvature.SHARED,
    )
    return Mechanism(
        name="beam",
        ground={"O": (0.0, 0.0)},
        bodies=(beam,),
        joints=(joint("O", "ground.O", "beam.A"),),
        motors=(Motor("drive", "O"),),
        assemblies=(Assembly("slanting", {"beam": 0.6}),),
    )


@pytest.mark.parametrize("geometry", ["linear", "second-order"])
def test_a_beam_on_a_held_motor_is_clamped_and_on_a_free_one_hinged(condition, geometry):
    mechanism = beam_on_a_motor(condition).with_geometry(geometry)
    unit = np.sqrt(70e9 * 0.03 * 0.004**3 / 12.0 / (2700.0 * 0.03 * 0.004)) / 0.8**2
    held, free = vibration(mechanism, ("O",)), vibration(mechanism)
    np.testing.assert_allclose(held.frequencies[:3], CLAMPED_FREE**2 * unit, rtol=1e-6)
    assert free.frequencies[0] == 0.0
    np.testing.assert_allclose(free.frequencies[1:3], HINGED_FREE**2 * unit, rtol=1e-6)
    # As many modes as coordinates that are free, of unit modal mass.
    assert (held.squares.size, free.squares.size) == (24, 25)
    system = build_system(mechanism)
    q = consistent_state(system, mechanism.assembly()).q
    np.testing.assert_allclose(held.shapes.T @ mass_matrix(system, q) @ held.shapes, np.eye(24), rtol=0, atol=1e-8)


def test_a_taut_pendulum_of_second_order_is_stiffer_than_one_of_linear_geometry():
    """A hanging beam under strong gravity: Southwell's bound, which the linear shape falls short of."""
    beam = beam_on_a_motor(ReferenceCondition.CANTILEVER, 3)
    hanging = replace(beam, gravity=(0.0, -400.0), assemblies=(Assembly("down", {"beam": -np.pi / 2}),))
    squares = {}
    for geometry in ("linear", "second-order"):
        mechanism = hanging.with_geometry(geometry)
        system = build_system(mechanism)
        state = static_equilibrium(system, consistent_state(system, mechanism.assembly()), ("O",))
        found = natural_frequencies(system, state, ("O",))
        assert found.acceleration < 1e-6
        squares[geometry] = found.squares[0]
    unloaded = vibration(beam, ("O",)).squares[0]
    # Of a cantilever hanging under its own weight: omega^2 = omega_0^2 + 1.5703 g/l, to first order in g.
    shape = CLAMPED_FREE[0] / 0.8
    x = np.linspace(0.0, 0.8, 20001)
    ratio = (np.cos(shape * 0.8) + np.cosh(shape * 0.8)) / (np.sin(shape * 0.8) + np.sinh(shape * 0.8))
    bend = np.cosh(shape * x) - np.cos(shape * x) - ratio * (np.sinh(shape * x) - np.sin(shape * x))
    tension = np.trapezoid(np.gradient(bend, x) ** 2 * (0.8 - x), x) / np.trapezoid(bend**2, x)
    assert squares["second-order"] == pytest.approx(unloaded + 400.0 * tension, rel=0.02)
    assert abs(squares["linear"] - squares["second-order"]) > 0.1 * squares["second-order"]


# --- RAParM-I against differences of the accelerations ---------------------------------------------------------------


def accelerations(system, q, held):
    """Accelerations at rest by the twins, angles of the held joints kept."""
    C = np.vstack([twins.constraint_jacobian(system, q), *(twins.joint_angle_row(system, name) for name in held)])
    n, m = system.n, len(C)
    M = twins.system_mass_matrix(system, q)
    left = np.block([[M, C.T], [C, np.zeros((m, m))]])
    right = np.concatenate([-twins.system_forces(system, q, np.zeros(n)), np.zeros(m)])
    return np.linalg.solve(left, right)[:n]


@pytest.mark.parametrize("held", [(), ("A1", "A2"), ("A1", "D1", "A2", "D2")], ids=["free", "two", "all"])
def test_raparm_as_differences_of_the_accelerations_have_it(raparm, held):
    # Few modes: differences of accelerations at 1e6 rad/s would say nothing about those at 10.
    mechanism = raparm.with_beams(modes=2)
    system = build_system(mechanism)
    assert {motor.joint for motor in mechanism.motors} == {"A1", "D1", "A2", "D2"}
    rigid = build_system(mechanism.rigid())
    q = np.zeros(system.n)
    for body, source in zip(system.bodies, rigid.bodies, strict=True):
        q[body.offset : body.offset + 3] = consistent_state(rigid, mechanism.assembly()).q[source.all]
    rows = [twins.joint_angle_row(system, name) for name in held]
    basis = scipy.linalg.null_space(np.vstack([twins.constraint_jacobian(system, q), *rows]))
    step = 1e-5
    columns = []
    for direction in basis.T:
        # Back onto the constraints: their gap is of the second order and cancels in central differences. Those of the
        # fourth order allow a step at which rounding does not show.
        once, twice = (
            accelerations(system, q + place * direction, held) - accelerations(system, q - place * direction, held)
            for place in (step, 2.0 * step)
        )
        columns.append((8.0 * once - twice) / (12.0 * step))
    operator = -np.linalg.lstsq(basis, np.column_stack(columns), rcond=None)[0]
    expected = np.sort(np.linalg.eigvals(operator).real)
    found = natural_frequencies(system, State(0.0, q, np.zeros(system.n)), held)
    assert found.acceleration < 1e-9
    assert found.squares.size == expected.size == system.n - system.m - len(held)
    np.testing.assert_allclose(found.squares, expected, rtol=1e-5, atol=1e-6 * expected[-1] if not held else 0.0)
    if not held:
        assert np.all(found.squares[:2] == 0.0)
        assert found.squares[2] > 1.0


def test_lowest_frequencies_of_many_coordinates_are_those_of_the_dense_problem(raparm, monkeypatch):
    system = build_system(raparm)
    state = consistent_state(system, raparm.assembly())
    dense = natural_frequencies(system, state, ("A1", "A2"))
    assert dense.complete
    monkeypatch.setattr("paraflex.dynamics.linearise.DENSE_COORDINATES", 10)
    sparse = natural_frequencies(system, state, ("A1", "A2"))
    assert not sparse.complete
    np.testing.assert_allclose(sparse.squares, dense.squares[:10], rtol=1e-7)
    M = mass_matrix(system, state.q)
    np.testing.assert_allclose(sparse.shapes.T @ M @ sparse.shapes, np.eye(10), rtol=0, atol=1e-8)
