"""Work-precision diagram of integration methods: wall time and steps over error."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

from matplotlib.figure import Figure

from paraflex.errors import InputError
from paraflex.plots.given import drawn
from paraflex.plots.labels import axis_label
from paraflex.plots.layout import lay_out, panels
from paraflex.plots.scales import name_powers
from paraflex.plots.style import BLACK, COLOURS, SHADE

# Methods of a family share marker and dashes and differ in colour.
_FAMILIES: Mapping[str, dict[str, Any]] = {
    "esdirk": {"marker": "o", "linestyle": "-"},
    "newmark": {"marker": "s", "linestyle": (0, (5, 1.5))},
    "scipy": {"marker": "^", "linestyle": (0, (5, 1.5, 1, 1.5))},
    "sundials": {"marker": "D", "linestyle": (0, (1, 1))},
}


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
