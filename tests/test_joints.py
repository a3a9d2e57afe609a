"""Joints, prescribed angles and motors: kernels against derivatives of Phi, and power against relative motion."""

from __future__ import annotations

import numpy as np
import pytest

import twins
from conftest import make_linkage
from paraflex.dynamics import build_system
from paraflex.kernel.joints import body_joints, body_motors, start_rows
from paraflex.kernel.packed import make_scratch
from paraflex.mechanism import Joint

SEEDS = (31, 32)
TIME = 0.37
# Signals replace a prescribed profile by quintic pieces, some 2000 a second: with sixth derivatives of 1e3 their values
# are right to rounding, their second derivatives to 1e-16/(1e-3)^2, less than 1e-8.
PROFILE = 1e-8


def rows_and_forces(system, t, q, v, a, lam, weight_v, weight_q):
    """Phi'' + weight_v Phi' + weight_q Phi and Phi_q^T lambda, from the kernels of the time loop."""
    rows, f, scratch = np.zeros(system.m), np.zeros(system.n), make_scratch(system.packed)
    start_rows(system.packed, twins.still_signals(system), t, (1.0, weight_v, weight_q), rows)
    for i in range(len(system.bodies)):
        body_joints(system.packed, i, q, v, a, lam, (1.0, weight_v, weight_q), scratch, f, rows)
    return rows, f


def law_of_rows(system, t):
    """Value, rate and acceleration of the prescribed angle of each row, zero for the rows of joints: (3, m)."""
    out = np.zeros((3, system.m))
    for prescribed in system.mechanism.prescribed:
        row = system.rows.index(f"{prescribed.name} angle")
        out[:, row] = [x[0] for x in prescribed.profile.evaluate(np.array([t]))]
    return out


def test_every_joint_and_prescribed_angle_has_its_rows(system):
    expected = [f"{joint.name} {axis}" for joint in system.mechanism.joints for axis in "xy"]
    expected += [f"{prescribed.name} angle" for prescribed in system.mechanism.prescribed]
    expected += [f"{gear.name} angle" for gear in system.mechanism.gears]
    assert sorted(system.rows) == sorted(expected)


@pytest.mark.parametrize("seed", SEEDS)
def test_constraints_and_their_rate(system, seed):
    q, v, _ = twins.random_state(system, seed)
    phi, rate = system.constraints(twins.still_signals(system), TIME, q, v)
    np.testing.assert_allclose(phi, twins.constraints(system, TIME, q), rtol=0, atol=1e-12)
    # Phi' = Phi_q q' - profile', the first by the complex step.
    expected = twins.along(lambda q: twins.constraints(system, TIME, q), q, v) - law_of_rows(system, TIME)[1]
    np.testing.assert_allclose(rate, expected, rtol=0, atol=PROFILE * 1e-2)


@pytest.mark.parametrize("seed", SEEDS)
def test_jacobian_is_the_derivative_of_the_constraints(system, seed):
    q, _, _ = twins.random_state(system, seed)
    unit = np.eye(system.n)
    numerical = np.column_stack([twins.along(lambda q: twins.constraints(system, TIME, q), q, e) for e in unit])
    scale = np.max(np.abs(numerical))
    np.testing.assert_allclose(system.jacobian(q), numerical, rtol=0, atol=1e-13 * scale)
    # The twin's formula too: the tests below differentiate it.
    np.testing.assert_allclose(twins.constraint_jacobian(system, q), numerical, rtol=0, atol=1e-13 * scale)


@pytest.mark.parametrize("seed", SEEDS)
def test_constraint_forces_are_the_transposed_jacobian_times_the_multipliers(system, seed):
    q, v, a = twins.random_state(system, seed)
    lam = np.random.default_rng(seed).normal(size=system.m)
    _, f = rows_and_forces(system, TIME, q, v, a, lam, 0.0, 0.0)
    expected = twins.constraint_jacobian(system, q).T @ lam
    np.testing.assert_allclose(f, expected, rtol=0, atol=1e-13 * np.max(np.abs(expected)))


@pytest.mark.parametrize("weights", [(0.0, 0.0), (40.0, 400.0)], ids=["Phi''", "with Baumgarte's terms"])
@pytest.mark.parametrize("seed", SEEDS)
def test_acceleration_rows_are_second_derivatives_along_a_motion(system, seed, weights):
    # A smooth motion q(t) with q(0), q'(0), q''(0) given: d/dt [Phi_q(q) q'] by the complex step in t.
    q0, v0, a0 = twins.random_state(system, seed)
    weight_v, weight_q = weights
    lam = np.zeros(system.m)
    rows, _ = rows_and_forces(system, TIME, q0, v0, a0, lam, weight_v, weight_q)

    def velocity_of_phi(t):
        q = q0 + np.sin(t) * v0 + (1 - np.cos(t)) * a0
        v = np.cos(t) * v0 + np.sin(t) * a0
        return twins.constraint_jacobian(system, q) @ v

    _, rate, acceleration = law_of_rows(system, TIME)
    expected = twins.along(velocity_of_phi, 0.0, 1.0) - acceleration
    expected += weight_v * (velocity_of_phi(0.0) - rate) + weight_q * twins.constraints(system, TIME, q0)
    scale = np.max(np.abs(expected))
    np.testing.assert_allclose(rows, expected, rtol=0, atol=1e-12 * scale + PROFILE)


# --- Prescribed angles ---------------------------------------------------------------------------------------------


