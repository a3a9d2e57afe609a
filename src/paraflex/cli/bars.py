"""Bars of progress on stderr; of one that is no terminal nothing stays."""

from __future__ import annotations

from collections.abc import Iterator
from contextlib import contextmanager

from rich.console import Console
from rich.progress import BarColumn, Progress, ProgressColumn, TextColumn, TimeElapsedColumn

from paraflex.campaign import OnProgress


def bars(console: Console, *columns: str | ProgressColumn) -> Progress:
    """Bars with a description, and columns or texts of theirs."""
    shown = [TextColumn(each, markup=False) if isinstance(each, str) else each for each in columns]
    return Progress(
        TextColumn("{task.description}", markup=False), BarColumn(), *shown, console=console,
        transient=not console.is_terminal, refresh_per_second=4,
    )  # fmt: skip


@contextmanager
def counting(console: Console) -> Iterator[OnProgress]:
    """A bar of runs one after the other."""
    with bars(console, "{task.completed}/{task.total}", TimeElapsedColumn()) as progress:
        bar = progress.add_task("", total=None)
        yield lambda at: progress.update(bar, description=at.doing, completed=at.done, total=at.total)


@contextmanager
def begun_late(progress: Progress) -> Iterator[None]:
    """Bars that whoever tells of progress starts when there is something to tell: an error before is one line."""
    try:
        yield
    finally:
        if progress.live.is_started:
            progress.stop()
