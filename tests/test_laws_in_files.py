"""Computed torque, rate feedback, LQG and shaped torques of model files: read, refused, written; their runs."""

import json
import re
import tomllib
import warnings
from dataclasses import replace
from pathlib import Path

import numpy as np
import pandas as pd
import pytest

import paraflex as pf
from pages import blocks_of
from paraflex import SampledController, Simulation
from paraflex.control import ControllerDescription, DesignedLQG, simulate_controlled
from paraflex.control.laws.kinds import LAWS
from paraflex.designs.derivatives.plans import check_open_and_whole
from paraflex.errors import InputError, ResultWarning
from paraflex.files import model_from
from rotors import ROTOR, J, T, rotor, under_rate_feedback
from shell import paraflex

LIBRARY = (Path(pf.__file__).parent / "mechanism" / "library" / "raparm_i.toml").read_text(encoding="utf-8")
ANGLES, MOTORS = ("A1", "D1", "A2", "D2"), ("tau1", "tau2", "tau5", "tau6")
GAUGES = """
[sensor.root1]
type = "strain"
body = "link1"
at = 0.02

[sensor.root5]
type = "strain"
body = "link5"
at = 0.02
"""
LAWS_OF_FILE = """
[controller.ct]
type = "computed-torque"
frequency = "15 Hz"
cutoff = 300.0
period = "1 ms"

[controller.damp]
type = "rate-feedback"
gains = { tau1 = { root1 = 0.3, A1 = 0.02 }, tau2 = { root1 = -0.1 } }
cutoff = "100 Hz"
period = 1e-3

[controller.lq]
type = "lqg"
deviations = { x = "0.5 mm", y = "0.5 mm", A1 = 0.02, D1 = 0.02, A2 = 0.02, D2 = 0.02 }
effort = 1.0
period = 1e-3
delay = 1e-3
quantise = { A1 = 1e-3, D1 = 1e-3, A2 = 1e-3, D2 = 2e-3 }
"""
ROBOT = LIBRARY + GAUGES + LAWS_OF_FILE
LQ = """
[assembly.zero]
rotor = 0.0
[controller.lq]
type = "lqg"
deviations = { hub = 0.01 }
effort = { tau = 1.0 }
noise = 1e-4
integrators = { hub = 0.05 }
period = 1e-3
delay = 1.5e-3
reference = { hub = 0.2 }
"""


def robot(**changes):
    return model_from(tomllib.loads(ROBOT), "robot.toml")


@pytest.fixture(scope="module")
def model():
    return robot()


@pytest.fixture(scope="module")
def task(model):
    """The start of RAParM-I's square, links rigid."""
    return model.plan(mechanism=model.mechanism.rigid(), duration=0.05, samples=51)


@pytest.fixture
def file(tmp_path):
    path = tmp_path / "robot.toml"
    path.write_text(ROBOT, encoding="utf-8")
    return path


# --- Files ------------------------------------------------------------------------------------------------------------


def test_laws_are_what_their_tables_say(model):
    laws = {name: one.law for name, one in model.controllers.items()}
    assert laws["ct"] == pf.ComputedTorque(15.0, cutoff=300.0)
    assert laws["damp"] == pf.RateFeedback({"tau1": {"root1": 0.3, "A1": 0.02}, "tau2": {"root1": -0.1}}, 100.0)
    deviations = {"x": 0.5e-3, "y": 0.5e-3, **dict.fromkeys(ANGLES, 0.02)}
    assert laws["lq"] == DesignedLQG(deviations, 1.0)


def test_files_are_written_and_read_again(file, model, tmp_path):
    read = pf.load(file)
    read.save(tmp_path / "same.toml")
    assert (tmp_path / "same.toml").read_text().strip() == ROBOT.strip()
    replace(read, parameters={}, text="", source="").save(tmp_path / "new.toml")
    assert pf.load(tmp_path / "new.toml").controllers == model.controllers
    changed = replace(read.controllers["lq"], law=DesignedLQG({"x": 1e-3}, {"tau1": 2.0}, noise=1e-4, states=8, at=0.1))
    replace(read, controllers={"lq": changed}).save(tmp_path / "changed.toml")
    assert pf.load(tmp_path / "changed.toml").controllers == {"lq": changed}


def test_a_law_and_its_description_agree_on_the_whole_torque(model):
    motors = [motor.name for motor in model.mechanism.motors]
    for one in model.controllers.values():
        assert one.made(model.mechanism, motors).whole_torque is one.whole_torque is one.law.whole_torque
    assert [kind for kind, law in LAWS.items() if law.whole_torque] == ["computed-torque"]


