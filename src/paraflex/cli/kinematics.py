"""`paraflex kinematics` and `paraflex torques`: motions of a rigid mechanism that its drives determine."""

from collections.abc import Mapping
from dataclasses import fields
from typing import Any

import numpy as np
import xarray as xr

from paraflex.driven import flywheel, kinematics, torques
from paraflex.errors import ActuationError, AssemblyError, InputError, UnreachablePathError, renamed
from paraflex.figures.kinematics import cycle_note, kinematics_of, kinematics_tables
from paraflex.files import Model, load_path
from paraflex.files.fields import number_in
from paraflex.formatting import number, quantity
from paraflex.results import motion_dataset, motion_summary
from paraflex.results.kinematics import add_kinematics
from paraflex.results.loads import load_figures
from . import COMPLETE
from .commands.models import KinematicsRequest, TorquesRequest
from .commands.requests import flagged, flags
from .ending import give_dataset
from .request import command_provenance, locating_errors, of_assembly, requested_model, without_model
from .run_lines import load_lines
from .tables import PlainConsole, print_tables


def kinematics_command(request: KinematicsRequest) -> int:
    """Compute a driven motion, print it and, with --out, write files; return the exit code."""
    if request.model.given is None:
        return without_model("torques" if isinstance(request, TorquesRequest) else "kinematics")
    model = requested_model(request.model)
    give_dataset(
        "motion", lambda: _data(model, request),
        lambda data: {**motion_summary(data), "kinematics": kinematics_of(data)}, _print, request.files,
    )  # fmt: skip
    return COMPLETE


torques_command = kinematics_command


def _data(model: Model, request: KinematicsRequest) -> xr.Dataset:
    asked, compute, fluctuation = _asked(model, request), kinematics, None
    if isinstance(request, TorquesRequest):
        asked["mode"], compute, fluctuation = request.mode, torques, request.fluctuation
    assembly = request.assembly or model.study.assembly
    with flagged(request), locating_errors(model), renamed("drive", only="held"):
        try:
            motion = compute(model, **asked, duration=request.duration, assembly=assembly, samples=request.samples)
        except UnreachablePathError as error:
            follows = request.path or (not request.drive and model.paths)
            field = f"path.{request.path or model.path_name()}" if follows else "drive"
            raise InputError(error.problem, field=field, remedy=error.remedy) from error
        except AssemblyError as error:
            raise of_assembly(error, model).at(f"assembly.{model.mechanism.assembly(assembly).name}") from error
        except ActuationError as error:
            raise InputError(error.problem, field="mode", remedy=error.remedy) from error
        wheel = None if fluctuation is None else flywheel(motion, fluctuation)
    given = {one.name: getattr(request, one.name) for one in fields(request) if one.name not in ("model", "files")}
    command = "torques" if isinstance(request, TorquesRequest) else "kinematics"
    parameters = command_provenance(model, {command: True} | {name: value for name, value in given.items() if value})
    data = motion_dataset(motion, parameters=parameters)
    if request.assemblies or wheel is not None:
        add_kinematics(data, motion, assemblies=request.assemblies, flywheel=wheel)
    return data


