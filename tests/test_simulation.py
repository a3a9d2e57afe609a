"""Simulations one can step, under sampled controllers: closed forms, open-loop runs, saved states, failures."""

import threading
from typing import Any

import numpy as np
import pytest

import paraflex as pf
from paraflex import SampledController, Simulation
from paraflex.errors import ControllerError, IntegrationError
from rotors import J, T, rotor

# Closed form of a rigid rotor under sampled PD: z^2 - (2 - (Kp T^2/2 + Kd T)/J) z + 1 + (Kp T^2/2 - Kd T)/J.
AT_20_MS = {0.0: (0.61753479, -23.76106697), T: (0.61700998, -24.83802936)}


def simulated_rotor(duration=0.02, **more):
    return Simulation(rotor(), duration=duration, samples=21, **more)


def pd(Kp=40.0, Kd=1.2, **more):
    def law(k, t, y):
        return [-Kp * y[0] - Kd * y[1]]

    return SampledController(law, **{"period": T, "inputs": ["hub", "rate"]} | more)


@pytest.fixture(scope="module")
def task():
    """A corner of RAParM-I's square, of rigid and flexible links."""
    robot = pf.load("raparm_i")
    return pf.plan(robot.mechanism, robot.paths["square"], duration=0.08, samples=81)


# --- Closed forms -----------------------------------------------------------------------------------------------------


@pytest.mark.parametrize("method", ["tr-bdf2", "esdirk4", "esdirk5", "generalised-alpha"])
@pytest.mark.parametrize("delay", AT_20_MS)
def test_a_rotor_under_sampled_pd(method, delay):
    sim = simulated_rotor(method=method)
    run = sim.run(pd(delay=delay))
    assert run.solution.status == "complete"
    reached = sim.sensors()
    assert [reached["hub"], reached["rate"]] == pytest.approx(AT_20_MS[delay], abs=1e-8)


@pytest.mark.parametrize(("delay", "samples"), [(0.4e-3, 0), (1.4e-3, 1)])
def test_torques_act_after_a_part_of_a_period(delay, samples):
    """State by hand: between instants the torque is constant, the motion a parabola."""
    sim = simulated_rotor(method="esdirk4")
    sim.run(pd(delay=delay))
    theta, rate, due = 1.0, 0.0, [0.0] * (samples + 1)
    part = delay - samples * T
    for _ in range(20):
        due.append(-40.0 * theta - 1.2 * rate)
        for torque, h in ((due[-3 - samples + 1], part), (due[-2 - samples + 1], T - part)):
            theta, rate = theta + rate * h + 0.5 * torque / J * h * h, rate + torque / J * h
    reached = sim.sensors()
    assert [reached["hub"], reached["rate"]] == pytest.approx([theta, rate], abs=1e-8)


@pytest.mark.parametrize(("delay", "limit"), [(0.0, 2.0 * J / T), (T, J / T)])
def test_limits_of_stability(delay, limit):
    """Angle, rate and torque held after a period are linear in those before: of that map the spectral radius."""

    def radius(Kd, Kp=1e-9):
        columns = []
        # A part of the angle cancels where the run of one period starts at another: the map is linear.
        for angle, rate, held in np.eye(3):
            sim = Simulation(rotor(angle, rate), duration=T, samples=2, method="esdirk4")
            wanted = -Kp * angle - Kd * rate
            after = sim.step([held if delay else wanted], T)
            columns.append([after["hub"], after["rate"], wanted])
        matrix = np.array(columns).T if delay else np.array(columns).T[:2, :2]
        return np.max(np.abs(np.linalg.eigvals(matrix)))

    # At Kp = 1e-9 the slow pole is at 1 - 1e-13; beyond the limit another one passes it.
    assert radius(0.9 * limit) <= 1.0
    assert radius(limit - 1e-9) <= 1.0 < radius(limit + 1e-9)
    assert radius(1.1 * limit) > 1.0


