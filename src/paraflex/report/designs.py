"""Runs of many designs: read, their numbers as columns of a page, why some failed."""

from __future__ import annotations

import re
from collections import Counter
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from paraflex.campaign import read_table
from paraflex.errors import InputError
from paraflex.plots.designs import DesignTable, read_designs
from paraflex.plots.labels import display_unit, text_symbol
from paraflex.report.page import DesignColumn
from paraflex.results.metrics import metric_label

# Reasons of failures that are listed.
_REASONS = 12
_COMPLETE = "complete"
_NUMBER = re.compile(r"-?\d+(?:\.\d+)?(?:e[+-]?\d+)?")
# A metric that spans so much is drawn on a logarithmic axis, and a range that is logarithmic itself.
_WIDE, _WIDE_RANGE = 50.0, 10.0


@dataclass(frozen=True)
class Studied:
    """The rows of a study.

    Attributes
    ----------
    table : DesignTable
    run, design : (rows,) array of int
    status, reason : (rows,) array of str
    """

    table: DesignTable
    run: NDArray[np.int64]
    design: NDArray[np.int64]
    status: NDArray[np.str_]
    reason: NDArray[np.str_]

    @property
    def counts(self) -> dict[str, int]:
        """How many runs ended how."""
        return dict(Counter(self.status.tolist()))

    @property
    def judged(self) -> list[str]:
        """The metrics that designs are chosen by; none where none varies."""
        if not self.table.complete.any():
            return []
        try:
            return self.table.judged_by(None, len(self.table.metrics))
        except InputError:
            known = [name for name, values in self.table.metrics.items() if np.isfinite(values).any()]
            return known[:1]

    def only(self, rows: NDArray[np.intp]) -> Studied:
        """Some of the rows, by their numbers."""
        parts = {name: getattr(self, name)[rows] for name in ("run", "design", "status", "reason")}
        return replace(self, table=self.table.only(rows), **parts)  # pyright: ignore[reportArgumentType]

    def values(self, row: int) -> tuple[float, ...]:
        """The numbers of a row's design, in the order of the parameters."""
        return tuple(float(values[row]) for values in self.table.parameters.values())

    def label(self, row: int) -> str:
        """What a run is called: its design's number, its mode, and its path where there are several."""
        several = len(set(self.table.path.tolist())) > 1
        return f"#{self.design[row]} {self.table.mode[row]}" + (f" {self.table.path[row]}" if several else "")


def read_studied(files: Sequence[Path]) -> Studied:
    """The rows of a study, from the files that `tables_of` its folder names."""
    import pyarrow as pa

    table = read_designs(files)
    rows = pa.concat_tables([read_table(file).select(["run", "design", "status", "reason"]) for file in files])
    texts = {name: np.array(rows[name].to_pylist(), dtype=str) for name in ("status", "reason")}
    studied = Studied(table, rows["run"].to_numpy(), rows["design"].to_numpy(), **texts)
    order = np.argsort(studied.run, kind="stable")
    return studied if np.array_equal(order, np.arange(order.size)) else studied.only(order)


def columns(
    studied: Studied, rows: NDArray[np.intp], units: Mapping[str, str], logarithmic: Sequence[str]
) -> list[DesignColumn]:
    """Parameters that vary and metrics of some rows, as the page draws them.

    Parameters
    ----------
    studied : Studied
    rows : array of int
    units : mapping of str to str
        Of parameters.
    logarithmic : sequence of str
        Parameters whose range is.
    """
    table, judged = studied.table, studied.judged
    out = []
    for name in table.varied:
        values = table.parameters[name]
        unit, factor = shown_unit(units.get(name, ""), values)
        log = name in logarithmic and _is_wide(values, _WIDE_RANGE)
        out.append(
            DesignColumn(
                name, text_symbol(name.replace("_", " ")), unit, factor * values[rows], parameter=True, log=log
            )
        )
    rest = [name for name in table.metrics if name not in judged]
    for name in [*judged, *rest]:
        values = np.where(table.complete, table.metrics[name], np.nan)
        if not np.isfinite(values).any():
            continue
        unit, factor = shown_unit(table.units.get(name, ""), values)
        out.append(DesignColumn(name, metric_name(name), unit, factor * values[rows], log=_is_wide(values, _WIDE)))
    return out


def shown_unit(unit: str, values: NDArray[np.float64]) -> tuple[str, float]:
    """The unit that values are shown in, and what they are multiplied by; "" of those without one."""
    if unit in ("", "1"):
        return "", 1.0
    name, factor = display_unit(unit, values)
    return name.replace("^2", "²").replace("^3", "³").replace("^4", "⁴"), factor


def metric_name(metric: str) -> str:
    """What a metric is called: "RMS tracking error"; "peak torque of τ₁" of one motor's."""
    return metric_label(metric, text_symbol)


def reasons(studied: Studied) -> list[tuple[str, str, int]]:
    """Why runs are not complete: status, one of the reasons, and how many have one like it but for its numbers."""
    groups: dict[tuple[str, str], list[str]] = {}
    for status, reason in zip(studied.status.tolist(), studied.reason.tolist(), strict=True):
        if status != _COMPLETE:
            groups.setdefault((status, _NUMBER.sub("#", reason)), []).append(reason)
    most = sorted(groups.items(), key=lambda group: -len(group[1]))
    found = [(status, texts[0], len(texts)) for (status, _), texts in most[:_REASONS]]
    left = sum(len(texts) for _, texts in most[_REASONS:])
    return [*found, *([("", "other reasons; the table has them", left)] if left else [])]


def _is_wide(values: NDArray[np.float64], share: float) -> bool:
    known = values[np.isfinite(values)]
    return bool(known.size and known.min() > 0.0 and known.max() > share * known.min())
