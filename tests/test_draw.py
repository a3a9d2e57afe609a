"""`paraflex draw` and `pf.draw`: names, motors, paths and open joints of a model that has not run."""

from __future__ import annotations

import math
from dataclasses import replace
from pathlib import Path

import matplotlib.text
import numpy as np
import pytest

import paraflex as pf
from paraflex.checks.drawing import pose_of
from paraflex.cli import draw as command
from paraflex.errors import ModelWarning
from paraflex.files import library_names, library_text
from paraflex.mechanism import Deflection
from paraflex.plots.marks import moving_marks
from paraflex.plots.model_drawing import model_drawing
from paraflex.plots.scene import scene
from shell import paraflex

RIDER = """
name = "beam with a rider"
gravity = [0.0, -9.81]
[section.s]
width = 0.02
thickness = 0.003
[material.steel]
youngs_modulus = 210e9
density = 7850
[ground]
A = [0.0, 0.0]
B = [1.0, 0.0]
G = [0.3, 0.4]
S = [0.7, 0.3]
[body.beam]
type = "beam"
length = 1.0
section = "s"
material = "steel"
points = { A = 0.0, M = 0.5, B = 1.0 }
elements = 4
[body.arm]
type = "rigid"
mass = 0.5
inertia = 1e-3
centre_of_mass = [0.2, 0.0]
points = { G = [0.0, 0.0], H = [0.41, 0.0], K = [0.2, 0.0] }
[body.tool]
type = "rigid"
mass = 0.3
inertia = 1e-4
points = { C = [0.0, 0.0], T = [0.0, 0.15] }
[joint]
A = ["ground.A", "beam.A"]
pivot = ["ground.G", "arm.G"]
[joint.roller]
type = "prismatic"
points = ["ground.B", "beam.B"]
[joint.ride]
type = "sliding"
points = ["beam.A", "arm.H"]
[joint.carriage]
type = "prismatic"
points = ["arm.K", "tool.C"]
[motor]
tau = "pivot"
push = "carriage"
[linear_spring.k]
points = ["ground.S", "tool.T"]
stiffness = 100.0
length = 0.1
[load.weight]
type = "force"
point = "beam.M"
force = [0.0, -5.0]
[load.twist]
type = "torque"
point = "arm.K"
torque = 0.3
[assembly.start]
beam = 0.0
arm = -1.35
tool = -1.35
"""


def words(figure) -> list[str]:
    return [text.get_text() for text in figure.findobj(matplotlib.text.Text) if text.get_text()]


def drawn(*arguments) -> str:
    """What the command prints."""
    done = paraflex("draw", *map(str, arguments))
    assert done.returncode == 0, done.stderr
    return done.stdout


@pytest.fixture
def rider(tmp_path: Path) -> Path:
    file = tmp_path / "rider.toml"
    file.write_text(RIDER)
    return file


@pytest.fixture
def open_loop(tmp_path: Path) -> Path:
    """A four-bar whose coupler is too short."""
    file = tmp_path / "short.toml"
    file.write_text(library_text("four_bar").replace("coupler = 0.350", "coupler = 0.050"))
    return file


def test_everything_of_a_model_is_named(rider: Path) -> None:
    said = words(pf.draw(rider))
    named = ("beam", "arm", "tool", "A", "ride", "roller", "pivot, motor tau", "carriage, motor push", "spring k")
    for name in (*named, "load weight", "load twist", "ground.S", "g = 9.81 m/s²", "slides along a beam", "motor"):
        assert name in said, name


@pytest.mark.parametrize("name", library_names())
def test_names_neither_cover_one_another_nor_leave_the_panel(name: str) -> None:
    figure = pf.draw(name)
    figure.canvas.draw()
    (axes,) = figure.axes
    mechanism = pf.load(name).mechanism
    boxes = {text.get_text(): text.get_window_extent() for text in axes.texts}
    assert {body.name for body in mechanism.bodies} <= boxes.keys()
    for motor in mechanism.motors:
        assert any(f"motor {motor.name}" in text for text in boxes)
    panel = axes.get_window_extent()
    for text, box in boxes.items():
        assert min(box.x0 - panel.x0, panel.x1 - box.x1, box.y0 - panel.y0, panel.y1 - box.y1) >= 0.0, text
        for other, there in boxes.items():
            wide, tall = min(box.x1, there.x1) - max(box.x0, there.x0), min(box.y1, there.y1) - max(box.y0, there.y0)
            assert text == other or wide <= 0.0 or tall <= 0.35 * box.height, (text, other)


def test_a_model_with_a_path_stands_where_the_path_begins() -> None:
    model = pf.load("raparm_i")
    shown = pose_of(model)
    figure = model_drawing(shown)
    begins = model.path().evaluate(np.zeros(1)).position[0]
    place = scene(shown.data, np.zeros(1)).trail
    assert place is not None
    assert np.allclose(place[0], begins, atol=1e-9)
    assert {"path square", "end-effector link4.C", "assembly outward, at the start of path square"} <= {*words(figure)}


