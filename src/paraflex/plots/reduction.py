"""Figures of reduced linear models: gains beside those of the full model, errors over frequency and along a path."""

from __future__ import annotations

from typing import Any

import numpy as np
import xarray as xr
from matplotlib.axes import Axes
from matplotlib.figure import Figure

from paraflex.errors import InputError
from paraflex.figures.selection import names_of, one_run
from paraflex.plots.given import drawn
from paraflex.plots.labels import plain, symbol
from paraflex.plots.layout import is_narrow, lay_out, panel_grid, panels
from paraflex.plots.scales import mark_powers
from paraflex.plots.style import BLACK, COLOURS, DASHES
from paraflex.results.kinds import check_kind
from paraflex.results.linear_data import HOLDINGS
from paraflex.results.reduction_along import OWN, STATIC, basis_name
from paraflex.results.reduction_data import FULL

# Decades of a gain shown below its largest value.
_DECADES = 7.0
# Smallest error along a path that is drawn; smaller ones are drawn as this one.
_LEAST = 1e-9
# Axis labels of positions along a motion, by unit.
AXES = {"m": "along the path [m]", "s": "along the motion [s]"}
# Largest number of outputs with a panel.
_PANELS = 6


@drawn
def reduced_responses(data: xr.Dataset, mode: str | None = None) -> Figure:
    """Plot the largest gain from a mode's inputs to every output over frequency, for full and reduced models."""
    check_kind(data, "reduction")
    run = one_run(data, mode)
    outputs = names_of(data, "output")[:_PANELS]
    figure, axes = panel_grid(len(outputs), 1 if is_narrow() else min(len(outputs), 2))
    for panel, output in zip(axes.flat, outputs, strict=False):
        gains = run["gain"].sel(output=output)
        for k, name in enumerate(names_of(data, "variant")):
            look = {"color": BLACK, "linewidth": 1.6} if name == FULL else {
                "color": COLOURS[(k - 1) % len(COLOURS)], "linestyle": DASHES[k % len(DASHES)]
            }  # fmt: skip
            panel.plot(data["frequency"].values, gains.sel(variant=name).values, label=_label(data, name), **look)
        panel.set_title(f"to {symbol(output)}")
        panel.set_ylabel(f"gain [{data['output_unit'].sel(output=output).item()}/({data.attrs['input_unit']})]")
        _over_frequency(panel, data)
        top = float(np.nanmax(gains.values))
        low = float(np.nanmin(gains.values[gains.values > 0.0]))
        panel.set_ylim(max(0.5 * low, top * 10.0**-_DECADES), 2.0 * top)
        panel.set_yscale("log")
        mark_powers(panel)
    return lay_out(figure, axes, panel_height=46.0)


