"""Layout of panels, labels and the legend, in millimetres of print.

Matplotlib's constrained layout measures every text several times, which takes longer than drawing, and it does not
align the axis labels of a column.
"""

import math
import re
from collections.abc import Iterator, Mapping, Sequence
from contextlib import contextmanager
from contextvars import ContextVar
from typing import Any, Literal

import numpy as np
from matplotlib.axes import Axes
from matplotlib.axis import Axis
from matplotlib.figure import Figure

from paraflex.arrays import NDArray
from paraflex.contexts import holding
from paraflex.figures.charts import TIME
from paraflex.formatting import ROUNDING
from paraflex.mechanism.quantities import known
from .labels import mathematics
from .style import STYLE, points

ONE_COLUMN, TWO_COLUMNS = 84.0, 174.0  # Widths of a journal's columns [mm].
COLUMNS = {"single": ONE_COLUMN, "double": TWO_COLUMNS}
MM = 1.0 / 25.4  # [inch]
# Largest height of a figure, that of a page's text, and smallest height of a readable panel, which has priority [mm].
_PAGE, _LOWEST = 225.0, 9.0

# Margin around a plane as a share of its size, smallest and largest ratio of a panel's height to its width, and the
# largest for a figure of two columns.
_MARGIN, _FLATTEST, _TALLEST, _TALLEST_WIDE = 0.06, 0.3, 1.3, 0.75
# Extent of a plane below which it is that of a point, as a share of the distance from the origin.
_AT_REST = 1e-9
# Room for the parts around a panel [mm]; that of text is for the sizes of the common style.
_EDGE = 1.0
_LEGEND_LINE = 4.2
_TITLE = 4.4
_BELOW_ROW = 2.4
_NUMBER_PAD = 1.8
_TIME_NUMBERS = 4.3
_AXIS_LABEL = 3.8
_RIGHT = 3.6  # half of a number such as 0.030

# Widths of the characters of numbers in DejaVu Sans [em], and font size on the axes [mm].
_DIGIT, _LETTERS = 0.636, {".": 0.318, "\N{MINUS SIGN}": 0.838, "+": 0.838}
# Width of a letter of a title [em], and the excess by which a centred title may be wider than its panel [mm].
_LETTER = 0.6
_OVERHANG = 4.0

_width: ContextVar[float | None] = ContextVar("_width", default=None)


@contextmanager
def column_width(style: str | None) -> Iterator[None]:
    """Set the width of figures to one ("single") or two ("double") journal columns; None keeps their own width."""
    if style is not None:
        known(style, COLUMNS, "style", "style")
    with holding(_width, None if style is None else COLUMNS[style]):
        yield


def page_width(width: float) -> float:
    """Return the width set by `column_width`, else the given one [mm]."""
    return _width.get() or width


def figure_width(panel: Axes) -> float:
    """Return the width of a panel's figure [mm]."""
    figure = panel.figure
    assert isinstance(figure, Figure)
    return figure.get_figwidth() / MM


def is_narrow(width: float = TWO_COLUMNS) -> bool:
    """Return whether the panels of a figure of this width [mm] must be arranged in one column."""
    return page_width(width) < 0.75 * TWO_COLUMNS


