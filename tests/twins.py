"""Plain NumPy twins of the kernels: the formulas of sections 1 to 4 of the formulation, written out.

Nothing here is fast or shares code with `paraflex.kernel`. Everything takes complex arguments, so derivatives come
from the complex step `d f(x)/dx = Im f(x + i h)/h`, which has no difference to lose digits in.

Shapes: q_body = [r (2), phi, u (nf)]; s is a `ShapeIntegrals`, a marker has x0 (2,), N (2, nf), slope (nf,).
"""

from __future__ import annotations

from dataclasses import dataclass
from itertools import pairwise

import numpy as np

from paraflex.actuation.allocation import allocate, required_effort
from paraflex.actuation.feed_forward import FeedForward, splines
from paraflex.dynamics import constant_signals, pack_signals
from paraflex.dynamics.numbers import _parts

E = np.array([[0.0, -1.0], [1.0, 0.0]])
# A complex step this small has no truncation error: h^2 is below the smallest number.
STEP = 1e-200


def rotation(phi):
    return np.array([[np.cos(phi), -np.sin(phi)], [np.sin(phi), np.cos(phi)]])


def along(function, x, dx):
    """Derivative of function at x in the direction dx, by the complex step."""
    return np.imag(function(x + 1j * STEP * dx)) / STEP


# --- Section 2: the beam -------------------------------------------------------------------------------------------


def hermite(z, l):
    """f2, f3, f4, f2', f3', f4' of section 2, as printed there."""
    return [
        1 - 10 * z**3 + 15 * z**4 - 6 * z**5,
        l * (z - 6 * z**3 + 8 * z**4 - 3 * z**5),
        l**2 / 2 * (z**2 - 3 * z**3 + 3 * z**4 - z**5),
        10 * z**3 - 15 * z**4 + 6 * z**5,
        l * (-4 * z**3 + 7 * z**4 - 3 * z**5),
        l**2 / 2 * (z**3 - 2 * z**4 + z**5),
    ]


def beam_shape(nodes, x):
    """Shape matrix (2, 4 n + 4) of a beam's nodal coordinates at x, which may be complex."""
    e = int(np.clip(np.searchsorted(nodes, np.real(x), side="right") - 1, 0, len(nodes) - 2))
    l = nodes[e + 1] - nodes[e]
    z = (x - nodes[e]) / l
    N = np.zeros((2, 4 * len(nodes)), dtype=np.result_type(x, float))
    N[0, [4 * e, 4 * e + 4]] = 1 - z, z
    N[1, [4 * e + 1, 4 * e + 2, 4 * e + 3, 4 * e + 5, 4 * e + 6, 4 * e + 7]] = hermite(z, l)
    return N


def beam_slope(nodes, x):
    """Slope row N2' (4 n + 4,) at x, by the complex step."""
    return along(lambda x: beam_shape(nodes, x)[1], x, 1.0)


@dataclass(frozen=True)
class Mass:
    """A mass point of a body: where it is undeformed, its shape and slope rows, its mass and moment of inertia."""

    x0: np.ndarray
    N: np.ndarray
    slope: np.ndarray
    mass: float
    inertia: float


def beam_masses(nodes, mass_per_length, lumps, D, points=12):
    """A beam as mass points: `points` Gauss points an element, more than the element needs, and the lumps.

    lumps: (x, mass, inertia); D: nodal coordinates per flexible coordinate.
    """
    z, w = np.polynomial.legendre.leggauss(points)
    places = [
        (a + (b - a) * (1 + zk) / 2, mass_per_length * (b - a) * wk / 2, 0.0)
        for a, b in pairwise(nodes)
        for zk, wk in zip(z, w, strict=True)
    ]
    return [
        Mass(np.array([x, 0.0]), beam_shape(nodes, x) @ D, beam_slope(nodes, x) @ D, m, J)
        for x, m, J in [*places, *lumps]
    ]