@pytest.mark.parametrize(
    ("old", "new", "said"),
    [
        ('frequency = "15 Hz"', "", r"controller.ct.frequency: .*(missing|needed)"),
        ('frequency = "15 Hz"', "frequency = 0.0", r"robot.toml: controller.ct.frequency: must be positive"),
        ('frequency = "15 Hz"', 'frequency = "15 s"', r"controller.ct.frequency: a quantity in s where one in"),
        ("cutoff = 300.0", "damping = 0.7", r"controller.ct.damping: .*did you mean .damping_ratio"),
        ("cutoff = 300.0", 'reference = "plan"', r"ct.reference: computed torque uses the readings themselves"),
        ("tau1 = { root1", "tau = { root1", r"controller.damp.gains: unknown motor \(got .tau.\)"),
        ("{ root1 = 0.3, A1", "{ root2 = 0.3, A1", r'damp.gains.tau1: unknown sensor'),
        ('"100 Hz"', '"100 Hz"\ninputs = ["root1"]', r"controller.damp.inputs: differ from those of the gains"),
        ("gains = {", "gains = {}\n[nothing]\nx = {", r"controller.damp.gains: no gains|nothing"),
        ("effort = 1.0", "effort = -1.0", r"controller.lq.effort: must be positive"),
        ("effort = 1.0", "effort = { tau3 = 1.0 }", r"controller.lq.effort: unknown motor \(got .tau3.\)"),
        ("effort = 1.0", "effort = {}", r"controller.lq.effort: there is no motor"),
        ("effort = 1.0", 'effort = { tau1 = 1.0 }\noutputs = ["tau2"]', r"lq.effort: names no active motor"),
        ("effort = 1.0", "effort = 1.0\ndisturbance = { tau1 = -1.0 }", r"lq.disturbance.tau1: must not be negative"),
        ("effort = 1.0", "effort = 1.0\nintegrators = { A9 = 1.0 }", r"controller.lq.integrators: unknown sensor"),
        ("effort = 1.0", "effort = 1.0\nintegrators = { A1 = 0.0 }", r"controller.lq.integrators.A1: must be positive"),
        ("effort = 1.0", "effort = 1.0\nnoise = { A1 = 0.0 }", r"controller.lq.noise.A1: must be positive"),
        ("effort = 1.0", "effort = 1.0\nstates = 0", r"controller.lq.states: no such number of states"),
        ("effort = 1.0", "effort = 1.0\nintegrators = { x = 1.0 }", r"controller.lq.integrators: unknown sensor"),
        ("effort = 1.0", "effort = 1.0\nnoise = { root1 = 1e-6 }", r"controller.lq.noise: unknown sensor"),
        ("effort = 1.0", 'effort = 1.0\nmeasured = ["A1"]', r"controller.lq.measured"),
        ('{ x = "0.5 mm"', '{ z = "0.5 mm"', r"controller.lq.deviations: unknown sensor \(got .z.\)"),
    ],
)  # fmt: skip
def test_what_files_cannot_say(old, new, said):
    assert old in ROBOT
    with pytest.raises(InputError, match=said):
        model_from(tomllib.loads(ROBOT.replace(old, new, 1)), "robot.toml")


def test_what_the_page_shows_is_read_and_runs(tmp_path):
    """Every controller of the page on the tables of model files acts on RAParM-I."""
    data = tomllib.loads(LIBRARY + GAUGES)
    for block in blocks_of(Path(__file__).parents[1] / "docs" / "model-file-tables.md"):
        if block.language == "toml" and "[controller." in block.text:
            data.setdefault("controller", {}).update(tomllib.loads(block.text)["controller"])
    model = model_from(data, "robot.toml")
    assert {one.law.kind for one in model.controllers.values()} == set(LAWS)
    task = model.plan(duration=0.11, samples=111)
    for one in model.controllers.values():
        made = one.made(model.mechanism, MOTORS)
        planned = not one.law.whole_torque
        run = Simulation(task, mode="++++", feed_forward=planned).run(made, until=0.002, warning=False)
        assert np.all(np.isfinite(run.controllers[0].applied)), one.name


# --- Computed torque --------------------------------------------------------------------------------------------------


def test_computed_torque_drives_alone(model, task):
    """Applied torques are those of the law, the same as in Python, and of the size of the planned ones."""
    run = simulate_controlled(task, "++++", [model.controllers["ct"]])
    law = SampledController(pf.ComputedTorque(15.0, cutoff=300.0), period=1e-3)
    by_hand = Simulation(task, mode="++++").run(law, warning=False)
    assert np.array_equal(run.controllers[0].applied, by_hand.controllers[0].applied)
    assert not np.any(run.torques.evaluate(task.motion.t))
    planned = task.torques("++++").evaluate(task.motion.t)
    assert np.max(np.abs(run.applied)) == pytest.approx(np.max(np.abs(planned)), rel=0.05)

    class Unmarked(pf.ComputedTorque):
        whole_torque = False

    twice = SampledController(Unmarked(15.0, cutoff=300.0), period=1e-3)
    beside = Simulation(task, mode="++++", feed_forward=True).run(twice, warning=False)
    assert 10.0 * run.driven.deviation < beside.driven.deviation


