"""The figures show the dataset's values in the units they name, and their files are the same each time."""

from __future__ import annotations

import re
from collections.abc import Callable
from functools import partial
from pathlib import Path

import numpy as np
import pytest
import xarray as xr
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from matplotlib.lines import Line2D

from paraflex import plots
from paraflex.errors import InputError, OutputError
from paraflex.figures.selection import default_mode
from paraflex.formatting import display_unit
from paraflex.plots.labels import plain, symbol
from paraflex.units import DisplayUnit

FULL, PARTIAL = "++", "+-"
STOP = 25  # Samples of the partial run.
DESIRED_TWINS = (
    "end_effector",
    "end_effector_velocity",
    "end_effector_acceleration",
    "angle",
    "angular_velocity",
    "angular_acceleration",
)
SINGLE = ("tip_deflections", "link_motions", "end_effector_path", "end_effector_motion", "phase_diagrams")
# The figures of this file's datasets, and the units on their axes; those of all results are in test_plot_command.py.
UNITS = {
    "desired_path": {"mm"},
    "motor_torques": {"N m", "s"},
    "tip_deflections": {"µm", "mm", "mrad", "s"},
    "link_motions": {"rad", "rad/s", "rad/s²", "s"},
    "end_effector_path": {"mm"},
    "end_effector_motion": {"mm", "m/s", "m/s²", "s"},
    "phase_diagrams": {"mm", "m/s", "m/s²"},
    "tracking_errors": {"mm", "s"},
    "compared_links": {"rad", "rad/s", "s"},
    "compared_paths": {"mm"},
    "model_distances": {"mm", "µm", "s"},
    "motion_overview": {"rad", "rad/s", "J", "s"},
}
# Of studies of many designs, from their results as files hold them.
_INDEX = {"first": 0.4, "first_confidence": 0.2, "total": 0.7, "total_confidence": 0.3}
_INDICES = [
    {"metric": metric, "path": "square", "mode": FULL, "parameter": parameter, **_INDEX}
    for metric in ("tracking_rms", "peak_torque_max", "motor_energy")
    for parameter in ("thickness", "length of the distal links")
]
_MOVED = {name: {"relative": {"thickness": -2.0, "end_mass": None}} for name in ("tracking_rms", "peak_torque_max")}
STUDIES = {
    "convergence": {
        "kind": "optimisation",
        "history": [(0, 2.0, True), (1, None, False), (2, 1.5, True), (3, 9.0, False)],
    },
    "targets_reached": {
        "targets": [
            {"metric": "tracking_rms", "path": path, "mode": FULL, "value": 2.0, "start": 1.0, "reached": 2.1}
            for path in ("square", "a long way round")
        ]
    },
    "sobol_bars": {"indices": _INDICES},
    "elasticities": {
        "mechanism": "arm", "parameters": ["thickness", "end_mass"],
        "runs": [{"path": "square", "mode": FULL, "metrics": _MOVED}],
    },
}  # fmt: skip
COMPARED = ("compared_links", "compared_paths")
NAMES = (
    "end_effector_path",
    "motor_torques",
    "tracking_errors",
    "end_effector_motion",
    "phase_diagrams",
    "tip_deflections",
    "link_motions",
    "desired_path",
)


