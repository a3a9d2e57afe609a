"""Figure of the lowest undamped mode shapes of a mechanism."""

from dataclasses import replace

import numpy as np
import xarray as xr
from matplotlib.figure import Figure

from paraflex.errors import InputError
from paraflex.figures.selection import default_mode, names_of, place_of
from paraflex.formatting import number
from paraflex.results.linear_motion import SWING, DrawnMode, drawn_modes, modal_motion
from paraflex.results.linear_summary import HELD_WORDS, HOLDINGS
from .drawing import pictures
from .given import drawn
from .labels import plain
from .layout import is_narrow
from .scene import Scene, scene
from .themes import theme

# Width of links relative to that in a film.
_WIDTH = 0.45
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
    titles = {holding: HELD_WORDS[holding] + (f", mode {plain(mode)}" if holding == "held" else "") for holding in rows}
    scenes = {
        titles[holding]: [(_scene(data, one), f"{number(one.frequency)} Hz") for one in shown]
        for holding, shown in rows.items()
    }
    columns = min(2 if is_narrow() else 4, max(map(len, rows.values())))
    return pictures(scenes, theme(theme_name), columns, _WIDTH, (0.4, 1.6))[0]


def _scene(data: xr.Dataset, one: DrawnMode) -> Scene:
    """Return the scene of a mode shape at its largest displacement."""
    shown = scene(modal_motion(data, one, _QUARTER, 0.6 * SWING), _QUARTER, 2.0)
    return replace(shown, trails=(), followed=())
