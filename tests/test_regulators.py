"""Sampling, LQR, LQG, filters: closed forms, another solver, a published rig, and RAParM-I with eight vibrations."""

from __future__ import annotations

from dataclasses import replace
from itertools import pairwise

import numpy as np
import pytest
import scipy

import paraflex as pf
from paraflex.control.design.coloured import disturbed_plant
from paraflex.control.laws.controllers import Plant
from paraflex.control.laws.estimators import kalman_filter, riccati
from paraflex.control.loop.chain import SampledController
from paraflex.errors import InputError
from paraflex.paths import Line
from rotors import rotor

# Quanser's arm with flexible links, first stage: a steel beam of 3 x 0.050 in, 0.202 m; repository
# basta/quanser-2-dof-serial-flexible-link.
STIFFNESS = 3.0 * 2.068427e11 * (3 * 0.0254) * (0.050 * 0.0254) ** 3 / 12.0 / 0.202
HUB, LINK, DRIVE, FRICTION = 0.06353616, 0.170434272, 8.925, 4.0
PERIOD = 0.01


def quanser():
    """States hub angle, deflection and rates; input current; outputs hub, deflection and tip."""
    A = np.zeros((4, 4))
    A[0, 2] = A[1, 3] = 1.0
    A[2] = [0.0, STIFFNESS / HUB, -FRICTION / HUB, 0.0]
    A[3] = [0.0, -STIFFNESS / HUB - STIFFNESS / LINK, FRICTION / HUB, 0.0]
    B = DRIVE / HUB * np.array([[0.0], [0.0], [1.0], [-1.0]])
    C = np.array([[1.0, 0.0, 0.0, 0.0], [0.0, 1.0, 0.0, 0.0], [1.0, 1.0, 0.0, 0.0]])
    return A, B, C, np.zeros((3, 1))


def quanser_design(**changes):
    """Q = 50 C^T C + 1e-3 I of the tip, R = 0.5, Qn = 10 Bd Bd^T, Rn = 1e-6 I of hub and deflection."""
    settings = {
        "measured": ["y1", "y2"], "deviations": {"y3": 50**-0.5}, "effort": 0.5**-0.5, "noise": 1e-3,
        "disturbance": 10**0.5, "state_weights": 1e-3 * np.eye(4),
    }  # fmt: skip
    return pf.lqg(quanser(), PERIOD, **{**settings, **changes})


def oscillator(omega=30.0, ratio=0.02):
    """A driven vibration: displacement and rate, the input's force over the mass."""
    A = np.array([[0.0, 1.0], [-(omega**2), -2.0 * ratio * omega]])
    return A, np.array([[0.0], [1.0]]), np.eye(2), np.zeros((2, 1))


# --- Sampling ---------------------------------------------------------------------------------------------------------


@pytest.mark.parametrize("delay", [0.0, 0.003, 0.01, 0.0125, 0.0301])
@pytest.mark.parametrize("feeds", [0.0, 2.0])
def test_sampled_models_do_what_continuous_ones_do(delay, feeds):
    """Against an integration to 1e-12 with torques that change where they act; readings before they change."""
    A, B, C, D = oscillator()
    D = D + feeds
    plant, torques = pf.discretise((A, B, C, D), 0.01, delay), np.random.default_rng(1).standard_normal((9, 1))
    x, state = np.zeros(len(plant.states)), np.zeros(2)
    switches = 0.01 * np.arange(9) + delay

    def acting(t):
        k = np.searchsorted(switches, t + 1e-12) - 1
        return torques[k] if k >= 0 else np.zeros(1)

    for k in range(9):
        before = C @ state + D @ acting(0.01 * k - 2e-12)
        assert plant.C @ x == pytest.approx(before, abs=1e-11)
        x = plant.A @ x + plant.B @ torques[k]
        ends = [0.01 * k, *sorted(s for s in switches if 0.01 * k + 1e-9 < s < 0.01 * (k + 1) - 1e-9), 0.01 * (k + 1)]
        for start, end in pairwise(ends):
            u = acting(0.5 * (start + end))
            state = scipy.integrate.solve_ivp(
                lambda t, z, u=u: A @ z + B @ u, (start, end), state, rtol=1e-12, atol=1e-14, method="DOP853"
            ).y[:, -1]
    assert plant.states[0] == "x1"
    assert all(name.startswith("u1(k-") for name in plant.states[2:])


