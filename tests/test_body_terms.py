"""Terms of a body, and the linear system of an iteration: kernels against twins, and those against a Lagrangian."""

from __future__ import annotations

import numpy as np
import pytest

import twins
from conftest import make_linkage
from paraflex.dynamics import build_system
from paraflex.kernel.bodies import body_energy, body_terms, system_energy
from paraflex.kernel.factor import factor_bodies
from paraflex.kernel.linear import factor_system, orient, solve_system
from paraflex.kernel.metric import mass_norm
from paraflex.kernel.packed import OMEGA2, make_scratch
from paraflex.kernel.stage import equations
from paraflex.mechanism import (
    FlexibleBeam,
    LumpedMass,
    Material,
    Mechanism,
    Motor,
    PointRef,
    RevoluteJoint,
    RigidBody,
    Section,
    raparm_i,
)

_ALUMINIUM = Material(youngs_modulus=70e9, density=2700.0)

SEEDS = (11, 12)
# A row of a body's equations adds up to some fifty products, in whatever order the compiler likes; where a frame moves
# with the body as a whole, these cancel to a tenth.
ROUNDING = 3e-13


def without_stiffness(system):
    """The packed system with K = 0: stiffness outweighs all else in a random state, 1e10 to 1."""
    modal = system.packed.modal.copy()
    modal[OMEGA2] = 0.0
    return system.packed._replace(modal=modal)


def kernel_forces(packed, system, q, v, a):
    f, scratch = np.zeros(system.n), make_scratch(packed)
    for i in range(len(system.bodies)):
        body_terms(packed, i, q, v, a, f, scratch)
    return f


def energy(system, q, v):
    return system_energy(system.packed, q, v, make_scratch(system.packed))


# --- M, h, K, T and V of a body ------------------------------------------------------------------------------------


@pytest.mark.parametrize("seed", SEEDS)
def test_mass_and_velocity_forces_are_those_of_the_formulation(system, seed):
    q, v, a = twins.random_state(system, seed)
    f = kernel_forces(without_stiffness(system), system, q, v, a)
    for body in system.bodies:
        M = twins.mass_matrix(body.integrals, q[body.all])
        h = twins.velocity_forces(body.integrals, q[body.all], v[body.all])
        bound = np.abs(M) @ np.abs(a[body.all]) + np.abs(h)
        assert np.all(np.abs(f[body.all] - M @ a[body.all] - h) <= ROUNDING * bound.max()), body.name


@pytest.mark.parametrize("seed", SEEDS)
def test_elastic_forces_are_those_of_the_modes(system, seed):
    q, _, _ = twins.random_state(system, seed)
    still = np.zeros(system.n)
    f = kernel_forces(system.packed, system, q, still, still)
    for body in system.bodies:
        expected = twins.elastic_forces(body.integrals, q[body.all])
        # V^T K V is diagonal up to rounding of its largest entry, so that is the scale.
        scale = body.modes.omega.max(initial=0.0) ** 2 * np.abs(q[body.flexible]).max(initial=0.0)
        np.testing.assert_allclose(f[body.all], expected, rtol=0, atol=1e-10 * scale, err_msg=body.name)
        # And entry by entry against the frequencies.
        np.testing.assert_allclose(f[body.flexible], body.modes.omega**2 * q[body.flexible], rtol=ROUNDING)


@pytest.mark.parametrize("seed", SEEDS)
def test_energies_are_those_of_the_formulation(system, seed):
    q, v, _ = twins.random_state(system, seed)
    total = np.zeros(2)
    for i, body in enumerate(system.bodies):
        kinetic, strain = body_energy(system.packed, i, q, v, make_scratch(system.packed))
        np.testing.assert_allclose(kinetic, twins.kinetic_energy(body.integrals, q[body.all], v[body.all]), rtol=1e-12)
        # The twin's K is V^T K V, see above.
        np.testing.assert_allclose(strain, twins.strain_energy(body.integrals, q[body.all]), rtol=1e-9)
        total += kinetic, strain
    np.testing.assert_allclose(energy(system, q, v), total, rtol=1e-14)


