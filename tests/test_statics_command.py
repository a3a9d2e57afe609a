"""`paraflex statics`: what it prints and writes against Python's, figures, bad input; flexures of the library."""

from __future__ import annotations

import json
import math

import pytest

import paraflex as pf
from flexures import EI, LENGTH, truss
from paraflex.reports.provenance import command_line
from paraflex.results import load_results, statics_summary
from shell import paraflex


@pytest.fixture(scope="module")
def guide(tmp_path_factory):
    """What the command says of a guide that is pushed, and where it has written."""
    folder = tmp_path_factory.mktemp("statics")
    options = ["--move", "stage.T.x=10 mm", "--steps", "5", "--stiffness", "stage.T.x", "--stiffness", "stage.T.y"]
    return paraflex("statics", "leaf_spring_guide", *options, "--out", "guide", cwd=folder), folder


def test_a_guide_is_pushed_and_written_as_python_does_it(guide):
    done, folder = guide
    assert done.returncode == 0, done.stderr
    found = pf.statics(
        pf.load("leaf_spring_guide"), moved={"stage.T.x": 0.01}, steps=5, stiffness=["stage.T.x", "stage.T.y"]
    )
    data = load_results(folder / "guide" / "statics.nc")
    assert data["effort"].sel(named="stage.T.x").values == pytest.approx(found.effort("stage.T.x"), abs=1e-9)
    assert data["stiffness"].sel(named="stage.T.y").values == pytest.approx(found.stiffness("stage.T.y"))
    numbers = json.loads((folder / "guide" / "statics.json").read_text())
    assert {key: numbers[key] for key in numbers if key != "digest"} == statics_summary(data)
    assert numbers["last"]["stage.T.y"]["travel"] == pytest.approx(-0.6e-3, rel=0.01)
    assert {file.name for file in (folder / "guide" / "figures").glob("*.png")} == {
        "force_travel.png", "stiffness_travel.png", "deformed_shapes.png"
    }  # fmt: skip
    lines = done.stdout.splitlines()
    assert lines[0] == "leaf-spring guide: 6 equilibria"
    assert any(line.split() == ["stable", "1", "10", "10.6", "1.08", "258.1"] for line in lines)
    assert "safety factor 3.6" in done.stdout
    again = paraflex("plot", "guide", "stiffness_travel", "--out", "again", cwd=folder)
    assert again.returncode == 0, again.stderr
    assert list((folder / "again").glob("stiffness_travel*"))


def test_metrics_are_printed_and_kept(tmp_path):
    asked = ("--metric", "max(abs(stage.T.y))", "--metric", "last(stage.A.x - 1 mm)", "--metric", "frequency")
    given = ("statics", "leaf_spring_guide", "--steps", "2", "--out", "g", "--no-figures", "--no-report")
    done = paraflex(*given, *asked, "--units", "mm", cwd=tmp_path)
    assert done.returncode == 0, done.stderr
    found = pf.statics(pf.load("leaf_spring_guide"), steps=2)
    sunk, held = abs(found.travel("stage.T.y")[-1]), found.frequencies[-1, 0] / (2.0 * math.pi)
    kept = json.loads((tmp_path / "g" / "statics.json").read_text())["metrics"]
    assert {name: one["unit"] for name, one in kept.items()} == dict(zip(asked[1::2], ("m", "m", "Hz"), strict=True))
    assert [one["value"] for one in kept.values()] == pytest.approx([sunk, 9e-3, held], rel=1e-6)
    assert f"max(abs(stage.T.y)): {1e3 * sunk:.4g} mm" in done.stdout
    bad = paraflex(*given, "--force", "--metric", "max(stage.T.y + 1)", cwd=tmp_path)
    assert bad.returncode == 2
    assert bad.stderr.splitlines()[-1].startswith(
        "error: --metric: a sum of a quantity in m and a number without a unit"
    )
    assert json.loads((tmp_path / "g" / "statics.json").read_text())["metrics"] == kept
    asked = json.loads(load_results(tmp_path / "g" / "statics.nc").attrs["parameters"])["run"]
    assert "--metric frequency" in command_line(asked)


def test_films_of_equilibria_are_refused(guide):
    done = paraflex("animate", "guide", "film.gif", cwd=guide[1])
    assert done.returncode == 2
    assert "paraflex plot draws them" in done.stderr


def test_loads_beyond_buckling_are_said_and_drawn(tmp_path):
    done = paraflex(
        "statics", "leaf_spring_guide", "--load", "stage.T.y=-100", "--steps", "4", "--buckling", "2", "--out", "b",
        cwd=tmp_path,
    )  # fmt: skip
    assert done.returncode == 0
    assert "warning: 1 of 5 equilibria are unstable" in done.stdout
    assert "buckling at load factor 0.8635 as seen from the start" in done.stdout
    # Each leaf between its clamps, which stay where they are: four times as much.
    assert "as seen from the start (next 3.454)\n" in done.stdout
    assert pytest.approx(2.0 * math.pi**2 * EI / LENGTH**2, rel=1e-3) == 100.0 * 0.8635
    assert (tmp_path / "b" / "figures" / "buckling_shapes.png").exists()