def test_sampled_poles_are_exponentials_and_names_stay():
    control = pytest.importorskip("control")
    plant = pf.discretise(control.ss(*oscillator(), inputs=["drive"], outputs=["place", "rate"]), 0.02, 0.03)
    assert plant.inputs == ("drive",)
    assert plant.outputs == ("place", "rate")
    exact = np.exp(0.02 * np.linalg.eigvals(oscillator()[0]))
    assert np.sort_complex(plant.poles[:2]) == pytest.approx(np.sort_complex(exact), abs=1e-14)
    assert plant.states[2:] == ("drive(k-2)", "drive(k-1)")


@pytest.mark.parametrize(
    ("arguments", "field"),
    [
        ((oscillator(), 0.0), "period"), ((oscillator(), float("nan")), "period"),
        ((oscillator(), 0.01, -1.0), "delay"),
        ((3.0, 0.01), "model"), ((oscillator()[:3], 0.01), "model"),
        (((np.eye(2), np.eye(3), np.eye(2), np.eye(2)), 0.01), "model"),
        ((scipy.signal.dlti(*oscillator(), dt=0.1), 0.01), "model"),
        (((np.full((2, 2), np.nan), *oscillator()[1:]), 0.01), "model"),
    ],
)  # fmt: skip
def test_models_that_cannot_be_sampled(arguments, field):
    with pytest.raises(InputError) as error:
        pf.discretise(*arguments)
    assert error.value.field == field
    assert error.value.remedy


# --- Design -----------------------------------------------------------------------------------------------------------


def test_the_rig_of_two_masses():
    """The model's nameplate values: poles of the repository's model, the hub's zeros."""
    A = quanser()[0]
    assert abs(STIFFNESS - 39.9572) < 1e-4
    assert np.sort_complex(np.linalg.eigvals(A)) == pytest.approx(
        [-51.78913263, -5.58357149 - 15.93171401j, -5.58357149 + 15.93171401j, 0.0], abs=1e-7
    )
    assert np.sqrt(STIFFNESS / LINK) == pytest.approx(15.3115452, abs=1e-7)


def test_gains_of_the_rig():
    design = quanser_design()
    gain = design.K[0]
    assert gain == pytest.approx([9.07846018, -0.07013988, 0.73128995, 0.60129318], abs=6e-9)
    plant = design.regulator.plant
    tip = np.array([[1.0, 1.0, 0.0, 0.0]])
    P = scipy.linalg.solve_discrete_are(plant.A, plant.B, 50.0 * tip.T @ tip + 1e-3 * np.eye(4), np.array([[0.5]]))
    exact = np.linalg.solve(0.5 + plant.B.T @ P @ plant.B, plant.B.T @ P @ plant.A)
    assert gain == pytest.approx(exact[0], rel=1e-8)


def test_step_of_the_rig_with_limited_current():
    """20 degrees, 0.6 A: the limits are told to the filter, the first estimate is a turned hub at rest."""
    design = quanser_design()
    law, plant, x = design.law(), design.regulator.plant, np.zeros(4)
    path = np.empty((300, 4))
    for k in range(300):
        torques = np.clip(law.step(k, PERIOD * k, x[:2] - [np.deg2rad(20.0), 0.0]), -0.6, 0.6)
        law.limited(torques)
        path[k], x = x, plant.A @ x + plant.B @ torques
    tip, deflection = np.rad2deg(path[:, 0] + path[:, 1]), np.rad2deg(path[:, 1])
    assert 100.0 * (tip.max() / 20.0 - 1.0) == pytest.approx(1.4579, abs=5e-5)
    assert np.abs(deflection).max() == pytest.approx(3.559445, abs=5e-7)
    assert tip[[20, 40, 100]] == pytest.approx([9.48473417, 20.26248746, 20.00576103], abs=6e-9)


