"""How a motion is followed: errors during it and after it, drift and vibration, deflections from the chord."""

import json
from io import StringIO
from pathlib import Path

import numpy as np
import pytest

from paraflex.cli.run_lines import below_tolerance
from paraflex.cli.tables import PlainConsole
from paraflex.dynamics import across_chord, build_system, consistent_state, static_equilibrium
from paraflex.errors import InputError
from paraflex.fem import ReferenceCondition
from paraflex.files import load
from paraflex.integrators import DeflectionLimit, IntegrationOptions
from paraflex.integrators.event_functions import event_functions
from paraflex.mechanism import (
    Assembly,
    Curvature,
    FlexibleBeam,
    Geometry,
    Material,
    Mechanism,
    PointForce,
    PointRef,
    RevoluteJoint,
    Section,
    SlotJoint,
    raparm_i,
)
from paraflex.paths import Circle, Line, PointPath, Polygon, length_fraction
from paraflex.results import load_results, save_results, summary, tracking_dataset
from paraflex.results.following import below_tolerance_line, part_run
from paraflex.results.formulas import drift_speed, vibration
from paraflex.results.outlines import deflections, outlines
from paraflex.studies import run_study
from paraflex.tracking import plan_tracking
from shell import paraflex

SQUARE = Polygon(((0.05, 0.314), (-0.05, 0.314), (-0.05, 0.214), (0.05, 0.214)), 40.0)
# The paper's model, whatever defaults are.
PAPER = raparm_i().with_geometry(Geometry.LINEAR)


@pytest.fixture(scope="module")
def paper_run():
    """The paper's worst mode and its best, with the dwell."""
    task = plan_tracking(PAPER, SQUARE, duration=0.7)
    return [task.simulate(mode) for mode in ("+-+-", "++++")]


@pytest.mark.parametrize("offset", [(0.0, 0.0), (0.2, -0.3)])
def test_vibration_is_about_the_drift(offset):
    """Known drift, a speed that grows evenly, and a known oscillation over whole periods: closed form."""
    t = np.linspace(0.6, 1.6, 2001)
    amplitude, direction = 2e-4, np.array([0.6, 0.8])
    s = t - t[0]
    drift = np.outer(0.05 * s + 0.5 * 0.03 * s**2, [1.0, -2.0]) + offset
    place = drift + amplitude * np.outer(np.cos(2.0 * np.pi * 25.0 * s), direction)
    assert vibration(t, place) == pytest.approx(amplitude / np.sqrt(2.0), rel=2e-3)
    # The mean speed of the parabola is that of its chord.
    assert drift_speed(t, place) == pytest.approx((0.05 + 0.5 * 0.03) * np.sqrt(5.0), rel=2e-3)
    # Rounding of places of 0.3 m, of which a parabola is taken off.
    assert vibration(t, drift) < 1e-14
    # With a constant in place of the drift it is three hundred times as large.
    assert np.sqrt(np.mean(np.sum((place - place.mean(axis=0)) ** 2, axis=1))) > 100.0 * amplitude


def test_too_few_samples_tell_no_vibration():
    t = np.linspace(0.0, 1.0, 8)
    assert np.isnan(vibration(t, np.zeros((8, 2))))
    assert np.isnan(drift_speed(t, np.zeros((8, 2))))


def test_the_paper_s_mode_drifts_and_hardly_vibrates(paper_run):
    """6.6 mm of "residual vibration" were drift; a straight line in place of the parabola leaves the same 0.22 mm."""
    data = tracking_dataset(paper_run).sel(mode="+-+-")
    after = data["time"].values > data.attrs["motion_end"]
    t, place = data["time"].values[after], data["end_effector"].values[after]
    about_the_mean = np.sqrt(np.mean(np.sum((place - place.mean(axis=0)) ** 2, axis=1)))
    assert about_the_mean > 6e-3
    line = np.polynomial.polynomial.polyfit(t, place, 1)
    left = place - np.polynomial.polynomial.polyval(t, line).T
    found = float(data["residual_vibration"])
    assert found == pytest.approx(np.sqrt(np.mean(np.sum(left**2, axis=1))), rel=0.01)
    assert found == pytest.approx(2.18e-4, rel=0.03)
    assert float(data["drift_speed"]) == pytest.approx(np.linalg.norm(line[1]), rel=1e-9)
    assert float(data["drift_speed"]) == pytest.approx(0.14, abs=0.005)