# --- The same as a run ------------------------------------------------------------------------------------------------


def test_without_torques_it_is_the_open_loop_run(task):
    run = pf.simulate(task, "++++")
    closed = Simulation(task, mode="++++", feed_forward=True).run()
    assert np.array_equal(closed.solution.q, run.solution.q)
    assert np.allclose(closed.applied, run.applied, atol=1e-14)
    assert closed.driven.deviation == run.driven.deviation


def test_in_steps_it_differs_by_the_tolerance_only(task):
    options = pf.IntegrationOptions(method="esdirk4", tolerance=1e-7)
    run = pf.simulate(task, "++++", options=options)
    sim = Simulation(task, mode="++++", feed_forward=True, options=options)
    for k in range(1, 81):
        sim.step([0.0] * 4, k * 1e-3)
    place = run.task.mechanism.end_effector.point
    assert place
    stepped = sim.result()
    assert stepped.solution.status == "complete"
    assert np.max(np.abs(stepped.driven.actual - run.driven.actual)) < 2e-7


def test_a_law_does_not_see_the_method():
    """Runs under one controller agree within the tolerance, whatever integrates them."""
    robot = pf.load("raparm_i")
    task = pf.plan(robot.mechanism, robot.paths["square"], duration=0.04, samples=41)

    def driven(method, tolerance):
        law = SampledController(
            lambda k, t, e: -60.0 * e, period=1e-3, delay=1e-3, reference="plan",
            inputs=[motor.joint for motor in task.mechanism.motors],
        )  # fmt: skip
        options = pf.IntegrationOptions(method=method, tolerance=tolerance)
        return Simulation(task, feed_forward=True, options=options).run(law).driven.actual

    exact = driven("esdirk4", 1e-9)
    for method, tolerance in (("tr-bdf2", 1e-6), ("esdirk5", 1e-8)):
        assert 0.0 < np.max(np.abs(driven(method, tolerance) - exact)) < 2.0 * tolerance, method


def test_torques_in_results_are_those_before_they_change(task):
    sim = Simulation(task)
    for k in range(1, 81):
        sim.step([float(k), 0.0, 0.0, -float(k)], k * 1e-3)
    applied = sim.result().applied
    assert np.array_equal(applied[:, 0], [1.0, *range(1, 81)])
    assert np.array_equal(applied[:, 3], -applied[:, 0])


# --- Saved and restored -----------------------------------------------------------------------------------------------


class Integrating:
    """A law with a state."""

    period, delay, outputs = 2e-3, 1e-3, ()

    def __init__(self, task):
        self.inputs = tuple(motor.joint for motor in task.mechanism.motors)

    def start(self, plant):
        self.sum = np.zeros(len(self.inputs))
        self.first = None

    def step(self, k, t, y):
        self.first = y if self.first is None else self.first
        self.sum += y - self.first
        return -10.0 * (y - self.first) - self.sum


def test_restored_runs_have_the_same_bits(task):
    sim = Simulation(task, mode="++++", feed_forward=True, method="esdirk5")
    sim.run(Integrating(task), until=0.0235)
    saved = sim.save()
    whole = sim.run()
    sim.step([0.3, 0.0, 0.0, 0.1], sim.end) if sim.time < sim.end else None
    sim.restore(saved)
    assert sim.time == saved.time == 0.0235
    again = sim.run()
    for name in ("t", "q", "v", "a", "multipliers", "work"):
        assert np.array_equal(getattr(again.solution, name), getattr(whole.solution, name)), name
    assert np.array_equal(again.controllers[0].applied, whole.controllers[0].applied)
    assert np.array_equal(again.applied, whole.applied)
    assert again.solution.steps == whole.solution.steps


