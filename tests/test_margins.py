"""Stability and margins of sampled loops: closed forms, python-control, and loops that are brought to their limits."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
import scipy

import paraflex as pf
from paraflex.control.design.closed_loops import damped_frequency, poles_beyond
from paraflex.control.laws.discrete import DiscreteModel
from paraflex.control.loop.chain import SampledController
from paraflex.errors import InputError
from test_regulators import PERIOD, oscillator, quanser, quanser_design

J, T = 0.01, 1e-3


def rotor():
    """A rigid rotor; outputs angle and rate."""
    return np.array([[0.0, 1.0], [0.0, 0.0]]), np.array([[0.0], [1.0 / J]]), np.eye(2), np.zeros((2, 1))


def gains(*values, period=T):
    """A law without states, torque = -values . readings."""
    row = -np.atleast_2d(values)
    return DiscreteModel(np.zeros((0, 0)), np.zeros((0, row.shape[1])), np.zeros((len(row), 0)), row, period, (), ())


def integrator():
    return np.zeros((1, 1)), np.ones((1, 1)), np.ones((1, 1)), np.zeros((1, 1))


# --- Poles ------------------------------------------------------------------------------------------------------------


def test_poles_of_a_rotor_under_pd():
    """z^2 - (2 - (Kp T^2 / 2 + Kd T) / J) z + 1 + (Kp T^2 / 2 - Kd T) / J."""
    K_p, K_d = 40.0, 1.2
    loop = pf.closed_loop(rotor(), gains(K_p, K_d))
    exact = np.roots([1.0, -2.0 + (0.5 * K_p * T**2 + K_d * T) / J, 1.0 + (0.5 * K_p * T**2 - K_d * T) / J])
    assert np.sort(loop.poles) == pytest.approx(np.sort(exact), abs=1e-12)
    assert loop.stable
    # From 1 rad, in 20 ms: 0.61753479 rad, -23.76106697 rad/s; with a sample of delay 0.61700998, -24.83802936.
    for delay, end in ((0.0, (0.61753479, -23.76106697)), (T, (0.61700998, -24.83802936))):
        A = pf.closed_loop(rotor(), gains(K_p, K_d), delay=delay).A
        start = np.eye(len(A))[0]
        assert (np.linalg.matrix_power(A, 20) @ start)[:2] == pytest.approx(end, abs=6e-9)


def limit(K_p, delay, low, high):
    """The gain K_d at which a pole leaves the unit circle."""

    def beyond(K_d):
        return pf.closed_loop(rotor(), gains(K_p, K_d), delay=delay).spectral_radius - 1.0

    return scipy.optimize.brentq(beyond, low, high, xtol=1e-14)


def test_gains_at_which_a_rotor_becomes_unstable():
    """K_p T / 2 < K_d < 2 J / T, and J / T with one sample of delay as K_p goes to zero."""
    assert limit(40.0, 0.0, 1.0, 30.0) == pytest.approx(20.0, abs=1e-9)
    assert limit(1e-6, T, 2.0, 15.0) == pytest.approx(10.0, abs=1e-8)
    assert limit(40.0, 0.0, 1e-3, 1.0) == pytest.approx(0.5 * 40.0 * T, abs=1e-9)
    with pytest.warns(pf.ResultWarning, match=r"\|z\| = 1\.\d+ at 500 Hz"):
        assert np.isnan(pf.margins(rotor(), gains(40.0, 20.1)).peak)


def test_a_loop_that_hardly_grows_is_seen_to_be_unstable():
    """x_k+1 = x_k + 2.8e-6 x_k: in what is printed, in a row of margins, and by a warning."""
    plant = np.zeros((1, 1)), np.eye(1), np.eye(1), np.zeros((1, 1))
    loop = pf.closed_loop(plant, DiscreteModel(*np.zeros((3, 1, 1)), np.array([[2.8e-6]]), 1.0, (), ()))
    assert repr(loop) == "ClosedLoop(2 states, spectral radius 1.0000028, unstable)"
    with pytest.warns(pf.ResultWarning, match=r"\|z\| = 1\.0000028 at 0 Hz"):
        (row,) = pf.margins(loop).to_frame().to_dict("records")
    assert row.pop("stable") is False
    assert np.isnan([value for name, value in row.items() if name != "crossover"]).all()
    with pytest.warns(pf.ResultWarning, match="unstable"):
        assert np.isnan(loop.delay_margin())


@pytest.mark.parametrize("seed", range(12))
def test_poles_beyond_a_radius_without_states_of_delay(seed):
    """As many as there are eigenvalues, of random plants and laws with delays up to 60 samples and a part."""
    random = np.random.default_rng(seed)
    n, motors, sensors = 1 + seed % 5, 1 + seed % 2, 1 + seed // 3 % 2
    A = 30.0 * random.standard_normal((n, n))
    A -= np.eye(n) * (np.max(np.linalg.eigvals(A).real) + (0.1, 3.0)[seed % 2])
    sizes = (n, motors), (sensors, n), (sensors, motors)
    plant = A, *(random.standard_normal(size) for size in sizes)
    law = [random.standard_normal(size) for size in ((2, 2), (2, sensors), (motors, 2), (motors, sensors))]
    law[0] *= 0.4
    late, part = (0, 3, 20, 60)[seed % 4], (0.0, 0.4)[seed // 2 % 2]
    for radius in (2.0**0.001, 1.02):
        now = pf.closed_loop(plant, DiscreteModel(*law, 1e-3, (), ()), delay=part * 1e-3)
        poles = now.later((late + part) * 1e-3).poles
        assert poles_beyond(now, late, radius) == np.count_nonzero(np.abs(poles) > radius)


def test_natural_frequency_and_damping_of_a_sampled_pole():
    for omega, ratio in ((30.0, 0.02), (200.0, -0.1), (50.0, 1.0)):
        z = complex(np.exp(0.01 * omega * (-ratio + 1j * np.sqrt(1.0 - ratio**2))))
        assert damped_frequency(z, 0.01) == pytest.approx((omega / (2.0 * np.pi), ratio), rel=1e-12)
    assert damped_frequency(0j, 0.01) == (0.0, 1.0)


# --- Margins ----------------------------------------------------------------------------------------------------------


@pytest.mark.parametrize("late", [0, 1, 3])
def test_an_integrator_with_delay(late):
    """L = k T z^-d / (z - 1): |L| = k T / (2 sin(w T / 2)), phase -90 degrees - (d + 1/2) w T."""
    k = 40.0
    found = pf.margins(integrator(), gains(k, period=PERIOD), delay=PERIOD * late).motors["u1"]
    crossover = 2.0 * np.arcsin(0.5 * k * PERIOD) / PERIOD
    phase = 0.5 * np.pi - (late + 0.5) * crossover * PERIOD
    assert found.crossovers == pytest.approx([crossover], rel=1e-10)
    assert found.phase == pytest.approx(phase, abs=1e-9)
    assert found.delay == pytest.approx(phase / crossover, rel=1e-9)
    turned = np.pi / (2 * late + 1) / PERIOD
    assert found.phase_crossovers[0] == pytest.approx(turned, rel=1e-9)
    assert found.gain_up == pytest.approx(2.0 * np.sin(0.5 * turned * PERIOD) / (k * PERIOD), rel=1e-9)
    assert found.gain_down == 0.0


def test_delay_margin_of_an_integrator():
    """Exact for parts of a sample: z (z - 1) + k T (1 - f) z + k T f = 0 has |z|^2 = k T f = 1."""
    k = 160.0
    loop = pf.closed_loop(integrator(), gains(k, period=PERIOD))
    assert loop.delay_margin() == pytest.approx(PERIOD / (k * PERIOD), rel=1e-9)
    slow = pf.margins(integrator(), gains(8.0, period=PERIOD))
    assert slow.loop.delay_margin() == pytest.approx(slow.motors["u1"].delay, rel=1e-3)
    with pytest.raises(InputError, match="sampled plant"):
        pf.closed_loop(pf.discretise(integrator(), PERIOD), gains(k, period=PERIOD)).delay_margin()


def test_margins_are_those_of_python_control():
    """Of few states, as it makes polynomials: a rotor with friction under a lead, one sample late."""
    control = pytest.importorskip("control")
    A, B, C, D = rotor()
    A = A + np.diag([0.0, -8.0])
    plant = control.ss(A, B, C[:1], D[:1]).sample(0.01)
    lead = control.tf([-1.2, 1.2 * 0.93], [1.0, -0.2], 0.01)
    gain, phase, distance, turned, crossover, at = control.stability_margins(
        -lead * plant * control.tf([1.0], [1.0, 0.0], 0.01), method="poly"
    )
    one = pf.margins((A, B, C[:1], D[:1]), control.ss(lead), delay=0.01).motors["u1"]
    assert one.gain_up == pytest.approx(gain, rel=1e-6)
    assert np.rad2deg(one.phase) == pytest.approx(phase, rel=1e-6)
    assert one.crossovers == pytest.approx([crossover], rel=1e-6)
    assert one.phase_crossovers[0] == pytest.approx(turned, rel=1e-6)
    assert 1.0 / one.peak == pytest.approx(distance, rel=1e-4)
    assert one.peak_frequency == pytest.approx(at, rel=1e-2)


def test_gains_that_may_not_fall():
    """What grows as e^at needs k > a: both margins of L = k b / (z - e^aT), b = (e^aT - 1) / a."""
    a, k = 3.0, 8.0
    found = pf.margins(([[a]], [[1.0]], [[1.0]], [[0.0]]), gains(k, period=PERIOD)).motors["u1"]
    grown = np.exp(a * PERIOD)
    assert found.gain_down == pytest.approx(a / k, rel=1e-9)
    assert found.gain_up == pytest.approx((1.0 + grown) * a / (grown - 1.0) / k, rel=1e-9)


def two_drives():
    """Two masses on springs to each other and to the ground, a drive at each, places and rates measured."""
    K, D = np.array([[900.0, -500.0], [-500.0, 700.0]]), np.array([[1.0, -0.3], [-0.3, 0.8]])
    A = np.block([[np.zeros((2, 2)), np.eye(2)], [-K, -D]])
    return A, np.vstack([np.zeros((2, 2)), np.eye(2)]), np.eye(4), np.zeros((4, 2))


MATRIX = np.array([[300.0, 40.0, 20.0, 3.0], [60.0, 200.0, 2.0, 14.0]])


@pytest.mark.parametrize("motor", [0, 1])
def test_a_loop_at_its_margins_is_at_the_border_of_stability(motor):
    """One gain of two multiplied by its margin; one delay, of whole samples, just below and above its own."""
    found = pf.margins(two_drives(), gains(*MATRIX, period=2e-3), delay=2e-3)
    one = found.motors[f"u{motor + 1}"]
    scaled = MATRIX.copy()
    scaled[motor] *= one.gain_up
    assert pf.closed_loop(two_drives(), gains(*scaled, period=2e-3), delay=2e-3).spectral_radius == pytest.approx(
        1.0, abs=1e-9
    )
    samples = one.delay / 2e-3
    radii = [np.max(np.abs(np.linalg.eigvals(later(motor, int(k))))) for k in (np.floor(samples), np.ceil(samples))]
    assert radii[0] < 1.0 < radii[1]
    S = found.loop.sensitivity(one.peak_frequency)[0]
    assert abs(S[motor, motor]) == pytest.approx(one.peak, rel=1e-9)
    assert found.peak >= one.peak
    assert np.linalg.norm(found.loop.sensitivity(found.peak_frequency)[0], 2) == pytest.approx(found.peak, rel=1e-9)


def later(motor, samples):
    """The closed loop's matrix with so many samples more at one motor."""
    plant = pf.discretise(two_drives(), 2e-3, 2e-3)
    n = len(plant.states)
    chain = np.eye(samples, k=-1)
    A = np.block([[plant.A, np.zeros((n, samples))], [np.zeros((samples, n)), chain]])
    law = -MATRIX @ plant.C
    direct = plant.B.copy()
    if samples:
        A[:n, n + samples - 1] = plant.B[:, motor]
        direct[:, motor] = 0.0
        A[n, :n] += law[motor]
    A[:n, :n] += direct @ law
    return A


