"""Chart and table of actuation modes: how well each drives a mechanism along a path."""

from collections.abc import Iterator, Mapping, Sequence
from typing import Any

import numpy as np

from .charts import Axis, Chart, Curve, Look
from .entry import figure
from .tables import Column, Table


@figure("worst condition number of every mode along the path", columns=1,
        missing=("no condition numbers: the mechanism has no path", "name one: --path"))  # fmt: skip
def mode_conditions(rows: Sequence[Mapping[str, Any]]) -> Iterator[Chart]:
    """Yield the chart of the worst condition number of the actuation matrix along a path, one bar per mode.

    Parameters
    ----------
    rows : sequence of mapping
        Rows of the output of `paraflex modes --json`.
    """
    # An infinite condition number is written as None.
    known = [row for row in rows if np.isfinite(row.get("condition_max") or np.nan)]
    curves = [
        Curve(word, np.flatnonzero(drives), [known[k]["condition_max"] for k in np.flatnonzero(drives)], Look(colour),
              mark="bar")
        for colour, word, drives in (
            (0, "drives the path", [row.get("drives_path", True) for row in known]),
            (1, "does not", [not row.get("drives_path", True) for row in known]),
        ) if any(drives)
    ]  # fmt: skip
    if curves:
        yield Chart("conditions", "", Axis("", names=[str(row["mode"]) for row in known]), curves,
                    Axis("condition number, worst along the path", log=True, low=1.0))  # fmt: skip


def mode_table(title: str, rows: Sequence[Mapping[str, Any]]) -> Table:
    """Return the table of modes or sets of motors."""
    words = {True: "yes", False: "no", None: None}
    worst = [np.inf if row.get("condition_max", 0.0) is None else row.get("condition_max") for row in rows]
    drives = [words[row.get("drives_path")] for row in rows]
    return Table(title, [
        Column("mode", [row["mode"] for row in rows]),
        Column("active motors", [", ".join(row["motors"]) for row in rows]),
        Column("redundancy", [row.get("redundancy") for row in rows]),
        Column("worst condition number", worst, digits=3, infinite="infinite"),
        Column("drives the path", [row.get("reason", word) for row, word in zip(rows, drives, strict=True)]),
    ]).filled()  # fmt: skip