def test_computed_torque_goes_on_from_what_was_saved(model, task):
    """The same bits: pose and rates are its state, and what started is the same before and after."""
    sim, ends = Simulation(task, mode="++++"), []
    controller = SampledController(model.controllers["ct"].law, period=1e-3)
    sim.run(controller, until=0.0205, warning=False)
    saved, started = sim.save(), controller.started
    for _ in range(2):
        sim.restore(saved)
        assert controller.started is started
        assert controller.law is model.controllers["ct"].law
        ends.append(sim.run(warning=False).controllers[0].requested)
    assert np.array_equal(*ends)
    assert np.array_equal(
        ends[0], Simulation(task, mode="++++").run(controller, warning=False).controllers[0].requested
    )


def test_no_second_torque_beside_the_whole_one(model, task):
    ct = model.controllers["ct"]
    with pytest.raises(
        InputError, match=r"ct: gives the whole torque, but the planned one also acts.*leave out feed_forward"
    ):
        Simulation(task, mode="++++", feed_forward=True).run(ct)
    twice = [ct, replace(ct, name="again")]
    for run in (lambda: Simulation(task, mode="++++").run(twice), lambda: simulate_controlled(task, "++++", twice)):
        with pytest.raises(InputError, match=r'again: gives the whole torque, as "ct" does'):
            run()
    two = (
        ROBOT.replace("[study]", '[study]\ncontrollers = ["ct", "two"]')
        + "[controller.two]"
        + "".join(LAWS_OF_FILE.split("[controller.ct]")[1].split("[controller.damp]")[0])
    )
    with pytest.raises(InputError, match=r'robot.toml: controller.two: gives the whole torque, as "ct" does'):
        model_from(tomllib.loads(two), "robot.toml")


def test_feedback_beside_the_whole_torque_adds_to_it(model, task):
    run = simulate_controlled(task, "++++", [model.controllers["ct"], ControllerDescription("pd", pf.JointPID(5.0), T)])
    whole, more = (one.applied for one in run.controllers)
    assert np.max(np.abs(more)) > 0.0
    assert run.applied[2:] == pytest.approx((whole + more)[1:], abs=1e-12)


def test_computed_torque_needs_a_path():
    text = (
        ROTOR
        + "[assembly.zero]\nrotor = 0.0\n"
        + '[controller.ct]\ntype = "computed-torque"\nfrequency = 5\nperiod = 1e-3\n'
    )
    rotor = model_from(tomllib.loads(text), "rotor.toml")
    with pytest.raises(InputError, match=r"ct.law: there is no planned motion to follow .*give a path"):
        Simulation(rotor, duration=0.01, samples=11).run(rotor.controllers["ct"])


# --- Rate feedback ----------------------------------------------------------------------------------------------------


def test_rate_feedback_is_the_law(model):
    start = "[start.velocity]\nangular = { rotor = 2.0 }\n[assembly.zero]\nrotor = 0.0\n"
    law = '[controller.d]\ntype = "rate-feedback"\ngains = { tau = { hub = 1.5 } }\nperiod = 1e-3\n'
    rotor = model_from(tomllib.loads(ROTOR + start + law), "rotor.toml")
    run = Simulation(rotor, duration=0.02, samples=21).run(rotor.controllers["d"])
    # J theta'' = -K theta': once a difference is known the rate falls by 1 - K T / J a period, with a sample's memory.
    assert run.solution.q[:, 2] == pytest.approx(under_rate_feedback(1.5, 2.0, 20), abs=1e-9)


def test_gains_are_used_of_the_motors_of_a_mode(model):
    flexible = model.plan(duration=0.01, samples=11)
    (done,) = simulate_controlled(flexible, "+-+-", [model.controllers["damp"]]).controllers
    assert (done.inputs, done.outputs, done.law) == (("root1", "A1"), ("tau1",), "rate feedback")
    damp = replace(model.controllers["damp"], law=pf.RateFeedback({"tau2": {"root1": 1.0}}))
    with pytest.raises(InputError, match=r"gains: names no active motor \(got .tau2.\); give some of tau1, tau5"):
        simulate_controlled(flexible, "+-+-", [damp])


# --- LQG --------------------------------------------------------------------------------------------------------------