@drawn
def reduction_errors(data: xr.Dataset) -> Figure:
    """Plot the error of the worst output over frequency, one panel for each method and one line for each mode."""
    check_kind(data, "reduction")
    names, modes = names_of(data, "reduction"), names_of(data, "mode")
    figure, axes = panels(len(names), 1) if is_narrow() else panels(1, len(names))
    for panel, name in zip(axes.flat, names, strict=True):
        for k, mode in enumerate(modes):
            worst = data["error"].sel(mode=mode, reduction=name).max("output").values
            panel.plot(data["frequency"].values, np.maximum(worst, 1e-16), label=f"mode {plain(mode)}",
                       color=COLOURS[k % len(COLOURS)], linestyle=DASHES[(k // len(COLOURS)) % len(DASHES)]
                       )  # fmt: skip
        panel.axhline(float(data.attrs["accuracy"]), color="0.6", linewidth=0.6)
        panel.set_title(f"{name}, {data.attrs['kept_states']} states")
        panel.set_ylabel("largest error over gain")
        panel.set_yscale("log")
        mark_powers(panel)
        _over_frequency(panel, data)
    return lay_out(figure, axes, panel_height=62.0)


@drawn
def held_frequency_by_states(data: xr.Dataset, mode: str | None = None) -> Figure:
    """Plot the lowest frequency of a mode with its motors held over the number of states, for every method.

    A line marks the frequency of the full model.
    """
    check_kind(data, "reduction")
    run = one_run(data, mode)
    figure, axes = panels(1, 1)
    panel = axes[0, 0]
    for k, name in enumerate(names_of(data, "reduction")):
        values = run["held_frequency"].sel(reduction=name).values
        if np.isfinite(values).any():
            panel.plot(data["kept"].values, values, label=name, marker="o", markersize=3.0,
                       color=COLOURS[k % len(COLOURS)], linestyle=DASHES[k % len(DASHES)])  # fmt: skip
    exact = float(run["natural_frequency"].sel(variant=FULL, holding=HOLDINGS[1], order=1))
    panel.axhline(exact, color=BLACK, linewidth=0.8, label=f"full model, {data.attrs['full_states']} states")
    panel.set_xlabel("states")
    panel.set_ylabel("lowest frequency [Hz]")
    panel.set_title(f"motors of {plain(str(run['mode'].item()))} held")
    panel.set_yscale("log")
    mark_powers(panel)
    return lay_out(figure, axes, panel_height=62.0)


@drawn
def bases_along_path(data: xr.Dataset, mode: str | None = None) -> Figure:
    """Plot errors of responses and frequencies along the path: bases of each pose, of one pose, and interpolated."""
    check_kind(data, "reduction")
    if "along_error" not in data:
        raise InputError("these reduced models are of one pose", field="data", remedy="reduce along a path: --along 21")
    run = one_run(data, mode)
    figure, axes = panels(3, 1) if is_narrow() else panels(1, 3)
    quantities = [("responses", run["along_error"])]
    quantities += [(f"frequencies, motors {name}", run["along_frequency_error"].sel(holding=name)) for name in HOLDINGS]
    looks = _bases_looks(data)
    for panel, (title, values) in zip(axes.flat, quantities, strict=True):
        for (static, basis), look in looks.items():
            line = values.sel(static=static, basis=basis).values
            if np.isfinite(line).any():
                panel.plot(data["place"].values, np.maximum(line, _LEAST), **look)
        panel.set_title(title)
        panel.set_xlabel(AXES[data.attrs["place_unit"]])
        panel.set_ylabel("largest relative error")
        panel.set_yscale("log")
        mark_powers(panel)
    axes.flat[0].axhline(float(data.attrs["accuracy"]), color="0.6", linewidth=0.6)
    return lay_out(figure, axes, panel_height=62.0)


def _bases_looks(data: xr.Dataset) -> dict[tuple[str, str], dict[str, Any]]:
    """Return the looks of the lines of bases: a colour for each, dashed if static shapes are of other poses too."""
    looks: dict[tuple[str, str], dict[str, Any]] = {}
    coloured = [colour for colour in COLOURS if colour != BLACK]
    for k, name in enumerate(names_of(data, "basis")):
        for static in STATIC[: 1 if name == OWN else None]:
            dash = "-" if static == STATIC[0] else "--"
            colour = BLACK if name == OWN else coloured[(k - 1) % len(coloured)]
            looks[static, name] = {"label": basis_name(static, name), "color": colour, "linestyle": dash}
    return looks


def _label(data: xr.Dataset, name: str) -> str:
    states = data.attrs["full_states"] if name == FULL else data.attrs["kept_states"]
    return f"{name}, {states} states"


def _over_frequency(panel: Axes, data: xr.Dataset) -> None:
    panel.set_xscale("log")
    panel.set_xlim(float(data["frequency"][0]), float(data["frequency"][-1]))
    panel.axvline(float(data.attrs["until"]), color="0.6", linewidth=0.6)
    mark_powers(panel, "x")
    panel.set_xlabel("frequency [Hz]")
