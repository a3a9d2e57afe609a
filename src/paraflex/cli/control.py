"""`paraflex control compare`: comparison of control laws in several actuation modes."""

from __future__ import annotations

import math
import textwrap
import time
from collections.abc import Iterator, Sequence

import xarray as xr
from rich.console import Console

from paraflex.campaign import Workers
from paraflex.checks import check_planned
from paraflex.cli.bars import counting
from paraflex.cli.collected import collected
from paraflex.cli.commands.control import CompareLawsRequest
from paraflex.cli.commands.requests import flagged
from paraflex.cli.ending import exit_code, say_where, tell
from paraflex.cli.replacing import hold_results
from paraflex.cli.request import asked_model, asked_of, blaming, find_modes, find_paths, plan_study
from paraflex.cli.tables import plain_console, plain_table, print_titled
from paraflex.cli.writing import write_drawn
from paraflex.compilation import compile_kernels_for
from paraflex.control import ControllerDescription
from paraflex.files import Model
from paraflex.folders import LAW_COMPARISON, ResultsFolder
from paraflex.kinematics import Path
from paraflex.mechanism import ActuationMode
from paraflex.results.following import ErrorSpan
from paraflex.results.metrics import VALIDITY, metric_label
from paraflex.studies.law_comparison import LawComparison, unit_shown
from paraflex.studies.laws import LawStudy, laws_of, reduced_tasks

Laws = dict[str, tuple[ControllerDescription, ...]]
Paths = dict[str, Path]
# Width of a line of a heading, and gap between two columns [characters].
_HEAD, _BETWEEN = 9, 2
# Internal torques below this share of the peak torque are rounding errors.
_ROUNDING = 1e-8


def compare_laws_command(request: CompareLawsRequest) -> int:
    """Run every control law in every mode, write the table and its figure; return the exit code."""
    model = asked_model(request.model)
    with blaming(model):
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
    doubts = collected(
        check_planned(model, next(iter(study.tasks.values())), next(iter(paths)), modes, request.plan.assembly)
    )
    tell(result.to_dict(), lambda out: print_laws(out, result), as_json=request.json, doubts=doubts)
    write_drawn(result.data, folder)
    if not request.json:
        say_where(began, "table and figure", folder.path)
    return exit_code(bool((result.data["status"] == "complete").any()), interrupted=result.interrupted)


def _study(request: CompareLawsRequest, model: Model, laws: Laws, paths: Paths, modes: list[ActuationMode]) -> LawStudy:
    """Return the study, planned along every path; errors name the option or field at fault."""
    tasks = {name: plan_study(model, model.mechanism, path, name, request.plan) for name, path in paths.items()}
    with flagged(request):
        chosen = {name: getattr(request, name) for name in ("tolerance", "method", "step")}
        options = model.study.integration(chosen)
        asked = {
            "laws": {name: [one.name for one in together] for name, together in laws.items()},
            "paths": list(paths),
            "modes": [mode.name for mode in modes],
            "reduced": model.study.reduced,
        }
        return LawStudy(
            reduced_tasks(model, tasks, modes), laws, modes, options, request.metrics, ErrorSpan(model.study.error),
            asked_of(model, asked | options.to_dict()),
        )  # fmt: skip


def print_laws(console: Console, result: LawComparison) -> None:
    """Print a row for each law in each mode; columns that do not fit the console continue in further tables."""
    data = result.data
    metrics = [name for name in result.metrics if name != VALIDITY]
    columns = {_heading(data, name): _column(data, name) for name in metrics}
    cells = [(mode, law) for mode in range(data.sizes["mode"]) for law in range(data.sizes["law"])]
    names = [["" if law else result.modes[mode], result.laws[law]] for mode, law in cells]
    taken = sum(max(map(len, texts)) + _BETWEEN for texts in zip(*names, ("mode", "law"), strict=True))
    title = f"{data.attrs['mechanism']}: control laws"
    for heads in _fitting(columns, console.width - taken):
        rows = ([*names[k], *(columns[head][cell] for head in heads)] for k, cell in enumerate(cells))
        print_titled(console, title, plain_table("mode", "law", numbers=_level(heads), rows=rows))
        title = "continued"
    for line in (*_reasons(result), *_doubtful(result)):
        console.print(line, soft_wrap=True)
    if result.interrupted:
        console.print("interrupted before all laws had run: the same command starts over", soft_wrap=True)


def _heading(data: xr.Dataset, name: str) -> str:
    unit = unit_shown(data, name).name
    lines = textwrap.wrap(metric_label(name), _HEAD, break_long_words=False)
    return "\n".join([*lines, f"[{unit}]" if unit else ""])


def _column(data: xr.Dataset, name: str) -> dict[tuple[int, int], str]:
    """Return texts by indices of mode and law; incomplete runs have their status instead, in the first column only."""
    values = unit_shown(data, name).factor * _unless_rounding(data, name).transpose("mode", "law").values
    status = data["status"].transpose("mode", "law").values
    first = name == next(iter(data.data_vars))
    out = {}
    for k, mode in enumerate(values):
        for j, value in enumerate(mode):
            known = "-" if math.isnan(value) else f"{value:.3g}"
            out[k, j] = known if status[k, j] == "complete" else str(status[k, j]) if first else ""
    return out


def _unless_rounding(data: xr.Dataset, name: str) -> xr.DataArray:
    if (name, "peak_torque_max" in data) != ("internal_torque_max", True):
        return data[name]
    return data[name].where(~(data[name] < _ROUNDING * data["peak_torque_max"]), 0.0)


def _level(heads: Sequence[str]) -> list[str]:
    """Return headings padded to the same number of lines, with units on the last."""
    most = max(head.count("\n") for head in heads)
    return ["\n" * (most - head.count("\n")) + head for head in heads]


def _fitting(columns: dict[str, dict[tuple[int, int], str]], room: int) -> Iterator[list[str]]:
    """Yield the headings of columns that fit side by side into `room` characters, at least one at a time."""
    heads: list[str] = []
    left = room
    for head, texts in columns.items():
        width = max(map(len, (*head.split("\n"), *texts.values()))) + _BETWEEN
        if heads and width > left:
            yield heads
            heads, left = [], room
        heads.append(head)
        left -= width
    yield heads


def _reasons(result: LawComparison) -> Iterator[str]:
    """Yield the reasons why laws failed or are doubtful in a mode; cases with the same reason share a line."""
    said = dict[tuple[str, str], list[str]]()
    for name, cell in _cells(result):
        if reason := str(cell["reason"].item()):
            said.setdefault((str(cell["status"].item()), reason), []).append(name)
    for (status, reason), names in said.items():
        yield f"{'; '.join(names)}: {status}, {reason}"


def _doubtful(result: LawComparison) -> Iterator[str]:
    """Yield a line with the laws and modes that bend links beyond what the model can describe, if any."""
    if names := [name for name, cell in _cells(result) if cell[VALIDITY] > 1.0]:
        yield f"beyond what the model can describe ({VALIDITY} above 1): {'; '.join(names)}"


def _cells(result: LawComparison) -> Iterator[tuple[str, xr.Dataset]]:
    for law in result.laws:
        for mode in result.modes:
            yield f"{law} in {mode}", result.data.sel(law=law, mode=mode)
