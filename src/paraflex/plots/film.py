"""Films of runs as MP4, GIF, a sequence of PNG files, or one animated SVG; several modes side by side.

Only a few pictures are in memory at a time.
"""

import re
import shutil
import subprocess
import tempfile
from collections.abc import Callable, Iterator, Sequence
from contextlib import suppress
from dataclasses import dataclass
from html import escape
from io import StringIO
from pathlib import Path
from typing import Any

import numpy as np
import xarray as xr
from matplotlib import rc_context, rcParams
from matplotlib.artist import Artist
from matplotlib.figure import Figure
from PIL import GifImagePlugin, Image, ImageChops

from paraflex.arguments import checked_arguments
from paraflex.errors import InputError, OutputError
from paraflex.formatting import number
from paraflex.interrupts import starting_processes
from paraflex.late import played, view
from paraflex.results.given import dataset_of
from paraflex.writing import whole_file, whole_folder
from .drawing import caption
from .film_pictures import FOOT, HEAD, Film, clock, frames, stage
from .labels import plain
from .scene import Scene, common_limits, default_magnification, run_times, scene, select
from .style import journal_style
from .svg import Pen, animated, moving_elements
from .themes import theme

Report = Callable[[int, int], None]

_GIF_COLOURS, _NEAR = 128, 12
# Trailer of a GIF file.
_TRAILER = b";"
# Key frames per second of an SVG, between which browsers interpolate linearly, and their largest number.
_KEY_FRAMES, _MOST_KEYS = 25.0, 400


def write_film(film: Film, kind: str, file: Path, report: Report) -> None:
    """Write a film of a kind that `film_kind` returns; for a sequence of pictures, `file` is an existing folder."""
    if kind == ".svg":
        file.write_text(_animated_svg(film), encoding="utf-8")
        report(len(film.time), len(film.time))
    elif kind == ".mp4":
        _write_mp4(film, file, find_encoder(), report)
    elif kind == ".gif":
        _write_gif(film, file, report)
    else:
        count, digits = len(film.time), max(4, len(str(len(film.time))))
        numbers = range(count) if kind == "" else [count - 1]
        for i, frame in enumerate(frames(film, numbers), 1):
            target = file / f"frame_{i:0{digits}d}.png" if kind == "" else file
            Image.fromarray(frame).convert("RGB").save(target, format="PNG")
            report(i, len(numbers))


def find_encoder() -> str:
    """Return the path of the MP4 encoder (ffmpeg); raise InputError if there is none."""
    found = shutil.which("ffmpeg")
    if found:
        return found
    try:
        import imageio_ffmpeg

        return imageio_ffmpeg.get_ffmpeg_exe()
    except (ImportError, RuntimeError):
        raise InputError(
            "no encoder for mp4 (ffmpeg) on this machine", field="output",
            remedy="install one with pip install 'paraflex[video]' (the package imageio-ffmpeg), or write .gif, .svg "
            "or a folder of PNG, which need none",
        ) from None  # fmt: skip


