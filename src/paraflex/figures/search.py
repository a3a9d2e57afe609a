"""Charts and tables of searches: convergence, parameters found, metrics or targets, and Sobol indices."""

from collections.abc import Iterator, Mapping, Sequence
from typing import Any

import numpy as np

from paraflex.arrays import Array
from paraflex.formatting import common_unit, number, quantity
from paraflex.units import PERCENT
from .charts import Axis, Chart, Curve, Look, Mark, is_wide, look, stairs
from .designs import column_label
from .entry import figure
from .tables import Column, Table, columns_of, in_row_units

IDENTIFICATION = "identification"
_BEST, _FAILED = Look(0), Look(1)
# Designs far above the best are drawn at the upper edge; otherwise they would hide the convergence.
_HIGHEST = 3.0
# Largest number of tiles for metrics or parameters.
_MOST_TILES = 2
# Place of designs that fail below the others, as a share of the height of the panel.
_BELOW = 0.08


# Charts


@figure(
    "objective of every design, and the least up to it", heading="Search", written_as="convergence",
    variables=("history",), columns=1, height=50.0,
)  # fmt: skip
def convergence(figures: Mapping[str, Any]) -> Iterator[Chart]:
    """Yield the chart of the objective, or the root mean square residual, of every design, and the least so far.

    Designs that fail to run are marked below the others; designs that exceed a limit are crosses.

    Parameters
    ----------
    figures : mapping
        Result of an optimisation or identification as plain numbers.
    """
    history = [(number, value, held) for number, value, held in figures["history"]]
    ran = [each for each in history if each[1] is not None]
    if not ran:
        return
    first = next((value for _, value, held in ran if held), ran[0][1])
    values = np.array([value for _, value, _ in ran])
    top = first + (_HIGHEST - 1.0) * max(first - values.min(), 0.1 * abs(first))
    shown, held = np.minimum(values, top), np.array([each[2] for each in ran], dtype=bool)
    numbers = np.array([each[0] for each in ran], dtype=float)
    curves = []
    kinds: tuple[tuple[str, Array, Mark], ...] = (("designs", held, "dot"), ("passing a limit", ~held, "cross"))
    for name, own, mark in kinds:
        if own.any():
            texts = [f"design {int(k)}: {number(value)}" for k, value in zip(numbers[own], values[own], strict=True)]
            curves.append(Curve(name, shown[own], numbers[own], mark=mark, faint=True, texts=texts))
    if held.any():
        least, last = np.minimum.accumulate(values[held]), history[-1][0]
        x, y = stairs(np.append(numbers[held], last), np.append(least, least[-1]))
        curves.append(Curve("least until then", y, x, _BEST))
    log = not (shown <= 0.0).any() and is_wide(shown)
    if failed := [number for number, value, _ in history if value is None]:
        scaled = np.log(shown) if log else shown
        below = scaled.min() - _BELOW * (np.ptp(scaled) or 1.0)
        curves.append(Curve("not running", np.full(len(failed), np.exp(below) if log else below), failed, _FAILED,
                            mark="cross", texts=[f"design {number} does not run" for number in failed]))  # fmt: skip
    goal = "root mean square residual" if figures["kind"] == IDENTIFICATION else "objective"
    notes = ["Crosses: designs that exceed a limit."] if not held.all() else []
    notes += ["Designs far above the first are at the upper edge."] if values.max() > top else []
    yield Chart("convergence", "Convergence", Axis(goal, log=log), curves, Axis("design"), note=" ".join(notes))


@figure(
    "every target at the start and at the best design", heading="Search", written_as="targets", variables=("targets",),
    columns=1,
)  # fmt: skip
def targets_reached(figures: Mapping[str, Any]) -> Iterator[Chart]:
    """Yield the chart of the ratio of reached to target value for every non-zero target, at start and best design.

    Parameters
    ----------
    figures : mapping
        Result of an identification as plain numbers.
    """
    targets = [each for each in figures["targets"] if each["value"] != 0.0]
    if not targets:
        return
    lines = np.arange(len(targets), dtype=float)
    curves = [Curve("target", [-0.6, lines[-1] + 0.6], [1.0, 1.0], Look(1))]
    kinds: tuple[tuple[str, str, Mark, Look], ...] = (
        ("start", "start", "ring", Look()), ("reached", "best", "square", _BEST),
    )  # fmt: skip
    for key, name, mark, own in kinds:
        curves.append(Curve(name, lines, [each[key] / each["value"] for each in targets], own, mark=mark))
    names = _target_names(targets, ("mode", "metric", "path"))
    yield Chart("targets", "Targets", Axis("", names=names), curves, Axis("reached / target"))


