"""`paraflex verify`: comparison of one mechanism at every fidelity and in other engines."""

from __future__ import annotations

import time
from dataclasses import asdict
from typing import Any

from rich.console import Console

from paraflex.cli.bars import counting
from paraflex.cli.commands.requests import flagged
from paraflex.cli.commands.runs import VerifyRequest
from paraflex.cli.ending import exit_code, say_where, tell
from paraflex.cli.replacing import hold_results
from paraflex.cli.request import asked_model, asked_of, find_mode, find_modes, find_path, plan_study, with_frames
from paraflex.cli.tables import number, plain_console, plain_table, print_titled
from paraflex.cli.writing import write_drawn
from paraflex.compilation import compile_kernels
from paraflex.engines import ENGINES
from paraflex.errors import InputError, suggestion
from paraflex.files import Model
from paraflex.folders import VERIFICATION, ResultsFolder
from paraflex.kinematics import Path
from paraflex.mechanism import ActuationMode, Geometry
from paraflex.results.following import SPAN_WORDS, ErrorSpan
from paraflex.studies import FIDELITIES, VerificationOptions, VerificationStudy, check_model

# Names short enough for a column head, of models that are not shown under their own names.
_SHORT = {"ked": "KED", "second-order": "2nd-ord.", "exudyn": "Exudyn", "mujoco": "MuJoCo"}
_ERRORS = ("error\n[m]", "largest\n[m]", "RMS\n[m]", "wall\n[s]")
_SOUND = {
    "finer step\n[m]": "change_with_finer_step",
    "finer mesh\n[m]": "change_with_finer_mesh",
    "energy\n[J]": "energy_balance_max",
    "constraints\n[m]": "constraint_position_max",
    "[m/s]": "constraint_velocity_max",
}
_LINKS = {"angle": "angle [rad]", "angular_velocity": "angular velocity [rad/s]"}


def verify_command(request: VerifyRequest) -> int:
    """Run all models and write their comparison; return the exit code."""
    model = asked_model(request.model)
    path, path_name = find_path(model, request.path)
    modes = find_modes(model, request.modes) if request.modes else [find_mode(model, [])]
    _options(request)
    models = _models(request)
    for name in models:
        check_model(name, with_frames(model.mechanism, request.frames))
    with hold_results(request.out, VERIFICATION, force=request.force) as folder:
        return _verify(request, model, (path, path_name), modes, models, folder)


def _verify(
    request: VerifyRequest,
    model: Model,
    along: tuple[Path, str],
    modes: list[ActuationMode],
    models: list[str],
    folder: ResultsFolder,
) -> int:
    """Run all models along a path, given with its name; write results into the held folder and return the exit code."""
    console, (path, path_name) = plain_console(stderr=True), along
    options, mechanism = _options(request), with_frames(model.mechanism, request.frames)
    for geometry in Geometry:
        if geometry is Geometry.LINEAR or "second-order" in models:
            compile_kernels(geometry, console.print)
    began = time.perf_counter()
    task = plan_study(model, mechanism, path, path_name, request.plan)
    asked = {"path": path_name, "modes": [mode.name for mode in modes]} | asdict(request.frames) | asdict(options)
    asked |= {"method": options.method.name, "method_parameters": options.method.values}
    study = VerificationStudy(task, modes, models, options, asked_of(model, asked), model.study.error)
    with counting(console) as report:
        verification = study.run(on_progress=report)
    summary = verification.to_dict()
    data = verification.data
    if data is not None:
        verification.save_in(folder)

    def show(out: Console) -> None:
        for mode in summary["modes"]:
            print_agreement(out, summary, mode)

    tell(summary, show, as_json=request.json)
    try:
        if data is not None:
            write_drawn(data, folder, request.drawn)
            if not request.json:
                say_where(began, "numbers", folder.path, request.drawn)
    finally:
        for mode, by_model in verification.runs.items():
            for name, runs in by_model.items():
                if runs.failure:
                    console.print(f'error: mode "{mode}", {name}: {runs.failure}', soft_wrap=True)
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


def print_agreement(console: Console, summary: dict[str, Any], mode: str) -> None:
    """Print how the models of a mode agree, the evidence that each is converged, and the differences of every link."""
    models, distances = summary["modes"][mode]["models"], summary["modes"][mode]["distances"]
    finished = {name: values for name, values in models.items() if "tracking_error" in values}
    reference = summary["reference"]
    compared = {name: values for name, values in finished.items() if "distance_max" in values and name != reference}

    short = [_short(name) for name in finished]
    where = f"{summary['mechanism']}, mode {mode}"
    span = SPAN_WORDS[ErrorSpan(summary["error"])]
    print_titled(
        console,
        f"{where}: tracking error {span}, and distance from the path of {_short(reference)}",
        plain_table("model", numbers=_ERRORS, rows=(_errors(name, one, reference) for name, one in models.items())),
    )
    apart = (
        [_short(a), *("" if a == b else number(distances[a][b], ".1e") for b in finished)] for a in finished
    )  # fmt: skip
    table = plain_table("", numbers=short, rows=apart)
    print_titled(console, "Largest distance between the paths of two models [m]", table)
    sound = ([_short(name), *(number(one[key], ".1e") for key in _SOUND.values())] for name, one in finished.items())
    title = "Change of the path with a finer step and mesh, imbalance of energy, constraint violation"
    print_titled(console, title, plain_table("model", numbers=_SOUND, rows=sound))
    for key, what in _LINKS.items() if compared else ():
        of_links = [one[f"{key}_difference_rms"] for one in compared.values()]
        rows = ([link, *(number(each[link], ".1e") for each in of_links)] for link in summary["links"])
        table = plain_table("link", numbers=(_short(name) for name in compared), rows=rows)
        print_titled(console, f"RMS difference of each link's {what} from {_short(reference)}", table)


def _errors(name: str, values: dict[str, Any], reference: str) -> list[str]:
    if "tracking_error" not in values:
        return [_short(name), "failed"]
    far = ("" if name == reference else number(values.get(f"distance_{kind}"), ".1e") for kind in ("max", "rms"))
    return [_short(name), number(values["tracking_error"], ".4e"), *far, number(values["wall_time"], ".2f")]


def _short(name: str) -> str:
    return _SHORT.get(name, name)
