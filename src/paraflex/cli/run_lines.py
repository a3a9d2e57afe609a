"""Tables and lines that `paraflex run` prints on its runs."""

from collections.abc import Mapping
from typing import Any

import xarray as xr

from paraflex.figures.controllers import controller_table
from paraflex.figures.loads import stress_table
from paraflex.figures.reduction import reduced_runs_table, reduced_words
from paraflex.figures.tracking import Runs, after_table, beside_table, beside_words, result_table
from paraflex.findings import DONE_STATUSES
from paraflex.formatting import quantity
from paraflex.mechanism.actuation_modes import SERVO
from paraflex.results.findings import validity_line
from paraflex.results.following import HEADLINE, ErrorSpan, below_tolerance_line, headline
from paraflex.results.loads import effort_lines, joint_line, stress_line
from paraflex.results.metrics import metric_label
from paraflex.studies.tracking import StudyResult
from paraflex.tracking import TrackingTask
from .tables import PlainConsole, print_table


def print_runs(
    out: PlainConsole,
    results: Mapping[str, StudyResult],
    numbers: Mapping[str, dict[str, Any]],
    task: TrackingTask,
    model: str,
) -> None:
    """Print tables of the runs in every mode along each path, and lines on all of them; nothing if none has results.

    Parameters
    ----------
    out : PlainConsole
        Console to print to.
    results : mapping of str to StudyResult
        Results by path; the name of a single path may be empty.
    numbers : mapping of str to dict
        The same results as plain values.
    task : TrackingTask
        Task of any of the paths.
    model : str
        Fidelity of the runs, for the title.
    """
    data = {path: result.data for path, result in results.items() if result.data is not None}
    if not data:
        return
    summaries = {path: numbers[path] for path in data}
    # Numbers of each run by the names of its path, if not empty, and of its mode.
    runs = {
        (path, mode) if path else (mode,): one
        for path, summary in summaries.items()
        for mode, one in summary["modes"].items()
    }
    heads, first = ["path", "mode"] if any(data) else ["mode"], next(iter(summaries.values()))
    rows = Runs(data, {path: list(results[path].failed) for path in data})
    table = result_table(rows, brief=True)
    print_table(out, table, f"{task.mechanism.name}, {model}: {table.title}")
    ked = first["parameters"]["run"].get("ked")
    motors = "held all the time" if ked else "held by brakes" if task.holds else "free"
    if any(name[-1].endswith(f" {SERVO}") for name in runs) or any(each.follows for each in task.mechanism.motors):
        motors += ", those that follow the plan held on it"
    print_table(out, after_table(rows), f"Tracking error during the motion and after it, the motors {motors}")
    print_table(out, controller_table(runs, heads))
    for (*path, mode), one in runs.items():
        if one["status"] == "stopped":
            whose = "".join(f'path "{each}", ' for each in path)
            out.print_lines(f'{whose}mode "{mode}": {one["message"]}')
    sizes = [reduced_words(one["reduction"]) for one in runs.values() if one.get("reduction") is not None]
    reduced = reduced_runs_table(heads, runs.items(), HEADLINE[ErrorSpan(first["error"])])
    print_table(out, reduced, "".join(sizes[:1]))
    modes = {", path ".join(reversed(names)): one for names, one in runs.items()}
    below_tolerance(out, summaries, modes)
    out.print_lines(validity_line({name: mode.get("validity") for name, mode in modes.items()}))
    if len(results) > 1:
        stresses = stress_table({names: one.get("loads", {}) for names, one in runs.items()}, heads, largest=True)
        print_table(out, stresses, "Largest stress of every run")
    out.print_lines(*load_lines({name: mode.get("loads", {}) for name, mode in modes.items()}), *metric_lines(modes))


def print_beside(out: PlainConsole, data: xr.Dataset) -> None:
    """Print the tracking errors in another geometry beside those of the runs; nothing if there are none."""
    table = beside_table(data)
    print_table(out, table, f"{data.attrs['mechanism']}: RMS tracking error {headline(data)[1]}")
    out.print_lines(beside_words(data))


def below_tolerance(out: PlainConsole, summaries: Mapping[str, Any], modes: Mapping[str, Any]) -> None:
    """Print which tracking errors are below the tolerance of integration; nothing for fixed steps, which have none."""
    first = next(iter(summaries.values()))
    settings = first["parameters"]["run"]
    if settings.get("step") is not None or settings.get("ked"):
        return
    key = HEADLINE[ErrorSpan(first["error"])]
    tolerance = first.get("tolerance") or settings["tolerance"]
    out.print_lines(below_tolerance_line({name: mode.get(key) for name, mode in modes.items()}, tolerance))


def load_lines(loads: Mapping[str, Mapping[str, Any]]) -> list[str]:
    """Return lines on the largest stress of all runs, the effort of prescribed motions, and the largest joint force.

    A line is empty if there is no such number.
    """
    efforts = [line for name, one in loads.items() for line in effort_lines(one, name)]
    return [stress_line(loads), *efforts, joint_line(loads)]


def metric_lines(runs: Mapping[str, Mapping[str, Any]]) -> list[str]:
    """Return a line for each metric that was asked for, of each run by its name, which may be empty."""
    return [
        f"{f'mode {name}, ' if name else ''}{metric_label(column)}: "
        + (quantity(value, one["unit"], digits=4, padded=False) if value is not None else one.get("reason", "-"))
        for name, run in runs.items()
        for column, one in run.get("metrics", {}).items()
        for value in [one["value"]]
    ]


def failures(out: PlainConsole, result: StudyResult, whose: str = "") -> None:
    """Print a line for each mode that did not run to its end."""
    reasons = list(result.failed.values())
    if result.data is not None:
        runs = [result.data.sel(mode=mode) for mode in result.data["mode"].values]
        ended = [run for run in runs if run["status"].item() not in DONE_STATUSES]
        reasons += [f'mode "{run["mode"].item()}": {run["message"].item()}' for run in ended]
    out.print_lines(*(f"error: {whose}{reason}" for reason in reasons))
