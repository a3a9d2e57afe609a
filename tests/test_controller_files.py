"""Controllers in model files: read, refused, written; in runs, studies and reports."""

import tomllib
from dataclasses import replace

import numpy as np
import pytest

import paraflex as pf
from paraflex import Simulation
from paraflex.control.described import LAWS, ControllerDescription, PIDDescription
from paraflex.errors import InputError
from paraflex.files import model_from
from paraflex.files.schema import model_schema
from rotors import ROTOR, rotor
from test_simulation import AT_20_MS, pd

START = """
[start.coordinates]
rotor = { x = 0.0, y = 0.0, phi = 1.0 }
[start.rates]
rotor = { x = 0.0, y = 0.0, phi = 0.0 }
"""
STATE_SPACE = """
[controller.pd]
type = "state-space"
D = [[-40.0, -1.2]]
period = 1e-3
inputs = ["hub", "rate"]
"""
PID = """
[parameters]
w = 2.0
[controller.joint]
type = "pid"
stiffness = "40 N m/rad"
damping = { tau = 1.2 }
cutoff = 200.0
period = "1 ms"
delay = 0.5e-3
reference = { hub = "0.2 * sin(w * t)" }
limits = [-20.0, 30.0]
rates = { tau = "5e4 N m/s" }
quantise = 1e-5
filters = { hub = [[1.0], [1e-3, 1.0]] }
"""


def read(text, **more):
    return model_from(tomllib.loads(ROTOR + START + text), "rotor.toml", **more)


# --- Files ------------------------------------------------------------------------------------------------------------


def test_every_kind_of_law_has_a_table():
    tables = model_schema()["properties"]["controller"]["additionalProperties"]["discriminator"]["mapping"]
    assert set(tables) == set(LAWS)


def test_a_state_space_controller_is_the_law():
    model = read(STATE_SPACE)
    sim = Simulation(model, duration=0.02, samples=21)
    sim.run(model.controllers["pd"])
    reached = sim.sensors()
    assert [reached["hub"], reached["rate"]] == pytest.approx(AT_20_MS[0.0], abs=1e-7)


def test_a_pid_controller_is_what_it_says():
    model = read(PID)
    one = model.controllers["joint"]
    assert one.law == PIDDescription(40.0, {"tau": 1.2}, cutoff=200.0)
    assert (one.period, one.delay, one.limits, one.rates) == (1e-3, 0.5e-3, [-20.0, 30.0], {"tau": 5e4})
    run = Simulation(model, duration=0.01, samples=11).run(one)
    (done,) = run.controllers
    assert done.limits.tolist() == [[-20.0, 30.0]]
    assert done.rates.tolist() == [5e4]
    # The first sample: the angle is 1 as the filter is settled, its reference is zero, and no rate is known.
    assert done.wanted[0] == pytest.approx([-40.0], abs=1e-12)
    assert done.given[0].tolist() == [-20.0]
    assert done.readings[0] == pytest.approx([1.0], abs=1e-12)


def test_references_are_functions_of_time():
    model = read(PID)
    held = replace(model.controllers["joint"], delay=0.0, filters={}, limits=None, rates=None, quantise=None,
                   law=PIDDescription(40.0))  # fmt: skip
    (done,) = Simulation(model, duration=0.01, samples=11).run(held).controllers
    assert done.wanted[:, 0] == pytest.approx(-40.0 * (done.readings[:, 0] - 0.2 * np.sin(2.0 * done.t)), abs=1e-12)


@pytest.mark.parametrize("text", [STATE_SPACE, PID])
def test_files_are_written_and_read_again(text, tmp_path):
    whole = ROTOR + START + text + '[study]\ncontrollers = ["' + ("pd" if "pd" in text else "joint") + '"]\n'
    (tmp_path / "model.toml").write_text(whole)
    model = pf.load(tmp_path / "model.toml")
    model.save(tmp_path / "same.toml")
    assert (tmp_path / "same.toml").read_text().strip() == whole.strip()
    bare = replace(model, parameters={}, text="", source="")
    bare.save(tmp_path / "new.toml")
    again = pf.load(tmp_path / "new.toml")
    assert again.controllers == model.controllers
    assert again.study.controllers == model.study.controllers


def test_a_controller_changed_in_python_is_written(tmp_path):
    (tmp_path / "model.toml").write_text(ROTOR + START + PID)
    model = pf.load(tmp_path / "model.toml")
    one = replace(model.controllers["joint"], period=2e-3)
    other = ControllerDescription("other", PIDDescription(1.0), 1e-3, reference={"hub": 0.5})
    replace(model, controllers={"joint": one, "other": other}).save(tmp_path / "new.toml")
    text = (tmp_path / "new.toml").read_text()
    assert 'stiffness = "40 N m/rad"' in text
    assert pf.load(tmp_path / "new.toml").controllers == {"joint": one, "other": other}


