"""Looks of figures: bent beams without kinks, magnification, trails, legends, and numbers below rounding."""

from __future__ import annotations

import numpy as np
import pytest
import xarray as xr
from matplotlib.figure import Figure
from scipy.interpolate import CubicSpline

from colours import APART, colour_distance
from paraflex.figures.selection import moving_directions
from paraflex.plots.layout import lay_out, panels
from paraflex.plots.scene import MAGNIFICATIONS, default_magnification, followed_stations
from paraflex.plots.style import journal_style
from paraflex.plots.themes import THEMES
from paraflex.results.outlines import Hold, Outline, stiff_shape


def held(at: list[float], places: list[complex], turn: float = 0.0) -> np.ndarray:
    """The base (s,) of a beam of 1 m that is held at places, its stations 0, 0.01, ..."""
    x = np.linspace(0.0, 1.0, 101)
    drawn = Outline("beam", np.column_stack([x, np.zeros_like(x)]), {})
    holds = [Hold(np.array([a + 0j]), np.array([b])) for a, b in zip(at, places, strict=True)]
    base = stiff_shape(drawn, holds, np.array([turn]))[0]
    return base[:, 0] + 1j * base[:, 1]


def test_a_beam_held_in_mid_span_has_no_kink() -> None:
    at, places = [0.1, 0.4, 0.55, 0.9], [0.1 + 0j, 0.4 + 0.03j, 0.55 + 0.04j, 0.9 - 0.01j]
    base = held(at, places)
    spline = CubicSpline(at, places, bc_type="natural")
    np.testing.assert_allclose(base[10:91], spline(np.linspace(0.1, 0.9, 81)), atol=1e-13)
    # Neighbouring pieces turn by far less than the chords between the holds.
    chords = np.diff(places)
    kinks = np.max(np.abs(np.angle(chords[1:] / chords[:-1])))
    assert np.max(np.abs(np.angle(np.diff(base)[1:] / np.diff(base)[:-1]))) < 0.1 * kinks
    # Beyond the last holds it goes on straight, as long as it is.
    np.testing.assert_allclose(np.abs(np.diff(base[:11])), 0.01, atol=1e-13)
    np.testing.assert_allclose(np.abs(np.diff(base[90:])), 0.01, atol=1e-13)


def test_a_beam_whose_holds_are_where_it_is_not_bent_is_straight() -> None:
    turned = 2.0 + 1j + np.exp(0.7j) * np.array([0.0, 0.3, 1.0])
    np.testing.assert_allclose(held([0.0, 0.3, 1.0], [*turned]), 2.0 + 1j + np.exp(0.7j) * np.linspace(0.0, 1.0, 101))
    # Two holds at one place tell no direction: the material does.
    np.testing.assert_allclose(held([0.5, 0.5], [0j, 0j], 0.2), np.exp(0.2j) * (np.linspace(0.0, 1.0, 101) - 0.5))


def bent(by: float) -> xr.Dataset:
    """Two samples of a link of 2 m that bends by a length in the second."""
    base = np.zeros((2, 3, 2))
    base[:, :, 0] = [0.0, 1.0, 2.0]
    shape = base.copy()
    shape[1, 1, 1] = by
    return xr.Dataset(
        {"shape": (("time", "station", "axis"), shape), "shape_base": (("time", "station", "axis"), base)}
    )


@pytest.mark.parametrize(
    ("by", "times"), [(0.0, 1.0), (1e-6, 1.0), (1e-4, 200.0), (0.004, 20.0), (0.01, 10.0), (0.1, 1.0), (3.0, 1.0)]
)
def test_deflections_are_drawn_as_large_as_is_seen_and_round(by: float, times: float) -> None:
    assert default_magnification([bent(by)]) == times
    assert times in MAGNIFICATIONS
    # Of several runs the largest counts; what a run did not reach does not.
    assert default_magnification([bent(by), bent(0.1)]) == 1.0
    assert default_magnification([bent(by).where(bent(by)["shape"] < -1.0)]) == 1.0


def test_the_trail_is_that_of_what_goes_farthest_where_nothing_is_free() -> None:
    shape = np.zeros((3, 2, 2))
    shape[:, 0, 0], shape[:, 1, 1] = [0.0, 0.1, 0.2], [0.0, 0.5, 0.9]
    run = xr.Dataset(
        {
            "shape": (("time", "station", "axis"), shape),
            "joint_position": (("time", "joint", "axis"), shape),
        },
        coords={"point": ["link.A", "link.B"], "point_station": ("point", [0, 1])},
    )
    assert followed_stations(run) == (1,)
    assert followed_stations(run.assign_attrs(end_effector_point="link.A")) == (0,)
    assert followed_stations(run.isel(joint=[1])) == (0,)
    assert followed_stations(run.isel(time=[0])) == ()


def figure_of(*labels: tuple[str, ...]) -> Figure:
    time = np.linspace(0.0, 1.0, 5)
    with journal_style():
        figure, axes = panels(len(labels), 1)
        for panel, names in zip(axes[:, 0], labels, strict=True):
            for name in names:
                panel.plot(time, np.sin(time), label=name)
        return lay_out(figure, axes, panel_height=30.0)


def words(holder) -> list[str]:
    legend = holder.get_legend() if not isinstance(holder, Figure) else next(iter(holder.legends), None)
    return [] if legend is None else [text.get_text() for text in legend.get_texts()]


def test_a_legend_stands_where_its_lines_are() -> None:
    apart = figure_of(("time", "a"), ("time", "b", "c"))
    assert words(apart) == ["time"]
    assert [words(panel) for panel in apart.axes] == [["a"], ["b", "c"]]
    # One legend is enough where one panel has it all.
    alike = figure_of(("a", "b"), ("a",))
    assert words(alike) == ["a", "b"]
    assert [words(panel) for panel in alike.axes] == [[], []]


def test_legends_of_panels_stand_between_them() -> None:
    figure = figure_of(("a",), ("b", "c"))
    figure.canvas.draw()
    upper, lower = figure.axes
    for panel, ceiling in ((upper, figure.bbox.y1), (lower, upper.get_window_extent().y0)):
        box = panel.get_legend().get_window_extent()
        assert panel.get_window_extent().y1 <= box.y0 + 1.0
        assert box.y1 <= ceiling + 1.0


def test_rounding_errors_are_shown_as_nothing() -> None:
    with journal_style():
        figure, axes = panels(2, 1)
        axes[0, 0].plot([0.0, 1.0], [1e-15, -3e-16])
        axes[1, 0].plot([0.0, 1.0], [1e-6, -3e-6])
        lay_out(figure, axes, panel_height=30.0)
    assert axes[0, 0].get_ylim() == (-1.04, 1.04)
    assert axes[1, 0].get_ylim()[1] < 1e-5


def test_an_axis_along_which_nothing_moves_has_no_panel() -> None:
    speed = np.column_stack([np.ones(4), 1e-12 * np.ones(4)])
    run = xr.Dataset(
        dict.fromkeys(("end_effector_velocity", "end_effector_velocity_desired"), (("time", "axis"), speed)),
        coords={"axis": ["x", "y"]},
    )
    assert moving_directions(run) == ["x"]
    assert moving_directions(0.0 * run) == ["x", "y"]


@pytest.mark.parametrize("look", THEMES.values(), ids=THEMES)
def test_no_link_is_drawn_in_the_colour_of_the_trail_or_the_path(look) -> None:
    assert min(colour_distance(own, link) for own in (look.trail, look.desired) for link in look.links) > APART
