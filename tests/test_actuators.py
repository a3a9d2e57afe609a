"""Actuators: rotors, windings and amplifiers of motors against closed forms, rotors on gears, and balances."""

import re
import tomllib
from dataclasses import replace
from math import inf, pi

import numpy as np
import pytest

import paraflex as pf
from paraflex.actuation.feed_forward import FeedForward
from paraflex.control.loop.amplifiers import Amplifiers, relaxing
from paraflex.designs.derivatives.plans import nominal_values
from paraflex.designs.run import Task, run_task
from paraflex.dynamics import InputSignals, build_system
from paraflex.engines.common import check_engine
from paraflex.engines.exudyn import ExudynOptions, simulate_exudyn
from paraflex.engines.mujoco import simulate_mujoco
from paraflex.errors import InputError
from paraflex.files import model_from
from paraflex.mechanism import with_actuators
from paraflex.mechanism.cut import Cut
from paraflex.results.metrics import METRICS
from paraflex.results.record import record
from paraflex.results.run_traces import run_traces
from paraflex.studies import load_sensitivities, metric_gradients
from rotors import ROTOR, J
from shell import paraflex

START = """
[start.coordinates]
rotor = { x = 0.0, y = 0.0, phi = 0.0 }
"""
MOTOR = """
[actuator.servo]
gear = 50
rotor_inertia = "4e-6 kg m^2"
torque_constant = "30 mN m/A"
resistance = "0.5 ohm"
"""
# n k_t [N m/A], n^2 J_m [kg m^2], n^2 k_t k_e/R [N m s/rad].
PER_CURRENT, ARMATURE, DAMPING = 1.5, 0.01, 4.5
EXACT = pf.IntegrationOptions(method="esdirk5", step=5e-5)


def rotor(more="", **changed):
    model = model_from(tomllib.loads(ROTOR + START + MOTOR + more), "rotor.toml")
    mechanism = model.mechanism
    if changed:
        mechanism = replace(mechanism, **changed)
    return replace(model, mechanism=mechanism)


def stepped(model, torques, duration, options=EXACT, **more):
    """A run under torques, each until a time."""
    sim = pf.Simulation(model, duration=duration, samples=41, options=options, **more)
    for torque, until in torques:
        sim.step([torque], until)
    return sim.result()


# --- Electrical part --------------------------------------------------------------------------------------------------


def test_a_step_of_voltage_without_inductance():
    """J w' = tau - c w: the time constant is the mechanical one with the load's inertia."""
    found = rotor('amplifier = "voltage"')
    run = stepped(found, [(2.0, 0.02)], 0.02)
    t, inertia = run.solution.t, J + ARMATURE
    rate = 2.0 / DAMPING * (1.0 - np.exp(-DAMPING / inertia * t))
    assert run.solution.v[:, 2] == pytest.approx(rate, abs=1e-9)
    record = run.electrical
    assert record.voltage[:, 0] == pytest.approx(np.full(41, 0.5 * 2.0 / PER_CURRENT), rel=1e-12)
    assert record.current[:, 0] == pytest.approx((2.0 - DAMPING * rate) / PER_CURRENT, abs=1e-8)


@pytest.mark.parametrize(("more", "lag"), [
    ("bandwidth = 100.0", 1.0 / (200.0 * pi)),
    ('amplifier = "voltage"\ninductance = "1 mH"', 2e-3),
])  # fmt: skip
def test_a_lagging_torque_has_a_second_order_response(more, lag):
    """(lag s + 1) tau = command, J w' = tau - d w, the command changed on the way: sums of two exponentials."""
    model = rotor(more)
    friction = 0.5
    model = replace(model, mechanism=replace(model.mechanism, dampers=(pf.TorsionalDamper("oil", "hub", friction),)))
    d = friction + (DAMPING if "voltage" in more else 0.0)
    run = stepped(model, [(1.0, 0.006), (-2.0, 0.02)], 0.02)
    t, fast = run.solution.t, (J + ARMATURE) / d

    def response(s):
        s = np.maximum(s, 0.0)
        rise = 1.0 - (fast * np.exp(-s / fast) - lag * np.exp(-s / lag)) / (fast - lag)
        return rise / d

    assert run.solution.v[:, 2] == pytest.approx(response(t) - 3.0 * response(t - 0.006), abs=1e-8)
    acting = 1.0 - np.exp(-t / lag) - 3.0 * np.where(t > 0.006, 1.0 - np.exp(-(t - 0.006) / lag), 0.0)
    assert run.applied[:, 0] == pytest.approx(acting, abs=1e-12)
    assert run.commanded[:, 0] == pytest.approx(np.where(t <= 0.006 + 1e-12, 1.0, -2.0))