def test_delay_that_the_rigs_design_does_not_know():
    """0, 10, ..., 60 ms beside the period of a law u_k = -K x_k|k-1, which acts on readings until the sample before."""
    design = quanser_design()
    one, plant = design.filter, design.regulator.plant
    late = plant.A @ design.L
    law = scipy.signal.dlti(plant.A - plant.B @ design.K - late @ one.C, late, -design.K, np.zeros((1, 2)), dt=PERIOD)
    radii = [pf.closed_loop(quanser(), law, delay=PERIOD * k, inputs=["y1", "y2"]).spectral_radius for k in range(7)]
    assert radii == pytest.approx([0.95192, 0.95192, 0.95192, 0.96536, 0.99077, 1.00741, 1.01792], abs=5e-6)
    # The design's own law, which corrects its estimate first, is a little faster, and unstable at 50 ms as well.
    own = [pf.closed_loop(quanser(), design, delay=delay).spectral_radius for delay in (0.04, 0.05)]
    assert own == pytest.approx([0.98296, 1.00708], abs=5e-6)
    margin = pf.closed_loop(quanser(), design).delay_margin()
    assert 0.04 < margin < 0.05
    assert pf.closed_loop(quanser(), design, delay=margin).spectral_radius == pytest.approx(1.0, abs=1e-9)
    # In the design the delay costs little.
    assert quanser_design(delay=0.05).spectral_radius < 0.96


@pytest.mark.parametrize("delay", [0.0, 0.01, 0.013, 0.02])
@pytest.mark.parametrize("integrators", [{}, {"y1": 0.5}])
def test_the_loop_has_the_poles_of_regulator_and_filter(delay, integrators):
    """Separation: the law as matrices on the plant, and the law itself, sample by sample."""
    deviations = {"y3": 0.1, "y1": 0.2}
    design = quanser_design(delay=delay, integrators=integrators, deviations=deviations)
    loop = pf.closed_loop(quanser(), design)
    z = np.exp(0.3j) * 1.7
    assert np.prod(z - loop.poles) == pytest.approx(np.prod(z - design.poles), rel=1e-7)
    assert loop.stable
    law, matrices, xi = design.law(), design.state_space, np.zeros(len(design.state_space.A))
    xi[: len(design.filter.A)] = design.start @ [0.1, 0.02]
    random = np.random.default_rng(3)
    for k in range(20):
        y = np.array([0.1, 0.02]) if not k else random.standard_normal(2)
        assert law.step(k, 0.0, y) == pytest.approx(matrices.C @ xi + matrices.D @ y, rel=1e-9, abs=1e-12)
        xi = matrices.A @ xi + matrices.B @ y


def test_integrators_remove_what_constant_loads_do():
    """A constant 0.3 A that nobody told: the hub returns, and does not without an integrator."""
    ends = {}
    for name, integrators in (("without", {}), ("with", {"y1": 0.3})):
        design = quanser_design(delay=0.013, integrators=integrators, deviations={"y1": 0.1, "y3": 0.1}, noise=1e-2)
        plant = pf.discretise(quanser(), PERIOD, 0.013)
        law, x = design.law(), np.zeros(len(plant.states))
        for k in range(1500):
            u = law.step(k, PERIOD * k, (plant.C @ x)[:2])
            x = plant.A @ x + plant.B @ u + plant.G[:, 0] * 0.3
        ends[name] = (plant.C @ x)[0]
    assert abs(ends["with"]) < 1e-6
    assert abs(ends["without"]) > 1e-3


@pytest.mark.parametrize("tighter", [0.0, 1.0, 12.0])
@pytest.mark.parametrize("decay", [0.2, 1.0])
def test_integrators_decay_with_their_time(tighter, decay):
    """A rotor that motors turn fast: exp(-t/tau) of its error; sqrt(1 + r^2) as slow if another is r as tight."""
    rotor = np.array([[0.0, 1.0], [0.0, 0.0]]), np.array([[0.0], [100.0]]), np.eye(2)[[0, 0]], np.zeros((2, 1))
    deviations = {"y1": 0.02} | ({"y2": 0.02 / tighter} if tighter else {})
    design = pf.lqg(rotor, 1e-3, measured=["y1"], deviations=deviations, effort=10.0, noise=1e-4,
                    integrators={"y1": decay})  # fmt: skip
    slowest = -1e-3 / np.log(np.max(np.abs(design.regulator.poles)))
    assert slowest == pytest.approx(decay * np.hypot(1.0, tighter), rel=1e-4)
    if not tighter:
        plant, law, x, y = pf.discretise(rotor, 1e-3), design.law(), np.zeros(2), []
        for k in range(round(4.0 * decay / 1e-3)):
            y.append((plant.C @ x)[0])
            x = plant.A @ x + plant.B @ law.step(k, 1e-3 * k, plant.C[:1] @ x) + plant.G[:, 0] * 0.3
        assert y[round(3e3 * decay)] / y[round(2e3 * decay)] == pytest.approx(np.exp(-1.0), rel=0.01)