def test_what_is_not_reached_is_an_error_and_the_steps_until_then_are_kept(tmp_path):
    done = paraflex(
        "statics", "pendulum", "--load", "pivot=3", "--hold", "none", "--steps", "4", "--out", "p", cwd=tmp_path
    )
    assert done.returncode == 1
    assert "error: no equilibrium beyond load factor" in done.stdout
    data = load_results(tmp_path / "p" / "statics.nc")
    assert data["status"].item() == "failed"
    assert data.sizes["step"] > 2


def test_without_anything_given_the_stiffness_of_the_end_effector_is_told():
    numbers = json.loads(paraflex("statics", "raparm_i", "--json").stdout)
    assert set(numbers["last"]) >= {"link4.C.x", "link4.C.y", "A1", "D2"}
    push = pf.statics(pf.load("raparm_i"), loads={"link4.C.y": 1e-3}, steps=1)
    assert numbers["last"]["link4.C.y"]["stiffness"] == pytest.approx(1e-3 / push.travel("link4.C.y")[-1], rel=1e-4)
    held = pf.linearise(pf.load("raparm_i"), balanced=True).held_frequencies() / (2.0 * math.pi)
    assert numbers["natural_frequency"][:4] == pytest.approx(held[:4], rel=1e-6)


def test_motors_are_loaded_by_name_and_what_is_held_replaces_what_motors_hold():
    done = paraflex(
        "statics", "five_bar", "--torque", "left=0.1", "--hold", "distal1.C.x", "--hold", "distal1.C.y", "--json"
    )
    last = json.loads(done.stdout)["last"]
    assert set(last) == {"A1", "distal1.C.x", "distal1.C.y"}
    assert last["A1"]["effort"] == pytest.approx(0.1)
    # The held point takes the torque over its lever: about the motor's axis, from the left elbow on.
    assert math.hypot(last["distal1.C.x"]["effort"], last["distal1.C.y"]["effort"]) > 0.1


def test_a_mechanism_that_turns_freely_is_refused_with_the_remedy():
    for _ in range(3):
        done = paraflex("statics", "five_bar", "--torque", "left=0.1")
        assert done.returncode in (1, 2)
        assert "error: no static equilibrium is found near the start" in done.stderr
        assert "hold joints that turn or slide freely" in done.stderr


@pytest.mark.parametrize(
    ("arguments", "message"),
    [
        (["--load", "stage.T.z=1"], "--load: is neither a joint nor a coordinate of a point (got 'stage.T.z')"),
        (["--load", "stage.T.x"], "--load: not NAME=VALUE (got 'stage.T.x')"),
        (["--load", "stage.T.x=1 mm"], "--load stage.T.x: a quantity in m where one in N is asked for"),
        (["--move", "stage.T.x=1 m", "--hold", "stage.T.x"], "--hold: is given twice"),
        (["--move", "A=1"], "--move: holds its angle"),
        (["--load", "stage.T.x=1", "--steps", "0"], "--steps: no such number of steps (got 0)"),
        (["--load", "stage.T.x=1", "--load", "stage.T.x=2"], "--load: given twice (got 'stage.T.x')"),
        (["--torque", "M1=1"], "--torque: unknown motor (got 'M1')"),
        (["--buckling", "-1"], "--buckling: no such number of factors (got -1)"),
    ],
)
def test_bad_input_names_the_option(arguments, message, tmp_path):
    done = paraflex("statics", "leaf_spring_guide", *arguments, "--out", "x", cwd=tmp_path)
    assert done.returncode == 2
    assert message in done.stderr
    assert len(done.stderr.strip().splitlines()) == 1
    assert not (tmp_path / "x").exists() or not list((tmp_path / "x").glob("statics*"))


def test_figures_of_a_snap_show_both_branches():
    found = pf.statics(truss(), loads={"apex.T.y": -15.0}, held=["apex.T.angle"], steps=5, warning=False)
    data = pf.statics_dataset(found)
    figure = pf.plots.force_travel(data)
    (axes,) = figure.axes
    # The stable parts, the unstable one, two limit points.
    marked = [line for line in axes.lines if line.get_marker() == "o"]
    assert len(marked[0].get_xdata()) == 2
    assert {line.get_linestyle() for line in axes.lines} >= {"-", "--"}
    assert "travel of apex.T.y" in axes.get_xlabel()


def test_the_folded_beam_guide_goes_straight_and_is_half_as_stiff():
    found = pf.statics(
        pf.load("folded_beam_guide"), moved={"shuttle.T.x": 0.01}, steps=2, stiffness=["shuttle.T.x", "shuttle.T.y"]
    )
    assert found.stiffness("shuttle.T.x")[0] == pytest.approx(12.0 * EI / LENGTH**3, rel=1e-3)
    assert abs(found.travel("shuttle.T.y")[-1]) < 1e-6
    # At 5 mm each leaf pair alone would sink by 3/5 y^2 / L, 150 um.


def test_the_cross_spring_pivot_turns_about_its_crossing():
    found = pf.statics(pf.load("cross_spring_pivot"), loads={"stage.C.angle": 0.05}, steps=1)
    assert found.stiffness("stage.C.angle")[0] == pytest.approx(2.0 * EI / LENGTH, rel=1e-4)