@pytest.mark.parametrize("lag", [1e-4, 3e-3, 2.0])
def test_pieces_of_a_lag_are_exact(lag):
    """A quintic of a plan and the exponential, looked at everywhere but between the pieces."""
    rng = np.random.default_rng(3)
    base = InputSignals(np.array([0.0, 0.2, 0.35, 1.0]), rng.normal(size=(3, 6)))
    found = relaxing(base, 0.15, 5.0, -3.0, lag)
    assert np.all(np.diff(found.breaks) > 0.0)
    t = np.linspace(0.15, 1.0, 4001)[:-1]
    value, planned = (FeedForward(None, (one,), t, t).evaluate(t)[:, 0] for one in (found, base))
    exact = planned - 3.0 + 8.0 * np.exp(-(t - 0.15) / lag)
    assert np.max(np.abs(value - exact)) < 1e-9 * 8.0


def test_a_lag_goes_on_over_samples_and_from_saved_states():
    """Between samples the torque does not start anew where the command stays, and continued it has the same bits."""
    model = rotor("bandwidth = 30.0")

    def driven(*times):
        sim = pf.Simulation(model, duration=0.02, samples=21, options=EXACT)
        for until in times:
            saved = sim.save()
            sim.step([1.0 if until <= 0.01 else -1.0], until)
        last = sim.result().solution
        sim.restore(saved)
        sim.step([-1.0], times[-1])
        return last, sim.result().solution

    coarse, fine = driven(0.01, 0.02), driven(0.0025, 0.005, 0.0075, 0.01, 0.015, 0.02)
    assert coarse[0].v == pytest.approx(fine[0].v, abs=1e-12)
    for last, again in (coarse, fine):
        assert np.array_equal(last.q, again.q)
        assert np.array_equal(last.v, again.v)


def test_sensors_feel_the_lagging_torque():
    model = rotor("bandwidth = 30.0")
    sensor = pf.JointForceSensor("turning", "hub", "moment")
    sim = pf.Simulation(replace(model.mechanism, sensors=(sensor,)), duration=0.02, samples=21, start=model.start)
    read = sim.step([1.0], 0.004)["turning"]
    assert read == pytest.approx(1.0 - np.exp(-0.004 * 60.0 * pi), rel=1e-9)


def test_voltage_limits_speed_and_current():
    """At the limit of the current first, then on the straight line of torque over speed, and no faster than no load."""
    model = rotor("voltage_limit = 24.0\ncurrent_limit = 10.0")
    law = pf.SampledController(lambda k, t, y: [100.0], period=1e-4)
    sim = pf.Simulation(model, duration=0.1, samples=1001, options=pf.IntegrationOptions(method="esdirk5", step=1e-4))
    run = sim.run(law)
    record = run.electrical
    current, voltage, rate = (values[:, 0] for values in (record.current, record.voltage, record.rate))
    assert run.controllers[0].limits.tolist() == [[-15.0, 15.0]]
    assert np.all(current <= 10.0 + 1e-12)
    assert np.max(voltage) == pytest.approx(24.0, rel=2e-2)
    # From a rate of 12.67 rad/s on, 24 V are not enough for 10 A; between samples the rate is that of before.
    assert np.all(current[(rate > 0.0) & (rate < 12.5)] == pytest.approx(10.0))
    line = rate[:-1] > 12.8
    expected = (24.0 - 1.5 * rate[:-1]) / 0.5
    assert current[1:][line] == pytest.approx(expected[line], abs=1e-9)
    assert rate[-1] == pytest.approx(16.0, abs=1e-3)
    assert np.max(rate) <= 16.0 + 1e-9
    assert model.mechanism.actuators[0].no_load_speed == 16.0


