"""Films of runs: mp4, gif, a sequence of PNG, or one animated SVG; several modes side by side."""

from __future__ import annotations

import math
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
from matplotlib import rc_context
from matplotlib.artist import Artist
from matplotlib.backends.backend_agg import FigureCanvasAgg
from matplotlib.figure import Figure
from numpy.typing import NDArray
from PIL import Image

from paraflex.errors import InputError, OutputError
from paraflex.plots.drawing import Sketch, bare, caption, draw_scale_bar, name_links
from paraflex.plots.labels import mode_label
from paraflex.plots.scene import Scene, at_times, common_limits, run_times, scene, select
from paraflex.plots.style import journal_style
from paraflex.plots.svg import Pen, animated, moving_elements
from paraflex.plots.themes import Theme, theme
from paraflex.writing import whole_file, whole_folder

FILM_FORMATS = (".mp4", ".gif", ".svg", ".png")
# A film of less is not worth looking at, one of more tires; speeds to choose from [s].
_SHORTEST_FILM = 5.0
_SPEEDS = tuple(step * 10.0**power for power in range(1, -7, -1) for step in (5.0, 2.0, 1.0))
_MOST_FRAMES = 20_000
# Places on the trail of a single picture.
_TRAIL = 400
_SMALLEST_PICTURE, _LARGEST_PICTURE = 64, 7680
# Parts of the picture's height above and below the drawing.
_HEAD, _FOOT = 0.105, 0.11
_GIF_COLOURS, _NEAR = 128, 12
# Key frames a second of an SVG; browsers go on evenly between them.
_KEY_FRAMES, _MOST_KEYS = 25.0, 400
_ELSEWHERE = "choose another place"


@dataclass(frozen=True)
class FilmOptions:
    """Options of a film.

    Attributes
    ----------
    magnify : float
        How many times deflections are drawn.
    fps : float
        Pictures a second; GIFs count in hundredths of a second.
    speed : float, optional
        Of the film against time: 0.1 is ten times slower. By default a round one at which it takes 5 s or more.
    size : (width, height), optional
        [pixels]
    theme : str
        "light" or "dark".
    at : float, optional
        Of a single picture [s]; half way by default.
    model : str, optional
        Of a verification; the reference by default.
    """

    magnify: float = 1.0
    fps: float = 30.0
    speed: float | None = None
    size: tuple[int, int] | None = None
    theme: str = "light"
    at: float | None = None
    model: str | None = None


@dataclass(frozen=True)
class Film:
    """A film that can be drawn: scenes of all its panels at the times of its pictures."""

    scenes: tuple[Scene, ...]
    size: tuple[int, int]
    fps: float
    speed: float
    look: Theme
    plays: bool = True

    @property
    def caption(self) -> str:
        """Text on the magnification and the speed."""
        return caption(self.scenes[0]) + (f", speed × {self.speed:g}" if self.plays else "")

    @property
    def time(self) -> NDArray[np.float64]:
        """Time of the run in each picture [s]."""
        return self.scenes[0].time


def plan_film(
    data: xr.Dataset, modes: Sequence[str] = (), options: FilmOptions | None = None, kind: str = ".mp4"
) -> Film:
    """Scenes of a film, and their times.

    Parameters
    ----------
    data : xarray.Dataset
        Of a run, with a path or without, or of a verification.
    modes : sequence of str
        Side by side; the first by default.
    options : FilmOptions, optional
    kind : str
        See `film_kind`: pictures of a GIF are a multiple of 0.01 s apart, of a still all lie before it.

    Raises
    ------
    InputError
        An option that makes no sense, no such mode or model, or results without shapes.
    """
    options = options or FilmOptions()
    _check(options)
    runs = [select(data, mode, options.model) for mode in modes] or [select(data, None, options.model)]
    first, last = min(run_times(run)[0] for run in runs), max(run_times(run)[1] for run in runs)
    duration = last - first
    speed = options.speed
    if speed is None:
        # The highest round speed at which a run is not over too soon.
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
    scenes = tuple(scene(run, times, options.magnify) for run in runs)
    return Film(scenes, _size(scenes, options.size), fps, speed, theme(options.theme), kind != ".png")


