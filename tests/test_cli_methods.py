"""Methods, steps, constraints and events on the command line and in a model's [study]."""

import json
import math

import numpy as np
import pytest

from paraflex.cli.commands.runs import RunRequest
from paraflex.cli.integration import integration_options
from paraflex.cli.stops import parse_event
from paraflex.errors import InputError
from paraflex.files import StudyDefaults, library_text, load
from paraflex.integrators import METHODS, DeflectionLimit, JointLimit, SingularDistance
from paraflex.results import load_results
from shell import paraflex


@pytest.mark.parametrize(
    ("text", "event"),
    [
        ("joint:A1=0.1..1.4", JointLimit("A1", 0.1, 1.4)),
        ("joint:A1=..-1e-1", JointLimit("A1", high=-0.1)),
        ("joint:A1=-.5..", JointLimit("A1", low=-0.5)),
        ("deflection:link1=0.002", DeflectionLimit("link1", 0.002)),
        ("joint:A1=-30 deg..0.25 rev", JointLimit("A1", -math.pi / 6, math.pi / 2)),
        ("joint:rail=..80 mm", JointLimit("rail", high=0.08)),
        ("deflection:link1=1.1 mm", DeflectionLimit("link1", 0.0011)),
        ("singular=0.05", SingularDistance(0.05)),
        ("singular:tau1,tau5=0.05", SingularDistance(0.05, ("tau1", "tau5"))),
    ],
)
def test_events_are_read(text, event):
    assert parse_event(text) == event


@pytest.mark.parametrize(
    ("request_", "says"),
    [
        ({"method": "trbdf2"}, '--method: unknown method .*did you mean "tr-bdf2"'),
        ({"method": "newmark", "parameters": ["gamma=0.2"]}, "--method-parameter: outside the range .*got 'gamma=0.2'"),
        ({"method": "newmark", "parameters": ["gam=0.6"]}, '--method-parameter: .*did you mean "gamma"'),
        ({"parameters": ["gamma=0.6"]}, "--method-parameter: no parameter of esdirk5 .*none to choose from"),
        ({"parameters": ["gamma"]}, "--method-parameter: not NAME=VALUE"),
        ({"parameters": ["gamma=x"]}, '--method-parameter: "x" is not a number'),
        ({"method": "radau", "step": 1e-4}, "--step: radau chooses its steps itself"),
        ({"step": -1.0}, "--step: must be positive"),
        ({"constraints": "gll"}, '--constraints: .*did you mean "ggl"'),
        (
            {"method": "newmark", "constraints": "ggl"},
            "--constraints: newmark cannot keep the constraints in this way .*position",
        ),
        ({"constraints": "ggl", "automatic_gains": True}, "--automatic-gains: .*choose --constraints baumgarte"),
        ({"automatic_gains": True, "alpha": 3.0}, "--alpha: has no effect with --automatic-gains"),
        ({"constraints": "ggl", "beta": 3.0}, "--beta: has no effect where ggl keeps the constraints"),
        ({"stop_at": ["speed=1"]}, "--stop-at: not an event .*write joint:NAME=LOW..HIGH"),
        ({"stop_at": ["joint:A1"]}, "--stop-at: not an event"),
        ({"stop_at": ["joint=0..1"]}, "--stop-at: not an event"),
        ({"stop_at": ["joint:A1=1"]}, "--stop-at: not a range"),
        ({"stop_at": ["joint:A1=.."]}, "--stop-at: not a range"),
        ({"stop_at": ["joint:A1=a..1"]}, '--stop-at: "a" is not a number'),
        (
            {"stop_at": ["joint:A1=2..1"]},
            "--stop-at: the lower limit is not below the upper one, or both are missing .*got 'joint:A1=2..1'",
        ),
        ({"stop_at": ["deflection:link1=nan"]}, "--stop-at: .*not a number"),
        ({"stop_at": ["singular:=0.1"]}, "--stop-at: not an event"),
        ({"stop_at": ["deflection:link1=2 deg"]}, "--stop-at: a quantity in rad where one in m is asked for .*2 deg'"),
        ({"stop_at": ["deflection:link1=2 mn"]}, '--stop-at: "2 mn" is not a number .*in m, or with a unit'),
        ({"stop_at": ["singular=0.1 m"]}, "--stop-at: a quantity in m where a number without a unit is asked for"),
        ({"stop_at": ["joint:A1=..2 N"]}, "--stop-at: a quantity in N where one in rad or m is asked for"),
        ({"stop_at": ["singular=2"]}, "--stop-at: not between 0 and 1"),
    ],
)
def test_what_makes_no_sense_names_the_flag(request_, says):
    with pytest.raises(InputError, match=f"^{says}"):
        integration_options(RunRequest(**request_), StudyDefaults())


def test_flags_go_before_the_study_and_its_step_goes_with_its_method():
    study = StudyDefaults(method="esdirk3", tolerance=1e-5, step=1e-3)
    kept = integration_options(RunRequest(), study)
    assert (kept.method.name, kept.tolerance, kept.step) == ("esdirk3", 1e-5, 1e-3)
    finer = integration_options(RunRequest(step=1e-4, tolerance=1e-7), study)
    assert (finer.method.name, finer.tolerance, finer.step) == ("esdirk3", 1e-7, 1e-4)
    other = integration_options(RunRequest(method="radau"), study)
    assert (other.method.name, other.tolerance, other.step) == ("radau", 1e-5, None)


