"""Second-order geometry: against a numerical Lagrangian of points that move as the theory says, and against itself."""

import dataclasses
from functools import cache
from itertools import pairwise

import numpy as np
import pytest

import twins
from paraflex.dynamics import build_system, consistent_state, pack_signals
from paraflex.dynamics.points import point_motion
from paraflex.errors import InputError
from paraflex.fem import ReferenceCondition
from paraflex.integrators import IntegrationOptions, integrate
from paraflex.kernel.bending import note_all_axial_forces
from paraflex.kernel.bodies import body_terms, system_energy
from paraflex.kernel.joints import body_joints, start_rows
from paraflex.kernel.linear import factor_system, solve_system
from paraflex.kernel.metric import mass_norm
from paraflex.kernel.packed import INDEX_1, OMEGA2, make_scratch
from paraflex.mechanism import (
    Assembly,
    Curvature,
    FlexibleBeam,
    Geometry,
    LumpedMass,
    Material,
    Mechanism,
    PointRef,
    RevoluteJoint,
    RigidBody,
    Section,
    raparm_i,
)
from paraflex.tracking import plan_tracking

RUBBER = Material(youngs_modulus=5e6, density=1100.0)


def beam(name="beam", **changes):
    values = {
        "name": name,
        "length": 0.5,
        "section": Section.rectangle(0.03, 0.02),
        "material": RUBBER,
        "points": {"A": 0.0, "B": 0.2, "C": 0.5},
        "elements": (1, 2),
        "lumps": (LumpedMass("B", 0.1, 2e-4), LumpedMass("C", 0.3, 5e-4)),
        "curvature": Curvature.SHARED,
    }
    return FlexibleBeam(**(values | changes))


def chain(reference=ReferenceCondition.CANTILEVER, geometry=Geometry.SECOND_ORDER):
    """Two soft beams and a rigid body, hinged in a row to the ground: joints at an end, a middle point, both sides."""
    return Mechanism(
        name="chain",
        ground={"O": (0.1, -0.2)},
        bodies=(
            beam("one", reference=reference),
            beam("two", reference=reference),
            RigidBody("block", 0.5, 0.01, (0.05, 0.0), {"P": (0.0, 0.02)}),
        ),
        joints=(
            RevoluteJoint("pin", PointRef.parse("ground.O", ""), PointRef("one", "A")),
            RevoluteJoint("elbow", PointRef("one", "C"), PointRef("two", "B")),
            RevoluteJoint("tip", PointRef("two", "C"), PointRef("block", "P")),
        ),
        assemblies=(Assembly("bent", {"one": 0.3, "two": -1.1, "block": 0.7}),),
        geometry=geometry,
    )


def random_state(system, seed, size=1.0):
    """q, v, a with bending slopes of some tenths of a radian."""
    rng = np.random.default_rng(seed)
    q, v, a = rng.normal(size=(3, system.n))
    for body in system.bodies:
        if body.nf:
            # Axial modes have no slopes: a tenth of the length for them.
            D = body.integrals.D
            scale = np.linalg.norm(D[2::4], axis=0) + 10.0 * np.linalg.norm(D[0::4], axis=0)
            weight = size * 0.3 / scale / np.arange(1, body.nf + 1)
            for x in (q, v, a):
                x[body.flexible] *= weight
    return q, v, a


# --- The point of view of mass points, exact where the kernels use a quadrature --------------------------------------


def shortening(nodes, x, D, u):
    """f(x) = int_0^x (N2' u)^2 dx, exactly: its integrand is of degree eight in an element."""
    rows, weights = slopes_before(tuple(nodes), float(x))
    return weights @ (rows @ (D @ u)) ** 2


@cache
def slopes_before(nodes, x):
    """Rows that give the slope at Gauss points between 0 and x, and weights of these."""
    z, w = np.polynomial.legendre.leggauss(6)
    rows, weights = [], []
    for a, b in pairwise(nodes):
        end = min(b, x)
        if end <= a:
            break
        rows += [twins.beam_slope(np.array(nodes), a + (end - a) * (1 + zk) / 2) for zk in z]
        weights += [0.5 * (end - a) * wk for wk in w]
    size = len(twins.beam_slope(np.array(nodes), 0.0))
    return np.array(rows).reshape(-1, size), np.array(weights)