def animate(
    data: xr.Dataset,
    file: str | Path,
    modes: Sequence[str] = (),
    options: FilmOptions | None = None,
    *,
    on_progress: Callable[[int, int], None] | None = None,
) -> Film:
    """Write a film; it appears whole or not at all.

    Parameters
    ----------
    data, modes, options
        See `plan_film`.
    file : str or Path
        Its ending says the kind: .mp4, .gif, .svg; .png is one picture; without one a folder of PNG pictures, made if
        it is not there. Files of the same names are written over.
    on_progress : callable, optional
        Called with how many pictures are drawn, and of how many.

    Raises
    ------
    InputError
        See `plan_film`; an ending that means nothing; no encoder for mp4.
    OutputError
        It cannot be written, or the encoder gave up.
    """
    file = Path(file)
    kind = film_kind(file)
    encoder = find_encoder() if kind == ".mp4" else ""
    film = plan_film(data, modes, options, kind)
    report = on_progress or (lambda done, total: None)
    whole = whole_file(file, remedy=_ELSEWHERE)
    if kind == "":
        whole = whole_folder(file, replaced="frame_*.png", remedy=_ELSEWHERE)
    with whole as unfinished:
        if kind == ".svg":
            unfinished.write_text(_animated_svg(film), encoding="utf-8")
            report(len(film.time), len(film.time))
        elif kind == ".mp4":
            _write_mp4(film, unfinished, encoder, report)
        elif kind == ".gif":
            _write_gif(film, unfinished, report)
        elif kind == ".png":
            still = next(_frames(film, len(film.time) - 1))
            Image.fromarray(still).convert("RGB").save(unfinished, format="PNG")
            report(1, 1)
        else:
            digits = max(4, len(str(len(film.time))))
            for i, frame in enumerate(_frames(film), 1):
                Image.fromarray(frame).convert("RGB").save(unfinished / f"frame_{i:0{digits}d}.png")
                report(i, len(film.time))
    return film


def film_kind(file: Path) -> str:
    """The kind of film by the suffix of a name; a name without a suffix is a folder of pictures."""
    kind = file.suffix.lower()
    if kind in FILM_FORMATS or kind == "":
        return kind
    raise InputError(
        "unknown kind of film", field="output", value=str(file),
        remedy="end it in .mp4, .gif, .svg or .png (one picture), or name a folder for a sequence of PNG",
    )  # fmt: skip


def find_encoder() -> str:
    """The program that makes mp4."""
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
                remedy="say 1280x720",
            )


def _size(scenes: Sequence[Scene], size: tuple[int, int] | None) -> tuple[int, int]:
    """Width and height in pixels, even as encoders want them; by default fitted to what is shown."""
    if size is None:
        limits = common_limits(list(scenes))
        ratio = (limits.right - limits.left) / (limits.top - limits.bottom)
        count = len(scenes)
        height = 720.0 if count < 3 else 600.0
        inside = height * (1.0 - _HEAD - _FOOT)
        width = count * float(np.clip(ratio * inside, 0.75 * height, 1.6 * height))
        if width > 1920.0:
            width, height = 1920.0, max(height * 1920.0 / width, 360.0)
        size = round(width), round(height)
    return size[0] + size[0] % 2, size[1] + size[1] % 2


# --- Pictures --------------------------------------------------------------------------------------------------------