@figure(
    "first-order and total Sobol indices", heading="Sobol indices", written_as="indices", variables=("indices",),
    panels="choices", columns=2,
)  # fmt: skip
def sobol_bars(figures: Mapping[str, Any]) -> Iterator[Chart]:
    """Yield the chart of first-order and total Sobol indices of every parameter, by metric, path and mode.

    Parameters
    ----------
    figures : mapping
        Result of `indices` as plain numbers.
    """
    found: dict[tuple[str, str, str], list[Mapping[str, Any]]] = {}
    for row in figures["indices"]:
        if row["first"] is not None:
            found.setdefault((row["metric"], row["path"], row["mode"]), []).append(row)
    several = len({path for _, path, _ in found}) > 1
    curves, choices = [], []
    for choice, ((metric, path, mode), rows) in enumerate(found.items()):
        choices.append(", ".join(filter(None, (column_label(metric), path if several else "", mode))))
        for k, (key, name) in enumerate((("first", "first order"), ("total", "total"))):
            y = np.arange(len(rows), dtype=float) + 0.38 * (k - 0.5)
            x, wide = (np.array([row[one] for row in rows], float) for one in (key, f"{key}_confidence"))
            curves.append(Curve(name, y, x, look(k), choice=choice, mark="bar", thickness=0.34))
            curves.append(Curve("interval of 95 %", *_gapped(y, x, wide), choice=choice, quiet=True))
    if curves:
        names = [row["parameter"] for row in next(iter(found.values()))]
        axis = Axis("share of the variance", zero=True)
        yield Chart("indices", "Sobol indices", Axis("", names=names), curves, axis, choices, choosing="metric")


def _gapped(y: Array, x: Array, wide: Array) -> tuple[Array, Array]:
    """Return ordinates and abscissae of horizontal lines about points, separated by NaN."""
    gap = np.full(y.size, np.nan)
    return np.ravel(np.column_stack([y, y, gap])), np.ravel(np.column_stack([x - wide, x + wide, gap]))


# Tables


def tables(found: Mapping[str, Any], units: Mapping[str, str]) -> Iterator[Table]:
    """Yield the tables of a search: its parameters, and its targets or metrics; none if it found no design.

    Parameters
    ----------
    found : mapping
        Result as plain numbers.
    units : mapping of str to str
        SI units of parameters and metrics.
    """
    if found.get("values"):
        yield parameter_table(found, units)
        yield (target_table if found["kind"] == IDENTIFICATION else metric_table)(found, units)


def parameter_table(found: Mapping[str, Any], units: Mapping[str, str]) -> Table:
    """Return the table of the parameters of the best design and of the start, with intervals of confidence."""
    values, confidence = found["values"], found.get("confidence") or {}
    deviations, bounds = confidence.get("deviations") or {}, found.get("bounds") or {}
    columns = in_row_units([
        Column("found", list(values.values()), digits=5),
        Column("start", [found["start"].get(name) for name in values], digits=5),
        Column("± (68 %)", [deviations.get(name) for name in values], digits=2),
    ], [units.get(name, "") for name in values])  # fmt: skip
    if bounds:
        words = {"low": "lowest allowed", "high": "highest allowed"}
        columns.append(Column("bound", [words.get(bounds.get(name, ""), "") for name in values]))
    whose: dict[str, list[str]] = {}
    for name, why in (confidence.get("reasons") or {}).items():
        whose.setdefault(why, []).append(name)
    note = " ".join(f"No interval of confidence of {', '.join(names)}: {why}." for why, names in whose.items())
    names = Column("parameter", list(values))
    return Table("Parameters found", [names, *columns], note).filled()