def test_a_rotor_under_lqg_is_that_of_its_equations():
    """The same design from theta'' = tau / J written down, sampled by another function."""
    rotor = model_from(tomllib.loads(ROTOR + LQ), "rotor.toml")
    sim = Simulation(rotor, duration=1.0, samples=1001)
    (done,) = sim.run(rotor.controllers["lq"]).controllers
    A, B, C, D = np.array([[0.0, 1.0], [0.0, 0.0]]), np.array([[0.0], [1.0 / J]]), np.eye(1, 2), np.zeros((1, 1))
    design = pf.lqg((A, B, C, D), T, measured=["y1"], deviations={"y1": 0.01}, effort=1.0, noise=1e-4, delay=1.5e-3,
                    integrators={"y1": 0.05})  # fmt: skip
    law, torques = design.law(), []
    for y in done.readings - 0.2:
        torques.append(law.step(0, 0.0, y))
    assert done.requested == pytest.approx(np.array(torques), abs=1e-9)
    assert np.max(np.abs(done.requested)) > 1.0
    assert sim.sensors()["hub"] == pytest.approx(0.2, abs=1e-6)
    assert done.law == "LQG of 2 states"


ARM = """
name = "arm"
gravity = [0.0, -9.81]
[ground]
O = [0.0, 0.0]
[body.arm]
%s
[joint.O]
type = "revolute"
points = ["ground.O", "arm.O"]
[motor]
tau = "O"
[section.bar]
width = "20 mm"
thickness = "4 mm"
[material.aluminium]
youngs_modulus = 70e9
density = 2700.0
[assembly.up]
arm = 0.3
[assembly.off]
arm = 0.31
[controller.lq]
type = "lqg"
deviations = { O = 0.01 }
effort = 0.5
noise = 1e-2
disturbance = 0.01
period = "1 ms"
delay = "1.5 ms"
reference = { O = 0.3 }
"""
RIGID = """
type = "rigid"
mass = 2.0
inertia = 0.3
centre_of_mass = [0.4, 0.0]
points = { O = [0.0, 0.0] }
"""
BEAM = """
type = "beam"
length = 0.8
section = "bar"
material = "aluminium"
points = { O = 0.0 }
elements = 3
damping = { ratios = [0.01] }
"""


def outside(controller):
    """The same controller, outside of the compiled time loop."""
    step = controller.step
    controller.step = lambda *sample: step(*sample)
    return controller


@pytest.mark.parametrize(("body", "mass"), [(RIGID, 2.0), (BEAM, 0.8 * 0.02 * 0.004 * 2700.0)], ids=["rigid", "beam"])
@pytest.mark.parametrize("kind", ["file", "python", "outside", "slow"])
def test_lqg_holds_an_arm_in_equilibrium(body, mass, kind):
    """By m g (l/2 cos 0.3 + w sin 0.3), w the mean deflection of a beam, q l^4 / (20 EI).

    Before its first torques act, too, and where torques may hardly change.
    """
    model = model_from(tomllib.loads(ARM % body), "arm.toml")
    design = pf.lqg(pf.linearise(model, balanced=True), 1e-3, measured=["O"], deviations={"O": 0.01}, effort=0.5,
                    noise=1e-2, disturbance=0.01, delay=1.5e-3)  # fmt: skip
    chain = SampledController(design.law(), reference={"O": 0.3}, rates=1.0 if kind == "slow" else None)
    controller = model.controllers["lq"] if kind == "file" else outside(chain) if kind == "outside" else chain
    run = Simulation(model, duration=1.0, balanced=True).run(controller)
    assert np.max(np.abs(run.solution.q - run.solution.q[0])) < 1e-12
    rigid = body == RIGID
    deflection = 0.0 if rigid else mass * 9.81 * np.cos(0.3) * 0.8**3 / (20.0 * 70e9 * 0.02 * 0.004**3 / 12.0)
    lever = 0.4 * np.cos(0.3) + deflection * np.sin(0.3)
    assert run.applied[0] == pytest.approx(mass * 9.81 * lever, rel=1e-9 if rigid else 5e-4)
    assert np.ptp(run.applied) < 1e-9


def test_lqg_returns_to_a_loaded_equilibrium():
    """From 0.01 rad off; without the holding torque the arm hangs lower by what the feedback gives way."""
    model = model_from(tomllib.loads(ARM % RIGID), "arm.toml")
    settings = {"measured": ["O"], "deviations": {"O": 0.01}, "effort": 0.5, "noise": 1e-4}
    design = pf.lqg(pf.linearise(model), 1e-3, **settings)
    assert design.holding_torques == pytest.approx([2.0 * 9.81 * 0.4 * np.cos(0.3)], rel=1e-12)
    ends = {}
    for name, one in (("held", design), ("sags", replace(design, holding_torques=np.zeros(1)))):
        controller = SampledController(one.law(), reference={"O": 0.3})
        sim = Simulation(model, duration=2.0, start="off")
        ends[name] = sim.run(controller, warning=False).solution.q[-1, 2]
    assert ends["held"] == pytest.approx(0.3, abs=1e-6)
    assert ends["sags"] < 0.29


