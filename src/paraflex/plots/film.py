"""Films of runs as MP4, GIF, a sequence of PNG files, or one animated SVG; several modes side by side."""

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from pathlib import Path

import numpy as np
import xarray as xr

from paraflex.arguments import checked_arguments
from paraflex.errors import InputError
from paraflex.writing import whole_file, whole_folder
from .film_files import find_encoder, write_film
from .film_pictures import FOOT, HEAD, Film
from .scene import Scene, common_limits, default_magnification, run_times, scene, select
from .themes import theme

FILM_FORMATS = (".mp4", ".gif", ".svg", ".png")
# Shortest film at the default speed [s], the speeds from which that is chosen, and the largest number of pictures.
_SHORTEST_FILM = 5.0
_SPEEDS = tuple(step * 10.0**power for power in range(1, -7, -1) for step in (5.0, 2.0, 1.0))
_MOST_FRAMES = 20_000
# Number of points on the trail of a single picture.
_TRAIL = 400
_SMALLEST_PICTURE, _LARGEST_PICTURE = 64, 7680
_ELSEWHERE = "choose another place"


@dataclass(frozen=True)
class FilmOptions:
    """Options of a film.

    Attributes
    ----------
    magnify : float, optional
        Magnification of deflections; by default a round number at which bending is visible.
    fps : float
        Pictures per second; the period of a GIF is rounded to a multiple of 0.01 s.
    speed : float, optional
        Speed of the film relative to real time: 0.1 is ten times slower. By default a round value at which the film
        takes 5 s or more.
    size : (width, height), optional
        Size of the pictures [pixels]; by default fitted to the mechanism.
    theme : str
        Theme of colours, "light" (default) or "dark".
    at : float, optional
        Time of a single picture [s]; the middle of the run by default.
    model : str, optional
        Model of a verification; the reference model by default.
    point : str, optional
        Point "body.point" whose trail is drawn; the end-effector by default.
    """

    magnify: float | None = None
    fps: float = 30.0
    speed: float | None = None
    size: tuple[int, int] | None = None
    theme: str = "light"
    at: float | None = None
    model: str | None = None
    point: str | None = None


def plan_film(
    data: xr.Dataset, modes: Sequence[str] = (), options: FilmOptions | None = None, kind: str = ".mp4"
) -> Film:
    """Compute the scenes of a film at the times of its pictures.

    Parameters
    ----------
    data : xarray.Dataset
        Results of a run, with a path or without, or of a verification.
    modes : sequence of str
        Actuation modes drawn side by side; the first one by default.
    options : FilmOptions, optional
        Options of the film; their defaults if omitted.
    kind : str
        Suffix of the film, see `film_kind`: the pictures of a GIF are a multiple of 0.01 s apart, the times of a still
        picture end at its own.

    Returns
    -------
    Film

    Raises
    ------
    InputError
        An option is invalid, there is no such mode, model or point, or the results have no shapes.
    """
    options = options or FilmOptions()
    _check(options)
    runs = [select(data, mode, options.model) for mode in modes] or [select(data, None, options.model)]
    first, last = min(run_times(run)[0] for run in runs), max(run_times(run)[1] for run in runs)
    duration = last - first
    speed = options.speed
    if speed is None:
        # The highest round speed at which the film is not too short.
        speed = next((one for one in _SPEEDS if duration / one >= _SHORTEST_FILM), _SPEEDS[-1])
    fps = 100.0 / max(1, round(100.0 / options.fps)) if kind == ".gif" else options.fps
    if kind == ".png":
        at = 0.5 * (first + last) if options.at is None else options.at
        if not first <= at <= last:
            raise InputError("outside the run", field="at", value=at, remedy=f"choose it from {first:g} to {last:g} s")
        times = np.linspace(first, at, _TRAIL)
    else:
        count = round(duration / speed * fps) + 1
        if count > _MOST_FRAMES:
            raise InputError(
                f"the film would have {count} pictures, more than {_MOST_FRAMES}", field="speed", value=speed,
                remedy=f"choose a higher speed: the run takes {duration:g} s",
            )  # fmt: skip
        times = np.linspace(first, last, max(count, 2))
    magnify = default_magnification(runs) if options.magnify is None else options.magnify
    scenes = tuple(scene(run, times, magnify, options.point) for run in runs)
    size, look = _size(scenes, options.size), theme(options.theme)
    return Film(scenes, size, fps, speed, look, kind != ".png", options.point)


