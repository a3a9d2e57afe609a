"""Charts that several reports have: families of curves by run and by part of the mechanism."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray

from paraflex.plots.labels import display_unit, text_symbol
from paraflex.plots.workspace import round_magnification
from paraflex.report.page import Chart, Curve, Look

# What the page has, a solid line among the dashes.
COLOURS, DASHES = 8, 5
DOTTED = 2
MOST_SAMPLES = 2000
# What the charts of tip displacements show: a deflection is from a link's chord.
TIP_TITLE, TIP_LABEL = "Displacements of the links' ends across them", "transverse displacement of the tip"
TIP_NOTE = "Of a link's last end from the tangent at its first end."


def look(k: int) -> Look:
    """Colour and dash of the k-th of many curves: no two alike, and apart without colour where few."""
    return Look(k % COLOURS, (k % COLOURS + k // COLOURS) % DASHES)


def followed(
    identity: str,
    title: str,
    label: str,
    unit: str,
    values: NDArray[np.float64],
    parts: Sequence[str],
    runs: Sequence[str],
    *,
    desired: NDArray[np.float64] | None = None,
    selecting: str = "mode",
    choosing: str = "link",
    note: str = "",
) -> Chart:
    """Curves over time of the selected run, one for each part; or those of one part in all runs, if there are more.

    Parameters
    ----------
    identity, title, label, unit : str
        Of the chart; what stands at its vertical axis; the unit of the values.
    values : (runs, samples, parts) array
    parts, runs : sequence of str
    desired : (samples, parts) array, optional
        Drawn dashed.
    selecting, choosing, note : str
    """
    shown = display_unit(unit, values)
    curves = [
        Curve(
            text_symbol(part),
            shown.factor * values[r, :, p],
            run=r,
            shown=(r,),
            choice=0,
            look=look(p) if desired is None else Look(look(p).colour),
        )
        for r in range(len(runs))
        for p, part in enumerate(parts)
    ]
    if desired is not None:
        curves += [
            Curve("desired", shown.factor * desired[:, p], choice=0, look=Look(look(p).colour, DOTTED), quiet=True)
            for p in range(len(parts))
        ]
    choices = [f"all {choosing}s" if len(parts) > 1 else text_symbol(parts[0])] if parts else []
    if len(runs) > 1:
        for p, part in enumerate(parts):
            curves += [
                Curve(run, shown.factor * values[r, :, p], run=r, choice=len(choices), look=look(r))
                for r, run in enumerate(runs)
            ]
            if desired is not None:
                curves.append(
                    Curve("desired", shown.factor * desired[:, p], choice=len(choices), look=Look(dash=DOTTED))
                )
            choices.append(f"{text_symbol(part)}, all {selecting}s")
    return Chart(
        identity, title, f"{label} [{shown.name}]", curves,
        choices=choices if len(choices) > 1 else (), choosing=choosing, note=note,
    )  # fmt: skip


def compared(
    identity: str,
    title: str,
    label: str,
    unit: str,
    values: NDArray[np.float64],
    runs: Sequence[str],
    *,
    log: bool = False,
    note: str = "",
) -> Chart:
    """A quantity (runs, samples) over time in all runs."""
    shown = display_unit(unit, values)
    factor = shown.factor
    curves = [Curve(run, factor * values[r], run=r, look=look(r)) for r, run in enumerate(runs)]
    name = f"{label} [{shown.name}]" if shown.name not in ("1", "") else label
    return Chart(identity, title, name, curves, log=log, note=note)


def plane_path(actual: NDArray[np.float64], desired: NDArray[np.float64], runs: Sequence[str]) -> Chart:
    """Paths of the end-effector (runs, samples, 2), deviations also magnified, and where it should go.

    The desired path is of all runs (samples, 2), or of each (runs, samples, 2).
    """
    curves = []
    for r in range(len(runs)):
        way, shown = (1e3 * desired, None) if desired.ndim == 2 else (1e3 * desired[r], (r,))
        if r == 0 or shown:
            curves.append(Curve("desired", way[:, 1], way[:, 0], Look(dash=1), shown=shown))
        places = 1e3 * actual[r]
        curves.append(Curve("actual", places[:, 1], places[:, 0], Look(0), run=r, shown=(r,)))
        times = round_magnification(places - way, float(np.ptp(way, axis=0).max()))
        if times > 1.0:
            far = way + times * (places - way)
            name = f"deviation × {times:g}"
            curves.append(Curve(name, far[:, 1], far[:, 0], Look(1, DOTTED), run=r, shown=(r,)))
    return Chart("path", "End-effector path", "y [mm]", curves, x="x [mm]", equal=True, over_time=False)


def thinned(samples: int) -> slice:
    """Every so manieth sample, where there are more than a chart can show."""
    return slice(None, None, max(1, -(-samples // MOST_SAMPLES)))
