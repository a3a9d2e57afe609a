"""The [statics] table of model files: read, saved, set, overridden by options and arguments, refused by field."""

from __future__ import annotations

import json
import math
from pathlib import Path

import pytest

import paraflex as pf
from paraflex.equilibria import StaticsDefaults
from paraflex.files import library_names, library_text
from shell import paraflex

GUIDE = library_text("leaf_spring_guide")
BEFORE = GUIDE.partition("[statics]")[0]


def written(folder: Path, statics: str) -> Path:
    file = folder / "guide.toml"
    file.write_text(BEFORE + "[statics]\n" + statics, encoding="utf-8")
    return file


def last(*arguments: object) -> dict:
    return json.loads(paraflex("statics", *arguments, "--json").stdout)["last"]


FLEXURES = {
    "leaf_spring_guide": ("stage.T.x", 0.010),
    "cross_spring_pivot": ("stage.C.angle", math.radians(15.0)),
    "folded_beam_guide": ("shuttle.T.x", 0.020),
}


@pytest.mark.parametrize("name", FLEXURES)
def test_flexures_of_the_library_do_what_their_comments_say(name):
    moved, travel = FLEXURES[name]
    model = pf.load(name)
    found = pf.statics(model)
    assert found.travel(moved)[-1] == pytest.approx(travel, rel=1e-12)
    assert found.stable.all()
    assert found.validity is not None
    assert found.validity.holds
    across = found.directions[-1].name
    said = {
        "leaf_spring_guide": (10.6, 42e6, 5.3e6, -0.6e-3),
        "cross_spring_pivot": (0.232, 21e6, 0.45e6, 0.8e-3),
        "folded_beam_guide": (10.6, 21e6, 37e3, 2e-6),
    }[name]
    numbers = (found.effort(moved)[-1], *found.stiffness(across)[[0, -1]], found.travel(across)[-1])
    assert numbers == pytest.approx(said, rel=0.1 if name == "folded_beam_guide" else 0.02)
    # The last equilibrium is the same after one step.
    assert last(name, "--steps", 1)[moved]["effort"] == pytest.approx(numbers[0], rel=1e-9)


def test_a_held_bridge_makes_the_folded_guide_stiff():
    held = pf.statics(pf.load("folded_beam_guide"), moved={"shuttle.T.x": 0.02, "bridge.A.x": 0.01}, steps=2)
    assert held.stiffness("shuttle.T.y")[-1] == pytest.approx(2.62e6, rel=0.01)


def test_units_and_expressions_are_those_of_each_coordinate(tmp_path):
    file = written(
        tmp_path,
        'moved = { "stage.T.x" = "length / 10" }\nloads = { "stage.T.y" = "-2 kN / 100", "left.A.angle" = "5 Nmm" }\n'
        'held = ["stage.T.angle"]\nsteps = 3\nbuckling = 2\n',
    )
    asked = pf.load(file).statics
    assert asked == StaticsDefaults(
        loads={"stage.T.y": -20.0, "left.A.angle": 5e-3}, moved={"stage.T.x": 0.01}, held=("stage.T.angle",), steps=3,
        buckling=2,
    )  # fmt: skip
    found = pf.statics(pf.load(file))
    assert [each.name for each in found.coordinates] == ["stage.T.x", "stage.T.y", "left.A.angle", "stage.T.angle"]
    assert found.buckling.shape == (4, 2)


def test_what_is_chosen_replaces_loads_and_travel_together_and_the_rest_one_by_one(tmp_path):
    file = written(tmp_path, 'moved = { "stage.T.x" = 0.01 }\nstiffness = ["stage.T.y"]\nsteps = 3\n')
    pulled = last(file, "--load", "stage.T.x=10.5")
    assert set(pulled) == {"stage.T.x", "stage.T.y"}
    assert pulled["stage.T.x"]["effort"] == pytest.approx(10.5)
    by_python = pf.statics(pf.load(file), loads={"stage.T.x": 10.5})
    assert by_python.fraction.size == 4
    assert pulled["stage.T.x"]["travel"] == pytest.approx(by_python.travel("stage.T.x")[-1], rel=1e-9)
    assert pf.statics(pf.load(file), steps=1).fraction.tolist() == [0.0, 1.0]
    assert pf.statics(pf.load(file), moved={}).fraction.tolist() == [0.0]
    # A mechanism alone proposes nothing.
    assert pf.statics(pf.load(file).mechanism).fraction.tolist() == [0.0]