def test_errors_during_the_motion_and_after_it_make_up_that_of_the_whole(paper_run):
    data = tracking_dataset(paper_run)
    assert int((data["time"] <= data.attrs["motion_end"]).sum()) == 532
    parts = 532 * data["tracking_rms_motion"] ** 2 + 169 * data["tracking_rms_after"] ** 2
    np.testing.assert_allclose(data["tracking_rms"] ** 2, parts / 701, rtol=1e-12)
    largest = np.maximum(data["tracking_max_motion"], data["tracking_max_after"])
    np.testing.assert_array_equal(data["tracking_max"], largest)
    # What the drift after the path adds is larger than what the motion has.
    assert data["tracking_rms_after"][0] > 3.0 * data["tracking_rms_motion"][0]


def test_the_error_of_the_motion_does_not_grow_with_the_duration(paper_run):
    longer = tracking_dataset([plan_tracking(PAPER, SQUARE, duration=0.9, samples=901).simulate("+-+-")]).isel(mode=0)
    shorter = tracking_dataset(paper_run).sel(mode="+-+-")
    assert float(longer["tracking_rms"]) > 1.1 * float(shorter["tracking_rms"])
    # The steps depend on the run's length: to the tolerance times the mode's condition number, 18.
    assert float(longer["tracking_rms_motion"]) == pytest.approx(float(shorter["tracking_rms_motion"]), rel=0.01)


def test_the_dwell_reverses_a_ranking():
    """In second-order geometry -+-+ is behind +--+ in the motion and drifts less after it."""
    task = plan_tracking(PAPER.with_geometry(Geometry.SECOND_ORDER), SQUARE, duration=0.7)
    options = IntegrationOptions(method="esdirk5", tolerance=1e-4)
    data = tracking_dataset([task.simulate(mode, options=options) for mode in ("-+-+", "+--+")])
    assert data["tracking_rms_motion"][0] > 1.1 * data["tracking_rms_motion"][1]
    assert data["tracking_rms"][0] < 0.9 * data["tracking_rms"][1]
    assert data["drift_speed"][0] < 0.5 * data["drift_speed"][1]


def test_the_model_file_says_which_error_ranks_modes(paper_run):
    assert load("raparm_i").study.error == load("raparm_ii").study.error == "whole"
    assert load("five_bar").study.error == "motion"
    told = summary(tracking_dataset(paper_run, error="whole"))
    assert (told["error"], told["after"], told["part"]) == ("whole", "free", None)
    assert summary(tracking_dataset(paper_run))["error"] == "motion"
    with pytest.raises(InputError, match=r"error: unknown error span \(got 'path'\)"):
        tracking_dataset(paper_run, error="path")


def test_figures_and_pages_are_ranked_by_the_headline(paper_run):
    from paraflex import plots
    from paraflex.reports import render, tracking_page

    for error, words in (("motion", "of the motion"), ("whole", "of the whole run")):
        data = tracking_dataset(paper_run, error=error)
        panel = plots.mode_comparison(data).axes[0]
        rms = data["tracking_rms_motion" if error == "motion" else "tracking_rms"]
        assert panel.get_title() == f"RMS error {words}"
        np.testing.assert_allclose(panel.lines[0].get_xdata(), 1e3 * rms)
    page = tracking_page(tracking_dataset(paper_run))
    assert page.figures[0][:2] == ("least RMS error during the motion", "0.505 mm")
    text = render(page)
    assert "Error, RMS, and the largest one: during the motion." in text
    assert "motors free" in text