@pytest.mark.parametrize("name", ["wave", "turn"])
def test_a_prescribed_angle_is_the_angle_of_body_b_less_that_of_body_a(linkage, name):
    # "wave" turns the flap (rigid) against the coupler (a beam, with its slope at R); "turn" has the ground as side b.
    q, v, _ = twins.random_state(linkage, 33)
    row = linkage.rows.index(f"{name} angle")
    phi, _ = linkage.constraints(twins.still_signals(linkage), TIME, q, v)
    coupler, flap, rocker = (linkage.body(body) for body in ("coupler", "flap", "rocker"))
    if name == "wave":
        # The slope from the mesh: the last node's, in nodal coordinates.
        slope = coupler.integrals.D[-2] @ q[coupler.flexible]
        assert abs(slope) > 1e-3
        expected = q[flap.angle] - (q[coupler.angle] + slope) - (0.3 + np.sin(3 * TIME))
    else:
        expected = -q[rocker.angle] - (0.2 * TIME**2 - TIME)
    assert phi[row] == pytest.approx(expected, abs=1e-12)


@pytest.mark.parametrize("time", [0.0, 0.1234, 0.5, 1.0])
def test_a_prescribed_profile_reaches_the_rows_with_both_derivatives(time):
    # At rest in the origin all that is left of the rows is the profile.
    system = build_system(make_linkage())
    zero = np.zeros(system.n)
    row = system.rows.index("wave angle")
    expected = [0.3 + np.sin(3 * time), 3 * np.cos(3 * time), -9 * np.sin(3 * time)]
    lam = np.zeros(system.m)
    found = -rows_and_forces(system, time, zero, zero, zero, lam, 0.0, 0.0)[0][row]
    assert found == pytest.approx(expected[2], abs=PROFILE)
    found = -rows_and_forces(system, time, zero, zero, zero, lam, 5.0, 7.0)[0][row]
    assert found == pytest.approx(expected[2] + 5.0 * expected[1] + 7.0 * expected[0], abs=PROFILE)


# --- Motors --------------------------------------------------------------------------------------------------------


@pytest.mark.parametrize("motor", range(4))
def test_power_of_a_motor_is_torque_times_the_relative_turning_rate_of_the_material(linkage, motor):
    q, v, _ = twins.random_state(linkage, 34)
    torques, f = np.zeros(4), np.zeros(linkage.n)
    torques[motor] = 1.7
    for i in range(len(linkage.bodies)):
        body_motors(linkage.packed, i, torques, make_scratch(linkage.packed), f)
    joint = linkage.mechanism.joint(linkage.mechanism.motors[motor].joint)
    rate = turning_rate(linkage, joint.b, q, v) - turning_rate(linkage, joint.a, q, v)
    assert abs(rate) > 0.1
    # Efforts are subtracted: f stands on the left of the equations. The rates are finite differences in space.
    assert -f @ v == pytest.approx(1.7 * rate, rel=1e-7)


def turning_rate(system, ref, q, v):
    """Rate at which material at a point turns in the body's linear theory: phi' + d/dx of the transverse velocity."""
    if ref.on_ground:
        return 0.0
    body = system.body(ref.body)
    if body.mesh is None:
        return v[body.angle]
    x = system.mechanism.body(ref.body).points[ref.point]
    # One-sided difference into the beam of step h, improved to fourth order, since the point may be an end.
    h = 1e-4 * body.mesh.length * (1.0 if x == 0.0 else -1.0)
    u = [twins.beam_shape(body.mesh.nodes, x + k * h)[1] @ body.integrals.D @ v[body.flexible] for k in range(5)]
    return v[body.angle] + (-25 * u[0] + 48 * u[1] - 36 * u[2] + 16 * u[3] - 3 * u[4]) / (12 * h)


def test_torque_and_reaction_cancel_in_a_turn_of_everything(linkage):
    # Turning all bodies alike does not work against a motor between two of them, only against one on the ground.
    together = np.zeros(linkage.n)
    for body in linkage.bodies:
        together[body.angle] = 1.0
    expected = {"base": 1.0, "knee": 0.0, "foot": -1.0, "hand": 0.0}
    for k, motor in enumerate(linkage.mechanism.motors):
        torques, f = np.zeros(4), np.zeros(linkage.n)
        torques[k] = 1.0
        for i in range(len(linkage.bodies)):
            body_motors(linkage.packed, i, torques, make_scratch(linkage.packed), f)
        assert -f @ together == pytest.approx(expected[motor.name], abs=1e-15)


def test_markers_stand_where_their_points_are(linkage):
    # Shape rows of the points of the coupler, against the printed shape functions.
    body, beam = linkage.body("coupler"), linkage.mechanism.body("coupler")
    for joint in linkage.mechanism.joints:
        for ref in (joint.a, joint.b):
            if ref.body != "coupler":
                continue
            marker, x = linkage.marker(ref), beam.points[ref.point]
            np.testing.assert_allclose(marker.x0, [x, 0.0], rtol=1e-15)
            scale = np.max(np.abs(body.integrals.D))
            N, slope = twins.beam_shape(body.mesh.nodes, x), twins.beam_slope(body.mesh.nodes, x)
            np.testing.assert_allclose(marker.N, N @ body.integrals.D, rtol=0, atol=1e-13 * scale)
            np.testing.assert_allclose(marker.slope, slope @ body.integrals.D, rtol=0, atol=1e-12 * scale)


def test_a_kind_of_joint_has_a_name_of_its_own_and_holds_what_kernels_know():
    with pytest.raises(TypeError, match="there is a joint of kind"):

        class Other(Joint, kind="revolute", holds=("points",)):
            pass

    with pytest.raises(TypeError, match="holds 'point'"):

        class Misspelt(Joint, kind="misspelt", holds=("point",)):
            pass