def test_braking_has_more_voltage_than_driving():
    """Against its motion back-EMF helps the amplifier: from -10 rad/s 24 V give 78 A, at 10 rad/s 18 A."""
    found = Amplifiers(rotor("voltage_limit = 24.0").mechanism)
    low, high = found.limits(np.array([10.0]))
    assert [low[0], high[0]] == pytest.approx([-1.5 * 78.0, 1.5 * 18.0])
    # A voltage has limits of its own, whatever the speed; a limit of the current then is one of the voltage.
    found = Amplifiers(rotor('voltage_limit = 24.0\ncurrent_limit = 4.0\namplifier = "voltage"').mechanism)
    low, high = found.limits(np.array([10.0]))
    assert [low[0], high[0]] == pytest.approx([1.5 / 0.5 * (15.0 - 2.0), 1.5 / 0.5 * (15.0 + 2.0)])
    low, high = found.limits(np.array([15.0]))
    assert [low[0], high[0]] == pytest.approx([1.5 / 0.5 * (22.5 - 2.0), 1.5 / 0.5 * 24.0])


@pytest.mark.parametrize("more", ['amplifier = "voltage"', ""])
def test_energy(more):
    """What the amplifier gives is heat of the winding and kinetic energy of rotor and load."""
    run = stepped(rotor(more), [(3.0, 0.02)], 0.02)
    record, rate = run.electrical, run.solution.v[-1, 2]
    kinetic = 0.5 * (J + ARMATURE) * rate**2
    # Trapezes of exponentials: 40 intervals of an eighth of a time constant.
    assert record.energy[0] == pytest.approx(record.copper_energy[0] + kinetic, rel=2e-3)
    assert run.solution.kinetic_energy[-1] == pytest.approx(kinetic, rel=1e-9)
    values = {name: METRICS[name].value(run_traces(run)) for name in ("current_max", "voltage_max", "rms_current")}
    assert values["current_max"][0] == pytest.approx(2.0, rel=1e-9)
    assert values["voltage_max"][0] == pytest.approx(np.max(record.voltage))
    assert values["rms_current"][0] <= 2.0 * (1.0 + 1e-12)
    assert METRICS["copper_energy"].value(run_traces(run))[0] == pytest.approx(record.copper_energy[0])


def test_numbers_of_a_datasheet():
    """Maxon-like numbers by hand."""
    one = pf.Actuator("m", gear=50.0, rotor_inertia=4e-6, torque_constant=0.03, back_emf=0.032, resistance=0.5,
                      inductance=1e-4, voltage_limit=24.0, current_limit=30.0, amplifier="voltage")  # fmt: skip
    assert one.reflected_inertia == pytest.approx(0.01)
    assert one.back_emf_damping == one.damping == pytest.approx(2500.0 * 0.03 * 0.032 / 0.5)
    assert one.electrical_time == one.lag == pytest.approx(2e-4)
    assert one.mechanical_time == pytest.approx(4e-6 * 0.5 / (0.03 * 0.032))
    assert one.no_load_speed == pytest.approx(24.0 / (0.032 * 50.0))
    assert one.stall_torque == pytest.approx(1.5 * 30.0)
    assert replace(one, current_limit=None).stall_torque == pytest.approx(1.5 * 48.0)
    assert replace(one, amplifier="current").damping == 0.0
    assert replace(one, amplifier="current", bandwidth=100.0).lag == pytest.approx(1.0 / (200.0 * pi))
    bare = pf.Actuator("bare", rotor_inertia=1e-5)
    assert (bare.stall_torque, bare.no_load_speed, bare.mechanical_time, bare.lag) == (inf, inf, inf, 0.0)
    # Of all gears the matching one gives the largest acceleration n k_t/(J + n^2 J_m).
    best = one.matching_gear(0.02)
    accelerations = [n / (0.02 + n**2 * 4e-6) for n in (0.99 * best, best, 1.01 * best)]
    assert max(accelerations) == accelerations[1]


# --- Rotors -----------------------------------------------------------------------------------------------------------

