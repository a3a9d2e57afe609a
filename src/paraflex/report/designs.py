"""Runs of many designs in a report: their numbers as columns of the page, and reasons for failures."""

from __future__ import annotations

import re
from collections.abc import Mapping, Sequence

import numpy as np
from numpy.typing import NDArray

from paraflex.formatting import display_unit, text_symbol
from paraflex.plots.designs import DesignTable
from paraflex.report.page import DesignColumn
from paraflex.results.metrics import metric_label

# Largest number of listed reasons for failures.
_MOST_REASONS = 12
_COMPLETE = "complete"
_NUMBER = re.compile(r"-?\d+(?:\.\d+)?(?:e[+-]?\d+)?")
# Ratio of values above which a metric has a logarithmic axis, and the same for a parameter with a logarithmic range.
_WIDE, _WIDE_RANGE = 50.0, 10.0


def columns(
    designs: DesignTable, rows: NDArray[np.intp], units: Mapping[str, str], logarithmic: Sequence[str]
) -> list[DesignColumn]:
    """Return the columns of a page: parameters that vary, and metrics.

    Parameters
    ----------
    designs : DesignTable
        Table of all runs.
    rows : array of int
        Rows to include.
    units : mapping of str to str
        Units of the parameters.
    logarithmic : sequence of str
        Parameters with a logarithmic range.
    """
    judged = designs.judged
    out = []
    for name in designs.varied:
        values = designs.parameters[name]
        unit, factor = shown_unit(units.get(name, ""), values)
        log = name in logarithmic and is_wide(values, _WIDE_RANGE)
        out.append(
            DesignColumn(
                name, text_symbol(name.replace("_", " ")), unit, factor * values[rows], parameter=True, log=log
            )
        )
    rest = [name for name in designs.metrics if name not in judged]
    for name in [*judged, *rest]:
        values = np.where(designs.complete, designs.metrics[name], np.nan)
        if not np.isfinite(values).any():
            continue
        unit, factor = shown_unit(designs.units.get(name, ""), values)
        out.append(DesignColumn(name, metric_name(name), unit, factor * values[rows], log=is_wide(values)))
    return out


def shown_unit(unit: str, values: NDArray[np.float64]) -> tuple[str, float]:
    """Return the unit for display, empty for dimensionless numbers, and the factor of the values."""
    if unit in ("", "1"):
        return "", 1.0
    name, factor = display_unit(unit, values)
    return name.replace("^2", "²").replace("^3", "³").replace("^4", "⁴"), factor


def metric_name(metric: str) -> str:
    """Return the label of a metric: "RMS tracking error"; "peak torque of τ₁" for a metric of one motor."""
    return metric_label(metric, text_symbol)


def reasons(designs: DesignTable) -> list[tuple[str, str, int]]:
    """Return the reasons why runs are not complete: status, an example, and the number of such runs.

    Reasons that differ only in their numbers are counted together.
    """
    groups: dict[tuple[str, str], list[str]] = {}
    for status, reason in zip(designs.status.tolist(), designs.reason.tolist(), strict=True):
        if status != _COMPLETE:
            groups.setdefault((status, _NUMBER.sub("#", reason)), []).append(reason)
    most = sorted(groups.items(), key=lambda group: -len(group[1]))
    found = [(status, texts[0], len(texts)) for (status, _), texts in most[:_MOST_REASONS]]
    left = sum(len(texts) for _, texts in most[_MOST_REASONS:])
    return [*found, *([("", "other reasons; the table has them", left)] if left else [])]


def is_wide(values: NDArray[np.float64], share: float = _WIDE) -> bool:
    """Return whether all values are positive and their ratio exceeds `share`, by default that of logarithmic axes."""
    known = values[np.isfinite(values)]
    return bool(known.size and known.min() > 0.0 and known.max() > share * known.min())
