"""Laws within the compiled time loop do what they do outside of it, sample by sample."""

import tomllib
import types

import numpy as np
import pytest
import scipy
from numba import njit

import paraflex as pf
from paraflex import CompiledLaw, JointPID, RateFeedback, SampledController, Simulation
from paraflex.control import LinearLaw
from paraflex.control.laws.discrete import DiscreteModel
from paraflex.errors import ControllerError, InputError
from paraflex.files import model_from
from rotors import ROTOR, J, T, rotor


class Outside(SampledController):
    """The same, of another class: the time loop does not know what its steps are."""


@njit
def pd(k, t, y, x, torques):
    torques[0] = -40.0 * y[0] - 1.2 * y[1]


@njit
def lagging(k, t, y, x, torques):
    torques[0] = -20.0 * x[0] - 0.4 * y[1] + 0.1 * np.sin(50.0 * t) + 1e-3 * k
    x[0] += 0.3 * (y[0] - x[0])


def lqg():
    """LQG of a rotor with an integrator, limits and a delay."""
    return pf.lqg(pf.linearise(rotor(0.0)), T, measured=["hub", "rate"], deviations={"hub": 0.02}, effort=1.0, delay=T,
                  noise={"hub": 1e-4, "rate": 1e-2}, integrators={"hub": 0.05}).law()  # fmt: skip


def model():
    A = np.array([[0.9, 0.05], [0.0, 0.8]])
    return DiscreteModel(A, np.array([[0.1, 0.0], [0.0, 0.01]]), np.array([[-30.0, -1.0]]), np.array([[-10.0, -0.5]]),
                         T, ("hub", "rate"), ("tau",))  # fmt: skip


BOTH = {"inputs": ["hub", "rate"], "period": T}
LAWS = {
    "discrete model": (model, BOTH),
    "PID": (lambda: JointPID(40.0, 0.6, 2000.0), {"period": T}),
    "PID with a low-pass": (lambda: JointPID(40.0, 0.6, 100.0, cutoff=120.0), {"period": 2 * T}),
    "feedback of rates": (lambda: RateFeedback({"tau": {"hub": 0.5, "rate": 1e-3}}, cutoff=80.0), {"period": T}),
    "LQG": (lqg, {}),
    "compiled": (lambda: CompiledLaw(pd), BOTH),
    "compiled, with states": (lambda: CompiledLaw(lagging, states=1), BOTH),
}
CHAINS = {
    "bare": {},
    "whole": {"quantise": {"hub": 1e-4}, "filters": {"hub": 300.0}, "limits": (-0.6, 2.0), "rates": 900.0,
              "reference": {"hub": lambda t: 0.3 + 0.2 * np.sin(40.0 * t)}},
    "late": {"delay": 0.4 * T, "limits": 0.5},
    "later": {"delay": 2.3 * T, "quantise": 1e-3},
}  # fmt: skip


def both(make, chain, method="esdirk5", duration=0.06):
    """A run within the time loop, and outside."""
    runs = []
    for kind in (SampledController, Outside):
        sim = Simulation(rotor(), duration=duration, samples=61, method=method)
        runs.append(sim.run(kind(make(), **chain), warning=False))
        assert (sim._loop.inside is not None) is (kind is SampledController)
    return runs


@pytest.mark.parametrize("chain", CHAINS)
@pytest.mark.parametrize("law", LAWS)
def test_a_rotor_does_the_same(law, chain):
    make, own = LAWS[law]
    more = {name: value for name, value in CHAINS[chain].items() if not (law == "LQG" and name == "delay")}
    if law.startswith("PID") and "reference" not in more:
        more["reference"] = {"hub": 0.1}
    inside, outside = both(make, own | more)
    a, b = inside.controllers[0], outside.controllers[0]
    for name in ("t", "readings", "requested", "applied"):
        # Readings are rounded to a resolution: rounding of the last bits may move one of them by a step of it.
        np.testing.assert_allclose(getattr(a, name), getattr(b, name), rtol=1e-9, atol=1e-9, err_msg=name)
    np.testing.assert_allclose(inside.acting, outside.acting, rtol=1e-9, atol=1e-9)
    np.testing.assert_allclose(inside.solution.q, outside.solution.q, rtol=1e-10, atol=1e-10)
    np.testing.assert_allclose(inside.solution.work, outside.solution.work, rtol=1e-8, atol=1e-10)
    assert a.law == b.law
    if chain == "whole":
        assert a.limited.any()