def _animated_svg(film: Film) -> str:
    """Return an SVG that plays in browsers: fixed parts from Matplotlib, moving parts as lists of values (SMIL)."""
    (width, height), time = film.size, film.time
    seconds = max(float(time[-1] - time[0]) / film.speed, 1e-3)
    count = min(time.size, _MOST_KEYS, round(seconds * _KEY_FRAMES) + 1)
    keys = np.unique(np.linspace(0, time.size - 1, count).round()).astype(int)
    with journal_style(), rc_context({"svg.fonttype": "none", "savefig.bbox": None}):
        rcParams["font.family"] = [*rcParams["font.family"], "sans-serif"]
        figure, sketches, texts = stage(film)
        texts[-1].set_text(f"t = {number(time[0])} to {clock(time[-1], time[-1])[4:]}")
        still = _still_svg(figure, [artist for sketch in sketches for artist in sketch.artists])
    moving = []
    for shown, sketch in zip(film.scenes, sketches, strict=True):
        box = sketch.axes.get_position()
        scale = box.width * width / (sketch.limits.right - sketch.limits.left)
        corner = box.x0 * width - scale * sketch.limits.left, (1.0 - box.y1) * height + scale * sketch.limits.top
        pen = Pen(corner, scale, min(box.width * width, box.height * height) / 480.0, film.look, seconds, keys)
        moving += moving_elements(shown, sketch.limits, pen)
    named = ", ".join(plain(shown.mode) for shown in film.scenes if shown.mode)
    title = f"{film.scenes[0].mechanism}{', mode ' + named if named else ''}: {caption(film.scenes[0])}"
    # SMIL cannot display a running time; a line fills instead.
    line = (
        f'<path d="M0 {height - 1.5}H{width}" stroke="{film.look.trail}" stroke-width="3" stroke-dasharray="{width}">'
    )
    view = f'viewBox="0 0 {width} {height}" width="{width}" height="{height}"'
    return "\n".join([
        f'<svg xmlns="http://www.w3.org/2000/svg" {view} style="max-width:100%;max-height:100vh" role="img">',
        f"<title>{escape(title)}</title>", f'<svg width="{width}" height="{height}" {still}', *moving,
        line + animated("stroke-dashoffset", [f"{width}", "0"], seconds) + "</path>", "</svg>", "",
    ])  # fmt: skip


def _still_svg(figure: Figure, moving: list[Artist]) -> str:
    """Return a figure without its moving parts as SVG, from its `viewBox` on.

    Its style rules are removed because they would apply to the whole document.
    """
    for artist in moving:
        artist.set_visible(False)
    out = StringIO()
    figure.savefig(out, format="svg", metadata=dict.fromkeys(("Creator", "Date", "Format", "Type")))
    text = re.sub(r"<defs>\s*<style.*?</defs>", "", out.getvalue(), flags=re.DOTALL)
    return text[text.index("viewBox=") :]


def _write_gif(film: Film, file: Path, report: Report) -> None:
    """Write a GIF with one palette for all pictures: fixed parts keep their colour, and the file is small.

    Pillow's own writer of animations keeps all pictures in memory; this one keeps two.
    """
    lasts = round(1000.0 / film.fps)
    pictures = _reduced(film, report)
    shown = next(pictures)
    with file.open("wb") as stream:
        stream.writelines(GifImagePlugin.getheader(shown, info={"loop": 0})[0])
        # Box of the part of the picture that is written, and the time for which it is shown [ms].
        box, duration = (0, 0, *shown.size), lasts
        for picture in pictures:
            changed = ImageChops.difference(picture, shown).getbbox()
            if changed is None:
                duration += lasts
                continue
            stream.writelines(GifImagePlugin.getdata(shown.crop(box), box[:2], duration=duration))
            shown, box, duration = picture, changed, lasts
        stream.writelines(GifImagePlugin.getdata(shown.crop(box), box[:2], duration=duration))
        stream.write(_TRAILER)


def _reduced(film: Film, report: Report) -> Iterator[Image.Image]:
    palette = _palette(film)
    for i, frame in enumerate(frames(film), 1):
        report(i, len(film.time))
        yield Image.fromarray(frame).convert("RGB").quantize(palette=palette, dither=Image.Dither.NONE)