RAIL = pf.PrismaticJoint("rail", "ground.O", "cart.P", direction=0.7)
RAIL_BACK = pf.PrismaticJoint("rail", "cart.P", "ground.O", direction=0.7)
SLOT = pf.SlotJoint("rail", "ground.O", "cart.P", direction=0.7)
PIN = pf.RevoluteJoint("rail", "ground.O", "cart.P")
PIN_BACK = pf.RevoluteJoint("rail", "cart.P", "ground.O")


def cart(joint, actuators=(), **more):
    """A body with an eccentric centre of mass, under gravity, that slides or turns."""
    body = pf.RigidBody("cart", 2.0, 0.03, (0.1, 0.05), {"P": (0.0, 0.0)})
    return pf.Mechanism(
        "cart", {"O": (0.0, 0.0)}, [body, *more.pop("bodies", ())], [joint, *more.pop("joints", ())],
        [pf.Motor("drive", "rail")], actuators=actuators, gravity=(0.0, -9.81),
        assemblies=[pf.Assembly("a", {"cart": 0.2 if "angle" not in joint.holds else 0.0} | more.pop("angles", {}))],
        **more,
    )  # fmt: skip


@pytest.mark.parametrize("joint", [RAIL, RAIL_BACK, SLOT, PIN, PIN_BACK])
def test_a_rotor_is_a_body_on_a_gear(joint):
    """n^2 J_m against a rotor on a pin of its own that a gear turns n times as fast: motion, forces of the joint."""
    geared = cart(
        joint, bodies=[pf.RigidBody("rotor", 0.5, 2e-4, (0.0, 0.0), {"O": (0.0, 0.0)})],
        joints=[pf.RevoluteJoint("pin", "ground.O", "rotor.O")], angles={"rotor": 0.0},
        gears=[pf.Gear("teeth", "rail", "pin", 60.0, phase=None if joint in (PIN, PIN_BACK) else 0.0)],
    )  # fmt: skip
    lumped = cart(joint, [pf.Actuator("servo", gear=60.0, rotor_inertia=2e-4)])
    options = pf.IntegrationOptions(method="esdirk5", step=5e-4)
    runs = [pf.simulate_motion(each, 0.2, torques={"drive": 3.0}, samples=21, start="a", options=options)
            for each in (lumped, geared)]  # fmt: skip
    for name in ("q", "v", "a"):
        lump, gear = (getattr(run.solution, name)[:, :3] for run in runs)
        assert lump == pytest.approx(gear, abs=1e-9)
    # Along its axis a joint has the force of the gear besides; what holds the body does not differ.
    lump, gear = (pf.motion_dataset(run)["joint_force"].sel(joint="rail").values for run in runs)
    across = [-np.sin(0.7), np.cos(0.7)] if joint.slides else np.eye(2)
    assert lump @ across == pytest.approx(gear @ across, abs=1e-8)
    # Without the rotor it is another motion.
    plain = pf.simulate_motion(cart(joint), 0.2, torques={"drive": 3.0}, samples=21, start="a", options=options)
    assert np.max(np.abs(plain.solution.v[:, :3] - runs[0].solution.v[:, :3])) > 0.1


def test_a_rotor_does_not_weigh():
    """Equilibria are those without it: its mass n^2 J_m on a rail is none to gravity, nor a mass of the mechanism."""
    assert build_system(cart(RAIL, [pf.Actuator("servo", gear=60.0, rotor_inertia=2e-4)])).total_mass == 2.0
    for joint in (RAIL, SLOT, PIN):
        found = []
        for actuators in ((), (pf.Actuator("servo", gear=60.0, rotor_inertia=2e-4),)):
            mechanism = cart(joint, actuators, springs=(pf.TorsionalSpring("coil", "rail", 300.0),))
            statics = pf.statics(mechanism, loads={"rail": 2.0}, steps=2)
            found.append(pf.statics_dataset(statics)["point_position"].values)
        assert found[0] == pytest.approx(found[1], abs=1e-12)