def masses_of(system, name):
    """The mass points of a beam of a system, in its modal coordinates."""
    beam, body = system.mechanism.body(name), system.body(name)
    lumps = [(beam.points[lump.point], lump.mass, lump.inertia) for lump in beam.lumps]
    return beam_masses(body.mesh.nodes, beam.material.density * beam.section.area, lumps, body.integrals.D)


# --- Section 1: a material point -----------------------------------------------------------------------------------


def point_position(marker, q):
    return q[:2] + rotation(q[2]) @ (marker.x0 + marker.N @ q[3:])


def point_velocity(marker, q, v):
    s = marker.x0 + marker.N @ q[3:]
    return v[:2] + rotation(q[2]) @ (v[2] * E @ s + marker.N @ v[3:])


def point_acceleration(marker, q, v, a):
    s, ds = marker.x0 + marker.N @ q[3:], marker.N @ v[3:]
    return a[:2] + rotation(q[2]) @ (a[2] * E @ s - v[2] ** 2 * s + 2 * v[2] * E @ ds + marker.N @ a[3:])


def point_jacobian(marker, q):
    """[1, R E s, R N]."""
    R = rotation(q[2])
    s = marker.x0 + marker.N @ q[3:]
    return np.column_stack([np.eye(2), R @ E @ s, R @ marker.N])


def angle_row(marker):
    """Of the angle phi + N2' u: [0, 0, 1, N2']."""
    return np.concatenate([[0.0, 0.0, 1.0], marker.slope])


def kinetic_energy_of_points(masses, q, v):
    """The definition: half the sum of m p'.p' + J (phi' + N2' u')^2, no shape integral in sight."""
    total = 0.0
    for point in masses:
        p = point_velocity(point, q, v)
        total = total + 0.5 * point.mass * (p @ p) + 0.5 * point.inertia * (angle_row(point) @ v) ** 2
    return total


# --- Section 3: a body ---------------------------------------------------------------------------------------------


def mass_matrix(s, q):
    R, u = rotation(q[2]), q[3:]
    first = s.S1 + s.S2 @ u
    M = np.zeros((3 + s.nf, 3 + s.nf), dtype=np.result_type(q, float))
    M[:2, :2] = s.m * np.eye(2)
    M[:2, 2] = M[2, :2] = R @ E @ first
    M[:2, 3:] = R @ s.S2
    M[3:, :2] = M[:2, 3:].T
    M[2, 2] = s.I0 + s.J + 2 * s.I1 @ u + u @ s.I2 @ u
    M[2, 3:] = M[3:, 2] = s.G1 + s.Jf + u @ s.G2
    M[3:, 3:] = s.I2 + s.Jff
    return M


def velocity_forces(s, q, v):
    """h of section 3."""
    R, u, w, du = rotation(q[2]), q[3:], v[2], v[3:]
    first = s.S1 + s.S2 @ u
    return np.concatenate(
        [
            R @ (-(w**2) * first + 2 * w * E @ s.S2 @ du),
            [2 * w * (s.I1 + u @ s.I2) @ du],
            -(w**2) * (s.I1 + s.I2 @ u) - 2 * w * s.G2 @ du,
        ]
    )


def elastic_forces(s, q):
    return np.concatenate([np.zeros(3), s.K @ q[3:]])


def kinetic_energy(s, q, v):
    return 0.5 * v @ mass_matrix(s, q) @ v


def strain_energy(s, q):
    return 0.5 * q[3:] @ s.K @ q[3:]


# --- Section 4: the system -----------------------------------------------------------------------------------------


def system_mass_matrix(system, q):
    M = np.zeros((system.n, system.n))
    for body in system.bodies:
        M[body.all, body.all] = mass_matrix(body.integrals, q[body.all])
    return M