@pytest.fixture
def data() -> xr.Dataset:
    """Two modes of an arm of two links; the second run stops on the way, its second motor is passive."""
    rng = np.random.default_rng(11)
    time = np.linspace(0.0, 0.4, 41)
    phase = 2.0 * np.pi * np.minimum(time / 0.3, 1.0)
    waves = np.sin(np.outer(time, [20.0, 33.0]))

    def vary(size: float) -> np.ndarray:
        return size * rng.uniform(0.5, 1.0, (2, 1, 2)) * waves

    variables = {}
    for name, scale in zip(DESIRED_TWINS, (0.05, 1.0, 30.0, 0.8, 5.0, 200.0), strict=True):
        desired = scale * np.column_stack([np.cos(phase), np.sin(phase)]) + [0.1 * scale, 0.3 * scale]
        last = "axis" if name.startswith("end") else "body"
        variables[f"{name}_desired"] = (("mode", "time", last), np.stack([desired, desired]))
        variables[name] = (("mode", "time", last), np.stack([desired, desired]) + vary(0.01 * scale))
    for name, scale in (("tip_axial", 3e-6), ("tip_transverse", 2e-3), ("tip_slope", 0.03)):
        variables[name] = (("mode", "time", "body"), vary(scale))
    elbow = np.column_stack([0.1 + 0.01 * np.sin(phase), 0.2 + 0.02 * np.sin(phase)])
    tip = variables["end_effector_desired"][1][0]
    places = np.stack([np.zeros_like(elbow), elbow, elbow, tip], axis=1)
    variables["point_position"] = (("mode", "time", "point", "axis"), np.stack([places, places]))
    for name, (_, values) in variables.items():
        if not name.endswith("_desired"):
            values[1, STOP:] = np.nan
    torque = vary(7.0)
    torque[1, :, 1] = 0.0
    variables["torque"] = (("mode", "time", "motor"), torque)
    variables["tracking_rms"] = (("mode",), np.array([3.25e-4, np.nan]))
    return xr.Dataset(
        variables,
        coords={
            "mode": [FULL, PARTIAL],
            "time": time,
            "axis": ["x", "y"],
            "body": ["link1", "link2"],
            "motor": ["tau1", "tau2"],
            "point": ["link1.A", "link1.B", "link2.B", "link2.P"],
        },
        attrs={"mechanism": "arm", "motion_end": 0.3},
    )


def models_of(data: xr.Dataset) -> xr.Dataset:
    """Three models of the arm: what `studies.Verification.dataset` gives, deviations of three sizes."""
    parts = []
    for scale in (1.0, 1.01, 0.2):
        part = data.copy()
        part["end_effector"] = data["end_effector_desired"] + scale * (
            data["end_effector"] - data["end_effector_desired"]
        )
        part["chord_angle"], part["chord_velocity"] = scale * data["angle"], -500.0 * scale * data["angular_velocity"]
        parts.append(part)
    both = xr.concat(parts, xr.Variable("model", ["second-order", "segments", "exudyn"]), combine_attrs="override")
    return both.assign_attrs(reference="second-order")


def motion_of(data: xr.Dataset) -> xr.Dataset:
    """A run of the arm without a path: what `results.motion_dataset` gives."""
    run = data.isel(mode=0)[["angle", "angular_velocity"]]
    # To 0.030 s: the last number on the time axis is as wide as they get.
    run = run.assign_coords(time=0.075 * run["time"])
    for k, name in enumerate(("kinetic_energy", "strain_energy", "work")):
        run[name] = ("time", -120.0 * np.cos((k + 1) * 10.0 * data["time"].values))
    return run.assign_attrs(kind="motion")


def figure_of(name: str, data: xr.Dataset, mode: str = FULL) -> Figure:
    draw: Callable[..., Figure] = getattr(plots, name)
    if name in COMPARED:
        return draw(models_of(data), mode, ("second-order", "segments"))
    if name == "model_distances":
        return draw(models_of(data))
    if name == "motion_overview":
        return draw(motion_of(data))
    return draw(data, mode) if name in SINGLE else draw(data)


def curve(axes: Axes, label: str) -> np.ndarray:
    """Points (n, 2) of the one line whose label starts so."""
    lines = [line for line in axes.lines if str(line.get_label()).startswith(label)]
    assert len(lines) == 1
    return points_of(lines[0])


def points_of(line: Line2D) -> np.ndarray:
    return np.column_stack([np.asarray(line.get_xdata(), float), np.asarray(line.get_ydata(), float)])


