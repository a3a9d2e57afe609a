"""Errors and warnings that no other test provokes: each says what is wrong, where, and what to do."""

import math
import pickle
import re
import sys
from dataclasses import replace

import numpy as np
import pytest
import xarray as xr

from paraflex.cli.app import main
from paraflex.elastodynamics import simulate_ked
from paraflex.errors import InputError, IntegrationError, Moment, NumericalError, UnreachablePathError
from paraflex.expressions.evaluate import ExpressionError, evaluate
from paraflex.files import library_file, load
from paraflex.findings import Finding
from paraflex.integrators import METHODS, IntegrationOptions
from paraflex.integrators.methods import find_method
from paraflex.integrators.spectra import tableau_of
from paraflex.mechanism import (
    FlexibleBeam,
    Mechanism,
    ModalDamping,
    PointForce,
    PointRef,
    RevoluteJoint,
    RigidBody,
    finite_segments,
)
from paraflex.motion import simulate_motion
from paraflex.paths import Circle, follow_path
from paraflex.results import open_results
from paraflex.studies import load_optimisation, load_sensitivities, load_sweep, sensitivities, sweep
from paraflex.studies.compare import ComparisonOptions
from paraflex.tracking import plan_tracking
from paraflex.validity import likely_cause
from test_bad_input import broken


def message(call, kind=InputError):
    with pytest.raises(kind) as caught:
        call()
    return str(caught.value)


def test_numerical_errors_name_cause_moment_and_remedy():
    error = IntegrationError("the run stops", Moment(0.5, 12, (0.1, 0.2)), remedy="shorten it")
    assert error.problem == "the run stops at t = 0.5 s (step 12), end-effector at (0.1, 0.2) m"
    assert str(error) == f"{error.problem}; shorten it"
    assert str(NumericalError("the run stops")) == "the run stops"
    far = UnreachablePathError("the path ends", Moment(0.0, 0), remedy="move it", detail="1 m beyond reach")
    assert str(far) == "the path ends at t = 0 s (step 0): 1 m beyond reach; move it"
    assert str(pickle.loads(pickle.dumps(far))) == str(far)
    # A finding made of an error says the remedy once.
    assert str(Finding("path-unreachable", "path.p", str(far), "move it")).count("move it") == 1


OPTIONS = [
    (lambda: IntegrationOptions(tolerance=np.inf), "tolerance: must be finite (got inf); "),
    (lambda: IntegrationOptions(method="bdf", constraints="ggl"), "constraints: bdf cannot keep the constraints in"),
    (lambda: IntegrationOptions(automatic_gains=True, constraints="position", method="newmark"), "automatic_gains: "),
    (
        lambda: find_method("generalised-alpha", {"spectral_radius": 2.0}),
        "parameters.spectral_radius: outside the",
    ),
    (lambda: find_method("newmark", {"gamma": 0.9, "beta": 0.25}), "parameters.beta: too small for unconditional"),
    (lambda: tableau_of(METHODS["bdf"]), "method: the method has no Butcher tableau (got 'bdf'); take a Runge-Kutta"),
    (lambda: ComparisonOptions(tolerances=()), "tolerances: nothing to compare; give a tolerance or a step"),
    (lambda: Circle((0.0, 0.0), 0.1, 5.0, sweep=0.0), "sweep: no angle to sweep (got 0.0); give it in rad, not zero"),
]


@pytest.mark.parametrize(("call", "says"), OPTIONS)
def test_options_are_refused_by_name(call, says):
    assert message(call).startswith(says)


EXPRESSIONS = [
    ("+".join(["1"] * 600), "too long for an expression"),
    ("[1, 2]", "only numbers, parameters, + - * / ** and brackets may stand in an expression"),
    ("a.b", "only numbers, parameters"),
]


@pytest.mark.parametrize(("text", "says"), EXPRESSIONS)
def test_expressions_are_refused_by_what_may_stand_in_them(text, says):
    assert says in message(lambda: evaluate(text, {}), ExpressionError)


# What is replaced in a model file, by what, and what the message says.
MODELS = [
    ('elements = 2', 'elements = 2\ndamping = { ratios = [] }', "body.left.damping.ratios: no damping ratio",
     "give one, say [0.01]"),
    (
        "elements = 2", "elements = 2\ndamping = { ratios = [0.01], mass = 1.0 }",
        "body.left.damping: ratios, a loss factor and Rayleigh's coefficients exclude one another", "give ratios alone",
    ),
]  # fmt: skip