def test_planned_torques_hold_in_place_of_the_law():
    """What acts beside feed-forward, or is designed about a motion, adds nothing of its own."""
    model = model_from(tomllib.loads(ARM % RIGID), "arm.toml")
    settings = {"measured": ["O"], "deviations": {"O": 0.01}, "effort": 0.5, "noise": 1e-4}
    law = pf.lqg(pf.linearise(model), 1e-3, **settings).law()
    sim = Simulation(model, duration=0.1)
    sim.run(SampledController(law, reference={"O": 0.3}))
    assert law.holding_torques != 0.0
    law.start(replace(sim._plant(SampledController(law)), feed_forward=True))
    assert law.holding_torques == 0.0
    run = Simulation(model, duration=0.1, samples=11).run([], warning=False)
    moving = pf.lqg(pf.linearise(run, at=0.05), 1e-3, **settings)
    assert np.array_equal(moving.holding_torques, [0.0])


def test_a_run_with_a_design_goes_on_from_what_was_saved():
    """The same bits, estimate and integrals included."""
    rotor = model_from(tomllib.loads(ROTOR + LQ), "rotor.toml")
    sim, ends = Simulation(rotor, duration=0.1, samples=101), []
    sim.run(rotor.controllers["lq"], until=0.05)
    saved = sim.save()
    for _ in range(2):
        sim.restore(saved)
        ends.append(sim.run().controllers[0].requested)
    assert np.array_equal(*ends)
    assert np.array_equal(ends[0], sim.run(rotor.controllers["lq"]).controllers[0].requested)


@pytest.mark.parametrize("mode", ["++++", "+-+-"])
def test_lqg_is_designed_for_the_mode(model, task, mode):
    """By hand: the mode's motors alone, encoders of them, noise of rounding, at the start of the path."""
    one = model.controllers["lq"]
    one = replace(one, law=replace(one.law, noise={"D1": 2e-3, "A2": 2e-3}, integrators={"A1": 0.5, "D1": 0.5}))
    one.check(model.mechanism)
    run = simulate_controlled(task, mode, [one])
    (done,) = run.controllers
    joints = ANGLES if mode == "++++" else ("A1", "A2")
    assert done.inputs == joints
    resolution = {name: one for name, one in model.controllers["lq"].quantise.items() if name in joints}
    rounding = {name: pf.quantisation_noise(one) for name, one in resolution.items()}
    design = pf.lqg(
        pf.linearise(task, mode=mode, at=0.0), 1e-3, measured=joints, deviations=model.controllers["lq"].law.deviations,
        effort=1.0, noise={**rounding, "A2": 2e-3, **({"D1": 2e-3} if mode == "++++" else {})}, delay=1e-3,
        integrators={name: 0.5 for name in ("A1", "D1") if name in joints},
    )  # fmt: skip
    assert design.outputs == done.outputs
    law = SampledController(design.law(), quantise=resolution, reference="open-loop")
    by_hand = Simulation(task, mode=mode, feed_forward=True).run(law, warning=False)
    assert done.applied == pytest.approx(by_hand.controllers[0].applied, abs=1e-12)
    assert np.max(np.abs(done.applied)) > 1e-3
    assert done.law == "LQG of 4 states"


def test_lqg_of_few_states_and_another_time(model):
    """Damped links and strain gauges, about a later pose: the design of `pf.reduce` there, stable with all states."""
    links = [replace(link, damping=pf.ModalDamping([0.01])) for link in model.mechanism.bodies]
    gauges = [pf.StrainGauge(f"root{k}", body=f"link{k}", at=0.05) for k in (1, 3, 5, 7)]
    damped = replace(model.mechanism, bodies=links, sensors=gauges)
    task = model.plan(mechanism=damped, duration=0.1, samples=101)
    read = (*ANGLES, *(gauge.name for gauge in gauges))
    deviations = {"x": 0.5e-3, "y": 0.5e-3, **dict.fromkeys(ANGLES, 0.02)}
    noise = {name: 1e-3 if name in ANGLES else 3e-5 for name in read}
    law = DesignedLQG(deviations, 1.0, noise=noise, states=20, at=0.05)
    controller = ControllerDescription("lq", law, 1e-3, delay=1e-3, inputs=read).made(damped, MOTORS)
    run = Simulation(task, mode="++++", feed_forward=True).run(controller, until=0.005, warning=False)
    full = pf.linearise(task, mode="++++", at=0.05)
    design = pf.lqg(
        pf.reduce(full, 20), 1e-3, measured=read, deviations=deviations, effort=1.0, noise=noise, delay=1e-3
    )
    assert np.allclose(controller.started.design.K, design.K, rtol=0.0, atol=1e-9)
    assert controller.title == "LQG of 20 states"
    assert pf.closed_loop(full, design).stable
    assert "loop-unstable" not in [one.code for one in run.findings]


