"""Result of an optimisation or identification in its report: the design found and its metrics or targets."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import Any

import numpy as np

from paraflex.report.designs import metric_name, shown_unit
from paraflex.report.text import NO_VALUE, number, table

IDENTIFICATION = "identification"
# Largest number of tiles for metrics or parameters.
_MOST_TILES = 2


def search_tiles(
    found: Mapping[str, Any], units: Mapping[str, str], metric_units: Mapping[str, str]
) -> list[tuple[str, str, str]]:
    """Return tiles of the minimised quantity, then of the identified parameters or of the metrics of the design.

    Parameters
    ----------
    found : mapping
        Content of `result.json`.
    units, metric_units : mapping of str to str
        Units of parameters and of metrics.
    """
    identified = found["kind"] == IDENTIFICATION
    goal = "residual" if identified else "objective"
    tiles = [(goal, number(found.get(goal)), f"{number(found.get(f'start_{goal}'))} at the start")]
    now, before = ("values", "start") if identified else ("metrics", "start_metrics")
    own_units = units if identified else metric_units
    old = found.get(before) or {}
    for name, value in list((found.get(now) or {}).items())[:_MOST_TILES]:
        shown, *start, unit = _in_unit((value, old.get(name)), own_units.get(name, ""))
        label = name.replace("_", " ") if identified else metric_name(name)
        tiles.append((label, f"{shown} {unit}".rstrip(), f"{start[0]} at the start"))
    return tiles


def search_tables(
    found: Mapping[str, Any], units: Mapping[str, str], metric_units: Mapping[str, str]
) -> list[tuple[str, str]]:
    """Return titles and tables of a search: its parameters, and its targets or metrics; empty if it found no design."""
    if not found.get("values"):
        return []
    identified = found["kind"] == IDENTIFICATION
    results = _targets(found, metric_units) if identified else _metrics(found, metric_units)
    title = "Targets" if identified else "Objective"
    return [("Parameters found", _parameters(found, units)), *([(title, results)] if results else [])]


def _parameters(found: Mapping[str, Any], units: Mapping[str, str]) -> str:
    deviations = (found.get("confidence") or {}).get("deviations") or {}
    known = any(value is not None for value in deviations.values())
    bounds = found.get("bounds") or {}
    rows = []
    for name, value in found["values"].items():
        numbers = (value, found["start"].get(name), *([deviations.get(name)] if known else []))
        *shown, unit = _in_unit(numbers, units.get(name, ""))
        end = {"low": "lowest allowed", "high": "highest allowed"}.get(bounds.get(name, ""), "")
        rows.append((name.replace("_", " "), [f"{shown[0]}\n{end}", *shown[1:], unit or NO_VALUE]))
    heads = [("parameter", ""), ("found", ""), ("start", ""), *([("±", "68 %")] if known else []), ("unit", "")]
    reasons = list(dict.fromkeys(((found.get("confidence") or {}).get("reasons") or {}).values()))
    note = f"No intervals of confidence: {'; '.join(reasons)}." if reasons and not known else ""
    return table(heads, rows, caption="Parameters found", note=note)


def _targets(found: Mapping[str, Any], metric_units: Mapping[str, str]) -> str:
    targets = found.get("targets") or []
    several = {key: len({one[key] for one in targets}) > 1 for key in ("path", "mode")}
    rows = []
    for one in targets:
        values = [one[key] for key in ("value", "reached", "start")]
        *shown, unit = _in_unit(values, metric_units.get(one["metric"], ""))
        where = ", ".join(one[key] for key in ("mode", "path") if several[key])
        name = metric_name(one["metric"]) + (f", {where}" if where else "")
        rows.append((name, [*shown, unit or NO_VALUE, _off(one["reached"], one["value"])]))
    heads = [("metric", ""), ("target", ""), ("reached", ""), ("start", ""), ("unit", ""), ("off by", "[%]")]
    return table(heads, rows, caption="Targets and what the design found reaches") if rows else ""


def _metrics(found: Mapping[str, Any], metric_units: Mapping[str, str]) -> str:
    start = found.get("start_metrics") or {}
    rows = []
    for name, value in (found.get("metrics") or {}).items():
        *shown, unit = _in_unit((value, start.get(name)), metric_units.get(name, ""))
        rows.append((metric_name(name), [*shown, unit or NO_VALUE, _off(value, start.get(name))]))
    heads = [("metric", ""), ("found", ""), ("start", ""), ("unit", ""), ("change", "[%]")]
    note = "" if found.get("holds_limits", True) else "The design found does not hold all limits."
    return table(heads, rows, caption="Metrics of the design found", note=note) if rows else ""


def _in_unit(values: Sequence[float | None], unit: str) -> list[str]:
    """Return numbers in a unit that suits all of them, and the unit."""
    name, factor = shown_unit(unit, np.array([np.nan if value is None else value for value in values]))
    return [*(number(value, factor) for value in values), name]


def _off(value: float | None, other: float | None) -> str:
    """Return the relative difference in per cent, with its sign."""
    if value is None or not other:
        return NO_VALUE
    share = 100.0 * (value - other) / abs(other)
    return ("+" if share > 0.0 else "") + number(share, beside=100.0)
