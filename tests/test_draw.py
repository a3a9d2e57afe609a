"""`paraflex draw` and `pf.draw`: names, motors, paths and open joints of a model that has not run."""

from __future__ import annotations

import math
from dataclasses import replace
from pathlib import Path

import matplotlib.text
import numpy as np
import pytest
from matplotlib.backends.backend_agg import FigureCanvasAgg
from matplotlib.patches import PathPatch

import paraflex as pf
from paraflex.checks.drawing import pose_of
from paraflex.cli import draw as command
from paraflex.errors import ModelWarning
from paraflex.files import library_names, library_text
from paraflex.mechanism import ConstantSpeed, Deflection, PrescribedAngle
from paraflex.plots.marks import SYMBOLS, moving_marks
from paraflex.plots.model_drawing import model_drawing
from paraflex.plots.model_marks import acting_arrows, sensor_marks
from paraflex.plots.scene import DrawnJoint, Limits, scene
from paraflex.plots.signs import joint_sign
from paraflex.plots.themes import THEMES
from paraflex.results.acting import acting_load
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
    for name in (
        *named,
        "weight 5 N",
        "twist 0.3 N m",
        "ground.S",
        "g = 9.81 m/s²",
        "slides along a beam",
        "motor",
        "load",
    ):
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
    (place,) = scene(shown.data, np.zeros(1)).trails
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
    with pytest.raises(pf.InputError, match="the poses of the bodies are unknown"):
        pf.draw(replace(pf.load("slider_crank").mechanism, assemblies=()))


LATER = """
[load.blow]
type = "force"
point = "tool.T"
pieces = [ { until = 0.1, force = [0.0, 0.0] }, { until = 0.2, force = [-200.0, 0.0] }, { force = [0.0, 0.0] } ]
[load.swing]
type = "torque"
point = "tool.C"
torque = "-2 * sin(10 * t)"
[load.idle]
type = "force"
point = "beam.M"
force = [0.0, 0.0]
[study]
duration = 0.5
"""
SENSORS = """
[sensor]
turn = { type = "encoder", joint = "pivot" }
rate = { type = "tachometer", joint = "carriage" }
acc = { type = "acceleration", point = "tool.T", axis = "x", body = "tool" }
high = { type = "position", point = "arm.K", axis = "y" }
fast = { type = "velocity", point = "beam.B", axis = 0.5 }
root = { type = "strain", body = "beam", at = 0.1 }
bear = { type = "joint_force", joint = "A", axis = "y" }
mom = { type = "joint_force", joint = "roller", axis = "moment" }
tip = { type = "deflection", point = "beam.M", axis = "y" }
"""


def with_lines(file: Path, more: str) -> Path:
    file.write_text(file.read_text() + more)
    return file


def acting(shown):
    drawn = scene(shown.data, shown.data["time"].values)
    return acting_arrows(shown, drawn, drawn.limits)


def test_loads_have_their_sizes_and_say_from_when_they_act(rider: Path) -> None:
    loads = {one.name: one for one in acting(pose_of(with_lines(rider, LATER))).loads}
    assert {name: (one.size, one.later) for name, one in loads.items()} == {
        "weight": ("5 N", False), "twist": ("0.3 N m", False), "blow": ("200 N from 0.1 s", True),
        "swing": ("up to 2 N m", False), "idle": ("0 N", True),
    }  # fmt: skip
    # As long as they are large, and to where they act: -200 N pushes to the left.
    blow, weight = (np.diff(loads[name].arrow.outline[[0, 2]], axis=0)[0] for name in ("blow", "weight"))
    assert blow[0] < 0.0 == pytest.approx(blow[1])
    assert np.linalg.norm(blow) > 2.0 * np.linalg.norm(weight)
    said = words(pf.draw(rider))
    assert {"blow 200 N from 0.1 s", "load", "load, not yet at the start"} <= {*said}
    out = drawn(rider, "--no-open")
    assert "load blow: force at tool.T, 200 N from 0.1 s" in out
    assert "load swing: torque at tool.C, up to 2 N m" in out


def test_a_load_that_begins_between_the_times_looked_at_is_told_exactly() -> None:
    step = pf.PiecewiseProfile((pf.ConstantSpeed(0.0, 0.0), pf.ConstantSpeed(0.0, 3.0)), (0.0123,))
    late = acting_load(pf.PointForce("f", pf.PointRef("a", "b"), (step, 0.0)), 1.0)
    assert late.begins == pytest.approx(0.0123, abs=1e-12)


