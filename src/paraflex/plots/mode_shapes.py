"""Figure of the lowest undamped mode shapes of a mechanism."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import xarray as xr
from matplotlib.figure import Figure

from paraflex.errors import InputError
from paraflex.figures.selection import default_mode, names_of, place_of
from paraflex.formatting import number
from paraflex.plots.drawing import Sketch, bare
from paraflex.plots.given import drawn
from paraflex.plots.labels import plain
from paraflex.plots.layout import MM, TWO_COLUMNS, is_narrow, page_width
from paraflex.plots.scene import Scene, common_limits, scene
from paraflex.plots.themes import theme
from paraflex.results.linear_motion import SWING, DrawnMode, drawn_modes, modal_motion
from paraflex.results.linear_summary import HELD_WORDS, HOLDINGS

# Heights of the titles of a panel and of a row [mm].
_TITLE, _ROW = 4.5, 5.0
# Phase of the largest displacement [rad]. Shapes are magnified twice because a magnified scene includes the undeformed
# mechanism.
_QUARTER = np.array([np.pi / 2.0])


@drawn
def mode_shapes(data: xr.Dataset, mode: str | None = None, count: int = 4, theme_name: str = "light") -> Figure:
    """Draw the shapes of the lowest undamped modes that vibrate: motors free above, the mode's motors held below.

    The undeformed mechanism is pale. Displacements are linear and scaled to one size.

    Parameters
    ----------
    count : int
        Number of shapes with motors free, and of those with motors held.
    theme_name : str
        Theme of colours, "light" (default) or "dark".
    """
    mode = default_mode(data) if mode is None else mode
    place_of(mode, names_of(data, "mode"), "mode")
    own = [one for one in drawn_modes(data, rigid=False) if one.mode in ("", mode)]
    rows = {holding: [one for one in own if one.holding == holding][: max(count, 1)] for holding in HOLDINGS}
    rows = {holding: shown for holding, shown in rows.items() if shown}
    if not rows:
        raise InputError("nothing vibrates", field="data", remedy="look at the poles")
    scenes = {
        one: replace(scene(modal_motion(data, one, _QUARTER, 0.6 * SWING), _QUARTER, 2.0), trail=None, followed=None)
        for shown in rows.values()
        for one in shown
    }
    return _panels(rows, scenes, mode, theme_name)


def _panels(rows: dict[str, list[DrawnMode]], scenes: dict[DrawnMode, Scene], mode: str, theme_name: str) -> Figure:
    """Draw a panel for each shape; motors free and motors held each have a row, or more rows if the page is narrow."""
    look, width = theme(theme_name), page_width(TWO_COLUMNS)
    columns = min(2 if is_narrow() else 4, max(map(len, rows.values())))
    (limits, aspect), wide = common_limits([*scenes.values()]).filling(0.4, 1.6), width / columns
    high = wide * aspect + _TITLE
    lines = {holding: -(-len(shown) // columns) for holding, shown in rows.items()}
    height = sum(lines.values()) * high + len(rows) * _ROW
    figure, top = Figure(figsize=(width * MM, height * MM), facecolor=look.ground), height
    for holding, shown in rows.items():
        title = f"{HELD_WORDS[holding]}" + (f", mode {plain(mode)}" if holding == "held" else "")
        figure.text(0.01, (top - 0.8) / height, title, va="top", fontsize=8.0, color=look.ink, fontweight="bold")
        top -= _ROW
        for k, one in enumerate(shown):
            line, column = divmod(k, columns)
            bottom = top - (line + 1) * high
            axes = bare(
                figure.add_axes((column / columns, bottom / height, 1.0 / columns, wide * aspect / height)), limits
            )
            Sketch(axes, scenes[one], limits, look, width=0.45).show(0)
            axes.set_title(f"{number(one.frequency)} Hz", fontsize=8.0, color=look.ink, pad=1.0)
        top -= lines[holding] * high
    return figure
