"""Values set in place of a file's: their names, what they may be, and that results and commands tell them."""

import json
import re
import shlex

import numpy as np
import pytest

import paraflex as pf
from paraflex.cli.sensitivity import _values
from paraflex.designs.sweep import load_sweep
from paraflex.files import load_data
from paraflex.files.overlay import find_place, value_of, with_values
from paraflex.reports.provenance import asked, command_line
from paraflex.studies import load_sensitivities
from shell import paraflex


@pytest.mark.parametrize(
    ("field", "value", "place"),
    [
        ("section.bar.thickness", 0.006, ("section", "bar", "thickness")),
        ("bar.thickness", "6 mm", ("section", "bar", "thickness")),
        ("distal1.length", "2 * 125 mm", ("body", "distal1", "length")),
        ("distal1.points.C", 0.2, ("body", "distal1", "points", "C")),
        ("ground.A1.0", "-80 mm", ("ground", "A1", 0)),
        ("l1", 0.26, ("parameters", "l1")),
        ("gravity", [0.0, -9.81], ("gravity",)),
        ("study.tolerance", "2 um", ("study", "tolerance")),
        ("study.torques.left", "3 N m", ("study", "torques", "left")),
        ("payload.mass", "0.1 kg", ("payload", "mass")),
        ("geometry", "linear", ("geometry",)),
        ("distal1.modes", 2, ("body", "distal1", "modes")),
        ("outward.distal1", "40 deg", ("assembly", "outward", "distal1")),
    ],
)
def test_fields_are_set_by_their_names(field, value, place):
    data, _ = load_data("five_bar")
    changed = with_values(data, {field: value})
    inside = changed
    for key in place:
        inside = inside[key]
    assert inside == value
    assert data == load_data("five_bar")[0]
    pf.load("five_bar", set={field: value})


def test_a_model_set_is_that_of_a_file_that_says_so(tmp_path):
    model = pf.load("five_bar", set={"bar.width": "40 mm", "distal1.elements": 2})
    bodies = model.mechanism.bodies
    assert {body.section.shape.width for body in bodies} == {0.04}
    assert [body.elements for body in bodies if body.name.startswith("distal")] == [2, 3]
    assert model.settings == {"bar.width": "40 mm", "distal1.elements": 2}
    assert model.parameters["section"]["bar"]["width"] == "40 mm"
    model.save(tmp_path / "set.toml")
    assert '"40 mm"' in (tmp_path / "set.toml").read_text()
    assert pf.load(tmp_path / "set.toml").mechanism == model.mechanism


@pytest.mark.parametrize(
    ("settings", "says"),
    [
        (
            {"distal1.lenght": 0.3},
            r"distal1.lenght: no such field in the model's file; did you mean \"body.distal1.length",
        ),
        ({"thickness": 0.3}, r"thickness: no such field in the model's file; did you mean section\.bar\.thickness\?"),
        ({"body.distal9.length": 0.3}, r"body.distal9.length: no such field"),
        ({"parameters.l9": 0.3}, r"parameters.l9: no such field"),
        ({"nothing": 0.3}, r"nothing: no such field"),
        ({"body.distal1": 0.3}, r'body.distal1: a table of the model\'s file; write "body.distal1.length"'),
        ({"distal1.points": {"C": 1.0}}, r"distal1.points: a table"),
        ({"ground.A1.2": 0.3}, r"ground.A1.2: no such field"),
        ({"distal1.length": "80 kg"}, r"body.distal1.length: a quantity in kg where one in m"),
        ({"distal1.length": [1.0]}, r"body.distal1.length: should be a valid number"),
        ({"": 0.3}, r".*: not the name of a field"),
        ({"distal1..length": 0.3}, r".*: not the name of a field"),
    ],
)
def test_what_cannot_be_set_is_refused(settings, says):
    with pytest.raises(pf.InputError, match=f"^five_bar.toml: {says}"):
        pf.load("five_bar", set=settings)


def test_a_name_of_several_tables_is_refused():
    data = {"section": {"bar": {"width": 1.0}}, "body": {"bar": {"length": 1.0, "width": 2.0}}}
    assert find_place(data, "bar.length") == ("body", "bar", "length")
    says = "bar.width: the name of several; choose from section.bar.width, body.bar.width"
    with pytest.raises(pf.InputError, match=says):
        find_place(data, "bar.width")


@pytest.mark.parametrize(
    ("text", "value"),
    [("0.3", 0.3), ("4", 4), ("true", True), ("[0, -9.81]", [0, -9.81]), ("30 deg", "30 deg"), ("circle", "circle"),
     ('"4"', "4"), ("1\nb = 2", "1\nb = 2"), ("-l1 / 2", "-l1 / 2"), (".5", ".5"), ("[" * 9999, "[" * 9999)],
)  # fmt: skip
def test_texts_of_a_shell_stand_for_values(text, value):
    found = value_of(text)
    assert found == value
    assert type(found) is type(value)