def test_a_loop_that_is_unstable_with_all_states_is_found(model):
    """Undamped links at 1 kHz: vibrations that sixteen states leave out grow (page on linear models, Traps)."""
    flexible = model.plan(duration=0.005, samples=6)
    stiff = replace(model.controllers["lq"], law=replace(model.controllers["lq"].law, noise=1e-4))
    run = simulate_controlled(flexible, "++++", [stiff])
    (found,) = [one for one in run.findings if one.code == "loop-unstable"]
    assert found.place == "mode ++++"
    assert re.search(r'controller "lq": the sampled loop is unstable about the start: \|z\| = 1\.0\d+ at', found.text)
    with warnings.catch_warnings(record=True) as said:
        warnings.simplefilter("always")
        Simulation(flexible, mode="++++", feed_forward=True).run(stiff)
    assert any(isinstance(one.message, ResultWarning) and "loop-unstable" in str(one.message) for one in said)


def test_a_disturbance_that_lasts_is_part_of_the_design(model, task):
    """At a motor and at a point, by its filter: what `pf.lqg` makes of the model with that force as an input."""
    lasting = {"link4.C.x": (0.7, 15.0), "tau1": (0.2, ((1.0,), (0.02, 1.0))), "tau2": (0.2, 5.0)}
    law = DesignedLQG({"x": 1e-3, "y": 1e-3}, 1.0, noise=1e-4, coloured=lasting)
    one = ControllerDescription("lq", law, 1e-3)
    one.check(model.mechanism)
    controller = one.made(task.mechanism, ("tau1", "tau5"))
    Simulation(task, mode="+-+-", feed_forward=True).run(controller, until=0.002, warning=False)
    design = pf.lqg(
        pf.linearise(task, mode="+-+-", at=0.0, forces=["link4.C"]), 1e-3, measured=["A1", "A2"],
        deviations={"x": 1e-3, "y": 1e-3}, effort={"tau1": 1.0, "tau5": 1.0}, noise=1e-4,
        coloured={name: each for name, each in lasting.items() if name != "tau2"},
    )  # fmt: skip
    assert np.allclose(controller.started.design.K, design.K, rtol=0.0, atol=1e-9)
    assert len(design.regulator.plant.states) == len(controller.started.design.regulator.plant.states)
    bad = DesignedLQG({"x": 1e-3}, 1.0, noise=1e-4, coloured={"link4.D.x": (1.0, 1.0)})
    with pytest.raises(InputError, match=r"controller.lq.coloured: unknown motor or point .*link4.C.x"):
        ControllerDescription("lq", bad, 1e-3).check(model.mechanism)


def test_open_loop_is_what_the_flexible_mechanism_reads(model):
    """Against it a law has no errors; against the rigid plan links that bend are one."""
    task = model.plan(duration=0.05, samples=26)
    errors = {}
    for reference in ("open-loop", "plan"):
        law = SampledController(lambda k, t, y: 0.0 * y, period=T, inputs=list(ANGLES), reference=reference)
        options = pf.IntegrationOptions(tolerance=1e-8)
        done = Simulation(task, mode="++++", feed_forward=True, options=options).run(law, warning=False).controllers[0]
        held = np.array([[read(t) for read in law.found_references] for t in done.t])
        errors[reference] = np.max(np.abs(done.readings - held))
    assert errors["open-loop"] < 0.1 * errors["plan"]
    still = Simulation(rotor(), duration=0.01, samples=11)
    law = SampledController(lambda k, t, y: y, period=T, reference="open-loop")
    with pytest.raises(InputError, match=r"reference: there is no planned motion"):
        still.run(law)


@pytest.mark.parametrize(
    ("change", "said"),
    [
        ({"quantise": {"A1": 1e-3}}, r"lq.noise: has no noise \(got .D1.\); give its standard deviation, or quantise"),
        ({"inputs": ("x",), "quantise": 1e-6, "law": DesignedLQG({"x": 1e-3, "y": 1e-3}, 1.0)},
         r"lq.measured: is not seen by the readings"),
        ({"law": DesignedLQG({"x": 1e-3, "y": 1e-3}, 1.0, at=0.3)}, r"lq.at: is not a time of the motion"),
    ],
)  # fmt: skip
def test_what_a_design_cannot_do(model, task, change, said):
    with pytest.raises(InputError, match=said):
        simulate_controlled(task, "++++", [replace(model.controllers["lq"], **change)])