def stops(figure: Figure) -> list[np.ndarray]:
    return [points_of(line) for axes in figure.axes for line in axes.lines if line.get_label() == "the run stopped"]


same = partial(np.testing.assert_allclose, rtol=1e-12, atol=0.0)


@pytest.mark.parametrize(("name", "units"), UNITS.items())
def test_every_axis_label_names_its_unit(data: xr.Dataset, name: str, units: set[str]) -> None:
    figure = figure_of(name, data)
    labels = [text for axes in figure.axes for text in (axes.get_xlabel(), axes.get_ylabel()) if text]
    found = [re.search(r"\[(.+)\]$", label) for label in labels]
    assert all(found), labels
    assert {match[1] for match in found if match} == units


@pytest.mark.parametrize("mode", [FULL, PARTIAL])
@pytest.mark.parametrize("name", UNITS)
def test_nothing_overlaps_or_leaves_the_page(data: xr.Dataset, name: str, mode: str) -> None:
    data["angular_acceleration"] *= 50.0  # five digits and a sign
    stays_on_the_page(figure_of(name, data, mode))


@pytest.mark.parametrize("name", list(STUDIES))
def test_figures_of_studies_stay_on_the_page(name: str) -> None:
    stays_on_the_page(getattr(plots, name)(STUDIES[name]))


def stays_on_the_page(figure: Figure) -> None:
    figure.draw_without_rendering()
    boxes = [axes.get_tightbbox() for axes in figure.axes if axes.get_visible()]
    boxes += [legend.get_window_extent() for legend in figure.legends]
    page = figure.bbox
    for k, box in enumerate(boxes):
        assert box is not None
        assert page.x0 <= box.x0 < box.x1 <= page.x1
        assert page.y0 <= box.y0 < box.y1 <= page.y1
        for other in boxes[:k]:
            assert other is not None
            assert min(box.x1, other.x1) <= max(box.x0, other.x0) or min(box.y1, other.y1) <= max(box.y0, other.y0)


def test_desired_path_and_the_mechanism_at_its_start(data: xr.Dataset) -> None:
    (axes,) = plots.desired_path(data).axes
    same(curve(axes, "desired path"), 1e3 * data["end_effector_desired"].values[0])
    same(curve(axes, "start"), 1e3 * data["end_effector_desired"].values[0, :1])
    base, elbow, _, tip = 1e3 * data["point_position"].values[0, 0]
    links = next(each for each in axes.collections if each.get_label() == "links").get_segments()
    # A link's ends, in either order.
    assert [sorted(map(tuple, link)) for link in links] == [
        sorted([tuple(base), tuple(elbow)]),
        sorted([tuple(elbow), tuple(tip)]),
    ]
    same(curve(axes, "joints"), [base, elbow])
    same(curve(axes, "other points"), [tip])
    supports = next(each for each in axes.collections if each.get_label() == "_ground").get_paths()
    assert len(supports) == 1
    same(supports[0].vertices[0], base)
    assert {text.get_text() for text in axes.texts} >= {"A", "B", "P"}


def test_a_link_with_points_off_a_line_is_a_closed_outline(data: xr.Dataset) -> None:
    data = data.assign_coords(point=["plate.A", "plate.B", "plate.C", "rod.P"])
    data["point_position"][:, :, 2] = [0.3, 0.05]
    (axes,) = plots.desired_path(data).axes
    outline = next(each for each in axes.collections if each.get_label() == "links").get_segments()[0]
    same(outline[0], outline[-1])
    corners = 1e3 * data["point_position"].values[0, 0, :3]
    assert sorted(map(tuple, outline[:-1])) == sorted(map(tuple, corners))