def _palette(film: Film) -> Image.Image:
    """Return the palette of the colours of the first, the middle and the last picture."""
    few = list(frames(film, (0, len(film.time) // 2, len(film.time) - 1)))
    palette = Image.fromarray(np.concatenate(few)).convert("RGB").quantize(_GIF_COLOURS)
    # The background keeps its exact colour: colours near it are replaced by it.
    colours = np.array(palette.getpalette(), dtype=np.int64).reshape(-1, 3)
    ground = np.array(list(bytes.fromhex(film.look.ground[1:])))
    colours[np.max(np.abs(colours - ground), axis=1) < _NEAR] = ground
    palette.putpalette(colours.ravel().tolist())
    return palette


def _write_mp4(film: Film, file: Path, encoder: str, report: Report) -> None:
    width, height = film.size
    command = [
        encoder, "-y", "-loglevel", "error", "-f", "rawvideo", "-pix_fmt", "rgba", "-s", f"{width}x{height}",
        "-r", f"{film.fps:g}", "-i", "-", "-an", "-c:v", "libx264", "-preset", "veryfast", "-tune", "animation",
        "-crf", "18", "-pix_fmt", "yuv420p", "-movflags", "+faststart", "-f", "mp4", str(file),
    ]  # fmt: skip
    with tempfile.TemporaryFile() as messages:
        with starting_processes():
            process = subprocess.Popen(command, stdin=subprocess.PIPE, stderr=messages)
        assert process.stdin is not None
        try:
            for i, frame in enumerate(frames(film), 1):
                process.stdin.write(frame.tobytes())
                report(i, len(film.time))
            process.stdin.close()
            process.wait()
        except BrokenPipeError:
            process.wait()
        except BaseException:
            process.kill()
            process.wait()
            raise
        finally:
            if not process.stdin.closed:
                with suppress(BrokenPipeError):
                    process.stdin.close()
        if process.returncode:
            messages.seek(0)
            lines = messages.read().decode(errors="replace").strip().splitlines()
            raise OutputError(
                f"the encoder {encoder} gave up ({lines[-1] if lines else f'exit code {process.returncode}'})",
                field=str(file.with_suffix("")), remedy="write .gif, .svg or a folder of PNG instead",
            )  # fmt: skip


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
    point : str or sequence of str, optional
        Point "body.point" whose trail is drawn, or several; the end-effector by default.
    """

    magnify: float | None = None
    fps: float = 30.0
    speed: float | None = None
    size: tuple[int, int] | None = None
    theme: str = "light"
    at: float | None = None
    model: str | None = None
    point: str | Sequence[str] | None = None


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
    points = [options.point] if isinstance(options.point, str) else list(options.point or ())
    scenes = tuple(scene(run, times, magnify, points) for run in runs)
    size, look = _size(scenes, options.size), theme(options.theme)
    return Film(scenes, size, fps, speed, look, kind != ".png", points)


@checked_arguments()
def animate(
    data: Any,
    file: str | Path | None = None,
    modes: Sequence[str] = (),
    options: FilmOptions | None = None,
    *,
    on_progress: Callable[[int, int], None] | None = None,
) -> Film:
    """Make a film of a run, which notebooks show, and write it if a file is given, whole or not at all.

    Parameters
    ----------
    data : Any
        Run, result of a study, dataset, or folder of results.
    modes, options
        Actuation modes and options, as for `plan_film`.
    file : str or Path, optional
        File to write. The suffix selects the format: .mp4, .gif or .svg; .png is a single picture; a name without a
        suffix is a folder of PNG pictures, created if needed. Files of the same names are overwritten.
    on_progress : callable, optional
        Function called with the number of pictures drawn so far and their total number.

    Returns
    -------
    Film
        The scenes that were drawn; in notebooks an animated SVG.

    Raises
    ------
    InputError
        Invalid arguments as for `plan_film`, an unknown suffix, or no encoder for MP4.
    OutputError
        The file cannot be written, or the encoder failed.
    """
    kind = ".svg" if file is None else film_kind(Path(file))
    if kind == ".mp4":
        # Checked before any planning: there may be no encoder.
        find_encoder()
    film = plan_film(dataset_of(data, "data"), modes, options, kind)
    if file is None:
        return film
    report = on_progress or (lambda done, total: None)
    whole = whole_file(Path(file), remedy=_ELSEWHERE)
    if kind == "":
        whole = whole_folder(Path(file), replaced="frame_*.png", remedy=_ELSEWHERE)
    with whole as unfinished:
        write_film(film, kind, unfinished, report)
    return film


@view.register(Film)
def film_html(film: Film) -> str | None:
    """Return the view of a film, an animated SVG; None for a single picture, of which notebooks show the text."""
    return _animated_svg(film) if film.plays else None


played.register(object)(animate)


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
