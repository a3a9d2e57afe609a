"""Curves over a joint or a coordinate of a point in place of time, hodographs, components and paths of points."""

import inspect
from functools import cache

import numpy as np
import pytest
import xarray as xr

import paraflex as pf
from paraflex import plots
from paraflex.errors import InputError
from paraflex.figures.abscissae import abscissae, drawn_over, offered
from paraflex.figures.charts import Axis, Chart, Curve, Span
from paraflex.figures.entry import prepared
from paraflex.figures.run_motion import hodographs, point_components, point_paths
from paraflex.reports import motion_page
from paraflex.results import motion_dataset, save_results
from shell import paraflex


@cache
def four_bar() -> xr.Dataset:
    return motion_dataset(pf.simulate_motion(pf.load("four_bar").mechanism.rigid(), 0.1, samples=21))


def drawn(figure, panel=0):
    """Points of the curves of a panel by their labels, as Matplotlib has them."""
    return {line.get_label(): np.asarray(line.get_xydata()) for line in figure.axes[panel].lines}


def test_forces_over_the_angle_of_a_joint():
    """The crank turns on the ground at a given speed: its angle is that of the body and proportional to time."""
    data = four_bar()
    figure = plots.joint_forces(data, over="O")
    (panel,) = figure.axes
    assert panel.get_xlabel() == "angle of $O$ [rad]"
    lines = drawn(figure)
    force = np.linalg.norm(data["joint_force"].sel(joint="A").transpose("time", "axis"), axis=1)
    np.testing.assert_allclose(lines["$A$"][:, 1], force, rtol=1e-12)
    for line in lines.values():
        np.testing.assert_allclose(line[:, 0], data["angle"].sel(body="crank"), atol=1e-9)
        np.testing.assert_allclose(np.diff(line[:, 0]), 20.0 * 0.005, rtol=1e-5)


def test_energies_over_a_coordinate_of_a_point_are_in_the_unit_of_the_axis():
    figure = plots.energies(four_bar(), over="crank.A.x")
    # The crank is 0.1 m long.
    angle = four_bar()["angle"].sel(body="crank").values
    for panel in figure.axes[:2]:
        assert panel.get_xlabel() == "x of crank.A [mm]"
        np.testing.assert_allclose(np.asarray(panel.lines[0].get_xdata()), 100.0 * np.cos(angle), atol=1e-3)


def test_hodographs_of_a_crank_are_circles_across_its_positions():
    (chart,) = hodographs(prepared(four_bar()), ["crank.A"])
    (path,) = point_paths(prepared(four_bar()), ["crank.A"])
    (velocity, _), (place, _) = chart.curves, path.curves
    vx, vy, x, y = (np.asarray(one) for one in (velocity.x, velocity.y, place.x, place.y))
    np.testing.assert_allclose(np.hypot(vx, vy), 2.0, rtol=1e-4)
    np.testing.assert_allclose([vx, vy], [-20.0 * y, 20.0 * x], atol=1e-3)
    assert chart.equal


def test_components_are_derivatives_of_one_another():
    """Central differences of the position over 5 ms differ from its velocity by (w h)^2/6 of it."""
    charts = list(point_components(prepared(four_bar()), ["crank.A", "rocker.B"]))
    assert [chart.choices for chart in charts] == 3 * [["crank.A", "rocker.B"]]
    place, velocity, acceleration = ([one for one in chart.curves if one.choice == 0] for chart in charts)
    assert [one.name for one in place] == ["x", "y"]
    for lower, upper in ((place, velocity), (velocity, acceleration)):
        for one, rate in zip(lower, upper, strict=True):
            slope = np.gradient(np.asarray(one.y), 0.005)[1:-1]
            size = np.max(np.abs(rate.y))
            np.testing.assert_allclose(slope, np.asarray(rate.y)[1:-1], atol=0.01 * size)


def test_time_is_the_default():
    one, other = (drawn(plots.energies(four_bar(), **given)) for given in ({}, {"over": "time"}))
    assert one.keys() == other.keys()
    assert all(np.array_equal(one[name], other[name]) for name in one)


def two_runs() -> xr.Dataset:
    time = np.linspace(0.0, 1.0, 11)
    place = np.stack([np.stack([time, 0.0 * time], 1), np.stack([1.0 - time**2, 0.0 * time], 1)])
    return xr.Dataset(
        {"end_effector": (("mode", "time", "axis"), place)},
        {"mode": ["a", "b"], "time": time, "axis": ["x", "y"]}, {"end_effector_point": "link.P"},
    )  # fmt: skip


