"""Figure of joint forces over time."""

from __future__ import annotations

import numpy as np
import xarray as xr
from matplotlib.figure import Figure

from paraflex.figures.run_motion import most_deflected as most_deflected
from paraflex.figures.selection import one_run
from paraflex.plots.given import drawn
from paraflex.plots.labels import axis_label
from paraflex.plots.runs import largest_over_time


@drawn
def joint_forces(data: xr.Dataset, mode: str | None = None) -> Figure:
    """Plot the magnitude of the force in every joint over time; of more than seven, the seven largest."""
    run = one_run(data, mode)
    forces = np.linalg.norm(run["joint_force"].transpose("time", "joint", "axis").values, axis=2)
    return largest_over_time(data, run, forces, "joint", axis_label("force"))