@pytest.mark.parametrize("name", ["link1", "link4"])
@pytest.mark.parametrize("seed", SEEDS)
def test_mass_matrix_and_h_are_those_of_a_numerical_lagrangian(raparm_system, name, seed):
    # T of the mass points alone; every derivative by the complex step, so nothing is lost but rounding.
    system, body = raparm_system, raparm_system.body(name)
    masses = twins.masses_of(system, name)
    q, v, a = (x[body.all] for x in twins.random_state(system, seed))

    def T(q, v):
        return twins.kinetic_energy_of_points(masses, q, v)

    def momentum(q, v):
        # T is quadratic in v, so dT/dv_i = T(v + e_i) - T(v) - T(e_i): exact, and still analytic in q.
        return np.array([T(q, v + e) - T(q, v) - T(q, e) for e in np.eye(v.size)])

    M = np.array([momentum(q, e) for e in np.eye(v.size)])
    # d/dt(dT/dv) - dT/dq at a = 0: dT/dv = M(q) v changes with q along v.
    force = np.array([twins.along(lambda x: T(x, v), q, e) for e in np.eye(v.size)])
    h = twins.along(lambda x: momentum(x, v), q, v) - force

    np.testing.assert_allclose(
        twins.mass_matrix(body.integrals, q), M, rtol=0, atol=1e-11 * np.max(np.abs(M)), err_msg="M"
    )
    expected = twins.velocity_forces(body.integrals, q, v)
    # The largest term of h is the momentum that changes: M' v, bounded by the sizes of M and v.
    scale = np.max(np.abs(h))
    np.testing.assert_allclose(expected, h, rtol=0, atol=1e-11 * scale, err_msg="h")

    whole = [np.zeros(system.n) for _ in range(3)]
    for full, part in zip(whole, (q, v, a), strict=True):
        full[body.all] = part
    f = kernel_forces(without_stiffness(system), system, *whole)[body.all]
    np.testing.assert_allclose(f, M @ a + h, rtol=0, atol=1e-11 * np.max(np.abs(f)), err_msg="kernel")


@pytest.mark.parametrize("seed", SEEDS)
def test_power_of_all_forces_is_the_rate_of_energy(linkage, seed):
    # v.(M a + h + K u) = d(T + V)/dt along any motion: the energies of the mass points and of the modes.
    q, v, a = twins.random_state(linkage, seed)
    f = kernel_forces(linkage.packed, linkage, q, v, a)
    for body in linkage.bodies:
        if body.mesh is None:
            continue
        masses = twins.masses_of(linkage, body.name)
        b = body.all

        def energy(x, masses=masses, body=body):
            q, v = np.split(x, 2)
            return twins.kinetic_energy_of_points(masses, q, v) + 0.5 * np.sum((body.modes.omega * q[3:]) ** 2)

        rate = twins.along(energy, np.concatenate([q[b], v[b]]), np.concatenate([v[b], a[b]]))
        # The power is a sum of terms as large as that of the stiffest mode.
        np.testing.assert_allclose(v[b] @ f[b], rate, rtol=0, atol=1e-12 * np.max(np.abs(v[b] * f[b])))
        # Without it, the rest of the power would show nothing: once more with the stiffness left out.
        soft = kernel_forces(without_stiffness(linkage), linkage, q, v, a)
        kinetic = twins.along(
            lambda x, masses=masses: twins.kinetic_energy_of_points(masses, *np.split(x, 2)),
            np.concatenate([q[b], v[b]]),
            np.concatenate([v[b], a[b]]),
        )
        np.testing.assert_allclose(v[b] @ soft[b], kinetic, rtol=0, atol=1e-12 * np.max(np.abs(v[b] * soft[b])))


@pytest.mark.parametrize(("alpha", "beta"), [(0.0, 0.0), (20.0, 50.0)])
def test_residuals_are_those_of_the_index_1_equations(system, alpha, beta):
    # M a + h + K q + Phi_q^T lambda - F and Phi'' + 2 alpha Phi' + beta^2 Phi (section 4), each put together by twins.
    q, v, a = twins.random_state(system, 27)
    q = twins.gentle_deflection(system, q, 28)
    rng, t, ws = np.random.default_rng(29), 0.2, system.workspace()
    lam, torques = rng.normal(size=system.m), rng.normal(size=len(system.mechanism.motors))
    signals = twins.still_signals(system, torques)
    equations(system.packed, signals, t, (1.0, 2.0 * alpha, beta**2), q, v, a, lam, np.zeros(torques.size), ws)

    J = twins.constraint_jacobian(system, q)
    motors = [twins.joint_angle_row(system, motor.joint) for motor in system.mechanism.motors]
    f = twins.system_mass_matrix(system, q) @ a + twins.system_forces(system, q, v) + J.T @ lam - torques @ motors
    np.testing.assert_allclose(ws.f, f, rtol=0, atol=1e-11 * np.max(np.abs(f)))

    profile = np.zeros((3, system.m))
    for prescribed in system.mechanism.prescribed:
        row = system.rows.index(f"{prescribed.name} angle")
        profile[:, row] = [x[0] for x in prescribed.profile.evaluate(np.array([t]))]
    second = twins.along(lambda q: twins.constraint_jacobian(system, q) @ v, q, v) + J @ a - profile[2]
    rows = second + 2 * alpha * (J @ v - profile[1]) + beta**2 * twins.constraints(system, t, q)
    # A prescribed profile's second derivative comes from quintic pieces: 1e-8, see test_joints.
    np.testing.assert_allclose(ws.rows, rows, rtol=0, atol=1e-12 * np.max(np.abs(rows)) + 1e-8)