def test_torques_and_passive_motors(data: xr.Dataset) -> None:
    full, part = plots.motor_torques(data).axes
    for axes, mode, motor in ((full, FULL, "tau1"), (full, FULL, "tau2"), (part, PARTIAL, "tau1")):
        same(curve(axes, symbol(motor))[:, 0], data["time"])
        same(curve(axes, symbol(motor))[:, 1], data["torque"].sel(mode=mode, motor=motor))
    assert not curve(part, symbol("tau2"))[:, 1].any()
    assert (full.get_title(), part.get_title()) == ("++", r"+-: passive $\tau_{2}$")
    assert full.get_ylim() == part.get_ylim()


def test_motors_differ_in_line_style_as_well_as_colour(data: xr.Dataset) -> None:
    axes = plots.motor_torques(data).axes[0]
    lines = [line for line in axes.lines if str(line.get_label()).startswith("$")]
    assert len({line.get_linestyle() for line in lines}) == len({line.get_color() for line in lines}) == 2


def test_tip_deflections_of_chosen_links(data: xr.Dataset) -> None:
    axes = plots.tip_deflections(data, FULL, ["link2"]).axes
    # 3 µm, 2 mm and 0.03 rad at most.
    for panel, variable, factor in zip(
        axes, ("tip_axial", "tip_transverse", "tip_slope"), (1e6, 1e3, 1e3), strict=True
    ):
        same(curve(panel, "link2")[:, 1], factor * data[variable].sel(mode=FULL, body="link2"))
    with pytest.raises(InputError, match="link9"):
        plots.tip_deflections(data, FULL, ["link9"])


def test_twins_of_a_symmetric_mechanism_are_shown_once(data: xr.Dataset) -> None:
    wave = np.sin(30.0 * data["time"].values)[:, None]
    names = ["left1", "left2", "right1", "right2"]
    run = data.isel(body=[0, 1, 0, 1]).assign_coords(body=names)
    run["tip_transverse"][:] = wave * [0.0070, 0.0041, 0.0075, 0.0040]
    titles = [axes.get_title() for axes in plots.tip_deflections(run, FULL).axes]
    assert titles[::3] == ["left1: axial displacement", "left2: axial displacement"]


def test_link_motions_desired_and_actual(data: xr.Dataset) -> None:
    panels = np.reshape(np.array(plots.link_motions(data, FULL).axes, dtype=object), (2, 3))
    for row, body in zip(panels, ("link1", "link2"), strict=True):
        for axes, variable in zip(row, DESIRED_TWINS[3:], strict=True):
            same(curve(axes, "mode ++")[:, 1], data[variable].sel(mode=FULL, body=body))
            same(curve(axes, "desired")[:, 1], data[f"{variable}_desired"].sel(mode=FULL, body=body))


def test_end_effector_motion_desired_and_actual(data: xr.Dataset) -> None:
    panels = np.reshape(np.array(plots.end_effector_motion(data, FULL).axes, dtype=object), (2, 3)).T
    for row, variable, factor in zip(panels, DESIRED_TWINS[:3], (1e3, 1.0, 1.0), strict=True):
        for axes, axis in zip(row, "xy", strict=True):
            same(curve(axes, "actual")[:, 0], data["time"])
            same(curve(axes, "actual")[:, 1], factor * data[variable].sel(mode=FULL, axis=axis))
            same(curve(axes, "desired")[:, 1], factor * data[f"{variable}_desired"].sel(mode=FULL, axis=axis))


def test_phase_diagrams_desired_and_actual(data: xr.Dataset) -> None:
    panels = np.reshape(np.array(plots.phase_diagrams(data, FULL).axes, dtype=object), (2, 2)).T
    position, velocity, acceleration = DESIRED_TWINS[:3]
    for row, across, up, factor in ((0, position, velocity, 1e3), (1, velocity, acceleration, 1.0)):
        for axes, axis in zip(panels[row], "xy", strict=True):
            for label, suffix in (("actual", ""), ("desired", "_desired")):
                shown = curve(axes, label)
                same(shown[:, 0], factor * data[across + suffix].sel(mode=FULL, axis=axis))
                same(shown[:, 1], data[up + suffix].sel(mode=FULL, axis=axis))


