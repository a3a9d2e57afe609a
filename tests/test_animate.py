"""Drawings and films of runs: what they show, where things are in them, files of every kind, what is refused."""

import re
import signal
import sys
import weakref
import xml.etree.ElementTree as ET
from dataclasses import replace
from pathlib import Path

import matplotlib
import numpy as np
import pytest
import xarray as xr
from matplotlib.collections import LineCollection
from PIL import Image
from typer.testing import CliRunner

import paraflex as pf
from paraflex.cli.app import app, main
from paraflex.errors import InputError, OutputError
from paraflex.figures.shapes import figure_of
from paraflex.integrators import IntegrationOptions
from paraflex.motion import simulate_motion
from paraflex.plots import film, mechanism_drawing
from paraflex.plots.film import FilmOptions, animate, find_encoder, plan_film
from paraflex.plots.film_pictures import frames
from paraflex.plots.marks import block, ground_of, is_guide, moving_marks, zigzag
from paraflex.plots.scene import ARROW, scale_bar, scene, select
from paraflex.reports.film import animation
from paraflex.results import motion_dataset
from processes import run, started
from test_kinematics import ROCKER

OLD = Path(__file__).parent / "data" / "schema1.nc"
SMALL = FilmOptions(magnify=50.0, fps=10.0, speed=0.1, size=(320, 240))
SVG = "{http://www.w3.org/2000/svg}"


@pytest.fixture(scope="module")
def data(raparm, square):
    """Two modes of RAParM-I, a tenth of a second; the second stops half way."""
    task = pf.plan(raparm, square, duration=0.1, samples=21)
    whole = task.simulate("++++", options=IntegrationOptions(tolerance=1e-4))
    with pytest.raises(pf.NumericalError) as caught:
        task.simulate("+--+", options=IntegrationOptions(tolerance=1e-4, max_steps=40))
    return pf.tracking_dataset([whole, caught.value.partial])


def own_motion(name, duration):
    model = pf.load(name)
    run = simulate_motion(model.mechanism, duration, samples=11, torques=model.study.torques)
    return motion_dataset(run)


@pytest.fixture(scope="module")
def slider():
    """A slider-crank with a flexible rod, without a path."""
    return own_motion("slider_crank_flexible", 0.01)


# --- Scenes ----------------------------------------------------------------------------------------------------------


def test_a_scene_is_the_data_magnified_and_between_samples_the_line_between(data):
    run = select(data, "++++")
    t = run["time"].values
    drawn = run["shape_base"].values + 50.0 * (run["shape"].values - run["shape_base"].values).astype(float)
    shown = scene(run, np.array([t[3], 0.5 * (t[3] + t[4])]), 50.0)
    places = np.concatenate([shown.bodies[name] for name in run["body"].values], axis=1)
    np.testing.assert_allclose(places[0], drawn[3], rtol=0, atol=1e-6)
    np.testing.assert_allclose(places[1], 0.5 * (drawn[3] + drawn[4]), rtol=0, atol=1e-6)
    # Stations of two bodies at a joint stay together.
    joint = next(joint for joint in shown.joints if joint.name == "B1")
    np.testing.assert_allclose(shown.bodies["link1"][:, -1], joint.place, rtol=0, atol=1e-5)
    np.testing.assert_allclose(shown.trails[0][0], run["end_effector"].values[3], rtol=0, atol=1e-5)
    left, right, bottom, top = shown.limits
    assert left < drawn[..., 0].min()
    assert right > drawn[..., 0].max()
    assert bottom < drawn[..., 1].min()
    assert top > drawn[..., 1].max()


def test_the_trail_is_that_of_the_point_asked_for(data):
    run = select(data, "++++")
    t = run["time"].values
    shown = scene(run, t, 1.0, ["link1.B1"])
    np.testing.assert_allclose(shown.trails[0], run["point_position"].sel(point="link1.B1"), rtol=0, atol=1e-5)
    film = plan_film(data, ["++++"], replace(SMALL, point="link1.B1"))
    assert film.scenes[0].followed == shown.followed
    assert film.caption.endswith(", trail of link1.B1")
    figure = pf.plots.mechanism_drawing(data, "++++", float(t[10]), 1.0, point="link1.B1")
    ends = [line.get_xydata()[-1] for line in figure.axes[0].get_lines() if len(line.get_xydata()) == 11]
    np.testing.assert_allclose(ends[0], shown.trails[0][10], rtol=0, atol=1e-6)