def _frames(film: Film, start: int = 0) -> Iterator[NDArray[np.uint8]]:
    """Pictures (height, width, 4) in succession, from a first one on; fixed parts are drawn once."""
    with journal_style():
        figure, sketches, texts = _stage(film)
        canvas = FigureCanvasAgg(figure)
        moving = [artist for sketch in sketches for artist in sketch.artists]
        for artist in (*moving, *texts):
            artist.set_animated(True)
        canvas.draw()
        background = canvas.copy_from_bbox(figure.bbox)
        for i in range(start, len(film.time)):
            time = film.time[i]
            canvas.restore_region(background)
            for sketch, text in zip(sketches, texts[:-1], strict=True):
                sketch.show(i)
                over = time > sketch.scene.reached + 1e-12
                text.set_text(f"ended at {sketch.scene.reached:.4g} s" if over else "")
                for artist in sketch.artists:
                    sketch.axes.draw_artist(artist)
                figure.draw_artist(text)
            texts[-1].set_text(clock(time, float(film.time[-1])))
            figure.draw_artist(texts[-1])
            yield np.array(canvas.buffer_rgba())


def clock(time: float, last: float) -> str:
    """Time of a picture, with a fixed number of digits."""
    digits = max(0, 2 - math.floor(math.log10(last))) if last > 0.0 else 3
    return f"t = {time:.{min(digits, 6)}f} s"


def _stage(film: Film) -> tuple[Figure, list[Sketch], list[Any]]:
    """The figure, its sketches, and the texts that change: one per panel, then the clock."""
    width, height = film.size
    count = len(film.scenes)
    # Text and lines are of one size against the picture, whatever its pixels.
    dpi = min(height / 5.0, width / count / 4.6)
    figure = Figure(figsize=(width / dpi, height / dpi), dpi=dpi, facecolor=film.look.ground)
    limits = common_limits(list(film.scenes)).fitted(width / count / (height * (1.0 - _HEAD - _FOOT)))
    sketches, texts = [], []
    look = film.look
    for k, shown in enumerate(film.scenes):
        axes = figure.add_axes((k / count, _FOOT, 1.0 / count, 1.0 - _HEAD - _FOOT))
        sketches.append(Sketch(bare(axes, limits), shown, limits, look))
        middle = (k + 0.5) / count
        if count > 1 or shown.mode:
            label = f"mode {mode_label(shown.mode)}"
            figure.text(middle, 0.925, label, color=look.ink, fontsize=10.5, ha="center", va="center")
        texts.append(figure.text(middle, 0.885, "", color=look.trail, fontsize=9.0, ha="center", va="center"))
    first = film.scenes[0]
    margin = 0.18 / (width / dpi)
    figure.text(margin, 0.972, first.mechanism, color=look.ink, fontsize=10.5, va="center", parse_math=False)
    figure.text(margin, 0.03, film.caption, color=look.earth, fontsize=9.0, va="center")
    draw_scale_bar(figure, limits, look, (1.0 - margin, 0.022), 9.0, share=1.0 / count)
    name_links(figure, first, look, 8.0, 0.088)
    texts.append(
        figure.text(1.0 - margin, 0.972, "", color=look.ink, fontsize=10.5, ha="right", va="center", parse_math=False)
    )
    return figure, sketches, texts


# --- Files -----------------------------------------------------------------------------------------------------------


