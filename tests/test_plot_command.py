"""`paraflex plot`: results are recognised by their content, every figure of every kind is drawn, nothing is lost."""

from __future__ import annotations

import json
import re
from collections.abc import Callable
from dataclasses import replace
from functools import cache
from pathlib import Path

import numpy as np
import pytest
import xarray as xr
from matplotlib.figure import Figure
from typer.testing import CliRunner

import paraflex as pf
from made_up import STUDY, made_up, write_study
from paraflex import plots
from paraflex.cli.app import app
from paraflex.control import ControllerDescription, StateSpaceLaw, simulate_controlled, simulate_controlled_motion
from paraflex.errors import InputError
from paraflex.figures.designs import undominated
from paraflex.formatting import logarithmic_number
from paraflex.mechanism import Motor
from paraflex.plots.catalogue import CATALOGUE, figure_names
from paraflex.plots.layout import MM, column_width
from paraflex.plots.planned import drawings, figures_of, find_figure
from paraflex.plots.save import write_figures
from paraflex.plots.sources import Source, open_source
from paraflex.results import motion_dataset, save_results, tracking_dataset
from paraflex.results.metrics import metric_label
from paraflex.studies import load_optimisation, load_sweep, optimise, sweep
from processes import python
from test_plots import STUDIES, stays_on_the_page

MADE_UP = {
    "tracking_rms": lambda mode, x, y: 1e-3 * (0.005 / x + 0.1 * y),
    "peak_torque_max": lambda mode, x, y: 7.0 * (x / 0.005) * (1.0 + y) * (2.0 if mode == "+++-" else 1.0),
    "total_mass": lambda mode, x, y: 3.0 + 100.0 * x + y,
}
SAMPLED = STUDY.replace('modes = ["++++"]', 'modes = ["++++", "+++-"]').replace(
    "[vary.x]", '[sampling]\nkind = "sobol"\nnumber = 16\n\n[vary.x]'
)
OBJECTIVE = "\n[objective]\nminimise = { tracking_rms = 1.0 }\n[search]\nevaluations = 12\n"
METHODS = {
    "reference": {"uncertainty": 1e-9},
    "fastest": {},
    "methods": {
        name: {
            "title": name,
            "family": "esdirk",
            "runs": [
                {"status": "complete", "error": 10.0**-k, "wall_time": 0.1 * k, "steps": 100 * k, "step": None}
                for k in (3, 4, 5)
            ],
        }
        for name in ("esdirk3", "esdirk5")
    },
}
# The file of each kind that figures are drawn from.
FILES = {
    "tracking": "results.nc",
    "motion": "results.nc",
    "verification": "verify.nc",
    "linear": "linear.nc",
    "reduction": "reduced.nc",
    "statics": "statics.nc",
    "laws": "laws.nc",
    "methods": "compare-methods.json",
    "sweep": "results.parquet",
    "optimisation": "result.json",
    "identification": "result.json",
    "indices": "indices.json",
    "sensitivity": "sensitivity.json",
    "modes": "",
}

# Quantities without a unit: ratios, counts, and parameters and metrics of the study that is made up.
PLAIN = {
    "condition number", "condition number, worst along the path", "number", "accepted steps", "states", "design",
    "objective", "root mean square residual", "share of the variance", "largest relative error", "error",
    "reached / target",
}  # fmt: skip
# Figures without axes.
PICTURES = ("mechanism_drawing", "mode_shapes", "deformed_shapes", "buckling_shapes")


@pytest.fixture(scope="module")
def results(tmp_path_factory) -> Path:
    """A folder or file of each kind, by its name."""
    folder = tmp_path_factory.mktemp("results")
    _runs(folder)
    _designs(folder)
    _write(folder / "methods" / "compare-methods.json", METHODS)
    _write(folder / "indices" / "indices.json", STUDIES["sobol_bars"] | {"kind": "indices"})
    told = STUDIES["elasticities"] | {"units": {"tracking_rms": "m"}}
    _write(folder / "sensitivity" / "sensitivity.json", told)
    found = STUDIES["convergence"] | STUDIES["targets_reached"] | {"kind": "identification"}
    _write(folder / "identification" / "result.json", found)
    modes = [
        {"mode": "++", "motors": ["a", "b"], "condition_max": 2.5, "drives_path": True},
        {"mode": "+-", "motors": ["a"], "condition_max": 180.0, "drives_path": False},
    ]
    _write(folder / "modes", modes)
    table = (folder / "sweep" / "results.parquet").read_bytes()
    for kind in ("indices", "identification"):
        (folder / kind / "results.parquet").write_bytes(table)
    return folder


