"""Tables and lines that commands print."""

from __future__ import annotations

from collections.abc import Container, Iterable, Iterator, Mapping, Sequence
from typing import TYPE_CHECKING, Any

from rich import box
from rich.console import Console, ConsoleOptions, RenderableType
from rich.segment import Segment
from rich.table import Table

from paraflex.cli.collected import printed
from paraflex.errors import printable
from paraflex.findings import DONE_STATUSES, Finding
from paraflex.units import STRESS

if TYPE_CHECKING:
    # Their import takes as long as all of `paraflex info`.
    from paraflex.studies import StudyResult
    from paraflex.tracking import TrackingTask


# Torques below this share of the largest are rounding errors.
_ROUNDING = 1e-9


class _PlainConsole(Console):
    """Console that prints control characters, which names from files may hold, as escapes."""

    def render(self, renderable: RenderableType, options: ConsoleOptions | None = None) -> Iterable[Segment]:
        """Yield the segments to print; controls and styles of Rich are kept, as they are not part of the text."""
        for part in super().render(renderable, options):
            yield part if part.control else part._replace(text=printable(part.text))


def plain_console(*, stderr: bool = False) -> Console:
    """Return a console that prints square brackets as they are, because here they hold units."""
    return _PlainConsole(highlight=False, markup=False, stderr=stderr)


def warn_of(console: Console, findings: Iterable[Finding], whose: str = "") -> None:
    """Print a line for each finding, which begins with `whose`."""
    from paraflex.results.findings import finding_lines  # imports xarray, which descriptions of mechanisms do not need

    findings = list(findings)
    for line in finding_lines(findings):
        console.print(f"{whose}{line}", soft_wrap=True)
    printed(findings)


def print_studies(console: Console, summaries: Mapping[str, Any], task: TrackingTask, model: str) -> None:
    """Print tables of the runs in every mode along each path, and a line for each run that an event stopped.

    Parameters
    ----------
    console : Console
        Console to print to.
    summaries : mapping of str to dict
        Summaries by path; the name of a single path may be empty.
    task : TrackingTask
        Task of any of the paths.
    model : str
        Fidelity of the runs, for the title.
    """
    console.print(_study_table(summaries, task, model))
    if any(mode.get("tracking_rms_after") is not None for _, mode in _runs(summaries)):
        console.print(_after_table(summaries, task))
    controllers(console, [(names, mode) for names, mode in _runs(summaries)], _texts(summaries))
    for names, mode in _runs(summaries):
        if mode["status"] == "stopped":
            *path, name = names
            whose = "".join(f'path "{one}", ' for one in path)
            console.print(f'{whose}mode "{name}": {mode["message"]}', soft_wrap=True)


def _runs(summaries: Mapping[str, Any]) -> Iterator[tuple[list[str], dict[str, Any]]]:
    """Yield each run along the paths: the names of its path, if not empty, and of its mode, then its numbers."""
    for path, summary in summaries.items():
        for name, mode in summary["modes"].items():
            yield [path, name] if path else [name], mode


def _texts(summaries: Mapping[str, Any]) -> list[str]:
    return ["path", "mode"] if any(summaries) else ["mode"]


def _study_table(summaries: Mapping[str, Any], task: TrackingTask, model: str) -> Table:
    """Return a table of the tracking error and peak torques of every run, with its steps and wall time."""
    from paraflex.results.following import HEADLINE, SPAN_WORDS, ErrorSpan

    first = next(iter(summaries.values()))
    span = ErrorSpan(first["error"])
    motors = [motor.name for motor in task.mechanism.motors]
    heads = [f"{name}\n[{unit}]" for name, unit in zip(motors, task.mechanism.motor_units(), strict=True)]
    quantity = "forces" if set(task.mechanism.motor_units()) == {"N"} else "torques"
    title = f"{first['mechanism']}, {model}: tracking error {SPAN_WORDS[span]}, and peak {quantity}"
    numbers = ("error\n[m]", *heads, "steps\n", "wall\n[s]")
    table = plain_table(*_texts(summaries), numbers=numbers, title=title)
    for names, mode in _runs(summaries):
        if "steps" not in mode:
            table.add_row(*names, "failed", *["" for _ in motors], "", "")
            continue
        table.add_row(
            *names,
            number(mode[HEADLINE[span]], ".4e") if mode["status"] == "complete" else mode["status"],
            *(number(mode["peak_torque"][motor], ".2f") for motor in motors),
            str(mode["steps"]),
            number(mode["wall_time"], ".2f"),
        )
    return table


