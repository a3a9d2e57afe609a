"""The look of every figure: print sizes, lines that stay apart in black and white, and layout."""

from __future__ import annotations

import math
from collections.abc import Iterator
from contextlib import contextmanager
from typing import Any

import matplotlib.style
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from numpy.typing import NDArray

ONE_COLUMN, TWO_COLUMNS = 90.0, 180.0  # Widths of a journal's columns [mm].
MM = 1.0 / 25.4  # [inch]

# Okabe and Ito (2008), Color Universal Design; their yellow is left out, it is too light for a thin line.
BLACK, BLUE, VERMILLION, GREEN = "#000000", "#0072B2", "#D55E00", "#009E73"
COLOURS = (BLUE, VERMILLION, GREEN, "#CC79A7", BLACK, "#E69F00", "#56B4E9")
DASHES: tuple[Any, ...] = ("-", (0, (5, 1.5)), (0, (5, 1.5, 1, 1.5)), (0, (1, 1)), (0, (9, 2)))
SHADE = "0.92"
ZERO: dict[str, Any] = {"color": "0.7", "linewidth": 0.5, "zorder": 0.5}

# Fonts that come with Matplotlib, so that a figure is the same on every machine.
STYLE: dict[str, Any] = {
    "font.family": "DejaVu Sans",
    "font.size": 7.0,
    "mathtext.fontset": "dejavusans",
    "axes.titlesize": 7.0,
    "axes.titlepad": 3.0,
    "axes.titley": 1.0,  # Nothing stands above a panel; looking for it takes time.
    "axes.labelsize": 7.0,
    "axes.labelpad": 2.0,
    "axes.linewidth": 0.6,
    "axes.axisbelow": True,
    "axes.xmargin": 0.0,
    "axes.ymargin": 0.06,
    "axes.formatter.useoffset": False,
    "axes.formatter.use_mathtext": False,  # Parsing each number as mathematics would take most of the time.
    "axes.formatter.limits": (-4, 6),
    "xtick.labelsize": 6.5,
    "ytick.labelsize": 6.5,
    "xtick.direction": "in",
    "ytick.direction": "in",
    "xtick.major.size": 2.5,
    "ytick.major.size": 2.5,
    "xtick.major.width": 0.5,
    "ytick.major.width": 0.5,
    "lines.linewidth": 0.9,
    "lines.dash_capstyle": "butt",
    "lines.scale_dashes": True,
    "legend.frameon": False,
    "legend.fontsize": 7.0,
    "legend.handlelength": 2.8,
    "legend.columnspacing": 1.6,
    "legend.borderaxespad": 0.2,
    "legend.borderpad": 0.1,
    "figure.constrained_layout.w_pad": 2.0 / 72.0,
    "figure.constrained_layout.h_pad": 2.0 / 72.0,
    "figure.constrained_layout.wspace": 0.02,
    "figure.constrained_layout.hspace": 0.02,
    "figure.dpi": 200.0,
    "savefig.dpi": "figure",  # The layout and the PNG then measure the same texts once.
    "svg.hashsalt": "paraflex",
    "svg.fonttype": "path",
}


@contextmanager
def journal_style() -> Iterator[None]:
    """Draw in this style, from Matplotlib's own defaults: nothing of the user's settings comes in or is changed."""
    with matplotlib.style.context(STYLE, after_reset=True):
        yield


def panels(rows: int, columns: int, *, height: float, width: float = TWO_COLUMNS) -> tuple[Figure, NDArray[Any]]:
    """A figure of `width` times `height` [mm] and its axes (rows, columns), which share their time axis or none."""
    figure = Figure(figsize=(width * MM, height * MM), layout="constrained")
    return figure, figure.subplots(rows, columns, squeeze=False)


def label_outer_time(axes: NDArray[Any]) -> None:
    """Name the time axis below the lowest panel of each column and take its numbers off the others."""
    for column in axes.T:
        shown = [panel for panel in column if panel.get_visible()]
        for panel in shown[:-1]:
            panel.tick_params(labelbottom=False)
        shown[-1].set_xlabel("time $t$ [s]")


def keep_flat(axes: Axes, scale: float) -> None:
    """Show what varies by less than a millionth of `scale` as a flat line, not as its rounding errors."""
    low, high = axes.dataLim.intervaly
    if not high - low > 1e-6 * scale:  # also true of axes without data
        middle = 0.5 * (low + high) if abs(low) < float("inf") else 0.0
        half = 0.05 * scale or 1.0
        axes.set_ylim(middle - half, middle + half)


def shared_legend(figure: Figure) -> None:
    """One legend above all panels, each entry once, in the order of drawing."""
    entries: dict[str, Any] = {}
    for axes in figure.axes:
        for handle, label in zip(*axes.get_legend_handles_labels(), strict=True):
            entries.setdefault(label, handle)
    for rows in range(1, len(entries) + 1):
        columns = math.ceil(len(entries) / rows)
        legend = figure.legend(list(entries.values()), list(entries), loc="outside upper center", ncols=columns)
        if columns == 1 or legend.get_window_extent().width <= 0.98 * figure.bbox.width:
            break
        legend.remove()


def freeze_layout(figure: Figure) -> Figure:
    """Lay the figure out once and for all: saving it does not do so again, and needs none of these settings."""
    engine = figure.get_layout_engine()
    if engine is not None:
        engine.execute(figure)
    figure.set_layout_engine(None)
    return figure


def fit_height(figure: Figure, axes: Axes) -> None:
    """Give the figure the height at which its one panel, of equal scales, fills its width."""
    (left, right), (bottom, top) = axes.get_xlim(), axes.get_ylim()
    for _ in range(2):  # The width of the tick labels may change once.
        engine = figure.get_layout_engine()
        assert engine is not None
        engine.execute(figure)
        box = axes.get_position(original=True)
        width, height = figure.get_size_inches()
        wanted = box.width * width * (top - bottom) / (right - left)
        figure.set_size_inches(width, height + wanted - box.height * height)