def _runs(folder: Path) -> None:
    model = pf.load("five_bar")
    sensors = (pf.Encoder("left", "A1"), pf.Tachometer("turning", "A1"))
    task = pf.plan(replace(model.mechanism, sensors=sensors), model.path("line"), duration=0.05, samples=26)
    linear = [[pf.linearise(task, mode=mode, at=at) for at in (0.0, 0.02, 0.04)] for mode in ("++", None)]
    (folder / "linear").mkdir()
    save_results(pf.linear_dataset([each[1] for each in linear], along=linear), folder / "linear" / "linear.nc")
    (folder / "statics").mkdir()
    pushed = pf.statics(pf.load("leaf_spring_guide"), loads={"stage.T.x": 5.0, "stage.T.y": -20.0}, steps=3, buckling=2,
                       stiffness=["stage.T.x", "stage.T.angle"])  # fmt: skip
    save_results(pf.statics_dataset(pushed), folder / "statics" / "statics.nc")
    (folder / "reduction").mkdir()
    # Of few states: the fewest that are needed are sought among all.
    coarse = replace(model, mechanism=model.mechanism.with_beams(elements=1))
    models = [pf.linearise(coarse, mode=mode) for mode in ("++", None)]
    task = pf.plan(coarse.mechanism, model.path("line"), duration=0.05, samples=26)
    along = [pf.poses_along(task, 4, mode=mode) for mode in ("++", None)]
    save_results(pf.reduction_dataset(models, 16, along=along), folder / "reduction" / "reduced.nc")
    task = pf.plan(replace(model.mechanism, sensors=sensors), model.path("line"), duration=0.05, samples=26)
    gentle = ControllerDescription("pd", pf.JointPID(1.0), 1e-3, delay=1e-3, limits=1e-4)
    run = tracking_dataset([simulate_controlled(task, "++", [gentle])])
    # One of them fails where it has no motor.
    one = ControllerDescription("one", pf.JointPID(1.0), 1e-3, outputs=("left",))
    laws = {"pd": [gentle], "one, with a long name": [one]}
    pf.compare_laws(model, ["++", "right"], laws, duration=0.05, samples=26).save(folder / "laws")
    # A second mode by name; the first is all that the motors can do.
    data = xr.concat([run, run.assign_coords(mode=["+-"])], "mode", combine_attrs="override")
    (folder / "tracking").mkdir()
    save_results(data, folder / "tracking" / "results.nc")
    (folder / "verification").mkdir()
    save_results(_two_models(data), folder / "verification" / "verify.nc")
    pendulum = pf.load("pendulum").mechanism
    (folder / "motion").mkdir()
    body, joint = pendulum.bodies[0].name, pendulum.joints[0].name
    end = f"{body}.{list(pendulum.bodies[0].points)[-1]}"
    # Of more units than there are panels below one another.
    sensors = (
        pf.Encoder("angle", joint), pf.Tachometer("rate", joint), pf.VelocitySensor("velocity", end, "x"),
        pf.AccelerationSensor("felt", end, "y", body), pf.JointForceSensor("pull", joint, 0.3),
    )  # fmt: skip
    driven = replace(pendulum, motors=(Motor("drive", joint),), sensors=sensors)
    brake = ControllerDescription("brake", StateSpaceLaw([[-1e-3, -1e-3]]), 2e-3, inputs=("angle", "rate"))
    run = simulate_controlled_motion(driven, 0.1, [brake], samples=21)
    save_results(motion_dataset(run), folder / "motion" / "results.nc")


def _two_models(data: xr.Dataset) -> xr.Dataset:
    other = data.copy()
    other["end_effector"] = data["end_effector"] + 1e-5
    both = xr.concat([data, other], xr.Variable("model", ["second-order", "segments"]), combine_attrs="override")
    return both.assign_attrs(reference="second-order")