def test_integrals_stay_while_torques_are_limited():
    """Held back at 1 mA for five seconds, the law returns within one; integrals that went on would take longer."""
    design = quanser_design(integrators={"y1": 0.3}, deviations={"y1": 0.1, "y3": 0.1})
    law = design.law()
    for k in range(500):
        law.step(k, 0.0, np.array([-0.3, 0.0]))
        law.limited(np.array([1e-3]))
    assert law.integrals == pytest.approx([0.0], abs=1e-12)
    free = design.law()
    for k in range(500):
        free.step(k, 0.0, np.array([-0.3, 0.0]))
    assert free.integrals == pytest.approx([-0.3 * PERIOD * 499])


def plant_of(**changes):
    settings = {
        "mechanism": rotor().mechanism, "mode": None, "task": None, "state": None, "inputs": ("y1", "y2"),
        "input_units": ("", ""), "outputs": ("u1",), "period": PERIOD, "delay": 0.0,
    }  # fmt: skip
    return Plant(**{**settings, **changes})


def test_the_law_is_one_for_sampled_controllers():
    """Names, period and delay are its own; limits reach the filter; a second run is as the first."""
    design = quanser_design(delay=0.013)
    controller = SampledController(design.law(), limits=0.6, reference={"y1": 0.3})
    assert (controller.period, controller.delay, controller.inputs, controller.outputs) == (
        0.01,
        0.013,
        ("y1", "y2"),
        ("u1",),
    )
    runs = []
    for _ in range(2):
        controller.start(plant_of(delay=0.013))
        runs.append([controller.step(k, PERIOD * k, np.array([0.01 * k, 0.0]))[0] for k in range(20)])
    assert runs[0] == runs[1]
    assert max(runs[0]) == 0.6
    law = design.law()
    by_hand = []
    for k in range(20):
        by_hand.append(np.clip(law.step(k, 0.0, np.array([0.01 * k - 0.3, 0.0])), -0.6, 0.6)[0])
        law.limited(np.array(by_hand[-1:]))
    assert by_hand == runs[0]
    for changes, field in (
        ({"inputs": ("y2", "y1")}, "inputs"),
        ({"outputs": ("u2",)}, "outputs"),
        ({"period": 0.02}, "period"),
        ({"delay": 0.0}, "delay"),
        ({"delay": 0.0131}, "delay"),
    ):
        with pytest.raises(InputError) as error:
            design.law().start(plant_of(**{"delay": 0.013, **changes}))
        assert error.value.field == field


def test_riccati_is_scipys_where_that_has_a_solution():
    random = np.random.default_rng(4)
    A, B = random.standard_normal((6, 6)), random.standard_normal((6, 2))
    rows = random.standard_normal((3, 6))
    weights = np.diag([2.0, 0.3])
    assert riccati(A, B, rows.T @ rows, weights) == pytest.approx(
        scipy.linalg.solve_discrete_are(A, B, rows.T @ rows, weights), rel=1e-8
    )
    with pytest.raises(np.linalg.LinAlgError):
        riccati(np.eye(2), np.array([[1.0], [0.0]]), np.eye(2), np.eye(1))


def test_filter_of_one_state():
    """x' = x + w, y = x + e: P = W / 2 + sqrt(W^2 / 4 + W R), L = P / (P + R)."""
    one, W, R = np.eye(1), 0.04, 2.0
    found = kalman_filter(one, one, one, W * one, R * one)
    P = 0.5 * W + np.sqrt(0.25 * W**2 + W * R)
    assert found.covariance.item() == pytest.approx(P, rel=1e-12)
    assert found.gain.item() == pytest.approx(P / (P + R), rel=1e-12)
    assert found.poles == pytest.approx([1.0 - P / (P + R)])