# --- The linear system of an iteration -----------------------------------------------------------------------------


def iteration_matrix(system, b, q):
    """[M + b K, Phi_q^T; Phi_q, 0] from the twins."""
    J = twins.constraint_jacobian(system, q)
    M = twins.system_mass_matrix(system, q)
    for body in system.bodies:
        index = np.arange(body.flexible.start, body.flexible.stop)
        # The frequencies, not V^T K V, whose rounding outside the diagonal is that of its stiffest mode.
        M[index, index] += b * body.modes.omega**2
    return np.block([[M, J.T], [J, np.zeros((system.m, system.m))]])


@pytest.mark.parametrize("b", [0.0, 1e-8, 1e-4])
def test_the_factored_system_solves_the_dense_one(system, b):
    q, _, _ = twins.random_state(system, 13)
    rng = np.random.default_rng(14)
    x, mu = rng.normal(size=system.n), rng.normal(size=system.m)
    ws = system.workspace()
    A, right = iteration_matrix(system, b, q), np.concatenate([x, mu])
    assert factor_system(system.packed, b, q, ws) == 0
    solve_system(system.packed, ws, x, mu)
    solution = np.concatenate([x, mu])
    # Eliminating the bodies costs the condition number of S: 1e3 here.
    residual = np.abs(A @ solution - right)
    assert np.all(residual <= 1e-12 * np.max(np.abs(A) @ np.abs(solution)))
    expected = np.linalg.solve(A, right)
    np.testing.assert_allclose(x, expected[: system.n], rtol=0, atol=1e-10 * np.max(np.abs(expected[: system.n])))
    np.testing.assert_allclose(mu, expected[system.n :], rtol=0, atol=1e-10 * np.max(np.abs(expected[system.n :])))


def test_bodies_factored_at_one_place_serve_at_another(system):
    # `orient` turns them to new angles; only the deformation is that of the factor.
    q, _, _ = twins.random_state(system, 15)
    turned, _, _ = twins.random_state(system, 16)
    for body in system.bodies:
        turned[body.flexible] = q[body.flexible]
    rng = np.random.default_rng(17)
    right = rng.normal(size=system.n + system.m)
    x, mu = right[: system.n].copy(), right[system.n :].copy()
    ws = system.workspace()
    factor_bodies(system.packed, 1e-6, q, ws)
    assert orient(system.packed, turned, ws, 1e-12) == 0
    solve_system(system.packed, ws, x, mu)
    expected = np.linalg.solve(iteration_matrix(system, 1e-6, turned), right)
    np.testing.assert_allclose(x, expected[: system.n], rtol=0, atol=1e-10 * np.max(np.abs(expected[: system.n])))


def test_mass_norm_is_the_root_of_kinetic_energy(system):
    q, v, _ = twins.random_state(system, 18)
    ws = system.workspace()
    factor_system(system.packed, 1e-5, q, ws)
    mass = sum(body.integrals.m for body in system.bodies)
    expected = np.sqrt(v @ twins.system_mass_matrix(system, q) @ v / mass)
    assert mass_norm(system.packed, ws, v) == pytest.approx(expected, rel=1e-12)
    # Metres: everything shifted by the same length has that norm, in any direction and pose.
    shift = np.zeros(system.n)
    for body in system.bodies:
        shift[body.position] = 0.3, -0.4
    assert mass_norm(system.packed, ws, shift) == pytest.approx(0.5, rel=1e-12)


