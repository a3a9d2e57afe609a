"""Derivatives of metrics by the place of a design in the unit cube: by differences, or exact ones of the runs."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from typing import Protocol

import numpy as np
from numpy.typing import NDArray

from paraflex.errors import InputError
from paraflex.studies.optimisation.evaluate import Evaluate, Evaluated
from paraflex.studies.optimisation.record import slope_column
from paraflex.studies.optimisation.study import DesignStudy
from paraflex.studies.sweeps.run import COMPLETE, Outcome, Task, run_task, trouble
from paraflex.studies.sweeps.study import Setting

Array = NDArray[np.float64]
EXACT = "exact"


class Slopes(Protocol):
    """Derivatives of the metrics that count."""

    def __call__(self, at: Evaluated) -> Mapping[str, Array]:
        """By column (runs, parameters), at a design that is complete."""
        ...


def slopes_of(study: DesignStudy, evaluate: Evaluate) -> Slopes:
    """Derivatives as a study asks for them."""
    if study.search.gradients == EXACT:
        return lambda at: exact_slopes(study, at)
    return lambda at: differences(study, evaluate, at)


def differences(study: DesignStudy, evaluate: Evaluate, at: Evaluated) -> Mapping[str, Array]:
    """Central differences, all designs of them evaluated at once.

    The step is a share of the range: long against what the choice of time steps makes of a metric, short against the
    metric's own bends. At a bound, and beside a design that fails, the difference is one-sided; beside two that fail
    it is zero.
    """
    middle = study.unit(at.design)
    sides = np.clip(middle[:, None] + study.search.difference * np.array([-1.0, 1.0]), 0.0, 1.0)
    done = evaluate([_moved(study, at, k, x) for k in range(middle.size) for x in sides[k]])
    columns = {column: np.zeros((study.runs, middle.size)) for column in study.columns}
    for k in range(middle.size):
        usable = [each for each in (done[2 * k], at, done[2 * k + 1]) if each.complete]
        apart = study.unit(usable[-1].design)[k] - study.unit(usable[0].design)[k]
        for column, out in columns.items():
            rise = usable[-1].metric(column) - usable[0].metric(column)
            out[:, k] = rise / apart if apart > 0.0 else 0.0
    return columns


def _moved(study: DesignStudy, at: Evaluated, k: int, place: float) -> tuple[float, ...]:
    """A design with one of its numbers elsewhere in its range."""
    if place == study.unit(at.design)[k]:
        return at.design
    moved = study.design(np.full(len(at.design), place))[k]
    return (*at.design[:k], moved, *at.design[k + 1 :])


def exact_slopes(study: DesignStudy, at: Evaluated) -> Mapping[str, Array]:
    """Derivatives that the runs brought with them; see `run_with_slopes`."""
    scale = study.per_unit(at.design)
    return {
        column: scale * np.array([[row[slope_column(column, name)] for name in study.setting.names] for row in at.rows])
        for column in study.columns
    }


def run_with_slopes(
    columns: tuple[str, ...], setting: Setting, task: Task, watch: Callable[[float], None] | None = None
) -> Outcome:
    """`run_task`, and exact derivatives of some metrics in the rows that are complete.

    Raises
    ------
    InputError
        A metric has no exact derivative by a parameter.
    """
    outcome = run_task(setting, task, watch)
    complete = [row for row in outcome.rows if row["status"] == COMPLETE]
    if complete:
        try:
            found = {mode: slopes for mode, _, slopes in _metric_gradients()(setting, task)}
        except InputError as error:
            raise InputError(
                f"no exact derivatives ({error})", field="search.gradients", value=EXACT, remedy='say "differences"'
            ) from error
        # Whatever else happens is the design's: its rows say so.
        except Exception as error:
            for row in complete:
                row |= trouble(error)
            return outcome
        for row in complete:
            for column in columns:
                slopes = found[row["mode"]][column]
                row |= {slope_column(column, name): float(x) for name, x in zip(setting.names, slopes, strict=True)}
    return outcome


def _metric_gradients() -> Callable:
    try:
        from paraflex.studies.sensitivities import (  # pyright: ignore[reportMissingImports]
            metric_gradients,
        )
    except ImportError:
        raise InputError("are not available here", field="search.gradients", remedy='say "differences"') from None
    return metric_gradients