def panels(count: int, columns: int, *, width: float = TWO_COLUMNS) -> tuple[Figure, NDArray[Any]]:
    """Create a figure of a width [mm] with `count` panels in rows of `columns`, to be placed by `lay_out`.

    They are the first ones of `axes.flat`; the others are hidden. A width set by `column_width` takes precedence.
    """
    width = page_width(width)
    figure = Figure(figsize=(width * MM, width * MM))
    axes = figure.subplots(-(-count // columns), columns, squeeze=False)
    for panel in axes.flat[count:]:
        panel.set_visible(False)
    return figure, axes


def label_outer_time(axes: NDArray[Any]) -> None:
    """Name the time axis below the lowest panel of each column and remove its name and numbers from the others."""
    for column in arranged(axes).T:
        shown = [panel for panel in column if panel.get_visible()]
        for panel in shown[:-1]:
            panel.tick_params(labelbottom=False)
            panel.set_xlabel("")
        shown[-1].set_xlabel(mathematics(TIME.label(TIME.unit_for(0.0))))


def arranged(axes: NDArray[Any]) -> NDArray[Any]:
    """Return the panels as placed: unchanged, or one below the other if they do not fit side by side."""
    figure = axes[0, 0].figure
    width = figure.get_figwidth() / MM
    if axes.shape[1] == 1 or width > 0.75 * TWO_COLUMNS:
        return axes
    _, _, panel_width = _columns(axes, width)
    if axes.shape[1] == 2 and all(_title_fits(panel, panel_width) for panel in axes.flat):
        return axes
    for row in axes:
        for panel in row[1:]:
            # The label of a row of panels is repeated at each of them.
            panel.set_ylabel(panel.get_ylabel() or row[0].get_ylabel())
    return np.array([[panel] for panel in axes.flat if panel.get_visible()], dtype=object)


def _title_fits(panel: Axes, width: float) -> bool:
    letter = _LETTER * points("axes.titlesize") / 72.0 * 25.4
    lengths = [letter * _letters(panel.get_title(loc=loc)) for loc in ("left", "center", "right")]
    return lengths[1] <= width + _OVERHANG and lengths[0] + lengths[2] <= width - letter


def _room(of: float, setting: str) -> float:
    """Return the room for a text whose room in the common style is `of`, in the size of the user's settings [mm]."""
    return of * points(setting) / STYLE[setting]


def _letters(text: str) -> int:
    """Return the number of printed letters of a text; for mathematics it is an estimate."""
    return len(re.sub(r"\\[a-z]+", "x", text.replace(r"\$", "S")).translate(str.maketrans("", "", "${}_^")))


def lay_out(figure: Figure, axes: NDArray[Any], *, panel_height: float) -> Figure:
    """Place legend, panels and axis labels, set the height of the figure, and return the figure.

    Parameters
    ----------
    figure : matplotlib.figure.Figure
        Figure with completely drawn panels.
    axes : array of matplotlib.axes.Axes (rows, columns)
        Panels of the figure.
    panel_height : float
        Height of a panel [mm]; it is reduced if the figure would be taller than a page.
    """
    axes = arranged(axes)
    for panel in axes.flat:
        low, high = panel.yaxis.get_data_interval()
        if panel.get_autoscaley_on() and panel.get_yscale() == "linear" and max(abs(low), abs(high)) <= ROUNDING:
            panel.set_ylim(-1.04, 1.04)
    width = figure.get_figwidth() / MM
    shared, own = _entries(figure)
    # One legend above all panels, and one above each panel.
    lines = _fitted_legend(figure, shared, 0.98 * figure.bbox.width, loc="upper center")
    room = (_columns(axes, width)[2] + _OVERHANG) * MM * figure.dpi
    panel_lines = {panel: _fitted_legend(panel, entries, room, loc="lower center") for panel, entries in own.items()}
    own_lines = [max((panel_lines.get(panel, 0) for panel in row), default=0) for row in axes]
    _, height = _rows(axes, panel_height, lines, own_lines)
    if height > _PAGE:
        panel_height = max(_LOWEST, panel_height - (height - _PAGE) / axes.shape[0])
    tops, height = _rows(axes, panel_height, lines, own_lines)
    figure.set_size_inches(width * MM, height * MM)
    for panel in axes.flat:  # The numbers on an axis depend on its length.
        panel.set_position((0.1, 0.0, 0.8, panel_height / height))
    lefts, numbers, panel_width = _columns(axes, width)
    for row, top in zip(axes, tops, strict=True):
        for panel, left, room in zip(row, lefts, numbers, strict=True):
            bottom = height - top - panel_height
            panel.set_position((left / width, bottom / height, panel_width / width, panel_height / height))
            panel.yaxis.set_label_coords(-room / panel_width, 0.5)
            panel.xaxis.set_label_coords(0.5, -_room(_TIME_NUMBERS, "xtick.labelsize") / panel_height)
            # Accessing the ticks creates them in the current style.
            panel.xaxis.get_major_ticks()
            panel.yaxis.get_major_ticks()
            if panel_lines.get(panel):
                titled = any(panel.get_title(loc=loc) for loc in ("left", "center"))
                above = 1.0 + (_room(_TITLE, "axes.titlesize") if titled else 0.5) / panel_height
                panel.get_legend().set_bbox_to_anchor((0.5, above), transform=panel.transAxes)
    return figure


def finish_plane(figure: Figure, axes: Axes) -> Figure:
    """Set the limits of the only panel, with a margin and a least size for a line or point, and lay out the figure."""
    box = axes.dataLim
    width, height = ((1.0 + 2.0 * _MARGIN) * extent for extent in (box.width, box.height))
    width = max(width, height / (_TALLEST if is_narrow(ONE_COLUMN) else _TALLEST_WIDE))
    # A point at rest moves by rounding errors.
    width = width if width > _AT_REST * np.max(np.abs(box.get_points())) else 1.0
    height = max(height, _FLATTEST * width)
    middle_x, middle_y = box.x0 + 0.5 * box.width, box.y0 + 0.5 * box.height
    axes.set_xlim(middle_x - 0.5 * width, middle_x + 0.5 * width)
    axes.set_ylim(middle_y - 0.5 * height, middle_y + 0.5 * height)
    # The panel has equal scales on both axes and fills the width of the figure.
    only = np.array([[axes]])
    return lay_out(figure, only, panel_height=_columns(only, figure_width(axes))[2] * height / width)


def _rows(
    axes: NDArray[Any], panel_height: float, legend_lines: int, own_lines: Sequence[int]
) -> tuple[list[float], float]:
    """Return the distances of the rows of panels from the figure's top edge, and the figure's height [mm]."""
    tops = []
    line, title = _room(_LEGEND_LINE, "legend.fontsize"), _room(_TITLE, "axes.titlesize")
    below = _room(_TIME_NUMBERS, "xtick.labelsize") + _room(_AXIS_LABEL, "axes.labelsize")
    y = _EDGE + (legend_lines * line + _EDGE if legend_lines else 0.0)
    for row, lines in zip(axes, own_lines, strict=True):
        y += lines * line + 0.5 * _EDGE if lines else 0.0
        y += title if any(panel.get_title(loc=loc) for panel in row for loc in ("left", "center")) else 0.0
        tops.append(y)
        y += panel_height
        y += below if any(panel.get_xlabel() for panel in row) else _BELOW_ROW
    return tops, y + _EDGE


def _columns(axes: NDArray[Any], width: float) -> tuple[list[float], list[float], float]:
    """Return the left edges of the columns of panels, the room for numbers left of each, and a panel's width [mm]."""
    numbers = [_NUMBER_PAD + max(_number_width(panel.yaxis) for panel in column) for column in axes.T]
    margins = [
        _EDGE + room + (_room(_AXIS_LABEL, "axes.labelsize") if any(panel.get_ylabel() for panel in column) else 0.0)
        for column, room in zip(axes.T, numbers, strict=True)
    ]
    panel_width = width / len(margins) - _RIGHT - sum(margins) / len(margins)
    lefts = [sum(margins[: k + 1]) + k * (panel_width + _RIGHT) for k in range(len(margins))]
    return lefts, numbers, panel_width


def _number_width(axis: Axis) -> float:
    """Return the width of the widest number on an axis [mm]."""
    low, high = sorted(axis.get_view_interval())
    places = axis.get_majorticklocs()
    texts = axis.get_major_formatter().format_ticks(places.tolist())
    shown = [text for text, place in zip(texts, places, strict=True) if low <= place <= high]
    plain = [re.sub(r"\\[a-z]+|[${}]", "", text) for text in shown]
    em = points("ytick.labelsize") / 72.0 * 25.4
    return em * max((sum(_LETTERS.get(letter, _DIGIT) for letter in text) for text in plain), default=0.0)


def _entries(figure: Figure) -> tuple[dict[str, Any], dict[Axes, dict[str, Any]]]:
    """Return the entries of the legend above all panels, and those of single panels, in the order of drawing.

    If one panel has all entries, the common legend holds them all; otherwise it holds those that every panel has, and
    the others stand above their panels.
    """
    entries: dict[Axes, dict[str, Any]] = {}
    for panel in figure.axes:
        own: dict[str, Any] = {}
        for handle, label in zip(*panel.get_legend_handles_labels(), strict=True):
            own.setdefault(label, handle)
        if own:
            entries[panel] = own
    every: dict[str, Any] = {}
    for own in entries.values():
        every |= {label: handle for label, handle in own.items() if label not in every}
    if len(entries) < 2 or any(own.keys() == every.keys() for own in entries.values()):
        return every, {}
    common = {label: handle for label, handle in every.items() if all(label in own for own in entries.values())}
    rest = {panel: {label: own[label] for label in own if label not in common} for panel, own in entries.items()}
    return common, {panel: own for panel, own in rest.items() if own}


def _fitted_legend(
    holder: Figure | Axes, entries: Mapping[str, Any], room: float, loc: Literal["upper center", "lower center"]
) -> int:
    """Add a legend at the middle of the upper edge, with as few lines as fit a width [pixels]; return their number."""
    for lines in range(1, len(entries) + 1):
        columns = math.ceil(len(entries) / lines)
        legend = holder.legend(list(entries.values()), list(entries), ncols=columns, bbox_to_anchor=(0.5, 1.0), loc=loc)
        if columns == 1 or legend.get_window_extent().width <= room:
            return math.ceil(len(entries) / columns)
        legend.remove()
    return 0