def test_an_arrow_says_which_way_a_joint_is_driven(tmp_path: Path) -> None:
    four_bar = pf.load("four_bar").mechanism
    for speed, by, way in ((2.0, 1.0, "anticlockwise"), (-2.0, -1.0, "clockwise")):
        drive = PrescribedAngle("drive", four_bar.joints[0].name, ConstantSpeed(1.0, speed))
        shown = pose_of(replace(four_bar, motors=(), modes=(), prescribed=(drive,)))
        (arrow,) = acting(shown).moves
        place = shown.data["joint_position"].values[0, 0]
        around = np.unwrap(np.angle((arrow.line - place) @ [1.0, 1j]))
        assert np.sign(around[-1] - around[0]) == by
        assert "prescribed motion" in words(model_drawing(shown))
        lines = command._drives(shown.mechanism, shown)
        assert lines == [f"prescribed drive: crank at {drive.joint} {way}, 2 rad/s"]


def test_motors_on_a_path_have_arrows_of_their_first_movement() -> None:
    shown = pose_of("3prr")
    drawn_scene = scene(shown.data, shown.data["time"].values)
    moves = acting_arrows(shown, drawn_scene, drawn_scene.limits).moves
    sliding = [joint for joint in drawn_scene.joints if joint.driven]
    assert len(moves) == len(sliding) == 3
    for joint, arrow in zip(sliding, moves, strict=True):
        # The first place that is a hundredth of the travel away.
        away = np.linalg.norm(joint.place - joint.place[0], axis=1)
        moved = joint.place[np.argmax(away > 0.02 * away.max())] - joint.place[0]
        assert np.dot(arrow.line[-1] - arrow.line[0], moved) > 0.0


def test_all_kinds_of_sensors_are_marked_with_their_axes(rider: Path) -> None:
    shown = pose_of(with_lines(rider, SENSORS))
    limits = scene(shown.data, np.zeros(1)).limits
    marks = {one.name: one for one in sensor_marks(shown, limits)}
    assert len(marks) == len(shown.mechanism.sensors) == 9
    axes = {name: np.angle((one.arrow.line[-1] - one.place) @ [1.0, 1j]) for name, one in marks.items()}
    tool = shown.angles["tool"]
    expected = {"high": np.pi / 2, "fast": 0.5, "root": 0.0, "bear": np.pi / 2, "tip": np.pi / 2, "acc": tool}
    for name, angle in expected.items():
        assert axes[name] == pytest.approx(angle, abs=1e-6), name
    assert axes["rate"] == pytest.approx(shown.angles["arm"], abs=1e-6)
    assert [name for name, one in marks.items() if one.arrow.round] == ["turn", "mom"]
    np.testing.assert_allclose(marks["root"].place, [0.1, 0.0], atol=1e-9)
    np.testing.assert_allclose(marks["turn"].place, [0.3, 0.4], atol=1e-9)
    said = words(model_drawing(shown))
    assert {"sensor", "encoder turn", "strain root", "joint force mom"} <= {*said}
    assert "turn (encoder)" in drawn(rider, "--no-open")


@pytest.mark.parametrize("kind", SYMBOLS)
def test_signs_of_the_legend_are_those_that_are_drawn(kind: str) -> None:
    limits, look = Limits(0.0, 1.0, 0.0, 0.8), THEMES["light"]
    sign = joint_sign(kind, limits, look, 1.0)
    joint = scene_joint(kind)
    shapes = [shape(joint, limits)[0] for shape in SYMBOLS[kind].values()]
    assert len(shapes) == len(sign.pieces)
    for (places, looks), shape in zip(sign.pieces, shapes, strict=True):
        np.testing.assert_allclose(places, shape)
        assert ("marker" in looks) == (len(places) == 1)
    assert len(joint_sign(kind, limits, look, 1.0, driven=True).pieces) == len(shapes) + 1


def scene_joint(kind: str) -> DrawnJoint:
    return DrawnJoint("", kind, False, np.zeros((1, 2)), np.array([np.nan if kind in ("pin", "weld") else 0.0]))


def test_the_sign_of_what_slides_along_a_beam_stands_in_the_legend_at_its_size(rider: Path) -> None:
    figure = pf.draw(rider)
    FigureCanvasAgg(figure).draw()
    (legend,) = figure.legends
    blocks = [one for one in legend.findobj(PathPatch) if len(one.get_path().vertices) == 5]
    (axes,) = figure.axes
    corners = [path.vertices for one in axes.collections for path in one.get_paths() if len(path.vertices) == 5]
    long = [np.linalg.norm(np.diff(axes.transData.transform(places[:2]), axis=0)) for places in corners]
    wide = [np.ptp(one.get_transform().transform(one.get_path().vertices)[:, 0]) for one in blocks]
    assert blocks
    for width in wide:
        assert any(width == pytest.approx(length, rel=1e-6) for length in long)


def test_a_column_of_motors_stands_only_where_there_are_motors(tmp_path: Path) -> None:
    (row,) = [line for line in drawn("five_bar", "--out", tmp_path / "a.svg").splitlines() if "between" in line]
    assert "motor" in row
    bare = tmp_path / "bare.toml"
    bare.write_text(RIDER.replace('[motor]\ntau = "pivot"\npush = "carriage"\n', ""))
    (row,) = [line for line in drawn(bare, "--out", tmp_path / "b.svg").splitlines() if "between" in line]
    assert "motor" not in row