def beam(hub, actuators=()):
    steel, bar = pf.Material(210e9, 7850.0), pf.Section.rectangle(width=0.03, thickness=0.003)
    link = pf.FlexibleBeam("link", 0.5, bar, steel, {"O": 0.0, "T": 0.5}, 3,
                           lumps=[pf.LumpedMass("O", 0.1, hub), pf.LumpedMass("T", 0.2)])  # fmt: skip
    return pf.Mechanism(
        "arm", {"O": (0.0, 0.0)}, [link], [pf.RevoluteJoint("hub", "ground.O", "link.O")], [pf.Motor("drive", "hub")],
        actuators=actuators, assemblies=[pf.Assembly("a", {"link": 0.0})],
        end_effector=pf.EndEffector("link.T", ["y"]),
    )  # fmt: skip


def test_linear_models_and_segments_have_the_rotor_at_the_slope_of_the_beam():
    servo = pf.Actuator("servo", gear=100.0, rotor_inertia=1e-6)
    lumped, by_hand = beam(1e-3, [servo]), beam(1e-3 + 0.01)
    poles = [np.sort(np.linalg.eigvals(pf.linearise(each).A).imag) for each in (lumped, by_hand, beam(1e-3))]
    assert poles[0] == pytest.approx(poles[1], rel=1e-7, abs=1e-5)
    assert np.max(np.abs(poles[2] - poles[1])) > 10.0
    path = pf.Line((0.5, 0.0), (0.5, 0.05), max_acceleration=3.0)
    tasks = [pf.plan(each, path, duration=0.1, samples=21) for each in (lumped, by_hand)]
    for one in (lambda task: task, lambda task: task.in_segments(4)):
        runs = [pf.simulate(one(task), "+") for task in tasks]
        assert runs[0].applied == pytest.approx(runs[1].applied, rel=1e-9, abs=1e-12)
        assert runs[0].driven.actual == pytest.approx(runs[1].driven.actual, abs=1e-9)


def test_back_emf_is_in_linear_models_and_plans():
    """A damper of n^2 k_t k_e/R at the joint, by the user's own hand, is the same."""
    servo = pf.Actuator("servo", gear=20.0, torque_constant=0.05, resistance=1.0, amplifier="voltage")
    assert servo.damping == pytest.approx(1.0)
    electric = beam(1e-2, [servo])
    by_hand = replace(beam(1e-2), dampers=(pf.TorsionalDamper("oil", "hub", 1.0),))
    models = [pf.linearise(each) for each in (electric, by_hand)]
    assert pytest.approx(models[1].A, rel=1e-12, abs=1e-9) == models[0].A
    assert pytest.approx(models[1].B, rel=1e-12) == models[0].B
    path = pf.Line((0.5, 0.0), (0.5, 0.05), max_acceleration=3.0)
    tasks = [pf.plan(each, path, duration=0.1, samples=21) for each in (electric, by_hand, beam(1e-2))]
    torques = [task.torques("+").evaluate(task.motion.t) for task in tasks]
    assert torques[0] == pytest.approx(torques[1], abs=1e-12)
    assert np.max(np.abs(torques[0] - torques[2])) > 0.1


def test_bodies_of_given_matrices_take_a_rotor():
    modal = pf.ModalBody(
        "link", mass=1.0, first_moment=(0.25, 0.0), inertia=0.1, mass_matrix=[[0.3]], stiffness=[[500.0]],
        S2=[[0.0], [0.4]], I1=[0.0], G1=[0.12], G2=[[0.0]],
        points={"O": pf.ModalPoint((0.0, 0.0), [[0.0], [0.0]], [0.7])},
    )  # fmt: skip
    plain = pf.Mechanism("m", {"O": (0.0, 0.0)}, [modal], [pf.RevoluteJoint("hub", "ground.O", "link.O")],
                         [pf.Motor("drive", "hub")], assemblies=[pf.Assembly("a", {"link": 0.0})])  # fmt: skip
    servo = pf.Actuator("servo", gear=10.0, rotor_inertia=1e-4)
    s, r = (build_system(each).bodies[0].shape.integrals for each in (plain, replace(plain, actuators=(servo,))))
    # J (phi' + slope u')^2 / 2.
    assert pytest.approx(0.01) == r.I0 - s.I0
    assert (r.G1 - s.G1)[0] == pytest.approx(0.01 * 0.7)
    assert (r.Mff - s.Mff)[0, 0] == pytest.approx(0.01 * 0.49)


