"""`paraflex kinematics` and `paraflex torques`: motions of a rigid mechanism that its drives determine."""

from collections.abc import Mapping
from dataclasses import fields
from typing import Any

import numpy as np
import xarray as xr

from paraflex.driven import flywheel, kinematics, torques
from paraflex.errors import AssemblyError, InputError, UnreachablePathError
from paraflex.figures.kinematics import kinematics_of, kinematics_tables
from paraflex.files import Model
from paraflex.files.fields import number_in
from paraflex.formatting import number, quantity
from paraflex.results import motion_dataset, motion_summary
from paraflex.results.kinematics import add_kinematics
from paraflex.results.loads import load_figures
from . import COMPLETE
from .commands.models import KinematicsRequest, TorquesRequest
from .commands.requests import flagged
from .ending import give_dataset
from .request import command_provenance, locating_errors, of_assembly, requested_model
from .run_lines import load_lines
from .tables import PlainConsole, print_tables

_EXAMPLES = {"rad": "90 deg", "m": "50 mm", "rad/s": "60 rpm", "m/s": "20 mm/s"}


def kinematics_command(request: KinematicsRequest) -> int:
    """Compute a driven motion, print it and, with --out, write files; return the exit code."""
    model = requested_model(request.model)
    give_dataset("motion", lambda: _data(model, request), _summary, _print, request.files)
    return COMPLETE


torques_command = kinematics_command


def _data(model: Model, request: KinematicsRequest) -> xr.Dataset:
    compute, fluctuation = (torques, request.fluctuation) if isinstance(request, TorquesRequest) else (kinematics, None)
    with flagged(request), locating_errors(model):
        try:
            motion = compute(
                model, request.drive, **_quantities(model, request), duration=request.duration,
                assembly=request.assembly or model.study.assembly, samples=request.samples,
            )  # fmt: skip
        except UnreachablePathError as error:
            raise InputError(error.problem, field="drive", remedy=error.remedy) from error
        except AssemblyError as error:
            raise of_assembly(error, model) from error
        wheel = None if fluctuation is None else flywheel(motion, fluctuation)
    given = {one.name: getattr(request, one.name) for one in fields(request) if one.name not in ("model", "files")}
    command = "torques" if isinstance(request, TorquesRequest) else "kinematics"
    parameters = command_provenance(model, {command: True} | {name: value for name, value in given.items() if value})
    data = motion_dataset(motion, parameters=parameters)
    if request.assemblies or wheel is not None:
        add_kinematics(data, motion, assemblies=request.assemblies, flywheel=wheel)
    return data


def _quantities(model: Model, request: KinematicsRequest) -> dict[str, float]:
    """Return start, end and speed of the drive in SI units; those of a joint that slides are lengths."""
    joint = next((one for one in model.mechanism.joints if one.name == request.drive), None)
    unit = "m" if joint is not None and joint.slides else "rad"
    texts = {"start": (request.start, unit), "end": (request.end, unit), "speed": (request.speed, f"{unit}/s")}
    found = {}
    for name, (text, wanted) in texts.items():
        if text is not None:
            try:
                found[name] = number_in(text, wanted)
            except InputError as error:
                if error.problem.startswith("not a number"):
                    remedy = f'write a number in {wanted}, or one with its unit, such as "{_EXAMPLES[wanted]}"'
                    raise InputError("not a quantity", field=name, value=text, remedy=remedy) from None
                raise error.at(name) from None
    return found


def _summary(data: xr.Dataset) -> dict[str, Any]:
    return {**motion_summary(data), "kinematics": kinematics_of(data)}


def _print(out: PlainConsole, data: xr.Dataset) -> None:
    found, count = kinematics_of(data), data.sizes["time"]
    freedoms, drive = found["degrees_of_freedom"], found["drive"]
    free = f"{freedoms} degree{'s' * (freedoms != 1)} of freedom"
    if drive is None:
        out.print_lines(
            f"{data.attrs['mechanism']}: {free}, {count} positions over {number(data['time'][-1].item())} s"
        )
    else:
        unit = drive["unit"]
        ends = " to ".join(quantity(drive[name], unit, digits=5) for name in ("start", "end"))
        turn = ", a whole turn" if drive["full_turn"] else ""
        speed = quantity(drive["speed"], f"{unit}/s", digits=5)
        out.print_lines(f"{data.attrs['mechanism']}: {free}; {drive['joint']} moves from {ends}{turn}, at {speed}; "
                        f"{count} positions")  # fmt: skip
        if None not in drive["reach"]:
            low, high = (quantity(value, unit, digits=7) for value in drive["reach"])
            out.print_lines(f"limits of reach of {drive['joint']}: {low} and {high}; the range ends beside them")
    print_tables(out, kinematics_tables(data))
    if np.isfinite(data["kinetic_energy"].values).any():
        loads = load_figures(data)
        out.print_lines(*load_lines({"": loads}), _shaking(loads["frame"]))
    wheel = found.get("flywheel")
    if wheel is not None:
        out.print_lines(
            f"flywheel for a fluctuation of {number(wheel['fluctuation'])}: {quantity(wheel['inertia'], 'kg m^2')} "
            f"(to {quantity(wheel['error'], 'kg m^2', digits=1)} by the samples), without the drive's own body; energy "
            f"exchanged {quantity(wheel['energy'], 'J')}, mean torque {quantity(wheel['mean_torque'], 'N m')}"
        )


def _shaking(frame: Mapping[str, float]) -> str:
    """Return a sentence on the largest force and moment on the ground."""
    parts = [f"{word} {quantity(frame[f'{name}_max'], unit)} at t = {number(frame[f'{name}_time'])} s"
             for word, name, unit in (("force", "force", "N"),
                                      ("moment about its origin", "moment", "N m"))]  # fmt: skip
    return f"on the ground: largest {' and '.join(parts)}"
