"""Control laws: PD and PID of joints, their projection, computed torque, feedback of rates."""

import dataclasses
import re
import time
import tomllib

import numpy as np
import pytest

import paraflex as pf
from paraflex import JointPID, SampledController, Simulation
from paraflex.control.laws.controllers import Plant
from paraflex.control.laws.joints import internal_torques, joint_gains, task_inertia, torque_projectors
from paraflex.control.laws.kinds.computed_torque import ComputedTorque, RigidInverseState
from paraflex.control.laws.kinds.rate_feedback import RateFeedback
from paraflex.control.loop.references import planned_readings
from paraflex.files import model_from
from paraflex.mechanism import TorsionalSpring
from rotors import ROTOR, T, under_rate_feedback

STILL = (
    ROTOR
    + """
[assembly.zero]
rotor = 0.0
"""
)

LOADED = (
    STILL
    + """
[load.constant]
type = "torque"
point = "rotor.O"
torque = 0.5
"""
)


@pytest.fixture(scope="module")
def task():
    """A corner of RAParM-I's square, links rigid."""
    robot = pf.load("raparm_i")
    return pf.plan(robot.mechanism.rigid(), robot.paths["square"], duration=0.1, samples=101)


def plant_of(task, period=1e-3):
    joints = tuple(motor.joint for motor in task.mechanism.motors)
    motors = tuple(motor.name for motor in task.mechanism.motors)
    mode = task.mode("++++")
    return Plant(task.mechanism, mode, task, task.start, joints, ("rad",) * 4, motors, period, 0.0)


def loaded_rotor(duration=1.0):
    return Simulation(model_from(tomllib.loads(LOADED), "rotor.toml"), duration=duration, samples=101)


# --- Joints -----------------------------------------------------------------------------------------------------------


def test_pd_gives_way_to_a_load_and_pid_does_not():
    """At rest Kp theta = 0.5 N m."""
    for Ki, rest in ((0.0, 0.5 / 40.0), (400.0, 0.0)):
        sim = loaded_rotor()
        sim.run(SampledController(JointPID(40.0, 1.2, Ki), period=T, reference={"hub": 0.0}))
        assert sim.sensors()["hub"] == pytest.approx(rest, abs=1e-7)
        assert sim.sensors()["rate"] == pytest.approx(0.0, abs=1e-6)


def test_an_integral_does_not_wind_up():
    """Torques stay at a limit below the load for half a second; with it forgotten what remains is a short overshoot."""

    class WindsUp(JointPID):
        def start(self, plant):
            return dataclasses.replace(super().start(plant), E=np.zeros((0, 0)))

    peaks = {}
    for kind in (JointPID, WindsUp):
        law = kind(40.0, 1.2, 400.0)
        sim = Simulation(model_from(tomllib.loads(STILL), "rotor.toml"), duration=1.5, samples=1501)
        controller = SampledController(law, period=T, limits=1.0, reference={"hub": 1.0})
        run = sim.run(controller)
        peaks[kind] = np.max(run.solution.q[:, 2]) - 1.0
        assert controller.last is not None
    assert peaks[JointPID] < 0.5 * peaks[WindsUp]


def test_projected_torques_do_not_strain_links(task):
    P = torque_projectors(task.effort, [motor.name for motor in task.mechanism.motors])
    assert np.allclose(P @ P, P, atol=1e-12)
    assert np.allclose(task.effort.matrix @ P, task.effort.matrix, atol=1e-12)
    needed = task.torques("++++").evaluate(task.motion.t)
    assert np.max(np.abs(internal_torques(task, "++++", needed))) < 1e-6
    against = np.tile([1.0, 2.0, 3.0, 4.0], (101, 1))
    inner = internal_torques(task, "++++", against)
    assert np.max(np.abs(np.einsum("kij,kj->ki", task.effort.matrix, inner))) < 1e-12
    assert np.min(np.linalg.norm(inner, axis=1)) > 0.1
    # In a mode of two motors nothing is left to strain links.
    assert np.max(np.abs(internal_torques(task, "+-+-", against * [1.0, 0.0, 1.0, 0.0]))) < 1e-9