def test_sensitivity_of_two_motors():
    """S = (1 - K P)^-1, from responses of plant and law by themselves."""
    loop = pf.closed_loop(two_drives(), gains(*MATRIX, period=2e-3), delay=3e-3)
    for omega in (1.0, 25.0, 300.0):
        z = np.exp(1j * omega * 2e-3)
        P = loop.plant.C @ np.linalg.solve(z * np.eye(len(loop.plant.A)) - loop.plant.A, loop.plant.B)
        S = np.linalg.inv(np.eye(2) + MATRIX @ P)
        assert loop.sensitivity(omega)[0] == pytest.approx(S, rel=1e-9)
        assert loop.loop(omega)[0] == pytest.approx(1.0 / np.diag(S) - 1.0, rel=1e-9)


def test_peaks_between_points_of_the_grid():
    """Two vibrations of damping 1e-5 within a step of the grid: peaks are found beside their poles, the higher one."""
    A = scipy.linalg.block_diag(oscillator(30.0, 1e-5)[0], oscillator(30.04, 1e-5)[0])
    model = A, np.array([[0.0], [1.0], [0.0], [0.3]]), np.array([[1.0, 0.0, 1.0, 0.0]]), np.zeros((1, 1))
    found = pf.margins(model, gains(-0.004, period=0.01))
    loop = found.loop
    poles = np.unique(np.round(np.abs(np.angle(loop.poles)) / 0.01, 9))
    near = (poles[:, None] * (1.0 + np.linspace(-1e-4, 1e-4, 20001))).ravel()
    highest = np.max(np.abs(loop.sensitivity(near)[:, 0, 0]))
    assert highest > 1.05
    assert found.peak == pytest.approx(highest, rel=1e-6)
    assert found.peak >= highest * (1.0 - 1e-10)


