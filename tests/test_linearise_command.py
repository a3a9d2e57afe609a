"""`paraflex linearise`: what it prints and writes against Python's models, mode shapes, branches, bad input."""

from __future__ import annotations

import json
from dataclasses import replace

import numpy as np
import pytest

import paraflex as pf
from conftest import DESKTOP
from paraflex.cli.repeated import repeated_runs
from paraflex.dynamics.points import marker_place
from paraflex.files import library_text
from paraflex.linear.branches import pole_branches
from paraflex.mechanism import Assembly, LossFactor, Mechanism, Motor, PointRef, RevoluteJoint
from paraflex.reports import linear_page, save_page
from paraflex.results import linear_dataset, linear_summary
from paraflex.results.linear_motion import drawn_modes, modal_motion
from paraflex.results.linear_summary import limiting_zero, roots
from shell import paraflex
from test_linear import HELD, hub_beam, parallelogram, upper

# --- Motions with motors held -----------------------------------------------------------------------------------------


def test_held_poles_are_the_zeros_of_motors_to_their_encoders():
    """With damping of the material, found from the equations of what moves and from the pencil of zeros."""
    model = pf.linearise(hub_beam(0.1, 0.5, 0.0, LossFactor(0.02, 1.0)))
    held, zeros = model.motions(["tau"]).poles, model.zeros(outputs=["O"])
    assert np.all(held.real < 0.0)
    first = held[held.imag > 0.0][:4]
    assert first == pytest.approx(zeros[zeros.imag > 0.0][:4], rel=1e-8)
    assert np.abs(model.motions().poles[:2]) == pytest.approx([0.0, 0.0], abs=1e-12)


def test_a_motor_that_moves_only_as_others_do_is_held_with_them():
    model = pf.linearise(parallelogram())
    assert model.motions(["tau1", "tau2"]).frequencies[:2] == pytest.approx([2.016298981807, 15.41820571698], rel=1e-6)
    rigid = pf.linearise(parallelogram().rigid())
    # One of the two motors' joints is the state; either holds the mechanism.
    assert [rigid.motions([name]).poles.size for name in ("tau1", "tau2")] == [0, 0]
    with pytest.raises(pf.InputError, match="is not a motor"):
        rigid.motions(["tau9"])


def pair(left: float, right: float) -> Mechanism:
    """Two beams on hubs of their own, their stiffness multiplied."""

    def beam(name, factor):
        one = hub_beam(0.1, 0.5, 0.0).bodies[0]
        return replace(
            one, name=name, material=replace(one.material, youngs_modulus=factor * one.material.youngs_modulus)
        )

    return Mechanism(
        "pair", ground={"A": (0.0, 0.0), "B": (0.0, 2.0)}, bodies=(beam("a", left), beam("b", right)),
        joints=tuple(RevoluteJoint(n, PointRef("ground", n), PointRef(n.lower(), "O")) for n in "AB"),
        motors=(Motor("tau1", "A"), Motor("tau2", "B")), assemblies=(Assembly("straight", {"a": 0.0, "b": 0.0}),),
    )  # fmt: skip


def test_branches_cross_where_frequencies_do():
    """One beam stiffens past the other: its branch goes on, though it is no longer the lowest."""
    models = [pf.linearise(pair(factor, 2.0)) for factor in (1.0, 1.5, 2.5, 4.0)]
    found = np.abs(pole_branches(models, ["tau1", "tau2"], 2))
    clamped = 2.016298981807
    assert found[:, 0] == pytest.approx([clamped * np.sqrt(factor) for factor in (1.0, 1.5, 2.5, 4.0)], rel=1e-6)
    assert found[:, 1] == pytest.approx([clamped * np.sqrt(2.0)] * 4, rel=1e-6)
    # Free motions have double poles, of which a branch is one.
    assert np.abs(pole_branches(models, (), 3))[0] == pytest.approx([0.0, 0.0, 5.69177290724], rel=1e-6)


# --- In words ---------------------------------------------------------------------------------------------------------


def test_poles_and_zeros_in_words():
    values = np.array([0.0, 1e-9, 10j, -10j, 1408.0, -1408.0, 1408.01, -1408.01, -3.0 + 40j, -3.0 - 40j, 2.0])
    texts = [one.text for one in roots(values)]
    assert texts == ["0 ×2", "+2 rad/s*", "1.592 Hz", "-3 ± 40i rad/s", "±1408 rad/s ×2*"]
    assert limiting_zero(values) == pytest.approx(2.0)
    assert limiting_zero(np.array([0.01 + 40j, 0.01 - 40j, -5.0])) == 0.0
    assert roots(np.array([1.0 + 2j, 1.0 - 2j, -1.0 + 2j, -1.0 - 2j]))[0].text == "±1 ± 2i rad/s*"