def test_it_is_set_for_one_run(tmp_path):
    file = written(tmp_path, 'moved = { "stage.T.x" = 0.01 }\nsteps = 1\n')
    for name in ("statics.moved.stage.T.x", 'statics.moved."stage.T.x"'):
        assert last(file, "--set", f"{name}=4 mm")["stage.T.x"]["travel"] == pytest.approx(0.004)
    more = last(file, "--set", 'statics.loads."stage.T.y"=-10 N')
    assert more["stage.T.y"]["effort"] == pytest.approx(-10.0)
    assert more["stage.T.x"]["travel"] == pytest.approx(0.01)


def test_it_is_saved(tmp_path):
    for name in library_names():
        model = pf.load(name)
        if model.statics != StaticsDefaults():
            model.save(tmp_path / "kept.toml")
            assert pf.load(tmp_path / "kept.toml").statics == model.statics
            assert "[statics]" in (tmp_path / "kept.toml").read_text()
    guide = pf.load("leaf_spring_guide").mechanism
    asked = StaticsDefaults(loads={"stage.T.x": 1.0}, held=(), steps=4, stiffness=("stage.T.y",))
    pf.Model(guide, statics=asked).save(tmp_path / "new.toml")
    assert pf.load(tmp_path / "new.toml").statics == asked


@pytest.mark.parametrize(
    ("table", "message"),
    [
        ('moved = { "stage.T.z" = 1 }', "statics.moved.stage.T.z: is neither a joint nor a coordinate of a point"),
        ('moved = { "stage.T.x" = "1 N" }', "statics.moved.stage.T.x: a quantity in N where one in m is asked for"),
        ('moved = { "stage.T.angle" = "1 mm" }', "statics.moved.stage.T.angle: a quantity in m where one in rad is"),
        ('loads = { "stage.T.y" = "1 m" }', "statics.loads.stage.T.y: a quantity in m where one in N is asked for"),
        ('loads = { "stage.T.angle" = "1 N" }', "statics.loads.stage.T.angle: a quantity in N where one in N m is"),
        ("moved.stage.T.x = 0.01", 'statics.moved: "stage" is a table: a name with points stands in quotes'),
        ("loads = { A = 1 }", "statics.loads.A: holds its angle"),
        ('torques = { M = "1 N m" }', "statics.torques: unknown motor (got 'M')"),
        ('loads = { "stage.T.x" = 1 }\nmoved = { "stage.T.x" = 1 }', "statics.loads: is given twice"),
        ("steps = 0", "statics.steps: no such number of steps (got 0)"),
        ("steps = 1.5", "statics.steps: should be a valid integer"),
        ("buckling = 21", "statics.buckling: no such number of factors (got 21)"),
        (
            'stifness = ["stage.T.x"]',
            "statics.stifness: unknown field (got ['stage.T.x']); did you mean \"stiffness\"?",
        ),
        ('stiffness = ["stage.T"]', "statics.stiffness: is neither a joint nor a coordinate of a point"),
        ('held = ["stage.T.q"]', "statics.held: is neither a joint nor a coordinate of a point"),
    ],
)
def test_bad_input_names_the_file_and_the_field(table, message, tmp_path):
    file = written(tmp_path, table + "\n")
    done = paraflex("statics", file)
    assert done.returncode == 2
    assert f"{file}: {message}" in done.stderr
    assert len(done.stderr.strip().splitlines()) == 1


@pytest.mark.parametrize(
    ("field", "value", "unit"),
    [
        ("torques.F1", "1 N m", "N"),
        ("loads.rail1", "1 N m", "N"),
        ("moved.rail1", "1 deg", "m"),
        ("moved.Q1", "1 mm", "rad"),
        ("loads.Q1", "1 N", "N m"),
    ],
)
def test_units_at_joints_are_those_of_what_slides_or_turns(field, value, unit, tmp_path):
    table, name = field.split(".")
    file = tmp_path / "platform.toml"
    for text, right in ((value, False), (f"1 {unit}", True)):
        file.write_text(f'{library_text("3prr")}\n[statics]\n{table} = {{ {name} = "{text}" }}\n', encoding="utf-8")
        if right:
            assert getattr(pf.load(file).statics, table) == {name: 1.0}
            continue
        with pytest.raises(pf.InputError, match=f"where one in {unit} is asked for") as caught:
            pf.load(file)
        assert caught.value.field == f"statics.{field}"