def test_crossovers_at_a_resonance_narrower_than_the_grid():
    """Gain above one within 2e-5 of 30 rad/s only: k / sqrt((w0^2 - w^2)^2 + (2 d w0 w)^2) = 1, sampled."""
    found = pf.margins(oscillator(30.0, 1e-5), gains(-0.04, 0.0, period=0.01)).motors["u1"]
    offset = np.sqrt(0.04**2 - (2e-5 * 900.0) ** 2) / 60.0
    assert found.crossovers == pytest.approx([30.0 - offset, 30.0 + offset], abs=0.03 * offset)


# --- Several models ---------------------------------------------------------------------------------------------------


def test_one_controller_on_several_models():
    """Rotors of several inertias; the lightest one is unstable, and last."""
    models = {f"{size:g} J": (rotor()[0], rotor()[1] / size, *rotor()[2:]) for size in (1.0, 0.05, 4.0)}
    with pytest.warns(pf.ResultWarning, match=r"unstable with 0\.05 J"):
        table = pf.closed_loops(models, gains(40.0, 1.2))
    assert table.index[-1] == "0.05 J"
    assert list(table["stable"]) == [True, True, False]
    assert table.loc["1 J", "spectral_radius"] == pf.closed_loop(rotor(), gains(40.0, 1.2)).spectral_radius
    with pytest.raises(InputError, match="no model"):
        pf.closed_loops({}, gains(1.0, 1.0))
    with pytest.raises(InputError, match=r"models\.rotor"):
        pf.closed_loops({"rotor": rotor()}, gains(1.0))