# --- RAParM-I in all modes --------------------------------------------------------------------------------------------


@pytest.fixture(scope="module")
def all_modes():
    done = paraflex("linearise", "raparm_i", "--mode", "all", "--pose", "0,264 mm", "--json")
    assert done.returncode == 0, done.stderr
    return json.loads(done.stdout)


def test_all_nine_modes(all_modes):
    modes = all_modes["modes"]
    assert len(modes) == 9
    for name, (frequencies, _) in HELD.items():
        held = modes[name]["motors_held"]
        assert held["natural_frequencies"][:4] == pytest.approx(frequencies, rel=1e-4)
        assert [one["frequency"] for one in held["oscillations"][:4]] == pytest.approx(frequencies, rel=1e-4)
        assert all(abs(one["damping_ratio"]) < 1e-9 for one in held["oscillations"])
        # The same from their encoders' zeros.
        zeros = [complex(*pair) for pair in modes[name]["zeros"]["encoders"]["zeros"]]
        assert upper(zeros)[:4] / (2.0 * np.pi) == pytest.approx(frequencies, rel=1e-4)
        assert modes[name]["zeros"]["encoders"]["minimum_phase"]
    limits = {name: one["zeros"]["end_effector"]["limiting_zero"] for name, one in modes.items()}
    assert [limits[name] for name in ("+-+-", "-+-+", "+--+")] == pytest.approx([1408.6, 800.6, 539.2], rel=1e-3)
    assert limits["++++"] is None
    assert modes["++++"]["zeros"]["end_effector"]["minimum_phase"]
    assert all(one["unbalanced"] < 1e-9 for one in modes.values())


# --- A small mechanism: files, figures, page --------------------------------------------------------------------------

MODES = ("++", "right")


@pytest.fixture(scope="module")
def written(tmp_path_factory):
    out = tmp_path_factory.mktemp("linear") / "five"
    modes = [word for mode in MODES for word in ("--mode", mode)]
    return paraflex("linearise", "five_bar", *modes, "--force-at", "distal1.C", "--out", out), out


def test_a_table_of_poles_stands_in_one_block(tmp_path):
    """Its last column, of words, is broken where it is too wide; no block before it has the names of modes alone."""
    text = library_text("slider_crank_flexible").replace("[body.rod]", "[body.rod]\ndamping = { stiffness = 1e-5 }")
    (tmp_path / "damped.toml").write_text(text, encoding="utf-8")
    done = paraflex("linearise", tmp_path / "damped.toml")
    assert done.returncode == 0, done.stderr
    assert "continued" not in done.stdout
    assert ["mode", "motors", "lowest"] in [line.split() for line in done.stdout.partition("Poles")[2].splitlines()]


def test_files_are_written_and_said(written):
    done, out = written
    assert done.returncode == 0, done.stderr
    assert "Traceback" not in done.stderr
    assert done.stderr.strip().endswith(f"numbers, figures and report.html in {out}")
    assert {file.name for file in out.iterdir()} >= {"linear.nc", "linear.json", "report.html", "figures"}
    names = ("singular_values", "bode", "pole_zero_map", "mode_shapes")
    assert {file.name for file in (out / "figures").iterdir()} == {f"{n}.{k}" for n in names for k in ("png", "svg")}
    assert "not of minimum phase" in done.stdout
    assert "1408 rad/s" in done.stdout


@pytest.mark.parametrize(
    ("model", "figures"),
    [("spin_up", ["mode_shapes"]), ("slider_crank", ["bode", "pole_zero_map", "singular_values"])],
)
def test_figures_are_those_that_there_is_anything_in(tmp_path, model, figures):
    """Without motors, end-effector and sensors there are no outputs; rigid links do not vibrate."""
    done = paraflex("linearise", model, "--no-report", "--out", tmp_path / "out")
    assert done.returncode == 0, done.stderr
    assert sorted(file.stem for file in (tmp_path / "out" / "figures").glob("*.png")) == figures
    assert json.loads((tmp_path / "out" / "linear.json").read_text())


