"""Figures of searches: convergence, targets of an identification, and Sobol indices."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure

from paraflex.errors import InputError
from paraflex.plots.given import drawn
from paraflex.plots.labels import metric_name, plain
from paraflex.plots.layout import ONE_COLUMN, TWO_COLUMNS, lay_out, panel_grid, panels
from paraflex.plots.scales import LIST_LINE, list_lines
from paraflex.plots.style import BLUE, VERMILLION, ZERO

_FAINT = "0.6"
# Height of a panel [mm].
_PANEL = 50.0
# Designs far above the best are drawn at the upper edge; otherwise they would hide the convergence.
_HIGHEST = 3.0


@drawn
def convergence(figures: Mapping[str, Any]) -> Figure:
    """Plot the objective, or the root mean square residual, of every design, and the smallest value so far.

    Designs that fail to run are marked below the others; designs that exceed a limit are crosses.
    """
    history = [(number + 1, value, held) for number, value, held in figures["history"]]
    ran = [each for each in history if each[1] is not None]
    if not ran:
        raise InputError("no design ran", field="figures", remedy="see the reasons in them")
    figure, axes = panels(1, 1, width=ONE_COLUMN)
    panel = axes[0, 0]
    first = next((value for _, value, held in ran if held), ran[0][1])
    low = min(value for _, value, _ in ran)
    top = first + (_HIGHEST - 1.0) * max(first - low, 0.1 * abs(first))
    for held, marker, label in ((True, "o", "designs"), (False, "x", "passing a limit")):
        points = [(number, min(value, top)) for number, value, each in ran if each == held]
        if points:
            panel.plot(*np.transpose(points), marker, color=_FAINT, markersize=2.2, markeredgewidth=0.6, label=label)
    _draw_best(panel, ran, len(history))
    failed = [number for number, value, _ in history if value is None]
    low, high = panel.get_ylim()
    if failed:
        low -= 0.08 * (high - low)
        panel.plot(failed, np.full(len(failed), low), "|", color=VERMILLION, markersize=4.0, label="not running")
    panel.set_ylim(low - 0.02 * (high - low), high)
    panel.set_xlim(0.0, len(history) + 1.0)
    panel.set_xlabel("design")
    panel.set_ylabel("objective" if figures["kind"] == "optimisation" else "root mean square residual")
    return lay_out(figure, axes, panel_height=_PANEL)


@drawn
def targets_reached(figures: Mapping[str, Any]) -> Figure:
    """Plot the ratio of reached to target value for every non-zero target, at the start and at the best design."""
    targets = [each for each in figures["targets"] if each["value"] != 0.0]
    if not targets:
        raise InputError("no targets to compare with", field="figures", remedy="give figures of an identification")
    figure, axes = panels(1, 1, width=ONE_COLUMN)
    panel = axes[0, 0]
    lines = np.arange(len(targets))
    for key, marker, colour, label in (("start", "o", _FAINT, "start"), ("reached", "D", BLUE, "best")):
        ratios = [each[key] / each["value"] for each in targets]
        panel.plot(ratios, lines, marker, color=colour, markersize=3.5, label=label)
    panel.axvline(1.0, color=VERMILLION, linewidth=0.7, zorder=0.7, label="target")
    for line in lines:
        panel.axhline(line, **ZERO)
    list_lines(panel, [_target_name(each, targets) for each in targets])
    panel.margins(x=0.08)
    panel.set_xlabel("reached / target")
    return lay_out(figure, axes, panel_height=LIST_LINE * len(targets) + 2.0)


@drawn
def sobol_bars(figures: Mapping[str, Any]) -> Figure:
    """Plot first-order and total Sobol indices of every parameter with 95 % intervals, per metric, path and mode."""
    panels_of: dict[tuple[str, str, str], list[Mapping[str, Any]]] = {}
    for row in figures["indices"]:
        if row["first"] is not None:
            panels_of.setdefault((row["metric"], row["path"], row["mode"]), []).append(row)
    if not panels_of:
        raise InputError("no metric varies", field="figures", remedy="widen the ranges, or choose another metric")
    columns = min(len(panels_of), 2)
    figure, axes = panel_grid(len(panels_of), columns, width=ONE_COLUMN if columns == 1 else TWO_COLUMNS)
    several = len({path for _, path, _ in panels_of}) > 1
    for panel, ((metric, path, mode), parameters) in zip(axes.flat, panels_of.items(), strict=False):
        _draw_bars(panel, parameters)
        names = [metric_name(metric), path if several else "", plain(mode)]
        panel.set_title(", ".join(filter(None, names)), loc="left")
    for panel in axes.flat:
        panel.set_xlabel("share of the variance" if panel.get_visible() else "")
    most = max(len(parameters) for parameters in panels_of.values())
    return lay_out(figure, axes, panel_height=1.6 * LIST_LINE * most + 2.0)


def _draw_best(panel: Axes, ran: list, last: int) -> None:
    """Draw the smallest value so far among the designs within all limits, as a step line."""
    numbers, least = [], []
    for number, value, held in ran:
        if held and (not least or value < least[-1]):
            numbers.append(number)
            least.append(value)
    if least:
        panel.step([*numbers, last], [*least, least[-1]], where="post", color=BLUE, label="least until then")


def _draw_bars(panel: Axes, rows: list[Mapping[str, Any]]) -> None:
    lines = np.arange(len(rows))
    for shift, key, colour, label in ((-0.19, "first", BLUE, "first order"), (0.19, "total", VERMILLION, "total")):
        values = [row[key] for row in rows]
        panel.barh(lines + shift, values, height=0.34, color=colour, label=label, linewidth=0.0)
        panel.errorbar(
            values, lines + shift, xerr=[row[f"{key}_confidence"] for row in rows], fmt="none", ecolor="black",
            elinewidth=0.6, capsize=1.5, capthick=0.6,
        )  # fmt: skip
    panel.axvline(0.0, **ZERO)
    list_lines(panel, [row["parameter"] for row in rows])
    panel.margins(x=0.05)


def _target_name(target: Mapping[str, Any], targets: list) -> str:
    """Return a distinctive name of a target: its mode, and its metric and path if these differ among targets."""
    differing = [key for key in ("metric", "path") if len({each[key] for each in targets}) > 1]
    names = [metric_name(target[key]) if key == "metric" else target[key] for key in differing]
    return " ".join(filter(None, [plain(target["mode"]), *names])) or metric_name(target["metric"])