TWO = scipy.linalg.block_diag(oscillator()[0], oscillator(47.0, 0.0)[0])


@pytest.mark.parametrize(
    ("changes", "field", "said"),
    [
        ({"measured": ["y7"]}, "measured", "unknown"), ({"measured": ["y1", "y1"]}, "measured", "twice"),
        ({"deviations": {"tip": 1.0}}, "deviations", "unknown"),
        ({"deviations": {"y3": 0.0}}, "deviations.y3", "positive"),
        ({"effort": {"u9": 1.0}}, "effort", "unknown"), ({"effort": -1.0}, "effort", "positive"),
        ({"effort": {}}, "effort", "no motor"), ({"noise": {"y1": 1.0}}, "noise", "no noise"),
        ({"noise": 0.0}, "noise", "positive"), ({"disturbance": {"u7": 1.0}}, "disturbance", "unknown"),
        ({"integrators": {"y2": 1.0}}, "integrators", "no deviation"),
        ({"integrators": {"y3": 1.0}}, "integrators", "not measured"),
        ({"state_weights": np.eye(3)}, "state_weights", "numbers"),
        ({"state_weights": -np.eye(4)}, "state_weights", "semi"),
        ({"measured": ["y2"]}, "measured", "free motion"), ({"delay": -1.0}, "delay", "negative"),
        ({"deviations": {"y2": 0.1}, "state_weights": None}, "deviations", "no optimal feedback"),
        ({"coloured": {"u7": (1.0, 1.0)}}, "coloured", "unknown"), ({"coloured": {"u1": 1.0}}, "coloured.u1", "pair"),
        ({"coloured": {"u1": (-1.0, 1.0)}}, "coloured.u1", "positive"),
        ({"coloured": {"u1": (1.0, -1.0)}}, "coloured.u1", "positive"),
        ({"coloured": {"u1": (1.0, ([1.0], [1.0, 0.0]))}}, "coloured.u1", "not stable"),
    ],
)  # fmt: skip
def test_designs_that_make_no_sense(changes, field, said):
    with pytest.raises(InputError, match=said) as error:
        quanser_design(**changes)
    assert error.value.field == field
    assert error.value.remedy


def test_vibrations_that_motors_or_readings_miss_are_named():
    """Two vibrations; the one at 47 rad/s, undamped, is not driven, or not measured."""
    both = np.array([[0.0], [1.0], [0.0], [1.0]])
    first = np.array([[0.0], [1.0], [0.0], [0.0]])
    settings = {"measured": ["y1"], "deviations": {"y1": 1.0}, "effort": 1.0, "noise": 0.1}
    hertz = rf"{47.0 / (2.0 * np.pi):.4g} Hz"
    with pytest.raises(InputError, match=hertz) as error:
        pf.lqg((TWO, first, np.array([[1.0, 0.0, 1.0, 0.0]]), np.zeros((1, 1))), 0.01, **settings)
    assert error.value.field == "effort"
    with pytest.raises(InputError, match=hertz) as error:
        pf.lqg((TWO, both, np.array([[1.0, 0.0, 0.0, 0.0]]), np.zeros((1, 1))), 0.01,
               **{**settings, "state_weights": np.eye(4)})  # fmt: skip
    assert error.value.field == "measured"