@pytest.mark.parametrize(("old", "new", "says", "remedy"), MODELS)
def test_models_are_refused_where_they_are_wrong(tmp_path, old, new, says, remedy):
    text = message(lambda: load(broken(tmp_path, old, new)))
    assert says in text
    assert remedy in text.rpartition(";")[2]


def test_names_stand_once_and_a_sliding_joint_names_a_beam_first():
    bodies = [RigidBody("a", 1.0, 0.1, points={"A": (0.1, 0.0)}), RigidBody("b", 1.0, 0.1, points={"B": (0.1, 0.0)})]
    joint = RevoluteJoint("O", "ground.O", "a.A")
    twice = {"name": "m", "bodies": [bodies[0], bodies[0]], "joints": [joint], "ground": {"O": (0.0, 0.0)}}
    assert message(lambda: Mechanism(**twice)).startswith("body: duplicate name (got 'a'); rename one of them")


def test_a_task_needs_an_end_effector():
    mechanism = replace(load("five_bar").mechanism, end_effector=None)
    text = message(lambda: follow_path(mechanism, Circle((0.0, 0.3), 0.01, 5.0), np.linspace(0.0, 0.1, 3)))
    assert text == "end_effector: the mechanism has no end-effector; name its point"


def test_what_segments_and_kineto_elastodynamics_leave_out():
    model = load("five_bar")
    beam = next(body for body in model.mechanism.bodies if isinstance(body, FlexibleBeam))
    damped = replace(beam, damping=ModalDamping((0.01,)))
    mechanism = replace(model.mechanism, bodies=tuple(damped if b is beam else b for b in model.mechanism.bodies))
    text = message(lambda: finite_segments(mechanism, 4))
    assert text.startswith(f"body.{beam.name}.damping: finite segments can be damped in proportion to stiffness only")
    task = plan_tracking(mechanism, model.path(), samples=11)
    mode = model.mechanism.modes[0].name if model.mechanism.modes else "++"
    assert "kineto-elastodynamics does not account for damped beams" in message(lambda: simulate_ked(task, mode))


def pendulum(force=0.0, **more):
    loads = (PointForce("push", PointRef("arm", "A"), (0.0, force)),) if force else ()
    arm = RigidBody("arm", 1.0, 0.1, points={"O": (0.0, 0.0), "A": (0.5, 0.0)}, centre_of_mass=(0.25, 0.0))
    return Mechanism(
        "pendulum", bodies=(arm,), joints=(RevoluteJoint("pin", "ground.O", "arm.O"),), loads=loads,
        ground={"O": (0.0, 0.0)}, gravity=(0.0, -9.81), **more,
    )  # fmt: skip


def run(mechanism, duration=1.0, **options):
    from paraflex.dynamics import State, build_system

    system = build_system(mechanism)
    start = State(0.0, np.array([0.0, 0.0, 0.0]), np.zeros(system.n))
    return simulate_motion(mechanism, duration, samples=11, start=start, options=IntegrationOptions(**options))


FAILURES = [
    ("the run has not ended after 5 steps, at t = ", "max_steps", 0.0, {"max_steps": 5}),
    ("no longer finite numbers", "look for masses", 1e308, {"method": "rk45"}),
    ("Newton's iteration does not converge, however small the step,", "look for masses", 1e160, {}),
    (
        "Newton's iteration does not converge in a fixed step, nor in parts of it,", "take a shorter step", 1e12,
        {"method": "newmark", "step": 0.1},
    ),
    ("steps are down to ", "allow more steps (max_steps)", 1e160, {"method": "rk45", "max_steps": 20_000}),
]  # fmt: skip


@pytest.mark.parametrize(("says", "remedy", "force", "options"), FAILURES)
@pytest.mark.filterwarnings("ignore:overflow:RuntimeWarning", "ignore:invalid value:RuntimeWarning")
@pytest.mark.filterwarnings("ignore::paraflex.errors.StiffnessWarning")
def test_runs_that_fail_say_why_when_and_what_to_do(monkeypatch, says, remedy, force, options):
    # Of forces that may be given few are so large that a run of them fails.
    monkeypatch.setattr("paraflex.limits.LARGEST", math.inf)
    # The pace of methods of other packages is taken of 20 000 attempts, of which the same is said.
    monkeypatch.setattr(sys.modules["paraflex.integrators.integration"], "_WINDOW_OUTSIDE", 1_000)
    with pytest.raises(IntegrationError) as caught:
        run(pendulum(force), **options)
    error = caught.value
    assert re.search(re.escape(says), str(error))
    assert re.search(r" at t = \S+ s \(step \d+\); ", str(error))
    assert remedy in error.remedy
    assert error.partial.solution.message == str(error)