def test_what_is_written_equals_what_python_has(written):
    _, out = written
    data, numbers = pf.load_results(out), json.loads((out / "linear.json").read_text())
    numbers.pop("digest")
    model = pf.load("five_bar")
    assert json.loads(json.dumps(linear_summary(data))) == numbers
    frequency = data["frequency"].values
    for name, mode in zip(data["mode"].values.tolist(), MODES, strict=True):
        found = pf.linearise(model, mode=mode, forces=["distal1.C"])
        own, inputs = data.sel(mode=name), [one.name for one in found.inputs]
        for matrix in "AC":
            assert np.array_equal(own[matrix].values, getattr(found, matrix))
        for matrix in "BD":
            assert np.array_equal(own[matrix].sel(input=inputs).values, getattr(found, matrix))
        others = [one for one in data["input"].values if one not in inputs]
        assert np.isnan(own["B"].sel(input=others).values).all()
        assert numbers["modes"][name]["inputs"] == inputs
        poles = np.array([complex(*pair) for pair in numbers["modes"][name]["motors_free"]["poles"]])
        assert np.array_equal(poles, found.poles())
        motors = [one for one in inputs if "." not in one]
        zeros = numbers["modes"][name]["zeros"]["end_effector"]["zeros"]
        assert np.array_equal([complex(*pair) for pair in zeros], found.zeros(motors, ["x", "y"]))
        response = own["response_real"].sel(input=inputs).values + 1j * own["response_imag"].sel(input=inputs).values
        assert np.array_equal(response[5], found.frequency_response(2.0 * np.pi * frequency[[5]])[0])
    assert set(numbers["states"].values()) == {"rad", "rad/s", "m kg^0.5", "m kg^0.5/s"}
    assert all(data[name].attrs["units"] for name in data.data_vars)


def test_drawn_points_move_as_the_shape_says(written):
    """The end-effector's station, found by differences, against the derivative of its place; joints stay together."""
    _, out = written
    data = pf.load_results(out)
    model = pf.linearise(pf.load("five_bar"), mode="++")
    system, q = model.minimal.system, model.minimal.point.q
    rows = marker_place(system, system.marker(system.mechanism.end_effector.point), q[None])[1][0]
    station = int(data["point_station"].sel(point=data.attrs["end_effector_point"]))
    for holding, motors in (("free", ()), ("held", ("left", "right"))):
        expected = rows @ model.motions(motors).shapes[:, 2:6]
        found = data["modal_shape"].sel(mode="++", holding=holding).isel(drawn=slice(2, 6), station=station).values.T
        scale = np.sum(expected * found, axis=0) / np.sum(found**2, axis=0)
        assert scale * found == pytest.approx(expected, rel=1e-6, abs=1e-6 * np.abs(expected).max())
    assert float(np.abs(data["modal_shape"]).max()) <= 1.0 + 1e-12
    ends = [list(data["point"].values).index(name) for name in ("distal1.C", "distal2.C")]
    first, second = (data["modal_shape"].isel(station=int(data["point_station"].values[end])).values for end in ends)
    assert first == pytest.approx(second, abs=1e-8)


def test_mode_shapes_as_motions(written):
    _, out = written
    data = pf.load_results(out)
    shown = list(drawn_modes(data))
    # Motors that turn freely are the same in all modes, held ones are not.
    assert {(one.mode, one.holding) for one in shown} == {("", "free"), ("++", "held"), ("-+", "held")}
    assert [one.frequency for one in shown[:2]] == [0.0, 0.0]
    assert all(one.frequency > 0.0 for one in drawn_modes(data, rigid=False))
    run = modal_motion(data, shown[2], np.array([0.0, np.pi / 2.0]))
    moved = np.linalg.norm(run["shape"].values[1] - run["shape_base"].values[1], axis=-1).max()
    assert np.array_equal(run["shape"].values[0], run["shape_base"].values[0])
    assert moved == pytest.approx(0.08 * np.ptp(run["shape_base"].values[0], axis=0).max())