def _designs(folder: Path) -> None:
    run = made_up(**MADE_UP)
    sweep(load_sweep(write_study(folder, SAMPLED)), folder / "sweep", run=run)
    study = load_optimisation(write_study(folder, STUDY + OBJECTIVE, "optimisation.toml"))
    optimise(study, folder / "optimisation", run=run)


def _write(file: Path, told: object) -> None:
    file.parent.mkdir(exist_ok=True)
    file.write_text(json.dumps(told), encoding="utf-8")


def drawn(source: Source, name: str, **chosen) -> list[Figure]:
    return [each.draw() for each in drawings(source, find_figure(source, name), **chosen)]


def plot(*words: object) -> tuple[int, str, str]:
    """The exit code of the command, and what it says."""
    caught = CliRunner().invoke(app, ["plot", *map(str, words)])
    if isinstance(caught.exception, InputError):
        return 2, caught.stdout, str(caught.exception)
    assert caught.exception is None or isinstance(caught.exception, SystemExit)
    return caught.exit_code, caught.stdout, caught.stderr


@pytest.mark.parametrize("kind", CATALOGUE)
def test_kinds_are_recognised_by_content_not_by_name(results: Path, tmp_path: Path, kind: str) -> None:
    assert open_source(results / kind).kind == kind
    file = results / kind / FILES[kind]
    copied = tmp_path / "anything.dat"
    copied.write_bytes(file.read_bytes())
    assert open_source(copied).kind == kind


@pytest.fixture(scope="module")
def sources(results):
    """Results of each kind, read once."""
    return cache(lambda kind: open_source(results / kind))


@pytest.mark.parametrize("style", ["single", "double"])
@pytest.mark.parametrize(("kind", "name"), [(kind, each.name) for kind, all_ in CATALOGUE.items() for each in all_])
def test_every_figure_of_every_kind_at_both_widths(
    sources: Callable[[str], Source], kind: str, name: str, style: str
) -> None:
    with column_width(style):
        figures = drawn(sources(kind), name)
    for figure in figures:
        width, height = figure.get_size_inches() / MM
        assert width == pytest.approx({"single": 84.0, "double": 174.0}[style])
        assert height < 240.0
        assert figure.axes
        stays_on_the_page(figure)
        labels = [text for axes in figure.axes for text in (axes.get_xlabel(), axes.get_ylabel())]
        assert any(labels) or name in ("parallel_coordinates", *PICTURES)
        assert {text for text in labels if text and not re.search(r" ?\[.+\]$", text)} <= PLAIN, name


def test_catalogue_and_package_have_the_same_figures() -> None:
    named = {name for name in plots.__all__ if not name.startswith("save")}
    assert named <= figure_names()
    assert all(callable(getattr(plots, name)) for name in figure_names())
    assert all(callable(getattr(plots, name)) for name in plots.__all__)
    for figures in CATALOGUE.values():
        names = [figure.name for figure in figures]
        assert len(set(names)) == len(names)


def test_list_tells_every_figure_in_a_line(results: Path) -> None:
    code, told, _ = plot(results / "tracking")
    assert code == 0
    lines = told.splitlines()
    assert "kind tracking" in lines[0]
    assert [line.split()[0] for line in lines[1:]] == [each.name for each in CATALOGUE["tracking"]]
    assert plot(results / "tracking", "motor_torques", "--list") == (0, told, "")


def test_files_of_all_formats_and_nothing_written_over(results: Path, tmp_path: Path) -> None:
    words = (
        results / "tracking",
        "motor_torques",
        "end_effector_path",
        "--output",
        tmp_path,
        "--format",
        "pdf,svg,png",
    )
    code, told, _ = plot(*words)
    assert code == 0
    stems = ("motor_torques", "end_effector_path_++")
    expected = [f"{stem}.{suffix}" for stem in stems for suffix in ("pdf", "svg", "png")]
    assert [Path(line).name for line in told.splitlines()] == expected
    assert sorted(file.name for file in tmp_path.iterdir()) == sorted(expected)
    before = {file: file.read_bytes() for file in tmp_path.iterdir()}
    code, _, said = plot(*words)
    assert code == 2
    assert "--force" in said
    assert "5 more" in said
    assert plot(*words, "--force")[0] == 0
    assert {file: file.read_bytes() for file in tmp_path.iterdir()} == before