def test_tracking_errors_and_their_titles(data: xr.Dataset) -> None:
    full, part = plots.tracking_errors(data).axes
    errors = 1e3 * (data["end_effector"] - data["end_effector_desired"])
    for axes, mode in ((full, FULL), (part, PARTIAL)):
        for axis in "xy":
            same(curve(axes, f"${axis}$")[:, 1], errors.sel(mode=mode, axis=axis))
    assert full.get_title() == "++: RMS 0.325 mm over all"
    of_motion = data.assign(tracking_rms_motion=0.5 * data["tracking_rms"]).assign_attrs(error="motion")
    assert plots.tracking_errors(of_motion).axes[0].get_title() == "++: RMS 0.163 mm in the motion"
    assert part.get_title() == "+-: stopped at 0.24 s"


@pytest.mark.parametrize("magnification", [1.0, 30.0])
def test_deviation_is_magnified_as_asked(data: xr.Dataset, magnification: float) -> None:
    (axes,) = plots.end_effector_path(data, FULL, magnification).axes
    run = 1e3 * data.sel(mode=FULL)
    desired, actual = run["end_effector_desired"].values, run["end_effector"].values
    same(curve(axes, "desired"), desired)
    # Differences of numbers of about 100 mm.
    np.testing.assert_allclose(curve(axes, "actual, mode ++"), actual, atol=1e-11)
    shown = "actual" if magnification == 1.0 else "deviation × 30"
    np.testing.assert_allclose(curve(axes, shown) - desired, magnification * (actual - desired), atol=1e-11)


@pytest.mark.parametrize(("deviation", "factor"), [(1e-3, 10), (3.1e-4, 20), (2.9e-4, 50), (0.02, 1), (1e-15, 1)])
def test_chosen_magnification_is_round_and_keeps_the_deviation_small(
    data: xr.Dataset, deviation: float, factor: float
) -> None:
    # 15 mm of a path 100 mm wide are the most that is shown: 15, 48.4, 51.7 and 0.75 times these deviations; the last
    # is rounding, which is not to be shown at all.
    data["end_effector"] = data["end_effector_desired"].copy()
    data["end_effector"][0, 20, 0] += deviation
    (axes,) = plots.end_effector_path(data, FULL).axes
    shown = curve(axes, "actual" if factor == 1 else f"deviation × {factor}")[20, 0] - curve(axes, "desired")[20, 0]
    assert shown == pytest.approx(factor * 1e3 * deviation, abs=1e-10)


@pytest.mark.parametrize("magnification", [0.0, -2.0, np.nan, np.inf])
def test_magnification_must_be_positive(data: xr.Dataset, magnification: float) -> None:
    with pytest.raises(InputError, match="magnification"):
        plots.end_effector_path(data, FULL, magnification)


@pytest.mark.parametrize("name", SINGLE)
def test_a_partial_run_is_marked_where_it_stops(data: xr.Dataset, name: str) -> None:
    assert stops(figure_of(name, data, FULL)) == []
    figure = figure_of(name, data, PARTIAL)
    marks = stops(figure)
    assert len(marks) == len(figure.axes)
    for mark, axes in zip(marks, figure.axes, strict=True):
        line = points_of(axes.lines[0])
        assert np.isnan(line[STOP:, 1]).all()
        same(mark[0], line[STOP - 1])


def test_a_run_without_samples_can_be_drawn(data: xr.Dataset) -> None:
    for name in DESIRED_TWINS:
        data[name][1] = np.nan
    figure = plots.tracking_errors(data)
    assert figure.axes[1].get_title() == "+-: no samples"
    assert stops(plots.end_effector_motion(data, PARTIAL)) == []