@checked_arguments()
def animate(
    data: xr.Dataset,
    file: str | Path,
    modes: Sequence[str] = (),
    options: FilmOptions | None = None,
    *,
    on_progress: Callable[[int, int], None] | None = None,
) -> Film:
    """Write a film of a run; the file appears whole or not at all.

    Parameters
    ----------
    data, modes, options
        Results, actuation modes and options, as for `plan_film`.
    file : str or Path
        File to write. The suffix selects the format: .mp4, .gif or .svg; .png is a single picture; a name without a
        suffix is a folder of PNG pictures, created if needed. Files of the same names are overwritten.
    on_progress : callable, optional
        Function called with the number of pictures drawn so far and their total number.

    Returns
    -------
    Film
        The scenes that were drawn.

    Raises
    ------
    InputError
        Invalid arguments as for `plan_film`, an unknown suffix, or no encoder for MP4.
    OutputError
        The file cannot be written, or the encoder failed.
    """
    file = Path(file)
    kind = film_kind(file)
    if kind == ".mp4":
        # Checked before any planning: there may be no encoder.
        find_encoder()
    film = plan_film(data, modes, options, kind)
    report = on_progress or (lambda done, total: None)
    whole = whole_file(file, remedy=_ELSEWHERE)
    if kind == "":
        whole = whole_folder(file, replaced="frame_*.png", remedy=_ELSEWHERE)
    with whole as unfinished:
        write_film(film, kind, unfinished, report)
    return film


def film_kind(file: Path) -> str:
    """Return the kind of film, the suffix of the file name; the empty suffix stands for a folder of pictures."""
    kind = file.suffix.lower()
    if kind in FILM_FORMATS or kind == "":
        return kind
    raise InputError(
        "unknown kind of film", field="output", value=str(file),
        remedy="end it in .mp4, .gif, .svg or .png (one picture), or name a folder for a sequence of PNG",
    )  # fmt: skip


def _check(options: FilmOptions) -> None:
    for name, value in (("fps", options.fps), ("speed", options.speed)):
        if value is not None and not (np.isfinite(value) and value > 0.0):
            raise InputError("must be positive", field=name, value=value, remedy="leave it out for the default")
    if options.fps > 240.0:
        raise InputError(
            "more pictures a second than a screen shows", field="fps", value=options.fps, remedy="30 is smooth"
        )
    for side in options.size or ():
        if not _SMALLEST_PICTURE <= side <= _LARGEST_PICTURE:
            raise InputError(
                f"not between {_SMALLEST_PICTURE} and {_LARGEST_PICTURE} pixels",
                field="size",
                value=side,
                remedy="give 1280x720",
            )


def _size(scenes: Sequence[Scene], size: tuple[int, int] | None) -> tuple[int, int]:
    """Return width and height in pixels, even as encoders require; by default fitted to the scenes."""
    if size is None:
        limits = common_limits(list(scenes))
        ratio = (limits.right - limits.left) / (limits.top - limits.bottom)
        count = len(scenes)
        height = 720.0 if count < 3 else 600.0
        inside = height * (1.0 - HEAD - FOOT)
        width = count * float(np.clip(ratio * inside, 0.75 * height, 1.6 * height))
        if width > 1920.0:
            width, height = 1920.0, max(height * 1920.0 / width, 360.0)
        size = round(width), round(height)
    return size[0] + size[0] % 2, size[1] + size[1] % 2
