"""Pictures of a film, drawn one after the other by Matplotlib."""

import math
from collections.abc import Iterable, Iterator, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
from matplotlib.backends.backend_agg import FigureCanvasAgg
from matplotlib.figure import Figure

from paraflex.arrays import Array, NDArray
from paraflex.display import Shown
from paraflex.formatting import number
from .drawing import Sketch, bare, caption, draw_load_keys, draw_scale_bar, name_links
from .labels import plain
from .scene import Scene, common_limits
from .style import journal_style
from .themes import Theme

# Shares of the picture's height above and below the drawing.
HEAD, FOOT = 0.105, 0.11


@dataclass(frozen=True)
class Film(Shown):
    """Film ready to be drawn: the scenes of all its panels at the times of its pictures.

    Attributes
    ----------
    scenes : tuple of Scene
        Scene of each panel.
    size : (width, height)
        Size of a picture [pixels].
    fps : float
        Pictures per second.
    speed : float
        Speed of the film relative to real time.
    look : Theme
        Colours.
    plays : bool
        Whether the film has several pictures (default) or is a still picture.
    points : sequence of str
        Requested points "body.point" whose trails are drawn; empty for those drawn by default.
    """

    scenes: tuple[Scene, ...]
    size: tuple[int, int]
    fps: float
    speed: float
    look: Theme
    plays: bool = True
    points: Sequence[str] = ()

    @property
    def caption(self) -> str:
        """Text that states the magnification, the speed, and the requested points whose trails are drawn."""
        trail = f", trail of {', '.join(map(plain, self.points))}" if self.points else ""
        return caption(self.scenes[0]) + (f", speed × {self.speed:g}" if self.plays else "") + trail

    @property
    def time(self) -> Array:
        """Times of the run in the pictures [s]."""
        return self.scenes[0].time


def frames(film: Film, numbers: Iterable[int] | None = None) -> Iterator[NDArray[np.uint8]]:
    """Yield pictures (height, width, 4) of a film by their numbers, by default all; fixed parts are drawn only once."""
    with journal_style():
        figure, sketches, texts = stage(film)
        canvas = FigureCanvasAgg(figure)
        moving = [artist for sketch in sketches for artist in sketch.artists]
        for artist in (*moving, *texts):
            artist.set_animated(True)
        canvas.draw()
        background = canvas.copy_from_bbox(figure.bbox)
    # No setting of Matplotlib is changed while a caller has a picture, or leaves the others out.
    for i in range(len(film.time)) if numbers is None else numbers:
        time = film.time[i]
        with journal_style():
            canvas.restore_region(background)
            for sketch, text in zip(sketches, texts[:-1], strict=True):
                sketch.show(i)
                over = time > sketch.scene.reached + 1e-12
                text.set_text(f"ended at {number(sketch.scene.reached)} s" if over else "")
                for artist in sketch.artists:
                    sketch.axes.draw_artist(artist)
                figure.draw_artist(text)
            texts[-1].set_text(clock(time, float(film.time[-1])))
            figure.draw_artist(texts[-1])
            picture = np.array(canvas.buffer_rgba())
        yield picture


def clock(time: float, last: float) -> str:
    """Return the text of a time [s], with the same number of decimals throughout a film that ends at `last`."""
    digits = max(0, 2 - math.floor(math.log10(last))) if last > 0.0 else 3
    return f"t = {time:.{min(digits, 6)}f} s"


def stage(film: Film) -> tuple[Figure, list[Sketch], list[Any]]:
    """Return the figure, the sketches of its panels, and the texts that change: one per panel, then the clock."""
    width, height = film.size
    count = len(film.scenes)
    # Text and lines keep their size relative to the picture, whatever its number of pixels.
    dpi = min(height / 5.0, width / count / 4.6)
    figure = Figure(figsize=(width / dpi, height / dpi), dpi=dpi, facecolor=film.look.ground)
    limits = common_limits(list(film.scenes)).fitted(width / count / (height * (1.0 - HEAD - FOOT)))
    sketches, texts = [], []
    look = film.look
    for k, shown in enumerate(film.scenes):
        axes = figure.add_axes((k / count, FOOT, 1.0 / count, 1.0 - HEAD - FOOT))
        sketches.append(Sketch(bare(axes, limits), shown, limits, look))
        middle = (k + 0.5) / count
        if count > 1 or shown.mode:
            label = f"mode {plain(shown.mode)}"
            figure.text(middle, 0.925, label, color=look.ink, fontsize=10.5, ha="center", va="center")
        texts.append(figure.text(middle, 0.885, "", color=look.trail, fontsize=9.0, ha="center", va="center"))
    first = film.scenes[0]
    margin = 0.18 / (width / dpi)
    figure.text(margin, 0.972, first.mechanism, color=look.ink, fontsize=10.5, va="center", parse_math=False)
    figure.text(margin, 0.03, film.caption, color=look.earth, fontsize=9.0, va="center")
    draw_scale_bar(figure, limits, look, (1.0 - margin, 0.022), 9.0, share=1.0 / count)
    draw_load_keys(figure, first, limits, look, (margin, 0.925), 9.0, share=1.0 / count)
    name_links(figure, first, look, 8.0, 0.088)
    texts.append(
        figure.text(1.0 - margin, 0.972, "", color=look.ink, fontsize=10.5, ha="right", va="center", parse_math=False)
    )
    return figure, sketches, texts