def test_the_rest_after_the_motion_is_shaded(data: xr.Dataset) -> None:
    def shades(figure: Figure) -> list[tuple[float, float]]:
        boxes = [patch.get_extents() for axes in figure.axes for patch in axes.patches]
        inverse = figure.axes[0].transData.inverted()
        return [(inverse.transform(box.min)[0], inverse.transform(box.max)[0]) for box in boxes[:1]]

    same(shades(plots.motor_torques(data)), [(0.3, 0.4)])
    legend = plots.motor_torques(data).legends[0]
    assert "after the desired motion" in [text.get_text() for text in legend.get_texts()]
    data.attrs["motion_end"] = 0.4
    assert shades(plots.motor_torques(data)) == []


def test_rounding_errors_are_drawn_flat(data: xr.Dataset) -> None:
    for name in ("end_effector", "end_effector_desired"):
        data[name][:, :, 1] = 0.3 + 1e-13 * np.sin(200.0 * data["time"].values)
    low, high = plots.end_effector_motion(data, FULL).axes[3].get_ylim()
    # The path is 100 mm wide in x.
    assert high - low == pytest.approx(10.0, rel=0.1)
    assert 0.5 * (low + high) == pytest.approx(300.0)


def test_unknown_mode(data: xr.Dataset) -> None:
    with pytest.raises(InputError, match=r"one of \+\+, \+-"):
        plots.link_motions(data, "--")


def test_files_are_named_and_the_same_each_time(data: xr.Dataset, tmp_path: Path) -> None:
    written = plots.save_figures(data, tmp_path / "new" / "folder")
    assert written == [tmp_path / "new" / "folder" / f"{name}.{suffix}" for name in NAMES for suffix in ("png", "svg")]
    again = plots.save_figures(data, str(tmp_path / "again"), FULL)
    other = plots.save_figures(data, tmp_path / "other", PARTIAL)
    for first, second, third in zip(written, again, other, strict=True):
        assert first.stat().st_size > 5000
        assert first.read_bytes() == second.read_bytes()
        single = first.stem in SINGLE
        assert (first.read_bytes() != third.read_bytes()) == single


def test_mode_drawn_where_none_is_named(data: xr.Dataset) -> None:
    assert default_mode(data.assign_coords(mode=["+-", "++"])) == "++"
    assert default_mode(data.assign_coords(mode=["both", "one++"])) == "both"


def test_unwritable_folder(data: xr.Dataset, tmp_path: Path) -> None:
    (tmp_path / "file").write_text("")
    with pytest.raises(OutputError, match="cannot be written") as caught:
        plots.save_figures(data, tmp_path / "file" / "figures")
    assert caught.value.field == str(tmp_path / "file" / "figures")


@pytest.mark.parametrize(
    ("unit", "largest", "name", "factor"),
    [
        ("m", 0.0, "mm", 1e3),
        ("m", 0.2, "mm", 1e3),
        ("m", 1.1e-4, "mm", 1e3),
        ("m", 0.9e-4, "µm", 1e6),
        ("m", 1e-14, "nm", 1e9),
        ("m", np.nan, "mm", 1e3),
        ("rad", 0.11, "rad", 1.0),
        ("rad", 0.09, "mrad", 1e3),
    ],
)
def test_unit_suits_the_largest_value(unit: str, largest: float, name: str, factor: float) -> None:
    assert display_unit(unit, [0.0, -largest]) == (name, factor)


def test_stresses_are_in_megapascals() -> None:
    assert [display_unit("Pa", value) for value in (0.0, 2.0, 3e8)] == [DisplayUnit("MPa", 1e-6)] * 3


def test_names_as_symbols() -> None:
    names = ("tau1", "A1", "C", "link1", "link", "crank_2b", "cost$")
    assert [symbol(name) for name in names] == [
        r"$\tau_{1}$",
        "$A_{1}$",
        "$C$",
        "link1",
        "link",
        "crank_2b",
        r"cost\$",
    ]
    assert [plain(name) for name in ("+-", "both", "one-by-one")] == ["+-", "both", "one-by-one"]
