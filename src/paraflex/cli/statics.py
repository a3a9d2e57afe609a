"""`paraflex statics`: static equilibria under loads and travel, applied in steps."""

import math
from collections.abc import Callable, Sequence
from functools import partial

import numpy as np
import xarray as xr

from paraflex.designs.measure import metric_figures, metrics_of
from paraflex.equilibria import StaticsDefaults, statics
from paraflex.equilibria.conditions import coordinate_named
from paraflex.errors import AssemblyError, EquilibriumError, InputError, renamed
from paraflex.figures import equilibria
from paraflex.files import Model
from paraflex.files.fields import number_in
from paraflex.formatting import number, quantity
from paraflex.results.metrics import STATICS, keep_metrics
from paraflex.results.statics_data import statics_dataset, statics_summary
from . import COMPLETE, FAILURE
from .commands.models import StaticsRequest
from .commands.requests import flagged
from .ending import give_dataset
from .request import command_provenance, of_assembly, requested_model
from .run_lines import metric_lines
from .tables import PlainConsole, print_tables


def statics_command(request: StaticsRequest) -> int:
    """Compute the equilibria, print them and, with --out, write files; return the exit code."""
    model = requested_model(request.model)
    data = give_dataset("statics", lambda: _data(model, request), statics_summary, _print_statics, request.files)
    return COMPLETE if data["status"].item() == "complete" else FAILURE


def _data(model: Model, request: StaticsRequest) -> xr.Dataset:
    """Return the equilibria, or those before the first that is not found."""
    requested = _requested(model, request)
    with flagged(request, first=True):
        metrics_of(request.metrics, model.study.error, runs=STATICS)
        try:
            found = statics(
                model, **vars(requested), warning=False,
                assembly=request.assembly or (None if model.start is not None else model.study.assembly),
            )  # fmt: skip
        except EquilibriumError as error:
            if error.partial is None:
                raise
            found = error.partial
        except AssemblyError as error:
            raise of_assembly(error, model) from error
        figures = metric_figures(found, request.metrics)
    given = vars(requested) | {"metrics": request.metrics or None, "assembly": request.assembly}
    given = {name: value for name, value in given.items() if value is not None and value != {}}
    data = statics_dataset(found, parameters=command_provenance(model, {"statics": True} | given))
    if figures:
        keep_metrics(data, {"": figures})
    return data


def _requested(model: Model, request: StaticsRequest) -> StaticsDefaults:
    """Return the arguments of `statics`: loads, torques and travel of the options if any is given, else the model's.

    All other arguments that are not given are the model's as well.
    """
    mechanism, coordinate = model.mechanism, partial(coordinate_named, model.mechanism)
    units = dict(zip([motor.name for motor in mechanism.motors], mechanism.motor_units(), strict=True))
    with flagged(request, first=True):
        loads = _quantities(request.loads, "--load", lambda name: coordinate(name, f"loads.{name}").effort_unit)
        moved = _quantities(request.moved, "--move", lambda name: coordinate(name, f"moved.{name}").unit)
        torques = _quantities(request.torques, "--torque", lambda name: units.get(name, "N m"))
        held = () if request.held == ["none"] else request.held
        requested = model.statics.filled(
            loads=loads or None, torques=torques or None, moved=moved or None, held=held, steps=request.steps,
            stiffness=request.stiffness, buckling=request.buckling,
        )  # fmt: skip
    effector = mechanism.end_effector
    if requested.stiffness is not None or requested.loads or requested.torques or requested.moved or effector is None:
        return requested
    # Without loads, torques or travel, the stiffness is that of the end-effector.
    return requested.filled(stiffness=tuple(f"{effector.point}.{axis}" for axis in effector.coordinates))


def _quantities(given: Sequence[str], flag: str, unit_of: Callable[[str], str]) -> dict[str, float]:
    """Return values by name, each in its SI unit; raise InputError if a name is given twice."""
    texts: dict[str, str] = {}
    for text in given:
        name, equals, value = (part.strip() for part in text.partition("="))
        if not (name and equals and value):
            raise InputError("not NAME=VALUE", field=flag, value=text, remedy=f'write {flag} "stage.T.x=1"')
        if name in texts:
            raise InputError("given twice", field=flag, value=name, remedy="leave one of them out")
        texts[name] = value
    values = {}
    for name, text in texts.items():
        unit = unit_of(name)
        with renamed(f"{flag} {name}"):
            values[name] = number_in(text, unit)
    return values


def _print_statics(out: PlainConsole, data: xr.Dataset) -> None:
    """Print equilibria: a table of steps, details of the last one, then frequencies, buckling, stress and validity."""
    summary = statics_summary(data)
    points = len(summary["limit_points"])
    also = f", {points} limit point{'s' * (points > 1)}" if points else ""
    out.print_lines(f"{data.attrs['mechanism']}: {data.sizes['step']} equilibria{also}")
    steps = [equilibria.step_table(data)] if data.sizes["step"] > 1 else []
    print_tables(out, [*steps, *equilibria.last_tables(data)])
    out.print_lines(*_lines(data, summary))


def _lines(data: xr.Dataset, summary: dict) -> list[str]:
    lines = []
    last = data.isel(step=-1)
    for name, word in equilibria.lowest_frequencies(data).items():
        kept = "moved coordinates released" if word == "free" else "held and moved coordinates fixed"
        values = last[name].values[np.isfinite(last[name].values)]
        kept += ", 0 for growing motions" if np.any(values == 0.0) else ""
        lines.append(f"{'free ' if word == 'free' else ''}frequencies: {', '.join(map(number, values))} Hz, {kept}")
    if words := equilibria.buckling_words(data):
        lines.append(f"buckling at {words}")
    elif words := equilibria.no_buckling(data):
        lines.append(words)
    if equilibria.is_stressed(data):
        body = int(np.nanargmax(data["stress_max"].values))
        one = data.isel(body=body)
        safety = float(one["safety_factor"])
        also = "" if math.isnan(safety) else f"; safety factor {number(safety, 3)}"
        lines.append(
            f"largest stress {quantity(float(one['stress_max']), 'Pa', digits=4)} in {one['body'].item()} at "
            f"{quantity(float(one['stress_place']), 'm')}, step {int(one['stress_step'])}{also}"
        )
    if data.sizes["step"] > 1 and summary["validity"] is not None and summary["validity"]["holds"]:
        lines.append(f"validity: {summary['validity']['verdict']}")
    lines += metric_lines({"": summary})
    if summary["status"] != "complete":
        lines.append(f"error: {summary['message']}")
    return lines
