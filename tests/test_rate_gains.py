"""Gains of rate feedback: closed forms of an oscillator, brute force, and runs of a flexible arm."""

from dataclasses import replace

import numpy as np
import pytest
import scipy

import paraflex as pf
from paraflex import SampledController, Simulation
from paraflex.control.design.closed_loops import named_law
from paraflex.control.design.rate_gains import _Search, _Tried
from paraflex.control.laws.discrete import DiscreteModel, side_by_side
from paraflex.control.laws.kinds.rate_feedback import RateFeedback

# An oscillator x'' = -omega^2 x + u, sampled slowly, torques a sample late.
F, T = 10.0, 5e-3
OMEGA = 2.0 * np.pi * F
OSCILLATOR = (np.array([[0.0, 1.0], [-(OMEGA**2), 0.0]]), np.array([[0.0], [1.0]]), np.eye(1, 2), np.zeros((1, 1)))
PAIR = {"u1": "y1"}
C = np.cos(OMEGA * T)


def characteristic(gain):
    """z^2 (z^2 - 2 c z + 1) + (g / T) (1 - c) / omega^2 (z^2 - 1): held torques, one sample late, differences."""
    return np.polyadd(np.polymul([1.0, 0.0, 0.0], [1.0, -2.0 * C, 1.0]),
                      gain / T * (1.0 - C) / OMEGA**2 * np.array([1.0, 0.0, -1.0]))  # fmt: skip


# Where a pole of it is exp(i pi / 4): (g / T) (1 - c) / omega^2 = (c - cos(pi / 4)) / sin(pi / 4).
LIMIT = (C - np.sqrt(0.5)) / np.sqrt(0.5) * T * OMEGA**2 / (1.0 - C)


def brute_force(gains):
    """Gain of most damping of the vibration's root among many, and the damping ratio."""
    z, best = np.exp(1j * OMEGA * T), (0.0, 0.0)
    for gain in gains:
        roots = np.roots(characteristic(gain))
        z = roots[np.argmin(np.abs(roots - z))]
        s = np.log(z) / T
        best = max(best, (-s.real / abs(s), gain))
    return best


@pytest.fixture(scope="module")
def arm():
    """An arm with an inertia at its hub and a gauge near its root."""
    strip = pf.Section.rectangle(width=0.030, thickness=0.004)
    beam = pf.FlexibleBeam(
        "arm", 0.6, strip, pf.Material(70e9, 2700.0), points={"hub": 0.0, "tip": 0.6}, elements=2,
        lumps=[pf.LumpedMass("hub", 0.0, 0.02), pf.LumpedMass("tip", 0.1)], damping=pf.LossFactor(0.01, frequency=10.0),
    )  # fmt: skip
    return pf.Mechanism(
        "arm", {"O": (0, 0)}, [beam], [pf.RevoluteJoint("hub", "ground.O", "arm.hub")], [pf.Motor("motor", "hub")],
        sensors=[pf.StrainGauge("middle", "arm", 0.3), pf.StrainGauge("root", "arm", 0.02)],
        assemblies=[pf.Assembly("straight", {"arm": 0.0})],
    )  # fmt: skip


@pytest.fixture(scope="module")
def five_bar():
    """With unequal inertias at its motors and gauges there; of its linear model twelve states."""
    mechanism = pf.load("five_bar").mechanism
    hubs, inertia = {"proximal1": "A1", "proximal2": "A2"}, {"proximal1": 5e-3, "proximal2": 2e-3}
    bodies = [
        replace(body, damping=pf.ModalDamping([0.01]), lumps=(*body.lumps, *(
            pf.LumpedMass(point, 0.0, inertia[name]) for name, point in hubs.items() if name == body.name
        ))) for body in mechanism.bodies
    ]  # fmt: skip
    gauges = [pf.StrainGauge(f"root_{body}", body, point) for body, point in hubs.items()]
    return pf.reduce(pf.linearise(replace(mechanism, bodies=bodies, sensors=gauges)), 12)


# --- An oscillator ----------------------------------------------------------------------------------------------------


def test_the_best_gain_is_that_of_brute_force():
    found = pf.rate_feedback_gains(OSCILLATOR, T, pairs=PAIR, delay=T)
    ratio, gain = brute_force(np.linspace(0.0, LIMIT, 20001))
    assert found.damping[0] == pytest.approx(ratio, abs=1e-7)
    # The damping ratio is flat about its maximum, and a step of the grid is 0.007.
    assert found.gains["u1"]["y1"] == pytest.approx(gain, abs=0.02)
    assert found.bound == "optimum"
    assert found.damping_without[0] == pytest.approx(0.0, abs=1e-12)
    assert found.frequencies_without == pytest.approx([F])
    assert found.spectral_radius == pytest.approx(np.max(np.abs(np.roots(characteristic(found.gains["u1"]["y1"])))))


