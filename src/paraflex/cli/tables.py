"""Tables and lines that commands print."""

from __future__ import annotations

import textwrap
from collections.abc import Container, Iterable, Iterator, Mapping, Sequence
from typing import TYPE_CHECKING, Any

from rich import box
from rich.console import Console, ConsoleOptions, RenderableType
from rich.segment import Segment
from rich.table import Table

from paraflex.cli.collected import printed
from paraflex.errors import printable
from paraflex.findings import DONE_STATUSES, Finding
from paraflex.formatting import number as text_of, quantity

if TYPE_CHECKING:
    # Their import takes as long as all of `paraflex info`.
    from paraflex.figures.tables import Table as DescribedTable
    from paraflex.studies.tracking import StudyResult
    from paraflex.tracking import TrackingTask


# Gap between two columns, width at which headings are broken, and above which columns of words are [characters].
_BETWEEN, _HEAD, _WRAPPED = 2, 9, 26


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


def print_studies(
    console: Console, results: Mapping[str, StudyResult], summaries: Mapping[str, Any], task: TrackingTask, model: str
) -> None:
    """Print tables of the runs in every mode along each path, and a line for each run that an event stopped.

    Parameters
    ----------
    console : Console
        Console to print to.
    results, summaries : mapping of str to StudyResult or dict
        Results and their summaries by path; the name of a single path may be empty.
    task : TrackingTask
        Task of any of the paths.
    model : str
        Fidelity of the runs, for the title.
    """
    from paraflex.figures.run_tables import Runs, after_table, result_table

    data = {path: one.data for path, one in results.items() if one.data is not None}
    runs = Runs(data, {path: list(results[path].failed) for path in data})
    table = result_table(runs, brief=True)
    print_table(console, table, f"{task.mechanism.name}, {model}: {table.title}")
    settings = next(iter(summaries.values()))["parameters"]["run"]
    motors = "held all the time" if settings.get("ked") else "held by brakes" if task.holds else "free"
    print_table(console, after_table(runs), f"Tracking error during the motion and after it, the motors {motors}")
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


def controllers(
    console: Console, runs: Sequence[tuple[Sequence[str], Mapping[str, Any]]], texts: Sequence[str] = ()
) -> None:
    """Print a table of the controllers of runs, if any; `texts` are the heads of the columns that name a run."""
    from paraflex.figures.controllers import controller_table

    print_table(console, controller_table({tuple(names): run for names, run in runs}, texts))


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


def print_tables(console: Console, tables: Iterable[DescribedTable]) -> None:
    """Print tables that have rows below their titles, a title that several share only once."""
    title = None
    for shown in filter(None, tables):
        print_table(console, shown, "" if shown.title == title else shown.title)
        title = shown.title


def print_table(console: Console, shown: DescribedTable, title: str | None = None) -> None:
    """Print a described table below its title; nothing if it has no rows.

    Columns that do not fit the console continue in further tables, behind the columns of words that name the rows.
    """
    if not shown:
        return
    heads = [list(column.head) for column in shown.columns]
    numeric, texts = [column.is_numeric for column in shown.columns], list(zip(*shown.texts(), strict=True))
    names = max(1, numeric.index(True)) if any(numeric) else 1
    widths = [max(map(len, "\n".join(cells).split("\n"))) for cells in texts]
    if sum(max(width, *map(len, head)) + _BETWEEN for width, head in zip(widths, heads, strict=True)) > console.width:
        heads = [[*textwrap.wrap(name, max(width, _HEAD), break_long_words=False, break_on_hyphens=False), below]
                 for width, (name, below) in zip(widths, heads, strict=True)]  # fmt: skip
    widths = [max(width, *map(len, head)) + _BETWEEN for width, head in zip(widths, heads, strict=True)]
    first = sum(min(width, _WRAPPED) for width in widths[:names])
    for k, part in enumerate(_fitting(widths, names, console.width - first)):
        kept = [*range(names), *part]
        most = max(len(list(filter(None, heads[c]))) for c in kept)
        table = plain_table()
        for c in kept:
            lines = list(filter(None, heads[c]))
            lines = [""] * (most - len(lines)) + lines if numeric[c] else lines
            table.add_column("\n".join(lines), justify="right" if numeric[c] else "left",
                             no_wrap=widths[c] <= _WRAPPED)  # fmt: skip
        for row in zip(*(texts[c] for c in kept), strict=True):
            table.add_row(*row)
        print_titled(console, "continued" if k else shown.title if title is None else title, table)


def _fitting(widths: Sequence[int], first: int, room: int) -> Iterator[list[int]]:
    """Yield the columns from the `first` on that fit side by side into `room` characters, at least one at a time."""
    part: list[int] = []
    left = room
    for c in range(first, len(widths)):
        if part and widths[c] > left:
            yield part
            part, left = [], room
        part.append(c)
        left -= widths[c]
    yield part


def print_titled(console: Console, title: str, table: Table) -> None:
    """Print a table below a title, which is not broken at the table's width as Rich does with a table's own title."""
    console.print(title, soft_wrap=True)
    console.print(table)


def validity(console: Console, verdicts: Mapping[str, Any]) -> None:
    """Print that the models of all runs are valid, if they are."""
    from paraflex.results.findings import validity_line

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
    from paraflex.figures.reduction import reduced_runs_table, reduced_words
    from paraflex.results.following import HEADLINE, ErrorSpan

    error = HEADLINE[ErrorSpan(next(iter(summaries.values()))["error"])]
    sizes = [reduced_words(mode["reduction"]) for _, mode in _runs(summaries) if mode.get("reduction") is not None]
    print_table(console, reduced_runs_table(_texts(summaries), _runs(summaries), error), "".join(sizes[:1]))


def reduction(console: Console, summary: Mapping[str, Any]) -> None:
    """Print error and time of a run without a path with few flexible coordinates, relative to the full run."""
    from paraflex.figures.reduction import reduced_words

    if (one := summary.get("reduction")) is not None:
        console.print(
            f"{reduced_words(one)}: points are up to {quantity(one['distance'], 'm', digits=2)} from their positions "
            f"in the full run, in {text_of(summary['wall_time'] / one['full_wall_time'], 2)} of its time",
            soft_wrap=True,
        )


def stresses(console: Console, summaries: Mapping[str, Any]) -> None:
    """Print a table of the largest stress of every run along the paths, if there are stresses."""
    from paraflex.figures.loads import stress_table

    loads = {tuple(names): mode.get("loads", {}) for names, mode in _runs(summaries)}
    print_table(console, stress_table(loads, _texts(summaries), largest=True), "Largest stress of every run")


def failures(console: Console, result: StudyResult, whose: str = "") -> None:
    """Print a line for each mode that did not run to its end."""
    reasons = list(result.failed.values())
    if result.data is not None:
        runs = [result.data.sel(mode=mode) for mode in result.data["mode"].values]
        ended = [run for run in runs if run["status"].item() not in DONE_STATUSES]
        reasons += [f'mode "{run["mode"].item()}": {run["message"].item()}' for run in ended]
    for reason in reasons:
        console.print(f"error: {whose}{reason}", soft_wrap=True)


def few(names: Sequence[Any], most: int) -> str:
    """Return the first `most` names as text, and how many more there are."""
    more = f" and {len(names) - most} more" if len(names) > most else ""
    return f"{', '.join(map(str, names[:most]))}{more}"
