"""`paraflex statics`: static equilibria under loads and travel, applied in steps."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

import xarray as xr

from paraflex.cli import COMPLETE, FAILURE
from paraflex.cli.commands.models import StaticsRequest
from paraflex.cli.commands.requests import flagged
from paraflex.cli.dataset_command import DatasetCommand
from paraflex.cli.request import command_provenance, of_assembly, requested_model
from paraflex.cli.statics_tables import print_statics
from paraflex.equilibria import Statics, StaticsDefaults, statics
from paraflex.equilibria.conditions import coordinate_named
from paraflex.errors import AssemblyError, EquilibriumError, InputError, renamed
from paraflex.files import Model
from paraflex.files.fields import number_in
from paraflex.results.statics_data import statics_dataset, statics_summary

_NONE = "none"


def statics_command(request: StaticsRequest) -> int:
    """Compute the equilibria, print them and, with --out, write files; return the exit code."""
    model = requested_model(request.model)
    data = _COMMAND.run(request.files, lambda: _data(model, request))
    return COMPLETE if data["status"].item() == "complete" else FAILURE


_COMMAND = DatasetCommand("statics", statics_summary, print_statics)


def _data(model: Model, request: StaticsRequest) -> xr.Dataset:
    requested = _requested(model, request)
    return statics_dataset(_found(model, requested, request), parameters=_parameters(model, requested, request))


def _found(model: Model, requested: StaticsDefaults, request: StaticsRequest) -> Statics:
    """Return the equilibria, or those before the first that is not found."""
    with flagged(request, first=True):
        try:
            return statics(
                model, **vars(requested), warning=False,
                assembly=request.assembly or (None if model.start is not None else model.study.assembly),
            )  # fmt: skip
        except EquilibriumError as error:
            if error.partial is None:
                raise
            return error.partial
        except AssemblyError as error:
            raise of_assembly(error, model) from error


def _requested(model: Model, request: StaticsRequest) -> StaticsDefaults:
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
        requested = model.statics.filled(
            loads=loads or None, torques=torques or None, moved=moved or None, held=held, steps=request.steps,
            stiffness=request.stiffness, buckling=request.buckling,
        )  # fmt: skip
    effector = mechanism.end_effector
    if requested.stiffness is not None or requested.loads or requested.torques or requested.moved or effector is None:
        return requested
    # Without loads, torques or travel, the stiffness is that of the end-effector.
    return requested.filled(stiffness=tuple(f"{effector.point}.{axis}" for axis in effector.coordinates))


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


def _parameters(model: Model, requested: StaticsDefaults, request: StaticsRequest) -> dict[str, Any]:
    """Return the provenance of the equilibria."""
    given = {name: value for name, value in (vars(requested) | {"assembly": request.assembly}).items()
             if value is not None and value != {}}  # fmt: skip
    return command_provenance(model, {"statics": True} | given)