def test_a_run_that_stops_after_the_motion_has_the_error_of_the_motion(paper_run):
    data = tracking_dataset(paper_run)
    data["end_effector"][0, 600:] = np.nan
    from paraflex.results.following import metric_variables

    found = metric_variables(data)
    assert found["tracking_rms_motion"][0] == data["tracking_rms_motion"][0]
    assert np.isnan(found["tracking_rms"][0])
    assert np.isnan(found["residual_vibration"][0])


def test_older_results_are_told_by_today_s_formulas_and_ranked_as_they_were(paper_run, tmp_path):
    from paraflex.results.following import FOLLOWING, headline

    data = tracking_dataset(paper_run)
    old = data.drop_vars([name for name in FOLLOWING if name != "tracking_rms"] + ["deflection", "brake_energy"])
    old["residual_vibration"] = data["residual_vibration"] * 30.0
    old.attrs = {key: value for key, value in data.attrs.items() if key not in ("error", "after")} | {"schema": 2}
    save_results(old, tmp_path / "results.nc")
    read = load_results(tmp_path)
    for name in FOLLOWING:
        np.testing.assert_array_equal(read[name], data[name])
    assert headline(read)[1] == "over the whole run, dwell included"
    assert summary(read)["modes"]["++++"]["tracking_rms_motion"] == float(data["tracking_rms_motion"][1])


@pytest.mark.parametrize(
    ("path", "end", "fraction"),
    [
        # Two of four equal sides; half of a side's time is half of its length, the law being symmetric.
        (SQUARE, SQUARE.duration / 2.0, 0.5),
        (SQUARE, SQUARE.duration / 8.0, 0.125),
        (SQUARE, 1.0, 1.0),
        (Line((0.0, 0.2), (0.1, 0.3), 40.0), 0.1, None),
        (Circle((0.0, 0.264), 0.05, 40.0), 0.5 * Circle((0.0, 0.264), 0.05, 40.0).duration, 0.5),
        (PointPath(((0.0, 0.0), (0.1, 0.0)), 0.3), 0.15, 0.5),
    ],
)
def test_the_length_of_a_path_that_is_run(path, end, fraction):
    if fraction is None:
        # On a straight line the length is the distance.
        fraction = np.linalg.norm(path.evaluate(end).position - path.evaluate(0.0).position) / np.sqrt(0.02)
    assert length_fraction(path, end) == pytest.approx(fraction, rel=1e-9)


def test_a_run_shorter_than_its_path_says_so(tmp_path):
    task = plan_tracking(PAPER, SQUARE, duration=0.3, samples=31)
    data = run_study(task, ["++++"], options=IntegrationOptions(tolerance=1e-3)).data
    part = part_run(data)
    assert (part.duration, part.path) == (0.3, SQUARE.duration)
    assert part.length == pytest.approx(length_fraction(SQUARE, 0.3))
    words = "only a part of the path was run: 0.3 of 0.532 s, 53.5 % of its length"
    assert words in summary(data)["part"]["message"]
    assert part_run(tracking_dataset([plan_tracking(PAPER, SQUARE, samples=11).simulate("++++")])) is None
    asked = ("--mode", "++++", "--duration", "0.3", "--tol", "1e-3", "--no-figures")
    done = paraflex("run", "-m", "raparm_i", *asked, cwd=tmp_path)
    assert done.returncode == 0, done.stderr
    assert done.stdout.startswith(f"warning: study.duration: {words}")
    figures = json.loads((tmp_path / "results" / "summary.json").read_text())
    assert words in figures["part"]["message"]
    assert figures["verdict"]["findings"][0]["code"] == "path-cut-short"
    assert words.removeprefix("o") in (tmp_path / "results" / "report.html").read_text(encoding="utf-8")