def test_commands_set_values_and_results_tell_them(tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    given = ["--set", "bar.thickness=6 mm", "--set", "study.samples=11"]
    out = paraflex("run", "--no-figures", "five_bar", *given, "--duration", "0.05", "--mode", "++", "--out", "set")
    assert out.returncode == 0, out.stderr
    data = pf.load_results("set")
    told = json.loads(data.attrs["parameters"])
    assert told["model"]["section"]["bar"]["thickness"] == "6 mm"
    assert told["run"]["set"] == {"bar.thickness": "6 mm", "study.samples": 11}
    assert data.sizes["time"] == 11
    words = shlex.split(command_line(asked(data)))
    assert words[:7] == ["paraflex", "run", "five_bar", *given]
    again = paraflex(*words[1:], "--out", "again")
    assert again.returncode == 0, again.stderr
    assert pf.load_results("again")["deflection"].equals(data["deflection"])
    facts = json.loads(paraflex("info", "five_bar", "--set", "distal1.elements=1", "--json").stdout)
    plain = json.loads(paraflex("info", "five_bar", "--json").stdout)
    assert json.dumps(facts) != json.dumps(plain)


@pytest.mark.parametrize("command", ["run", "verify", "compare-methods", "control compare", "modes", "info"])
def test_every_command_that_takes_a_model_takes_settings(command):
    wrong = paraflex(*command.split(), "five_bar", "--set", "bar.thickness=6 kg")
    assert wrong.returncode == 2
    assert "five_bar.toml: section.bar.thickness: a quantity in kg where one in m is asked for" in wrong.stderr
    lacks = "--set: not FIELD=VALUE"
    for text, says in (
        ("bar.thickness", lacks),
        ("=3", lacks),
        ("bar.thickness=", "--set bar.thickness: has no value"),
    ):
        wrong = paraflex(*command.split(), "five_bar", "--set", text)
        assert wrong.returncode == 2
        assert says in wrong.stderr


def test_options_take_units(tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    done = paraflex("info", "four_bar", "--at", "10 ms", "--json")
    assert done.returncode == 0, done.stderr
    assert done.stdout == paraflex("info", "four_bar", "--at", "0.01", "--json").stdout
    for given, says in [
        ("10 mm", "a quantity in m where one in s"),
        ("soon", "not a number"),
        ("3 parsec", "not a number"),
    ]:
        wrong = paraflex("run", "four_bar", "--duration", given)
        assert wrong.returncode == 2
        assert "--duration" in wrong.stderr
        assert re.search(says, " ".join(wrong.stderr.split()))


def test_a_study_sets_values_of_its_mechanism(tmp_path):
    study = 'mechanism = "five_bar"\nset = { "bar.width" = "4 cm", "study.samples" = 11 }\n'
    study += '[vary.thickness]\nvalues = ["5 mm", "6 mm"]\nfields = ["bar.thickness"]\n'
    (tmp_path / "study.toml").write_text(study)
    loaded = load_sweep(tmp_path / "study.toml")
    model, _ = loaded.setting.design((0.006,))
    assert model.mechanism.bodies[0].section == pf.Section.rectangle(0.04, 0.006)
    assert model.study.samples == 11
    (tmp_path / "study.toml").write_text(study.replace("4 cm", "4 kg"))
    with pytest.raises(pf.InputError, match=r"five_bar.toml: section.bar.width: a quantity in kg where one in m"):
        load_sweep(tmp_path / "study.toml")


def test_values_may_be_numpy_ones_and_names_of_files(tmp_path):
    model = pf.load("five_bar", set={"gravity": np.array([0.0, -9.81]), "distal1.elements": np.int64(2)})
    assert model.mechanism.gravity == (0.0, -9.81)
    assert model.mechanism.body("distal1").elements == 2
    (tmp_path / "rows.csv").write_text("t, angle\n0, 0\n1, 0.5\n2, 1.0\n")
    text = (
        'name = "rotor"\nground = { O = [0, 0] }\njoint = { O = ["ground.O", "rotor.O"] }\n'
        'body.rotor = { type = "rigid", mass = 1.0, inertia = 1.0, points = { O = [0, 0] } }\n'
        'prescribed.drive = { joint = "O", table = [[0.0, 0.0], [1.0, 1.0]] }\n'
    )
    (tmp_path / "rotor.toml").write_text(text)
    (drive,) = pf.load(tmp_path / "rotor.toml", set={"drive.table": "rows.csv"}).mechanism.prescribed
    assert list(drive.profile.values) == [0.0, 0.5, 1.0]


def test_a_sensitivity_is_taken_at_values_with_units(tmp_path):
    (tmp_path / "study.toml").write_text('mechanism = "five_bar"\n[vary.t]\nfields = ["bar.thickness"]\n')
    setting = load_sensitivities(tmp_path / "study.toml").setting
    assert _values(["t = 6 mm"], setting) == {"t": 0.006}
    assert _values(["t=0.006"], setting) == {"t": 0.006}
    for entry, says in [("t=6 kg", "--at: a quantity in kg where one in m"), ("t", "--at: not NAME=VALUE")]:
        with pytest.raises(pf.InputError, match=says):
            _values([entry], setting)