def _after_table(summaries: Mapping[str, Any], task: TrackingTask) -> Table:
    """Return a table of errors during the motion and after it, drift and vibration after it, and energy of brakes.

    Runs with controllers also have settling time and overshoot.
    """
    held = task.holds
    motors = "held by brakes" if held else "free"
    if next(iter(summaries.values()))["parameters"]["run"].get("ked"):
        motors = "held all the time"
    keys = {"motion\n[m]": "tracking_rms_motion", "after\n[m]": "tracking_rms_after", "drift\n[m/s]": "drift_speed",
            "vibration\n[m]": "residual_vibration"} | ({"brakes\n[J]": "brake_energy"} if held else {})  # fmt: skip
    if any("controllers" in mode for _, mode in _runs(summaries)):
        keys |= {"settling\n[s]": "settling_time", "overshoot\n[m]": "overshoot"}
    ran = ((names, mode) for names, mode in _runs(summaries) if "steps" in mode)
    rows = ([*names, *(number(mode[key], ".2e") for key in keys.values())] for names, mode in ran)
    title = f"Tracking error during the motion and after it, the motors {motors}"
    return plain_table(*_texts(summaries), numbers=keys, rows=rows, title=title)


def controllers(
    console: Console, runs: Sequence[tuple[Sequence[str], Mapping[str, Any]]], texts: Sequence[str] = ()
) -> None:
    """Print a table of the controllers of runs, if any; `texts` are the heads of the columns that name a run."""
    rows = []
    for names, run in runs:
        internal = number(_unless_rounding(run.get("internal_torque_max"), run.get("peak_torque", {})), ".2g")
        for name, one in run.get("controllers", {}).items():
            most = max((each["given_max"] or 0.0 for each in one["torques"].values()), default=0.0)
            share = "" if one["saturated_share"] is None else f"{100.0 * one['saturated_share']:.3g}"
            times = (f"{1e3 * one[key]:.4g}" for key in ("period", "delay"))
            rows.append([*names, name, one["law"], *times, f"{most:.3g}", share, *([internal] if texts else [])])
    if rows:
        numbers = ["period\n[ms]", "delay\n[ms]", "largest\ntorque", "limited\n[%]"]
        numbers += ["internal\ntorque"] if texts else []
        console.print(plain_table(*texts, "controller", "law", numbers=numbers, rows=rows, title="Controllers"))


def _unless_rounding(value: float | None, beside: Mapping[str, float | None]) -> float | None:
    """Return a value, or zero if it is a rounding error of the values beside it."""
    return (
        0.0
        if value is not None and value < _ROUNDING * max((x or 0.0 for x in beside.values()), default=0.0)
        else value
    )


def plain_table(
    *texts: str,
    numbers: Iterable[str] = (),
    rows: Iterable[Iterable[str]] = (),
    title: str | None = None,
    wrapped: Iterable[str] = (),
) -> Table:
    """Return a table without frames: columns of text, of which the `wrapped` ones may be broken, then of numbers."""
    table = Table(title=title, title_justify="left", box=box.SIMPLE, collapse_padding=True, pad_edge=False)
    for heading in texts:
        table.add_column(heading, no_wrap=heading not in wrapped)
    for heading in numbers:
        table.add_column(heading, justify="right", no_wrap=True)
    for row in rows:
        table.add_row(*row)
    return table


def framed_table(title: str, headings: Iterable[str], right: Container[int] = ()) -> Table:
    """Return a table in a frame; `right` holds the indices of its columns of numbers."""
    table = Table(title=title, title_justify="left")
    for k, heading in enumerate(headings):
        table.add_column(heading, justify="right" if k in right else "left")
    return table


def print_titled(console: Console, title: str, table: Table) -> None:
    """Print a table below a title, which is not broken at the table's width as Rich does with a table's own title."""
    console.print(title, soft_wrap=True)
    console.print(table)


def validity(console: Console, verdicts: Mapping[str, Any]) -> None:
    """Print that the models of all runs are valid, if they are."""
    from paraflex.results.validity import validity_line

    if line := validity_line(verdicts):
        console.print(line, soft_wrap=True)