def test_the_mechanism_stays_as_it_was_described():
    mechanism = beam(1e-3, [pf.Actuator("servo", gear=100.0, rotor_inertia=1e-6)])
    computed = with_actuators(mechanism)
    assert isinstance(computed.cut, Cut)
    assert computed.described is mechanism
    assert with_actuators(computed) is computed
    assert build_system(mechanism).described is mechanism
    assert mechanism.body("link").lumps[0].inertia == 1e-3


# --- RAParM-I ---------------------------------------------------------------------------------------------------------

SERVO = pf.Actuator("servo", gear=20.0, rotor_inertia=1e-5, torque_constant=0.05, resistance=0.8, inductance=4e-4,
                    voltage_limit=48.0, current_limit=20.0, bandwidth=1000.0)  # fmt: skip


@pytest.fixture(scope="module")
def square():
    robot = pf.load("raparm_i")
    mechanism = replace(robot.mechanism, actuators=(SERVO,))
    return pf.plan(mechanism, robot.paths["square"], duration=0.1, samples=101)


def test_raparm_plans_for_its_rotors(square):
    """The required effort grows by B n^2 J_m times the accelerations of the motors' joints."""
    robot = pf.load("raparm_i")
    plain = pf.plan(robot.mechanism, robot.paths["square"], duration=0.1, samples=101)
    rows = square.effort.matrix
    basis, a = square.effort.motion.basis, square.effort.motion.a
    joints = [robot.mechanism.joint(motor.joint) for motor in robot.mechanism.motors]
    system = square.effort.motion.system
    angles = np.stack([a[:, system.body(joint.b.body).angle] for joint in joints], axis=1)
    more = SERVO.reflected_inertia * np.einsum("ktm,km->kt", rows, angles)
    assert square.effort.required - plain.effort.required == pytest.approx(more, abs=1e-9)
    assert np.max(np.abs(more)) > 0.1
    assert basis.shape[0] == 101


def test_raparm_with_servos_runs_under_a_controller(square):
    """Encoders feel the rotors, so that a damping acts which makes links without rotors vibrate ever more."""

    def driven(task):
        law = pf.SampledController(pf.JointPID(stiffness=20.0, damping=0.4), period=5e-4, reference="plan")
        return pf.Simulation(task, mode="++++", feed_forward=True).run(law, warning=False)

    run = driven(square)
    assert run.solution.status == "complete"
    record = run.electrical
    assert record.current == pytest.approx(run.applied / 1.0, rel=1e-12)
    assert np.max(np.abs(record.voltage)) < 48.0
    assert np.max(np.abs(run.applied)) < 8.0
    assert not [one for one in run.findings if one.code.startswith(("amplifier", "back-emf"))]
    # Without them links bend beyond all theory in the end, where rounding lets them.
    try:
        bare = driven(square.remodelled(replace(square.mechanism, actuators=())))
    except pf.errors.IntegrationError as error:
        bare = error.partial
    assert np.max(np.abs(bare.applied)) > 50.0


def test_what_motors_cannot_give_is_found(square):
    weak = replace(square.mechanism, actuators=(replace(SERVO, current_limit=1.0, voltage_limit=3.0),))
    doubts = pf.simulate(square.remodelled(weak), "++++", warning=False).findings
    found = [(one.code, one.place) for one in doubts if one.code == "amplifier-beyond"]
    assert ("amplifier-beyond", "actuator.servo.current_limit") in found
    assert ("amplifier-beyond", "actuator.servo.voltage_limit") in found


def test_back_emf_that_comes_late_or_unasked_is_found(square):
    slow = replace(SERVO, amplifier="voltage", bandwidth=None, voltage_limit=None, current_limit=None)
    task = square.remodelled(replace(square.mechanism, actuators=(slow,)))
    run = pf.simulate(task, "+-+-", warning=False)
    found = {one.code: one for one in run.findings}
    assert found["back-emf-passive"].text.startswith("motor tau6 is passive")
    late = re.search(r"L/R = 0.5 ms would delay up to ([\d.]+) of ([\d.]+)", found["back-emf-late"].text)
    assert late
    k = run.task.mechanism.motors.index(next(one for one in run.task.mechanism.motors if one.name == "tau6"))
    assert float(late[2]) == pytest.approx(np.max(np.abs(run.electrical.torque[:, k])), rel=1e-2)
    quick = replace(slow, inductance=0.0)
    task = square.remodelled(replace(square.mechanism, actuators=(quick,)))
    codes = {one.code for one in pf.simulate(task, "++++", warning=False).findings}
    assert not codes & {"back-emf-passive", "back-emf-late"}


