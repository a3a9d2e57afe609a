"""Controllers in model files: read, refused, written; in runs, studies and reports."""

import json
import re
import tomllib
from dataclasses import replace
from pathlib import Path

import numpy as np
import pandas as pd
import pytest

import paraflex as pf
from paraflex.cli.repeated import repeated_runs
from paraflex.control import ControllerDescription, Simulation, simulate_controlled
from paraflex.control.laws.kinds import LAWS
from paraflex.designs.derivatives.plans import check_open_and_whole
from paraflex.designs.measure import measure
from paraflex.errors import InputError
from paraflex.files import model_from
from paraflex.files.schema import model_schema
from paraflex.plots.planned import figures_of
from paraflex.plots.sources import open_source
from paraflex.reports.provenance import asked, command_line
from paraflex.results.controllers import controllers_of
from paraflex.studies.tracking import TrackingStudy
from rotors import ROTOR, rotor
from shell import paraflex
from test_simulation import AT_20_MS, pd as pd_law

LIBRARY = (Path(pf.__file__).parent / "mechanism" / "library" / "raparm_i.toml").read_text(encoding="utf-8")

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
    assert one.law == pf.JointPID(40.0, {"tau": 1.2}, cutoff=200.0)
    assert (one.period, one.delay, one.limits, one.rates) == (1e-3, 0.5e-3, [-20.0, 30.0], {"tau": 5e4})
    run = Simulation(model, duration=0.01, samples=11).run(one)
    (done,) = run.controllers
    assert done.limits.tolist() == [[-20.0, 30.0]]
    assert done.rates.tolist() == [5e4]
    # The first sample: the angle is 1 as the filter is settled, its reference is zero, and no rate is known.
    assert done.requested[0] == pytest.approx([-40.0], abs=1e-12)
    assert done.applied[0].tolist() == [-20.0]
    assert done.readings[0] == pytest.approx([1.0], abs=1e-12)


def test_references_are_functions_of_time():
    model = read(PID)
    held = replace(model.controllers["joint"], delay=0.0, filters={}, limits=None, rates=None, quantise=None,
                   law=pf.JointPID(40.0))  # fmt: skip
    (done,) = Simulation(model, duration=0.01, samples=11).run(held).controllers
    assert done.requested[:, 0] == pytest.approx(-40.0 * (done.readings[:, 0] - 0.2 * np.sin(2.0 * done.t)), abs=1e-12)


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
    other = ControllerDescription("other", pf.JointPID(1.0), 1e-3, reference={"hub": 0.5})
    replace(model, controllers={"joint": one, "other": other}).save(tmp_path / "new.toml")
    text = (tmp_path / "new.toml").read_text()
    assert 'stiffness = "40 N m/rad"' in text
    assert pf.load(tmp_path / "new.toml").controllers == {"joint": one, "other": other}


def test_laws_that_files_do_not_have_are_not_written(tmp_path):
    class Mine(pf.JointPID):
        """A law of a user, which has no table."""

    model = read(PID)
    for law, said in (
        (Mine(1.0), r"controller.one.law: a model file cannot express this \(got 'Mine'\); give a law of type"),
        (pf.JointPID([1.0]), r"controller.one.stiffness: a model file cannot express this .*numbers by name"),
    ):
        one = ControllerDescription("one", law, 1e-3)
        with pytest.raises(InputError, match=said):
            replace(model, controllers={"one": one}).save(tmp_path / "new.toml")


