"""`paraflex statics`: static equilibria under loads and travel, applied in steps."""

from __future__ import annotations

import math
from collections.abc import Sequence
from typing import Any

import numpy as np
import xarray as xr
from rich.console import Console

from paraflex.cli import COMPLETE, TROUBLE
from paraflex.cli.commands.models import StaticsRequest
from paraflex.cli.commands.requests import flagged
from paraflex.cli.dataset_command import DatasetCommand
from paraflex.cli.request import asked_model, asked_of, of_assembly
from paraflex.cli.tables import plain_table, print_titled
from paraflex.equilibria import Statics, StaticsDefaults, statics
from paraflex.equilibria.given import coordinate_named
from paraflex.errors import AssemblyError, EquilibriumError, InputError, renamed
from paraflex.files import Model
from paraflex.files.fields import number_in
from paraflex.results.statics_data import statics_dataset, statics_summary
from paraflex.results.statics_rows import (
    buckling_words,
    four_digits,
    is_stressed,
    last_rows,
    lowest_frequencies,
    no_buckling,
    step_table,
)
from paraflex.units import STRESS

_NONE = "none"


def statics_command(request: StaticsRequest) -> int:
    """Compute the equilibria, print them and, with --out, write files; return the exit code."""
    model = asked_model(request.model)
    data = _COMMAND.run(request.files, lambda: _data(model, request))
    return COMPLETE if data["status"].item() == "complete" else TROUBLE


def _data(model: Model, request: StaticsRequest) -> xr.Dataset:
    asked = _asked(model, request)
    return statics_dataset(_found(model, asked, request), parameters=_parameters(model, asked, request))


def _found(model: Model, asked: StaticsDefaults, request: StaticsRequest) -> Statics:
    """Return the equilibria, or those before the first that is not found."""
    with flagged(request, first=True):
        try:
            return statics(
                model, **vars(asked), warning=False,
                assembly=request.assembly or (None if model.start is not None else model.study.assembly),
            )  # fmt: skip
        except EquilibriumError as error:
            if error.partial is None:
                raise
            return error.partial
        except AssemblyError as error:
            raise of_assembly(error, model) from error


def _asked(model: Model, request: StaticsRequest) -> StaticsDefaults:
    """Return the arguments of `statics`: loads, torques and travel of the options if any is given, else the model's.

    All other arguments that are not given are the model's as well.
    """
    mechanism = model.mechanism
    units = dict(zip([motor.name for motor in mechanism.motors], mechanism.motor_units(), strict=True))
    with flagged(request, first=True):
        loads, moved = (
            {name: _in_unit(text, getattr(coordinate_named(mechanism, name, f"{field}.{name}"), unit), f"{flag} {name}")
             for name, text in _pairs(getattr(request, field), flag).items()}
            for field, flag, unit in (("loads", "--load", "effort_unit"), ("moved", "--move", "unit"))
        )  # fmt: skip
        torques = {
            name: _in_unit(text, units.get(name, "N m"), f"--torque {name}")
            for name, text in _pairs(request.torques, "--torque").items()
        }
        held = () if request.held == [_NONE] else request.held
        asked = model.statics.filled(
            loads=loads or None, torques=torques or None, moved=moved or None, held=held, steps=request.steps,
            stiffness=request.stiffness, buckling=request.buckling,
        )  # fmt: skip
    effector = mechanism.end_effector
    if asked.stiffness is not None or asked.loads or asked.torques or asked.moved or effector is None:
        return asked
    # Without loads, torques or travel, the stiffness is that of the end-effector.
    return asked.filled(stiffness=tuple(f"{effector.point}.{axis}" for axis in effector.coordinates))


def _pairs(given: Sequence[str], flag: str) -> dict[str, str]:
    """Return values by name; raise InputError if a name is given twice."""
    found: dict[str, str] = {}
    for text in given:
        name, equals, value = (part.strip() for part in text.partition("="))
        if not (name and equals and value):
            raise InputError("not NAME=VALUE", field=flag, value=text, remedy=f'write {flag} "stage.T.x=1"')
        if name in found:
            raise InputError("given twice", field=flag, value=name, remedy="leave one of them out")
        found[name] = value
    return found


def _in_unit(text: str, unit: str, field: str) -> float:
    with renamed(field):
        return number_in(text, unit)


def _parameters(model: Model, asked: StaticsDefaults, request: StaticsRequest) -> dict[str, Any]:
    """Return the provenance of the equilibria."""
    given = {name: value for name, value in (vars(asked) | {"assembly": request.assembly}).items()
             if value is not None and value != {}}  # fmt: skip
    return asked_of(model, {"statics": True} | given)


def print_statics(out: Console, data: xr.Dataset) -> None:
    """Print equilibria: a table of steps, details of the last one, then frequencies, buckling, stress and validity."""
    summary = statics_summary(data)
    points = len(summary["limit_points"])
    also = f", {points} limit point{'s' * (points > 1)}" if points else ""
    out.print(f"{data.attrs['mechanism']}: {data.sizes['step']} equilibria{also}", soft_wrap=True)
    if data.sizes["step"] > 1:
        found = step_table(data)
        heads = [f"{name}\n[{unit}]" if unit else name for name, unit in found.heads]
        print_titled(out, found.title, plain_table("", numbers=heads, rows=found.rows))
    if rows := list(last_rows(data)):
        title = "At the last step" if data.sizes["step"] > 1 else "At rest"
        numbers = ("travel", "force", "stiffness", "compliance")
        print_titled(out, title, plain_table("coordinate", "", numbers=numbers, rows=rows))
    for line in _lines(data, summary):
        out.print(line, soft_wrap=True)


def _lines(data: xr.Dataset, summary: dict) -> list[str]:
    lines = []
    last = data.isel(step=-1)
    for name, word in lowest_frequencies(data).items():
        kept = "moved coordinates released" if word == "free" else "held and moved coordinates fixed"
        values = last[name].values[np.isfinite(last[name].values)]
        known = ", ".join(map(four_digits, values))
        kept += ", 0 for growing motions" if np.any(values == 0.0) else ""
        lines.append(f"{'free ' if word == 'free' else ''}frequencies: {known} Hz, {kept}")
    if words := buckling_words(data):
        lines.append(f"buckling at {words}")
    elif words := no_buckling(data):
        lines.append(words)
    if is_stressed(data):
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


_COMMAND = DatasetCommand("statics", statics_summary, print_statics)