def test_rails_are_as_long_as_the_travel_along_the_path() -> None:
    shown = pose_of("3prr")
    drawn = scene(shown.data, shown.data["time"].values)
    (joint,) = [one for one in drawn.joints if one.name == "rail1"]
    along = np.array([math.cos(joint.direction[0]), math.sin(joint.direction[0])])
    assert np.ptp(joint.place @ along) > 0.02


def test_the_rail_of_a_moving_carrier_goes_with_it(rider: Path) -> None:
    shown = pose_of(rider)
    drawn = scene(shown.data, np.zeros(1))
    (rail,) = [mark.places[0] for mark in moving_marks(drawn, drawn.limits) if mark.look == "rail"]
    arm = drawn.bodies["arm"][0]
    along = (arm[-1] - arm[0]) / np.linalg.norm(arm[-1] - arm[0])
    across = np.array([-along[1], along[0]])
    assert np.allclose((rail - arm[0]) @ across, 0.0, atol=1e-9)
    # Only joints with motors have their symbol.
    motors = [mark.places for mark in moving_marks(drawn, drawn.limits) if mark.look == "motor"]
    assert len(motors) == 2


def test_a_loop_that_does_not_close_is_drawn_as_given(open_loop: Path) -> None:
    with pytest.warns(ModelWarning, match="a gap of"):
        figure = pf.draw(open_loop)
    said = words(figure)
    assert "Q: open by 0.327 m" in said
    assert "assembly open, as given: it does not close" in said
    # By hand: crank at 1 rad, coupler at 0.4, rocker at 1.6, from its end B back to Q.
    ends = 0.1 * np.exp(1j) + 0.05 * np.exp(0.4j) - 0.25 * np.exp(1.6j)
    assert abs(ends - 0.4) == pytest.approx(0.327, abs=5e-4)


def test_a_path_out_of_reach_is_drawn_beside_the_mechanism(tmp_path: Path) -> None:
    file = tmp_path / "far.toml"
    file.write_text(library_text("slider_crank").replace("rod = 0.240", "rod = 0.120"))
    shown = pose_of(file)
    assert shown.closes
    assert "path stroke: the path's start is out of reach" in shown.problems[0]
    left, right = model_drawing(shown).axes[0].get_xlim()
    assert left < shown.desired[:, 0].min()
    assert right > shown.desired[:, 0].max()


def test_a_start_is_drawn_as_it_deflects_links() -> None:
    spin = pf.load("spin_up").mechanism
    start = pf.Start(deflection={"beam": {"tip": Deflection(transverse=0.05)}})
    shown = pose_of(pf.Model(spin, start=start))
    tip = scene(shown.data, np.zeros(1)).bodies["beam"][0, -1]
    # From the tangent at the root, which is held along x.
    assert tip[1] == pytest.approx(0.05, rel=1e-4)


def test_large_mechanisms_say_what_is_left_out() -> None:
    said = words(pf.draw("chain:70"))
    assert "assembly straight; names of bodies and joints left out" in said


@pytest.mark.parametrize("ending", ["svg", "png", "pdf", "html"])
def test_the_command_writes_what_the_name_says(tmp_path: Path, ending: str) -> None:
    file = tmp_path / f"drawn.{ending}"
    assert str(file) in drawn("five_bar", "--out", file, "--no-open")
    assert file.read_bytes()[:5] in (b"<?xml", b"\x89PNG\r", b"%PDF-", b"<!doc")
    again = paraflex("draw", "five_bar", "--out", str(file))
    assert again.returncode == 2
    assert "--force" in again.stderr


def test_the_command_shows_a_page_where_there_is_a_screen(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    seen = []
    monkeypatch.setattr(command.tempfile, "mkdtemp", lambda prefix: str(tmp_path))
    monkeypatch.setattr(command.webbrowser, "open", lambda address: seen.append(address) or True)
    assert drawn("five_bar")
    assert not seen
    monkeypatch.setattr(command, "_has_screen", lambda: True)
    assert drawn("five_bar")
    assert [address.rpartition("/")[2] for address in seen] == ["five-bar.html"]
    assert drawn("five_bar", "--no-open")
    assert len(seen) == 1
    page = (tmp_path / "five-bar.html").read_text()
    assert "<svg" in page
    assert "<?xml" not in page


def test_the_command_says_joints_motors_and_what_is_open(open_loop: Path, tmp_path: Path) -> None:
    out = drawn(open_loop, "--out", tmp_path / "open.svg")
    assert "drawn as given, with open joints: Q by 0.327 m" in out
    assert "ground.Q, rocker.Q" in out
    assert "paraflex info" in out


def test_what_cannot_be_drawn_is_refused(tmp_path: Path) -> None:
    for options, said in (
        (("--out", str(tmp_path / "a.jpg")), "end it in .html, .svg, .png or .pdf"),
        (("--assembly", "inside-out"), "inside-out"),
        (("--path", "nowhere"), "nowhere"),
    ):
        done = paraflex("draw", "five_bar", *options)
        assert done.returncode == 2
        assert said in done.stderr
    with pytest.raises(pf.InputError, match="not a model"):
        pf.draw(3)
    with pytest.raises(pf.InputError, match="nothing says where the bodies are"):
        pf.draw(replace(pf.load("slider_crank").mechanism, assemblies=()))