def test_a_run_is_a_reference(task):
    """Against its own readings a flexible mechanism has no error, against the rigid plan it has."""
    sim = Simulation(task, mode="++++", feed_forward=True, options=pf.IntegrationOptions(step=T))
    # Steps end at the same instants in all runs.
    run = sim.run(SampledController(lambda k, t, y: 0.0 * y, period=T), warning=False)
    for reference, least, most in ((run, 0.0, 1e-7), ("plan", 1e-5, 1.0)):
        law = SampledController(lambda k, t, y: 1e-12 * y, period=T, reference=reference)
        errors = sim.run(law, warning=False).controllers[0].requested / 1e-12
        assert least <= np.max(np.abs(errors)) < most
    with pytest.raises(pf.errors.InputError, match=r"reference: unknown sensor .*hub"):
        simulated_rotor().run(SampledController(lambda k, t, y: y, period=T, inputs=["hub"], reference=run))


@pytest.mark.parametrize("method", ["esdirk5", "tr-bdf2"])
def test_jumps_of_torques_do_not_part_joints_in_fixed_steps(task, method):
    """Redundant motors that pull at random: Baumgarte's coefficients would let joints be apart by tenths of mm."""
    apart = {}
    for constraints in (None, "baumgarte"):
        sim = Simulation(task, options=pf.IntegrationOptions(method=method, step=1e-3, constraints=constraints))
        random = np.random.default_rng(0)
        while sim.time < 0.05:
            sim.step(random.standard_normal(4), sim.time + 1e-3)
        apart[constraints] = sim.result().solution.constraint_position_max
    assert apart[None] < 1e-9
    assert apart["baumgarte"] > 1e-5


def test_reset_starts_anew(task):
    sim = Simulation(task, mode="++++", feed_forward=True)
    first = sim.run(Integrating(task))
    second = sim.run(Integrating(task))
    assert np.array_equal(first.solution.q, second.solution.q)
    at_start = sim.reset()
    assert sim.time == 0.0
    assert at_start == sim.sensors()
    assert sim.run().controllers == ()


# --- Several controllers ----------------------------------------------------------------------------------------------


def test_several_periods():
    slow = pd(40.0, 0.0, period=4e-3, name="slow")
    fast = pd(0.0, 1.2, name="fast")
    run = simulated_rotor().run([slow, fast])
    assert [one.name for one in run.controllers] == ["slow", "fast"]
    assert [one.t.size for one in run.controllers] == [5, 20]
    theta, rate, torque = 1.0, 0.0, 0.0
    for k in range(20):
        torque = -40.0 * theta if k % 4 == 0 else torque
        total = torque - 1.2 * rate
        theta, rate = theta + rate * T + 0.5 * total / J * T * T, rate + total / J * T
    q = run.solution.q[-1]
    assert q[2] == pytest.approx(theta, abs=1e-8)


@pytest.mark.parametrize("period", [1.5e-3, 2.7e-3])
def test_a_period_that_is_no_multiple(period):
    with pytest.raises(pf.InputError, match=r"slow\.period: is not a multiple of the shortest period, 0\.001 s"):
        simulated_rotor().run([pd(name="fast"), pd(name="slow", period=period)])


# --- The chain --------------------------------------------------------------------------------------------------------


def test_readings_are_quantised_and_torques_limited():
    run = simulated_rotor().run(pd(quantise={"hub": 0.01}, limits=30.0, rates=5e3))
    (record,) = run.controllers
    assert np.allclose(record.readings[:, 0] / 0.01, np.round(record.readings[:, 0] / 0.01), atol=1e-9)
    assert record.applied[0, 0] == -5.0  # a rate of 5000 N m/s from zero
    assert np.max(np.abs(np.diff(record.applied[:, 0]))) <= 5.0 + 1e-12
    assert np.max(np.abs(record.applied)) <= 30.0
    assert record.limited[0]