@pytest.mark.parametrize(
    ("old", "new", "said"),
    [
        ('inputs = ["hub", "rate"]', 'inputs = ["hup", "rate"]',
         r'rotor.toml: controller.pd.inputs: unknown sensor \(got .hup.\); did you mean "hub"'),
        ("period = 1e-3", 'period = 1e-3\noutputs = ["tao"]', r'controller.pd.outputs: unknown motor \(got .tao.\)'),
        ("period = 1e-3", "period = -1e-3", r"controller.pd.period: must be positive"),
        ("period = 1e-3", "", r"controller.pd.period: .*(missing|needed)"),
        ("period = 1e-3", 'period = "1 mm"', r"controller.pd.period: a quantity in m where one in s"),
        ("period = 1e-3", "period = 1e-3\nlimits = { tao = 1.0 }", r"controller.pd.limits: unknown name"),
        ("period = 1e-3", "period = 1e-3\nlimits = [2.0, 1.0]", r"controller.pd.limits: the lowest must be below"),
        ("period = 1e-3", "period = 1e-3\nrates = 0.0", r"controller.pd.rates: must be positive"),
        ("period = 1e-3", "period = 1e-3\nquantise = { rat = 1.0 }", r"controller.pd.quantise: unknown"),
        ("period = 1e-3", "period = 1e-3\nfilters = { hub = [[1.0], [1.0]] }", r"pd.filters.hub: is no filter"),
        ("period = 1e-3", 'period = 1e-3\nreference = { hup = 1.0 }', r"controller.pd.reference: unknown sensor"),
        ("period = 1e-3", 'period = 1e-3\nreference = { hub = "2 * s" }', r"controller.pd.reference.hub: "),
        ("D = [[-40.0, -1.2]]", "D = [[-40.0]]", r"controller.pd.inputs: the model has 1"),
        ("D = [[-40.0, -1.2]]", "D = [[-40.0, -1.2], [1.0]]", r"controller.pd.D: is no matrix"),
        ("D = [[-40.0, -1.2]]", "D = [[-40.0, -1.2]]\nA = [[1.0]]", r"controller.pd.B: has 0, not 1 x 2"),
        ('"state-space"', '"lqg"', r"controller.pd.type"),
        ("[controller.pd]", "[controller.none]", r"controller.none: is the word for no controller"),
        ("[controller.pd]", '[controller."a.b"]', r"controller: is no name of a controller"),
    ],
)  # fmt: skip
def test_what_files_cannot_say(old, new, said):
    assert old in STATE_SPACE
    with pytest.raises(InputError, match=said):
        read(STATE_SPACE.replace(old, new))


@pytest.mark.parametrize(
    ("old", "new", "said"),
    [
        ("damping = { tau = 1.2 }", "damping = { tao = 1.2 }", r"joint.damping: unknown motor \(got .tao.\)"),
        ("damping = { tau = 1.2 }", "damping = -1.0", r"controller.joint.damping: no gains"),
        ("cutoff = 200.0", "cutoff = 0.0", r"controller.joint.cutoff: must be positive"),
        ('"40 N m/rad"', '"40 N m"', r"controller.joint.stiffness: a quantity in N m"),
        ("cutoff = 200.0", 'outputs = ["tau"]\ninputs = ["hub", "rate"]',
         r"controller.joint.inputs: 2 readings for 1 motors"),
    ],
)  # fmt: skip
def test_what_pid_tables_cannot_say(old, new, said):
    assert old in PID
    with pytest.raises(InputError, match=said):
        read(PID.replace(old, new))


def test_studies_name_controllers_with_periods_that_fit():
    more = STATE_SPACE.replace("pd", "slow").replace("1e-3", "1.5e-3")
    with pytest.raises(InputError, match=r"controller.slow.period: is no multiple .* say 0.002"):
        read(STATE_SPACE + more + '[study]\ncontrollers = ["pd", "slow"]\n')
    with pytest.raises(InputError, match=r"study.controllers: unknown controller \(got .pid.\)"):
        read(STATE_SPACE + '[study]\ncontrollers = ["pid"]\n')
    model = read(STATE_SPACE + '[study]\ncontrollers = ["pd"]\n')
    assert [one.name for one in model.acting()] == ["pd"]
    assert model.acting(["none"]) == ()


def test_what_is_given_by_motor_is_used_of_those_of_a_mode():
    model = pf.load("raparm_i")
    motors = [motor.name for motor in model.mechanism.motors]
    one = ControllerDescription("pd", PIDDescription(dict.fromkeys(motors, 60.0)), 1e-3,
                                limits=dict.fromkeys(motors, 5.0))  # fmt: skip
    one.check(model.mechanism)
    task = pf.plan(model.mechanism.rigid(), model.paths["square"], duration=0.01, samples=11)
    (done,) = Simulation(task, mode="tau1,tau5").run(one).controllers
    assert done.outputs == ("tau1", "tau5")
    assert done.limits.tolist() == [[-5.0, 5.0]] * 2


def test_the_same_as_a_law_in_python():
    by_file, by_hand = Simulation(rotor(), duration=0.02, samples=21), Simulation(rotor(), duration=0.02, samples=21)
    file, hand = by_file.run(read(STATE_SPACE).controllers["pd"]), by_hand.run(pd())
    assert np.allclose(file.controllers[0].given, hand.controllers[0].given, rtol=1e-12)
