"""Files of films: MP4, GIF, one animated SVG, one or many PNG files; only a few pictures are in memory at a time."""

import re
import shutil
import subprocess
import tempfile
from collections.abc import Callable, Iterator
from contextlib import suppress
from html import escape
from io import StringIO
from pathlib import Path

import numpy as np
from matplotlib import rc_context
from matplotlib.artist import Artist
from matplotlib.figure import Figure
from PIL import GifImagePlugin, Image, ImageChops

from paraflex.errors import InputError, OutputError
from paraflex.interrupts import starting_processes
from .drawing import caption
from .film_pictures import Film, clock, frames, stage
from .labels import plain
from .style import journal_style
from .svg import Pen, animated, moving_elements

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
    with journal_style(), rc_context({"svg.fonttype": "none", "font.family": ["DejaVu Sans", "sans-serif"]}):
        figure, sketches, texts = stage(film)
        texts[-1].set_text(f"t = {time[0]:.4g} to {clock(time[-1], time[-1])[4:]}")
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
