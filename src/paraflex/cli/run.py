"""`paraflex run`: read, plan, simulate every mode under a progress bar, write, report."""

from __future__ import annotations

import json
import time
from dataclasses import dataclass
from pathlib import Path

from rich.console import Console
from rich.progress import BarColumn, Progress, TaskID, TextColumn, TimeElapsedColumn

from paraflex.cli.tables import failures, plain_console, study_table
from paraflex.compilation import compile_kernels
from paraflex.errors import AssemblyError, InputError, OutputError
from paraflex.files import Model, load, load_path
from paraflex.integrators import IntegrationOptions
from paraflex.kinematics import Path as EndEffectorPath
from paraflex.mechanism import ActuationMode, Geometry, Mechanism, parse_mode
from paraflex.results import save_results, summary
from paraflex.simulate import TrackingTask, plan_tracking
from paraflex.studies import StudyResult, run_study

COMPLETE, TROUBLE, INTERRUPTED = 0, 1, 130


@dataclass(frozen=True)
class RunRequest:
    """What was asked for on the command line; None takes the model's or the library's default."""

    mechanism: str
    path: str | None
    modes: list[str]
    tolerance: float | None
    duration: float | None
    samples: int | None
    assembly: str | None
    alpha: float | None
    beta: float | None
    max_steps: int | None
    rigid: bool
    geometry: str | None
    out: str
    json: bool


def run_command(request: RunRequest) -> int:
    """Run a study and write its results; the exit code."""
    console = plain_console(stderr=True)
    model = load(request.mechanism)
    path, path_name = _path(model, request.path)
    options = _options(request)
    modes = _modes(model, request.modes)
    # Every check that needs no computing comes before the first minute is spent.
    folder = _folder(request.out)
    mechanism = _mechanism(model, request)
    compile_kernels(Geometry.LINEAR if request.rigid else mechanism.geometry, console.print)
    began = time.perf_counter()
    task = _plan(model, mechanism, path, path_name, request)
    parameters = _parameters(model, path_name, modes, task, options, request.rigid)
    result = _simulate(console, task, modes, options, parameters)
    if result.data is None:
        failures(console, result)
        return INTERRUPTED if result.interrupted else TROUBLE
    _write(result, folder)
    figures = summary(result.data, result.failed)
    if request.json:
        print(json.dumps(figures, indent=2))
    else:
        plain_console().print(study_table(figures, task))
        console.print(f"{time.perf_counter() - began:.1f} s; results and figures in {folder}")
    failures(console, result)
    if result.interrupted:
        return INTERRUPTED
    return COMPLETE if result.complete else TROUBLE


def _path(model: Model, name: str | None) -> tuple[EndEffectorPath, str]:
    if name is not None and name not in model.paths and name.endswith(".toml"):
        return load_path(name), name
    path = model.path(name)
    return path, next(key for key, value in model.paths.items() if value is path)


def _options(request: RunRequest) -> IntegrationOptions:
    given = {
        "tolerance": request.tolerance,
        "alpha": request.alpha,
        "beta": request.beta,
        "max_steps": request.max_steps,
    }
    flags = {"tolerance": "--tol", "alpha": "--alpha", "beta": "--beta", "max_steps": "--max-steps"}
    try:
        return IntegrationOptions(**{key: value for key, value in given.items() if value is not None})
    except InputError as error:
        raise InputError(error.problem, field=flags[error.field], value=error.value, remedy=error.remedy) from None


def _modes(model: Model, names: list[str]) -> list[ActuationMode]:
    wanted = names or list(model.study.modes) or [mode.name for mode in model.mechanism.modes]
    if not wanted:
        raise InputError(
            "no actuation mode to run", field="--mode", remedy="name one, or add [study] modes to the file"
        )
    try:
        return list(dict.fromkeys(parse_mode(model.mechanism, name) for name in wanted))
    except InputError as error:
        raise InputError(error.problem, field="--mode", value=error.value, remedy=error.remedy) from None


def _mechanism(model: Model, request: RunRequest) -> Mechanism:
    mechanism = model.mechanism.rigid() if request.rigid else model.mechanism
    if request.geometry is None:
        return mechanism
    try:
        return mechanism.with_geometry(request.geometry)
    except InputError as error:
        raise InputError(error.problem, field="--geometry", value=error.value, remedy=error.remedy) from None


def _plan(
    model: Model, mechanism: Mechanism, path: EndEffectorPath, path_name: str, request: RunRequest
) -> TrackingTask:
    # Another path than the study's has another length: its own duration, with the study's share of dwell.
    duration, samples = request.duration, request.samples
    if duration is None:
        own = path_name == model.study.path
        duration = model.study.duration if own and model.study.duration is not None else _with_dwell(model, path)
    try:
        return plan_tracking(
            mechanism,
            path,
            duration=duration,
            samples=model.study.samples if samples is None else samples,
            assembly=request.assembly or model.study.assembly,
        )
    except AssemblyError as error:
        raise InputError(
            str(error), field=f"path.{path_name}", remedy="move the path or the bases, or choose another assembly",
            source=model.source,
        ) from error  # fmt: skip
    except InputError as error:
        flags = {"duration": "--duration", "samples": "--samples", "assembly": "--assembly"}
        if error.field in flags:
            raise InputError(error.problem, field=flags[error.field], value=error.value, remedy=error.remedy) from None
        raise error.in_file(model.source) from None


def _with_dwell(model: Model, path: EndEffectorPath) -> float:
    if model.study.path is None or model.study.duration is None:
        return path.duration
    return path.duration * model.study.duration / model.paths[model.study.path].duration


def _parameters(
    model: Model,
    path: str,
    modes: list[ActuationMode],
    task: TrackingTask,
    options: IntegrationOptions,
    rigid: bool,
) -> dict:
    return {
        "model": dict(model.parameters),
        "run": {
            "mechanism": model.source,
            "path": path,
            "modes": [mode.name for mode in modes],
            "duration": float(task.motion.t[-1]),
            "samples": int(task.motion.t.size),
            "tolerance": options.tolerance,
            "alpha": options.alpha,
            "beta": options.beta,
            "rigid": rigid,
            "geometry": task.mechanism.geometry.value,
        },
    }


def _simulate(
    console: Console,
    task: TrackingTask,
    modes: list[ActuationMode],
    options: IntegrationOptions,
    parameters: dict,
) -> StudyResult:
    end = float(task.motion.t[-1])
    columns = (
        TextColumn("{task.description}", markup=False),
        BarColumn(),
        TextColumn("{task.completed:.3f}/{task.total:.3f} s"),
    )
    with Progress(*columns, TimeElapsedColumn(), console=console, transient=not console.is_terminal) as progress:
        bars: dict[str, TaskID] = {mode.name: progress.add_task(mode.name, total=end, start=False) for mode in modes}

        def report(name: str, reached: float) -> None:
            progress.start_task(bars[name])
            progress.update(bars[name], completed=reached)

        return run_study(task, modes, options=options, parameters=parameters, on_progress=report)


def _folder(out: str) -> Path:
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


def _write(result: StudyResult, folder: Path) -> None:
    from paraflex.plots import save_figures

    assert result.data is not None
    folder.mkdir(parents=True, exist_ok=True)
    save_results(result.data, folder / "results.nc")
    unfinished = folder / "summary.json.part"
    unfinished.write_text(json.dumps(summary(result.data, result.failed), indent=2) + "\n", encoding="utf-8")
    unfinished.replace(folder / "summary.json")
    save_figures(result.data, folder / "figures")