def system_forces(system, q, v):
    """h + K q, with K = diag(omega^2): V^T K V has the rounding of its stiffest mode everywhere."""
    f = np.zeros(system.n)
    for body in system.bodies:
        f[body.all] = velocity_forces(body.integrals, q[body.all], v[body.all])
        f[body.flexible] += body.modes.omega**2 * q[body.flexible]
    return f


def _sides(joint):
    """p_b - p_a and angle_b - angle_a."""
    return ((joint.b, 1.0), (joint.a, -1.0))


def constraints(system, t, q):
    """Phi (m,) in the order of system.rows: p_b - p_a of a joint, angle_b - angle_a - profile; of gears."""
    values = {}
    for joint in system.mechanism.joints:
        gap = np.zeros(2, dtype=np.result_type(q, float))
        for ref, sign in _sides(joint):
            marker = system.marker(ref)
            gap += sign * (marker.x0 if ref.on_ground else point_position(marker, _coordinates(system, ref, q)))
        values[f"{joint.name} x"], values[f"{joint.name} y"] = gap
    for prescribed in system.mechanism.prescribed:
        angle = joint_angle(system, prescribed.joint, q)
        values[f"{prescribed.name} angle"] = angle - prescribed.profile.evaluate(np.array([t]))[0][0]
    for gear in system.mechanism.gears:
        first, second = (joint_angle(system, joint, q) for joint in gear.joints)
        values[f"{gear.name} angle"] = second - gear.ratio * first - gear.phase
    return np.array([values[row] for row in system.rows])


def joint_angle(system, joint, q):
    """Angle of body b relative to body a with the slopes of the beams; linear, so also its rate of the velocities."""
    return joint_angle_row(system, joint) @ q


def joint_angle_row(system, joint):
    row = np.zeros(system.n)
    for ref, sign in _sides(system.mechanism.joint(joint)):
        if not ref.on_ground:
            row[system.body(ref.body).all] += sign * angle_row(system.marker(ref))
    return row


def constraint_jacobian(system, q):
    """Phi_q (m, n), row by row of what `constraints` gives."""
    rows = {}
    for joint in system.mechanism.joints:
        block = np.zeros((2, system.n), dtype=np.result_type(q, float))
        for ref, sign in _sides(joint):
            if not ref.on_ground:
                block[:, system.body(ref.body).all] += sign * point_jacobian(
                    system.marker(ref), _coordinates(system, ref, q)
                )
        rows[f"{joint.name} x"], rows[f"{joint.name} y"] = block
    for prescribed in system.mechanism.prescribed:
        rows[f"{prescribed.name} angle"] = joint_angle_row(system, prescribed.joint)
    for gear in system.mechanism.gears:
        first, second = (joint_angle_row(system, joint) for joint in gear.joints)
        rows[f"{gear.name} angle"] = second - gear.ratio * first
    return np.array([rows[row] for row in system.rows])


def _coordinates(system, ref, q):
    return q[system.body(ref.body).all]


# --- RAParM-I in closed form ---------------------------------------------------------------------------------------

# RAParM-I (reference set): half distance of the base pivots, l1, la, l2 [m].
HALF, L1, LA, L2 = 0.100, 0.250, 0.100, 0.250
BASES = (np.array([-HALF, 0.0]), np.array([HALF, 0.0]))
# Elbows B1, B2 to the left (+1) or right (-1) of the lines from A1, A2 to C.
ELBOWS = {"outward": (1, -1), "inward": (-1, 1), "left": (1, 1), "right": (-1, -1)}


def unit(angle):
    return np.array([np.cos(angle), np.sin(angle)])


def wrapped(angles):
    return (angles + np.pi) % (2 * np.pi) - np.pi


def elbow(base, C, side):
    """B of an arm A B C: on the circles about A and C; analytic in C, for the complex step."""
    d = C - base
    D2 = d @ d
    along = (L1**2 - L2**2 + D2) / (2 * D2)
    return base + along * d + side * np.sqrt(L1**2 / D2 - along**2) * (E @ d)


