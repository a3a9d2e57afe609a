"""Chart and tables of the derivatives of a run's metrics with respect to parameters."""

from collections.abc import Iterator, Mapping, Sequence
from typing import Any

import numpy as np

from paraflex.errors import InputError
from paraflex.formatting import number, text_symbol
from .charts import Axis, Chart, Curve, look
from .designs import column_label
from .entry import figure
from .tables import Column, Table, in_row_units

# Share of the distance of two metrics that their bars fill.
_FILLED = 0.8


@figure(
    "elasticities: change of metrics in % per % of parameter", takes="run", written_as="elasticities",
    variables=("runs",),
)  # fmt: skip
def elasticities(figures: Mapping[str, Any], run: int = 0) -> Iterator[Chart]:
    """Yield the chart of elasticities: the change of each metric in per cent per one per cent of each parameter.

    Parameters
    ----------
    figures : mapping
        Result of `sensitivities` as plain numbers.
    run : int
        Number of the run.
    """
    if not 0 <= run < len(figures["runs"]):
        raise InputError("no such run", field="run", value=run, remedy=f"name one from 0 to {len(figures['runs']) - 1}")
    shown = figures["runs"][run]
    parameters, metrics = list(figures["parameters"]), list(shown["metrics"])
    pitch = _FILLED / len(parameters)
    curves = []
    for k, parameter in enumerate(parameters):
        values = [shown["metrics"][metric]["relative"][parameter] for metric in metrics]
        y = np.arange(len(metrics)) + pitch * (k - 0.5 * (len(parameters) - 1))
        name, x = text_symbol(parameter.replace("_", " ")), np.array(values, dtype=float)
        curves.append(Curve(name, y, x, look(k), mark="bar", thickness=0.9 * pitch))
    title = ", ".join(filter(None, (figures["mechanism"], shown["path"], shown["mode"])))
    yield Chart("elasticities", title, Axis("", names=list(map(column_label, metrics))), curves,
                Axis("elasticity", "% / %", zero=True))  # fmt: skip


def tables(figures: Mapping[str, Any], run: int, parameters: Sequence[str] = ()) -> Iterator[Table]:
    """Yield tables of the elasticities and the derivatives of a run, by all parameters or some of them."""
    shown, units = figures["runs"][run], figures["units"]
    metrics, where = shown["metrics"], f"{figures['mechanism']}, {shown['path']}, mode {shown['mode']}"

    def columns(key: str) -> Iterator[Column]:
        for name in parameters or figures["parameters"]:
            value = number(figures["parameters"][name]["value"])
            yield Column(f"{name}\n{value}", [one[key][name] for one in metrics.values()], digits=3)

    names = Column("metric", list(map(column_label, metrics)))
    values = in_row_units([Column("value", [one["value"] for one in metrics.values()])],
                          [units.get(name, "") for name in metrics])  # fmt: skip
    yield Table(f"{where}: change of metrics by that of parameters [% / %]", [names, *values, *columns("relative")])
    yield Table("Derivatives, in the units of metrics and parameters", [
        names, Column("unit", [units.get(name, "") for name in metrics]), *columns("derivatives"),
    ])  # fmt: skip
