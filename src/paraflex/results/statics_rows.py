"""Equilibria as rows of text, for the tables of the command line and of report pages."""

from __future__ import annotations

import math
from collections.abc import Iterator
from typing import NamedTuple

import numpy as np
import xarray as xr

from paraflex.arrays import Array
from paraflex.results.statics_data import NAMED_UNITS, step_kinds
from paraflex.units import DisplayUnit

# Largest numbers of rows and of coordinates in the table of steps; statics.nc has all.
_ROWS, _COLUMNS = 24, 2
_SHOWN = {"m": DisplayUnit("mm", 1e3), "N/m": DisplayUnit("N/mm", 1e-3), "m/N": DisplayUnit("mm/N", 1e3)}
GIVEN = ("moved", "loaded")
# Stress up to which a beam counts as unstressed [Pa].
_NO_STRESS = 1.0
# Ratio of stiffnesses above which they are drawn on a logarithmic axis.
_SPREAD = 30.0
# Relative difference below which buckling factors are equal.
_SAME = 0.01
# Quantities of a coordinate in the tables.
_LAST = ("travel", "effort", "stiffness", "compliance")


class StepTable(NamedTuple):
    """Table of steps as text: heads and units of columns, rows that begin with the kind of step, number of steps."""

    heads: list[tuple[str, str]]
    rows: list[list[str]]
    steps: int

    @property
    def title(self) -> str:
        """Heading of the table, with the numbers of rows and steps if rows are left out."""
        return "Steps" if len(self.rows) == self.steps else f"Steps ({len(self.rows)} of {self.steps})"


def step_table(data: xr.Dataset) -> StepTable:
    """Return the table of steps, thinned out if there are many, with the first coordinates that are moved or loaded."""
    heads, columns = [("given", "")], [[f"{x:.4g}" for x in data["fraction"].values]]
    for k in given_coordinates(data)[:_COLUMNS]:
        one = data.isel(named=k)
        for quantity in _LAST[:3]:
            shown, values = shown_unit(unit_of(one, quantity)), one[quantity].values
            if np.isfinite(values).any():
                name = str(one["named"].item()) if quantity == "travel" else quantity_word(one, quantity)
                heads.append((name, shown.name))
                columns.append([four_digits(shown.factor * x) for x in values])
    if word := lowest_frequencies(data).get("natural_frequency"):
        heads.append((word, "Hz"))
        columns.append([four_digits(x) for x in data["natural_frequency"].values[:, 0]])
    kinds = step_kinds(data)
    steps = range(data.sizes["step"])
    every = math.ceil(len(steps) / _ROWS)
    kept = [k for k in steps if k % every == 0 or k == steps[-1] or kinds[k] == "limit point"]
    return StepTable(heads, [[kinds[k], *(column[k] for column in columns)] for k in kept], len(steps))


def lowest_frequencies(data: xr.Dataset) -> dict[str, str]:
    """Return variables of natural frequencies and labels: "held" and "free" if a coordinate is moved, else "lowest"."""
    words = {"natural_frequency": "held", "free_frequency": "free"}
    words = words if (data["role"] == "moved").any() else {"natural_frequency": "lowest"}
    return {name: word for name, word in words.items() if name in data and np.isfinite(data[name].values[:, :1]).any()}


def last_rows(data: xr.Dataset) -> Iterator[list[str]]:
    """Yield a row for every named coordinate at the last step: name, role, travel, effort, stiffness, compliance."""
    last = data.isel(step=-1)
    for name in last["named"].values:
        one = last.sel(named=name)
        yield [str(name), str(one["role"].item()), *(_quantity(one, quantity) for quantity in _LAST)]


def buckling_words(data: xr.Dataset) -> str:
    """Return a text on the buckling factors as seen from the start and from the last step; empty if none is known.

    Without loads, a factor of the travel is reported only if the travel reaches it: a travel has no safety margin.
    """
    factors = data["buckling_factor"].values
    loaded = bool((data["role"] == "loaded").any())
    if not (factors.size and np.isfinite(factors[0, 0]) and (loaded or factors[0, 0] <= 1.0)):
        return ""
    higher = " and ".join(f"{each:.4g}" for each in factors[0, 1:] if np.isfinite(each))
    seen = [f"load factor {factors[0, 0]:.4g} as seen from the start" + (f" (next {higher})" if higher else "")]
    if data.sizes["step"] > 1 and np.isfinite(factors[-1, 0]):
        seen.append(f"{factors[-1, 0]:.4g} as seen from the last step")
        if abs(factors[-1, 0] / factors[0, 0] - 1.0) > _SAME:
            seen[-1] += ": linear estimates, which change along the branch"
    return ", ".join(seen)


def no_buckling(data: xr.Dataset) -> str:
    """Return the reason why no buckling factor is known at the start; empty if one is known, or nothing buckles."""
    reason = str(data["buckling_note"].values[0]) if "buckling_note" in data else ""
    return f"no factor of buckling: {reason}" if reason and (data["role"] == "loaded").any() else ""


def is_stressed(data: xr.Dataset) -> bool:
    """Check whether beams have stresses above rounding."""
    return "stress_max" in data and float(np.nanmax(data["stress_max"].values, initial=0.0)) > _NO_STRESS


def given_coordinates(data: xr.Dataset) -> list[int]:
    """Return the indices of the coordinates that are moved or loaded."""
    return [k for k, role in enumerate(data["role"].values) if role in GIVEN]


def is_wide(values: Array) -> bool:
    """Check whether stiffnesses differ so much that their axis should be logarithmic."""
    known = values[np.isfinite(values)]
    return bool(known.size and known.min() > 0.0 and known.max() > _SPREAD * known.min())


def unit_of(one: xr.Dataset, quantity: str) -> str:
    """Return the SI unit of a quantity of a named coordinate."""
    return NAMED_UNITS[quantity][one["unit"].item() == "rad"]


def shown_unit(unit: str) -> DisplayUnit:
    """Return the unit in which tables print a quantity of an SI unit."""
    return _SHOWN.get(unit, DisplayUnit(unit, 1.0))


def quantity_word(one: xr.Dataset, quantity: str) -> str:
    """Return the heading of a quantity's column."""
    return quantity if quantity != "effort" else "force" if one["unit"].item() == "m" else "torque"


def four_digits(value: float) -> str:
    """Format a number to four digits, or all integer digits below a million; "rigid" if infinite, 0 within rounding."""
    if math.isinf(value):
        return "rigid"
    return f"{value:.0f}" if 1e4 <= abs(value) < 1e6 else f"{0.0 if abs(value) < 1e-12 else value:.4g}"


def _quantity(one: xr.Dataset, quantity: str) -> str:
    shown, value = shown_unit(unit_of(one, quantity)), float(one[quantity].item())
    if math.isinf(value):
        return "rigid" if quantity == "stiffness" else "free"
    return "" if math.isnan(value) else f"{four_digits(shown.factor * value)} {shown.name}"