LEAD = ([-80.0, 60.0], [1.0, -0.2])


@pytest.mark.parametrize(
    "model",
    [
        scipy.signal.dlti(*LEAD, dt=T),
        scipy.signal.dlti(*scipy.signal.tf2zpk(*LEAD), dt=T),
        scipy.signal.dlti(*scipy.signal.tf2ss(*LEAD), dt=T),
        scipy.signal.StateSpace(*scipy.signal.tf2ss(*LEAD), dt=T),
        scipy.signal.TransferFunction(*LEAD, dt=T),
        lambda control: control.tf(*LEAD, T),
        lambda control: control.ss(control.tf(*LEAD, T)),
    ],
    ids=["TF", "ZPK", "SS", "StateSpace", "TransferFunction", "control.tf", "control.ss"],
)
def test_models_of_others_run_as_they_are(model):
    """u_k = 0.2 u_k-1 - 80 y_k + 60 y_k-1, by itself and in a chain; their own period and loop."""
    model = model(pytest.importorskip("control")) if callable(model) else model
    sim = Simulation(rotor(), duration=0.05, samples=2)
    for controller, reference in ((model, 0.0), (SampledController(model, reference={"hub": 0.5}), 0.5)):
        (done,) = sim.run(controller, warning=False).controllers
        y, torques = done.readings[:, 0] - reference, [0.0]
        for k in range(y.size):
            torques.append(0.2 * torques[-1] - 80.0 * y[k] + (60.0 * y[k - 1] if k else 0.0))
        assert done.requested[:, 0] == pytest.approx(torques[1:], rel=1e-9, abs=1e-9)
        assert sim._loop.inside is not None
    assert pf.closed_loop(pf.linearise(rotor()), model, inputs=["hub"]).plant.period == T


@pytest.mark.parametrize(
    ("model", "said"),
    [
        (scipy.signal.lti(*LEAD), "is a continuous model"),
        (scipy.signal.StateSpace([[0.5]], [[1.0]], [[np.nan]], [[0.0]], dt=T), "holds numbers that are not finite"),
        (lambda control: control.tf(*LEAD), "is a continuous model"),
        (scipy.signal.dlti([1.0, 0.0, 0.0], [1.0, 2.0], dt=T), "has no state space"),
        (lambda control: control.tf([1.0, 0.0, 0.0], [1.0, 2.0], T), "has no state space"),
    ],
)
def test_models_that_are_no_laws(model, said):
    model = model(pytest.importorskip("control")) if callable(model) else model
    with pytest.raises(InputError, match=said):
        SampledController(model, period=T)
    with pytest.raises(InputError, match=said):
        pf.closed_loop(pf.linearise(rotor()), model, inputs=["hub"], period=T)


@pytest.mark.parametrize("method", ["tr-bdf2", "esdirk5", "generalised-alpha"])
def test_closed_form_under_a_compiled_function(method):
    """z^2 - (2 - (Kp T^2/2 + Kd T)/J) z + 1 + (Kp T^2/2 - Kd T)/J, as under a law in Python."""
    sim = Simulation(rotor(), duration=0.02, samples=21, method=method)
    sim.run(SampledController(CompiledLaw(pd), **BOTH))
    assert sim._loop.inside is not None
    assert [sim.sensors()["hub"], sim.sensors()["rate"]] == pytest.approx([0.61753479, -23.76106697], abs=1e-8)


@pytest.fixture(scope="module")
def task():
    robot = pf.load("raparm_i")
    return pf.plan(robot.mechanism, robot.paths["square"], duration=0.06, samples=61)