@pytest.mark.parametrize(
    ("old", "new", "said"),
    [
        ('inputs = ["hub", "rate"]', 'inputs = ["hup", "rate"]',
         r'rotor.toml: controller.pd.inputs: unknown sensor \(got .hup.\); did you mean "hub"'),
        ("period = 1e-3", 'period = 1e-3\noutputs = ["tao"]', r'controller.pd.outputs: unknown motor \(got .tao.\)'),
        ("period = 1e-3", "period = -1e-3", r"controller.pd.period: must be positive"),
        ("period = 1e-3", "", r"controller.pd.period: .*(missing|needed)"),
        ("period = 1e-3", 'period = "1 mm"', r"controller.pd.period: a quantity in m where one in s"),
        ("period = 1e-3", "period = 1e-3\nlimits = { tao = 1.0 }", r"controller.pd.limits: unknown motor"),
        ("period = 1e-3", "period = 1e-3\nlimits = [2.0, 1.0]", r"controller.pd.limits: the lowest must be below"),
        ("period = 1e-3", "period = 1e-3\nrates = 0.0", r"controller.pd.rates: must be positive"),
        ("period = 1e-3", "period = 1e-3\nquantise = { rat = 1.0 }", r"controller.pd.quantise: unknown"),
        ("period = 1e-3", "period = 1e-3\nfilters = { hub = [[1.0], [1.0]] }", r"pd.filters.hub: is not a filter"),
        ("period = 1e-3", 'period = 1e-3\nreference = { hup = 1.0 }', r"controller.pd.reference: unknown sensor"),
        ("period = 1e-3", 'period = 1e-3\nreference = { hub = "2 * s" }', r"controller.pd.reference.hub: "),
        ("period = 1e-3", "period = 1e-3\ndelay = -1e-3", r"controller.pd.delay: must not be negative"),
        ('["hub", "rate"]', '["hub", "hub"]', r"controller.pd.inputs: is named twice \(got .hub.\)"),
        ("D = [[-40.0, -1.2]]", "D = [[-40.0]]", r"controller.pd.inputs: the model has 1"),
        ("D = [[-40.0, -1.2]]", "D = [[-40.0, -1.2], [1.0]]", r"controller.pd.D: is not a matrix"),
        ("D = [[-40.0, -1.2]]", "D = [[-40.0, -1.2]]\nA = [[1.0]]", r"controller.pd.B: has 0, not 1 x 2"),
        ('"state-space"', '"lqr"', r"controller.pd.type"),
        ("[controller.pd]", "[controller.none]", r"controller.none: is reserved for open loop"),
        ("[controller.pd]", '[controller."a.b"]', r"controller: is not a name for a controller"),
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
        ("damping = { tau = 1.2 }", "damping = -1.0", r"controller.joint.damping: must not be negative"),
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
    with pytest.raises(InputError, match=r"controller.slow.period: is not a multiple .* give 0.002"):
        read(STATE_SPACE + more + '[study]\ncontrollers = ["pd", "slow"]\n')
    with pytest.raises(InputError, match=r"study.controllers: unknown controller \(got .pid.\)"):
        read(STATE_SPACE + '[study]\ncontrollers = ["pid"]\n')
    model = read(STATE_SPACE + '[study]\ncontrollers = ["pd"]\n')
    assert [one.name for one in model.acting()] == ["pd"]
    assert model.acting(["none"]) == ()


def test_what_is_given_by_motor_is_used_of_those_of_a_mode():
    model = pf.load("raparm_i")
    motors = [motor.name for motor in model.mechanism.motors]
    one = ControllerDescription("pd", pf.JointPID(dict.fromkeys(motors, 60.0)), 1e-3,
                                limits=dict.fromkeys(motors, 5.0))  # fmt: skip
    one.check(model.mechanism)
    task = pf.plan(model.mechanism.rigid(), model.paths["square"], duration=0.01, samples=11)
    (done,) = Simulation(task, mode="tau1,tau5").run(one).controllers
    assert done.outputs == ("tau1", "tau5")
    assert done.limits.tolist() == [[-5.0, 5.0]] * 2


def test_the_same_as_a_law_in_python():
    by_file, by_hand = Simulation(rotor(), duration=0.02, samples=21), Simulation(rotor(), duration=0.02, samples=21)
    file, hand = by_file.run(read(STATE_SPACE).controllers["pd"]), by_hand.run(pd_law())
    assert np.allclose(file.controllers[0].applied, hand.controllers[0].applied, rtol=1e-12)


# --- Runs and studies -------------------------------------------------------------------------------------------------

# Rigid: a run of 20 ms takes a moment.
ROBOT = (
    LIBRARY
    + """
[controller.pd]
type = "pid"
stiffness = 60.0
damping = 0.5
period = 1e-3
limits = 3.0

[controller.brake]
type = "state-space"
D = [[-0.2]]
inputs = ["A1"]
outputs = ["tau1"]
period = 2e-3
delay = 1e-3
"""
)
SHORT = ("--duration", "0.02", "--samples", "21", "--rigid", "--mode", "++++", "--no-report")


@pytest.fixture
def robot(tmp_path):
    file = tmp_path / "robot.toml"
    file.write_text(ROBOT, encoding="utf-8")
    return file


def told(folder):
    return json.loads((folder / "summary.json").read_text())["modes"]["++++"]


def test_run_takes_controllers(robot, tmp_path):
    both = ("--controller", "pd", "--controller", "brake")
    ran = paraflex("run", "--no-figures", robot, *both, *SHORT, "--out", tmp_path / "out")
    assert ran.returncode == 0, ran.stderr
    assert "PID of joints" in ran.stdout
    model, data = pf.load(robot), pf.open_results(tmp_path / "out")
    task = model.plan(mechanism=model.mechanism.rigid(), duration=0.02, samples=21)
    options = model.study.integration()
    run = Simulation(task, mode="++++", feed_forward=True, options=options).run(
        [model.controllers["pd"], model.controllers["brake"]]
    )
    assert np.array_equal(data["given_torque_pd"][0], run.controllers[0].applied)
    assert np.array_equal(data["torque"][0], run.applied)
    assert set(told(tmp_path / "out")["controllers"]) == {"pd", "brake"}
    # The figures that a run writes; they are drawn below.
    assert "controllers" in {figure.written_as for figure in figures_of(open_source(tmp_path / "out"))}
    assert command_line(asked(data)).count("--controller") == 2


def test_the_study_names_controllers_and_none_is_none_of_them(robot, tmp_path):
    text = ROBOT.replace("[study]", '[study]\ncontrollers = ["pd"]')
    robot.write_text(text, encoding="utf-8")
    assert paraflex("run", "--no-figures", robot, *SHORT, "--out", tmp_path / "study").returncode == 0
    assert (
        paraflex("run", "--no-figures", robot, *SHORT, "--controller", "none", "--out", tmp_path / "none").returncode
        == 0
    )
    assert list(told(tmp_path / "study")["controllers"]) == ["pd"]
    assert "controllers" not in told(tmp_path / "none")
    assert "--controller none" in command_line(asked(pf.open_results(tmp_path / "none")))
    # Linearised along a run it is made again, under its controllers.
    _, runs = repeated_runs(str(tmp_path / "study"))
    (run,) = runs
    assert np.array_equal(run.controllers[0].applied, pf.open_results(tmp_path / "study")["given_torque_pd"][0])


@pytest.mark.parametrize(
    ("arguments", "said"),
    [
        (["--controller", "pid"], r"--controller: unknown controller \(got .pid.\); did you mean"),
        (
            ["--controller", "none", "--controller", "pd"],
            "--controller: cannot be combined with others .*give it alone",
        ),
        (["--controller", "pd", "--ked"], "--controller: has no effect with --ked"),
        (["--controller", "pd", "--after", "hold", "--duration", "0.6"], "--after: brakes are not for motors under"),
        (
            ["--controller", "pd", "--method", "rk45"],
            "--method: continues from time to time with paraflex's own methods only",
        ),
        (["--controller", "brake", "--mode", "-+-+"], r"robot.toml: controller.brake.outputs: unknown motor"),
    ],
)
def test_what_run_refuses(robot, tmp_path, arguments, said):
    rest = [] if "--ked" in arguments else ["--rigid"]
    ran = paraflex("run", robot, *arguments, *rest, "--samples", "21", "--out", tmp_path / "out")
    assert ran.returncode == 2, ran.stderr
    assert re.search(said, ran.stderr), ran.stderr


def test_run_without_a_path(tmp_path):
    (tmp_path / "rotor.toml").write_text(ROTOR + START + STATE_SPACE + "[study]\nduration = 0.02\n")
    ran = paraflex("run", tmp_path / "rotor.toml", "--controller", "pd", "--out", tmp_path / "out", "--json")
    assert ran.returncode == 0, ran.stderr
    one = json.loads(ran.stdout)["controllers"]["pd"]
    assert (one["samples"], one["torques"]["tau"]["wanted_max"]) == (20, 40.0)
    page = (tmp_path / "out" / "report.html").read_text()
    assert "Controller pd: torques" in page
    assert "controllers.png" in {file.name for file in (tmp_path / "out" / "figures").iterdir()}


def test_a_run_that_a_controller_ends_keeps_what_there_is(tmp_path):
    """Gains far beyond the limit of stability grow without bound."""
    law = STATE_SPACE.replace("-40.0, -1.2", "-1e18, -1e18")
    (tmp_path / "rotor.toml").write_text(ROTOR + START + law + "[study]\nduration = 0.02\n")
    ran = paraflex("run", tmp_path / "rotor.toml", "--controller", "pd", "--out", tmp_path / "out", "--no-report")
    assert ran.returncode == 1, ran.stderr
    assert pf.open_results(tmp_path / "out")["status"].item() == "failed"


def test_interrupted_runs_keep_what_there_is(robot):
    model = pf.load(robot)
    task = model.plan(mechanism=model.mechanism.rigid(), duration=0.7, samples=21)

    def until(progress):
        if progress.done > 0.1:
            raise KeyboardInterrupt

    study = TrackingStudy(task, ["++++"], controllers=model.acting(["pd"]))
    result = study.run(on_progress=until)
    assert result.data is not None
    assert result.data["status"].item() == "interrupted"
    assert 0 < controllers_of(result.data)[0].data.sizes["sample"] < 700


SWEEP = """
mechanism = "robot.toml"
duration = 0.02
samples = 21
modes = ["++++"]
metrics = ["tracking_rms_motion", "saturated_share", "internal_torque_max", "settling_time", "overshoot"]
set = { "study.controllers" = ["pd"] }
[vary.stiffness]
fields = ["controller.pd.stiffness"]
values = [20.0, "60 N m/rad"]
[vary.period]
fields = ["controller.pd.period"]
values = ["1 ms", "2 ms"]
[vary.delay]
fields = ["controller.pd.delay"]
values = [0.0, 1e-3]
"""


def test_sweeps_vary_gains_periods_and_delays(robot, tmp_path):
    robot.write_text(ROBOT.replace("damping = 0.5", "damping = 0.5\ndelay = 0.0"), encoding="utf-8")
    (tmp_path / "sweep.toml").write_text(SWEEP)
    ran = paraflex("sweep", tmp_path / "sweep.toml", "--output", tmp_path / "out", "--engine", "threads")
    assert ran.returncode == 0, ran.stderr
    table = pd.read_parquet(tmp_path / "out" / "results.parquet")
    assert len(table) == 8
    assert (table["status"] == "complete").all(), table["reason"].unique()
    assert table["tracking_rms_motion"].nunique() == 8
    model = pf.load(
        robot, set={"controller.pd.stiffness": 20.0, "controller.pd.period": 2e-3, "controller.pd.delay": 1e-3}
    )
    run = simulate_controlled(model.plan(duration=0.02, samples=21), "++++", [model.controllers["pd"]],
                              options=model.study.integration())  # fmt: skip
    row = table[(table["stiffness"] == 20.0) & (table["period"] == 2e-3) & (table["delay"] == 1e-3)].iloc[0]
    assert row["tracking_rms_motion"] == measure(run, ["tracking_rms_motion"])["tracking_rms_motion"]


def test_derivatives_are_of_runs_without_controllers(robot):
    with pytest.raises(InputError, match=r"study.controllers: .*derivatives need runs without controllers"):
        check_open_and_whole(pf.load(robot, set={"study.controllers": ["pd"]}))