def place(point, nodes, D, u):
    f = shortening(nodes, point.x0[0], D, u)
    return point.x0 + point.N @ u - 0.5 * f * np.array([1.0, 0.0])


def kinetic_energy(points, nodes, D, q, v):
    """Half the sum of m p'.p' + J (phi' + N2' u')^2, with p' from the chain rule on p(q)."""
    total = 0.0
    for point in points:
        s = place(point, nodes, D, q[3:])
        ds = bilinear_rate(point, nodes, D, q[3:], v[3:])
        p = v[:2] + twins.rotation(q[2]) @ (v[2] * twins.E @ s + ds)
        total = total + 0.5 * point.mass * (p @ p) + 0.5 * point.inertia * (v[2] + point.slope @ v[3:]) ** 2
    return total


def bilinear_rate(point, nodes, D, u, du):
    """s': f is a quadratic form, so f' = f(u + u') - f(u) - f(u') exactly."""
    f = [shortening(nodes, point.x0[0], D, x) for x in (u + du, u, du)]
    return point.N @ du - 0.5 * (f[0] - f[1] - f[2]) * np.array([1.0, 0.0])


@pytest.mark.parametrize("reference", list(ReferenceCondition))
def test_forces_are_those_of_a_numerical_lagrangian(reference):
    """d/dt dT/dq' - dT/dq by the complex step; the kernels' quadrature of f is off by little."""
    system = build_system(chain(reference))
    body = system.body("one")
    nodes, D = body.mesh.nodes, body.integrals.D
    points = twins.masses_of(system, "one")
    q, v, a = random_state(system, 3)
    f = np.zeros(system.n)
    body_terms(system.packed, 0, q, v, a, f, make_scratch(system.packed))
    found = f[body.all] - np.concatenate([np.zeros(3), body.modes.omega**2 * q[body.flexible]])
    q, v, a = q[body.all], v[body.all], a[body.all]

    def energy(q, v):
        return kinetic_energy(points, nodes, D, q, v)

    unit = np.eye(q.size)
    expected = np.zeros(q.size)
    for j in range(q.size):

        def momentum(q, v, e=unit[j]):
            return energy(q, v + e) - energy(q, v) - energy(q, e)

        expected[j] = momentum(q, a) + twins.along(lambda x: momentum(x, v), q, v)
        expected[j] -= twins.along(lambda x: energy(x, v), q, unit[j])
    np.testing.assert_allclose(found, expected, rtol=0, atol=2e-4 * np.max(np.abs(expected)))
    linear = np.zeros(system.n)
    plain = build_system(chain(reference, Geometry.LINEAR))
    body_terms(plain.packed, 0, *random_state(system, 3), linear, make_scratch(plain.packed))
    # What is tested is not small.
    shape = linear[body.all] - f[body.all]
    assert np.max(np.abs(shape)) > 0.02 * np.max(np.abs(expected))


def mass_point_forces(body, q, v, a):
    """The forces of a body's inertia by the sum over its mass points, with the weights of f as they are."""
    points, e = body.points, body.flexible
    (w, dw), E = (v[body.angle], a[body.angle]), twins.E
    turn = twins.rotation(q[body.angle])
    slopes = points.slope[: points.weights.shape[1]]
    s0, s1, s2 = (slopes @ x[e] for x in (q, v, a))
    forces = np.zeros(3 + body.nf)
    for k, weights in enumerate(points.weights):
        shift = -0.5 * np.array([weights @ s0**2, 2.0 * weights @ (s0 * s1), 2.0 * weights @ (s1**2 + s0 * s2)])
        s, ds, dds = (points.N[k] @ x[e] + [f, 0.0] for x, f in zip((q, v, a), shift, strict=True))
        s = s + [points.x[k], 0.0]
        relative = turn.T @ a[body.position] + dw * E @ s - w * w * s + 2.0 * w * E @ ds + dds
        by_u = points.N[k] - np.outer([1.0, 0.0], (weights * s0) @ slopes)
        rotary = points.inertia[k] * (dw + points.slope[k] @ a[e])
        forces[:2] += points.mass[k] * turn @ relative
        forces[2] += points.mass[k] * (E @ s) @ relative + rotary
        forces[3:] += points.mass[k] * by_u.T @ relative + rotary * points.slope[k]
    return forces