# --- Slips of units ------------------------------------------------------------------------------------------------


@pytest.mark.parametrize("name", ["five_bar", "pendulum", "four_bar"])
def test_a_modulus_in_gigapascals_is_named_by_the_error(tmp_path, monkeypatch, capsys, name):
    """The run fails, the doubtful number is found before, and the error points at it."""
    monkeypatch.chdir(tmp_path)
    assert command(monkeypatch, "new", "soft", "--from", name) == 0
    file = tmp_path / "soft.toml"
    file.write_text(re.sub(r"(youngs_modulus = \d+)e9", r"\1", file.read_text()))
    capsys.readouterr()
    code = command(monkeypatch, "run", "-m", "soft.toml", "--no-report", "--no-figures", "--out", "out")
    out, err = capsys.readouterr()
    assert code in (1, 2)
    said = out + err
    assert "no solid has a modulus of" in said
    (error,) = (line for line in err.splitlines() if line.startswith("error: "))
    assert "most likely because of body." in error
    assert ".material.youngs_modulus: " in error


def test_sound_numbers_are_not_blamed():
    mechanism = load("five_bar").mechanism
    assert likely_cause(mechanism, "proximal1 bends to a slope of 3 rad") == ""


# --- The command line ----------------------------------------------------------------------------------------------


def command(monkeypatch, *arguments):
    """The exit code of a command in this process."""
    monkeypatch.setattr(sys, "argv", ["paraflex", *arguments])
    with pytest.raises(SystemExit) as caught:
        main()
    return caught.value.code or 0


COMMANDS = [
    (["plot", "nothing"], 2, "RESULTS: no such file or folder (got 'nothing')"),
    (["plot", "nothing", "--dpi", "0"], 2, "--dpi: not a number of dots per inch (got 0.0); give a number up to"),
    (["run", "-m", "nothing.toml"], 2, "nothing.toml: file: cannot be read (no such file or directory); check"),
    (["run", "-m", "pendulum", "--mode", "++"], 2, "--mode: a model without a path has no actuation modes"),
    (
        ["run", "-m", "pendulum", "--after", "hold"],
        2,
        "--after: the model has no path after which motors could be held",
    ),
    (["run", "-m", "five_bar", "--path", "nothing"], 2, "path"),
    (
        ["run", "-m", "five_bar", "--mode", "+- servo"],
        2,
        '--mode: mode "+- servo" cannot drive the mechanism: 1 active',
    ),
    (["run", "-m", "five_bar", "--stop-at", "nothing"], 2, "--stop-at: not an event (got 'nothing'); write "),
    (["run", "-m", "five_bar", "--rigid", "--ked"], 2, "--rigid: cannot be combined"),
    (["run", "-m", "five_bar", "--segments", "0"], 2, "--segments: must be positive (got 0); "),
    (["sweep", "nothing.toml"], 2, "nothing.toml"),
    (["optimise", "nothing.toml"], 2, "nothing.toml"),
    (["identify", "nothing.toml"], 2, "nothing.toml"),
    (["indices", "nothing.toml"], 2, "nothing.toml"),
    (["sensitivity", "nothing.toml"], 2, "nothing.toml"),
    (["animate", "nothing", "film.gif"], 2, "nothing"),
    (["export", "nothing", "--to", "csv"], 2, "nothing"),
    (["report", "nothing"], 2, "nothing"),
]


@pytest.mark.parametrize(("arguments", "code", "says"), COMMANDS)
def test_commands_answer_in_one_line(tmp_path, monkeypatch, capsys, arguments, code, says):
    monkeypatch.chdir(tmp_path)
    assert command(monkeypatch, *arguments) == code
    err = capsys.readouterr().err
    *_, last = err.strip().splitlines()
    assert last.startswith("error: ")
    assert says in last
    assert "; " in last
    assert list(tmp_path.iterdir()) == []


