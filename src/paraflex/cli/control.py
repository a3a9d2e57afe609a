"""`paraflex control compare`: comparison of control laws in several actuation modes."""

import time
from collections.abc import Iterator

import xarray as xr

from paraflex.campaign import Workers
from paraflex.checks import check_planned
from paraflex.compilation import compile_kernels_for
from paraflex.control import ControllerDescription
from paraflex.figures.laws import law_table
from paraflex.files import Model
from paraflex.folders import LAW_COMPARISON
from paraflex.mechanism import ActuationMode
from paraflex.paths import Path
from paraflex.results.following import ErrorSpan
from paraflex.results.metrics import VALIDITY
from paraflex.studies.law_comparison import LawComparison
from paraflex.studies.laws import LawStudy, laws_of, reduced_tasks
from .bars import counting
from .collected import collected
from .commands.requests import flagged
from .commands.runs import CompareLawsRequest
from .ending import exit_code, print_location, print_results, write_drawn
from .replacing import hold_results
from .request import command_provenance, find_modes, find_paths, locating_errors, plan_study, requested_model
from .tables import PlainConsole, print_table

Laws = dict[str, tuple[ControllerDescription, ...]]
Paths = dict[str, Path]


def compare_laws_command(request: CompareLawsRequest) -> int:
    """Run every control law in every mode, write the table and its figure; return the exit code."""
    model = requested_model(request.model)
    with locating_errors(model):
        laws = laws_of(model, request.controllers)
    paths, modes = find_paths(model, request.paths), find_modes(model, request.modes)
    # All checks that need no computation come before the long runs.
    with hold_results(request.out, LAW_COMPARISON, force=request.force, field="--output") as folder:
        console = PlainConsole(stderr=True)
        compile_kernels_for(model.mechanism, console.print)
        began = time.perf_counter()
        study = _study(request, model, laws, paths, modes)
        with counting(console) as report:
            result = study.run(workers=Workers(number=request.workers), on_progress=report)
        if not result.begun:
            console.print_lines("interrupted before any law had run; nothing is written")
            return exit_code(False, interrupted=result.interrupted)
        result.save_in(folder)
        findings = collected(
            check_planned(model, next(iter(study.tasks.values())), next(iter(paths)), modes, request.plan.assembly)
        )
        print_results(result.to_dict(), lambda out: print_laws(out, result), as_json=request.json, findings=findings)
        write_drawn(result.data, folder)
        print_location(began, "table and figure", folder.path, as_json=request.json)
        return exit_code(bool((result.data["status"] == "complete").any()), interrupted=result.interrupted)


def _study(request: CompareLawsRequest, model: Model, laws: Laws, paths: Paths, modes: list[ActuationMode]) -> LawStudy:
    """Return the study, planned along every path; errors name the option or field at fault."""
    tasks = {name: plan_study(model, model.mechanism, path, name, request.plan) for name, path in paths.items()}
    with flagged(request):
        chosen = {name: getattr(request, name) for name in ("tolerance", "method", "step")}
        options = model.study.integration(chosen)
        requested = {
            "laws": {name: [one.name for one in together] for name, together in laws.items()},
            "paths": list(paths),
            "modes": [mode.name for mode in modes],
            "reduced": model.study.reduced,
        }
        few = reduced_tasks(model, tasks, modes, options)
        return LawStudy(
            few, laws, modes, options, request.metrics, ErrorSpan(model.study.error),
            command_provenance(model, requested | options.to_dict()),
        )  # fmt: skip


def print_laws(console: PlainConsole, result: LawComparison) -> None:
    """Print a row for each law in each mode, and reasons of those that failed or are doubtful."""
    print_table(console, law_table(result.data))
    console.print_lines(*_reasons(result), *_doubtful(result))
    if result.interrupted:
        console.print_lines("interrupted before all laws had run: the same command starts over")


def _reasons(result: LawComparison) -> Iterator[str]:
    """Yield the reasons why laws failed or are doubtful in a mode; cases with the same reason share a line."""
    alike = dict[tuple[str, str], list[str]]()
    for name, cell in _cells(result):
        if reason := str(cell["reason"].item()):
            alike.setdefault((str(cell["status"].item()), reason), []).append(name)
    for (status, reason), names in alike.items():
        yield f"{'; '.join(names)}: {status}, {reason}"


def _doubtful(result: LawComparison) -> Iterator[str]:
    """Yield a line with the laws and modes that bend links beyond what the model can describe, if any."""
    if names := [name for name, cell in _cells(result) if cell[VALIDITY] > 1.0]:
        yield f"beyond what the model can describe ({VALIDITY} above 1): {'; '.join(names)}"


def _cells(result: LawComparison) -> Iterator[tuple[str, xr.Dataset]]:
    for law in result.laws:
        for mode in result.modes:
            yield f"{law} in {mode}", result.data.sel(law=law, mode=mode)
