"""Traces of a run at its samples, from which metrics are computed."""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property
from typing import Any

import numpy as np
import xarray as xr
from numpy.typing import NDArray

from paraflex.results.formulas import during_motion, length

# Of a run: real. Of one near it: with a complex step.
Trace = NDArray[Any]


@dataclass(frozen=True)
class Traces:
    """Time series of a run at its k samples that every model of a mechanism has.

    Attributes
    ----------
    t : (k,) array
        [s]
    motion_end : float
        Of the motion along the path [s].
    position : (k, 2) array
        Of the end-effector [m].
    distance : (k,) array
        Of the end-effector from its desired place [m].
    torque : (samples, motors) array
        [N m], or [N] of motors that slide; at the samples where it is known.
    """

    t: Trace
    motion_end: float
    position: Trace
    distance: Trace
    torque: Trace

    @cached_property
    def moving(self) -> NDArray[np.bool_]:
        """The samples (k,) during the motion along the path; the others are after it."""
        return during_motion(self.t, self.motion_end)

    @property
    def after(self) -> tuple[Trace, Trace]:
        """Times (j,) of the samples after the motion [s], and places of the end-effector at them (j, 2) [m]."""
        return self.t[~self.moving], self.position[~self.moving]


@dataclass(frozen=True)
class DataTraces(Traces):
    """Traces of a run in a dataset.

    Attributes
    ----------
    data : xarray.Dataset
        Of this run alone.
    """

    data: xr.Dataset

    @property
    def deflection(self) -> Trace:
        """Largest deflection of each body from its chord (k, bodies) [m]."""
        return self.data["deflection"].values

    @property
    def desired(self) -> Trace:
        """Desired places of the end-effector (k, 2) [m]."""
        return self.data["end_effector_desired"].transpose("time", "axis").values

    @property
    def condition(self) -> Trace:
        """Condition number of the actuation matrix (samples,)."""
        return self.data["actuation_condition"].values


def data_traces(data: xr.Dataset, motion_end: float | None = None) -> DataTraces:
    """Traces of the only run of a dataset; NaN at samples it did not reach.

    Parameters
    ----------
    data : xarray.Dataset
    motion_end : float, optional
        End of the motion along the path [s]; that of the dataset by default.
    """
    position = data["end_effector"].transpose("time", "axis").values
    desired = data["end_effector_desired"].transpose("time", "axis").values
    torque = data["torque"].transpose("time", "motor").values
    return DataTraces(
        t=data["time"].values,
        motion_end=float(data.attrs["motion_end"]) if motion_end is None else motion_end,
        position=position,
        distance=length(position - desired),
        torque=torque[~np.isnan(torque).all(axis=1)],
        data=data,
    )