def test_the_page_has_every_mode_shape(written, browser, tmp_path):
    """In a browser: a group is chosen, then a shape; the mechanism moves, charts and tables are there."""
    done, out = written
    page = browser.new_page(viewport=DESKTOP)
    problems = []
    page.on("pageerror", lambda error: problems.append(str(error)))
    page.on("console", lambda said: problems.append(said.text) if said.type == "error" else None)
    page.goto((out / "report.html").as_uri())
    page.wait_for_function("document.documentElement.dataset.charts === 'true'")
    assert page.locator("#group option").all_inner_texts() == ["motors free", "++, motors held", "-+, motors held"]
    assert page.locator("#members label").count() == 8
    before = page.evaluate("document.getElementById('canvas').toDataURL()")
    page.locator("#group").select_option(label="motors free")
    page.locator("#members label").nth(2).click()
    assert page.evaluate("report.runName()").startswith("motors free: 168")
    page.evaluate("player.seek(0.5)")
    page.wait_for_function("(old) => document.getElementById('canvas').toDataURL() !== old", arg=before)
    assert page.locator("#time").inner_text() == "90°"
    page.locator("#chart-map-end_effector").scroll_into_view_if_needed()
    page.wait_for_function("document.querySelector('#chart-map-end_effector .js-plotly-plot .trace')")
    assert "no, from 1408 rad/s on" in page.locator("#part-zeros-motors-to-the-end-effector").inner_text()
    assert "--force-at distal1.C" in page.locator(".command").inner_text().replace("\n", " ")
    assert not problems
    page.close()
    again = tmp_path / "again.html"
    save_page(linear_page(pf.load_results(out)), again)
    assert again.read_text() == (out / "report.html").read_text()
    assert done.returncode == 0


def test_other_commands_know_these_results(written, tmp_path):
    _, out = written
    listed = paraflex("plot", out).stdout
    assert "results of kind linear" in listed
    assert "poles_along_path" not in listed
    done = paraflex("plot", out, "bode", "--mode", "++", "--output", tmp_path, "--format", "png")
    assert done.returncode == 0, done.stderr
    assert (tmp_path / "bode_++.png").exists()
    assert paraflex("report", out, "--output", tmp_path / "page.html").returncode == 0
    for words in (("animate", out, tmp_path / "a.gif"), ("compare", out, out), ("export", out, "--to", "csv")):
        done = paraflex(*words)
        assert (done.returncode, done.stderr.count("error: ")) == (2, 1), done.stderr
        assert "linear" in done.stderr


def test_about_motions():
    planned = paraflex("linearise", "five_bar", "--path", "line", "--at", "0.05", "--along", "5", "--json")
    assert planned.returncode == 0, planned.stderr
    numbers = json.loads(planned.stdout)
    task = pf.plan("five_bar", "line")
    found = pf.linearise(task, mode="++", at=0.05)
    assert numbers["about"] == "a planned motion"
    assert numbers["time"] == found.time
    poles = [complex(*pair) for pair in numbers["modes"]["++"]["motors_free"]["poles"]]
    assert np.array_equal(poles, found.poles())
    task = paraflex("linearise", "five_bar", "--path", "line", "--at", "0.05", "--coordinates", "task", "--json")
    assert json.loads(task.stdout)["parameters"]["run"]["coordinates"] == "task"
    own = paraflex("linearise", "slider_crank_flexible", "--at", "0.02")
    assert own.returncode == 0, own.stderr
    assert "about the run at t = 0.02 s" in own.stdout
    assert "frozen" in own.stdout


def test_about_the_runs_of_a_folder(tmp_path):
    """With a path and without: the same as about the run in Python."""
    few = ["--samples", "51", "--no-report"]
    done = paraflex(
        "run", "--no-figures", "-m", "five_bar", "--path", "line", "--duration", "0.1", *few, "--out", tmp_path / "path"
    )
    assert done.returncode == 0, done.stderr
    numbers = json.loads(paraflex("linearise", tmp_path / "path", "--at", "0.05", "--json").stdout)
    model = pf.load("five_bar")
    task = model.plan("line", duration=0.1, samples=51)
    found = pf.linearise(pf.simulate(task, "++", options=model.study.integration({})), at=0.05)
    assert (numbers["about"], numbers["time"]) == ("a run", found.time)
    poles = np.array([complex(*pair) for pair in numbers["modes"]["++"]["motors_free"]["poles"]])
    assert np.array_equal(poles, found.poles())
    assert numbers["parameters"]["run"]["results"] == str(tmp_path / "path")
    own = ["-m", "slider_crank_flexible", "--duration", "0.05"]
    assert paraflex("run", "--no-figures", *own, *few, "--out", tmp_path / "own").returncode == 0
    said = paraflex("linearise", tmp_path / "own" / "results.nc", "--at", "0.02")
    assert "about the run at t = 0.02 s: 10 states" in said.stdout, said.stderr
    file, changed = tmp_path / "mine.toml", tmp_path / "changed"
    file.write_text(library_text("five_bar"))
    line = ["-m", file, "--path", "line", "--duration", "0.02"]
    assert paraflex("run", "--no-figures", *line, "--samples", "5", "--no-report", "--out", changed).returncode == 0
    file.write_text(library_text("five_bar").replace("mass = 0.100", "mass = 0.200", 1))
    for words, problem in (
        ([tmp_path / "path", "--pose", "start"], "--pose: has no effect on results"),
        ([tmp_path / "path", "--mode", "+-"], "--mode: no such mode in these results"),
        ([tmp_path / "own", "--mode", "+-"], "--mode: no such mode in these results"),
        ([tmp_path / "path", "--at", "9"], "--at: is not a time of the motion"),
        ([tmp_path], f"{tmp_path}: no results in this folder"),
        ([changed], f"{changed}: these results are of another version"),
    ):
        done = paraflex("linearise", *words)
        assert (done.returncode, done.stderr.splitlines()[-1][: len(problem) + 7]) == (2, f"error: {problem}")