def below_tolerance(console: Console, summaries: Mapping[str, Any], modes: Mapping[str, Any]) -> None:
    """Print which tracking errors are below the tolerance of integration; nothing for fixed steps, which have none."""
    from paraflex.results.following import HEADLINE, ErrorSpan, below_tolerance_line

    first = next(iter(summaries.values()))
    settings = first["parameters"]["run"]
    if settings.get("step") is not None or settings.get("ked"):
        return
    key = HEADLINE[ErrorSpan(first["error"])]
    tolerance = first.get("tolerance") or settings["tolerance"]
    if line := below_tolerance_line({name: mode.get(key) for name, mode in modes.items()}, tolerance):
        console.print(line, soft_wrap=True)


def loads(console: Console, figures: Mapping[str, Any]) -> None:
    """Print the largest stress of all runs, the effort that prescribed motions need, and the largest joint force."""
    from paraflex.results.loads import effort_lines, joint_line, stress_line

    lines = [line for name, one in figures.items() for line in effort_lines(one, name)]
    for line in filter(None, [stress_line(figures), *lines, joint_line(figures)]):
        console.print(line, soft_wrap=True)


def reductions(console: Console, summaries: Mapping[str, Any]) -> None:
    """Print errors and times of runs with few flexible coordinates relative to those with all, if there are any."""
    from paraflex.results.following import HEADLINE, ErrorSpan

    rows, title, key = [], "", HEADLINE[ErrorSpan(next(iter(summaries.values()))["error"])]
    for names, mode in _runs(summaries):
        if (one := mode.get("reduction")) is None:
            continue
        error, exact, times = mode[key], one[f"full_{key}"], (mode["wall_time"], one["full_wall_time"])
        off = None if error is None or exact is None else error - exact
        rows.append([*names, number(exact, ".4e"), number(off, "+.1e"), number(one["distance"], ".1e"),
                     "" if None in times else f"{times[0] / times[1]:.2f}"])  # fmt: skip
        title = _reduced_words(one)
    if rows:
        heads = ("full error\n[m]", "off\n[m]", "distance\n[m]", "time of\nfull run")
        print_titled(console, title, plain_table(*_texts(summaries), numbers=heads, rows=rows))


def reduction(console: Console, summary: Mapping[str, Any]) -> None:
    """Print error and time of a run without a path with few flexible coordinates, relative to the full run."""
    if (one := summary.get("reduction")) is not None:
        console.print(
            f"{_reduced_words(one)}: points are up to {one['distance']:.1e} m from their positions in the full run, in "
            f"{summary['wall_time'] / one['full_wall_time']:.2f} of its time", soft_wrap=True,
        )  # fmt: skip


def _reduced_words(one: Mapping[str, Any]) -> str:
    return (
        f"{one['flexible_coordinates']} of {one['full_flexible_coordinates']} flexible coordinates, {one['states']} of "
        f"{one['full_states']} states"
    )


def stresses(console: Console, summaries: Mapping[str, Any]) -> None:
    """Print a table of the largest stress of every run along the paths, if there are stresses."""
    from paraflex.results.loads import ranked

    rows, numbers = [], (f"stress\n[{STRESS.name}]", "at\n[m]", "time\n[s]", "safety\nfactor")
    for names, mode in _runs(summaries):
        found = ranked({"": mode.get("loads", {})}, "beams", "stress_max")
        if found:
            most, _, body, one = found[0]
            values = (STRESS.factor * most, one["place"], one["time"], one["safety_factor"])
            rows.append([*names, body, *(number(value, ".4g") for value in values)])
    if rows:
        table = plain_table(*_texts(summaries), "beam", numbers=numbers, rows=rows)
        print_titled(console, "Largest stress of every run", table)


def failures(console: Console, result: StudyResult, whose: str = "") -> None:
    """Print a line for each mode that did not run to its end."""
    reasons = list(result.failed.values())
    if result.data is not None:
        runs = [result.data.sel(mode=mode) for mode in result.data["mode"].values]
        ended = [run for run in runs if run["status"].item() not in DONE_STATUSES]
        reasons += [f'mode "{run["mode"].item()}": {run["message"].item()}' for run in ended]
    for reason in reasons:
        console.print(f"error: {whose}{reason}", soft_wrap=True)


def number(value: float | None, form: str) -> str:
    """Return a number in a format; empty for None."""
    return "" if value is None else format(value, form)


def few(names: Sequence[Any], most: int) -> str:
    """Return the first `most` names as text, and how many more there are."""
    more = f" and {len(names) - most} more" if len(names) > most else ""
    return f"{', '.join(map(str, names[:most]))}{more}"