def test_dependent_rows_leave_the_accelerations_of_the_pseudo_inverse():
    # Three equal cranks under one bar: one row too many, and still one degree of freedom.
    cranks = [RigidBody(f"crank{k}", 0.3, 0.002, (0.1, 0.0), {"O": (0.0, 0.0), "P": (0.2, 0.0)}) for k in range(3)]
    points = {f"P{k}": (0.3 * k, 0.0) for k in range(3)}
    bar = RigidBody("bar", 0.8, 0.03, (0.3, 0.05), points)
    joints = [
        joint
        for k in range(3)
        for joint in (
            RevoluteJoint(f"O{k}", PointRef("ground", f"O{k}"), PointRef(f"crank{k}", "O")),
            RevoluteJoint(f"P{k}", PointRef(f"crank{k}", "P"), PointRef("bar", f"P{k}")),
        )
    ]
    ground = {f"O{k}": (0.3 * k, 0.0) for k in range(3)}
    system = build_system(Mechanism("parallel", ground, (*cranks, bar), tuple(joints)))
    rng, ws = np.random.default_rng(19), system.workspace()
    # At many angles: what rounding leaves of the last pivot is now positive, now negative.
    for angle in rng.uniform(0.2, 2.9, 40):
        q = np.zeros(system.n)
        for k in range(3):
            q[3 * k : 3 * k + 3] = 0.3 * k, 0.0, angle
        q[9:11] = 0.2 * np.cos(angle), 0.2 * np.sin(angle)
        J = twins.constraint_jacobian(system, q)
        assert np.linalg.matrix_rank(J) == system.m - 1
        assert factor_system(system.packed, 0.0, q, ws) == 1
        force, right = rng.normal(size=system.n), J @ rng.normal(size=system.n)
        x, mu = force.copy(), right.copy()
        solve_system(system.packed, ws, x, mu)
        # Least change in the mass metric: a = M^-1 (F - J^T lambda) with the pseudo-inverse of J M^-1 J^T.
        inverse = np.linalg.inv(twins.system_mass_matrix(system, q))
        multipliers = np.linalg.pinv(J @ inverse @ J.T, rcond=1e-10) @ (J @ inverse @ force - right)
        expected = inverse @ (force - J.T @ multipliers)
        # The condition number of S without the dependent row is 1e4 or so.
        np.testing.assert_allclose(x, expected, rtol=0, atol=1e-10 * np.max(np.abs(expected)))


# --- Invariance and limits -----------------------------------------------------------------------------------------


def accelerations(system, q, v, torques, t=0.2):
    """Accelerations and multipliers of the index-1 equations, without Baumgarte terms."""
    a, lam, ws = np.zeros(system.n), np.zeros(system.m), system.workspace()
    signals = twins.still_signals(system, torques)
    equations(system.packed, signals, t, (1.0, 0.0, 0.0), q, v, a, lam, np.zeros(len(torques)), ws)
    factor_system(system.packed, 0.0, q, ws)
    x, mu = -ws.f, -ws.rows
    solve_system(system.packed, ws, x, mu)
    return x, mu


def test_a_change_of_the_ground_frame_is_followed(condition):
    turn, shift = 0.8, np.array([3.0, -2.0])
    R = twins.rotation(turn)
    mechanism = make_linkage(condition)
    ground = {name: tuple(R @ np.array(point) + shift) for name, point in mechanism.ground.items()}
    moved = Mechanism("moved", ground, mechanism.bodies, mechanism.joints, mechanism.motors, mechanism.prescribed[:1])
    # A prescribed angle against the ground is of the ground frame: left out of both.
    fixed = Mechanism(
        "fixed", mechanism.ground, mechanism.bodies, mechanism.joints, mechanism.motors, mechanism.prescribed[:1]
    )
    systems = build_system(fixed), build_system(moved)
    q, v, _ = twins.random_state(systems[0], 21)
    q = twins.gentle_deflection(systems[0], q, 22)
    q2, v2 = q.copy(), v.copy()
    for body in systems[1].bodies:
        q2[body.position] = R @ q[body.position] + shift
        q2[body.angle] += turn
        v2[body.position] = R @ v[body.position]
    # Prescribed angles shift with t only, the joint angle between two bodies not at all.
    torques = [0.3, -0.2, 0.1, 0.4]
    (a, lam), (a2, lam2) = (
        accelerations(s, *state, torques) for s, state in zip(systems, ((q, v), (q2, v2)), strict=True)
    )
    expected, forces = a.copy(), lam.copy()
    for body in systems[0].bodies:
        expected[body.position] = R @ a[body.position]
    rows = systems[0].rows
    for r, row in enumerate(rows):
        if row.endswith(" x"):
            forces[[r, r + 1]] = R @ lam[[r, r + 1]]
    assert systems[1].rows == rows
    np.testing.assert_allclose(a2, expected, rtol=0, atol=1e-10 * np.max(np.abs(a)))
    np.testing.assert_allclose(lam2, forces, rtol=0, atol=1e-10 * np.max(np.abs(lam)))
    np.testing.assert_allclose(energy(systems[1], q2, v2), energy(systems[0], q, v), rtol=1e-12)


