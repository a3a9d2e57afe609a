"""Tiles of an optimisation or identification in its report."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

from paraflex.figures.designs import column_label
from paraflex.figures.search import IDENTIFICATION
from paraflex.formatting import common_unit, number, quantity

# Largest number of tiles for metrics or parameters.
_MOST_TILES = 2


def search_tiles(found: Mapping[str, Any], units: Mapping[str, str]) -> list[tuple[str, str, str]]:
    """Return tiles of the minimised quantity, then of the identified parameters or of the metrics of the design.

    Parameters
    ----------
    found : mapping
        Content of `result.json`.
    units : mapping of str to str
        SI units of parameters and metrics.
    """
    identified = found["kind"] == IDENTIFICATION
    goal = "residual" if identified else "objective"
    tiles = [(goal, number(found.get(goal)), f"{number(found.get(f'start_{goal}'))} at the start")]
    now, before = ("values", "start") if identified else ("metrics", "start_metrics")
    old = found.get(before) or {}
    for name, value in list((found.get(now) or {}).items())[:_MOST_TILES]:
        unit = units.get(name, "")
        shown = common_unit(unit, (value, old.get(name)))
        label = name.replace("_", " ") if identified else column_label(name)
        start = number(old.get(name), factor=shown.factor)
        tiles.append((label, quantity(value, unit, shown, digits=4, padded=False), f"{start} at the start"))
    return tiles