def test_poses_along_a_path_and_payloads():
    """A design for the start of the five-bar's path on poses along it, and with a payload."""
    model = pf.load("five_bar")
    links = tuple(replace(one, damping=pf.ModalDamping((0.01,))) for one in model.mechanism.bodies)
    bar = replace(model.mechanism, bodies=links)
    path = next(iter(model.paths.values()))
    poses = pf.poses_along(pf.plan(bar, path, samples=41), 3, mode="++")
    few = pf.reduce(poses.models[0], 12)
    angles = [one.name for one in few.outputs][:2]
    design = pf.lqg(
        few, 1e-3, delay=1e-3, measured=angles, deviations=dict.fromkeys(angles, 0.02), effort=1.0, noise=1e-3
    )
    named = {f"{place:.3f} {poses.unit}": one for place, one in zip(poses.places, poses.models, strict=True)}
    named["payload"] = pf.linearise(bar.with_payload(pf.Payload(0.1)), mode="++")
    table = pf.closed_loops(named, design)
    assert set(table.index) == set(named)
    assert table["stable"].all()


@pytest.mark.parametrize(
    ("arguments", "settings", "field"),
    [
        ((rotor(), 3.0), {}, "controller"), ((rotor(), scipy.signal.StateSpace(*oscillator())), {}, "controller"),
        ((rotor(), gains(1.0)), {}, "controller"),
        ((rotor(), scipy.signal.dlti(-1.0, 0.0, 0.0, -1.0, dt=True)), {}, "period"),
        ((rotor(), gains(1.0, 1.0)), {"inputs": ["y1", "y9"]}, "inputs"),
        ((rotor(), gains(1.0, 1.0)), {"outputs": ["u9"]}, "outputs"),
        ((rotor(), gains(1.0, 1.0)), {"delay": -1.0}, "delay"), ((rotor(), gains(1.0, 1.0)), {"period": 0.0}, "period"),
        ((pf.discretise(rotor(), 0.5), gains(1.0, 1.0)), {}, "model"),
        ((rotor(), gains(1.0, 1.0)), {"period": "1 ms"}, "period"),
        ((rotor(), gains(1.0, 1.0)), {"inputs": 3}, "inputs"),
    ],
)  # fmt: skip
def test_loops_that_cannot_be_closed(arguments, settings, field):
    with pytest.raises(InputError) as error:
        pf.closed_loop(*arguments, **settings)
    assert error.value.field == field
    assert error.value.remedy