STUDY = """
mechanism = "robot.toml"
paths = ["line"]
modes = ["++++"]
duration = 0.04
samples = 9
[integration]
method = "tr-bdf2"
step = 2e-3
tolerance = 1e-9
[vary.gear]
fields = ["actuator.servo.gear"]
[vary.rotor]
fields = ["actuator.servo.rotor_inertia"]
"""


def test_derivatives_by_gear_and_rotor(tmp_path):
    """Against central differences of whole runs; back-EMF and rotor both depend on the gear."""
    robot = pf.load("raparm_i")
    servo = replace(SERVO, amplifier="voltage", bandwidth=None, inductance=0.0, voltage_limit=None)
    replace(robot, mechanism=replace(robot.mechanism, actuators=(servo,))).save(tmp_path / "robot.toml")
    (tmp_path / "study.toml").write_text(STUDY, encoding="utf-8")
    setting = load_sensitivities(tmp_path / "study.toml").setting
    task = Task(0, 0, nominal_values(setting), setting.paths[0])
    ((_, values, gradients),) = metric_gradients(setting, task)
    for k, step in enumerate((3e-4, 3e-4)):
        rows = []
        for place in (-2.0, -1.0, 1.0, 2.0):
            moved = list(task.values)
            moved[k] *= 1.0 + place * step
            rows.append(run_task(setting, task._replace(values=tuple(moved))).rows[0])
        for metric in ("tracking_rms", "peak_torque_max", "motor_energy", "strain_energy_max"):
            weights = np.array([1.0, -8.0, 8.0, -1.0]) / 12.0
            difference = weights @ [row[metric] for row in rows] / step
            assert gradients[metric][k] * task.values[k] == pytest.approx(difference, rel=1e-3), metric
            assert abs(difference) > 1e-3 * abs(values[metric])


# --- Files ------------------------------------------------------------------------------------------------------------


def test_files_say_actuators(tmp_path):
    model = rotor('amplifier = "voltage"\nmotors = ["tau"]\nvoltage_limit = "24 V"\ninductance = "0.1 mH"')
    (one,) = model.mechanism.actuators
    expected = pf.Actuator("servo", ("tau",), 50.0, 4e-6, 0.03, None, 0.5, 1e-4, 24.0, None, pf.Amplifier.VOLTAGE)
    assert one == expected
    model.mechanism.save(tmp_path / "rotor.toml")
    assert pf.load(tmp_path / "rotor.toml").mechanism == model.mechanism


@pytest.mark.parametrize(("more", "says"), [
    ("resistance = -1.0", r"actuator\.servo\.resistance: must be positive \(got -1\.0\); give it in ohm"),
    ("rotor_inertia = -1e-6", r"actuator\.servo\.rotor_inertia: must not be negative"),
    ("gear = 0.0", r"actuator\.servo\.gear: must be positive \(got 0\.0\); give it in turns of the rotor"),
    ('resistance = "2 H"', r"actuator\.servo\.resistance: .* where one in ohm is asked for"),
    ('torque_constant = "30 mN m"', r"actuator\.servo\.torque_constant: .* where one in N m/A is asked for"),
    ('motors = ["tua"]', r"actuator\.servo\.motors: unknown motor \(got 'tua'\); did you mean .tau"),
    ('amplifier = "volts"', r"actuator\.servo\.amplifier: should be 'current' or 'voltage' \(got 'volts'\)"),
    ('amplifier = "voltage"\nresistance = 0.5\n#', r"actuator\.servo\.torque_constant: is missing; give"),
    ('amplifier = "voltage"\ntorque_constant = 0.1\n#', r"actuator\.servo\.resistance: is missing; give the"),
    ("voltage_limit = 24.0\ntorque_constant = 0.1", r"servo\.resistance: is missing; .* voltage_limit = 24\.0"),
    ("current_limit = 2.0", r"actuator\.servo\.torque_constant: is missing; .*current_limit = 2\.0"),
    ("inductance = 1e-3", r"actuator\.servo\.torque_constant: is missing"),
    ('amplifier = "voltage"\nresistance = 0.5\ntorque_constant = 0.1\nbandwidth = 50.0',
     r"actuator\.servo\.bandwidth: has no meaning for a voltage amplifier"),
    ("[actuator.other]\nmotors = [\"tau\"]", r"actuator\.other\.motors: motor tau has actuator servo already"),
])  # fmt: skip
def test_what_is_wrong_is_named(more, says):
    with pytest.raises(InputError, match=says) as caught:
        model_from(tomllib.loads(f"{ROTOR}{START}[actuator.servo]\n{more}\n"), "rotor.toml")
    assert "\n" not in str(caught.value)