def test_several_trails(data, tmp_path):
    points = ["link1.B1", "link4.C"]
    film = plan_film(data, ["++++"], replace(SMALL, point=points))
    for trail, point in zip(film.scenes[0].trails, points, strict=True):
        places = select(data, "++++")["point_position"].sel(point=point)
        np.testing.assert_allclose(trail[[0, -1]], places[[0, -1]], rtol=0, atol=1e-5)
    assert film.caption.endswith(", trail of link1.B1, link4.C")
    drawn = tmp_path / "film.svg"
    animate(data, drawn, ["++++"], replace(SMALL, point=points))
    assert drawn.read_text(encoding="utf-8").count('stroke-dashoffset="') == 2


def test_the_coupler_curves_of_a_driven_motion_are_trails(tmp_path):
    (tmp_path / "rocker.toml").write_text(ROCKER, encoding="utf-8")
    data = pf.motion_dataset(pf.kinematics(pf.load(tmp_path / "rocker.toml"), "O"))
    film = plan_film(data, (), SMALL)
    (trail,) = film.scenes[0].trails
    places = data["point_position"].sel(point="coupler.P")
    np.testing.assert_allclose(trail[[0, -1]], places[[0, -1]], rtol=0, atol=1e-5)


def test_true_deflections_have_no_stiff_twin_and_after_the_end_the_last_picture_stays(data):
    run = select(data, "+--+")
    reached = run["time"].values[np.isfinite(run["shape"].values[:, 0, 0])][-1]
    assert reached < 0.099
    shown = scene(run, np.array([reached, 0.1]))
    assert shown.stiff == {}
    assert shown.reached == reached
    for places in shown.bodies.values():
        assert np.isfinite(places).all()
        np.testing.assert_array_equal(places[0], places[1])


def test_a_slider_has_a_block_on_a_rail_that_is_long_enough(slider):
    run = select(slider, None)
    shown = scene(run, run["time"].values)
    joint = next(joint for joint in shown.joints if joint.kind == "slider")
    assert not is_guide(joint, shown.limits)
    corners = block(joint, shown.limits)
    np.testing.assert_allclose(corners[:, :4].mean(axis=1), joint.place, rtol=0, atol=1e-12)
    (rail,), strokes = ground_of(joint, shown.limits)
    assert rail[:, 0].min() < corners[..., 0].min()
    assert rail[:, 0].max() > corners[..., 0].max()
    # The block stands on the rail, the ground hangs under it.
    np.testing.assert_allclose(rail[:, 1], corners[..., 1].min(), rtol=0, atol=1e-9)
    assert strokes[:, 1, 1].max() < rail[0, 1]


def test_springs_hang_between_their_ends(slider):
    run = select(own_motion("andrews", 0.001), None)
    shown = scene(run, run["time"].values)
    assert len(shown.springs) == len(shown.anchors) == 1
    (ends,) = shown.springs.values()
    line = zigzag(ends, shown.limits)
    np.testing.assert_allclose(line[:, [0, -1]], ends, rtol=0, atol=1e-12)
    assert any(np.allclose(shown.anchors[0], end) for end in ends[0])


def test_a_plate_is_drawn_up_to_where_it_closes():
    corners = np.array([[0.0, 0.0], [1.0, 0.0], [0.0, 1.0], [0.0, 0.0], [0.3, 0.3]])
    assert len(figure_of(corners)) == 4
    assert len(figure_of(corners[:3])) == 3


def test_scale_bars_are_round(data):
    limits = scene(select(data, "++++"), np.array([0.0])).limits
    assert scale_bar(limits) == (0.1, "100 mm")
    assert scale_bar(limits._replace(left=0.0, right=30.0)) == (5.0, "5 m")
    assert scale_bar(limits._replace(left=0.0, right=2e-4)) == (5e-5, "50 µm")


# --- A drawing -------------------------------------------------------------------------------------------------------


