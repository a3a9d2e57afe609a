"""Figure that compares control laws in several actuation modes."""

from __future__ import annotations

from typing import Any

import numpy as np
import xarray as xr
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from numpy.typing import NDArray

from paraflex.errors import InputError
from paraflex.figures.selection import names_of
from paraflex.formatting import display_unit
from paraflex.plots.given import drawn
from paraflex.plots.labels import metric_name, plain
from paraflex.plots.layout import is_narrow, lay_out, panels
from paraflex.plots.scales import LIST_LINE, list_lines, mark_powers
from paraflex.plots.style import BLACK, COLOURS
from paraflex.results.metrics import METRICS, VALIDITY

# Metrics shown first; others fill the remaining panels.
_FIRST = ("tracking_rms_motion", "tracking_rms", "residual_vibration", "peak_torque_max")
_PANELS = 3
_MARKERS = ("o", "s", "^", "D", "v", "P", "X")
# Share of a law's line over which its modes are spread, and height per mode [mm].
_BAND, _SHARE = 0.6, 2.6
# Position of the marks of failures, as a share of the panel's width.
_EDGE = 0.02
# Ratio of a panel's values above which its axis is logarithmic.
_DECADE = 10.0
# Ratio above which it is numbered at powers of ten only: narrow panels have no room for more.
_WIDE = 40.0


@drawn
def law_comparison(data: xr.Dataset) -> Figure:
    """Plot the tracking error, residual vibration and largest torque of every control law, by mode.

    An "x" marks a run that did not reach its end, an open mark a run beyond the validity of the model.
    """
    shown = _metrics(data)
    laws, modes = names_of(data, "law"), names_of(data, "mode")
    figure, axes = panels(1, len(shown))
    for number, (panel, name) in enumerate(zip(axes.flat, shown, strict=True)):
        values = data[name].transpose("mode", "law").values
        unit = display_unit(data[name].attrs["units"], values)
        named = number == 0 or is_narrow()
        list_lines(panel, laws if named else [""] * len(laws))
        for k, mode in enumerate(modes):
            # The marks of the modes are spread within the line of a law.
            places = np.arange(len(laws)) + (0.0 if len(modes) == 1 else _BAND * (k / (len(modes) - 1) - 0.5))
            _draw_mode(panel, unit.factor * values[k], places, _beyond(data, mode), k, f"mode {plain(mode)}")
        _scale(panel, unit.factor * values)
        panel.set_title(metric_name(name))
        panel.set_xlabel("" if unit.name == "1" else f"[{unit.name}]")
        for line in range(len(laws) - 1):
            panel.axhline(line + 0.5, color="0.85", linewidth=0.5, zorder=0.5)
    _explain(axes.flat[0], data)
    return lay_out(figure, axes, panel_height=max(LIST_LINE, _SHARE * len(modes) + 1.5) * len(laws) + 2.0)


def _metrics(data: xr.Dataset) -> list[str]:
    """Return at most three metrics with finite values, those of `_FIRST` first."""
    there = [str(name) for name in data.data_vars if str(name).partition(".")[0] in METRICS and name != VALIDITY]
    order = [name for name in _FIRST if name in there] + [name for name in there if name not in _FIRST]
    found = [name for name in order if np.isfinite(data[name].values).any()][:_PANELS]
    if not found:
        raise InputError("no law ran in any mode", field="results", remedy="see the reasons in laws.json")
    return found


def _beyond(data: xr.Dataset, mode: str) -> NDArray[np.bool_]:
    """Return a mask of the laws under which links bend beyond the validity of the model."""
    if VALIDITY not in data:
        return np.zeros(data.sizes["law"], dtype=bool)
    return data[VALIDITY].sel(mode=mode).values > 1.0


def _draw_mode(
    panel: Axes, values: NDArray[Any], places: NDArray[Any], beyond: NDArray[np.bool_], number: int, label: str
) -> None:
    look: dict[str, Any] = {
        "linestyle": "none", "marker": _MARKERS[number % len(_MARKERS)], "color": COLOURS[number % len(COLOURS)],
        "markersize": 4.0,
    }  # fmt: skip
    panel.plot(np.where(beyond, np.nan, values), places, label=label, **look)
    hollow: dict[str, Any] = look | {"markerfacecolor": "white"}
    panel.plot(np.where(beyond, values, np.nan), places, **hollow)
    missing = np.isnan(values)
    edge: dict[str, Any] = look | {"marker": "x", "transform": panel.get_yaxis_transform(), "clip_on": False}
    if missing.any():
        panel.plot(np.full(missing.sum(), _EDGE), places[missing], **edge)


def _scale(panel: Axes, values: NDArray[Any]) -> None:
    positive = values[np.isfinite(values) & (values > 0.0)]
    panel.grid(axis="x", color="0.9", linewidth=0.4)
    if positive.size and positive.max() > _DECADE * positive.min():
        panel.margins(x=0.08)
        mark_powers(panel, "x", wide=_WIDE)
    else:
        panel.set_xlim(0.0, 1.08 * positive.max() if positive.size else 1.0)


def _explain(panel: Axes, data: xr.Dataset) -> None:
    """Add legend entries for failures and for runs beyond the validity of the model."""
    mark: dict[str, Any] = {"linestyle": "none", "color": BLACK, "markersize": 4.0}
    if (data["status"] != "complete").any():
        panel.plot([], [], marker="x", label="not run to the end", **mark)
    if VALIDITY in data and (data[VALIDITY] > 1.0).any():
        panel.plot([], [], marker="o", markerfacecolor="white", label="beyond what the model can describe", **mark)
