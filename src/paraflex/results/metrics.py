"""What a run is judged by, one formula for each number.

Formulas of arrays take real numbers and numbers with a complex step: sums, products and roots alone.
"""

from __future__ import annotations

from dataclasses import dataclass
from enum import Enum
from typing import Any

import numpy as np
import xarray as xr
from numpy.typing import NDArray

from paraflex.arguments import checked_arguments
from paraflex.findings import Finding
from paraflex.results.kinds import check_kind

# A sample so near to the end of the motion is at it: rounding of times, as a fraction of the motion.
_SAME_TIME = 1e-9
# Degree of the drift in time: a free mechanism drifts at a speed that changes slowly.
_DRIFT_DEGREE = 2
# Fewer samples after the motion do not tell a vibration from a drift.
_FEWEST = 3 * (_DRIFT_DEGREE + 1)


class ErrorSpan(Enum):
    """What of a run its tracking error is taken over, where one number has to stand for it.

    MOTION
        The motion along the path, from its start to its end.
    WHOLE
        All samples, the dwell after the path among them: the paper's index (Eq. 64).
    """

    MOTION = "motion"
    WHOLE = "whole"


# The metric that ranks runs, and what it is called.
HEADLINE = {ErrorSpan.MOTION: "tracking_rms_motion", ErrorSpan.WHOLE: "tracking_rms"}
SPAN_WORDS = {ErrorSpan.MOTION: "during the motion", ErrorSpan.WHOLE: "over the whole run, dwell included"}


def during_motion(t: NDArray[Any], motion_end: float) -> NDArray[np.bool_]:
    """Which samples at times t (k,) are of the motion, its end among them [s]; the others are after it."""
    end = np.real(motion_end)
    return np.real(t) <= end + _SAME_TIME * abs(end)


def rms(values: NDArray[Any]) -> Any:
    """Root mean square over the first axis; NaN of no values."""
    if len(values) == 0:
        return np.full(values.shape[1:], np.nan)[()]
    return np.sqrt(np.mean(values**2, axis=0))


def drift_speed(t: NDArray[Any], position: NDArray[Any]) -> Any:
    """Speed at which positions (k, 2) at times t (k,) move on average [m/s]: of the drift that `vibration` is about.

    The slope of the straight line of least squares. NaN where there are too few samples.
    """
    if len(t) < _FEWEST:
        return np.nan
    coefficients, half = _drift(t, position)[1:]
    # The constant and the quadratic part are the same at both ends.
    return np.sqrt(np.sum(coefficients[1] ** 2)) / half


def vibration(t: NDArray[Any], position: NDArray[Any]) -> Any:
    """Root mean square distance of positions (k, 2) at times t (k,) from their drift [m].

    The drift is the quadratic in time of least squares, which a body has that moves freely, at a speed that changes
    slowly. Of a steady sinusoid of amplitude A along a line A / sqrt(2), if the samples are of a few periods. NaN where
    there are too few.
    """
    if len(t) < _FEWEST:
        return np.nan
    basis, coefficients, _ = _drift(t, position)
    return np.sqrt(np.mean(np.sum((position - basis @ coefficients) ** 2, axis=1)))


def _drift(t: NDArray[Any], position: NDArray[Any]) -> tuple[NDArray[Any], NDArray[Any], Any]:
    """Legendre polynomials at the samples (k, 3), their coefficients (3, 2) by least squares, half of the time [s]."""
    half = 0.5 * (t[-1] - t[0])
    x = (t - t[0]) / half - 1.0
    basis = np.stack([np.ones_like(x), x, 1.5 * x**2 - 0.5], axis=1)
    # Normal equations with a plain transpose: well conditioned for these, and analytic.
    return basis, np.linalg.solve(basis.T @ basis, basis.T @ position), half


@checked_arguments()
def tracking_error(data: xr.Dataset) -> xr.DataArray:
    """Root mean square distance of the end-effector from its desired place over the samples (Eq. 64) [m]."""
    return tracking_variables(data)["tracking_rms"]


@checked_arguments()
def residual_vibration(data: xr.Dataset, motion_end: float) -> xr.DataArray:
    """Root mean square distance of the end-effector after the motion's end from its drift [m]: see `vibration`.

    NaN where the run has too few samples after it, or did not get to its end.
    """
    return tracking_variables(data, motion_end)["residual_vibration"]