def test_a_time_is_of_a_plan():
    rotor = model_from(tomllib.loads(ROTOR + LQ.replace("period", "at = 0.1\nperiod", 1)), "rotor.toml")
    with pytest.raises(InputError, match=r"lq.at: there is no planned motion"):
        Simulation(rotor, duration=0.01, samples=11).run(rotor.controllers["lq"])


def test_a_design_is_for_the_motors_that_it_drives(model, task):
    """Two of the mode's four: those of another mode, and the same by their efforts."""
    few = replace(model.controllers["lq"], outputs=("tau1", "tau5"))
    named = replace(model.controllers["lq"], law=replace(few.law, effort={"tau1": 1.0, "tau5": 1.0}))
    runs = [simulate_controlled(task, "++++", [one]).controllers[0] for one in (few, named)]
    design = pf.lqg(
        pf.linearise(task, mode="+-+-", at=0.0), 1e-3, measured=["A1", "A2"], deviations=few.law.deviations, effort=1.0,
        noise=pf.quantisation_noise(1e-3), delay=1e-3,
    )  # fmt: skip
    law = SampledController(design.law(), quantise=1e-3, reference="open-loop")
    by_hand = Simulation(task, mode="++++", feed_forward=True).run(law, warning=False).controllers[0]
    for done in runs:
        assert done.outputs == ("tau1", "tau5")
        assert done.applied == pytest.approx(by_hand.applied, abs=1e-12)


def test_a_design_in_python_starts_anew(task):
    """Started for one mode, then another."""
    controller = SampledController(DesignedLQG({"x": 1e-3, "y": 1e-3}, 1.0, noise=1e-4), period=T)
    for mode, motors in (("+-+-", ("tau1", "tau5")), ("++++", MOTORS)):
        run = Simulation(task, mode=mode, feed_forward=True).run(controller, warning=False)
        assert run.controllers[0].outputs == controller.started.design.outputs == motors


# --- Runs, sweeps -----------------------------------------------------------------------------------------------------


def test_run_and_summary(file, tmp_path):
    short = ("--duration", "0.02", "--samples", "21", "--rigid", "--mode", "++++", "--mode", "+-+-", "--no-report")
    for name, law in (("ct", "computed torque"), ("lq", "LQG of 4 states")):
        ran = paraflex("run", "--no-figures", file, "--controller", name, *short, "--out", tmp_path / name)
        assert ran.returncode == 0, ran.stderr
        assert law in ran.stdout
        modes = json.loads((tmp_path / name / "summary.json").read_text())["modes"]
        assert {one["controllers"][name]["law"] for one in modes.values()} == {law}
    data = pf.open_results(tmp_path / "ct")
    model = pf.load(file)
    task = model.plan(mechanism=model.mechanism.rigid(), duration=0.02, samples=21)
    run = Simulation(task, mode="++++", options=model.study.integration()).run(model.controllers["ct"], warning=False)
    assert np.array_equal(data["torque"].sel(mode="++++"), run.applied)


def test_run_names_the_file(file, tmp_path):
    file.write_text(ROBOT.replace("quantise = { A1 = 1e-3, ", "quantise = { "), encoding="utf-8")
    ran = paraflex("run", file, "--controller", "lq", "--rigid", "--mode", "++++", "--out", tmp_path / "out")
    assert ran.returncode == 2
    assert re.search(r"robot.toml: controller.lq.noise: has no noise \(got .A1.\)", ran.stderr), ran.stderr
    assert not (tmp_path / "out").exists()


SWEEP = """
mechanism = "robot.toml"
duration = 0.01
samples = 11
modes = ["++++"]
metrics = ["tracking_rms_motion"]
set = { "study.controllers" = ["lq"] }
[vary.effort]
fields = ["controller.lq.effort"]
values = [1.0, "2 N m"]
[vary.period]
fields = ["controller.lq.period"]
values = ["1 ms", "2 ms"]
"""


def test_sweeps_vary_what_a_design_is_made_of(file, tmp_path):
    (tmp_path / "sweep.toml").write_text(SWEEP)
    ran = paraflex("sweep", tmp_path / "sweep.toml", "--output", tmp_path / "out", "--engine", "threads")
    assert ran.returncode == 0, ran.stderr
    table = pd.read_parquet(tmp_path / "out" / "results.parquet")
    assert (table["status"] == "complete").all(), table["reason"].unique()
    assert table["tracking_rms_motion"].nunique() == 4