def test_a_filter_is_settled_and_lags():
    """First order, cut-off f: in the end a ramp is followed with a lag of 1 / (2 pi f)."""
    law = SampledController(lambda k, t, y: [0.0], period=T, inputs=["hub"], filters={"hub": 100.0})
    sim = Simulation(rotor(1.0, 3.0), duration=0.05, samples=2)
    (record,) = sim.run(law).controllers
    assert record.readings[0, 0] == pytest.approx(1.0, abs=1e-12)
    truth = 1.0 + 3.0 * record.t
    tau = 1.0 / (200.0 * np.pi)
    assert record.readings[:, 0] == pytest.approx(truth - 3.0 * tau * (1.0 - np.exp(-record.t / tau)), abs=1e-9)


def test_a_model_of_python_control_is_a_law():
    """PD with the rate from differences, as transfer function and by hand."""
    control = pytest.importorskip("control")
    derivative = control.ss([[0.0]], [[1.0]], [[-1.0 / T]], [[1.0 / T]], T)
    model = -(40.0 * control.ss([], [], [], [[1.0]], T) + 1.2 * derivative)
    run = simulated_rotor().run(SampledController(model, inputs=["hub"]))

    class Difference:
        def start(self, plant):
            self.last = 0.0

        def step(self, k, t, y):
            rate, self.last = (y[0] - self.last) / T, y[0]
            return [-40.0 * y[0] - 1.2 * rate]

    by_hand = simulated_rotor().run(SampledController(Difference(), period=T, inputs=["hub"]))
    assert np.allclose(run.solution.q, by_hand.solution.q, atol=1e-12)
    # As it is: with its period, and the encoders of all motors.
    assert np.array_equal(simulated_rotor().run(model).solution.q, run.solution.q)


# --- Failures ---------------------------------------------------------------------------------------------------------


def failing(value):
    def law(k, t, y):
        if t < 0.0095:
            return [0.0]
        if isinstance(value, Exception):
            raise value
        return value

    return SampledController(law, period=T, inputs=["hub"], name="mine")


@pytest.mark.parametrize(
    ("value", "said"),
    [
        ([float("nan")], 'controller "mine" returned torques that are not finite, for tau'),
        ([1.0, 2.0], 'controller "mine" returned 2 in place of 1 torques'),
        (None, 'controller "mine" returned NoneType, not torques'),
        (np.zeros((1, 2)), 'controller "mine" returned 1 x 2 in place of 1 torques'),
        ("much", 'controller "mine" returned str, not torques'),
        (ZeroDivisionError("division by zero"), 'controller "mine" raised ZeroDivisionError: division by zero'),
    ],
)
def test_a_controller_that_fails_ends_the_run(value, said):
    with pytest.raises(ControllerError) as caught:
        simulated_rotor().run(failing(value))
    assert caught.value.cause == said
    assert "\n" not in str(caught.value)
    partial = caught.value.partial
    assert partial.solution.status == "failed"
    assert said in partial.solution.message
    assert partial.solution.t[-1] == pytest.approx(0.01)
    assert partial.controllers[0].t.size == 10


@pytest.mark.parametrize(
    ("more", "said"),
    [
        ({"inputs": ["hob"]}, r'inputs: unknown sensor.*did you mean "hub"'),
        ({"outputs": ["tao"]}, r'outputs: unknown motor.*did you mean "tau"'),
        ({"period": 0.0}, "period: must be positive"),
        ({"period": None}, "period: is missing"),
        ({"delay": -1e-3}, "delay: must not be negative"),
        ({"quantise": {"hab": 0.1}}, "quantise: unknown sensor"),
        ({"limits": (3.0, 1.0)}, "limits: the lowest must be below"),
        ({"limits": (-1.0, "one")}, "limits: is not a pair of numbers"),
        ({"limits": "one"}, "limits: is not a number"),
        ({"period": True}, "period: is not a number"),
        ({"outputs": ["tau", "tau"]}, r"outputs: is named twice \(got 'tau'\)"),
        ({"filters": {"hub": ([1.0], [1.0, -3.0])}}, r"filters\.hub: is not stable"),
        ({"reference": {"hub": "far"}}, r"reference\.hub: is not a reference"),
        ({"reference": "plan"}, "reference: there is no planned motion"),
    ],
)
def test_bad_controllers(more, said):
    with pytest.raises(pf.InputError, match=said):
        simulated_rotor().run(pd(**more))


