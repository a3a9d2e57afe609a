"""Tables and lines that commands print."""

from __future__ import annotations

import json
import textwrap
from collections.abc import Container, Iterable, Iterator, Sequence
from contextlib import suppress
from pathlib import Path
from typing import TYPE_CHECKING, Any

from rich import box
from rich.console import Console, ConsoleOptions, RenderableType
from rich.segment import Segment
from rich.table import Table

from paraflex.errors import printable
from paraflex.findings import Finding
from paraflex.formatting import prefer_units
from .collected import printed

if TYPE_CHECKING:
    # Its import takes as long as all of `paraflex info`.
    from paraflex.figures.tables import Table as DescribedTable

# Gap between two columns, width at which headings are broken, and above which columns of words are [characters].
_BETWEEN, _HEAD, _WRAPPED = 2, 9, 26


def in_own_units(data: Any, folder: Path | None = None) -> Any:
    """Return results, to be shown in the units of the [units] of their model's file unless others are chosen.

    The model is part of a dataset or of plain numbers; that of a study of many designs is in its folder.
    """
    from paraflex.campaign import STUDY, read_study  # imports xarray

    with suppress(AttributeError, KeyError, TypeError, ValueError):
        if folder is not None and (folder / STUDY).is_file():
            model = read_study(folder / STUDY)["study"]["mechanism"]
        else:
            model = (data["parameters"] if isinstance(data, dict) else json.loads(data.attrs["parameters"]))["model"]
        prefer_units(model["units"])
    return data


def in_units_of(study: Any) -> Any:
    """Return a study, to be shown in the units of the [units] of its mechanism's file unless others are chosen."""
    prefer_units(study.setting.data.get("units", {}))
    return study


class PlainConsole(Console):
    """Console that prints text as it is, without markup: square brackets hold units here.

    Control characters, which names from files may hold, are printed as escapes.
    """

    def __init__(self, **how: Any) -> None:
        super().__init__(highlight=False, markup=False, **how)

    def render(self, renderable: RenderableType, options: ConsoleOptions | None = None) -> Iterable[Segment]:
        """Yield the segments to print; controls and styles of Rich are kept, as they are not part of the text."""
        for part in super().render(renderable, options):
            yield part if part.control else part._replace(text=printable(part.text))

    def print_lines(self, *lines: str) -> None:
        """Print lines that are not broken at the width of the console; empty ones are left out."""
        for line in filter(None, lines):
            self.print(line, soft_wrap=True)


def warn_of(console: PlainConsole, findings: Iterable[Finding], whose: str = "") -> None:
    """Print a line for each finding, which begins with `whose`."""
    from paraflex.results.findings import finding_lines  # imports xarray, which descriptions of mechanisms do not need

    findings = list(findings)
    console.print_lines(*(f"{whose}{line}" for line in finding_lines(findings)))
    printed(findings)


def plain_table(title: str | None = None) -> Table:
    """Return a table without frames."""
    return Table(title=title, title_justify="left", box=box.SIMPLE, collapse_padding=True, pad_edge=False)


def framed_table(title: str, headings: Iterable[str], right: Container[int] = ()) -> Table:
    """Return a table in a frame; `right` holds the indices of its columns of numbers."""
    table = Table(title=title, title_justify="left")
    for k, heading in enumerate(headings):
        table.add_column(heading, justify="right" if k in right else "left")
    return table


def print_tables(console: PlainConsole, tables: Iterable[DescribedTable]) -> None:
    """Print tables that have rows below their titles, a title that several share only once."""
    title = None
    for shown in filter(None, tables):
        print_table(console, shown, "" if shown.title == title else shown.title)
        title = shown.title


def print_table(console: PlainConsole, shown: DescribedTable, title: str | None = None) -> None:
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
    # Columns of words may be broken.
    least = [width if of_numbers else min(width, _WRAPPED) for width, of_numbers in zip(widths, numeric, strict=True)]
    for k, part in enumerate(_fitting(least, names, console.width - sum(least[:names]))):
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
        # A title of the table itself would be broken at the width of the table.
        console.print("continued" if k else shown.title if title is None else title, soft_wrap=True)
        console.print(table)


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
