"""`paraflex verify`: comparison of one mechanism at every fidelity and in other engines."""

import time
from dataclasses import asdict

from paraflex.compilation import compile_kernels
from paraflex.engines import ENGINES
from paraflex.errors import InputError, suggestion
from paraflex.figures.verification import distance_table, link_tables, model_table, path_extent, printed
from paraflex.folders import VERIFICATION
from paraflex.mechanism import Geometry
from paraflex.results.following import SPAN_WORDS, ErrorSpan
from paraflex.studies.verification import FIDELITIES, VerificationOptions, VerificationStudy, check_model
from .bars import counting
from .commands.requests import flagged
from .commands.runs import VerifyRequest
from .ending import exit_code, print_location, print_results, write_drawn
from .replacing import hold_results
from .request import command_provenance, find_mode, find_modes, find_path, plan_study, requested_model, with_frames
from .tables import PlainConsole, print_table


def verify_command(request: VerifyRequest) -> int:
    """Run all models and write their comparison; return the exit code."""
    model = requested_model(request.model)
    path, path_name = find_path(model, request.path)
    modes = find_modes(model, request.modes) if request.modes else [find_mode(model, [])]
    options, models = _options(request), _models(request)
    mechanism = with_frames(model.mechanism, request.frames)
    for name in models:
        check_model(name, mechanism)
    with hold_results(request.out, VERIFICATION, force=request.force) as folder:
        console = PlainConsole(stderr=True)
        for geometry in Geometry:
            if geometry is Geometry.LINEAR or "second-order" in models:
                compile_kernels(geometry, console.print)
        began = time.perf_counter()
        task = plan_study(model, mechanism, path, path_name, request.plan)
        requested = (
            {"path": path_name, "modes": [mode.name for mode in modes]} | asdict(request.frames) | asdict(options)
        )
        requested |= {"method": options.method.name, "method_parameters": options.method.values}
        study = VerificationStudy(task, modes, models, options, command_provenance(model, requested), model.study.error)
        with counting(console) as report:
            verification = study.run(on_progress=report)
        summary = verification.to_dict()
        data = verification.data
        if data is not None:
            verification.save_in(folder)

        def show(out: PlainConsole) -> None:
            span, extent = SPAN_WORDS[ErrorSpan(summary["error"])], path_extent(data)
            out.print_lines(f"{summary['mechanism']}: RMS tracking error {span}, and distances from the path of "
                      f"{printed(summary['reference'])}")  # fmt: skip
            for mode in summary["modes"]:
                for table in (model_table(summary, mode, extent), distance_table(summary, mode, extent),
                              *link_tables(summary, mode)):  # fmt: skip
                    print_table(out, table)

        print_results(summary, show, as_json=request.json)
        try:
            if data is not None:
                write_drawn(data, folder, request.drawn)
                print_location(began, "numbers", folder.path, request.drawn, as_json=request.json)
        finally:
            for mode, by_model in verification.runs.items():
                for name, runs in by_model.items():
                    if runs.failure:
                        console.print_lines(f'error: mode "{mode}", {name}: {runs.failure}')
        return exit_code(verification.complete, interrupted=verification.interrupted)


def _options(request: VerifyRequest) -> VerificationOptions:
    for flag, value in (("--tol", request.tolerance), ("--segments", request.segments)):
        if value is not None and not 0 < value < float("inf"):
            raise InputError("must be positive", field=flag, value=value, remedy="leave it out for the default")
    given = {name: getattr(request, name) for name in ("method", "tolerance", "segments")}
    with flagged(request):
        return VerificationOptions(**{name: value for name, value in given.items() if value is not None})


def _models(request: VerifyRequest) -> list[str]:
    for flag, names, known in (("--model", request.fidelities, FIDELITIES), ("--engine", request.engines, ENGINES)):
        for name in names:
            if name not in known:
                raise InputError(f"unknown {flag[2:]}", field=flag, value=name, remedy=suggestion(name, known))
    return list(dict.fromkeys([*(request.fidelities or FIDELITIES), *request.engines]))
