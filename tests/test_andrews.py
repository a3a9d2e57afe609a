"""Andrews' squeezing mechanism (IVP test set, published): seven bodies, one spring, a constant moment."""

import numpy as np
import pytest

from paraflex.dynamics import State, build_system, pack_signals
from paraflex.dynamics.state import mass_matrix
from paraflex.files import load
from paraflex.integrators import IntegrationOptions
from paraflex.mechanism import AppliedTorque, Assembly, LinearSpring, Mechanism, PointRef, RevoluteJoint, RigidBody
from paraflex.motion import simulate_motion

m = dict(enumerate([0.04325, 0.00365, 0.02373, 0.00706, 0.07050, 0.00706, 0.05498], 1))
J = dict(enumerate([2.194e-6, 4.410e-7, 5.255e-6, 5.667e-7, 1.169e-5, 5.667e-7, 1.912e-5], 1))
A, B, C = (-0.06934, -0.00227), (-0.03635, 0.03273), (0.014, 0.072)
c0, l0, moment = 4530.0, 0.07785, 0.033
d, da, e, ea, rr, ra, ss, sa, sb, sc, sd = (
    0.028,
    0.0115,
    0.02,
    0.01421,
    0.007,
    0.00092,
    0.035,
    0.01874,
    0.01043,
    0.018,
    0.02,
)
ta, tb, u, ua, ub, zf, zt, fa = 0.02308, 0.00916, 0.04, 0.01228, 0.00449, 0.02, 0.04, 0.01421
START = (-0.0617138900142764496, 0.0, 0.455279819163070380, 0.222668390165885885, 0.487364979543842550,
         -0.222668390165885885, 1.23054744454982119)  # fmt: skip
END = (15.81077119629904, -15.75637105984298, 0.04082224013073101, -0.5347301163226948, 0.5244099658805304,
       0.5347301163226948, 1.048080741042263)  # fmt: skip
END_RATES = (1139.920302151208, -1424.379294994111, 11.03291221937134)


def bodies():
    """Each in a frame in which its joints are as the published loop equations have them."""
    return (
        RigidBody("K1", m[1], J[1], (ra, 0.0), {"O": (0.0, 0.0), "P": (rr, 0.0)}),
        RigidBody("K2", m[2], J[2], (-da, 0.0), {"P": (0.0, 0.0), "F": (-d, 0.0)}),
        RigidBody("K3", m[3], J[3], (sa, sb), {"B": (0.0, 0.0), "F": (0.0, -ss), "D": (sd, -sc)}),
        RigidBody("K4", m[4], J[4], (0.0, ea - e), {"E": (0.0, 0.0), "F": (0.0, -e)}),
        RigidBody("K5", m[5], J[5], (ta, tb), {"A": (0.0, 0.0), "E": (zt, 0.0)}),
        RigidBody("K6", m[6], J[6], (zf - fa, 0.0), {"H": (0.0, 0.0), "F": (zf, 0.0)}),
        RigidBody("K7", m[7], J[7], (ua, ub), {"A": (0.0, 0.0), "H": (0.0, -u)}),
    )


def absolute(published):
    """Angles of the bodies' frames from the seven of the problem: beta, Theta, gamma, Phi, delta, Omega, epsilon."""
    b, T, g, P, dl, O, ep = published
    return np.array([b, b + T, g, P + dl, dl, O + ep, ep])


def squeezer():
    def joint(name, a, b):
        return RevoluteJoint(name, PointRef.parse(a), PointRef.parse(b))

    return Mechanism(
        name="Andrews' squeezer",
        ground={"O": (0.0, 0.0), "A": A, "B": B, "C": C},
        bodies=bodies(),
        joints=(
            joint("O", "ground.O", "K1.O"),
            joint("P", "K1.P", "K2.P"),
            joint("F3", "K2.F", "K3.F"),
            joint("F4", "K2.F", "K4.F"),
            joint("F6", "K2.F", "K6.F"),
            joint("B", "ground.B", "K3.B"),
            joint("A5", "ground.A", "K5.A"),
            joint("A7", "ground.A", "K7.A"),
            joint("E", "K5.E", "K4.E"),
            joint("H", "K7.H", "K6.H"),
        ),
        linear_springs=(LinearSpring("spring", PointRef("ground", "C"), PointRef("K3", "D"), c0, l0),),
        loads=(AppliedTorque("drive", PointRef("K1", "O"), moment),),
        assemblies=(Assembly("start", {f"K{k + 1}": float(x) for k, x in enumerate(absolute(START))}),),
    )