SHORT_STUDY = """
mechanism = "raparm_i"
paths = ["square", "line"]
modes = ["++++"]
duration = 0.3
samples = 11
[integration]
tolerance = 1e-3
[vary.thickness]
fields = ["section.bar.thickness"]
values = [0.005]
"""


def test_studies_shorter_than_a_path_say_so(tmp_path):
    (tmp_path / "study.toml").write_text(SHORT_STUDY, encoding="utf-8")
    done = paraflex("sweep", "study.toml", "--output", "out", cwd=tmp_path)
    assert done.returncode == 0, done.stderr
    words = "path.square: only a part of the path was run: 0.3 of 0.532 s, 53.5 % of its length"
    assert f"warning: {words}" in done.stdout
    # The line takes 0.1 s.
    assert "line" not in done.stdout
    told = json.loads(paraflex("sweep", "study.toml", "--output", "out", "--json", cwd=tmp_path).stdout)["part"]
    assert list(told) == ["square"]
    page = (tmp_path / "out" / "report.html").read_text(encoding="utf-8")
    assert words.removeprefix("path.square: ") in page
    done = paraflex("sensitivity", "study.toml", "--output", "slopes", cwd=tmp_path)
    assert done.returncode == 0, done.stderr
    assert f"warning: {words}" in done.stdout


def bent_beam(reference, geometry, load, curvature=Curvature.SEPARATE):
    """A beam on two supports, one of them a slot, under a force at its middle."""
    beam = FlexibleBeam(
        "beam", 0.6, Section.rectangle(0.02, 0.002), Material(210e9, 7850.0), points={"A": 0.0, "M": 0.3, "B": 0.6},
        elements=2, reference=reference, curvature=curvature,
    )  # fmt: skip
    return Mechanism(
        "bridge",
        {"O": (0.0, 0.0), "P": (0.6, 0.0)},
        (beam,),
        (
            RevoluteJoint("left", PointRef("ground", "O"), PointRef("beam", "A")),
            SlotJoint("right", PointRef("ground", "P"), PointRef("beam", "B")),
        ),
        loads=(PointForce("weight", PointRef("beam", "M"), (0.0, -load)),),
        assemblies=(Assembly("flat", {"beam": 0.0}),),
        geometry=geometry,
    )


def settled(mechanism):
    system = build_system(mechanism)
    return system, static_equilibrium(system, consistent_state(system, mechanism.assemblies[0])).q[None]


@pytest.mark.parametrize("geometry", list(Geometry))
@pytest.mark.parametrize("reference", list(ReferenceCondition))
def test_a_deflection_is_from_the_chord_whatever_the_frame(reference, geometry):
    """P L^3 / 48 EI at the middle of a simply supported beam, in every frame: where ends are fixed to the frame too."""
    stiffness = 210e9 * 0.02 * 0.002**3 / 12
    load = 0.5
    system, q = settled(bent_beam(reference, geometry, load))
    exact = load * 0.6**3 / (48.0 * stiffness)
    # What the reference conditions differ by is of the order of the slope's square.
    slope = load * 0.6**2 / (16.0 * stiffness)
    assert np.max(np.abs(deflections(system, q))) == pytest.approx(exact, rel=3.0 * slope**2)
    limit = event_functions(system, q[0], (DeflectionLimit("beam", 1.0),))[0]
    assert limit.value(q)[0] == pytest.approx(np.max(np.abs(deflections(system, q))), rel=1e-9)


def test_a_rigid_motion_changes_no_deflection():
    rest = np.column_stack([np.linspace(0.0, 1.0, 9), np.zeros(9)])
    shape = rest + np.column_stack([np.zeros(9), 0.1 * np.sin(np.pi * rest[:, 0])])
    turned = []
    for angle in (0.0, 1.0, -2.5):
        c, s = np.cos(angle), np.sin(angle)
        turned.append(shape @ np.array([[c, s], [-s, c]]) + [3.0 * angle, -1.0])
    found = across_chord(np.array(turned), rest)
    np.testing.assert_allclose(found, np.tile(0.1 * np.sin(np.pi * rest[:, 0]), (3, 1)), atol=1e-15)


