"""Progress bars on stderr; they are removed at the end if stderr is not a terminal."""

from collections.abc import Callable, Iterator
from contextlib import contextmanager
from typing import Any

from rich.console import Console
from rich.progress import BarColumn, Progress, ProgressColumn, TextColumn, TimeElapsedColumn

from paraflex.campaign import OnProgress


def bars(console: Console, *columns: str | ProgressColumn) -> Progress:
    """Return progress bars with a description, followed by the given columns or texts."""
    shown = [TextColumn(each, markup=False) if isinstance(each, str) else each for each in columns]
    return Progress(
        TextColumn("{task.description}", markup=False), BarColumn(), *shown, console=console,
        transient=not console.is_terminal, refresh_per_second=4,
    )  # fmt: skip


@contextmanager
def counting(console: Console) -> Iterator[OnProgress]:
    """Show a progress bar for consecutive runs; yield the callback that updates it."""
    with bars(console, "{task.completed}/{task.total}", TimeElapsedColumn()) as progress:
        bar = progress.add_task("", total=None)
        yield lambda at: progress.update(bar, description=at.doing, completed=at.done, total=at.total)


@contextmanager
def late_bar(
    console: Console, description: str, total: float | None, *columns: ProgressColumn
) -> Iterator[Callable[..., None]]:
    """Provide a progress bar that appears at the first report, so that an error before it prints one line only.

    The function that is yielded updates the fields of the bar, such as `completed`.
    """
    progress = bars(console, *columns)
    bar = progress.add_task(description, total=total)

    def update(**state: Any) -> None:
        progress.start()
        progress.update(bar, **state)

    try:
        yield update
    finally:
        if progress.live.is_started:
            progress.stop()