def test_accelerations_do_not_depend_on_the_number_of_the_bodies():
    # The order of bodies and joints only names the coordinates.
    mechanism = make_linkage()
    shuffled = Mechanism(
        "shuffled",
        mechanism.ground,
        mechanism.bodies[::-1],
        mechanism.joints[2:] + mechanism.joints[:2],
        mechanism.motors,
        mechanism.prescribed,
        geometry=mechanism.geometry,
    )
    one, two = build_system(mechanism), build_system(shuffled)
    q, v, _ = twins.random_state(one, 23)
    q = twins.gentle_deflection(one, q, 24)
    order = np.concatenate([np.arange(one.n)[one.body(body.name).all] for body in two.bodies])
    torques = [0.3, -0.2, 0.1, 0.4]
    a, lam = accelerations(one, q, v, torques)
    b, mu = accelerations(two, q[order], v[order], torques)
    np.testing.assert_allclose(b, a[order], rtol=0, atol=1e-10 * np.max(np.abs(a)))
    rows = [one.rows.index(row) for row in two.rows]
    np.testing.assert_allclose(mu, lam[rows], rtol=0, atol=1e-10 * np.max(np.abs(lam)))


def test_a_beam_without_flexibility_is_a_rigid_body():
    L, section = 0.6, Section.rectangle(width=0.03, thickness=0.005)
    lumps = (LumpedMass("A", 0.05, 1e-4), LumpedMass("M", 0.2, 3e-4), LumpedMass("B", 0.1, 2e-4))
    places = {"A": 0.0, "M": 0.2, "B": L}
    beam = FlexibleBeam("arm", L, section, _ALUMINIUM, places, (1, 2), lumps, flexible=False)
    # By hand: a rod and three lumps.
    rod = _ALUMINIUM.density * section.area * L
    mass = rod + 0.35
    centre = (rod * L / 2 + 0.2 * 0.2 + 0.1 * L) / mass
    inertia = rod * L**2 / 12 + rod * (L / 2 - centre) ** 2 + 6e-4
    inertia += sum(m * (places[name] - centre) ** 2 for name, m in (("A", 0.05), ("M", 0.2), ("B", 0.1)))
    body = RigidBody("arm", mass, inertia, (centre, 0.0), {name: (x, 0.0) for name, x in places.items()})
    flap = RigidBody("flap", 0.1, 1e-3, (-0.05, 0.02), {"M": (0.0, 0.1)})
    joints = (
        RevoluteJoint("A", PointRef("ground", "O"), PointRef("arm", "A")),
        RevoluteJoint("M", PointRef("arm", "M"), PointRef("flap", "M")),
    )
    motors = (Motor("base", "A"), Motor("elbow", "M"))
    ground = {"O": (0.1, 0.2)}
    one, two = (build_system(Mechanism("arm", ground, (arm, flap), joints, motors)) for arm in (beam, body))
    assert one.n == two.n == 6
    rng = np.random.default_rng(25)
    q, v = rng.normal(size=(2, 6))
    for x, y in zip(accelerations(one, q, v, [1.0, 2.0]), accelerations(two, q, v, [1.0, 2.0]), strict=True):
        # Some of them vanish: the pin does not move.
        np.testing.assert_allclose(x, y, rtol=0, atol=1e-12 * np.max(np.abs(y)))
    np.testing.assert_allclose(energy(one, q, v), energy(two, q, v), rtol=1e-13)


def test_the_rigid_mechanism_is_the_flexible_one_held_straight(condition):
    # Remark 3: at u = u' = u'' = 0 the rigid rows of every body are those of the rigid mechanism.
    mechanism = raparm_i().with_beams(reference=condition)
    flexible, rigid = build_system(mechanism), build_system(mechanism.rigid())
    assert (rigid.n_flexible, flexible.n_flexible) == (0, 80)
    rng = np.random.default_rng(26)
    states = rng.normal(size=(3, rigid.n))
    lifted = np.zeros((3, flexible.n))
    for small, large in zip(rigid.bodies, flexible.bodies, strict=True):
        lifted[:, large.offset : large.offset + 3] = states[:, small.all]
    f, g = kernel_forces(rigid.packed, rigid, *states), kernel_forces(flexible.packed, flexible, *lifted)
    for small, large in zip(rigid.bodies, flexible.bodies, strict=True):
        np.testing.assert_allclose(
            g[large.offset : large.offset + 3], f[small.all], rtol=0, atol=ROUNDING * np.max(np.abs(f))
        )


def test_raparm_has_the_sizes_the_formulation_counts(raparm):
    # Section 4: 20 elements, 80 flexible and 24 rigid coordinates, 22 rows.
    system = build_system(raparm)
    assert sum(body.mesh.n_elements for body in system.bodies) == 20
    assert (system.n_flexible, system.n, system.m) == (80, 104, 22)