class Bare:
    """A controller without a chain."""

    period: Any = T
    delay: Any = 0.0
    inputs: Any = ("hub",)
    outputs: Any = ("tau",)

    def start(self, plant):
        if self.period == 2 * T:
            raise ZeroDivisionError("no gain")

    def step(self, k, t, y):
        return [0.0]


@pytest.mark.parametrize(
    ("name", "value", "said"),
    [
        ("period", -1e-3, "controller.period: must be positive"),
        ("period", "1 ms", "controller.period: is not a number"),
        ("delay", -1e-3, "controller.delay: must not be negative"),
        ("inputs", "hub", "controller.inputs: is not a list of names"),
        ("outputs", ("tau", "tau"), "controller.outputs: is named twice"),
    ],
)
def test_controllers_without_a_chain_are_checked_too(name, value, said):
    bare = Bare()
    setattr(bare, name, value)
    with pytest.raises(pf.InputError, match=said):
        simulated_rotor().run(bare)
    with pytest.raises(pf.InputError, match="law: is not a control law"):
        SampledController(Bare, period=T)


def test_a_controller_that_raises_as_it_starts():
    bare = Bare()
    bare.period = 2 * T
    with pytest.raises(ControllerError, match=r'controller "controller" raised ZeroDivisionError: no gain') as caught:
        simulated_rotor().run(bare)
    assert caught.value.partial.solution.status == "failed"
    assert caught.value.partial.solution.t.tolist() == [0.0]


def test_continuous_models_are_refused():
    control = pytest.importorskip("control")
    with pytest.raises(pf.InputError, match="is a continuous model"):
        SampledController(control.ss([[-1.0]], [[1.0]], [[1.0]], [[0.0]]), period=T, inputs=["hub"])
    with pytest.raises(pf.InputError, match=r"inputs: the model has 1"):
        SampledController(control.ss([[0.5]], [[1.0]], [[1.0]], [[0.0]], T), inputs=["hub", "rate"])
    with pytest.raises(pf.InputError, match=r"period: the model is sampled every 0\.001 s"):
        SampledController(control.ss([[0.5]], [[1.0]], [[1.0]], [[0.0]], T), inputs=["hub"], period=2e-3)


@pytest.mark.parametrize(
    ("make", "said"),
    [
        (lambda task: Simulation(task, duration=1.0), "duration: is set by the plan"),
        (lambda task: Simulation(task, mode="+-"), "mode"),
        (
            lambda task: Simulation(task, method="radau"),
            "method: continues from time to time with paraflex's own methods only",
        ),
        (lambda task: Simulation(rotor(), duration=1.0, feed_forward=True), "feed_forward: there is no plan"),
        (lambda task: Simulation(rotor()), "duration: is missing"),
        (lambda task: simulated_rotor().step([1.0, 2.0], 0.01), "torques: not 1 finite numbers"),
        (lambda task: simulated_rotor().step([np.inf], 0.01), "torques: not 1 finite numbers"),
        (lambda task: simulated_rotor().step({"tai": 1.0}, 0.01), "torques: unknown motor"),
        (lambda task: simulated_rotor().step([1.0], 0.0), "until: is not within the rest of the run"),
        (lambda task: simulated_rotor().step([1.0], 0.5), "until: is not within the rest of the run"),
        (lambda task: simulated_rotor().step([1.0], "1 ms"), "until: is not within the rest of the run"),
        (lambda task: simulated_rotor().step(["one"], 0.01), "torques: not 1 finite numbers"),
        (lambda task: simulated_rotor().step([1.0 + 1j], 0.01), "torques: not 1 finite numbers"),
        (lambda task: simulated_rotor().step({"tau": 10**400}, 0.01), "torques: not 1 finite numbers"),
        (lambda task: simulated_rotor().restore(3), "saved: not a saved simulation"),
        (lambda task: simulated_rotor().restore(Simulation(task).save()), "saved: the state of another simulation"),
        (
            lambda task: simulated_rotor().restore(simulated_rotor(0.03).save()),
            "saved: the state of another simulation",
        ),
    ],
)
def test_bad_simulations(task, make, said):
    with pytest.raises(pf.InputError, match=said):
        make(task)