@pytest.mark.parametrize("margin", [5.0, 20.0])
def test_gains_keep_a_margin_to_the_limit_of_stability(margin):
    found = pf.rate_feedback_gains(OSCILLATOR, T, pairs=PAIR, delay=T, margin=margin)
    assert found.bound == "margin"
    assert found.gains["u1"]["y1"] == pytest.approx(LIMIT / margin, rel=1e-6)
    law = found.law().sampled(T)
    for factor, stable in ((0.999 * margin, True), (1.001 * margin, False)):
        more = RateFeedback({"u1": {"y1": factor * found.gains["u1"]["y1"]}}).sampled(T)
        assert pf.closed_loop(OSCILLATOR, more, delay=T).stable is stable
    assert pf.closed_loop(OSCILLATOR, law, delay=T).spectral_radius == pytest.approx(found.spectral_radius)


def test_gains_keep_within_the_largest():
    """To first order in the gain, a half of it over omega, less what the delay of a period and a half takes."""
    found = pf.rate_feedback_gains(OSCILLATOR, T, pairs=PAIR, delay=T, largest=0.1)
    assert found.gains["u1"]["y1"] == pytest.approx(0.1, rel=1e-6)
    assert found.bound == "largest"
    # Delays: one period, half a period of the difference, half of the hold; rates are shortened by sin(x) / x each.
    x = 0.5 * OMEGA * T
    assert found.damping[0] == pytest.approx(0.1 / (2.0 * OMEGA) * np.cos(4.0 * x) * (np.sin(x) / x) ** 2, rel=2e-3)


def test_a_sign_that_excites_is_turned():
    """A sensor whose reading has the other sign gets the other gain."""
    A, B, out, D = OSCILLATOR
    found = pf.rate_feedback_gains((A, B, -out, D), T, pairs=PAIR, delay=T)
    assert found.gains["u1"]["y1"] < 0.0
    assert found.damping[0] == pytest.approx(pf.rate_feedback_gains(OSCILLATOR, T, pairs=PAIR, delay=T).damping[0])


def test_a_pole_is_followed_past_another():
    """One that feedback leaves as it is lies in the way of the vibration's: the gain is that without it."""
    ratio, gain = brute_force(np.linspace(0.0, LIMIT, 2001))
    z = np.roots(characteristic(0.4 * gain))
    s = np.log(z[np.argmin(np.abs(z - np.exp(1j * OMEGA * T)))]) / T
    A, B, out, D = OSCILLATOR
    still = np.array([[s.real, s.imag], [-s.imag, s.real]])
    both = scipy.linalg.block_diag(A, still), np.vstack([B, [[0.0], [0.0]]]), np.hstack([out, [[0.0, 0.0]]]), D
    found = pf.rate_feedback_gains(both, T, pairs=PAIR, delay=T)
    assert found.damping[0] == pytest.approx(ratio, abs=1e-5)
    assert found.gains["u1"]["y1"] == pytest.approx(gain, rel=1e-2)


def test_directions_are_derivatives_of_the_damping_ratio():
    law = RateFeedback({"u1": {"y1": 1.0}}).sampled(T)
    zero = DiscreteModel(law.A, law.B, 0.0 * law.C, 0.0 * law.D, T, law.inputs, law.outputs)
    search = _Search(lambda g: pf.closed_loop(OSCILLATOR, law if g[0] else zero, delay=T), 1, 1.0, np.inf)
    at = search._follow(_Tried(np.zeros(1), search.vibrations(None)), np.array([20.0]))
    ratios = [search.least(search._follow(at, np.array([20.0 + one]))) for one in (1e-4, -1e-4)]
    assert search.directions(at)[0, 0] == pytest.approx((ratios[0] - ratios[1]) / 2e-4, rel=1e-6)


# --- Laws as models ---------------------------------------------------------------------------------------------------


def stepped(law, readings):
    """Torques of a law in state space."""
    x, out = np.zeros(len(law.A)), []
    for y in readings:
        out.append(law.C @ x + law.D @ y)
        x = law.A @ x + law.B @ y
    return np.array(out)


def test_laws_as_models_are_the_laws(arm):
    random = np.random.default_rng(1)
    readings = np.vstack([[0.0, 0.0], random.standard_normal((30, 2))])
    rates = RateFeedback({"motor": {"root": 0.3, "hub": -0.2}}, cutoff=40.0)
    pid = pf.JointPID(20.0, 1.0, 300.0, cutoff=100.0)
    sim = Simulation(arm, duration=0.1, samples=11)
    for law, sampled, y in (
        (rates, rates.sampled(1e-3), readings), (pid, pid.sampled(1e-3, arm), readings[:, :1])
    ):  # fmt: skip
        controller = SampledController(law, period=1e-3, inputs=sampled.inputs, reference={})
        started, state, torques = law.start(sim._plant(controller)), None, []
        for k, one in enumerate(y):
            given, state = started.step(state, k, 0.0, one)
            torques.append(given)
        assert stepped(sampled, y) == pytest.approx(np.array(torques))