def arm(base, C, dC, ddC, side):
    """Angles, rates and accelerations (3, 2) of the links A B and B C: l1 e(th1) + l2 e(th4) = C - A, twice derived."""
    B = elbow(base, C, side)
    th1, th4 = np.arctan2(*(B - base)[::-1]), np.arctan2(*(C - B)[::-1])
    J = np.column_stack([L1 * E @ unit(th1), L2 * E @ unit(th4)])
    rates = np.linalg.solve(J, dC)
    turning = np.linalg.solve(J, ddC + L1 * unit(th1) * rates[0] ** 2 + L2 * unit(th4) * rates[1] ** 2)
    return np.array([[th1, th4], rates, turning])


def raparm_coordinates(C, dC, ddC, elbows):
    """q, v, a (3, 24) of RAParM-I; links 3, 7 are parallel to 1, 5 and links 2, 6 to 4, 8."""
    out = []
    for base, side in zip(BASES, elbows, strict=True):
        (th1, th4), (w1, w4), (e1, e4) = arm(base, C, dC, ddC, side)

        def tip(angle, rate, turning, length, base=base):
            p, n = length * unit(angle), length * E @ unit(angle)
            return np.array([base + p, n * rate, n * turning - p * rate**2])

        still = np.array([base, 0 * base, 0 * base])
        origins = still, still, tip(th4, w4, e4, LA), tip(th1, w1, e1, L1)
        turns = (th1, w1, e1), (th4, w4, e4), (th1, w1, e1), (th4, w4, e4)
        for origin, turn in zip(origins, turns, strict=True):
            out.append(np.column_stack([origin, turn]))
    return np.concatenate(out, axis=1)


# --- Inputs the tests share ----------------------------------------------------------------------------------------


def random_state(system, seed, *, deflection=0.01):
    """Coordinates, velocities and accelerations far from rest; not on the constraints.

    Modal coordinates carry sqrt(mass): dividing by the root of the body's mass makes `deflection` a length [m].
    """
    rng = np.random.default_rng(seed)
    q, v, a = rng.normal(size=(3, system.n))
    for body in system.bodies:
        q[body.flexible] *= deflection * np.sqrt(body.integrals.m)
        v[body.flexible] *= np.sqrt(body.integrals.m)
        a[body.flexible] *= np.sqrt(body.integrals.m)
    return q, v, a


def gentle_deflection(system, q, seed, load=20.0):
    """q with flexible coordinates as static loads of some newtons give them: u_k = force_k / omega_k^2."""
    q = q.copy()
    rng = np.random.default_rng(seed)
    for body in system.bodies:
        q[body.flexible] = load * rng.normal(size=body.nf) / body.modes.omega**2
    return q


def still_signals(system, torques=None, end=1.0):
    """Signals of constant torques, zero by default, and of the mechanism's prescribed angles."""
    values = np.zeros(len(system.mechanism.motors)) if torques is None else torques
    return pack_signals(system.mechanism, constant_signals(values, end), end)[0]


def blocks_of(record, numbers):
    """Numbers as `dynamics.numbers_of` orders them by what they are: each field of a record, each row of a matrix."""
    blocks, at = [], 0
    for part in _parts(record):
        # Matrices of so few rows hold another quantity in each.
        rows = part.shape[0] if part.ndim == 2 and 0 < part.shape[0] <= 6 else 1
        blocks += np.split(numbers[at : at + part.size], rows)
        at += part.size
    return blocks


def feed_forward_like(plan, other):
    """Torques of a plan through as many instants as another has, in proportion between knots: smooth in a change."""
    times = np.interp(other.times, other.knots, plan.knots)
    times[np.searchsorted(other.times, other.knots)] = plan.knots
    torques = allocate(required_effort(plan.follow(times)), other.mode)
    return FeedForward(other.mode, tuple(splines(times, torques, plan.knots)), plan.knots, times)