def test_a_run_from_equilibrium_is_made_again_from_there(tmp_path):
    few = ("--duration", "0.01", "--samples", "3", "--no-report")
    ran = paraflex(
        "run", "--no-figures", "five_bar", "--set", "gravity=[0,-9.81]", "--balanced", *few, "--out", tmp_path
    )
    assert ran.returncode == 0
    energy = pf.open_results(tmp_path)["strain_energy"].values[0]
    _, runs = repeated_runs(str(tmp_path))
    assert energy[0] > 1e-3
    assert np.array_equal(pf.tracking_dataset(list(runs))["strain_energy"].values[0], energy)


def test_about_equilibrium():
    weight = ["--set", "gravity=[0,-9.81]"]
    off = paraflex("linearise", "five_bar", *weight)
    assert "not in equilibrium: if released, the mechanism would start with 9.02 m/s^2" in off.stdout
    balanced = paraflex("linearise", "five_bar", *weight, "--balanced")
    assert balanced.returncode == 0
    assert "about static equilibrium" in balanced.stdout
    assert "not in equilibrium" not in balanced.stdout


BAD = [
    (["raparm_i", "--mode", "+++++"], "--mode: not an actuation mode (got '+++++')"),
    (["five_bar", "--mode", "left", "--set", "gravity=[0,-9.81]"], "--mode: it does not hold the mechanism"),
    (["five_bar", "--mode", "left", "--at", "0.05"], "--mode: it cannot drive this motion"),
    (["pendulum"], "--force-at: flexible pendulum has neither motors nor prescribed motions"),
    (["five_bar", "--at", "99"], "--at: is not a time of the motion (got 99.0)"),
    (["five_bar", "--at", "-1"], "--at: not a time of the motion"),
    (["slider_crank_flexible", "--at", "9"], "--at: is not a time of the motion (got 9.0); choose one up to 0.1 s"),
    (["five_bar", "--at", "0.1", "--pose", "outward"], "--at: is about a motion, --pose about rest"),
    (["five_bar", "--along", "9", "--balanced"], "--along: is about a motion, --balanced about rest"),
    (["five_bar", "--along", "1"], "--along: not a valid number of times"),
    (["five_bar", "--pose", "nothing"], "--pose: no such pose"),
    (["five_bar", "--pose", "start"], "--pose: no such pose"),
    (["five_bar", "--pose", "9,9"], "--pose: the end-effector cannot reach it"),
    (["five_bar", "--pose", "a,b"], "--pose: not a position"),
    (["four_bar", "--pose", "1,2"], "--pose: no end-effector with a position"),
    (["five_bar", "--pose", "1,2", "--assembly", "x"], "--assembly: names the pose as --pose does"),
    (["five_bar", "--force-at", "link1.Z"], "--force-at: unknown body"),
    (["five_bar", "--coordinates", "x"], "--coordinates: unknown first coordinates (got 'x')"),
    (["four_bar", "--coordinates", "task"], "--coordinates: needs an end-effector"),
    (["five_bar", "--prescribed", "x"], "--prescribed: is not a prescribed motion"),
]  # fmt: skip


@pytest.mark.parametrize(("words", "says"), BAD)
def test_bad_input_is_one_line_that_names_it(tmp_path, words, says):
    done = paraflex("linearise", *words, cwd=tmp_path)
    assert done.returncode == 2
    *_, last = done.stderr.strip().splitlines()
    assert last.startswith(f"error: {says}")
    assert "; " in last
    assert not list(tmp_path.iterdir())


def test_models_of_one_mode_twice_are_refused():
    model = pf.linearise(hub_beam(0.1, 0.0, 0.0))
    with pytest.raises(pf.InputError, match="different modes"):
        linear_dataset([model, model])