# --- Shaped torques ---------------------------------------------------------------------------------------------------

SHAPED = (
    LIBRARY.replace("[study]", '[study]\nshaper = { type = "zvd", frequencies = [51.4, 60.9] }')
    .replace('path = "square"', 'path = "short"')
    .replace("duration = 0.7", "duration = 0.5")
    + '\n[path.short]\ntype = "line"\nstart = [-0.04, 0.264]\nend = [0.04, 0.264]\nmax_acceleration = 20.0\n'
)


def vibration(model):
    run = model.plan().simulate("++++", options=pf.IntegrationOptions(tolerance=1e-7))
    return pf.tracking_dataset([run])["residual_vibration"].item()


def test_a_study_shapes_planned_torques():
    shaped = model_from(tomllib.loads(SHAPED), "robot.toml")
    plain = replace(shaped, study=replace(shaped.study, shaper=None))
    assert shaped.study.shaper == pf.shaper("zvd", [51.4, 60.9])
    by_hand = pf.shape_torques(plain.plan(), shaped.study.shaper)
    t = by_hand.motion.t
    assert np.array_equal(shaped.plan().torques("++++").evaluate(t), by_hand.torques("++++").evaluate(t))
    # The same line unshaped leaves 5 um (page "Input shaping").
    assert vibration(shaped) < 0.02 * vibration(plain)


def test_controllers_act_beside_shaped_torques():
    model = model_from(tomllib.loads(SHAPED), "robot.toml")
    task = model.plan(mechanism=model.mechanism.rigid(), samples=101)
    run = simulate_controlled(task, "++++", [ControllerDescription("pd", pf.JointPID(5.0), 1e-3)])
    reached = run.solution.t
    assert run.torques.evaluate(reached) == pytest.approx(task.torques("++++").evaluate(reached), abs=1e-12)
    assert np.max(np.abs(run.controllers[0].applied)) < 0.01 * np.max(np.abs(run.applied))


def test_without_a_duration_shaped_torques_have_their_time():
    model = model_from(tomllib.loads(SHAPED.replace("duration = 0.5", "")), "robot.toml")
    path = model.paths["short"]
    assert model.duration("short") == path.duration + model.study.shaper.duration
    assert float(model.plan(mechanism=model.mechanism.rigid()).motion.t[-1]) == model.duration("short")


def test_shapers_of_studies_are_written(tmp_path):
    (tmp_path / "robot.toml").write_text(SHAPED, encoding="utf-8")
    model = pf.load(tmp_path / "robot.toml")
    model.save(tmp_path / "same.toml")
    assert (tmp_path / "same.toml").read_text().strip() == SHAPED.strip()
    other = replace(model, study=replace(model.study, shaper=pf.shaper("ei", 50.0, 0.01, 0.1)))
    other.save(tmp_path / "changed.toml")
    assert pf.load(tmp_path / "changed.toml").study == other.study
    replace(other, parameters={}, text="", source="").save(tmp_path / "new.toml")
    assert pf.load(tmp_path / "new.toml").study == other.study
    assert pf.load(tmp_path / "robot.toml", set={"study.shaper.type": "zv"}).study.shaper == pf.shaper(
        "zv", [51.4, 60.9]
    )


def test_what_a_study_cannot_shape(tmp_path):
    with pytest.raises(InputError, match=r"robot.toml: study.shaper.frequencies: must be positive"):
        model_from(tomllib.loads(SHAPED.replace("51.4", "-51.4")), "robot.toml")
    with pytest.raises(InputError, match=r'study.shaper: should be a table .*\{ type = "zvd", frequencies = '):
        model_from(tomllib.loads(ROTOR + '[study]\nshaper = "zv"\n'), "rotor.toml")
    rotor = ROTOR + '[study]\nshaper = { type = "zv", frequencies = 5.0 }\n'
    with pytest.raises(InputError, match=r"study.shaper: is for torques planned along a path, and the model has none"):
        model_from(tomllib.loads(rotor), "rotor.toml")
    with pytest.raises(InputError, match=r"study.shaper: derivatives need runs whose torques are not shaped"):
        check_open_and_whole(model_from(tomllib.loads(SHAPED), "robot.toml"))
    (tmp_path / "robot.toml").write_text(SHAPED, encoding="utf-8")
    ran = paraflex("run", tmp_path / "robot.toml", "--duration", "0.17", "--rigid", "--out", tmp_path / "out")
    assert ran.returncode == 2
    assert re.search(r"--duration: the run ends before the shaped torques do .*at least 0\.204", ran.stderr), ran.stderr
