"""Scales of axes: linear, logarithmic with numbers at powers of ten, symmetrical logarithmic, and lists of names.

Numbers are plain text because the layout computes their width from that of the digits.
"""

import math
from collections.abc import Sequence
from typing import Any, Literal

import numpy as np
from matplotlib.axes import Axes
from matplotlib.ticker import FixedLocator, LogLocator, NullFormatter, NullLocator

from paraflex.arrays import Array
from paraflex.figures.charts import Axis, is_logarithmic, symmetrical_numbers
from paraflex.formatting import logarithmic_number
from paraflex.units import DisplayUnit
from .labels import plain

# Height of a line in a list of names [mm].
LIST_LINE = 5.5
# Share by which an axis with marks is longer than its values.
BESIDE = 0.06
# Decades of a vertical logarithmic axis shown below its largest value.
_DECADES = 9.0
# Ratio of data above which only powers of ten are numbered; numbers side by side need more room.
_WIDE = {"x": 40.0, "y": 200.0}
# Difference, in the unit of the axis, below which data are constant up to rounding.
_NOTHING = 1e-9
_ZERO: dict[str, Any] = {"color": "0.7", "linewidth": 0.5, "zorder": 0.5}


def set_scale(
    panel: Axes, direction: Literal["x", "y"], axis: Axis, values: Array, unit: DisplayUnit, *, marked: bool = False
) -> None:
    """Set scale, limits and lines of an axis; if all of its values are `marked`, there is room beside them."""
    own, set_limits = getattr(panel, f"{direction}axis"), getattr(panel, f"set_{direction}lim")
    set_kind = getattr(panel, f"set_{direction}scale")
    if axis.linear_below:
        set_kind("symlog", linthresh=axis.linear_below * unit.factor, linscale=0.5)
        own.set_major_locator(FixedLocator((unit.factor * symmetrical_numbers(axis)).tolist()))
        own.set_major_formatter(_written)
    elif is_logarithmic(axis, values):
        set_kind("log")
        several = own.get_data_interval()[1] > _WIDE[direction] * own.get_minpos()
        own.set_major_locator(LogLocator(numticks=12) if several else LogLocator(subs=(1.0, 2.0, 5.0)))
        own.set_major_formatter(_written)
        own.set_minor_formatter(NullFormatter())
        positive = values[np.isfinite(values) & (values > 0.0)]
        if direction == "y":
            own.set_minor_locator(NullLocator())
            top = positive.max()
            set_limits(max(0.5 * np.percentile(positive, 0.5), top * 10.0**-_DECADES), 2.0 * top)
        else:
            margin = (positive.max() / positive.min()) ** BESIDE if marked else 1.0
            set_limits(positive.min() / margin, positive.max() * margin)
    elif axis.extent:
        # Data that vary by less than a millionth of the extent appear constant.
        scale, (low, high) = unit.factor * axis.extent, own.get_data_interval()
        if not high - low > max(1e-6 * scale, _NOTHING):  # also true of axes without data
            middle = 0.5 * (low + high) if math.isfinite(low) and max(abs(low), abs(high)) > _NOTHING else 0.0
            half = 0.052 * scale if scale > _NOTHING else 1.04
            set_limits(middle - half, middle + half)
    if axis.low is not None:
        set_limits(unit.factor * axis.low, None)
    if axis.high is not None:
        set_limits(None, unit.factor * axis.high)
    if axis.ticks:
        own.set_ticks(unit.factor * np.asarray(axis.ticks))
    if axis.zero:
        (panel.axhline if direction == "y" else panel.axvline)(0.0, **_ZERO)


def _written(value: float, _: int) -> str:
    return logarithmic_number(value)


def list_lines(panel: Axes, names: Sequence[str]) -> None:
    """Label the lines of a panel with names, from the top down."""
    panel.set_yticks(range(len(names)), [plain(name) for name in names])
    panel.set_ylim(len(names) - 0.4, -0.6)