def test_redundant_motors_with_projection_and_gauges(task):
    """Torques of four motors along a plan, its own ones beside them; readings of encoders and of strain."""
    gauge = next(name for name in Simulation(task).sensors_read if name not in ("x", "y"))
    for law, more in (
        (JointPID(0.02, 1e-5, 0.1), {}),
        (RateFeedback({"tau1": {gauge: 1e-5}}), {"reference": None}),
        (
            DiscreteModel(*(np.zeros(shape) for shape in ((0, 0), (0, 2), (1, 0))), np.array([[0.3, -0.2]]), T, (), ()),
            {"inputs": ["x", "y"], "outputs": ["tau5"], "reference": "plan"},
        ),
    ):
        runs = []
        for kind in (SampledController, Outside):
            sim = Simulation(task, mode="++++", feed_forward=True, options=pf.IntegrationOptions(step=T))
            runs.append(sim.run(kind(law, period=T, delay=T, limits=2e-3, **more), warning=False))
            assert (sim._loop.inside is not None) is (kind is SampledController)
        a, b = runs
        np.testing.assert_allclose(a.controllers[0].requested, b.controllers[0].requested, rtol=1e-6, atol=1e-10)
        np.testing.assert_allclose(a.solution.q, b.solution.q, rtol=1e-9, atol=1e-12)


def test_in_parts_it_is_the_same_run():
    sim = Simulation(rotor(), duration=0.02, samples=21)
    for until in (0.0055, 0.011, 0.02):
        sim.run(SampledController(CompiledLaw(pd), **BOTH) if until == 0.0055 else None, until=until, warning=False)
    whole = Simulation(rotor(), duration=0.02, samples=21).run(SampledController(CompiledLaw(pd), **BOTH))
    np.testing.assert_allclose(sim.result().solution.q, whole.solution.q, atol=1e-9)
    np.testing.assert_array_equal(sim.result().controllers[0].t, whole.controllers[0].t)


LOAD = """
[load.twist]
type = "torque"
point = "rotor.O"
pieces = [{ until = 0.007, torque = 0.1 }, { until = 0.0123, torque = -2.0 }, { torque = 1.0 }]
"""
START = """
[start.coordinates]
rotor = { x = 0.0, y = 0.0, phi = 0.0 }
"""


def test_loads_that_jump_at_samples_and_between():
    model = model_from(tomllib.loads(ROTOR + LOAD + START), "rotor.toml")
    runs = []
    for kind in (SampledController, Outside):
        sim = Simulation(model, duration=0.03, samples=31, method="esdirk4")
        runs.append(sim.run(kind(CompiledLaw(pd), delay=0.5 * T, reference={"hub": 0.1}, **BOTH), warning=False))
    for name in ("q", "v", "a", "work"):
        np.testing.assert_allclose(getattr(runs[0].solution, name), getattr(runs[1].solution, name), rtol=1e-9,
                                   atol=1e-9, err_msg=name)  # fmt: skip
    # One parabola after another, by hand.
    theta = rate = torque = 0.0
    jumps, t = [0.007, 0.0123, np.inf], 0.0
    for k in range(30):
        due = -40.0 * (theta - 0.1) - 1.2 * rate
        instants = sorted({t + 0.5 * T, t + T} | {each for each in jumps if t < each < t + T})
        for until in instants:
            load = (0.1, -2.0, 1.0)[int(np.searchsorted(jumps, 0.5 * (t + until)))]
            h, acceleration = until - t, (torque + load) / J
            theta, rate = theta + rate * h + 0.5 * acceleration * h * h, rate + acceleration * h
            t = until
            if abs(until - (k + 0.5) * T) < 1e-9:
                torque = due
    assert runs[0].solution.q[-1, 2] == pytest.approx(theta, abs=1e-8)


