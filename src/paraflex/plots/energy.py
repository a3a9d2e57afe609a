"""Figure of the energies of a run and their balance."""

from __future__ import annotations

import numpy as np
import xarray as xr
from matplotlib.figure import Figure

from paraflex.figures.selection import one_run
from paraflex.formatting import peak
from paraflex.plots.given import drawn
from paraflex.plots.labels import axis_label
from paraflex.plots.layout import panels
from paraflex.plots.runs import draw_curves, finish_over_time
from paraflex.plots.scales import mark_powers
from paraflex.plots.style import ZERO

# Names of the curves, in every figure of energies.
ENERGIES = {"kinetic_energy": "kinetic energy", "strain_energy": "strain energy", "work": "work done on it"}

# Bound of rounding errors, as a share of the largest energy.
_ROUNDING = 1e-12


@drawn
def energies(data: xr.Dataset, mode: str | None = None) -> Figure:
    """Plot kinetic and strain energy and the work done on the mechanism; strain energy alone; the energy imbalance.

    The imbalance is |kinetic + strain energy - their initial values - work|, at the samples. Strain energy and
    imbalance have no panel if they are zero throughout.
    """
    run = one_run(data, mode)
    curves = {label: run[name].values for name, label in ENERGIES.items()}
    kinetic, strain, work = curves.values()
    imbalance = np.abs(kinetic + strain - kinetic[0] - strain[0] - work)
    # Rounding errors would extend the logarithmic axis.
    imbalance = np.where(imbalance > _ROUNDING * max(map(peak, curves.values())), imbalance, 0.0)
    figure, axes = panels(1 + (peak(strain) > 0.0) + (peak(imbalance) > 0.0), 1)
    every, *rest = axes[:, 0]
    draw_curves(every, run, curves)
    every.axhline(0.0, **ZERO)
    if peak(strain) > 0.0:
        # `first` keeps the colour of the panel above.
        draw_curves(rest.pop(0), run, {"strain energy": strain}, first=1)
    if peak(imbalance) > 0.0:
        draw_curves(rest[0], run, {"imbalance": np.where(imbalance > 0.0, imbalance, np.nan)}, first=3)
        mark_powers(rest[0])
    for panel in axes.flat:
        panel.set_ylabel(axis_label("energy"))
    return finish_over_time(figure, axes, data, panel_height=34.0)