def test_a_body_that_is_not_straight_bends_from_its_own_form():
    """Three points of a triangle: the corner moves across the line of the other two."""
    rest = np.array([[0.0, 0.0], [0.5, 0.4], [1.0, 0.0]])
    shape = rest + np.array([[0.0, 0.0], [0.0, 0.01], [0.0, 0.0]])
    assert across_chord(shape[None], rest)[0] == pytest.approx([0.0, 0.01, 0.0], abs=1e-15)
    assert np.isnan(across_chord(shape[None, [0, 1, 0]], rest[[0, 1, 0]])).all()


def test_stations_follow_a_length_with_a_complex_step():
    import dataclasses

    beam = bent_beam(ReferenceCondition.PINNED, Geometry.LINEAR, 1.0).bodies[0]
    places = outlines(bent_beam(ReferenceCondition.PINNED, Geometry.LINEAR, 1.0))[0].places[:, 0]
    longer = object.__new__(FlexibleBeam)
    for field in dataclasses.fields(beam):
        object.__setattr__(longer, field.name, getattr(beam, field.name))
    object.__setattr__(longer, "length", 0.6 + 1e-30j)
    object.__setattr__(longer, "points", {"A": 0.0, "M": 0.3 + 5e-31j, "B": 0.6 + 1e-30j})
    from paraflex.results.outlines import outline

    moved = outline(longer).places[:, 0]
    np.testing.assert_allclose(moved.real, places, atol=1e-15)
    np.testing.assert_allclose(moved.imag / 1e-30, places / 0.6, atol=1e-12)


def test_a_coordinate_that_is_no_task_is_compared_with_the_plan():
    """A lambda linkage led by x alone: y follows from it, and is no deviation. The path gives another y."""
    model = load(Path(__file__).parent / "data" / "slips" / "linkage.toml")
    task = plan_tracking(model.mechanism.rigid(), model.path("stroke"), samples=51)
    desired, planned = task.motion.desired, model.path("stroke").evaluate(task.motion.t)
    np.testing.assert_array_equal(desired.position[:, 0], planned.position[:, 0])
    assert np.max(np.abs(desired.position[:, 1] - planned.position[:, 1])) > 1e-4
    # Its rates are those of its place.
    t = task.motion.t
    middle = slice(5, -5)
    for lower, upper in ((desired.position, desired.velocity), (desired.velocity, desired.acceleration)):
        slope = np.gradient(lower[:, 1], t)
        np.testing.assert_allclose(slope[middle], upper[middle, 1], atol=0.02 * np.max(np.abs(upper[:, 1])))
    data = tracking_dataset([task.simulate("one", options=IntegrationOptions(tolerance=1e-8))])
    assert data["tracking_rms_motion"].item() < 1e-6


def test_tracking_errors_below_the_tolerance_are_named():
    line = below_tolerance_line({"++-": 1.1e-6, "+++": 9e-7, "+-+": 1e-6, "---": None}, 1e-6)
    assert line.startswith("tracking errors below the tolerance of 1e-06 m")
    assert ": +++; choose a finer tolerance (--tol)" in line
    assert below_tolerance_line({"++-": 1.1e-6, "---": None}, 1e-6) == ""


def test_the_command_names_them_unless_steps_are_fixed():
    said = StringIO()
    out = PlainConsole(file=said, width=200)
    modes = {"++": {"tracking_rms_motion": 1e-7}}
    for settings in ({"step": None, "tolerance": 1e-6}, {"step": 1e-4, "tolerance": 1e-6}):
        below_tolerance(out, {"line": {"error": "motion", "parameters": {"run": settings}}}, modes)
    assert said.getvalue().count("tracking errors below the tolerance of 1e-06 m") == 1