def test_curves_keep_their_runs_and_those_of_all_runs_are_over_each():
    data, y = two_runs(), np.arange(11.0)
    curves = [Curve("one", y, run=1, shown=(1,)), Curve("desired", y, desired=True, choice=2),
              Curve("sampled", [0.0, 1.0], [0.25, 0.5], run=1)]  # fmt: skip
    chart = Chart("a", "A", Axis("way", "m"), curves, spans=[Span(0.5, 1.0)])
    (over,) = drawn_over([chart], data, "link.P.x")
    one, first, second, sampled = over.curves
    time = data["time"].values
    assert (over.x.name, over.spans, over.over_time) == ("x of link.P", (), False)
    assert (one.shown, first.shown, second.shown, second.choice) == ((1,), (0,), (1,), 2)
    np.testing.assert_allclose(np.asarray(one.x), 1.0 - time**2)
    np.testing.assert_allclose(np.asarray(first.x), time)
    np.testing.assert_allclose(np.asarray(second.x), np.asarray(one.x))
    # Between samples 0.1 s apart the coordinate is straight: at 0.25 s it lies 0.05^2 below the parabola.
    np.testing.assert_allclose(np.asarray(sampled.x), [1.0 - 0.25**2 - 0.05**2, 0.75], rtol=1e-12)
    plane = Chart("b", "B", Axis("", "m"), [Curve("", y, y)], Axis("", "m"))
    assert drawn_over([chart, plane], data, "link.P.x")[1] is plane


def test_runs_of_all_models_are_numbered_mode_by_mode():
    data = xr.concat([two_runs(), two_runs() + 10.0], xr.IndexVariable("model", ["p", "q"]), combine_attrs="override")
    x, y = abscissae(data.transpose("mode", "model", "time", "axis"))
    assert (x.name, x.moves, y.name, y.moves) == ("link.P.x", True, "link.P.y", False)
    np.testing.assert_allclose(x.values[:, 0], [0.0, 10.0, 1.0, 11.0])


@pytest.mark.parametrize(
    ("name", "words"),
    [
        ("crank.O.x", "over: does not move in these results (got 'crank.O.x'); one of time, O, A, B, Q"),
        ("crank.A", "over: no joint or coordinate of a point with this name in these results (got 'crank.A'); "
                    'write "crank.A.x" or "crank.A.y"'),
        ("rocker.Bx", 'did you mean "rocker.B.x"?'),
        ("", "choose from time, O, A"),
        ("ψ\n", "choose from time, O, A"),
        (3, "over: not a text (got 3)"),
    ],
)  # fmt: skip
def test_what_cannot_be_an_abscissa_is_named(name, words):
    with pytest.raises(InputError) as error:
        plots.energies(four_bar(), over=name)
    assert words in str(error.value)
    assert "\n" not in str(error.value)


def test_only_figures_of_runs_are_over_something():
    runs = "energies", "tracking_errors", "model_distances"
    others = "bode", "force_travel", "sobol_bars", "work_precision"
    for name in (*runs, *others):
        assert ("over" in inspect.signature(getattr(plots, name)).parameters) == (name in runs), name


def test_a_figure_without_curves_over_time_is_named():
    with pytest.raises(InputError, match="over: this figure has no curves over time"):
        plots.point_paths(four_bar(), over="O")


def test_a_joint_that_is_held_does_not_move():
    """Constraint errors of a hundred-millionth of an angle are no motion, whether or not another joint turns."""
    data = four_bar().copy(deep=True)
    for joint in ("O", "A"):
        data["joint_coordinate"].loc[{"joint": joint}] = 1e-10 * np.sin(np.arange(21.0))
    moving = {one.name for one in abscissae(prepared(data)) if one.moves}
    assert moving & {"O", "A", "B", "Q"} == {"B", "Q"}


def test_a_page_offers_what_moves_and_results_without_joints_their_end_effector():
    names = [one.name for one in offered(prepared(four_bar()))]
    # Two points are in each joint, of which one is offered.
    assert names[:4] == ["O", "A", "B", "Q"]
    assert [name.partition(".")[2] for name in names[4:]] in (
        ["A.x", "A.y", "B.x", "B.y"],
        ["B.x", "B.y", "A.x", "A.y"],
    )
    assert [one.name for one in offered(two_runs())] == ["link.P.x"]
    assert offered(four_bar()[["angle"]].expand_dims(mode=[""])) == []
    assert [one.name for one in motion_page(four_bar()).abscissae][:2] == ["O", "A"]


def test_the_command_draws_figures_over_time_alone_and_names_files_after_the_abscissa(tmp_path):
    save_results(four_bar(), tmp_path / "results.nc")
    every = paraflex("plot", str(tmp_path), "--over", "O", "--format", "svg")
    assert every.returncode == 0, every.stderr
    names = {file.name for file in (tmp_path / "figures").iterdir()}
    assert {"joint_forces_over_O.svg", "energies_over_O.svg", "point_components_over_O.svg"} <= names
    assert not {name for name in names if "paths" in name or "hodo" in name or "drawing" in name}
    for given, words in (
        (["--over", "Oo"], "--over: no joint or coordinate of a point with this name in these results (got 'Oo'); did"),
        (["point_paths", "--over", "A"], "--over: point_paths has no curves over time (got 'A'); leave it out"),
        (["energies", "--over", "crank.O.y"], "--over: does not move in these results (got 'crank.O.y')"),
    ):
        refused = paraflex("plot", str(tmp_path), *given, "--out", str(tmp_path / "none"))
        assert refused.returncode == 2
        assert words in refused.stderr
    assert not (tmp_path / "none").exists()
