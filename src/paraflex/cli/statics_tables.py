"""What `paraflex statics` prints: a table of steps, and what the last of them is."""

from __future__ import annotations

import math

import numpy as np
import xarray as xr
from rich.console import Console

from paraflex.cli.tables import number, plain_table, print_titled
from paraflex.results.statics_data import statics_summary, step_kinds
from paraflex.units import STRESS, DisplayUnit

# Rows of the table of steps, and coordinates in it; statics.nc has all.
_ROWS, _COLUMNS = 24, 2
_SHOWN = {"m": DisplayUnit("mm", 1e3), "N/m": DisplayUnit("N/mm", 1e-3), "m/N": DisplayUnit("mm/N", 1e3)}


def print_statics(out: Console, data: xr.Dataset) -> None:
    """All that is printed of equilibria."""
    summary = statics_summary(data)
    points = len(summary["limit_points"])
    also = f", {points} limit point{'s' * (points > 1)}" if points else ""
    out.print(f"{data.attrs['mechanism']}: {data.sizes['step']} equilibria{also}", soft_wrap=True)
    if data.sizes["step"] > 1:
        _print_steps(out, data)
    _print_last(out, data)
    for line in _lines(data, summary):
        out.print(line, soft_wrap=True)


def _print_steps(out: Console, data: xr.Dataset) -> None:
    """A row for each step, of many for some; of the coordinates that are moved or loaded the first."""
    given = [k for k, role in enumerate(data["role"].values) if role in ("moved", "loaded")][:_COLUMNS]
    heads, columns = ["given"], [[f"{x:.4g}" for x in data["fraction"].values]]
    for k in given:
        one = data.isel(named=k)
        name = str(one["named"].item())
        for quantity, unit in (("travel", one["unit"].item()), ("effort", one["effort_unit"].item()),
                               ("stiffness", stiffness_unit(one))):  # fmt: skip
            shown = _SHOWN.get(unit, DisplayUnit(unit, 1.0))
            values = one[quantity].values
            if np.isfinite(values).any():
                heads.append(f"{name if quantity == 'travel' else quantity_word(quantity, unit)}\n[{shown.name}]")
                columns.append([_four(shown.factor * x) for x in values])
    if data.sizes["frequency_number"]:
        heads.append("lowest\n[Hz]")
        columns.append([_four(x) for x in data["natural_frequency"].values[:, 0]])
    kinds = step_kinds(data)
    rows = range(data.sizes["step"])
    kept = [k for k in rows if k % math.ceil(len(rows) / _ROWS) == 0 or k == rows[-1] or kinds[k] == "limit point"]
    title = "Steps" if len(kept) == len(rows) else f"Steps ({len(kept)} of {len(rows)})"
    table = plain_table("", numbers=heads, rows=([kinds[k], *(column[k] for column in columns)] for k in kept))
    print_titled(out, title, table)


def _print_last(out: Console, data: xr.Dataset) -> None:
    """Every named coordinate at the last step."""
    last = data.isel(step=-1)
    rows = []
    for name in last["named"].values:
        one = last.sel(named=name)
        row = [str(name), str(one["role"].item())]
        for quantity, unit in (("travel", one["unit"].item()), ("effort", one["effort_unit"].item()),
                               ("stiffness", stiffness_unit(one)), ("compliance", _inverse(stiffness_unit(one)))
                               ):  # fmt: skip
            shown, value = _SHOWN.get(unit, DisplayUnit(unit, 1.0)), float(one[quantity].item())
            row.append("" if math.isnan(value) else f"{_four(shown.factor * value)} {shown.name}")
        rows.append(row)
    if rows:
        title = "At the last step" if data.sizes["step"] > 1 else "At rest"
        table = plain_table("coordinate", "", numbers=("travel", "force", "stiffness", "compliance"), rows=rows)
        print_titled(out, title, table)


def _lines(data: xr.Dataset, summary: dict) -> list[str]:
    lines = []
    last = data.isel(step=-1)
    frequencies = [x for x in last["natural_frequency"].values if np.isfinite(x)]
    if frequencies:
        lines.append("frequencies: " + ", ".join(_four(x) for x in frequencies) + " Hz, what is held and moved kept")
    factors = data["buckling_factor"].values
    if factors.size and np.isfinite(factors[0, 0]) and (data["role"] == "loaded").any():
        seen = [f"{factors[0, 0]:.4g} of what is given, as seen from the start"]
        if data.sizes["step"] > 1 and np.isfinite(factors[-1, 0]):
            seen.append(f"{factors[-1, 0]:.4g} as seen from the last step")
        lines.append("buckling at " + ", ".join(seen))
    if "stress_max" in data and np.nanmax(data["stress_max"].values, initial=0.0) > 0.0:
        body = int(np.nanargmax(data["stress_max"].values))
        one = data.isel(body=body)
        safety = float(one["safety_factor"])
        also = "" if math.isnan(safety) else f"; safety factor {safety:.3g}"
        lines.append(
            f"largest stress {STRESS.factor * float(one['stress_max']):.4g} {STRESS.name} in {one['body'].item()} at "
            f"{float(one['stress_place']):.3g} m, step {int(one['stress_step'])}{also}"
        )
    if data.sizes["step"] > 1 and summary["validity"] is not None and summary["validity"]["holds"]:
        lines.append(f"validity: {summary['validity']['verdict']}")
    if summary["status"] != "complete":
        lines.append(f"error: {summary['message']}")
    return lines


def stiffness_unit(one: xr.Dataset) -> str:
    """Unit of the stiffness of a named coordinate."""
    return "N/m" if one["unit"].item() == "m" else "N m/rad"


def _inverse(unit: str) -> str:
    return "m/N" if unit == "N/m" else "rad/(N m)"


def quantity_word(quantity: str, unit: str) -> str:
    """Heading of a column."""
    return quantity if quantity == "stiffness" else "force" if unit == "N" else "torque"


def _four(value: float) -> str:
    """Four digits; rounding of what is none is zero."""
    return "rigid" if math.isinf(value) else number(0.0 if abs(value) < 1e-12 else value, ".4g")