def test_disturbances_that_last_are_estimated():
    """A rotor under a torque that noise makes through a low-pass: its sampling in closed form, gains by SciPy."""
    T, J, sd, hertz = 0.01, 0.02, 0.3, 2.0
    a = 2.0 * np.pi * hertz
    e, g = np.exp(-a * T), sd * np.sqrt((1.0 + np.exp(-a * T)) / (1.0 - np.exp(-a * T)))
    once, twice = (1.0 - e) / a, T / a - (1.0 - e) / a**2  # integrals of exp(-a t) over the period
    A = np.array([[1.0, T, twice / J], [0.0, 1.0, once / J], [0.0, 0.0, e]])
    B = np.array([[T**2 / 2.0], [T], [0.0]]) / J
    w = g * np.array([[(T**2 / 2.0 - twice) / J], [(T - once) / J], [1.0 - e]])
    assert w[2] ** 2 / (1.0 - e**2) == pytest.approx(sd**2)
    rotor = np.array([[0.0, 1.0], [0.0, 0.0]]), np.array([[0.0], [1.0 / J]]), np.array([[1.0, 0.0]]), np.zeros((1, 1))
    design = pf.lqg(rotor, T, measured=["y1"], deviations={"y1": 1e-3}, effort=1.0, noise=1e-4, disturbance=0.1,
                    coloured={"u1": (sd, hertz)})  # fmt: skip
    C, process = np.array([[1.0, 0.0, 0.0]]), w @ w.T + 0.1**2 * B @ B.T
    P = scipy.linalg.solve_discrete_are(A, B, 1e6 * C.T @ C, np.eye(1))
    gain = np.linalg.solve(1.0 + B.T @ P @ B, B.T @ P @ A)
    # The filter's state x follows noise with x' = w - a x: the torque is g a x.
    size = np.array([1.0, 1.0, g * a])
    assert design.K / size == pytest.approx(gain, rel=1e-7)
    P = scipy.linalg.solve_discrete_are(A.T, C.T, process, np.array([[1e-8]]))
    assert design.filter.covariance * np.outer(size, size) == pytest.approx(P, rel=1e-6)
    assert design.regulator.plant.states == ("x1", "x2", "u1 disturbance 1")
    # Torques act against what lasts: K of the disturbance is one, but for what effort spares.
    assert gain[0, 2] == pytest.approx(1.0, abs=0.05)


@pytest.mark.parametrize("period", [1e-3, 0.02])
@pytest.mark.parametrize("through", [5.0, ([1.0, 300.0], [1.0, 20.0])])
def test_filters_of_noise_have_the_deviation_asked_for(period, through):
    """y = u: the variance is the sum of squares of the response to one sample of noise, the sample itself too."""
    straight = np.zeros((0, 0)), np.zeros((0, 1)), np.zeros((1, 0)), np.eye(1)
    plant, noise = disturbed_plant(straight, period, 0.0, {"u1": (0.7, through)})
    x, squares = noise[:, 0], 0.0
    for _ in range(20000):
        squares += (plant.C @ x).item() ** 2
        x = plant.A @ x
    direct = 0.0 if isinstance(through, float) else _direct(through, period, 0.7)
    assert squares + direct**2 == pytest.approx(0.7**2, rel=1e-9)


def _direct(through, period, deviation):
    """What a sample of noise adds at once: c s + d over s + a passes c, beside a response d - c a."""
    (c, d), (_, a) = through
    e = np.exp(-a * period)
    after = (d - c * a) * (1.0 - e) / a  # of the sample that follows, and then less by e each
    return deviation * c / np.sqrt(c**2 + after**2 / (1.0 - e**2))


def test_noise_through_a_filter_acts_as_integrated():
    """A vibration driven by noise held for a period through (s + 300)/(s + 20), against an integration to 1e-12."""
    A, B, _, _ = oscillator()
    plant, noise = disturbed_plant(oscillator(), 0.01, 0.003, {"u1": (0.7, ([1.0, 300.0], [1.0, 20.0]))})
    gain = _direct(([1.0, 300.0], [1.0, 20.0]), 0.01, 0.7)

    def rates(t, x):
        return [*(A @ x[:2] + B[:, 0] * gain * (1.0 + 280.0 * x[2])), 1.0 - 20.0 * x[2]]

    exact = scipy.integrate.solve_ivp(rates, (0.0, 0.01), np.zeros(3), rtol=1e-12, atol=1e-15, method="DOP853").y[:, -1]
    assert noise[:3, 0] == pytest.approx(exact, rel=1e-9)
    assert plant.states == ("x1", "x2", "u1 disturbance 1", "u1(k-1)")
    assert noise[3, 0] == 0.0