def test_one_file_that_is_there_keeps_all_from_being_written(results: Path, tmp_path: Path) -> None:
    (tmp_path / "tracking_errors.pdf").write_text("mine")
    code, _, said = plot(results / "tracking", "motor_torques", "tracking_errors", "--output", tmp_path)
    assert code == 2
    assert "tracking_errors.pdf" in said
    assert [file.name for file in tmp_path.iterdir()] == ["tracking_errors.pdf"]
    assert (tmp_path / "tracking_errors.pdf").read_text() == "mine"


def test_fonts_are_embedded_as_truetype_and_the_page_is_a_column_wide(results: Path, tmp_path: Path) -> None:
    assert plot(results / "tracking", "tracking_errors", "--style", "single", "--output", tmp_path)[0] == 0
    written = (tmp_path / "tracking_errors.pdf").read_bytes()
    assert b"/Type /Font" in written
    assert b"/Subtype /Type3" not in written
    assert b"/FontFile2" in written
    box = written.split(b"/MediaBox [")[1].split(b"]")[0].split()
    assert float(box[2]) == pytest.approx(84.0 / 25.4 * 72.0, abs=1e-3)


def test_png_has_the_dots_asked_for(results: Path, tmp_path: Path) -> None:
    words = ("--style", "double", "--format", "png", "--dpi", "100", "--output", tmp_path)
    assert plot(results / "tracking", "tracking_distance", *words)[0] == 0
    header = (tmp_path / "tracking_distance.png").read_bytes()[16:20]
    assert int.from_bytes(header, "big") == pytest.approx(174.0 / 25.4 * 100.0, abs=1.0)


def test_names_of_the_files_of_a_run_are_names_too(results: Path) -> None:
    source = open_source(results / "tracking")
    assert find_figure(source, "tracking_errors").name == "tracking_errors"


def test_a_misspelt_figure_names_the_nearest_and_lists_all(results: Path) -> None:
    code, _, said = plot(results / "tracking", "motor_torque")
    assert code == 2
    assert 'did you mean "motor_torques"?' in said
    assert all(each.name in said for each in CATALOGUE["tracking"])
    code, _, said = plot(results / "motion", "tracking_errors")
    assert code == 2
    assert "of results of kind motion" in said


def test_modes_are_chosen_and_unknown_ones_refused(results: Path) -> None:
    source = open_source(results / "tracking")
    figure = find_figure(source, "link_motions")
    assert [each.stem for each in drawings(source, figure, ["+-", "++"])] == ["link_motions_+-", "link_motions_++"]
    (one,) = drawn(source, "tracking_errors", modes=["+-"])
    assert [axes.get_title()[:2] for axes in one.axes if axes.get_visible()] == ["+-"]
    for kind, name in (("tracking", "tracking_errors"), ("verification", "compared_links"), ("sweep", "pareto_front")):
        with pytest.raises(InputError, match="no such mode"):
            drawn(open_source(results / kind), name, modes=["--"])
    with pytest.raises(InputError, match="no modes to choose"):
        drawn(open_source(results / "motion"), "energies", modes=["++"])


def curves(figure: Figure) -> dict[str, list]:
    """Ordinates of the labelled curves of a figure."""
    found: dict[str, list] = {}
    for axes in figure.axes:
        for line in axes.get_lines():
            found.setdefault(str(line.get_label()), []).append(line.get_ydata())
    return found