def test_a_drawing_has_the_links_where_they_are(data):
    figure = mechanism_drawing(data, "++++", 0.05, 20.0)
    links = [each for each in figure.axes[0].collections if isinstance(each, LineCollection)]
    segments = max(links, key=lambda each: each.get_linewidth()[0]).get_segments()
    run = data.sel(mode="++++", time=0.05)
    drawn = (run["shape_base"] + 20.0 * (run["shape"] - run["shape_base"])).values
    assert len(segments) == 8
    np.testing.assert_allclose(np.concatenate(segments), drawn, rtol=0, atol=1e-6)
    texts = " ".join(text.get_text() for text in figure.texts)
    assert "++++" in texts
    assert "deflections × 20" in texts
    assert "mm" in texts


@pytest.mark.parametrize(
    ("arguments", "field"),
    [
        ({"mode": "+++"}, "mode"),
        ({"mode": "++++", "time": 0.2}, "time"),
        ({"mode": "++++", "magnify": -1.0}, "magnify"),
        ({"mode": "++++", "magnify": np.nan}, "magnify"),
        ({"mode": "++++", "theme_name": "drak"}, "theme"),
        ({"mode": "++++", "model": "linear"}, "model"),
    ],
)
def test_what_cannot_be_drawn_is_refused(data, arguments, field):
    with pytest.raises(InputError) as caught:
        mechanism_drawing(data, **arguments)
    assert caught.value.field == field
    assert caught.value.remedy


def test_results_of_the_first_schema_have_no_shapes_to_draw():
    with pytest.raises(InputError, match=r"no shapes of links.*run the study again"):
        mechanism_drawing(pf.open_results(OLD))


def test_of_a_verification_the_model_asked_for_is_drawn(data):
    models = xr.concat([data, data.assign(shape=data["shape"] + 1.0)], xr.Variable("model", ["linear", "moved"]))
    models.attrs["reference"] = "moved"
    places = {
        name: plan_film(models, ["++++"], FilmOptions(model=name, magnify=1.0)).scenes[0].bodies["link1"]
        for name in ("linear", None)
    }
    np.testing.assert_allclose(places[None], places["linear"] + 1.0, rtol=0, atol=1e-6)
    with pytest.raises(InputError, match=r'model: no such model.*did you mean "linear"'):
        plan_film(models, ["++++"], FilmOptions(model="linaer"))


# --- Films -----------------------------------------------------------------------------------------------------------


def test_a_film_plays_the_run_at_its_speed(data):
    film = plan_film(data, ["++++"], SMALL)
    assert len(film.time) == 11
    np.testing.assert_allclose(film.time, np.linspace(0.0, 0.1, 11))
    # By default a round speed at which it takes five seconds or more.
    assert plan_film(data, ["++++"]).speed == pytest.approx(0.02)


def test_pictures_of_a_film_leave_the_settings_of_matplotlib_as_they_are(data):
    before = dict(matplotlib.rcParams)
    pictures = frames(plan_film(data, ["++++"], FilmOptions(size=(120, 100))))
    first, second = next(pictures), next(pictures)
    assert dict(matplotlib.rcParams) == before
    matplotlib.rcParams["lines.linewidth"] = before["lines.linewidth"] + 1.0
    pictures.close()
    assert matplotlib.rcParams["lines.linewidth"] == before["lines.linewidth"] + 1.0
    assert np.any(first != second)


def test_a_gif_moves_and_keeps_its_ground(data, tmp_path):
    animate(data, tmp_path / "film.gif", ["++++"], SMALL)
    with Image.open(tmp_path / "film.gif") as film:
        assert film.size == (320, 240)
        assert film.n_frames == 11
        assert film.info["duration"] == 100
        assert film.info["loop"] == 0
        pictures = []
        for k in (0, 10):
            film.seek(k)
            pictures.append(np.asarray(film.convert("RGB")).astype(int))
    np.testing.assert_array_equal(pictures[0][3, 160], [255, 255, 255])
    assert np.sum(np.any(pictures[0] != pictures[1], axis=-1)) > 200


@pytest.fixture
def drawn(data, monkeypatch):
    """Pictures as they are asked for, two of them as the one before: copies, and how many there are at once."""
    reduced, copies, alive, most = film._reduced, [], [], [0]

    def kept(film, report):
        for k, picture in enumerate(reduced(film, report)):
            picture = copies[1].copy() if k in (2, 3) else picture
            copies.append(picture.copy())
            alive.append(weakref.ref(picture))
            most[0] = max(most[0], sum(each() is not None for each in alive))
            yield picture

    monkeypatch.setattr(film, "_reduced", kept)
    return copies, most


