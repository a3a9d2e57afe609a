"""Logarithmic axes whose numbers are plain text: the layout knows how wide digits are."""

from __future__ import annotations

from typing import Literal

from matplotlib.axes import Axes
from matplotlib.ticker import FuncFormatter, LogLocator, NullFormatter

from paraflex.plots.labels import power_of_ten


def mark_powers(panel: Axes, direction: Literal["x", "y"] = "y") -> None:
    """Make an axis logarithmic, with numbers at powers of ten, or also at 2 and 5 where it spans hardly one of them."""
    axis = panel.yaxis if direction == "y" else panel.xaxis
    (panel.set_yscale if direction == "y" else panel.set_xscale)("log")
    low, high = axis.get_data_interval()
    several = high > 10.0 * low
    axis.set_major_locator(LogLocator(numticks=12) if several else LogLocator(subs=(1.0, 2.0, 5.0)))
    axis.set_major_formatter(
        FuncFormatter(lambda value, _: power_of_ten(value) if not 0.01 <= value < 1e4 else f"{value:g}")
    )
    axis.set_minor_formatter(NullFormatter())
