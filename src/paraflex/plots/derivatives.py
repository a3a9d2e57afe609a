"""Figure of the derivatives of a run's metrics: elasticities as bars."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

import numpy as np
from matplotlib.figure import Figure

from paraflex.errors import InputError
from paraflex.plots.given import drawn
from paraflex.plots.labels import metric_name, plain
from paraflex.plots.layout import MM, is_narrow, lay_out, panels
from paraflex.plots.style import COLOURS, STYLE, ZERO

# Gap between the groups of bars of two metrics and height of a bar [mm]; part of the width of a letter of a name [em].
_GROUP_HEIGHT, _BAR, _LETTER = 2.4, 1.9, 0.2
_EM = STYLE["font.size"] / 72.0 * 25.4


@drawn
def elasticities(figures: Mapping[str, Any], run: int = 0) -> Figure:
    """Plot elasticities as bars: the change of each metric in per cent per one per cent change of each parameter."""
    if not 0 <= run < len(figures["runs"]):
        raise InputError("no such run", field="run", value=run, remedy=f"name one from 0 to {len(figures['runs']) - 1}")
    shown = figures["runs"][run]
    parameters, metrics = list(figures["parameters"]), list(shown["metrics"])
    figure, axes = panels(1, 1)
    panel = axes[0, 0]
    # Groups run from the top down, the parameters within a group likewise.
    pitch = len(parameters) * _BAR + _GROUP_HEIGHT
    places = -pitch * np.arange(len(metrics))
    for k, parameter in enumerate(parameters):
        values = [shown["metrics"][metric]["relative"][parameter] for metric in metrics]
        widths = [np.nan if value is None else value for value in values]
        offset = (0.5 * (len(parameters) - 1) - k) * _BAR
        panel.barh(places + offset, widths, 0.9 * _BAR, color=COLOURS[k % len(COLOURS)], label=parameter)
    panel.axvline(0.0, **ZERO)
    for place in places[:-1]:
        panel.axhline(place - 0.5 * pitch, color="0.9", linewidth=0.4)
    panel.set_ylim(places[-1] - 0.5 * pitch, 0.5 * pitch)
    panel.margins(x=0.06)
    panel.autoscale(axis="x")
    panel.set_yticks([])
    # The names of the metrics take half of the width, so the label must be short in one column.
    panel.set_xlabel("elasticity [% / %]" if is_narrow() else "change of the metric by change of the parameter [% / %]")
    panel.set_title(f"{figures['mechanism']}, {shown['path']}, {plain(shown['mode'])}", loc="left")
    lay_out(figure, axes, panel_height=pitch * len(metrics))
    _name_groups(panel, dict(zip(map(metric_name, metrics), places, strict=True)))
    return figure


def _name_groups(panel: Any, places: Mapping[str, float]) -> None:
    """Write the names of the metrics left of the panel and shrink the panel to make room for them."""
    left, bottom, width, height = panel.get_position().bounds
    room = _EM * (1.0 + max(len(name) for name in places) * (0.36 + _LETTER)) / (panel.figure.get_figwidth() / MM)
    panel.set_position((left + room, bottom, width - room, height))
    for name, place in places.items():
        panel.text(-0.008, place, name, transform=panel.get_yaxis_transform(), ha="right", va="center", clip_on=False)