def test_a_gif_is_what_was_drawn_and_few_pictures_are_held(data, drawn, tmp_path):
    copies, most = drawn
    animate(data, tmp_path / "film.gif", ["++++"], SMALL)
    assert len(copies) == 11
    # Pillow's own writer holds all eleven.
    assert most[0] <= 3
    with Image.open(tmp_path / "film.gif") as film:
        # Those that do not move are one that lasts longer.
        assert film.n_frames == 9
        for k, shown in enumerate(copies[:2] + copies[4:]):
            film.seek(k)
            np.testing.assert_array_equal(np.asarray(film.convert("RGB")), np.asarray(shown.convert("RGB")))
            assert film.info["duration"] == (300 if k == 1 else 100)


def test_a_folder_of_pictures_and_one_picture(data, slider, tmp_path):
    told = []
    animate(data, tmp_path / "frames", ["++++", "+--+"], SMALL, on_progress=lambda *how_far: told.append(how_far))
    names = sorted(each.name for each in (tmp_path / "frames").iterdir())
    assert names == [f"frame_{i:04d}.png" for i in range(1, 12)]
    assert told == [(i, 11) for i in range(1, 12)]
    with Image.open(tmp_path / "frames" / names[-1]) as picture:
        assert picture.size == (320, 240)
        last = np.asarray(picture)
    # Both panels show something: link colours left and right.
    for half in (last[:, :160], last[:, 160:]):
        assert np.sum(np.ptp(half.astype(int), axis=-1) > 60) > 100
    animate(slider, tmp_path / "one.png", (), FilmOptions(at=0.005, theme="dark", size=(300, 201)))
    with Image.open(tmp_path / "one.png") as picture:
        # Even, as encoders want it.
        assert picture.size == (300, 202)
        assert picture.getpixel((2, 100)) == (0x14, 0x18, 0x1B)


def test_an_svg_plays_by_itself(data, tmp_path):
    file = tmp_path / "film.svg"
    film = animate(data, file, ["++++"], SMALL)
    text = file.read_text(encoding="utf-8")
    assert not re.search(r"href|url\(|<script|@import", text)
    root = ET.fromstring(text)
    moves = list(root.iter(f"{SVG}animate"))
    assert {move.get("dur") for move in moves} == {"1.000s"}
    assert {move.get("repeatCount") for move in moves} == {"indefinite"}
    links = [line for line in root.iter(f"{SVG}polyline") if line.get("stroke-linecap") == "round"]
    assert len(links) == 8
    # Pixels of the last picture are places of the last sample, by one scale and one offset.
    places = np.concatenate([shown[-1, [0, 8, -1]] for shown in film.scenes[0].bodies.values()])
    values = [line.find(f"{SVG}animate").get("values").split(";") for line in links]
    assert {len(one) for one in values} == {11}
    curves = [np.array([pair.split(",") for pair in one[-1].split()], dtype=float) for one in values]
    ends = np.concatenate([[curve[0], curve[0], curve[-1]] for curve in curves])
    scale = np.ptp(ends[:, 0]) / np.ptp(places[:, 0])
    pixels = ends[0] + scale * (places - places[0]) * [1.0, -1.0]
    np.testing.assert_allclose(ends[::3], pixels[::3], rtol=0, atol=0.2)
    np.testing.assert_allclose(ends[2::3], pixels[2::3], rtol=0, atol=0.2)
    # Half way along a link the line, whose straight parts have fewer points, passes by where it is bent to.
    for curve, middle in zip(curves, pixels[1::3], strict=True):
        assert _distance(middle, curve) < 0.6
    assert max(_distance(middle, curve[[0, -1]]) for curve, middle in zip(curves, pixels[1::3], strict=True)) > 2.0
    assert "deflections × 50" in text


def _distance(place, curve):
    """Of a place from a line through points."""
    starts, steps = curve[:-1], np.diff(curve, axis=0)
    part = np.clip(np.sum((place - starts) * steps, axis=1) / np.sum(steps**2, axis=1), 0.0, 1.0)
    return np.min(np.linalg.norm(starts + part[:, None] * steps - place, axis=1))


def test_names_are_escaped_in_an_svg(data, tmp_path):
    odd = data.assign_attrs(mechanism='<b>"5R" & more</b>')
    animate(odd, tmp_path / "film.svg", ["++++"], SMALL)
    root = ET.fromstring((tmp_path / "film.svg").read_text(encoding="utf-8"))
    assert any(text.text == '<b>"5R" & more</b>' for text in root.iter(f"{SVG}text"))