@pytest.mark.parametrize("lumps", ["ABC", "AABBCCC", "C", ""])
@pytest.mark.parametrize("elements", [(1, 1), (1, 2), (3, 4)])
def test_elements_with_any_number_of_lumps_have_the_forces_of_their_mass_points(lumps, elements):
    """More than two lumps do not fit into the vector of an element's Gauss points: it then has two vectors."""
    masses = tuple(LumpedMass(point, 0.1 * k + 0.1, 1e-4 * k) for k, point in enumerate(lumps))
    made = beam("one", lumps=masses, elements=elements, curvature=Curvature.SEPARATE)
    system = build_system(dataclasses.replace(chain(), bodies=(made, *chain().bodies[1:])))
    body, (q, v, a) = system.body("one"), random_state(system, 7)
    f = np.zeros(system.n)
    body_terms(system.packed, 0, q, v, a, f, make_scratch(system.packed))
    expected = mass_point_forces(body, q, v, a)
    expected[3:] += body.modes.omega**2 * q[body.flexible]
    np.testing.assert_allclose(f[body.all], expected, rtol=0, atol=1e-11 * np.max(np.abs(expected)))


def test_energy_is_that_of_the_points():
    system = build_system(chain())
    q, v, _ = random_state(system, 5)
    kinetic, strain = system_energy(system.packed, q, v, make_scratch(system.packed))
    total = 0.0
    for name in ("one", "two"):
        body = system.body(name)
        points = twins.masses_of(system, name)
        total += kinetic_energy(points, body.mesh.nodes, body.integrals.D, q[body.all], v[body.all])
    block = system.body("block")
    total += twins.kinetic_energy(block.integrals, q[block.all], v[block.all])
    assert kinetic == pytest.approx(total, rel=1e-5)
    assert strain == pytest.approx(sum(twins.strain_energy(b.integrals, q[b.all]) for b in system.bodies), rel=1e-9)


def test_joints_follow_the_shortened_points():
    """Phi, its Jacobian and Phi'' along a motion, by differences; points of the dataset stand where joints are."""
    system = build_system(chain())
    signals, _ = pack_signals(system.mechanism, [], 1.0)
    q, v, a = random_state(system, 8)
    h = 1e-5

    def at(t):
        return system.constraints(signals, 0.0, q + t * v + 0.5 * t**2 * a, v + t * a)

    phi, rate = at(0.0)
    np.testing.assert_allclose((at(h)[0] - at(-h)[0]) / (2 * h), rate, rtol=0, atol=1e-7)
    np.testing.assert_allclose(system.jacobian(q) @ v, rate, rtol=0, atol=1e-12)
    ws = system.workspace()
    start_rows(system.packed, signals, 0.0, INDEX_1, ws.rows)
    for i in range(len(system.bodies)):
        body_joints(system.packed, i, q, v, a, np.zeros(system.m), INDEX_1, ws.scratch, ws.f, ws.rows)
    np.testing.assert_allclose((at(h)[1] - at(-h)[1]) / (2 * h), ws.rows, rtol=0, atol=1e-7)
    elbow = [
        point_motion(system, ref, q[None], v[None], a[None]) for ref in (PointRef("two", "B"), PointRef("one", "C"))
    ]
    r = system.rows.index("elbow x")
    np.testing.assert_allclose((elbow[0].position - elbow[1].position)[0], phi[r : r + 2], rtol=0, atol=1e-14)
    np.testing.assert_allclose((elbow[0].velocity - elbow[1].velocity)[0], rate[r : r + 2], rtol=0, atol=1e-13)
    np.testing.assert_allclose(
        (elbow[0].acceleration - elbow[1].acceleration)[0], ws.rows[r : r + 2], rtol=0, atol=1e-12
    )
    one = system.body("one")
    end = twins.masses_of(system, "one")[-1]
    expected = q[:2] + twins.rotation(q[2]) @ place(end, one.mesh.nodes, one.integrals.D, q[one.flexible])
    np.testing.assert_allclose(elbow[1].position[0], expected, rtol=0, atol=1e-13)