def test_laws_side_by_side_add_up(arm):
    one, other = pf.JointPID(20.0, 1.0).sampled(1e-3, arm), RateFeedback({"motor": {"root": 0.3}}).sampled(1e-3)
    both = side_by_side([one, other])
    assert (both.inputs, both.outputs) == (("hub", "root"), ("motor",))
    y = np.random.default_rng(2).standard_normal((20, 2))
    assert stepped(both, y) == pytest.approx(stepped(one, y[:, :1]) + stepped(other, y[:, 1:]))
    with pytest.raises(pf.InputError, match=r"period: differs from that of another law, 0.001 s \(got 0.002"):
        side_by_side([one, RateFeedback({"motor": {"root": 0.3}}).sampled(2e-3)])


# --- Flexible mechanisms ----------------------------------------------------------------------------------------------


def rings(arm, found):
    """Frequency [Hz] and damping ratio of the arm's strain after a blow of its motor, from a run.

    Samples of n vibrations that die out satisfy y_k = sum of a_j y_k-j, j = 1 to 2 n; the roots of that are their poles
    (Prony). Three are left after a quarter of a second.
    """
    blow = SampledController(lambda k, t, y: [0.05] if k < 20 else [0.0], period=1e-3, name="blow")
    damp = SampledController(found.law(), period=1e-3, delay=1e-3, name="damp")
    run = Simulation(arm, duration=0.7, samples=701, options=pf.IntegrationOptions(tolerance=1e-9)).run([blow, damp])
    y = run.controllers[1].readings[250:, 0]
    before = np.column_stack([y[5 - j : -1 - j] for j in range(6)])
    s = np.log(np.roots([1.0, *-np.linalg.lstsq(before, y[6:], rcond=None)[0]]).astype(complex)) / 1e-3
    s = s[np.argmin(np.abs(np.abs(s) - 2.0 * np.pi * found.frequencies[0]))]
    return abs(s) / (2.0 * np.pi), -s.real / abs(s)


@pytest.mark.parametrize("largest", [3.0, 10.0])
def test_an_arm_rings_as_the_design_says(arm, largest):
    """The motor's own gauge is taken, the nearer one of two; the run is of the nonlinear flexible arm."""
    found = pf.rate_feedback_gains(pf.linearise(arm), 1e-3, delay=1e-3, largest=largest)
    assert list(found.gains["motor"]) == ["root"]
    assert found.damping[0] > 3.0 * found.damping_without[0]
    assert rings(arm, found) == pytest.approx((found.frequencies[0], found.damping[0]), rel=1e-5)


def test_gains_of_two_motors_are_the_best(five_bar):
    """The least damping ratio of two vibrations, among random gains about them, by the poles of other loops."""
    found = pf.rate_feedback_gains(five_bar, 1e-3, delay=1e-3)
    assert found.gains.keys() == {"left", "right"}
    gains = np.array([found.gains["left"]["root_proximal1"], found.gains["right"]["root_proximal2"]])

    def least(values):
        law = RateFeedback({"left": {"root_proximal1": values[0]}, "right": {"root_proximal2": values[1]}})
        z = pf.closed_loop(five_bar, law.sampled(1e-3), delay=1e-3).poles
        s = np.log(z[(np.abs(z) > 1e-6) & (z.imag > 1e-6)]) / 1e-3
        told = 2.0 * np.pi * found.frequencies * (-found.damping + 1j * np.sqrt(1.0 - found.damping**2))
        nearest = s[np.argmin(np.abs(s[:, None] - told), axis=0)]
        return min(-nearest.real / np.abs(nearest))

    assert least(gains) == pytest.approx(min(found.damping), abs=1e-9)
    random = np.random.default_rng(3)
    ratios = np.array(
        [least(gains * (1.0 + size * random.standard_normal(2))) for size in (0.02, 0.1) for _ in range(40)]
    )
    assert np.max(ratios) < min(found.damping) + 1e-3
    assert np.min(ratios) < min(found.damping) - 0.01
    assert min(found.damping) > 0.2 > 10.0 * max(found.damping_without)


def test_chosen_vibrations_are_damped(five_bar):
    slow, fast = five_bar.frequencies[2:4] / (2.0 * np.pi)
    both = pf.rate_feedback_gains(five_bar, 1e-3, largest=2.0)
    assert both.frequencies_without == pytest.approx([slow, fast], rel=1e-3)
    found = pf.rate_feedback_gains(five_bar, 1e-3, frequencies=[1.01 * fast], largest=2.0)
    assert found.frequencies_without == pytest.approx([fast], rel=1e-3)
    assert found.damping[0] > 2.0 * found.damping_without[0]
    with pytest.raises(pf.InputError, match="frequencies: no vibration, or one named twice"):
        pf.rate_feedback_gains(five_bar, 1e-3, frequencies=[slow, 1.001 * slow])