@pytest.mark.parametrize("law", ["PID", "LQG", "compiled, with states"])
def test_saved_and_restored_it_has_the_same_bits(law):
    make, own = LAWS[law]
    more = {"reference": {"hub": 0.1}, "quantise": 1e-5, "filters": {"hub": 200.0}, "limits": 1.5}
    sim = Simulation(rotor(), duration=0.05, samples=51)
    sim.run(SampledController(make(), **own, **more), until=0.0205, warning=False)
    assert sim._loop.inside is not None
    saved = sim.save()
    first = sim.run()
    sim.restore(saved)
    again = sim.run()
    np.testing.assert_array_equal(first.solution.q, again.solution.q)
    np.testing.assert_array_equal(first.acting, again.acting)
    np.testing.assert_array_equal(first.controllers[0].requested, again.controllers[0].requested)
    assert len(first.controllers[0].t) == 50
    # One that went another way in between comes back as well.
    sim.reset()
    sim.step([1.0], 0.01)
    sim.restore(saved)
    np.testing.assert_array_equal(sim.run().solution.q, first.solution.q)


def test_after_it_one_can_step_on():
    sim = Simulation(rotor(), duration=0.05, samples=51)
    sim.run(SampledController(CompiledLaw(pd), **BOTH), until=0.02, warning=False)
    rate = sim.sensors()["rate"]
    after = sim.step([0.5], 0.03)
    assert after["rate"] - rate == pytest.approx(0.5 / J * 0.01, abs=1e-8)


def test_torques_that_are_not_finite_end_the_run():
    @njit
    def wrong(k, t, y, x, torques):
        torques[0] = np.nan if k == 7 else 0.1

    with pytest.raises(ControllerError, match=r'controller "pd" returned torques that are not finite, for tau') as got:
        Simulation(rotor(), duration=0.02, samples=21).run(
            SampledController(CompiledLaw(wrong), name="pd", **BOTH), warning=False
        )
    partial = got.value.partial
    assert partial.solution.status == "failed"
    assert partial.solution.t[-1] == pytest.approx(0.007)
    assert len(partial.controllers[0].t) == 7
    assert "t = 0.007" in str(got.value)


def test_an_event_ends_it_between_samples():
    runs = []
    for kind in (SampledController, Outside):
        options = pf.IntegrationOptions(events=[pf.JointLimit("hub", low=0.9)])
        sim = Simulation(rotor(), duration=0.05, samples=51, options=options)
        runs.append(sim.run(kind(CompiledLaw(pd), **BOTH), warning=False))
    assert runs[0].solution.status == "stopped"
    assert runs[0].solution.t[-1] == pytest.approx(runs[1].solution.t[-1], abs=1e-9)
    assert len(runs[0].controllers[0].t) == len(runs[1].controllers[0].t)


def test_what_stays_outside():
    """Laws whose steps are another class's, several controllers, readings that are no products with states."""

    class Doubled(LinearLaw):
        def step(self, state, k, t, y):
            torques, state = super().step(state, k, t, y)
            return 2.0 * torques, state

    class Other(JointPID):
        def start(self, plant):
            return Doubled(**vars(super().start(plant)))

    hub = {"period": T, "inputs": ["hub"], "reference": {"hub": 0.1}}
    for given in (
        SampledController(Other(1.0), **hub),
        SampledController(lambda k, t, y: -y, **hub),
        [SampledController(JointPID(1.0), name=name, **hub) for name in ("one", "two")],
    ):
        sim = Simulation(rotor(), duration=0.01, samples=11)
        sim.run(given, warning=False)
        assert sim._loop.inside is None
    law = pf.lqg(pf.linearise(rotor()), T, measured=["hub"], deviations={"hub": 0.1}, effort=1.0, noise=1e-4).law()
    sim.run(SampledController(law, reference={"hub": 0.1}), warning=False)
    assert sim._loop.inside is not None
    law.step = lambda k, t, y: -y
    sim.run(SampledController(law, reference={"hub": 0.1}), warning=False)
    assert sim._loop.inside is None
    with pytest.raises(TypeError, match="give it to the object that `start` returns"):
        type("Stepped", (JointPID,), {"step": lambda self, k, t, y: -y})