def dense_system(system, q, b):
    """[M + b K, Phi_q^T; Phi_q, 0] with M column by column from the equations of motion, and M."""
    matrix = np.zeros((system.n + system.m, system.n + system.m))
    matrix[system.n :, : system.n] = system.jacobian(q)
    matrix[: system.n, system.n :] = system.jacobian(q).T
    still, scratch = np.zeros(system.n), make_scratch(system.packed)
    modal = system.packed.modal.copy()
    modal[OMEGA2] = 0.0
    inert = system.packed._replace(modal=modal)
    base, column = np.zeros((2, system.n))
    for i in range(len(system.bodies)):
        body_terms(inert, i, q, still, still, base, scratch)
    for j in range(system.n):
        unit = np.zeros(system.n)
        unit[j] = 1.0
        for i in range(len(system.bodies)):
            body_terms(inert, i, q, still, unit, column, scratch)
        matrix[: system.n, j] = column - base
    mass = matrix[: system.n, : system.n].copy()
    for body in system.bodies:
        k = np.arange(body.flexible.start, body.flexible.stop)
        matrix[k, k] += b * body.modes.omega**2
    return matrix, mass


def check_solution(system, ws, matrix):
    right = np.random.default_rng(1).normal(size=system.n + system.m)
    x, mu = right[: system.n].copy(), right[system.n :].copy()
    solve_system(system.packed, ws, x, mu)
    expected = np.linalg.solve(matrix, right)
    np.testing.assert_allclose(np.concatenate([x, mu]), expected, rtol=0, atol=1e-9 * np.max(np.abs(expected)))


@pytest.mark.parametrize("b", [0.0, 1e-6])
def test_the_factored_system_solves_the_dense_one(b):
    system = build_system(chain())
    q, v, _ = random_state(system, 13)
    ws = system.workspace()
    assert factor_system(system.packed, b, q, ws) == 0
    matrix, mass = dense_system(system, q, b)
    check_solution(system, ws, matrix)
    assert np.linalg.eigvalsh(mass).min() > 0.0
    assert mass_norm(system.packed, ws, v) ** 2 == pytest.approx(v @ mass @ v / system.total_mass, rel=1e-10)


@pytest.mark.parametrize("source", ["inertia forces", "joint forces"])
def test_the_iteration_matrix_has_the_geometric_stiffness(source):
    """Forces on u are linear in u where bodies are only pushed along: their differences are K and K_g exactly."""
    system = build_system(chain())
    q, v, a = random_state(system, 17)
    v[:] = 0.0
    pushed = np.zeros(system.n)
    lam = np.zeros(system.m)
    if source == "inertia forces":
        for body in system.bodies:
            pushed[body.position] = 30.0 * a[body.position]
    else:
        lam[:] = 1e3 * np.random.default_rng(2).normal(size=system.m)
    b, ws = 1e-5, system.workspace()

    def forces(q):
        f, rows = np.zeros(system.n), np.zeros(system.m)
        for i in range(len(system.bodies)):
            body_terms(system.packed, i, q, v, pushed, f, ws.scratch)
            body_joints(system.packed, i, q, v, pushed, lam, INDEX_1, ws.scratch, f, rows)
        return f

    matrix, _ = dense_system(system, q, 0.0)
    share = []
    for body in (body for body in system.bodies if body.nf):
        k = np.arange(body.flexible.start, body.flexible.stop)
        base = forces(q)
        tangent = np.column_stack([forces(q + unit)[k] - base[k] for unit in np.eye(system.n)[k]])
        matrix[np.ix_(k, k)] += b * tangent
        share.append(np.abs(b * (tangent - np.diag(body.modes.omega**2))).max(initial=0.0))
    # Beside the unit mass matrix: far more than the tolerance, and not so much that a beam would buckle.
    assert max(share) > 0.05
    note_all_axial_forces(system.packed, q, v, pushed, lam, ws, ws.geometric)
    assert factor_system(system.packed, b, q, ws) == 0
    check_solution(system, ws, matrix)