def published_mass_matrix(q):
    _, T, _, P, _, O, _ = q
    M = np.zeros((7, 7))
    M[0, 0] = m[1] * ra**2 + m[2] * (rr**2 - 2 * da * rr * np.cos(T) + da**2) + J[1] + J[2]
    M[1, 0] = M[0, 1] = m[2] * (da**2 - da * rr * np.cos(T)) + J[2]
    M[1, 1] = m[2] * da**2 + J[2]
    M[2, 2] = m[3] * (sa**2 + sb**2) + J[3]
    M[3, 3] = m[4] * (e - ea) ** 2 + J[4]
    M[4, 3] = M[3, 4] = m[4] * ((e - ea) ** 2 + zt * (e - ea) * np.sin(P)) + J[4]
    M[4, 4] = m[4] * (zt**2 + 2 * zt * (e - ea) * np.sin(P) + (e - ea) ** 2) + m[5] * (ta**2 + tb**2) + J[4] + J[5]
    M[5, 5] = m[6] * (zf - fa) ** 2 + J[6]
    M[6, 5] = M[5, 6] = m[6] * ((zf - fa) ** 2 - u * (zf - fa) * np.sin(O)) + J[6]
    M[6, 6] = m[6] * ((zf - fa) ** 2 - 2 * u * (zf - fa) * np.sin(O) + u**2) + m[7] * (ua**2 + ub**2) + J[6] + J[7]
    return M


def place(system, published):
    """All coordinates of the chains that the published angles describe: O-K1-K2, B-K3, A-K5-K4, A-K7-K6."""
    q = np.zeros(system.n)
    phi = absolute(published)

    def turn(k, x, y):
        c, s = np.cos(phi[k]), np.sin(phi[k])
        return np.array([c * x - s * y, s * x + c * y])

    origins = [
        np.zeros(2),
        turn(0, rr, 0.0),
        np.array(B),
        A + turn(4, zt, 0.0),
        np.array(A),
        A + turn(6, 0.0, -u),
        np.array(A),
    ]
    for k, origin in enumerate(origins):
        q[3 * k : 3 * k + 2], q[3 * k + 2] = origin, phi[k]
    return q


def test_the_mechanism_is_the_published_one():
    """Kinetic energy as a quadratic form of the seven rates: the published mass matrix; and the loops close."""
    system = build_system(squeezer())
    q, h = place(system, np.array(START)), 1e-6
    basis = np.column_stack(
        [(place(system, START + h * unit) - place(system, START - h * unit)) / (2 * h) for unit in np.eye(7)]
    )
    M = basis.T @ mass_matrix(system, q) @ basis
    np.testing.assert_allclose(M, published_mass_matrix(START), rtol=0, atol=1e-8 * np.abs(M).max())
    signals, _ = pack_signals(system.mechanism, [], 1.0)
    phi, _ = system.constraints(signals, 0.0, q, np.zeros(system.n))
    assert np.abs(phi).max() < 1e-14


def test_the_library_has_it():
    model = load("andrews")
    assert model.mechanism == squeezer()
    assert model.study.duration == 0.03


def run(tolerance, **more):
    system = build_system(squeezer())
    start = State(0.0, place(system, START), np.zeros(system.n))
    options = IntegrationOptions(tolerance=tolerance, **more)
    run = simulate_motion(squeezer(), 0.03, samples=2, start=start, options=options)
    return run.solution


def published(q):
    """Back from the bodies' angles at the end."""
    phi = q[2::3]
    return np.array([phi[0], phi[1] - phi[0], phi[2], phi[3] - phi[4], phi[4], phi[5] - phi[6], phi[6]])


def test_seven_angles_at_the_end_as_published():
    """With TR-BDF2, of second order: ten times the steps, a hundredth of the error."""
    coarse, fine = run(1e-7), run(1e-9)
    errors = [np.max(np.abs(published(solution.q[-1]) - END)) for solution in (coarse, fine)]
    np.testing.assert_allclose(published(fine.q[-1]), END, rtol=1e-6)
    assert errors[1] < 0.02 * errors[0]
    rates = published(fine.v[-1])[:3]
    np.testing.assert_allclose(rates, END_RATES, rtol=1e-5)
    assert fine.energy_balance_max < 1e-5 * fine.kinetic_energy[-1]
    assert fine.work[-1] == pytest.approx(moment * (END[0] - START[0]), rel=1e-6)


@pytest.mark.parametrize("method", ["esdirk4", "esdirk5"])
def test_seven_angles_to_1e_8_by_methods_of_high_order(method):
    solution = run(1e-10, method=method)
    assert published(solution.q[-1]) == pytest.approx(END, rel=0, abs=1e-8)
    assert solution.steps < 10000