def test_inputs_that_are_not_named_are_disturbances():
    """A second input, not of a motor: its torques disturb, and the law has one output."""
    A, B, C, _ = oscillator()
    model = A, np.hstack([B, 3.0 * B]), C, np.zeros((2, 2))
    settings = {"measured": ["y1"], "deviations": {"y1": 0.1}, "noise": 0.01, "delay": 0.013}
    design = pf.lqg(model, 0.01, effort={"u1": 1.0}, disturbance={"u2": 0.2}, **settings)
    alone = pf.lqg(oscillator(), 0.01, effort=1.0, disturbance=0.6, **settings)
    assert design.law().outputs == ("u1",)
    law, other = design.law(), alone.law()
    for k, y in enumerate(np.random.default_rng(1).standard_normal((9, 1))):
        assert law.step(k, 0.0, y) == pytest.approx(other.step(k, 0.0, y), rel=1e-8)


# --- Rates of quantised readings --------------------------------------------------------------------------------------


def test_differentiator_has_the_gains_of_alpha_beta():
    """Kalata: L = acceleration T^2 / noise, r = (4 + L - sqrt(8 L + L^2)) / 4, alpha = 1 - r^2, beta = 2 (1 - r)^2."""
    for period, resolution, acceleration in ((1e-3, 1.5e-4, 20.0), (0.01, 1e-6, 300.0), (1e-3, 1e-2, 0.1)):
        index = acceleration * period**2 / pf.quantisation_noise(resolution)
        r = (4.0 + index - np.sqrt(8.0 * index + index**2)) / 4.0
        found = pf.Differentiator(period, resolution, acceleration).alpha_beta
        assert found == pytest.approx((1.0 - r**2, 2.0 * (1.0 - r) ** 2), rel=1e-7)


def test_rates_of_an_encoder():
    """1.2 rad/s through steps of 2 pi / 4096: differences jump by 1.5 rad/s, the filter by hundredths, without lag."""
    period, resolution = 1e-3, 2.0 * np.pi / 4096
    filtered, plain, smooth = (
        pf.Differentiator(period, resolution, 10.0), pf.BackwardDifference(period), pf.BackwardDifference(period, 20.0)
    )  # fmt: skip
    rates = np.array([
        [each.step(resolution * np.round(1.2 * period * k / resolution))[1][0] for each in (filtered, plain, smooth)]
        for k in range(2000)
    ])[1000:]  # fmt: skip
    assert rates.mean(axis=0) == pytest.approx([1.2, 1.2, 1.2], abs=2e-3)
    assert np.std(rates[:, 1]) > 0.6
    assert np.std(rates[:, 0]) < 0.1 * np.std(rates[:, 1])
    assert np.std(rates[:, 2]) < 0.3 * np.std(rates[:, 1])
    for each in (filtered, plain, smooth):
        each.start()
        assert each.step(np.array([0.3, 0.4]))[1] == pytest.approx([0.0, 0.0])
    # A ramp, unrounded: a low-pass of first order answers with 1 - (1 - share)^k.
    smooth.start()
    answers = [smooth.step(1.2 * period * k)[1][0] for k in range(5)]
    assert answers == pytest.approx([1.2 * (1.0 - np.exp(-2.0 * np.pi * 20.0 * period * k)) for k in range(5)])


@pytest.mark.parametrize(
    ("make", "field"),
    [
        (lambda: pf.Differentiator(0.0, 1.0, 1.0), "period"), (lambda: pf.Differentiator(1.0, -1.0, 1.0), "resolution"),
        (lambda: pf.Differentiator(1.0, 1.0, 0.0), "acceleration"), (lambda: pf.BackwardDifference(-1.0), "period"),
        (lambda: pf.BackwardDifference(1.0, 0.0), "cutoff"), (lambda: pf.quantisation_noise(0.0), "resolution"),
    ],
)  # fmt: skip
def test_numbers_that_are_not_positive(make, field):
    with pytest.raises(InputError) as error:
        make()
    assert error.value.field == field


def test_noise_of_rounding():
    values = np.random.default_rng(0).uniform(0.0, 1.0, 100000)
    error = 0.01 * np.round(values / 0.01) - values
    assert np.std(error) == pytest.approx(pf.quantisation_noise(0.01), rel=0.01)