def test_figures_of_the_end_effector_are_drawn_of_a_named_point(results: Path, tmp_path: Path) -> None:
    data = pf.load_results(results / "tracking").isel(mode=0)
    point = data.sel(point="proximal1.B1")
    label = "proximal1.B1, mode ++"
    moved = curves(plots.end_effector_motion(results / "tracking", "++", point="proximal1.B1"))
    assert "desired" not in moved
    parts = (1e3 * point["point_position"], point["point_velocity"], point["point_acceleration"])
    for drawn_, part in zip(moved[label], [part.sel(axis=axis) for axis in "xy" for part in parts], strict=True):
        np.testing.assert_array_equal(drawn_, part.values)
    (path,) = curves(plots.end_effector_path(results / "tracking", "++", point="proximal1.B1"))[label]
    np.testing.assert_array_equal(path, 1e3 * point["point_position"].sel(axis="y").values)
    phases = curves(plots.phase_diagrams(results / "tracking", "++", point="proximal1.B1"))[label]
    np.testing.assert_array_equal(phases[0], point["point_velocity"].sel(axis="x").values)
    # The end-effector by its name is what it is without.
    effector = str(data.attrs["end_effector_point"])
    assert "desired" in curves(plots.end_effector_motion(results / "tracking", "++", point=effector))
    with pytest.raises(InputError, match="magnification: a point without a desired path has no deviation"):
        plots.end_effector_path(results / "tracking", "++", 10.0, point="proximal1.B1")
    old = pf.load_results(results / "tracking").drop_vars(["point_velocity", "point_acceleration"])
    with pytest.raises(InputError, match="no motion of points: they are of an earlier version"):
        plots.end_effector_motion(old, "++", point="proximal1.B1")


def test_the_command_draws_the_figures_of_points(results: Path, tmp_path: Path) -> None:
    asked = ("--point", "proximal1.B1", "--point", "distal1.C", "--format", "png", "--dpi", 60)
    code, said, _ = plot(results / "tracking", "end_effector_path", "point_motions", *asked, "--out", tmp_path / "two")
    assert code == 0
    assert [Path(line).name for line in said.splitlines()] == [
        "end_effector_path_++_proximal1.B1.png",
        "end_effector_path_++_distal1.C.png",
        "point_motions_++_proximal1.B1,distal1.C.png",
    ]
    code, said, _ = plot(results / "motion", "all", *asked[4:], "--point", "beam.tip", "--out", tmp_path / "all")
    assert code == 0, said
    able = [figure.name for figure in CATALOGUE["motion"] if figure.points]
    assert [Path(line).stem for line in said.splitlines()] == [f"{name}_beam.tip" for name in able]
    code, _, said = plot(results / "tracking", "energies", "--point", "proximal1.B1")
    assert code == 2
    assert "--point: energies is not of a named point (got 'proximal1.B1'); choose from end_effector_path," in said
    code, _, said = plot(results / "tracking", "end_effector_path", "--point", "C")
    assert code == 2
    assert "--point: no such point in these results (got 'C'); one of " in said
    assert "distal1.C" in said
    assert "\n" not in said


@pytest.mark.parametrize(
    ("words", "said"),
    [
        (("--style", "triple"), "--style: neither a width nor a style"),
        (("--format", "gif"), "--format: unknown format (got 'gif'); choose from png, svg, pdf, pgf"),
        (("--format", ","), "--format: unknown format"),
        (("--dpi", "0"), "--dpi"),
        (("--dpi", "nan"), "--dpi"),
    ],
)
def test_bad_options(results: Path, tmp_path: Path, words: tuple[str, ...], said: str) -> None:
    code, _, complaint = plot(results / "tracking", "tracking_errors", "--output", tmp_path / "new", *words)
    assert code == 2
    assert said in complaint
    assert not (tmp_path / "new").exists()