def test_an_mp4_decodes_to_what_was_drawn(data, tmp_path):
    animate(data, tmp_path / "film.mp4", ["++++"], SMALL)
    animate(data, tmp_path / "frames", ["++++"], SMALL)
    decode = [find_encoder(), "-loglevel", "error", "-i", str(tmp_path / "film.mp4"), "-f", "rawvideo",
              "-pix_fmt", "rgb24", "-"]  # fmt: skip
    raw = run(*decode, text=False, check=True).stdout
    film = np.frombuffer(raw, dtype=np.uint8).reshape(-1, 240, 320, 3).astype(float)
    assert len(film) == 11
    for k in (0, 10):
        with Image.open(tmp_path / "frames" / f"frame_{k + 1:04d}.png") as picture:
            assert np.mean(np.abs(film[k] - np.asarray(picture))) < 3.0
    assert np.mean(np.abs(film[0] - film[10])) > 0.2


def test_without_an_encoder_the_package_is_named(data, tmp_path, monkeypatch):
    monkeypatch.setattr("shutil.which", lambda name: None)
    monkeypatch.setitem(sys.modules, "imageio_ffmpeg", None)
    with pytest.raises(InputError, match=r"pip install 'paraflex\[video\]'"):
        animate(data, tmp_path / "film.mp4", ["++++"], SMALL)
    assert not list(tmp_path.iterdir())


def test_an_encoder_that_gives_up_leaves_nothing(data, tmp_path, monkeypatch):
    fake = tmp_path / "ffmpeg"
    fake.write_text("#!/bin/sh\necho no such codec >&2\nexit 1\n")
    fake.chmod(0o755)
    monkeypatch.setattr("shutil.which", lambda name: str(fake))
    with pytest.raises(OutputError, match=r"gave up .no such codec."):
        animate(data, tmp_path / "film.mp4", ["++++"], SMALL)
    assert [each.name for each in tmp_path.iterdir()] == ["ffmpeg"]


@pytest.mark.parametrize("name", ["film.gif", "film.mp4", "frames"])
def test_what_is_interrupted_leaves_nothing(data, tmp_path, name):
    def interrupt(done, total):
        if done == 3:
            raise KeyboardInterrupt

    with pytest.raises(KeyboardInterrupt):
        animate(data, tmp_path / name, ["++++"], SMALL, on_progress=interrupt)
    assert not list(tmp_path.iterdir())


@pytest.mark.parametrize(
    ("name", "options", "message"),
    [
        ("film.avi", {}, "unknown kind of film"),
        ("film.gif", {"fps": 0.0}, "fps: must be positive"),
        ("film.gif", {"fps": 1000.0}, "more pictures a second than a screen shows"),
        ("film.gif", {"speed": np.inf}, "speed: must be positive"),
        ("film.gif", {"speed": 1e-6}, "choose a higher speed"),
        ("film.gif", {"size": (10, 10)}, "pixels"),
        ("film.png", {"at": 3.0}, "outside the run"),
    ],
)
def test_options_that_make_no_film(data, tmp_path, name, options, message):
    with pytest.raises(InputError, match=message):
        animate(data, tmp_path / name, ["++++"], FilmOptions(**options))
    assert not list(tmp_path.iterdir())


# --- The command -----------------------------------------------------------------------------------------------------


@pytest.fixture(scope="module")
def folder(data, tmp_path_factory):
    folder = tmp_path_factory.mktemp("run")
    pf.save_results(data, folder / "results.nc")
    return folder


def test_the_command_makes_a_film_and_writes_over_none(folder, tmp_path):
    out = tmp_path / "film.svg"
    arguments = ["animate", str(folder), str(out), "--mode", "++++", "--magnify", "20", "--size", "400x300"]
    done = CliRunner().invoke(app, arguments)
    assert done.exit_code == 0, done.output
    assert 'viewBox="0 0 400 300"' in out.read_text(encoding="utf-8")
    again = CliRunner().invoke(app, arguments)
    assert isinstance(again.exception, InputError)
    assert "--force" in str(again.exception)
    assert CliRunner().invoke(app, [*arguments, "--force"]).exit_code == 0


