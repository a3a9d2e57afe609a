"""Charts of all designs of a study, which the reader chooses columns of, and the runs that they show."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import Any, NamedTuple

import numpy as np

from paraflex.arrays import NDArray
from paraflex.figures.charts import Axis, Chart, Panel, is_logarithmic, look
from paraflex.figures.designs import DesignTable, in_conflict
from paraflex.formatting import count, superscripts
from .packing import Series

# Kind of chart that Plotly's basic part does not have.
PARALLEL = "parallel"
LOWER = (
    "Less is taken as better; metrics for which more may be better, as safety factor and stiffness, select no design."
)


class Picker(NamedTuple):
    """Choice of a column for a chart of designs: name, columns, and index of the initial one."""

    name: str
    columns: Sequence[int]
    chosen: int = 0


@dataclass(frozen=True)
class DesignChart(Chart):
    """Chart that the page draws of the runs of all designs.

    Attributes
    ----------
    drawer : str
        Kind of chart: "responses", "front", "parallel" or "distribution".
    pickers : sequence of Picker
        Choices of columns that the reader makes.
    """

    drawer: str = ""
    pickers: Sequence[Picker] = ()


@dataclass(frozen=True)
class Designs:
    """Runs of many designs for the charts of the page.

    Attributes
    ----------
    table : DesignTable
        Table of all runs.
    rows : (k,) array of int
        Rows that the charts show.
    shown : mapping of int to int
        Runs of the page by their rows.
    """

    table: DesignTable
    rows: NDArray[np.intp]
    shown: Mapping[int, int]

    @property
    def columns(self) -> list[str]:
        """Parameters that vary, then metrics that have values, those by which designs are chosen first."""
        table = self.table
        known = [name for name, values in table.metrics.items() if np.isfinite(values[table.complete]).any()]
        return list(dict.fromkeys([*table.varied, *table.judged, *known]))

    def to_dict(self, series: Series) -> dict[str, Any]:
        """Return the runs for the scripts; numbers are added to `series`."""
        table, rows = self.table, self.rows
        pairs = list(dict.fromkeys(zip(table.path.tolist(), table.mode.tolist(), strict=True)))
        several = {word: len({pair[k] for pair in pairs}) > 1 for word, k in (("mode", 1), ("path", 0))}
        names = [
            ", ".join([mode] * several["mode"] + [path] * several["path"]) or mode or "runs" for path, mode in pairs
        ]
        known = {pair: k for k, pair in enumerate(pairs)}
        numbers = {
            "member": [known[str(table.path[row]), str(table.mode[row])] for row in rows],
            "number": table.design[rows],
            "shown": [self.shown.get(int(row), -1) for row in rows],
        }
        return {name: series.add(one, exact=True) for name, one in numbers.items()} | {
            "telling": ", ".join(word for word, differ in several.items() if differ) or "mode",
            "columns": [self._column(name, series) for name in self.columns],
            "series": [{"name": name} | look(k)._asdict() for k, name in enumerate(names)],
        }

    def _column(self, name: str, series: Series) -> dict[str, Any]:
        table, axis = self.table, self.table.axis(name)
        values = table.column(name)
        unit = axis.unit_for(values)
        return {
            "identity": name, "name": axis.name, "unit": superscripts("" if unit.name == "1" else unit.name),
            "parameter": name in table.parameters, "log": is_logarithmic(axis, values[table.complete]),
            "row": series.add(unit.factor * values[self.rows]),
        }  # fmt: skip


def survey(designs: Designs, first: Sequence[Chart] = (), *, seeks_least: bool = True) -> list[Panel]:
    """Return the charts of all designs: responses, Pareto front, distribution, parallel coordinates.

    Parameters
    ----------
    designs : Designs
        Runs.
    first : sequence of Chart
        Charts before these, such as that of the convergence of a search.
    seeks_least : bool
        Whether smaller metrics are better; without it, as for targets, there is no Pareto front.
    """
    table, names = designs.table, designs.columns
    parameters = [k for k, name in enumerate(names) if name in table.parameters]
    metrics = [k for k, name in enumerate(names) if name in table.metrics]
    charts = list(first)
    if parameters and metrics:
        several = len(parameters) > 1
        note = "One mark per run" + ("; thick, the median over the other parameters." if several else ".")
        # Charts of the first two parameters, or of two metrics if there is only one parameter.
        starts = [(0, 0), (0, 1)] if several else [(k, 0) for k in range(min(2, len(metrics)))]
        charts += [
            _chart("responses", "Response", [Picker("of", metrics, metric), Picker("to", parameters, parameter)], note,
                   str(k + 1)) for k, (metric, parameter) in enumerate(starts)
        ]  # fmt: skip
    if seeks_least and len(metrics) > 1:
        pair = [names.index(name) for name in in_conflict(table, table.judged)]
        across, up = map(metrics.index, pair if len(pair) == 2 else metrics[:2])
        mode = " of the same mode" if any(table.mode) else ""
        charts.append(_chart(
            "front", "Pareto front", [Picker("across", metrics, across), Picker("up", metrics, up)],
            f"Large, joined: no run{mode} is better in one and as good in the other. {LOWER}",
        ))  # fmt: skip
    if metrics:
        charts.append(_chart("distribution", "Distribution", [Picker("of", metrics)]))
        charts.append(_chart(
            PARALLEL, "All numbers of each run", [Picker("coloured by", metrics)],
            "One line per run. Drag along an axis to keep the runs that pass there; drag names to reorder.",
        ))  # fmt: skip
    return [Panel(_heading(designs), charts)] if charts else []


def _chart(drawer: str, title: str, pickers: Sequence[Picker], note: str = "", number: str = "") -> DesignChart:
    up, across = ("runs", "metric") if drawer == "distribution" else ("metric", pickers[-1].name)
    return DesignChart(drawer + number, title, Axis(up), x=Axis(across), note=note, drawer=drawer, pickers=pickers)


def _heading(designs: Designs) -> str:
    complete = int(np.count_nonzero(designs.table.complete))
    if designs.rows.size == complete:
        return f"All designs: {count(complete)} runs"
    return (
        f"{count(designs.rows.size)} of {count(complete)} complete runs, drawn by lot; the best and those of the "
        "fronts are among them"
    )