_MEANINGS = {
    "tracking_rms": ("RMS tracking error over the whole run", "m"),
    "tracking_max": ("largest tracking error of the whole run", "m"),
    "tracking_rms_motion": ("RMS tracking error during the motion", "m"),
    "tracking_max_motion": ("largest tracking error during the motion", "m"),
    "tracking_rms_after": ("RMS tracking error after the motion", "m"),
    "tracking_max_after": ("largest tracking error after the motion", "m"),
    "residual_vibration": ("RMS residual vibration about the drift after the motion", "m"),
    "drift_speed": ("mean drift of the end-effector after the motion", "m/s"),
}


FOLLOWING = tuple(_MEANINGS)


def tracking_variables(data: xr.Dataset, motion_end: float | None = None) -> dict[str, xr.DataArray]:
    """How every run of a dataset follows its path: variables by name, NaN over spans that a run did not finish.

    Parameters
    ----------
    data : xarray.Dataset
    motion_end : float, optional
        End of the motion along the path [s]; that of the dataset by default.
    """
    check_kind(data, "tracking", "verification")
    end = float(data.attrs["motion_end"]) if motion_end is None else motion_end
    place = data["end_effector"].transpose(..., "time", "axis")
    away = (data["end_effector_desired"] - data["end_effector"]).transpose(*place.dims).values
    distance = np.linalg.norm(away, axis=-1)
    runs = [(distance[i], place.values[i]) for i in np.ndindex(distance.shape[:-1])]
    found = [_of_run(data["time"].values, *one, end) for one in runs]
    return {
        name: xr.DataArray(
            np.array([each[name] for each in found]).reshape(distance.shape[:-1]),
            dims=place.dims[:-2],
            attrs={"long_name": meaning, "units": unit},
        )
        for name, (meaning, unit) in _MEANINGS.items()
    }


def _of_run(
    t: NDArray[np.float64], distance: NDArray[np.float64], position: NDArray[np.float64], motion_end: float
) -> dict[str, float]:
    moving = during_motion(t, motion_end)
    after = ~moving
    return {
        "tracking_rms": rms(distance),
        "tracking_max": largest(distance),
        "tracking_rms_motion": rms(distance[moving]),
        "tracking_max_motion": largest(distance[moving]),
        "tracking_rms_after": rms(distance[after]),
        "tracking_max_after": largest(distance[after]),
        "residual_vibration": vibration(t[after], position[after]),
        "drift_speed": drift_speed(t[after], position[after]),
    }


def largest(values: NDArray[np.float64]) -> float:
    """Largest of distances; NaN of none, or where one is."""
    return float(np.max(values)) if values.size else float("nan")


def headline(data: xr.Dataset) -> tuple[xr.DataArray, str]:
    """The tracking error that ranks the runs of a dataset [m], and what it is of, in words.

    Results that earlier versions wrote are ranked by the whole run, as they were then.
    """
    span = ErrorSpan.MOTION if ranked_by_motion(data) else ErrorSpan.WHOLE
    return data[HEADLINE[span]], SPAN_WORDS[span]


def ranked_by_motion(data: xr.Dataset) -> bool:
    """Whether the error of the motion ranks the runs of a dataset; else that of the whole run."""
    return data.attrs.get("error", ErrorSpan.WHOLE.value) == ErrorSpan.MOTION.value


@dataclass(frozen=True)
class Part:
    """What runs did of a path that they were too short for.

    Attributes
    ----------
    duration, path : float
        Of the runs, and of the path [s].
    length : float
        Of the path's length, the part that was run.
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
        """The same, to be kept with results."""
        return Finding("path-cut-short", place, str(self), f"the path takes {self.path:.4g} s")

    def figures(self) -> dict[str, float | str]:
        """As plain numbers, and in words."""
        return {"duration": self.duration, "path": self.path, "length": self.length, "message": str(self)}


def too_short(end: float, path_duration: float) -> bool:
    """Whether a run that ends then [s] does not come to the end of its path [s]."""
    return end < path_duration * (1.0 - _SAME_TIME)


def part_run(data: xr.Dataset) -> Part | None:
    """What the runs of a dataset were to do of a path that they were too short for; None where they were not."""
    end, path = float(data["time"].values[-1]), float(data.attrs.get("motion_end", 0.0))
    if "path_length_run" not in data.attrs or not too_short(end, path):
        return None
    return Part(end, path, float(data.attrs["path_length_run"]))


@checked_arguments()
def peak_torque(data: xr.Dataset) -> xr.DataArray:
    """Largest magnitude of each motor's torque [N m]."""
    return abs(data["torque"]).max("time").assign_attrs(long_name="peak torque", units="N m")


@checked_arguments()
def rms_torque(data: xr.Dataset) -> xr.DataArray:
    """Root mean square of each motor's torque over the run [N m]."""
    return ((data["torque"] ** 2).mean("time") ** 0.5).assign_attrs(long_name="RMS torque", units="N m")
