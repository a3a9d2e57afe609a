"""Time series (traces) of a run at its samples, from which metrics are computed."""

from dataclasses import dataclass
from functools import cached_property
from typing import Any

import numpy as np
import xarray as xr

from paraflex.arrays import Mask, NDArray
from .formulas import during_motion, length

# Real for a run, complex for a run with a complex step.
Trace = NDArray[Any]


@dataclass(frozen=True)
class Traces:
    """Time series of a run along a path at its k samples, which every model of a mechanism has.

    Attributes
    ----------
    t : (k,) array
        Sample times [s].
    motion_end : float
        End of the motion along the path [s].
    position : (k, 2) array
        Position of the end-effector [m].
    distance : (k,) array
        Distance of the end-effector from its desired position [m].
    torque : (samples, motors) array
        Motor torques [N m], for sliding motors forces [N], at the samples where they are known.
    """

    t: Trace
    motion_end: float
    position: Trace
    distance: Trace
    torque: Trace

    @cached_property
    def moving(self) -> Mask:
        """Mask (k,) of the samples during the motion along the path; the others are after it."""
        return during_motion(self.t, self.motion_end)

    @property
    def after(self) -> tuple[Trace, Trace]:
        """Times (j,) of the samples after the motion [s], and positions (j, 2) of the end-effector at them [m]."""
        return self.t[~self.moving], self.position[~self.moving]


@dataclass(frozen=True)
class DataTraces(Traces):
    """Traces of a run in a dataset.

    Attributes
    ----------
    data : xarray.Dataset
        Results of this run alone.
    """

    data: xr.Dataset

    @property
    def deflection(self) -> Trace:
        """Largest deflection of each body from its chord (k, bodies) [m]."""
        return self.data["deflection"].values

    @property
    def desired(self) -> Trace:
        """Desired positions of the end-effector (k, 2) [m]."""
        return self.data["end_effector_desired"].transpose("time", "axis").values

    @property
    def condition(self) -> Trace:
        """Condition number of the actuation matrix (samples,)."""
        return self.data["actuation_condition"].values


def data_traces(data: xr.Dataset, motion_end: float | None = None) -> DataTraces:
    """Return the traces of the single run of a dataset, with NaN at samples that it did not reach.

    Parameters
    ----------
    data : xarray.Dataset
        Results of one run along a path.
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