@pytest.mark.parametrize(("make", "said"), [
    (lambda: CompiledLaw(3.0), "function"),
    (lambda: CompiledLaw(len), "function"),
    (lambda: CompiledLaw(pd, states=-1), "states"),
    (lambda: CompiledLaw(pd, states=10**9), "states"),
    (lambda: SampledController(CompiledLaw(pd), inputs=["hub", "rate"], period=1e-10), "period"),
    (lambda: SampledController(CompiledLaw(lambda k, t, y, x, u: u.nothing()), **BOTH), "cannot be compiled"),
])  # fmt: skip
def test_bad_compiled_laws(make, said):
    with pytest.raises(InputError, match=said):
        Simulation(rotor(), duration=0.01, samples=11).run(make())


@njit
def _beyond(torques, place):
    torques[place] = 5.0


_helpers = types.ModuleType("helpers")
_helpers.beyond = _beyond


def _raises(k, t, y, x, torques):
    x[0] += 1.0
    if x[0] > 7.0:
        raise ValueError("the eighth")


def _divides(k, t, y, x, torques):
    torques[0] = 1.0 / (k - 7)


def _writes(k, t, y, x, torques):
    torques[0 if k < 7 else 10_000_000] = 0.0


def _reads(k, t, y, x, torques):
    torques[0] = y[1 if k < 7 else -3]


def _calls(k, t, y, x, torques):
    _beyond(torques, 0 if k < 7 else 10_000_000)


def _calls_by_module(k, t, y, x, torques):
    _helpers.beyond(torques, 0 if k < 7 else 10_000_000)


def _closure():
    here = _beyond

    def calls_a_name_around_it(k, t, y, x, torques):
        here(torques, 0 if k < 7 else 10_000_000)

    return calls_a_name_around_it


def _slices(k, t, y, x, torques):
    torques[:] = np.zeros(1 if k < 7 else 7)


@pytest.mark.parametrize(
    ("law", "raised"),
    [(_raises, "ValueError: the eighth"), (_divides, "ZeroDivisionError"), (_writes, "IndexError"),
     (_reads, "IndexError"), (_calls, "IndexError"), (_calls_by_module, "IndexError"), (_closure(), "IndexError"),
     (_slices, "ValueError: cannot assign")],
)  # fmt: skip
def test_exceptions_of_compiled_functions_end_the_run(law, raised):
    """Within the time loop as outside: accesses out of bounds too, in functions that are called as well."""
    said = []
    for kind in (SampledController, Outside):
        sim = Simulation(rotor(), duration=0.02, samples=21)
        with pytest.raises(ControllerError, match=f'controller "law" raised {raised}') as got:
            sim.run(kind(CompiledLaw(law, states=1), name="law", **BOTH), warning=False)
        assert len(got.value.partial.controllers[0].t) == 7
        assert (sim._loop.inside is not None) is (kind is SampledController)
        said.append(str(got.value))
    assert said[0] == said[1]


def test_what_a_compiled_function_is_given():
    """Torques are zero before each sample, and errors its own: it may write into them."""

    def adds(k, t, y, x, torques):
        torques[0] += -40.0 * y[0] - 1.2 * y[1]
        y[0] = 99.0

    inside, outside = both(lambda: CompiledLaw(adds), BOTH)
    plain, _ = both(lambda: CompiledLaw(pd), BOTH)
    for run in (inside, outside):
        np.testing.assert_allclose(run.controllers[0].requested, plain.controllers[0].requested, rtol=1e-9, atol=1e-9)
        np.testing.assert_allclose(run.controllers[0].readings, plain.controllers[0].readings, rtol=1e-9, atol=1e-9)


def test_functions_are_compiled_once():
    first, second = (SampledController(CompiledLaw(pd), **BOTH) for _ in range(2))
    for controller in (first, second):
        Simulation(rotor(), duration=0.01, samples=11).run(controller, warning=False)
    assert first.started.address == second.started.address
