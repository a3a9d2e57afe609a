"""Places of panels, labels and the legend, in millimetres of print.

Matplotlib's constrained layout measures every text several times, which takes longer than drawing; and it does not
put the axis labels of a column on one line.
"""

from __future__ import annotations

import math
from typing import Any

import numpy as np
from matplotlib.axes import Axes
from matplotlib.axis import Axis
from matplotlib.figure import Figure
from numpy.typing import NDArray

ONE_COLUMN, TWO_COLUMNS = 90.0, 180.0  # Widths of a journal's columns [mm].
MM = 1.0 / 25.4  # [inch]

# Room for the parts round a panel [mm].
_EDGE = 1.0
_LEGEND_LINE = 3.7
_TITLE = 3.8
_BELOW_ROW = 2.2
_NUMBER_PAD = 1.8
_TIME_NUMBERS = 4.0
_AXIS_LABEL = 3.3
_RIGHT = 3.4  # half of a number such as 0.030

# Widths of the letters of numbers [em] in DejaVu Sans, and its size on the axes [mm].
_DIGIT, _LETTERS = 0.636, {".": 0.318, "\N{MINUS SIGN}": 0.838, "+": 0.838}
_EM = 6.5 / 72.0 * 25.4


def panels(rows: int, columns: int, *, width: float = TWO_COLUMNS) -> tuple[Figure, NDArray[Any]]:
    """A figure of a width [mm] and its axes (rows, columns); `lay_out` gives them their places."""
    figure = Figure(figsize=(width * MM, width * MM))
    return figure, figure.subplots(rows, columns, squeeze=False)


def label_outer_time(axes: NDArray[Any]) -> None:
    """Name the time axis below the lowest panel of each column and take its numbers off the others."""
    for column in axes.T:
        shown = [panel for panel in column if panel.get_visible()]
        for panel in shown[:-1]:
            panel.tick_params(labelbottom=False)
        shown[-1].set_xlabel("time $t$ [s]")


def lay_out(figure: Figure, axes: NDArray[Any], *, panel_height: float) -> Figure:
    """Put legend, panels and axis labels in their places and give the figure the height they need.

    Parameters
    ----------
    figure : matplotlib.figure.Figure
        Completely drawn.
    axes : array of matplotlib.axes.Axes (rows, columns)
        Its panels.
    panel_height : float
        [mm]
    """
    tops, height = _rows(axes, panel_height, _shared_legend(figure))
    width = figure.get_figwidth() / MM
    figure.set_size_inches(width * MM, height * MM)
    for panel in axes.flat:  # The numbers on an axis depend on its length.
        panel.set_position((0.1, 0.0, 0.8, panel_height / height))
    lefts, numbers, panel_width = _columns(axes, width)
    for row, top in zip(axes, tops, strict=True):
        for panel, left, room in zip(row, lefts, numbers, strict=True):
            bottom = height - top - panel_height
            panel.set_position((left / width, bottom / height, panel_width / width, panel_height / height))
            _place_labels(panel, room / panel_width, _TIME_NUMBERS / panel_height)
    return figure


def equal_scales_height(figure: Figure, panel: Axes) -> float:
    """Height [mm] at which the one panel of a figure has equal scales on both axes and fills its width."""
    (left, right), (bottom, top) = panel.get_xlim(), panel.get_ylim()
    _, _, width = _columns(np.array([[panel]]), figure.get_figwidth() / MM)
    return width * (top - bottom) / (right - left)


def _rows(axes: NDArray[Any], panel_height: float, legend_lines: int) -> tuple[list[float], float]:
    """Tops of the rows of panels below the figure's top edge, and the figure's height [mm]."""
    tops = []
    y = _EDGE + (legend_lines * _LEGEND_LINE + _EDGE if legend_lines else 0.0)
    for row in axes:
        y += _TITLE if any(panel.get_title(loc=loc) for panel in row for loc in ("left", "center")) else 0.0
        tops.append(y)
        y += panel_height
        y += _TIME_NUMBERS + _AXIS_LABEL if any(panel.get_xlabel() for panel in row) else _BELOW_ROW
    return tops, y + _EDGE


def _columns(axes: NDArray[Any], width: float) -> tuple[list[float], list[float], float]:
    """Left edges of the columns of panels, room for the numbers left of each, and width of a panel [mm]."""
    numbers = [_NUMBER_PAD + max(_number_width(panel.yaxis) for panel in column) for column in axes.T]
    margins = [
        _EDGE + room + (_AXIS_LABEL if any(panel.get_ylabel() for panel in column) else 0.0)
        for column, room in zip(axes.T, numbers, strict=True)
    ]
    panel_width = width / len(margins) - _RIGHT - sum(margins) / len(margins)
    lefts = [sum(margins[: k + 1]) + k * (panel_width + _RIGHT) for k in range(len(margins))]
    return lefts, numbers, panel_width


def _place_labels(panel: Axes, left: float, below: float) -> None:
    """Put axis labels at these distances, as shares of the panel, and make the ticks while the style is in force."""
    panel.yaxis.set_label_coords(-left, 0.5)
    panel.xaxis.set_label_coords(0.5, -below)
    panel.xaxis.get_major_ticks()
    panel.yaxis.get_major_ticks()


def _number_width(axis: Axis) -> float:
    """Width of the widest number on an axis [mm]."""
    low, high = sorted(axis.get_view_interval())
    places = axis.get_majorticklocs()
    texts = axis.get_major_formatter().format_ticks(places.tolist())
    shown = [text for text, place in zip(texts, places, strict=True) if low <= place <= high]
    return _EM * max((sum(_LETTERS.get(letter, _DIGIT) for letter in text) for text in shown), default=0.0)


def _shared_legend(figure: Figure) -> int:
    """One legend above all panels, each entry once, in the order of drawing; how many lines it takes."""
    entries: dict[str, Any] = {}
    for axes in figure.axes:
        for handle, label in zip(*axes.get_legend_handles_labels(), strict=True):
            entries.setdefault(label, handle)
    for lines in range(1, len(entries) + 1):
        columns = math.ceil(len(entries) / lines)
        legend = figure.legend(
            list(entries.values()), list(entries), loc="upper center", ncols=columns, bbox_to_anchor=(0.5, 1.0)
        )
        if columns == 1 or legend.get_window_extent().width <= 0.98 * figure.bbox.width:
            return math.ceil(len(entries) / columns)
        legend.remove()
    return 0