@pytest.mark.parametrize("mode", ["++++", "+-+-"])
def test_newton_converges_as_fast_as_in_the_linear_case(square, mode):
    rates = []
    for geometry in Geometry:
        task = plan_tracking(raparm_i().with_geometry(geometry), square, duration=0.1, samples=11)
        solution = task.simulate(mode, options=IntegrationOptions(tolerance=1e-5)).solution
        rates.append(solution.newton_iterations / (solution.steps + solution.rejected))
    assert rates[1] < 1.1 * rates[0]


def test_small_deflections_are_the_linear_ones():
    bent, linear = build_system(chain()), build_system(chain(geometry=Geometry.LINEAR))
    differences = []
    for size in (1e-3, 1e-4):
        state = random_state(bent, 21, size)
        forces = np.zeros((2, bent.n))
        body_terms(bent.packed, 1, *state, forces[0], make_scratch(bent.packed))
        body_terms(linear.packed, 1, *state, forces[1], make_scratch(linear.packed))
        differences.append(np.max(np.abs(forces[0] - forces[1])))
    # Of first order: products of the deflection with the accelerations of the undeformed body.
    assert 1e-5 < differences[0] < 1e-2
    assert differences[1] == pytest.approx(0.1 * differences[0], rel=0.02)


def test_a_swinging_soft_pendulum_keeps_its_energy():
    """Deflections of nearly half the length, no loads: T + U stays, and the better the smaller the tolerance."""
    system = build_system(
        Mechanism(
            name="pendulum",
            ground={"O": (0.0, 0.0)},
            bodies=(beam(elements=(2, 2), reference=ReferenceCondition.CANTILEVER),),
            joints=(RevoluteJoint("pin", PointRef.parse("ground.O", ""), PointRef("beam", "A")),),
            assemblies=(Assembly("level", {"beam": 0.0}),),
            geometry=Geometry.SECOND_ORDER,
        )
    )
    x = system.bodies[0].mesh.nodes
    nodal = np.zeros(4 * x.size)
    nodal[1::4], nodal[2::4], nodal[3::4] = 0.9 * x**2, 1.8 * x, 1.8
    velocity = np.zeros(system.n)
    velocity[system.bodies[0].angle] = 4.0
    state = consistent_state(system, system.mechanism.assembly(), deflection={"beam": nodal}, velocity=velocity)
    signals, _ = pack_signals(system.mechanism, [], 1.0)
    worst = []
    for tolerance in (1e-3, 1e-4):
        solution = integrate(
            system, signals, state, np.linspace(0.0, 0.5, 11), options=IntegrationOptions(tolerance=tolerance)
        )
        total = solution.kinetic_energy[0] + solution.strain_energy[0]
        assert solution.strain_energy[0] > 0.05 * total
        worst.append(solution.energy_balance_max / total)
    assert worst[0] < 1e-2
    assert worst[1] < 0.3 * worst[0]


def test_geometry_is_a_choice_of_the_mechanism():
    mechanism = chain(geometry=Geometry.LINEAR)
    assert mechanism.with_geometry("second-order") == dataclasses.replace(mechanism, geometry=Geometry.SECOND_ORDER)
    with pytest.raises(InputError, match=r'geometry: unknown geometry .*second-oder.* did you mean "second-order"'):
        mechanism.with_geometry("second-oder")
    assert build_system(mechanism.with_geometry("second-order").rigid()).packed.bending is None
