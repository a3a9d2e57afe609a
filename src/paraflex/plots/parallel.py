"""Parallel coordinates of many designs."""

from collections.abc import Sequence

import matplotlib
import numpy as np
from matplotlib.axes import Axes
from matplotlib.collections import LineCollection
from matplotlib.colors import ListedColormap
from matplotlib.figure import Figure

from paraflex.arrays import Array
from paraflex.figures.designs import DesignTable, column_label
from paraflex.formatting import number, typeset
from .given import drawn
from .labels import mathematics, plain
from .layout import is_narrow, lay_out, panels
from .style import VERMILLION

# Number of metrics by default, largest numbers of axes and of lines, and height of an axis [mm].
_METRICS, _AXES, _LINES, _AXIS_HEIGHT = 3, 10, 2000, 10.0
_LIGHTEST = 0.85  # End of the used part of the colour map: its light end is too light on paper.


@drawn
def parallel_coordinates(table: DesignTable, metrics: Sequence[str] | None = None) -> Figure:
    """Plot every design as a line across parallel axes of parameters and metrics, coloured by the first metric.

    The axes lie one below the other, each from the smallest to the largest value. The design with the smallest first
    metric is a thick line. Only complete runs of the first path and mode are shown, at most 2,000, evenly chosen.

    Parameters
    ----------
    metrics : sequence of str, optional
        Metrics to show; by default the first three that vary.
    """
    chosen = table.judged_by(metrics, _METRICS)
    pair, runs = next(iter(table.series.items()))
    parameters = runs.varied[: max(1, _AXES - len(chosen))]
    labelled = {name: table.labelled(name) for name in (*parameters, *chosen)}
    values = np.column_stack([factor * runs.column(name) for name, (_, factor) in labelled.items()])
    values = values[np.isfinite(values).all(axis=1)]
    low, high = values.min(axis=0), values.max(axis=0)
    places = (values - low) / np.where(high > low, high - low, 1.0)
    labels = [mathematics(label) for label, _ in labelled.values()]
    figure, axes = panels(1, 1)
    _draw_designs(axes[0, 0], places, places[:, len(parameters)], mathematics(column_label(chosen[0])))
    _draw_axes(axes[0, 0], labels, low, high)
    # The title is centred: above the names there is no room for it in one column.
    axes[0, 0].set_title(
        ", ".join(filter(None, [f"{len(values)} designs", "" if is_narrow() else plain(pair[0]), plain(pair[1])]))
    )
    return lay_out(figure, axes, panel_height=_AXIS_HEIGHT * len(labels))


def _draw_designs(panel: Axes, places: Array, judged: Array, judge: str) -> None:
    """Draw one line per design; the one with the smallest judging metric is drawn last and thick."""
    order = np.argsort(-judged, kind="stable")
    shown = order[np.unique(np.linspace(0, order.size - 1, min(order.size, _LINES)).astype(int))]
    rows = np.arange(places.shape[1])
    # The colour map runs from dark to light, in grey as well.
    colours = ListedColormap(matplotlib.colormaps["viridis"](np.linspace(0.0, _LIGHTEST, 256)))
    lines = [np.column_stack([places[k], rows]) for k in shown]
    width = 0.7 if len(lines) < 200 else 0.35
    panel.add_collection(LineCollection(lines, colors=colours(judged[shown]), linewidths=width, alpha=0.8))
    for share, word in ((0.0, "small"), (1.0, "large")):
        panel.plot([], [], color=colours(share), label=f"{word} {judge}")
    panel.plot(places[order[-1]], rows, color=VERMILLION, linewidth=1.6, marker="o", markersize=3.0, label="the least")


def _draw_axes(panel: Axes, labels: list[str], low: Array, high: Array) -> None:
    for row, (least, most) in enumerate(zip(low, high, strict=True)):
        panel.axhline(row, color="0.3", linewidth=0.6, zorder=0.5)
        for place, value, side in ((0.0, least, "left"), (1.0, most, "right")):
            panel.text(
                place, row - 0.08, typeset(number(value, 3, padded=True)), ha=side, va="bottom", fontsize=7.0,
                bbox={"facecolor": "white", "edgecolor": "none", "alpha": 0.75, "pad": 0.5},
            )  # fmt: skip
    panel.set_yticks(range(len(labels)), labels)
    panel.tick_params(length=0.0)
    panel.set_xticks([])
    panel.set_ylim(len(labels) - 0.75, -0.5)
    panel.set_xlim(-0.02, 1.02)
    panel.set_frame_on(False)
