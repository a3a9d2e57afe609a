"""`paraflex animate`: a film of a run."""

from __future__ import annotations

import re
from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING

from rich.console import Console
from rich.progress import BarColumn, Progress, TaskProgressColumn, TextColumn, TimeRemainingColumn

from paraflex.cli.tables import plain_console
from paraflex.errors import InputError
from paraflex.results import open_results

if TYPE_CHECKING:
    from paraflex.plots.film import Film

COMPLETE, INTERRUPTED = 0, 130
# Options as the command spells them.
_FLAGS = ("magnify", "fps", "speed", "size", "theme", "at", "mode", "model")


@dataclass(frozen=True)
class AnimateRequest:
    """What `paraflex animate` was asked for."""

    results: str
    output: str
    modes: list[str]
    magnify: float
    fps: float
    speed: float | None
    size: str | None
    theme: str
    at: float | None
    model: str | None
    force: bool


def animate_command(request: AnimateRequest) -> int:
    """Draw the film; the exit code."""
    # Before Matplotlib, which takes its time: what is wrong is said at once.
    data = open_results(request.results)
    output = Path(request.output)
    refuse_existing(output, request.force)
    from paraflex.plots.film import FilmOptions, write_film

    console = plain_console(stderr=True)
    try:
        options = FilmOptions(
            magnify=request.magnify,
            fps=request.fps,
            speed=request.speed,
            size=None if request.size is None else _size(request.size),
            theme=request.theme,
            at=request.at,
            model=request.model,
        )
        film = _drawn(console, lambda report: write_film(data, output, request.modes, options, on_progress=report))
    except KeyboardInterrupt:
        console.print("interrupted: nothing was written")
        return INTERRUPTED
    except InputError as error:
        raise _at_fault(error, request) from None
    width, height = film.size
    if output.suffix.lower() == ".png":
        console.print(f"{width} x {height} pixels in {output}")
    else:
        duration = float(film.time[-1] - film.time[0]) / film.speed
        console.print(
            f"{len(film.time)} pictures, {duration:.3g} s at {film.speed:g} of the speed, {width} x {height} pixels in "
            f"{output}",
            soft_wrap=True,
        )
    return COMPLETE


def refuse_existing(output: Path, force: bool) -> None:
    """Nothing, if there is no file of that name, nor anything in a folder of it, or it may be written over.

    Raises
    ------
    InputError
        It may not.
    """
    if force or not output.exists() or (output.is_dir() and not any(output.iterdir())):
        return
    raise InputError(
        "exists already" if output.is_file() else "the folder holds files already",
        field=str(output),
        remedy="name another, or write over it with --force",
    )


def _drawn(console: Console, draw: Callable[[Callable[[int, int], None]], Film]) -> Film:
    """Draw, telling how far that is."""
    columns = (BarColumn(), TaskProgressColumn(), TimeRemainingColumn())
    progress = Progress(TextColumn("{task.description}"), *columns, console=console, transient=not console.is_terminal)
    bar = progress.add_task("pictures", total=None)

    def report(done: int, total: int) -> None:
        # Not before there is something to tell: an error is one line.
        progress.start()
        progress.update(bar, completed=done, total=total)

    try:
        return draw(report)
    finally:
        if progress.live.is_started:
            progress.stop()


def _size(text: str) -> tuple[int, int]:
    found = re.fullmatch(r"(\d+)[x×](\d+)", text)
    if found is None:
        raise InputError("not a size", field="size", value=text, remedy="write width and height, say 1280x720")
    return int(found[1]), int(found[2])


def _at_fault(error: InputError, request: AnimateRequest) -> InputError:
    """The same error, naming the option or file it came from."""
    field = {"results": request.results, "output": request.output}.get(error.field, error.field)
    if error.field in _FLAGS:
        field = f"--{error.field}"
    value = None if field == error.value else error.value
    return type(error)(error.problem, field=field, value=value, remedy=error.remedy)