def test_drives_that_contradict_one_another_are_those_of_the_file(tmp_path, monkeypatch, capsys):
    file = tmp_path / "disc.toml"
    file.write_text(
        'name = "disc"\nground = { O = [0, 0] }\njoint = { O = ["ground.O", "disc.O"] }\n'
        "[body.disc]\nmass = 1\ninertia = 0.01\npoints = { O = [0, 0], P = [0.1, 0] }\n"
        '[prescribed]\na = { joint = "O", speed = 1 }\nb = { joint = "O", speed = 2 }\n'
        "[assembly]\nstart = { disc = 0 }\n[study]\nduration = 1\n"
    )
    assert command(monkeypatch, "run", "-m", str(file), "--out", str(tmp_path / "out")) == 2
    says = (
        f"error: {file}: prescribed: the velocities of constraints contradict one another, by 1 m/s or rad/s: b, a, at"
    )
    assert says in capsys.readouterr().err
    assert list(tmp_path.iterdir()) == [file]


# --- Files ---------------------------------------------------------------------------------------------------------


def test_files_that_are_no_results(tmp_path):
    table, cut, other, later = (tmp_path / name for name in ("a.parquet", "cut.nc", "other.nc", "later.nc"))
    table.write_bytes(b"PAR1....")
    cut.write_bytes(b"\x89HDF....")
    xr.Dataset({"x": 1.0}).to_netcdf(other)
    xr.Dataset(attrs={"schema": 10**6, "paraflex_version": "99.0"}).to_netcdf(later)
    (tmp_path / "sweep").mkdir()
    (tmp_path / "sweep" / "results.parquet").write_bytes(b"PAR1")
    (tmp_path / "empty").mkdir()
    for path, says in [
        (table, "a table of many runs, not the results of one; read it with pandas or pyarrow"),
        (
            cut,
            "damaged: cut short, or not a readable netCDF file; copy it again, or delete it",
        ),
        (other, "a netCDF file, but not of paraflex; name a results.nc that paraflex wrote"),
        (later, "written by a later version, paraflex 99.0 (schema 1000000"),
        (tmp_path / "sweep", "the folder of a study of many runs, whose results are in results.parquet; it kept no"),
        (tmp_path / "empty", "no results in this folder (no results.nc"),
    ]:
        assert f"{path}: {says}" in message(lambda path=path: open_results(path))


SWEEPS = [
    ('[vary.L]\nfields = ["body.beam.length"]\nlow = 0.5\nhigh = 1.0', "vary.L.number: a grid needs the number of val"),
    (
        '[sampling]\nkind = "random"\nnumber = 3\n[vary.L]\nfields = ["body.beam.length"]\nlow = 0.5\nhigh = 1.0\n'
        "number = 2",
        "vary.L.number: only grids have a number of values for each parameter",
    ),
    ('[vary.L]\nfields = ["body.beam.length"]\nvalues = [1.0]\nlow = 0.5', "vary.L: values and a range exclude each"),
    ('[sampling]\nkind = "random"\nnumber = 3', "vary: no parameter varies; add a [vary.NAME] table"),
    (
        '[vary.L]\nfields = ["body.beam.length"]\nlow = 0.5\nhigh = 1.0\nnumber = 2\nwhole = true',
        "vary.L.whole: whole numbers need a linear range with whole ends",
    ),
    ('[vary.L]\nfields = ["body.beam.lengthh"]\nvalues = [1.0]', "no such number in the mechanism's file"),
    (
        '[sampling]\nkind = "list"\nnumber = 3\n[vary.L]\nfields = ["body.beam.length"]\nvalues = [1.0]',
        "sampling.number: a list has as many designs as its values make",
    ),
    (
        '[sampling]\nkind = "random"\nnumber = 1000000000\n'
        '[vary.L]\nfields = ["body.beam.length"]\nlow = 0.5\nhigh = 1.0',
        "sampling.number: too many designs (got 1000000000); at most",
    ),
    (
        '[vary.L]\nfields = ["body.beam.length"]\nvalues = [1.5]\nwhole = true',
        "vary.L.values: not all of them whole (got [1.5]); leave out whole = true",
    ),
    ('[vary.L]\nfields = ["body..length"]\nvalues = [1.0]', "not the name of a field"),
]


@pytest.mark.parametrize(("text", "says"), SWEEPS)
def test_sweeps_are_refused_where_they_are_wrong(tmp_path, text, says):
    file = tmp_path / "sweep.toml"
    file.write_text('mechanism = "raparm_i"\n' + text.replace("body.beam", "body.link1"))
    assert says in message(lambda: load_sweep(file))