def test_a_state_goes_on_in_another_simulation_of_the_same():
    one, other = simulated_rotor(), simulated_rotor()
    one.step([1.0], 0.01)
    other.restore(one.save())
    assert one.step([2.0], 0.02) == other.step([2.0], 0.02)


@pytest.mark.parametrize("call", ["step", "reset", "restore", "run"])
def test_a_law_does_not_run_its_own_simulation(call):
    sim = simulated_rotor()
    saved = sim.save()
    calls = {"step": lambda: sim.step([1.0], 0.01), "reset": sim.reset, "restore": lambda: sim.restore(saved),
             "run": lambda: sim.run(pd())}  # fmt: skip

    def law(k, t, y):
        calls[call]()

    with pytest.raises(ControllerError, match="a law, or another thread, may not run it"):
        sim.run(pf.SampledController(law, period=T, inputs=["hub"]))
    sim.reset()
    assert sim.step([0.0], 0.01) == simulated_rotor().step([0.0], 0.01)


def test_threads_do_not_share_a_simulation():
    sim, inside, go_on = simulated_rotor(), threading.Event(), threading.Event()

    def waits(k, t, y):
        inside.set()
        go_on.wait(60.0)
        return [0.0]

    thread = threading.Thread(target=sim.run, args=(pf.SampledController(waits, period=T, inputs=["hub"]),))
    thread.start()
    inside.wait(60.0)
    with pytest.raises(pf.InputError, match="simulation: is running"):
        sim.step([1.0], 0.01)
    go_on.set()
    thread.join()
    assert sim.ended


def test_complex_torques_of_a_law_are_none():
    law = pf.SampledController(lambda k, t, y: np.array([1.0 + 2.0j]), period=T, inputs=["hub"])
    with pytest.raises(ControllerError, match="returned complex numbers, not torques"):
        simulated_rotor().run(law)


def test_an_event_ends_it():
    options = pf.IntegrationOptions(events=[pf.JointLimit("hub", low=0.8)])
    sim = Simulation(rotor(), duration=0.02, samples=21, options=options)
    run = sim.run(pd())
    assert run.solution.status == "stopped"
    assert run.solution.q[-1, 2] == pytest.approx(0.8, abs=1e-9)
    assert run.applied.shape == (run.solution.t.size, 1)
    sim.reset()
    with pytest.raises(
        IntegrationError, match=r"the run has ended: joint hub reached .* at t = 0\.00816497 s; call result"
    ):
        sim.step([-60.0], 0.02)


def test_ctrl_c_keeps_what_is_there():
    def stop(t):
        if t > 0.0055:
            raise KeyboardInterrupt

    sim = simulated_rotor()
    run = sim.run(pd(), on_progress=stop)
    assert run.solution.status == "interrupted"
    assert run.solution.t[-1] == pytest.approx(0.006)
    assert sim.run().solution.status == "complete"
    assert np.array_equal(sim.result().solution.q, simulated_rotor().run(pd()).solution.q)


def test_a_run_in_the_middle_says_so():
    sim = simulated_rotor()
    run = sim.run(pd(), until=0.01)
    assert run.solution.status == "interrupted"
    assert run.solution.message == "as far as t = 0.01 s"
    assert sim.run().solution.status == "complete"
