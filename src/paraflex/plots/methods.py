"""Figures of integration methods: work-precision diagram, and their numerical damping."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import Any

import numpy as np
from matplotlib.figure import Figure
from numpy.typing import NDArray

from paraflex.arguments import checked_arguments
from paraflex.errors import InputError
from paraflex.integrators import METHODS
from paraflex.integrators.spectra import Spectrum, spectrum
from paraflex.plots.given import drawn
from paraflex.plots.labels import axis_label
from paraflex.plots.layout import lay_out, panels
from paraflex.plots.scales import name_powers
from paraflex.plots.style import BLACK, COLOURS, SHADE, ZERO, journal_style

# Methods of a family share marker and dashes and differ in colour.
_FAMILIES: Mapping[str, dict[str, Any]] = {
    "esdirk": {"marker": "o", "linestyle": "-"},
    "newmark": {"marker": "s", "linestyle": (0, (5, 1.5))},
    "scipy": {"marker": "^", "linestyle": (0, (5, 1.5, 1, 1.5))},
    "sundials": {"marker": "D", "linestyle": (0, (1, 1))},
}
# Orders of the multistep methods that are shown; IDA is omitted because its characteristic roots are those of BDF.
_ORDERS = {"adams": (4,), "bdf": (2, 5), "ndf": (2,)}
CURVES: tuple[tuple[str, int | None], ...] = tuple(
    (name, order) for name in METHODS if name != "ida" for order in _ORDERS.get(name, (None,))
)
# Frequencies h omega that a step resolves, and the whole range up to those at which modes need only be damped [rad].
_RESOLVED, _HIGH = np.geomspace(0.1, 3.0, 120), np.geomspace(0.1, 1e4, 240)
# Range of damping ratio and period error shown, and largest spectral radius shown.
_SHOWN, _GROWN = (1e-6, 1.0), 1.5


def method_look(family: str, number: int) -> dict[str, Any]:
    """Return the look of a method by its number in its family."""
    colours = [BLACK, *(colour for colour in COLOURS if colour != BLACK)]
    return {
        "color": colours[number % len(colours)],
        "markersize": 3.0,
        "linewidth": 1.3 if family == "esdirk" and number == 0 else 0.9,
        **_FAMILIES[family],
    }


@drawn
def work_precision(figures: Mapping[str, Any]) -> Figure:
    """Plot wall time and accepted steps of every method over its error, on logarithmic axes.

    Runs with fixed steps and runs with error control form separate lines; the former have open marks. Errors below the
    uncertainty of the reference are shaded.
    """
    lines = _lines(figures["methods"])
    if not lines:
        raise InputError("no run reached its end", field="figures", remedy="see the reasons in `methods`")
    figure, axes = panels(1, 2)
    for panel, key, label in zip(
        axes[0], ("wall_time", "steps"), (axis_label("wall_time"), "accepted steps"), strict=True
    ):
        for title, look, runs in lines:
            panel.plot([run["error"] for run in runs], [run[key] for run in runs], label=title, **look)
        panel.set_xscale("log")
        panel.set_yscale("log")
        panel.margins(0.06)
        panel.grid(color="0.9", linewidth=0.4)
        name_powers(panel.xaxis)
        name_powers(panel.yaxis)
        uncertainty = figures["reference"]["uncertainty"]
        low, high = panel.get_xlim()
        if low < uncertainty < high:
            panel.axvspan(low, uncertainty, color=SHADE, linewidth=0.0, zorder=0.0, label="below the reference's own")
        panel.set_xlim(low, high)
        panel.set_xlabel("largest error of position [m]")
        panel.set_ylabel(label)
    return lay_out(figure, axes, panel_height=72.0)


def _lines(methods: Mapping[str, Any]) -> list[tuple[str, dict[str, Any], list[dict[str, Any]]]]:
    """Return title, look and complete runs of each line, by decreasing error and without runs of zero error."""
    members: dict[str, int] = {}
    lines = []
    for method in methods.values():
        number = members[method["family"]] = members.get(method["family"], -1) + 1
        done = [run for run in method["runs"] if run["status"] == "complete" and run["error"] > 0.0]
        for fixed in (False, True):
            runs = [run for run in done if (run["step"] is not None) == fixed]
            look = method_look(method["family"], number) | ({"markerfacecolor": "white"} if fixed else {})
            title = f"{method['title']}, fixed steps" if fixed else method["title"]
            if runs:
                lines.append((title, look, sorted(runs, key=lambda run: -run["error"])))
    return lines


@journal_style()
@checked_arguments(curves='give pairs of a method and an order or None, such as [("bdf", 2)]')
def numerical_damping(curves: Sequence[tuple[str, int | None]] = CURVES) -> Figure:
    """Plot damping ratio, period error and spectral radius over h omega, for x'' = -omega^2 x and steps of size h.

    Damping ratio and period error are shown where the method is stable and their magnitude is not negligible.

    Parameters
    ----------
    curves : sequence of (str, int or None)
        Names of methods, each with an order if the method has several; by default all methods but IDA.
    """
    figure, axes = panels(1, 3)
    members: dict[str, int] = {}
    for name, order in curves:
        method = METHODS[name]
        number = members[method.family.value] = members.get(method.family.value, -1) + 1
        look: dict[str, Any] = method_look(method.family.value, number) | {"marker": ""}
        label = method.title if not method.multistep else f"{method.title.split(' ')[0]} {order}"
        low, high = (spectrum(name, frequency, order=order) for frequency in (_RESOLVED, _HIGH))
        axes[0, 0].plot(low.frequency, _shown(low, low.damping_ratio), label=label, **look)
        axes[0, 1].plot(low.frequency, _shown(low, np.abs(low.period_error)), label=label, **look)
        axes[0, 2].plot(high.frequency, np.where(high.radius < _GROWN, high.radius, np.nan), label=label, **look)
    titles = ("damping ratio", "period error, as a fraction", "spectral radius")
    for panel, title in zip(axes[0], titles, strict=True):
        panel.set_title(title)
        panel.set_xlabel(r"$h\,\omega$ [rad]")
        panel.set_xscale("log")
        name_powers(panel.xaxis)
    for panel in axes[0, :2]:
        panel.set_yscale("log")
        panel.set_ylim(*_SHOWN)
        panel.grid(color="0.9", linewidth=0.4)
        name_powers(panel.yaxis)
    axes[0, 2].set_ylim(0.0, _GROWN)
    axes[0, 2].axhline(1.0, **ZERO)
    return lay_out(figure, axes, panel_height=62.0)


def _shown(found: Spectrum, values: NDArray[np.float64]) -> NDArray[np.float64]:
    """Return values with NaN where the method is unstable or the value is too small for the logarithmic axis."""
    return np.where((found.radius < 1.0 + 1e-9) & (values > 0.1 * _SHOWN[0]), values, np.nan)
