"""Chart of actuation modes: how well each drives a path."""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from typing import Any

import numpy as np

from paraflex.figures.catalogue import figure
from paraflex.figures.charts import Axis, Chart, Curve, Look


@figure("worst condition number of every mode along the path", columns=1,
        missing=("no condition numbers: the mechanism has no path", "name one: --path"))  # fmt: skip
def mode_conditions(rows: Sequence[Mapping[str, Any]]) -> Iterator[Chart]:
    """Yield the chart of the worst condition number of the actuation matrix along a path, one bar per mode.

    Bars of modes that cannot drive the path have another colour.

    Parameters
    ----------
    rows : sequence of mapping
        Rows of the output of `paraflex modes --json`.
    """
    # An infinite condition number is written as None.
    known = [row for row in rows if np.isfinite(row.get("condition_max") or np.nan)]
    curves = []
    for drives, colour, name in ((True, 0, "drives the path"), (False, 6, "does not")):
        values = [row["condition_max"] if row.get("drives_path", True) == drives else np.nan for row in known]
        if np.isfinite(values).any():
            curves.append(Curve(name, np.arange(len(known)), values, Look(colour), mark="bar"))
    if curves:
        yield Chart("modes", "Condition of modes", Axis("", names=[str(row["mode"]) for row in known]), curves,
                    Axis("condition number, worst along the path", log=True, low=1.0))  # fmt: skip
