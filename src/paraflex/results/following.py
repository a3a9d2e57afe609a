"""Tracking metrics of the runs of a dataset, the metric that ranks runs, and the part of a path that was covered."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from enum import Enum

import numpy as np
import xarray as xr

from paraflex.arguments import checked_arguments
from paraflex.findings import Finding
from .formulas import SAME_TIME, settling_time
from .kinds import check_kind
from .metrics import METRICS, Metric
from .traces import data_traces

# Variables of a dataset from which tracking metrics are computed.
_TRACES = ["end_effector", "end_effector_desired", "torque"]


class ErrorSpan(Enum):
    """Time span of the tracking error that ranks runs.

    MOTION
        The motion along the path, from its start to its end.
    WHOLE
        All samples, including the dwell after the path: the paper's index (Eq. 64).
    """

    MOTION = "motion"
    WHOLE = "whole"


# Metric that ranks runs, and its time span in words.
HEADLINE = {ErrorSpan.MOTION: "tracking_rms_motion", ErrorSpan.WHOLE: "tracking_rms"}
SPAN_WORDS = {ErrorSpan.MOTION: "during the motion", ErrorSpan.WHOLE: "over the whole run, dwell included"}


@checked_arguments()
def tracking_error(data: xr.Dataset) -> xr.DataArray:
    """Return the RMS distance of the end-effector from its desired position over all samples (Eq. 64) [m]."""
    return metric_variables(data)["tracking_rms"]


@checked_arguments()
def residual_vibration(data: xr.Dataset, motion_end: float) -> xr.DataArray:
    """Return the root mean square distance of the end-effector from its drift after the motion [m]: see `vibration`.

    The value is NaN if a run has too few samples after the motion, or did not finish.

    Parameters
    ----------
    data : xarray.Dataset
        Results of runs along a path.
    motion_end : float
        End of the motion along the path [s].
    """
    return metric_variables(data, motion_end=motion_end)["residual_vibration"]


@checked_arguments()
def settling_times(data: xr.Dataset, band: float | None = None, motion_end: float | None = None) -> xr.DataArray:
    """Return the settling time [s] of each run: from the end of the motion until the error stays within a band.

    The error is the distance of the end-effector from its desired position. The time is NaN for runs that do not settle
    or have no samples after the motion.

    Parameters
    ----------
    data : xarray.Dataset
        Results of runs along a path.
    band : float, optional
        Width of the band [m]; by default 5 % of the largest tracking error of the run, as in the metric
        `settling_time`.
    motion_end : float, optional
        End of the motion along the path [s]; that of the dataset by default.

    Raises
    ------
    InputError
        The band is not positive.
    """
    from paraflex.mechanism.quantities import positive

    if band is not None:
        positive(band, "band", "m")
    metric = Metric("settling_time", "time until it stays within a band of its desired place", "s",
                    lambda x, _: settling_time(x.t, x.distance, x.motion_end, band), "settling time")  # fmt: skip
    return _of_runs(data, [metric], motion_end)["settling_time"]


# Metrics that are variables of datasets, and those of them that have one value per run.
KEPT_METRICS = tuple(metric.name for metric in METRICS.values() if metric.kept)
FOLLOWING = tuple(name for name in KEPT_METRICS if not METRICS[name].each)


def metric_variables(
    data: xr.Dataset, names: Sequence[str] = FOLLOWING, motion_end: float | None = None
) -> dict[str, xr.DataArray]:
    """Return metrics of every run of a dataset by name; NaN over spans that a run did not finish.

    Parameters
    ----------
    data : xarray.Dataset
        Results of runs along a path.
    names : sequence of str
        Names of the metrics; by default those of tracking.
    motion_end : float, optional
        End of the motion along the path [s]; that of the dataset by default.
    """
    return _of_runs(data, [METRICS[name] for name in names], motion_end)


def _of_runs(data: xr.Dataset, metrics: Sequence[Metric], motion_end: float | None) -> dict[str, xr.DataArray]:
    check_kind(data, "tracking", "verification")
    runs = data[_TRACES]
    dims = [str(dim) for dim in runs["end_effector"].dims if dim not in ("time", "axis")]
    shape = tuple(runs.sizes[dim] for dim in dims)
    traces = [data_traces(runs.isel(dict(zip(dims, at, strict=True))), motion_end) for at in np.ndindex(*shape)]
    out = {}
    for metric in metrics:
        own = [*dims, "motor"] if metric.each else dims
        values = np.array([metric.value(one) for one in traces]).reshape([runs.sizes[dim] for dim in own])
        about = {"long_name": metric.label, "units": metric.unit, "comment": metric.meaning}
        out[metric.name] = xr.DataArray(values, {dim: data[dim] for dim in own if dim in data.coords}, own, attrs=about)
    return out


def headline(data: xr.Dataset) -> tuple[xr.DataArray, str]:
    """Return the tracking error that ranks the runs of a dataset [m], and its time span in words.

    Results of earlier versions are ranked by the error over the whole run, as in those versions.
    """
    span = ErrorSpan.MOTION if ranked_by_motion(data) else ErrorSpan.WHOLE
    return data[HEADLINE[span]], SPAN_WORDS[span]


def below_tolerance_line(errors: Mapping[str, float | None], tolerance: float) -> str:
    """Return a line on tracking errors [m] below the integration tolerance [m], which are meaningless; else ""."""
    small = [name for name, error in errors.items() if error is not None and error < tolerance]
    if not small:
        return ""
    return (
        f"tracking errors below the tolerance of {tolerance:g} m, too small to be compared: "
        f"{', '.join(small)}; choose a finer tolerance (--tol)"
    )


def ranked_by_motion(data: xr.Dataset) -> bool:
    """Check whether the error during the motion ranks the runs of a dataset; otherwise that of the whole run does."""
    return data.attrs.get("error", ErrorSpan.WHOLE.value) == ErrorSpan.MOTION.value


@dataclass(frozen=True)
class PathPart:
    """Part of a path that runs covered which ended before the path.

    Attributes
    ----------
    duration, path : float
        Durations of the runs and of the path [s].
    length : float
        Fraction of the path's length that was covered.
    """

    duration: float
    path: float
    length: float

    def __str__(self) -> str:
        return (
            f"only a part of the path was run: {self.duration:.3g} of {self.path:.3g} s, {100.0 * self.length:.3g} % "
            "of its length; errors are of that part"
        )

    def finding(self, place: str = "study.duration") -> Finding:
        """Return the part as a finding."""
        return Finding("path-cut-short", place, str(self), f"the path takes {self.path:.4g} s")

    def to_dict(self) -> dict[str, float | str]:
        """Return the part as plain numbers, and in words."""
        return {"duration": self.duration, "path": self.path, "length": self.length, "message": str(self)}


def too_short(end: float, path_duration: float) -> bool:
    """Check whether a run ends before its path; both times in s."""
    return end < path_duration * (1.0 - SAME_TIME)


def part_run(data: xr.Dataset) -> PathPart | None:
    """Return the part of the path that the runs of a dataset covered; None if they reached its end."""
    end, path = float(data["time"].values[-1]), float(data.attrs.get("motion_end", 0.0))
    covered = data.attrs.get("path_length_run")
    return PathPart(end, path, float(covered)) if covered is not None and too_short(end, path) else None


@checked_arguments()
def peak_torque(data: xr.Dataset) -> xr.DataArray:
    """Return the largest magnitude of each motor's torque [N m], of sliding motors of the force [N]."""
    return metric_variables(data, ["peak_torque"])["peak_torque"]


@checked_arguments()
def rms_torque(data: xr.Dataset) -> xr.DataArray:
    """Return the root mean square of each motor's torque over the run [N m], of sliding motors of the force [N]."""
    return metric_variables(data, ["rms_torque"])["rms_torque"]