def test_encoders_that_contradict_one_another_make_no_internal_torque(task):
    law = JointPID(40.0, 1.2).start(plant_of(task))
    torques, _ = law.step(None, 0, 0.0, np.array([1e-3, 0.0, 0.0, 0.0]))
    alone = JointPID(40.0, 1.2, project=False).start(plant_of(task))
    assert np.allclose(alone.step(None, 0, 0.0, np.array([1e-3, 0.0, 0.0, 0.0]))[0], [-0.04, 0.0, 0.0, 0.0])
    row = np.tile(torques, (1, 1))
    assert np.max(np.abs(internal_torques(task, "++++", row))) < 1e-12
    assert np.linalg.norm(torques) > 1e-3


def test_gains_give_the_rigid_mechanism_its_frequency():
    """With springs of that stiffness at the motors' joints the mean square of its frequencies is the one asked for."""
    robot = pf.load("raparm_i")
    rigid = robot.mechanism.rigid()
    still = pf.plan(rigid, pf.Line((0.0, 0.264), (0.0, 0.264001), max_acceleration=1.0))
    gains = joint_gains(still, "++++", 5.0, 0.6)
    springs = tuple(
        TorsionalSpring(f"spring{k}", motor.joint, gains.stiffness, rest)
        for k, (motor, rest) in enumerate(zip(rigid.motors, rest_angles(still), strict=True))
    )
    held = dataclasses.replace(rigid, springs=springs)
    at_rest = pf.plan(held, pf.Line((0.0, 0.264), (0.0, 0.264001), max_acceleration=1e-5))
    frequencies = pf.linearise(at_rest, mode="++++", at=0.0).frequencies / (2.0 * np.pi)
    assert np.sqrt(np.mean(frequencies**2)) == pytest.approx(5.0, rel=1e-5)
    assert gains.damping == pytest.approx(2.0 * 0.6 * gains.stiffness / (2.0 * np.pi * 5.0))


def rest_angles(task):
    return [one[0] for one in np.array([reading(0.0) for reading in planned_readings(plant_of(task))])[:, None]]


# --- Computed torque --------------------------------------------------------------------------------------------------


def test_on_the_plan_it_is_the_feed_forward(task):
    """Readings of the plan, hardly any feedback."""
    plant = plant_of(task)
    law = ComputedTorque(1e-4).start(plant)
    needed = task.torques("++++").evaluate(task.motion.t)
    readings = planned_readings(plant)
    for k in range(0, 100, 7):
        t = k * 1e-3
        before = np.array([one(t) - 1e-3 * rate for one, rate in zip(readings, joint_rates(task, k), strict=True)])
        state = RigidInverseState(task.motion.q[k], law.rates.after(None, before))
        given, _ = law.step(state, k, t, np.array([one(t) for one in readings]))
        assert given == pytest.approx(needed[k], abs=1e-5)


def joint_rates(task, k):
    return task.effort.matrix[k].T @ task_rates(task, k)


def task_rates(task, k):
    return task.motion.desired.velocity[k]


def test_an_error_makes_the_acceleration_that_returns_it(task):
    """tau - tau_plan = B^+ M (-Kp) dx, to first order in dx."""
    plant = plant_of(task)
    law = ComputedTorque(10.0).start(plant)
    readings = np.array([one(0.0) for one in planned_readings(plant)])
    at_plan, _ = law.step(None, 0, 0.0, readings)
    dx = np.array([1e-6, -2e-6])
    B = task.effort.matrix[0]
    away, _ = law.step(None, 0, 0.0, readings + B.T @ dx)
    expected = np.linalg.pinv(B) @ task_inertia(task.effort)[0] @ (-((2.0 * np.pi * 10.0) ** 2) * dx)
    # Of the plan's own acceleration the change of inertia with the pose is a part as well.
    moved = np.linalg.norm(away - at_plan - expected)
    assert moved < 5e-2 * np.linalg.norm(expected)


def test_it_tracks_with_a_payload_that_it_does_not_know(task):
    robot = pf.load("raparm_i")
    errors = {}
    for frequency in (None, 15.0):
        loaded = task.remodelled(robot.mechanism.rigid().with_payload(pf.Payload(0.5)))
        sim = Simulation(loaded, mode="++++", feed_forward=frequency is None, method="esdirk4")
        law = None if frequency is None else SampledController(ComputedTorque(frequency), period=1e-3)
        errors[frequency] = np.max(sim.run(law, warning=False).driven.deviation)
    assert errors[15.0] < 0.1 * errors[None]


# --- Rates ------------------------------------------------------------------------------------------------------------


