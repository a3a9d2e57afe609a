"""`paraflex control compare`: comparison of control laws in several actuation modes."""

from __future__ import annotations

import time

from paraflex.campaign import Workers
from paraflex.checks import check_planned
from paraflex.cli.bars import counting
from paraflex.cli.collected import collected
from paraflex.cli.commands.requests import flagged
from paraflex.cli.commands.runs import CompareLawsRequest
from paraflex.cli.control_tables import print_laws
from paraflex.cli.ending import exit_code, print_location, print_results
from paraflex.cli.replacing import hold_results
from paraflex.cli.request import (
    command_provenance,
    find_modes,
    find_paths,
    locating_errors,
    plan_study,
    requested_model,
)
from paraflex.cli.tables import plain_console
from paraflex.cli.writing import write_drawn
from paraflex.compilation import compile_kernels_for
from paraflex.control import ControllerDescription
from paraflex.files import Model
from paraflex.folders import LAW_COMPARISON, ResultsFolder
from paraflex.kinematics import Path
from paraflex.mechanism import ActuationMode
from paraflex.results.following import ErrorSpan
from paraflex.studies.laws import LawStudy, laws_of, reduced_tasks

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
        return _compare(request, model, laws, paths, modes, folder)


def _compare(
    request: CompareLawsRequest, model: Model, laws: Laws, paths: Paths, modes: list[ActuationMode],
    folder: ResultsFolder,
) -> int:  # fmt: skip
    console = plain_console(stderr=True)
    compile_kernels_for(model.mechanism, console.print)
    began = time.perf_counter()
    study = _study(request, model, laws, paths, modes)
    with counting(console) as report:
        result = study.run(workers=Workers(number=request.workers), on_progress=report)
    if not result.begun:
        console.print("interrupted before any law had run; nothing is written", soft_wrap=True)
        return exit_code(False, interrupted=result.interrupted)
    result.save_in(folder)
    findings = collected(
        check_planned(model, next(iter(study.tasks.values())), next(iter(paths)), modes, request.plan.assembly)
    )
    print_results(result.to_dict(), lambda out: print_laws(out, result), as_json=request.json, findings=findings)
    write_drawn(result.data, folder)
    if not request.json:
        print_location(began, "table and figure", folder.path)
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
        return LawStudy(
            reduced_tasks(model, tasks, modes), laws, modes, options, request.metrics, ErrorSpan(model.study.error),
            command_provenance(model, requested | options.to_dict()),
        )  # fmt: skip