@pytest.mark.parametrize(
    ("arguments", "message"),
    [
        (["--size", "wide"], "--size: not a size (got 'wide'); write width and height, such as 1280x720"),
        (["--mode", "+++"], "--mode: no such mode in these results (got '+++')"),
        (["--theme", "drak"], "--theme: unknown theme (got 'drak'); did you mean \"dark\"?"),
        (["--magnify", "-2"], "--magnify: must not be negative"),
        (["--magnify", "nan"], "--magnify: not a finite number (got nan)"),
        (["--point", "link1.Z"], "--point: no such point in these results (got 'link1.Z'); one of "),
    ],
)
def test_the_command_names_the_option_at_fault(folder, tmp_path, monkeypatch, capsys, arguments, message):
    monkeypatch.setattr(sys, "argv", ["paraflex", "animate", str(folder), str(tmp_path / "film.svg"), *arguments])
    with pytest.raises(SystemExit) as caught:
        main()
    assert caught.value.code == 2
    told = capsys.readouterr().err
    assert told.startswith(f"error: {message}")
    assert told.count("\n") == 1


def test_ctrl_c_ends_it_with_130_and_no_half_film(folder, tmp_path):
    arguments = ["animate", folder, tmp_path / "film.gif", "--speed", "0.0002", "--mode", "++++"]
    with started(sys.executable, "-m", "paraflex", *arguments) as child:
        child.until((tmp_path / "film.gif.part").exists)
        child.send(signal.SIGINT)
        done = child.end()
    assert done.returncode == 130
    assert "interrupted: nothing was written" in done.stderr
    assert not list(tmp_path.iterdir())


BLOW = """
[load.blow]
type = "force"
point = "rod.P"
pieces = [ { until = 0.0501, force = [0.0, 0.0] }, { until = 0.0521, force = [0.0, -50.0] }, { force = [20.0, 0.0] } ]
"""


@pytest.fixture(scope="module")
def pushed(tmp_path_factory):
    """A pendulum with a blow of 2 ms, then a steady force."""
    file = tmp_path_factory.mktemp("pushed") / "pushed.toml"
    file.write_text(
        """
name = "pushed"
[ground]
O = [0.0, 0.0]
[body.rod]
type = "rigid"
mass = 1.0
inertia = 0.1
centre_of_mass = [0.5, 0.0]
points = { O = [0.0, 0.0], P = [1.0, 0.0] }
[joint]
O = ["ground.O", "rod.O"]
[assembly.start]
rod = -0.5
"""
        + BLOW
    )
    return motion_dataset(simulate_motion(pf.load(file).mechanism, 0.1, start="start", samples=201))


def test_loads_are_arrows_as_long_as_they_are_large_while_they_act(pushed):
    times = np.linspace(0.0, 0.1, 11)
    shown = scene(select(pushed, None), times)
    (drawn_load,) = shown.loads
    # All of 50 N downwards is drawn in the picture nearest to the blow, which lies between two; then two fifths, 20 N.
    np.testing.assert_allclose(drawn_load.force[:5], 0.0)
    np.testing.assert_allclose(drawn_load.force[5], [0.0, -1.0])
    np.testing.assert_allclose(drawn_load.force[6:], [[0.4, 0.0]] * 5)
    assert shown.load_keys == {"force": "load blow: 50 N"}
    (line,) = [mark.places for mark in moving_marks(shown, shown.limits) if mark.look == "load"]
    (head,) = [mark.places for mark in moving_marks(shown, shown.limits) if mark.look == "head"]
    long = np.linalg.norm(head[:, 0] - line[:, 0], axis=1)
    np.testing.assert_allclose(long / (ARROW * shown.limits.size), [0.0] * 5 + [1.0] + [0.4] * 5, atol=1e-12)
    np.testing.assert_allclose(head[:, 0], drawn_load.place)
    # Results of earlier versions hold no loads.
    assert not scene(pushed.drop_vars(["load_force", "load_torque"]), times).loads


def test_a_page_has_the_loads_and_their_key(pushed):
    film = animation(pushed, ())
    assert film is not None
    page = film.to_dict()
    assert [key[2] for key in page["keys"][0]] == ["load blow: 50 N"]
    assert [piece[:2] for piece in page["marks"][0][1]["pieces"]][-2:] == [["load", "blow"], ["head", ""]]
