"""Charts of all designs of a study: convergence, responses, Pareto front, distribution, parallel coordinates."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from paraflex.plots.designs import DesignTable, in_conflict
from paraflex.report.curves import DOTTED, look
from paraflex.report.designs import is_wide
from paraflex.report.page import Chart, Curve, DesignColumn, Designs, Look, Panel, Picker
from paraflex.report.text import count

LOWER = (
    "Less is taken as better; metrics for which more may be better, as safety factor and stiffness, select no design."
)


class Step(NamedTuple):
    """Design of a search: its number, its objective (NaN if it failed), and whether it satisfies the limits."""

    number: int
    objective: float
    allowed: bool


def survey(
    designs: DesignTable,
    rows: NDArray[np.intp],
    drawn: Sequence[DesignColumn],
    history: Sequence[Step],
    *,
    seeks_least: bool = True,
) -> list[Panel]:
    """Return the charts of all designs.

    `seeks_least` is whether smaller metrics are better; without it, as for targets, there is no Pareto front.
    """
    parameters = [k for k, column in enumerate(drawn) if column.parameter]
    metrics = [k for k, column in enumerate(drawn) if not column.parameter]
    place = {column.identity: k for k, column in enumerate(drawn)}
    charts = []
    if history:
        charts.append(_history(history, "objective" if seeks_least else "residual"))
    if parameters and metrics:
        charts += _responses(parameters, metrics)
    if seeks_least and len(metrics) > 1:
        pair = [place[name] for name in in_conflict(designs, designs.judged)]
        first, second = pair if len(pair) == 2 else metrics[:2]
        mode = " of the same mode" if any(designs.mode) else ""
        charts.append(Chart(
            "front", "Pareto front", "metric", x="metric", over_time=False, drawer="front",
            pickers=[Picker("across", metrics, metrics.index(first)), Picker("up", metrics, metrics.index(second))],
            note=f"Large, joined: no run{mode} is better in one and as good in the other. {LOWER}",
        ))  # fmt: skip
    if metrics:
        charts.append(Chart(
            "distribution", "Distribution", "runs", x="metric", over_time=False, drawer="distribution",
            pickers=[Picker("of", metrics)],
        ))  # fmt: skip
        charts.append(Chart(
            "parallel", "All numbers of each run", "metrics", x="parameters", over_time=False, drawer="parallel",
            pickers=[Picker("coloured by", metrics)],
            note="One line per run. Drag along an axis to keep the runs that pass there; drag names to reorder.",
        ))  # fmt: skip
    return [Panel(_drawn(designs, rows), charts)] if charts else []


def _responses(parameters: Sequence[int], metrics: Sequence[int]) -> list[Chart]:
    """Return two response charts: of the first two parameters, or of two metrics if there is only one parameter."""
    note = (
        "One mark per run; thick, the median over the other parameters." if len(parameters) > 1 else "One mark per run."
    )
    starts = [(0, 0), (0, 1)] if len(parameters) > 1 else [(k, 0) for k in range(min(2, len(metrics)))]
    return [
        Chart(
            f"responses{k + 1}", "Response", "metric", x="parameter", over_time=False, drawer="responses",
            pickers=[Picker("of", metrics, metric), Picker("to", parameters, parameter)], note=note,
        )
        for k, (metric, parameter) in enumerate(starts)
    ]  # fmt: skip


def _drawn(designs: DesignTable, rows: NDArray[np.intp]) -> str:
    complete = int(np.count_nonzero(designs.complete))
    if rows.size == complete:
        return f"All designs: {count(complete)} runs"
    return (
        f"{count(rows.size)} of {count(complete)} complete runs, drawn by lot; the best and those of the fronts are "
        "among them"
    )


def _history(steps: Sequence[Step], goal: str) -> Chart:
    """Return the chart of objectives or residuals of a search in order of evaluation, and of the smallest so far."""
    numbers = np.array([step.number for step in steps], dtype=float)
    values = np.array([step.objective for step in steps], dtype=float)
    allowed = np.array([step.allowed for step in steps], dtype=bool)
    least = np.minimum.accumulate(np.where(allowed & np.isfinite(values), values, np.inf))
    curves = [
        Curve("a design", values, numbers, Look(dash=DOTTED)),
        Curve("least until then", np.where(np.isfinite(least), least, np.nan), numbers, Look(0)),
    ]
    return Chart("history", "Convergence", goal, curves, x="design", over_time=False, log=is_wide(values))


def drawn_designs(
    designs: DesignTable, rows: NDArray[np.intp], drawn: Sequence[DesignColumn], shown: Mapping[int, int]
) -> Designs:
    """Return the drawn rows for the page's charts; `shown` maps a row to its run on the page."""
    pairs = list(dict.fromkeys(zip(designs.path.tolist(), designs.mode.tolist(), strict=True)))
    several_paths, several_modes = (len({pair[k] for pair in pairs}) > 1 for k in (0, 1))
    names = [", ".join([mode] * several_modes + [path] * several_paths) or mode or "runs" for path, mode in pairs]
    known = {pair: k for k, pair in enumerate(pairs)}
    return Designs(
        columns=drawn,
        telling=", ".join(["mode"] * several_modes + ["path"] * several_paths) or "mode",
        series=[(name, look(k)) for k, name in enumerate(names)],
        member=[known[str(designs.path[row]), str(designs.mode[row])] for row in rows],
        number=designs.design[rows],
        shown=[shown.get(int(row), -1) for row in rows],
    )