def metric_table(found: Mapping[str, Any], units: Mapping[str, str]) -> Table:
    """Return the table of objective and metrics of the best design of an optimisation and of the start."""
    now, before = ({"objective": found.get(f"{kind}objective")} | (found.get(f"{kind}metrics") or {})
                   for kind in ("", "start_"))  # fmt: skip
    targets = {name: target for name, target, _ in (found.get("goal") or {}).get("targets", ())}
    columns = in_row_units([
        *([Column("target", [targets.get(name) for name in now], digits=5)] if targets else []),
        Column("found", list(now.values()), digits=5),
        Column("start", [before.get(name) for name in now], digits=5),
    ], [units.get(name, "") for name in now])  # fmt: skip
    off = [_relative(value, before.get(name)) for name, value in now.items()]
    note = "" if found.get("holds_limits", True) else "The design found does not hold all limits."
    names = Column("metric", list(map(column_label, now)))
    return Table("Metrics", [names, *columns, Column("change", off, shown=PERCENT, digits=3)], note)


def target_table(found: Mapping[str, Any], units: Mapping[str, str]) -> Table:
    """Return the table of the targets of an identification, and what the best design and the start reach."""
    targets = found.get("targets") or []
    columns = in_row_units(
        columns_of(targets, ("target", "value", ""), ("reached", "reached", ""), ("start", "start", ""), digits=5),
        [units.get(one["metric"], "") for one in targets],
    )  # fmt: skip
    off = [_relative(one["reached"], one["value"]) for one in targets]
    # Residuals are these differences unless a target has a weight or is not relative.
    residuals = [one.get("residual") for one in targets]
    if np.allclose(np.array(residuals, dtype=float), np.array(off, dtype=float), equal_nan=True):
        residuals = [None] * len(targets)
    return Table("Targets", [
        Column("metric", _target_names(targets, ("metric", "mode", "path"), ", ")), *columns,
        Column("off by", off, shown=PERCENT, digits=3), Column("residual", residuals, digits=3),
    ]).filled()  # fmt: skip


def index_table(found: Mapping[str, Any]) -> Table:
    """Return the table of Sobol indices: a row for each metric, path, mode and parameter."""
    rows = found["indices"]
    words = [Column("metric", [column_label(row["metric"]) for row in rows]),
             *columns_of(rows, *((key, key, "") for key in ("path", "mode", "parameter")))]  # fmt: skip
    numbers = []
    for key, name in (("first", "first order"), ("total", "total")):
        numbers += columns_of(rows, (name, key, ""), ("± (95 %)", f"{key}_confidence", ""), digits=3)
    return Table("Sobol indices", [*words, *numbers])


def tiles(found: Mapping[str, Any], units: Mapping[str, str]) -> list[tuple[str, str, str]]:
    """Return tiles of the minimised quantity, then of the identified parameters or of the metrics of the design.

    Parameters
    ----------
    found : mapping
        Result as plain numbers.
    units : mapping of str to str
        SI units of parameters and metrics.
    """
    identified = found["kind"] == IDENTIFICATION
    goal = "residual" if identified else "objective"
    shown_tiles = [(goal, number(found.get(goal)), f"{number(found.get(f'start_{goal}'))} at the start")]
    now, before = ("values", "start") if identified else ("metrics", "start_metrics")
    old = found.get(before) or {}
    for name, value in list((found.get(now) or {}).items())[:_MOST_TILES]:
        unit = units.get(name, "")
        shown = common_unit(unit, (value, old.get(name)))
        label = name.replace("_", " ") if identified else column_label(name)
        start = number(old.get(name), factor=shown.factor)
        shown_tiles.append((label, quantity(value, unit, shown, digits=4, padded=False), f"{start} at the start"))
    return shown_tiles


def _relative(value: float | None, other: float | None) -> float | None:
    return None if value is None or not other else (value - other) / abs(other)


def _target_names(targets: Sequence[Mapping[str, Any]], keys: Sequence[str], joint: str = " ") -> list[str]:
    """Return distinctive names of targets: of the entries `keys`, the metric and those that differ among targets."""
    kept = [key for key in keys if key == "metric" or len({each[key] for each in targets}) > 1]
    return [joint.join(filter(None, (column_label(each[key]) if key == "metric" else each[key] for key in kept)))
            for each in targets]  # fmt: skip
