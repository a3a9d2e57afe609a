"""Options that commands share: one value each, and one way to name a model."""

import json

import pytest
from typer.main import get_command

import paraflex as pf
from paraflex.cli import app as program
from paraflex.errors import InputError
from paraflex.reports.provenance import command_line

COMMANDS = program.all_commands(get_command(program.app))
NEEDED = {"report": ["r"], "animate": ["r", "o"], "export": ["r"], "plot": ["r"], "new": ["n"]}
STUDIES = ("sensitivity", "sweep", "optimise", "optimize", "identify", "indices")
NEEDED |= {name: ["study.toml"] for name in STUDIES}
MODEL_COMMANDS = (
    "run", "verify", "compare-methods", "control compare", "modes", "linearise", "reduce", "statics", "draw", "info",
    "kinematics", "torques",
)  # fmt: skip


def options():
    """Every option of every command that takes one value."""
    for name, command in COMMANDS.items():
        for parameter in command.params:
            if parameter.opts[0].startswith("-") and not parameter.is_flag and not parameter.multiple:
                yield pytest.param(name, parameter, id=f"{name} {parameter.opts[0]}")


@pytest.mark.parametrize(("name", "parameter"), [*options()])
def test_a_second_value_of_an_option_is_refused(name, parameter):
    longest = max(parameter.opts, key=len)
    # The two spellings, where there are two, are one option; the values are given in both ways.
    line = [*NEEDED.get(name, []), parameter.opts[0], "7", f"{longest}=8"]
    with pytest.raises(InputError) as error:
        COMMANDS[name].make_context(name, line)
    assert error.value.field == longest
    assert error.value.value == "7, 8"


def test_options_of_several_values_take_them():
    context = COMMANDS["run"].make_context("run", ["--mode", "++++", "--mode", "+-+-", "--stop-at", "singular=0.1"])
    assert context.params["modes"] == ["++++", "+-+-"]
    assert context.params["stop_at"] == ["singular=0.1"]


def test_a_switch_on_and_off_is_refused_and_twice_on_is_not():
    with pytest.raises(InputError, match="--report: given on and off"):
        COMMANDS["run"].make_context("run", ["--no-report", "--report"])
    assert COMMANDS["run"].make_context("run", ["--json", "--json"]).params["json"] is True


def called(monkeypatch, command, line):
    """The model that a command would load."""
    loaded = []

    def load(name, **_):
        loaded.append(name)
        raise InputError("enough", field="test")

    monkeypatch.setattr("paraflex.cli.request.load", load)
    with pytest.raises(InputError, match="enough"):
        COMMANDS[command].main([*line], standalone_mode=False)
    return loaded


@pytest.mark.parametrize("command", MODEL_COMMANDS)
@pytest.mark.parametrize(
    "line", [["five_bar"], ["-m", "five_bar"], ["--mechanism", "five_bar"], ["five_bar", "-m", "five_bar"]]
)
def test_models_are_named_by_argument_or_option(monkeypatch, command, line):
    assert called(monkeypatch, command, line) == ["five_bar"]


@pytest.mark.parametrize(
    "command", [name for name in MODEL_COMMANDS if name not in ("info", "run", "kinematics", "torques")]
)
def test_without_a_name_it_is_the_papers(monkeypatch, command):
    assert called(monkeypatch, command, []) == ["raparm_i"]


@pytest.mark.parametrize("command", MODEL_COMMANDS)
def test_two_different_models_are_refused_with_exit_code_2(monkeypatch, capsys, command):
    monkeypatch.setattr("sys.argv", ["paraflex", *command.split(), "five_bar", "--mechanism", "raparm_i"])
    with pytest.raises(SystemExit) as end:
        program.main()
    assert end.value.code == 2
    says = "error: --mechanism: two models are named, 'five_bar' and --mechanism 'raparm_i'; name one of them\n"
    assert capsys.readouterr().err == says


def test_every_command_with_a_mechanism_takes_both():
    with_option = [name for name, each in COMMANDS.items() if any("--mechanism" in one.opts for one in each.params)]
    assert sorted(with_option) == sorted(MODEL_COMMANDS)
    for name in MODEL_COMMANDS:
        assert any(one.opts == ["source"] for one in COMMANDS[name].params), name


# Options that say where results go and how they are shown.
SHOWN = {"out", "force", "figures", "report", "json", "units"}
# It is repeated by the names of its modes.
NAMED = {"servo"}


def asked_for(tmp_path, *line):
    """The command in the results of a run that is as quick as it can be."""
    out = tmp_path / "out"
    COMMANDS["run"].main([*line, "--no-report", "--out", str(out)], standalone_mode=False)
    return command_line(json.loads((out / "summary.json").read_text())["parameters"]["run"])


def test_the_command_that_repeats_a_run_has_every_option_that_decides_it(tmp_path):
    options = (
        "--duration 1e-4 --samples 2 --balanced --geometry linear "
        "--max-steps 500000 --tol 1e-4 --method trapezoidal --assembly stretched --stop-at deflection:rod=0.5"
    )
    pf.load("slider_crank_flexible").mechanism.save(tmp_path / "crank.toml")
    motion = [str(tmp_path / "crank.toml"), *options.split()]
    line = asked_for(tmp_path, *motion)
    for word in motion[1:]:
        if word.startswith("--"):
            assert word in line.split(), line


def test_every_option_of_a_run_is_in_the_command_that_repeats_it_or_shows_results():
    """A new option that is forgotten there is found here."""
    run = {
        "set": {"a.b": 1.0}, "mechanism": "five_bar",
        "path": "line", "modes": ["++++"], "duration": 1.0, "samples": 3, "tolerance": 1e-6,
        "method": "bdf2", "step": 0.1, "constraints": "baumgarte", "alpha": 1.0, "beta": 2.0, "segments": 3,
        "reduced": 4, "reference": "free", "curvature": "shared", "after": "hold", "assembly": "start", "max_steps": 7,
        "method_parameters": {"a": 1.0}, "rigid": True, "ked": True, "balanced": True, "stop_at": ["singular=0.1"],
        "controllers": ["joint"], "tolerance_per": "run", "control": "forces", "allow_outside": True,
        "metrics": ["max(abs(A1.rate))"],
    }  # fmt: skip
    lines = " ".join(
        command_line(each)
        for each in (run, run | {"automatic_gains": True},
                     run | {"geometry": "linear", "rigid": False, "ked": False, "segments": None})
    )  # fmt: skip
    words = {word.partition("=")[0] for word in lines.split()}
    # The model is the command's argument.
    words |= {"--mechanism"} if "five_bar" in words else set()
    for parameter in COMMANDS["run"].params:
        if parameter.name not in SHOWN | NAMED and parameter.opts[0].startswith("-"):
            assert words & set(parameter.opts), parameter.name
