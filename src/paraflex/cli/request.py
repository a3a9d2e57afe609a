"""What commands that simulate a study have in common: which path, which modes, the plan, where results go."""

from __future__ import annotations

import json
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

from paraflex.errors import AssemblyError, InputError, OutputError, UnreachablePathError
from paraflex.files import Model, load_path
from paraflex.kinematics import Path as EndEffectorPath
from paraflex.mechanism import ActuationMode, Mechanism, parse_mode
from paraflex.simulate import TrackingTask, plan_tracking
from paraflex.validity import to_blame

COMPLETE, TROUBLE, INTERRUPTED = 0, 1, 130


@dataclass(frozen=True)
class StudyRequest:
    """What was asked for on the command line; None takes the model's or the library's default."""

    mechanism: str
    path: str | None
    modes: list[str]
    duration: float | None
    samples: int | None
    assembly: str | None
    out: str
    json: bool
    balanced: bool = field(default=False, kw_only=True)
    after: str | None = field(default=None, kw_only=True)
    report: bool = field(default=True, kw_only=True)


def with_frames(mechanism: Mechanism, reference: str | None, curvature: str | None) -> Mechanism:
    """The mechanism with all beams in the frames and of the curvature asked for; None leaves them as they are."""
    try:
        return mechanism.with_beams(reference=reference, curvature=curvature)
    except InputError as error:
        flag = f"--{error.field.rpartition('.')[2]}"
        raise InputError(error.problem, field=flag, value=error.value, remedy=error.remedy) from None


def find_path(model: Model, name: str | None) -> tuple[EndEffectorPath, str]:
    """A path of the model or of a file, and its name."""
    if name is not None and name not in model.paths and name.endswith(".toml"):
        return load_path(name), name
    path = model.path(name)
    return path, next(key for key, value in model.paths.items() if value is path)


def find_modes(model: Model, names: list[str]) -> list[ActuationMode]:
    """The modes asked for, or the study's."""
    wanted = names or list(model.study.modes) or [mode.name for mode in model.mechanism.modes]
    if not wanted:
        raise InputError(
            "no actuation mode to run",
            field="--mode",
            remedy="name one (paraflex modes lists what there is), or add [study] modes to the file",
        )
    try:
        return list(dict.fromkeys(parse_mode(model.mechanism, name) for name in wanted))
    except InputError as error:
        raise InputError(error.problem, field="--mode", value=error.value, remedy=error.remedy) from None


def plan_study(
    model: Model, mechanism: Mechanism, path: EndEffectorPath, path_name: str, request: StudyRequest
) -> TrackingTask:
    """The study, planned; errors name the option or the field at fault."""
    if model.start is not None:
        raise InputError(
            "a path says where and how the mechanism starts", field="start", source=model.source,
            remedy="drop the [start] table, or run without a path",
        )  # fmt: skip
    duration, samples = request.duration, request.samples
    if duration is None:
        duration = model.duration(path_name, path)
    try:
        return plan_tracking(
            mechanism,
            path,
            duration=duration,
            samples=model.study.samples if samples is None else samples,
            assembly=request.assembly or model.study.assembly,
            orientation=model.study.orientation,
            after=model.study.after if request.after is None else request.after,
            warning=False,
        )
    except AssemblyError as error:
        if not isinstance(error, UnreachablePathError):
            raise of_assembly(error, model) from error
        raise InputError(error.problem, field=f"path.{path_name}", remedy=error.remedy, source=model.source) from error
    except InputError as error:
        raise at_fault(error, model) from None


# What to do about a start for which no equilibrium is found.
UNBALANCED = "make links and springs stiff enough for weight and loads, or leave it out"


def of_assembly(error: AssemblyError, model: Model) -> InputError:
    """The error of a mechanism that cannot be put together, naming the model's file."""
    # Links that are far too soft bend where the loops are to close, instead of moving.
    remedy = to_blame(model.mechanism) or error.remedy
    return InputError(error.problem, field="assembly", remedy=remedy, source=model.source)


def at_fault(error: InputError, model: Model) -> InputError:
    """The same error, naming the option it came from or else the model's file."""
    flags = {
        "duration": "--duration",
        "samples": "--samples",
        "assembly": "--assembly",
        "after": "--after",
        "events": "--stop-at",
    }
    if error.field in flags:
        return InputError(error.problem, field=flags[error.field], value=error.value, remedy=error.remedy)
    return error.in_file(model.source)


def results_folder(out: str) -> Path:
    """The results folder, proved writable; nothing is left of the proof until there are results."""
    folder = Path(out)
    made = [parent for parent in (folder, *folder.parents) if not parent.exists()]
    try:
        folder.mkdir(parents=True, exist_ok=True)
        probe = folder / ".paraflex-writable"
        probe.touch()
        probe.unlink()
    except OSError as error:
        raise OutputError(
            f"cannot be written ({(error.strerror or str(error)).lower()})",
            field="--out",
            value=out,
            remedy="choose another folder",
        ) from error
    finally:
        for parent in made:
            if parent.is_dir() and not any(parent.iterdir()):
                parent.rmdir()
    return folder


def report_too(request: StudyRequest) -> str:
    """How the last line of a command goes on where it has written a report."""
    return " and report.html" if request.report else ""


def study_folder(study: str, output: str | None) -> Path:
    """Where results of a study file go: where it is said, else results/ and the file's name."""
    return Path("results") / Path(study).stem if output is None else Path(output)


def write_json(figures: Any, file: Path) -> None:
    """Write a file of numbers; it appears whole or not at all."""
    unfinished = file.with_name(file.name + ".part")
    unfinished.write_text(json.dumps(figures, indent=2) + "\n", encoding="utf-8")
    unfinished.replace(file)
