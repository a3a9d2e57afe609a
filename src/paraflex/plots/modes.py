"""Figures of all actuation modes side by side over time: motor torques and tracking errors (Figs. 12, 18)."""

from __future__ import annotations

import math
from typing import Any

import numpy as np
import xarray as xr
from matplotlib.figure import Figure
from numpy.typing import NDArray

from paraflex.figures.selection import names_of, samples, select_run
from paraflex.formatting import ROUNDING, display_unit, peak
from paraflex.plots.given import drawn
from paraflex.plots.labels import axis_label, effort_label, plain, symbol, three_digits
from paraflex.plots.layout import ONE_COLUMN, TWO_COLUMNS, is_narrow, panel_grid
from paraflex.plots.runs import draw_actual, finish_over_time
from paraflex.plots.style import BLUE, VERMILLION, ZERO, keep_flat, look_of
from paraflex.results.following import headline, ranked_by_motion

# Letters of a mode's name and its passive motors that fit above a panel.
_TITLE_LETTERS = 22


@drawn
def motor_torques(data: xr.Dataset) -> Figure:
    """Plot the torque of every motor over time, one panel per mode; the panels of a row share their scale (Fig. 12).

    A motor whose torque is zero throughout is omitted from the panel and listed as passive above it.
    """
    names = names_of(data, "mode")
    figure, axes = _mode_panels(len(names))
    time, motors, largest = data["time"].values, data["motor"].values, peak(data["torque"])
    for row in range(axes.shape[0]):
        shown = names[row * axes.shape[1] :][: axes.shape[1]]
        scale = max(peak(select_run(data, name)["torque"]) for name in shown)
        for panel, name in zip(axes[row], shown, strict=False):
            run = select_run(data, name)
            passive = []
            for k, motor in enumerate(motors):
                torque = run["torque"].sel(motor=motor).values
                if peak(torque) <= max(1e-9 * largest, ROUNDING):
                    passive.append(str(motor))
                    torque = np.full_like(torque, np.nan)  # Keeps its place in the legend.
                panel.plot(time, torque, label=symbol(str(motor)), **look_of(k))
            panel.axhline(0.0, **ZERO)
            half = 1.08 * scale if scale > max(1e-9 * largest, ROUNDING) else 1.0
            panel.set_ylim(-half, half)
            panel.set_title(plain(name), loc="left")
            if passive:
                short = len(name) + len(", ".join(passive)) <= _TITLE_LETTERS
                listed = ", ".join(map(symbol, passive)) if short else f"{len(passive)} motors"
                panel.set_title(f"passive: {listed}", loc="right")
        axes[row, 0].set_ylabel(effort_label(data["torque"].attrs.get("units", "N m")))
    return finish_over_time(figure, axes, data, panel_height=38.0)


@drawn
def tracking_errors(data: xr.Dataset) -> Figure:
    """Plot the tracking error of the end-effector in x and y, actual minus desired, one panel per mode (Fig. 18)."""
    names = names_of(data, "mode")
    figure, axes = _mode_panels(len(names))
    time = data["time"].values
    looks = ({"color": BLUE, "linestyle": "-"}, {"color": VERMILLION, "linestyle": (0, (4, 1.2))})
    for panel, name in zip(axes.flat, names, strict=False):
        run = select_run(data, name)
        errors = (run["end_effector"] - run["end_effector_desired"]).values
        unit = display_unit("m", errors)
        for k, (axis, look) in enumerate(zip(data["axis"].values, looks, strict=True)):
            draw_actual(panel, run, time, unit.factor * errors[:, k], label=f"error in ${axis}$", **look)
        panel.axhline(0.0, **ZERO)
        keep_flat(panel, unit.factor * peak(errors))
        panel.set_title(f"{plain(name)}: {_outcome(run)}")
        panel.set_ylabel(axis_label("error", unit=unit.name))
    return finish_over_time(figure, axes, data, panel_height=38.0)


def _outcome(run: xr.Dataset) -> str:
    """Return the RMS tracking error of a run, or the time at which it stopped, in words."""
    rms = float(headline(run)[0])
    if math.isfinite(rms):
        unit = display_unit("m", rms)
        span = "in the motion" if ranked_by_motion(run) else "over all"
        return f"RMS {three_digits(unit.factor * rms)} {unit.name} {span}"
    reached = samples(run)
    return f"stopped at {run['time'].values[reached - 1]:.3g} s" if reached else "no samples"


def _mode_panels(count: int) -> tuple[Figure, NDArray[Any]]:
    """Create a panel for each mode, at most three side by side; unused panels are hidden."""
    columns = 2 if count == 4 or (is_narrow() and count > 1) else min(count, 3)
    return panel_grid(count, columns, width=ONE_COLUMN if columns == 1 else TWO_COLUMNS)