def test_results_that_are_none(results: Path, tmp_path: Path) -> None:
    def complaint(path: Path) -> str:
        code, _, said = plot(path)
        assert code == 2
        return said

    assert "no such file" in complaint(tmp_path / "nowhere")
    assert "no results in this folder" in complaint(tmp_path)
    whole = (results / "tracking" / "results.nc").read_bytes()
    for name, content, said in (
        ("cut.nc", whole[: len(whole) // 2], "damaged"),
        ("cut.json", b'{"kind": "optimisation", ', "damaged"),
        ("cut.parquet", b"PAR1 and no more", "damaged"),
        ("text.txt", b"hello", "not a file of results"),
        ("empty", b"", "not a file of results"),
        ("other.json", b'{"a": 1}', "no figures are drawn"),
    ):
        (tmp_path / name).write_bytes(content)
        assert said in complaint(tmp_path / name)
    xr.Dataset({"a": ("time", [1.0])}).to_netcdf(tmp_path / "foreign.nc")
    assert "a netCDF file, but" in complaint(tmp_path / "foreign.nc")
    later = xr.load_dataset(results / "tracking" / "results.nc").assign_attrs(schema=99)
    later.to_netcdf(tmp_path / "later.nc")
    assert "later version" in complaint(tmp_path / "later.nc")
    both = tmp_path / "both"
    both.mkdir()
    (both / "results.nc").write_bytes(whole)
    (both / "verify.nc").write_bytes(whole)
    assert "several results (results.nc, verify.nc)" in complaint(both)
    (both / "summary.json").write_text('{"modes": {}}')
    assert "name results.nc beside it" in complaint(both / "summary.json")


def test_figures_without_their_data_are_not_listed(results: Path) -> None:
    source = open_source(results / "tracking")
    less = Source(source.kind, source.data.drop_vars(["joint_force", "actuation_condition"]), source.folder)
    missing = {each.name for each in CATALOGUE["tracking"]} - {each.name for each in figures_of(less)}
    assert missing == {"joint_forces", "actuation_condition"}
    failed = Source("optimisation", {"kind": "optimisation", "history": [[0, None, False]]}, results)
    assert figures_of(failed) == []


def test_a_folder_that_cannot_be_written(results: Path, tmp_path: Path) -> None:
    (tmp_path / "file").write_text("")
    source = open_source(results / "tracking")
    with pytest.raises(InputError, match="cannot be written"):
        write_figures(drawings(source, find_figure(source, "tracking_errors")), tmp_path / "file" / "figures")


def test_response_curves_show_the_table(results: Path) -> None:
    source = open_source(results / "sweep")
    (figure,) = drawn(source, "response_curves", metrics=["total_mass"])
    rows = figure.axes
    runs = source.designs.in_modes(["++++"])
    shown = {line.get_label(): np.column_stack(line.get_data()) for line in rows[0].lines}
    points = next(values for values in shown.values() if len(values) == 16)
    np.testing.assert_allclose(points, np.column_stack([1e3 * runs.parameters["x"], runs.metrics["total_mass"]]))
    np.testing.assert_allclose(points[:, 1], 3.0 + 0.1 * points[:, 0] + runs.parameters["y"])
    assert rows[0].get_ylabel() == "mass [kg]"
    assert [axes.get_xlabel() for axes in rows] == ["$x$ [mm]", "$y$ [kg]"]


def test_a_point_at_rest_has_a_panel(results: Path) -> None:
    (figure,) = drawn(open_source(results / "tracking"), "end_effector_path", points=["proximal1.A1"])
    (axes,) = figure.axes
    assert np.diff(axes.get_xlim())[0] == pytest.approx(1.0)
    assert figure.get_figheight() > 20.0 * MM


def test_the_front_is_of_what_no_other_design_is_better_than(results: Path) -> None:
    rng = np.random.default_rng(5)
    x, y = rng.integers(0, 12, (2, 80)).astype(float)
    front = undominated(x, y)
    worse = [
        any((x[j] <= x[i]) & (y[j] <= y[i]) & ((x[j] < x[i]) | (y[j] < y[i])) for j in range(80)) for i in range(80)
    ]
    assert {(x[i], y[i]) for i in range(80) if not worse[i]} == {(x[i], y[i]) for i in front}
    assert list(x[front]) == sorted(x[front])
    assert undominated(np.zeros(0), np.zeros(0)).size == 0
    # A design without one of the metrics neither is on the front nor ends it.
    assert undominated(np.array([0.0, 1.0, 2.0, np.nan]), np.array([3.0, np.nan, 1.0, 0.0])).tolist() == [0, 2]
    (figure,) = drawn(open_source(results / "sweep"), "pareto_front")
    # Thin links err, thick ones are heavy and want torque.
    assert figure.axes[0].get_xlabel().startswith("RMS tracking error")


def test_the_thick_line_is_the_design_that_is_least(results: Path) -> None:
    source = open_source(results / "sweep")
    (figure,) = drawn(source, "parallel_coordinates", modes=["++++"])
    panel = figure.axes[0]
    (thick,) = [line for line in panel.lines if line.get_label() == "the least"]
    runs = source.designs.in_modes(["++++"])
    best = int(np.argmin(runs.metrics["tracking_rms"]))
    # What is the same of all designs (validity is 0 of rigid ones) has no line.
    drawn_columns = [values for values in (*runs.parameters.values(), *runs.metrics.values()) if np.ptp(values) > 0.0]
    places = [(values[best] - values.min()) / np.ptp(values) for values in drawn_columns]
    np.testing.assert_allclose(thick.get_xdata(), places, atol=1e-12)
    assert len(panel.collections[0].get_segments()) == 16


def test_energies_and_their_imbalance(results: Path) -> None:
    source = open_source(results / "motion")
    run = source.data
    (figure,) = drawn(source, "energies")
    every, elastic, balance = figure.axes
    shown = {line.get_label(): line.get_ydata() for line in every.lines}
    np.testing.assert_array_equal(shown["kinetic energy"], run["kinetic_energy"])
    np.testing.assert_array_equal(shown["work done on it"], run["work"])
    np.testing.assert_array_equal(elastic.lines[0].get_ydata(), run["strain_energy"])
    total = (run["kinetic_energy"] + run["strain_energy"] - run["work"]).values
    off = np.abs(total - total[0])
    drawn_off = balance.lines[0].get_ydata()
    np.testing.assert_allclose(drawn_off[off > 0.0], off[off > 0.0])


def test_distances_forces_and_conditions_are_those_of_the_dataset(results: Path) -> None:
    source = open_source(results / "tracking")
    run = source.data.isel(mode=0)
    (distance,) = drawn(source, "tracking_distance")
    away = 1e6 * np.linalg.norm((run["end_effector"] - run["end_effector_desired"]).values, axis=1)
    seen = np.asarray(distance.axes[0].lines[0].get_ydata())
    np.testing.assert_allclose(seen[np.isfinite(seen)], away[away > 1e-2])
    (forces,) = drawn(source, "joint_forces", modes=["++"])
    largest = max(np.nanmax(line.get_ydata()) for line in forces.axes[0].lines)
    assert largest == pytest.approx(float(np.linalg.norm(run["joint_force"].values, axis=-1).max()))
    (condition,) = drawn(source, "actuation_condition")
    np.testing.assert_array_equal(condition.axes[0].lines[0].get_ydata(), run["actuation_condition"])
    (bends,) = drawn(source, "link_deflections")
    assert bends.axes[0].get_ylabel().startswith("transverse displacement [")


def test_all_figures_of_rigid_links_are_those_that_can_be_drawn(tmp_path: Path) -> None:
    model = pf.load("five_bar")
    task = pf.plan(model.mechanism.rigid(), model.paths["square"], duration=0.02, samples=3)
    save_results(pf.tracking_dataset([task.simulate("++")]), tmp_path / "results.nc")
    source = open_source(tmp_path / "results.nc")
    names = [figure.name for figure in figures_of(source)]
    assert "link_deflections" not in names
    for name in names:
        drawn(source, name)


def test_one_name_a_quantity() -> None:
    assert metric_label("peak_torque.tau1") == "peak torque of tau1"
    assert [logarithmic_number(x) for x in (0.001, 5.0, 1e-5, 2e-5, 1e4)] == ["0.001", "5", "10⁻⁵", "2·10⁻⁵", "10⁴"]


def test_neither_numba_nor_kernels_are_imported(results: Path, tmp_path: Path) -> None:
    code = (
        "import sys\n"
        "from paraflex.cli.app import app\n"
        f"words = ['plot', {str(results / 'tracking')!r}, 'motor_torques', '--output', {str(tmp_path)!r}]\n"
        "try:\n    app(words)\nexcept SystemExit as end:\n    assert not end.code\n"
        "loaded = {'numba', 'llvmlite', 'paraflex.kernel', 'paraflex.integrators'} & set(sys.modules)\n"
        "assert not loaded, loaded\n"
    )
    python("-c", code, check=True)