# --- RAParM-I ---------------------------------------------------------------------------------------------------------

ENCODERS, GAUGES = ["A1", "D1", "A2", "D2"], ["root1", "root3", "root5", "root7"]


@pytest.fixture(scope="module")
def raparm():
    """Full and reduced model in mode ++++ at (0, 0.264), links damped by one per cent, gauges on links 1, 3, 5, 7."""
    mechanism = pf.library.raparm_i()
    gauges = tuple(pf.StrainGauge(f"root{k}", body=f"link{k}", at=0.05) for k in (1, 3, 5, 7))
    links = tuple(replace(link, damping=pf.ModalDamping((0.01,))) for link in mechanism.bodies)
    start = pf.plan(mechanism, Line((0.0, 0.264), (0.0, 0.26), max_acceleration=1.0), samples=2).start
    full = pf.linearise(replace(mechanism, bodies=links, sensors=gauges), mode="++++", start=start)
    return full, pf.reduce(full, 16)


def raparm_design(model, angles=1e-3, strains=3e-5, disturbance=None):
    """0.5 mm at C, 20 mrad, 1 N m; 1 kHz, torques act one sample late."""
    return pf.lqg(
        model, 1e-3, delay=1e-3, measured=[*ENCODERS, *GAUGES],
        deviations={"x": 5e-4, "y": 5e-4, **dict.fromkeys(ENCODERS, 0.02)}, effort=1.0,
        noise={**dict.fromkeys(ENCODERS, angles), **dict.fromkeys(GAUGES, strains)}, disturbance=disturbance,
    )  # fmt: skip


def test_raparm_with_sixteen_states_controls_the_full_model(raparm):
    """No spillover: the slowest pole is that of the design, and the loop is far from -1 at all motors."""
    full, few = raparm
    design = raparm_design(few)
    table = pf.spillover(full, few, design)
    assert table["stable"].all()
    assert table.loc["full", "spectral_radius"] == pytest.approx(table.loc["reduced", "spectral_radius"], abs=2e-4)
    # The vibration at 51 Hz has three times the damping of the links.
    assert table.loc["full", "damping"] == pytest.approx(0.0337, abs=5e-4)
    found = pf.margins(full, design)
    assert found.peak < 1.65
    rows = found.to_frame()
    assert list(rows.index) == ["tau1", "tau2", "tau5", "tau6"]
    assert (rows["gain_up"] > 2.0).all()
    assert (rows["delay"] > 1.0).all()


def test_a_filter_that_believes_encoders_reaches_vibrations_of_the_full_model(raparm):
    """Noise of rounding alone: stable with sixteen states, not with the vibrations beyond 500 Hz, which fold back."""
    full, few = raparm
    design = raparm_design(few, angles=1e-4, strains=1e-6, disturbance=1.0)
    with pytest.warns(pf.ResultWarning, match="unstable with full"):
        table = pf.spillover(full, few, design)
    assert list(table["stable"]) == [True, False]


def test_integrators_of_raparm(raparm):
    """Four angles with four motors: internal forces, too, are controlled to nothing."""
    _, few = raparm
    times = dict.fromkeys(ENCODERS, 1.0)
    design = pf.lqg(few, 1e-3, delay=1e-3, measured=ENCODERS, deviations=dict.fromkeys(ENCODERS, 0.02), effort=1.0,
                    noise=1e-3, integrators=times)  # fmt: skip
    assert design.spectral_radius < 1.0
    assert pf.closed_loop(few, design).stable


def test_integrators_beside_vibrations_that_hardly_decay():
    """Links without damping, some of which motors hardly reach: doubling finds nothing there, and SciPy does."""
    mechanism = pf.load("five_bar").mechanism
    servos = pf.Actuator("servo", gear=30.0, rotor_inertia=3e-5)
    few = pf.reduce(pf.linearise(replace(mechanism, actuators=[servos]), mode="++"), 12)
    design = pf.lqr(few, 1e-3, delay=1e-3, deviations={"x": 5e-4, "y": 5e-4, "A1": 0.02}, effort=1.0,
                    integrators={"A1": 0.5})  # fmt: skip
    assert 0.9999 < design.spectral_radius < 1.0 - 1e-8
