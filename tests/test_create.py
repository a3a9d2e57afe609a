"""A newcomer's way: a file to start from, edited, checked, run; and the schema editors check it by."""

import json
import tomllib

import pytest

from paraflex.files import library_file, library_names, load
from shell import paraflex
from test_cli import FAST


def test_a_newcomers_five_bar(tmp_path):
    done = paraflex("new", "my_fivebar", cwd=tmp_path)
    assert done.returncode == 0, done.stderr
    assert "paraflex info my_fivebar.toml" in done.stdout
    file = tmp_path / "my_fivebar.toml"
    assert load(file).mechanism.name == "my_fivebar"
    # Longer arms: one number.
    file.write_text(file.read_text().replace("l1 = 0.250 ", "l1 = 0.280 "))
    assert load(file).mechanism.body("proximal1").length == 0.28
    assert "my_fivebar" in paraflex("info", "my_fivebar.toml", cwd=tmp_path).stdout
    done = paraflex("run", "--mechanism", "my_fivebar.toml", *FAST, "--json", cwd=tmp_path)
    assert done.returncode == 0, done.stderr
    assert json.loads(done.stdout)["modes"]["++"]["status"] == "complete"


def test_a_link_too_short_is_said_so(tmp_path):
    paraflex("new", "short", cwd=tmp_path)
    file = tmp_path / "short.toml"
    short = file.read_text().replace("l1 = 0.250 ", "l1 = 0.060 ").replace("l2 = 0.250 ", "l2 = 0.060 ")
    file.write_text(short)
    done = paraflex("run", "--mechanism", "short.toml", cwd=tmp_path)
    assert done.returncode == 2
    assert "short.toml: path.square: " in done.stderr
    assert " m beyond reach" in done.stderr


def test_nothing_is_written_over(tmp_path):
    (tmp_path / "mine.toml").write_text("precious")
    done = paraflex("new", "mine.toml", cwd=tmp_path)
    assert done.returncode == 2
    assert done.stderr == "error: mine.toml: already exists; choose another name, or remove it\n"
    assert (tmp_path / "mine.toml").read_text() == "precious"


def test_a_template_that_is_none(tmp_path):
    done = paraflex("new", "mine", "--from", "raparm", cwd=tmp_path)
    assert done.returncode == 2
    assert "--from: not a library mechanism (got 'raparm'); did you mean \"raparm_i\"?" in done.stderr
    done = paraflex("new", "no/such/folder/mine", cwd=tmp_path)
    assert done.returncode == 2
    assert "no/such/folder/mine.toml: cannot be written" in done.stderr
    assert list(tmp_path.iterdir()) == []


@pytest.mark.parametrize("name", library_names())
def test_every_library_mechanism_is_sound_and_makes_a_template(name, tmp_path):
    model = load(name)
    assert model.paths or model.study.duration
    done = paraflex("new", "copy", "--from", name, cwd=tmp_path)
    assert done.returncode == 0
    assert load(tmp_path / "copy.toml").mechanism.bodies == model.mechanism.bodies
    facts = json.loads(paraflex("info", name, "--json").stdout)
    assert facts["assembly_closes"] is True
    # Flexures are held by more than rigid links would need.
    flexure = name in ("cross_spring_pivot", "folded_beam_guide", "leaf_spring_guide")
    assert bool(facts["redundant_constraints"]) == flexure
    assert facts["degrees_of_freedom"] == {
        "3prr": 3,
        "3rrr": 3,
        "4rrr": 3,
        "andrews": 1,
        "cross_spring_pivot": 0,
        "folded_beam_guide": 0,
        "four_bar": 0,
        "geared_five_bar": 1,
        "leaf_spring_guide": 0,
        "pendulum": 1,
        "slider_crank": 1,
        "slider_crank_flexible": 0,
        "spin_up": 0,
    }.get(name, 2)


def test_the_schema_names_every_table_of_the_library_and_its_fields():
    schema = json.loads(paraflex("schema").stdout)
    assert schema["title"] == "paraflex model"
    for name in library_names():
        content = tomllib.loads(library_file(name).read_text(encoding="utf-8"))
        assert set(content) <= set(schema["properties"])
    beam = schema["$defs"]["BeamTable"]
    assert beam["properties"]["length"]["description"] == "the length in m"
    assert beam["additionalProperties"] is False
    assert "length" in beam["required"]