def test_a_rotor_between_moving_bodies_is_refused():
    arm = pf.RigidBody("arm", 1.0, 0.1, (0.5, 0.0), {"O": (0.0, 0.0), "E": (1.0, 0.0)})
    fore = pf.RigidBody("fore", 1.0, 0.1, (0.5, 0.0), {"E": (0.0, 0.0)})
    joints = [pf.RevoluteJoint("shoulder", "ground.O", "arm.O"), pf.RevoluteJoint("elbow", "arm.E", "fore.E")]

    def made(*actuators):
        return pf.Mechanism("arm", {"O": (0.0, 0.0)}, [arm, fore], joints, [pf.Motor("m", "elbow")],
                            actuators=actuators, assemblies=[pf.Assembly("a", {"arm": 0.0, "fore": 0.5})])  # fmt: skip

    with pytest.raises(
        InputError, match=r"actuator\.s\.rotor_inertia: .*two bodies that both move \(m at elbow\).*gear"
    ):
        made(pf.Actuator("s", rotor_inertia=1e-5))
    # Its electrical part may act there.
    servo = pf.Actuator("s", torque_constant=0.1, resistance=1.0, amplifier="voltage")
    assert with_actuators(made(servo)).dampers[0].coefficient == pytest.approx(0.01)
    turned = pf.SlotJoint("rail", "cart.P", "ground.O")
    with pytest.raises(InputError, match="a joint that slides on cart"):
        cart(turned, [pf.Actuator("s", rotor_inertia=1e-5)])


def test_info_has_the_numbers_of_a_datasheet(tmp_path):
    rotor('amplifier = "voltage"\nvoltage_limit = 24.0').mechanism.save(tmp_path / "rotor.toml")
    said = " ".join(paraflex("info", str(tmp_path / "rotor.toml")).stdout.split())
    assert "servo: rotor 0.01 kg m^2, back-EMF 4.5 N m s/rad, stall 72 N m, no load 16 rad/s" in said
    assert pf.Actuator("m", gear=60.0, rotor_inertia=2e-4).summary(slides=True) == "rotor 0.72 kg"


@pytest.mark.parametrize("engine", ["mujoco", "exudyn"])
def test_other_programs_have_rotors_and_refuse_back_emf(square, engine):
    """MuJoCo of the same segments, Exudyn of finer cables, here of the converged beam; 7 mm off without rotors."""
    pytest.importorskip(engine)
    fine = square.mechanism.with_geometry("second-order").with_beams(
        curvature="separate", reference="pinned", elements=2
    )
    task = square.remodelled(fine)
    task = task.in_segments(4) if engine == "mujoco" else task
    ours = record(pf.simulate(task, "++++", options=pf.IntegrationOptions(tolerance=1e-7), warning=False))
    cables = ExudynOptions(refinement=2)
    other = simulate_mujoco(task, "++++") if engine == "mujoco" else simulate_exudyn(task, "++++", cables)
    assert np.max(np.abs(other.end_effector.position - ours.end_effector.position)) < 3e-7
    voltage = replace(SERVO, amplifier="voltage", bandwidth=None)
    with pytest.raises(InputError, match=r"actuator\.servo\.amplifier: \w+ cannot express back-EMF"):
        check_engine(engine, replace(square.mechanism, actuators=(voltage,)))