def with_study(tmp_path, lines):
    file = tmp_path / "model.toml"
    file.write_text(library_text("pendulum").replace("[study]", f"[study]\n{lines}"), encoding="utf-8")
    return file


def test_a_study_names_method_tolerance_and_step(tmp_path):
    study = load(with_study(tmp_path, 'method = "newmark"\ntolerance = 1e-5\nstep = 1e-3')).study
    assert (study.method, study.tolerance, study.step) == ("newmark", 1e-5, 1e-3)


@pytest.mark.parametrize(
    ("lines", "says"),
    [
        ('method = "newmak"', 'study.method: unknown method .*did you mean "newmark"'),
        ("tolerance = 0", "study.tolerance: must be positive"),
        ('method = "radau"\nstep = 1e-3', "study.step: radau chooses its steps itself"),
    ],
)
def test_a_study_that_cannot_be_integrated_names_file_and_field(tmp_path, lines, says):
    file = with_study(tmp_path, lines)
    with pytest.raises(InputError, match=f"{file}: {says}"):
        load(file)


def test_methods_lists_what_there_is():
    done = paraflex("methods")
    assert done.returncode == 0, done.stderr
    assert all(name in done.stdout for name in METHODS)
    assert "spectral_radius" in done.stdout
    rows = json.loads(paraflex("methods", "--json").stdout)
    assert [row["name"] for row in rows] == list(METHODS)
    newmark = next(row for row in rows if row["name"] == "newmark")
    assert newmark["parameters"]["gamma"]["low"] == 0.5
    assert newmark["constraints"] == ["position"]
    assert [row["name"] for row in rows if row["default"]] == ["esdirk5"]


def test_a_motion_stopped_by_an_event_is_a_success(tmp_path):
    command = ["run", "-m", "pendulum", "--duration", "0.3", "--samples", "31", "--out", str(tmp_path)]
    done = paraflex(*command, "--rigid", "--stop-at", "joint:pivot=-0.3..")
    assert done.returncode == 0, done.stderr
    assert "error" not in done.stderr
    assert "joint pivot reached its lower limit -0.3 rad at t = " in done.stdout
    figures = json.loads((tmp_path / "summary.json").read_text())
    assert (figures["status"], figures["event"]) == ("stopped", "joint pivot")
    run = figures["parameters"]["run"]
    assert (run["method"], run["constraints"], run["step"]) == ("esdirk5", "baumgarte", None)
    assert run["stop_at"] == ["joint:pivot=-0.3.."]
    data = load_results(tmp_path / "results.nc")
    assert data["time"].values[-1] == pytest.approx(figures["event_time"])
    assert np.isfinite(data["angle"].values).all()
    assert list((tmp_path / "figures").iterdir())


def test_a_study_stopped_by_an_event_is_a_success(tmp_path):
    command = [
        "run",
        "raparm_i",
        "--mode",
        "++++",
        "--tol",
        "1e-3",
        "--duration",
        "0.1",
        "--samples",
        "51",
        "--out",
        str(tmp_path),
    ]
    done = paraflex(*command, "--stop-at", "deflection:link1=1e-5", "--method", "tr-bdf2")
    assert done.returncode == 0, done.stderr
    assert 'mode "++++": the deflection of link1 reached its limit 1e-05 m at t = ' in done.stdout
    mode = json.loads((tmp_path / "summary.json").read_text())["modes"]["++++"]
    assert (mode["status"], mode["event"]) == ("stopped", "deflection of link1")
    data = load_results(tmp_path / "results.nc")
    assert data.attrs["integration_method"] == "tr-bdf2"
    assert json.loads(data.attrs["method_parameters"]) == {}
    reached = data["end_effector"].notnull().all("axis").sel(mode="++++")
    assert data["time"].values[reached.values][-1] <= mode["event_time"]
    assert list((tmp_path / "figures").iterdir())


@pytest.mark.parametrize(
    ("arguments", "says"),
    [
        (["run", "raparm_i", "--ked", "--method", "newmark"], "--method: has no effect with --ked (got 'newmark')"),
        (
            ["run", "raparm_i", "--ked", "--stop-at", "singular=0.1"],
            "--stop-at: has no effect with --ked (got 'singular=0.1')",
        ),
        (
            ["run", "raparm_i", "--stop-at", "joint:A9=0..1"],
            "--stop-at: unknown joint A9 (got 'joint:A9=0..1'); choose from A1",
        ),
        (
            ["run", "raparm_i", "--stop-at", "joint:A1=..80 mm"],
            "--stop-at: a quantity in m where one in rad is asked for (got 'joint:A1=..80 mm'); give it in rad",
        ),
        (["run", "raparm_i", "--rigid", "--stop-at", "deflection:link1=1"], "--stop-at: a rigid body does not bend"),
        (
            ["run", "raparm_i", "--stop-at", "joint:A1=50.."],
            "--stop-at: the run would start outside the limits of joint A1",
        ),
        (["run", "-m", "pendulum", "--stop-at", "joint:pivot=1.."], "--stop-at: the run would start outside"),
        (["verify", "--method", "trbdf2"], "--method: unknown method (got 'trbdf2')"),
    ],
)
def test_bad_input_is_one_line_and_exit_code_2(tmp_path, arguments, says):
    done = paraflex(*arguments, "--out", str(tmp_path / "out"), cwd=tmp_path)
    assert done.returncode == 2
    assert says in done.stderr
    assert done.stderr.count("error:") == 1
    assert "Traceback" not in done.stderr
    assert not list(tmp_path.rglob("*.nc*"))