@pytest.mark.parametrize(
    ("call", "field"),
    [
        (lambda: pf.closed_loops([rotor()], gains(1.0, 1.0)), "models"),
        (lambda: pf.discretise(rotor(), "fast"), "period"),
        (lambda: pf.discretise(rotor(), 1e-3, [1.0, 2.0]), "delay"),
        (lambda: pf.margins(rotor(), gains(1.0, 1.0), period="fast"), "period"),
        (lambda: pf.spillover(rotor(), rotor(), gains(1.0, 1.0), delay="late"), "models.reduced.delay"),
    ],
)
def test_arguments_of_another_type_are_refused(call, field):
    with pytest.raises(InputError) as error:
        call()
    assert error.value.field == field


def test_one_sensor_is_a_list_of_one():
    loop = pf.closed_loop(rotor(), gains(1.0), inputs="y2")
    assert loop.plant.outputs == ("y2",)


def test_controllers_of_all_kinds_are_one_loop():
    design = quanser_design(delay=0.02)
    control = pytest.importorskip("control")
    law = scipy.signal.dlti(*design.state_space, dt=PERIOD)
    ways = [
        pf.closed_loop(quanser(), design), pf.closed_loop(quanser(), design.law()),
        pf.closed_loop(quanser(), SampledController(design.law(), limits=1.0)),
        pf.closed_loop(quanser(), law, delay=0.02, inputs=["y1", "y2"]),
        pf.closed_loop(
            pf.discretise(quanser(), PERIOD, 0.02), control.ss(*design.state_space, PERIOD), inputs=["y1", "y2"]
        ),
    ]  # fmt: skip
    for one in ways[1:]:
        assert one.spectral_radius == pytest.approx(ways[0].spectral_radius, rel=1e-12)
    assert "spectral radius" in repr(ways[0])