def _animated_svg(film: Film) -> str:
    """One animated file for browsers: fixed parts from Matplotlib, moving parts as values in time (SMIL)."""
    (width, height), time = film.size, film.time
    seconds = max(float(time[-1] - time[0]) / film.speed, 1e-3)
    count = min(time.size, _MOST_KEYS, round(seconds * _KEY_FRAMES) + 1)
    keys = np.unique(np.linspace(0, time.size - 1, count).round()).astype(int)
    with journal_style(), rc_context({"svg.fonttype": "none", "font.family": ["DejaVu Sans", "sans-serif"]}):
        figure, sketches, texts = _stage(film)
        texts[-1].set_text(f"t = {time[0]:.4g} to {clock(time[-1], time[-1])[4:]}")
        still = _still_svg(figure, [artist for sketch in sketches for artist in sketch.artists])
    moving = []
    for shown, sketch in zip(film.scenes, sketches, strict=True):
        box = sketch.axes.get_position()
        scale = box.width * width / (sketch.limits.right - sketch.limits.left)
        corner = box.x0 * width - scale * sketch.limits.left, (1.0 - box.y1) * height + scale * sketch.limits.top
        pen = Pen(corner, scale, min(box.width * width, box.height * height) / 480.0, film.look, seconds)
        moving += moving_elements(at_times(shown, keys), sketch.limits, pen)
    named = ", ".join(mode_label(shown.mode) for shown in film.scenes if shown.mode)
    title = f"{film.scenes[0].mechanism}{', mode ' + named if named else ''}: {caption(film.scenes[0])}"
    # SMIL cannot count: a line fills as time passes.
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
    """A figure without moving parts as SVG, from its `viewBox` on, without its global style rules."""
    for artist in moving:
        artist.set_visible(False)
    out = StringIO()
    figure.savefig(out, format="svg", metadata=dict.fromkeys(("Creator", "Date", "Format", "Type")))
    text = re.sub(r"<defs>\s*<style.*?</defs>", "", out.getvalue(), flags=re.DOTALL)
    return text[text.index("viewBox=") :]


def _write_gif(film: Film, file: Path, report: Callable[[int, int], None]) -> None:
    """Write a GIF with one palette for all pictures: fixed parts keep their colour, and files are small."""
    total = len(film.time)
    frames = _frames(film)
    palette = _palette(film)

    def reduced() -> Iterator[Image.Image]:
        for i, frame in enumerate(frames, 1):
            report(i, total)
            yield Image.fromarray(frame).convert("RGB").quantize(palette=palette, dither=Image.Dither.NONE)

    pictures = reduced()
    with file.open("wb") as stream:
        next(pictures).save(
            stream, format="GIF", save_all=True, append_images=pictures, duration=round(1000.0 / film.fps), loop=0,
            optimize=False,
        )  # fmt: skip


def _palette(film: Film) -> Image.Image:
    """Colours of the first, a middle and the last picture."""
    chosen = np.array([0, len(film.time) // 2, len(film.time) - 1])
    scenes = tuple(at_times(shown, chosen) for shown in film.scenes)
    few = Film(scenes, film.size, film.fps, film.speed, film.look)
    palette = Image.fromarray(np.concatenate(list(_frames(few)))).convert("RGB").quantize(_GIF_COLOURS)
    # The background colour is exact; no similar colour replaces it.
    colours = np.array(palette.getpalette(), dtype=np.int64).reshape(-1, 3)
    ground = np.array(list(bytes.fromhex(film.look.ground[1:])))
    colours[np.max(np.abs(colours - ground), axis=1) < _NEAR] = ground
    palette.putpalette(colours.ravel().tolist())
    return palette


def _write_mp4(film: Film, file: Path, encoder: str, report: Callable[[int, int], None]) -> None:
    width, height = film.size
    command = [
        encoder, "-y", "-loglevel", "error", "-f", "rawvideo", "-pix_fmt", "rgba", "-s", f"{width}x{height}",
        "-r", f"{film.fps:g}", "-i", "-", "-an", "-c:v", "libx264", "-preset", "veryfast", "-tune", "animation",
        "-crf", "18", "-pix_fmt", "yuv420p", "-movflags", "+faststart", "-f", "mp4", str(file),
    ]  # fmt: skip
    with tempfile.TemporaryFile() as said:
        # In a session of its own: Ctrl-C is ours to answer.
        process = subprocess.Popen(command, stdin=subprocess.PIPE, stderr=said, start_new_session=True)
        assert process.stdin is not None
        try:
            for i, frame in enumerate(_frames(film), 1):
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
            said.seek(0)
            lines = said.read().decode(errors="replace").strip().splitlines()
            raise OutputError(
                f"the encoder {encoder} gave up ({lines[-1] if lines else f'exit code {process.returncode}'})",
                field=str(file.with_suffix("")), remedy="write .gif, .svg or a folder of PNG instead",
            )  # fmt: skip