def _asked(model: Model, request: KinematicsRequest) -> dict[str, Any]:
    """Return drive, held joints, path, and start, end and speed of the drive, in SI units."""
    slides = {one.name: one.slides for one in model.mechanism.joints}
    moving = [text for text in request.drive if "=" not in text or text in slides]
    for text in moving:
        if len(names := [part.strip() for part in text.split(",")]) > 1 and slides.keys() >= set(names):
            raise InputError("several joints", field="--drive", value=text, remedy="give one --drive for each of them")
    if len(moving) > 1:
        twice = len(set(moving)) < len(moving)
        raise InputError(
            "names a joint twice" if twice else "two joints move", field="--drive", value=", ".join(moving),
            remedy="leave one out" if twice
            else f'hold the others, or give their ends: --drive "{moving[1]}=VALUE" or "{moving[1]}=FIRST:LAST"',
        )  # fmt: skip
    drive, held = next(iter(moving), None), dict[str, Any]()
    for text in request.drive:
        joint, _, value = (part.strip() for part in text.rpartition("="))
        if text not in moving:
            if joint in (*held, drive):
                raise InputError("names a joint twice", field="--drive", value=text, remedy="leave one out")
            if not value:
                raise InputError("has no value", field="--drive", value=text, remedy='write one such as "JOINT=30 deg"')
            held[joint] = _ends(joint, value, "m" if slides.get(joint) else "rad")
    ends = dict[str, Any]()
    if drive is None and request.start is None and request.end is None:
        # Without a joint that moves alone, the first with two values is the drive.
        drive = next((joint for joint, one in held.items() if isinstance(one, tuple)), None)
        ends = {} if drive is None else dict(zip(("start", "end"), held.pop(drive), strict=True))
    unit = "m" if slides.get(drive or "", False) else "rad"
    texts = {"start": (request.start, unit), "end": (request.end, unit), "speed": (request.speed, f"{unit}/s")}
    flag, path = flags(request), request.path
    found = {name: _number(text, wanted, flag[name]) for name, (text, wanted) in texts.items() if text is not None}
    of_file = path is not None and path not in model.paths and path.endswith(".toml")
    asked: dict[str, Any] = {"drive": drive, "held": held, "path": load_path(path) if of_file and path else path}
    return asked | ends | found


def _ends(joint: str, text: str, unit: str) -> float | tuple[float, ...]:
    """Return the value at which a joint is held, or the first and last one of a joint that moves."""
    try:
        found = tuple(_number(each, unit, "--drive") for each in text.split(":", 1))
    except InputError as error:
        raise error.advising(
            f'{error.remedy}; a joint that moves has two, "{joint}=FIRST:LAST", and the drive a --speed'
        ) from None
    return found if ":" in text else found[0]


def _number(text: str, unit: str, field: str) -> float:
    with renamed(field):
        return number_in(text, unit)


def _print(out: PlainConsole, data: xr.Dataset) -> None:
    found, count = kinematics_of(data), data.sizes["time"]
    freedoms, drive = found["degrees_of_freedom"], found["drive"]
    free = f"{freedoms} degree{'s' * (freedoms != 1)} of freedom"
    if drive is None:
        way = f"along path {found['path']}, " if found["path"] else ""
        acting = f" by mode {found['mode']}" if found["mode"] else ""
        over = f"{count} positions over {number(data['time'][-1].item())} s"
        out.print_lines(f"{data.attrs['mechanism']}: {free}; {way}{over}{acting}")
    else:
        unit = drive["unit"]
        ends = " to ".join(quantity(drive[name], unit, digits=5) for name in ("start", "end"))
        turn = ", a whole turn" if drive["full_turn"] else ""
        speed = quantity(drive["speed"], f"{unit}/s", digits=5)
        out.print_lines(f"{data.attrs['mechanism']}: {free}; {drive['joint']} moves from {ends}{turn}, at {speed}; "
                        f"{count} positions")  # fmt: skip
        for joint, value in drive["held"].items():
            ends = [quantity(one, found["joint_units"][joint], digits=5) for one in np.atleast_1d(value)]
            moves = f"moves from {' to '.join(ends)} in the same time" if len(ends) > 1 else f"is held at {ends[0]}"
            out.print_lines(f"{joint} {moves}")
        if None not in drive["reach"]:
            low, high = (quantity(value, unit, digits=7) for value in drive["reach"])
            out.print_lines(f"limits of reach of {drive['joint']}: {low} and {high}; the range ends beside them")
    out.print_lines(cycle_note(found))
    print_tables(out, kinematics_tables(data))
    if np.isfinite(data["kinetic_energy"].values).any():
        loads = load_figures(data)
        # Drives of the command have no table of the model.
        named = {} if drive is None else {drive["name"]: drive["joint"], **{joint: joint for joint in drive["held"]}}
        named = {name: f"drive {joint}" for name, joint in named.items()}
        if found["path"]:
            loads["drives"], named = loads["motors"], {name: f"motor {name}" for name in loads["motors"]}
        lines = load_lines({"": loads})
        for name, text in named.items():
            lines = [line.replace(f"prescribed.{name}:", f"{text}:") for line in lines]
        out.print_lines(*lines, _shaking(loads["frame"]))
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
