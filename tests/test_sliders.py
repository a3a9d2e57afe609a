"""Library mechanisms that slide: both slider-cranks and the 3-PRR platform."""

import numpy as np
import pytest

import twins
from paraflex.dynamics import build_system, joint_coordinate, start_state
from paraflex.files import load
from paraflex.integrators import IntegrationOptions
from paraflex.motion import simulate_motion
from paraflex.results import tracking_dataset
from paraflex.tracking import plan_tracking, simulate

# Published at 0.1 s (IVP test set): angle of the rod, place of the slider.
ROD, SLIDER = -0.3311734988, 0.1697373328


def crank_errors(tolerance):
    model = load("slider_crank_flexible")
    system = build_system(model.mechanism)
    start = start_state(system, model.start, model.mechanism.assembly())
    options = IntegrationOptions(tolerance=tolerance)
    solution = simulate_motion(model.mechanism, 0.1, samples=2, start=start, options=options).solution
    rod, slider = system.body("rod"), system.body("slider")
    return np.abs(solution.q[-1, [rod.angle, slider.offset]] - [ROD, SLIDER])


def test_simeons_slider_crank_ends_where_it_is_published():
    # The printed problem has 15 times the axial inertia; from its start, with next to no axial vibration, that hardly
    # matters: references differ by some 1e-7.
    rough, fine = (crank_errors(tolerance) for tolerance in (2e-3, 1e-6))
    assert np.all(fine < 3e-7), fine
    # Errors follow the tolerance. Between the two they lie within a factor of ten or so, by how a processor rounds: the
    # rod's axial vibration amplifies it.
    assert 1e-5 < rough[0] < 2e-4, rough


def test_the_published_start_is_consistent():
    model = load("slider_crank_flexible")
    system = build_system(model.mechanism)
    state = start_state(system, model.start, model.mechanism.assembly())
    phi, rate = system.constraints(twins.still_signals(system), 0.0, state.q, state.v)
    assert np.max(np.abs(phi)) < 1e-9
    assert np.max(np.abs(rate)) < 1e-6
    # Both sines begin to bend at the published rates.
    bar = system.body("rod")
    np.testing.assert_allclose((bar.integrals.D @ state.v[bar.flexible])[:2], [0.444896112581599, 4.63433931923867e-3])


@pytest.fixture(scope="module")
def crank_task():
    model = load("slider_crank")
    return plan_tracking(model.mechanism, model.path(), duration=0.5, samples=101, assembly="up")


def test_a_slider_cranks_motion_in_closed_form(crank_task):
    motion = crank_task.motion
    x = motion.desired.position[:, 0]
    # Law of cosines at the crank's pin.
    angle = np.arccos((0.08**2 + x**2 - 0.24**2) / (2 * 0.08 * x))
    np.testing.assert_allclose(motion.q[:, motion.system.body("crank").angle], angle, rtol=0, atol=1e-11)


def test_a_slider_cranks_torque_in_closed_form(crank_task):
    # Power of the motor: kinetic energy's rate and what the rail takes.
    motion, torque = crank_task.motion, crank_task.torques("+").evaluate(crank_task.motion.t)[:, 0]
    system, q, v, a = motion.system, motion.q, motion.v, motion.a
    crank, rod, slider = (system.body(name) for name in ("crank", "rod", "slider"))
    power = np.zeros(len(q))
    for body, mass, inertia, arm in ((crank, 0.3, 2.0e-4, 0.04), (rod, 0.4, 1.9e-3, 0.12), (slider, 0.5, 1e-4, 0.0)):
        phi, w, dw = q[:, body.angle], v[:, body.angle], a[:, body.angle]
        e = np.column_stack([np.cos(phi), np.sin(phi)])
        n = np.column_stack([-e[:, 1], e[:, 0]])
        speed = v[:, body.position] + arm * w[:, None] * n
        rise = a[:, body.position] + arm * (dw[:, None] * n - w[:, None] ** 2 * e)
        power += mass * np.sum(speed * rise, axis=1) + inertia * w * dw
    power += 5.0 * v[:, slider.offset] ** 2
    np.testing.assert_allclose(torque * v[:, crank.angle], power, rtol=0, atol=1e-6 * np.max(np.abs(power)))


@pytest.fixture(scope="module")
def platform():
    model = load("3prr")
    return plan_tracking(model.mechanism, model.path(), duration=0.4, samples=81)


def test_rails_are_where_the_travels_say(platform):
    motion = platform.motion
    for rail, slider, turn in (("rail1", "slider1", 0.0), ("rail2", "slider2", 2 * np.pi / 3)):
        travel = joint_coordinate(motion.system, rail, motion.q).value
        along, middle = np.array([np.cos(turn), np.sin(turn)]), 0.28 * np.array([np.sin(turn), -np.cos(turn)])
        expected = middle + travel[:, None] * along
        np.testing.assert_allclose(motion.q[:, motion.system.body(slider).position], expected, rtol=0, atol=1e-12)
    assert np.max(np.abs(motion.q[:, motion.system.body("platform").angle])) < 1e-12


def test_forces_along_the_rails_move_the_rigid_platform_along_its_path(platform):
    rigid = platform.remodelled(platform.mechanism.rigid())
    run = simulate(rigid, "+++", options=IntegrationOptions(tolerance=1e-7))
    data = tracking_dataset([run])
    assert data["tracking_rms"].item() < 1e-7
    assert data["torque"].attrs["units"] == "N"
    assert data["peak_torque"].attrs["long_name"] == "peak force"


def test_flexible_links_let_the_platform_lag(platform):
    data = tracking_dataset([simulate(platform, "+++", options=IntegrationOptions(tolerance=1e-5))])
    # Linear beams in cantilever frames would say 1.3e-5.
    assert data["tracking_rms"].item() == pytest.approx(4.35e-6, rel=0.2)
    # A rail holds what is square to it; along it pushes its motor.
    force = data["joint_force"].sel(joint="rail1", mode="+++").values
    rail = platform.mechanism.joint("rail1")
    (motor,) = (motor.name for motor in platform.mechanism.motors if motor.joint == "rail1")
    assert rail.direction == 0.0
    np.testing.assert_allclose(force[:, 0], data["torque"].sel(motor=motor, mode="+++"), rtol=0, atol=1e-9)
    assert np.max(np.abs(force[:, 1])) > 1.0
    normal = data["multiplier"].sel(row="rail1 normal", mode="+++").values
    np.testing.assert_allclose(force[:, 1], -normal, rtol=0, atol=1e-12)