def test_other_vibrations_are_not_paid_for_it(five_bar):
    """One is damped alone; the other, which the gains reach as well, is no slower than the slowest was."""
    fast = five_bar.frequencies[3] / (2.0 * np.pi)
    found = pf.rate_feedback_gains(five_bar, 1e-3, delay=1e-3, frequencies=[fast], margin=1.0)
    none = RateFeedback({"left": {"root_proximal1": 0.0}, "right": {"root_proximal2": 0.0}}).sampled(1e-3)
    before, after = (loop.poles for loop in (pf.closed_loop(five_bar, none, delay=1e-3), found.loop))
    slowest = [np.max(np.abs(z[np.abs(z - 1.0) > 1e-5])) for z in (before, after)]
    assert slowest[1] <= slowest[0] + 1e-8
    assert found.damping[0] > 10.0 * found.damping_without[0]


def test_beside_a_joint_controller(arm):
    """The loop is that of both: a pole of it has the damping ratio that is told."""
    pid, model = pf.JointPID(40.0, 1.0).sampled(1e-3, arm), pf.linearise(arm)
    found = pf.rate_feedback_gains(model, 1e-3, delay=1e-3, beside=pid)
    both = side_by_side([pid, found.law().sampled(1e-3)])
    poles = pf.closed_loop(model, both, delay=1e-3).poles
    s = np.log(poles[np.abs(poles) > 1e-6].astype(complex)) / 1e-3
    nearest = s[np.argmin(np.abs(np.abs(s) / (2.0 * np.pi) - found.frequencies[0]))]
    assert -nearest.real / abs(nearest) == pytest.approx(found.damping[0], abs=1e-9)
    assert found.damping[0] > found.damping_without[0] > 0.0
    alone = pf.closed_loop(model, pid, delay=1e-3)
    assert alone.slowest == pytest.approx((found.frequencies_without[0], found.damping_without[0]))
    # Of the continuous model: a delay can be added, and beyond the margin the loop is unstable.
    margin = found.loop.delay_margin()
    assert not found.loop.later(1e-3 + 1.01 * margin).stable


@pytest.mark.parametrize(
    ("arguments", "said"),
    [
        ({"pairs": {}}, "pairs: there is none"),
        ({"pairs": {"motr": "root"}}, r'pairs: unknown motor \(got .motr.\); did you mean "motor"'),
        ({"pairs": {"motor": "rot"}}, r'pairs.motor: unknown sensor \(got .rot.\); did you mean "root"'),
        ({"margin": 0.5}, "margin: must be at least 1"),
        ({"largest": 0.0}, "largest: must be positive"),
        ({"frequencies": [-1.0]}, "frequencies: must be positive"),
        ({"cutoff": 0.0}, "cutoff: must be positive"),
        ({"delay": -1.0}, "delay: must not be negative"),
        ({"period": "fast"}, "period: .*number"),
        ({"beside": lambda k, t, y: y}, "controller: is not a linear law"),
    ],
)
def test_what_it_refuses(arm, arguments, said):
    with pytest.raises(pf.InputError, match=said):
        pf.rate_feedback_gains(pf.linearise(arm), **{"period": 1e-3, **arguments})


def test_what_cannot_be_damped(arm):
    with pytest.raises(pf.InputError, match=r"pairs: no motor has a strain gauge on a link at its joint"):
        pf.rate_feedback_gains(OSCILLATOR, T)
    rotor = (np.array([[0.0, 1.0], [0.0, 0.0]]), np.array([[0.0], [1.0]]), np.eye(1, 2), np.zeros((1, 1)))
    with pytest.raises(pf.InputError, match="model: has no vibration"):
        pf.rate_feedback_gains(rotor, T, pairs=PAIR)
    A, B, out, D = OSCILLATOR
    with pytest.raises(pf.InputError, match="pairs: do not see a vibration"):
        pf.rate_feedback_gains((A, B, 0.0 * out, D), T, pairs=PAIR)
    grows = A + np.diag([0.0, 1.0])
    with pytest.raises(pf.InputError, match=r"model: is unstable without gains: \|z\| = 1.0"):
        pf.rate_feedback_gains((grows, B, out, D), T, pairs=PAIR)
    with pytest.raises(pf.InputError, match="has no names of its sensors and motors"):
        named_law(scipy.signal.dlti(np.zeros((0, 0)), np.zeros((0, 1)), np.zeros((1, 0)), [[-1.0]], dt=T))
