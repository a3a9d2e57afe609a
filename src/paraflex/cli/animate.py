"""`paraflex animate`: a film, or pictures, of a run."""

import re
from pathlib import Path

from rich.progress import TaskProgressColumn, TimeRemainingColumn

from paraflex.errors import InputError
from paraflex.formatting import number
from paraflex.results import open_results
from . import COMPLETE, signals
from .bars import late_bar
from .commands.results import AnimateRequest
from .replacing import refuse_existing
from .tables import PlainConsole

# Fields of `FilmOptions` that are passed on unchanged.
_OPTIONS = ("magnify", "fps", "speed", "theme", "at", "model", "point")


def animate_command(request: AnimateRequest) -> int:
    """Draw the film; return the exit code."""
    # These checks come before the slow import of Matplotlib, so that errors are reported at once.
    data = open_results(request.results)
    output = Path(request.output)
    refuse_existing(output, request.force)
    from paraflex.plots.film import FilmOptions, animate

    console = PlainConsole(stderr=True)
    try:
        size = None if request.size is None else _size(request.size)
        options = FilmOptions(size=size, **{name: getattr(request, name) for name in _OPTIONS})
        with late_bar(console, "pictures", None, TaskProgressColumn(), TimeRemainingColumn()) as update:
            film = animate(
                data, output, request.modes, options,
                on_progress=lambda done, total: update(completed=done, total=total),
            )  # fmt: skip
    except KeyboardInterrupt:
        console.print("interrupted: nothing was written")
        return signals.exit_code()
    except InputError as error:
        raise _located_error(error, request) from None
    width, height = film.size
    if output.suffix.lower() == ".png":
        console.print(f"{width} x {height} pixels in {output}")
    else:
        duration = float(film.time[-1] - film.time[0]) / film.speed
        console.print_lines(
            f"{len(film.time)} pictures, {number(duration, 3)} s at {film.speed:g} of the speed, {width} x {height} "
            f"pixels in {output}"
        )
    return COMPLETE


def _size(text: str) -> tuple[int, int]:
    found = re.fullmatch(r"(\d+)[x×](\d+)", text)
    if found is None:
        raise InputError("not a size", field="size", value=text, remedy="write width and height, such as 1280x720")
    return int(found[1]), int(found[2])


def _located_error(error: InputError, request: AnimateRequest) -> InputError:
    """Return the same error, naming the option or file it came from."""
    field = {"results": request.results, "output": request.output}.get(error.field, error.field)
    if error.field in (*_OPTIONS, "size", "mode"):
        field = f"--{error.field}"
    value = None if field == error.value else error.value
    return type(error)(error.problem, field=field, value=value, remedy=error.remedy)
