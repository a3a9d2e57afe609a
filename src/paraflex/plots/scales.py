"""Scales of axes: logarithmic axes numbered by powers of ten, and axes that list names.

Numbers are plain text because the layout computes their width from that of the digits.
"""

from __future__ import annotations

from collections.abc import Sequence
from typing import Literal

from matplotlib.axes import Axes
from matplotlib.ticker import FuncFormatter, LogLocator, NullFormatter

from paraflex.formatting import logarithmic_number
from paraflex.plots.labels import plain

# Height of a line in a list of names [mm].
LIST_LINE = 5.5


def mark_powers(panel: Axes, direction: Literal["x", "y"] = "y", *, wide: float = 200.0) -> None:
    """Make an axis logarithmic with numbers at powers of ten; also at 2 and 5 times these up to a data ratio `wide`."""
    axis = panel.yaxis if direction == "y" else panel.xaxis
    (panel.set_yscale if direction == "y" else panel.set_xscale)("log")
    low, high = axis.get_minpos(), axis.get_data_interval()[1]
    several = high > wide * low
    axis.set_major_locator(LogLocator(numticks=12) if several else LogLocator(subs=(1.0, 2.0, 5.0)))
    axis.set_major_formatter(FuncFormatter(lambda value, _: logarithmic_number(value)))
    axis.set_minor_formatter(NullFormatter())


def list_lines(panel: Axes, names: Sequence[str]) -> None:
    """Label the lines of a panel with names, from the top down."""
    panel.set_yticks(range(len(names)), [plain(name) for name in names])
    panel.set_ylim(len(names) - 0.4, -0.6)