def test_fields_of_one_parameter_with_two_values_have_no_nominal_one(tmp_path):
    file = tmp_path / "study.toml"
    file.write_text('mechanism = "five_bar"\n[vary.L]\nfields = ["ground.A1.0", "ground.A2.0"]\n')
    text = message(lambda: sensitivities(load_sensitivities(file)))
    assert "so that there is no nominal one" in text


def test_a_sweep_needs_modes_and_its_own_folder(tmp_path):
    source = library_file("five_bar").read_text(encoding="utf-8")
    bare = source.replace('[mode]\n"++" = ["left", "right"]\n', "").replace('modes = ["++"]\n', "")
    (tmp_path / "bare.toml").write_text(bare, encoding="utf-8")
    file = tmp_path / "sweep.toml"
    varied = '[vary.L]\nfields = ["parameters.l1"]\nvalues = [0.25]\n'
    file.write_text('mechanism = "bare.toml"\n' + varied)
    assert "no actuation mode to run" in message(lambda: load_sweep(file))
    file.write_text('mechanism = "five_bar"\n' + varied)
    folder = tmp_path / "out"
    folder.mkdir()
    (folder / "study.json").write_text("[]")
    assert "not the study of a campaign; name a new folder" in message(lambda: sweep(file, folder))


def test_a_search_needs_a_start(tmp_path):
    file = tmp_path / "search.toml"
    file.write_text(
        'mechanism = "five_bar"\n[vary.L]\nfields = ["ground.A1.0", "ground.A2.0"]\nlow = -0.2\nhigh = 0.2\n'
        "[objective]\nminimise = { tracking_rms = 1.0 }\n"
    )
    assert "so that there is no start" in message(lambda: load_optimisation(file))
    tolerances = (
        file.read_text().replace('"ground.A1.0", "ground.A2.0"', '"integration.tolerance"').replace("-0.2", "1e-7")
    )
    file.write_text(tolerances)
    assert "the study's [integration] has no such number; give a start" in message(lambda: load_optimisation(file))
    file.write_text(tolerances + "[integration]\ntolerance = 1e-4\n")
    assert load_optimisation(file).start == (1e-4,)


def test_messages_on_expressions_name_the_culprit_and_the_cure():
    """A stranger's mistakes: a caret, a mistyped millimetre."""
    with pytest.raises(ExpressionError, match=r'"\^" is a power only in units') as caught:
        evaluate("(1 + 2)^2", {})
    assert caught.value.remedy == 'write ** for powers: "x**2"'
    with pytest.raises(ExpressionError, match="unknown unit") as caught:
        evaluate("600 mn", {})
    assert caught.value.remedy.startswith('did you mean "mm" or ')


def model_text(period):
    return f"""
name = "turning"
parameters = {{ n = "60 rpm", T = "{period}" }}
ground = {{ O = [0.0, 0.0] }}
joint = {{ O = ["ground.O", "crank.O"] }}
body.crank = {{ type = "rigid", mass = 1.0, inertia = 0.1, points = {{ O = [0.0, 0.0] }} }}
study.duration = "2 * T"
"""


def test_a_period_from_a_speed_names_its_parameter_and_the_turn(tmp_path):
    file = tmp_path / "model.toml"
    file.write_text(model_text("1 rev / n"))
    assert load(file).study.duration == pytest.approx(2.0)
    file.write_text(model_text("2 * pi / n"))
    said = message(lambda: load(file))
    assert "study.duration: a quantity in s rad^-1 where one in s" in said
    assert "it depends on parameters.T" in said
    assert '"1 rev / n"' in said


def test_files_of_another_kind_are_said_to_be(tmp_path):
    model, study = tmp_path / "model.toml", tmp_path / "study.toml"
    model.write_text(model_text("1 rev / n"))
    study.write_text('mechanism = "five_bar"\n[vary.a]\nfields = ["body.left.length"]\nvalues = [1.0]\n')
    for read in (load_sweep, load_optimisation, load_sensitivities):
        assert "this is a model file, not a study file" in message(lambda read=read: read(model))
    assert "this is a study file, not a model file; name its mechanism, five_bar" in message(lambda: load(study))


def test_an_open_quote_is_not_a_name_that_stands_twice(tmp_path):
    file = tmp_path / "model.toml"
    file.write_text('name = "open\n')
    assert message(lambda: load(file)).endswith("correct this line")
    file.write_text('name = "one"\nname = "two"\n')
    assert message(lambda: load(file)).endswith("correct this line; a name may appear only once")