def test_feedback_of_a_rate_damps_a_rotor():
    """J theta'' = -K theta' sampled: the rate falls by 1 - K T / J a period, once differences are known."""
    start = "[start.velocity]\nangular = { rotor = 2.0 }\n"
    sim = Simulation(model_from(tomllib.loads(STILL + start), "rotor.toml"), duration=0.02, samples=21)
    run = sim.run(SampledController(RateFeedback({"tau": {"hub": 1.5}}), period=T))
    assert run.solution.q[:, 2] == pytest.approx(under_rate_feedback(1.5, 2.0, 20), abs=1e-9)


@pytest.mark.parametrize(
    ("make", "said"),
    [
        (lambda: JointPID(-1.0), r"stiffness: must not be negative \(got -1.0\)"),
        (lambda: JointPID([1.0, 2.0]), "stiffness: not gains for 1 motors"),
        (lambda: JointPID({"tao": 1.0}), 'stiffness: unknown motor.*did you mean "tau"'),
        (lambda: JointPID(1.0, cutoff=0.0), "cutoff: must be positive"),
        (lambda: ComputedTorque(0.0), "frequency: must be positive"),
        (lambda: ComputedTorque(10.0), "there is no planned motion"),
        (lambda: RateFeedback({}), "gains: no gains"),
        (lambda: RateFeedback({"tau": {"hub": np.nan}}), r"gains\.tau\.hub: not a finite number"),
        (lambda: RateFeedback({"tau": {"hob": 1.0}}), "inputs: unknown sensor"),
    ],
)
def test_bad_laws(make, said):
    with pytest.raises(pf.InputError, match=said):
        loaded_rotor().run(SampledController(make(), period=T, reference={}))


def test_encoders_and_motors_must_be_as_many():
    with pytest.raises(pf.InputError, match="2 readings for 1 motors"):
        loaded_rotor().run(SampledController(JointPID(1.0), period=T, inputs=["hub", "rate"], reference={}))


# --- Loops ------------------------------------------------------------------------------------------------------------


def unstable(*controllers, duration=0.1):
    """What is said of the loop of a rotor at rest, its parts to the right of the colon."""
    sim = Simulation(model_from(tomllib.loads(STILL), "rotor.toml"), duration=duration, samples=11)
    doubts = sim.run(list(controllers), warning=False).findings
    return [one.text for one in doubts if one.code == "loop-unstable"]


def test_an_unstable_loop_is_found():
    """Kd of a rotor is at most 2 J/T = 20 N m s, with a sample's delay J/T; less where rates are differences."""
    chain = {"period": T, "reference": {"hub": 0.1}}
    for Kd, delay, found in ((19.5, 0.0, False), (25.0, 0.0, True), (5.0, T, False), (12.5, T, True)):
        said = unstable(SampledController(JointPID(40.0, Kd), delay=delay, name="pd", **chain))
        assert len(said) == found, (Kd, delay)
        if found:
            assert said[0].startswith('controller "pd": the sampled loop is unstable about the start: |z| = 1.')
    # Halves act together; what has other instants, or is no linear law, is not looked at.
    half = JointPID(20.0, 12.5)
    halves = [SampledController(half, name=name, **chain) for name in ("one", "two")]
    assert unstable(*halves)[0].startswith('controller "one", "two": ')
    assert not unstable(halves[0])
    late = SampledController(half, name="two", delay=T, **chain)
    assert not unstable(halves[0], late)
    assert not unstable(SampledController(lambda k, t, y: 50.0 * y, **chain))


def test_long_delays_are_no_states():
    """A loop whose torques are 3 s late is unstable, found at once; none acts in a run that is shorter."""
    begun = time.process_time()
    late = SampledController(JointPID(40.0, 1.2), period=T, delay=3.0, reference={"hub": 0.1}, name="late")
    (said,) = unstable(late, duration=9.0)
    assert re.match(r'controller "late": the sampled loop is unstable about the start: \d+ with \|z\| > 1\.0000', said)
    assert not unstable(late, duration=2.5)
    much_later = SampledController(JointPID(40.0, 1.2), period=T, delay=1000.0, reference={"hub": 0.1})
    assert not unstable(much_later, duration=1.0)
    # Eigenvalues of 3000 states took minutes.
    assert time.process_time() - begun < 60.0


def test_what_only_drifts_is_not_unstable():
    """Feedback of rates holds no place: a pole stays at one."""
    law = RateFeedback({"tau": {"hub": 0.5}})
    assert not unstable(SampledController(law, period=T), duration=1.0)
