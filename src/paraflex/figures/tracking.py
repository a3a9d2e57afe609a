"""Charts of runs along a path: errors, paths and motion of the end-effector, torques and condition of modes."""

import math
from collections.abc import Iterator, Sequence
from dataclasses import replace
from itertools import pairwise
from typing import Any

import numpy as np
import xarray as xr

from paraflex.errors import InputError
from paraflex.formatting import ROUNDING, display_unit, number, peak, quantity, text_symbol
from paraflex.results.following import headline, ranked_by_motion
from .charts import DASHED, Axis, Chart, Curve, Look, look
from .entry import figure
from .run_motion import actual_name, effort_axis, of_member, start_mark
from .runs import after_motion, check_magnification, compared, followed, ranges, round_magnification, stopped_runs
from .selection import moving_directions, names_of, of_point, samples

# Axes of the variables of the end-effector's motion: name, unit, and the dots of the symbol above the direction.
_MOTION = {
    "end_effector": ("displacement", "m", ""),
    "end_effector_velocity": ("velocity", "m/s", "\u0307"),
    "end_effector_acceleration": ("acceleration", "m/s²", "\u0308"),
}
# Letters of a mode's name and its passive motors that fit above a panel.
_TITLE_LETTERS = 22
# Distances up to this one are rounding errors [m].
_NOTHING = 1e-8
_FOLLOWING, _MOTORS = "Following the path", "Motors"


@figure("distance from the desired position over time, all modes", heading=_FOLLOWING, height=56.0)
def tracking_distance(data: xr.Dataset) -> Iterator[Chart]:
    """Yield the chart of the distance of the end-effector from its desired position over time in all modes."""
    distance = errors(data)
    axis = Axis("distance", "m", log=True, shown=display_unit("m", distance))
    chart = Chart("errors", "Tracking error", axis, note="Distance of the end-effector from its desired place.")
    # Rounding errors would extend the logarithmic axis.
    yield compared(chart, data, distance.where(distance > _NOTHING))


@figure("desired and actual path, deviation magnified (Fig. 15)", heading=_FOLLOWING, takes="mode",
        written_as="end_effector_path", points="point")  # fmt: skip
def end_effector_path(
    data: xr.Dataset, magnification: float | None = None, point: str | None = None
) -> Iterator[Chart]:
    """Yield the chart of the desired and the actual path of the end-effector, with magnified deviation (Fig. 15).

    Parameters
    ----------
    magnification : float, optional
        Magnification of the deviation; by default the largest of 1, 2, 5, 10, ... that keeps it small beside the path.
    point : str, optional
        Point "body.point" in place of the end-effector; it has no desired path, and its own path is not magnified.
    """
    data = of_point(data, point)
    check_magnification(magnification)
    curves: list[Curve] = []
    desired = data["end_effector_desired"].values if "end_effector_desired" in data else None
    if desired is None and magnification is not None:
        raise InputError(
            "a point without a desired path has no deviation", field="magnification", value=magnification,
            remedy="leave it out",
        )  # fmt: skip
    for r, stopped in enumerate(stopped_runs(data)):
        actual = data["end_effector"].values[r]
        curves.append(Curve(actual_name(data, r, point), actual[:, 1], actual[:, 0], look(0), run=r, shown=(r,),
                            stopped=stopped))  # fmt: skip
        if desired is not None:
            away, extent = actual - desired[r], float(np.ptp(desired[r], axis=0).max())
            times = round_magnification(away, extent) if magnification is None else magnification
            if times != 1.0:
                x, y = (desired[r] + times * away).T
                curves.append(Curve(f"deviation × {number(times)}", y, x, Look(1), run=r, shown=(r,)))
        else:
            curves.append(start_mark(actual[:, 0], actual[:, 1], r))
    if desired is not None:
        # Designs may have paths of their own.
        common = bool(np.all(desired == desired[:1]))
        for r, (x, y) in enumerate(np.swapaxes(desired[: 1 if common else None], 1, 2)):
            own: dict[str, Any] = {} if common else {"run": r, "shown": (r,)}
            curves += [Curve("desired", y, x, Look(dash=DASHED), desired=True, **own),
                       Curve("start", y[:1], x[:1], mark="square", **own)]  # fmt: skip
    yield Chart("path", "End-effector path", Axis("", "m", "y"), curves, Axis("", "m", "x"), equal=True)


@figure("torque of every motor over time, one panel per mode (Fig. 12)", heading=_MOTORS, written_as="motor_torques",
        panels="runs", columns=3, height=38.0, shared=True)  # fmt: skip
def motor_torques(data: xr.Dataset) -> Iterator[Chart]:
    """Yield the chart of the torque of every motor over time (Fig. 12).

    In print each mode has a panel, whose title lists the motors that are passive; panels of a row share their scale.
    """
    axis = effort_axis(data)
    yield followed(Chart("torques", f"Motor {'forces' if axis.name == 'force' else 'torques'}", axis, choosing="motor",
                         of_runs=_passive_words(data)), data, data["torque"])  # fmt: skip


def _passive_words(data: xr.Dataset) -> list[str]:
    """Return a text on the motors of each mode whose torques are zero throughout; empty if there are none."""
    words, least = [], max(1e-9 * peak(data["torque"]), ROUNDING)
    for mode, torque in zip(names_of(data, "mode"), data["torque"].values, strict=True):
        passive = [name for k, name in enumerate(names_of(data, "motor")) if peak(torque[:, k]) <= least]
        short = len(mode) + len(", ".join(passive)) <= _TITLE_LETTERS
        listed = ", ".join(map(text_symbol, passive)) if short else f"{len(passive)} motors"
        words.append(f"passive {listed}" if passive else "")
    return words


@figure("condition number of the actuation matrix along the path, all modes", heading=_MOTORS,
        variables=("actuation_condition",), height=56.0)  # fmt: skip
def actuation_condition(data: xr.Dataset) -> Iterator[Chart]:
    """Yield the chart of the condition number of the actuation matrix along the path in every mode.

    It is large near a Type II singularity.
    """
    chart = Chart(
        "condition", "Condition number of the actuation matrix", Axis("condition number", log=True, low=1.0),
        note="Condition of the matrix from motor torques to forces along the path: it grows without bound towards "
             "positions where the active motors lose control of a direction.",
    )  # fmt: skip
    # The condition number belongs to the planned motion, which continues after a run has stopped.
    yield compared(chart, data.assign(end_effector=data["end_effector_desired"]), data["actuation_condition"])


@figure("tracking error in x and y over time, one panel per mode (Fig. 18)", written_as="tracking_errors",
        panels="runs", columns=3, height=38.0)  # fmt: skip
def tracking_errors(data: xr.Dataset) -> Iterator[Chart]:
    """Yield the chart of the tracking error of the end-effector in x and y, actual minus desired (Fig. 18).

    In print each mode has a panel, whose title has the RMS error or the time at which the run stopped.
    """
    gaps = (data["end_effector"] - data["end_effector_desired"]).assign_attrs(units="m")
    words = [_outcome(data.isel(mode=r)) for r in range(data.sizes["mode"])]
    chart = Chart("error-parts", "Tracking error in x and y", Axis("error", "m", zero=True, extent=peak(gaps)),
                  choosing="direction", of_runs=words)  # fmt: skip
    yield followed(chart, data, gaps)


def _outcome(run: xr.Dataset) -> str:
    """Return the RMS tracking error of a run, or the time at which it stopped, in words."""
    rms = float(headline(run)[0])
    if math.isfinite(rms):
        return f"RMS {quantity(rms, 'm')} {'in the motion' if ranked_by_motion(run) else 'over all'}"
    reached = samples(run)
    return f"stopped at {number(run['time'].values[reached - 1], 3)} s" if reached else "no samples"


@figure("tracking error, vibration and largest torque of every mode", columns=3,
        variables=("residual_vibration", "peak_torque"))  # fmt: skip
def mode_comparison(data: xr.Dataset) -> Iterator[Chart]:
    """Yield charts of the RMS tracking error, the residual vibration and the largest torque of every mode.

    The tracking error is that of the motion or of the whole run, as the results define it.
    """
    rms, effort, modes = headline(data)[0], effort_axis(data), Axis("", names=names_of(data, "mode"))
    lines, title = np.arange(len(rms)), f"RMS error {'of the motion' if ranked_by_motion(data) else 'of the whole run'}"
    # Modes differ by orders of magnitude; bars would show only the largest.
    for k, (name, values) in enumerate(((title, rms), ("residual vibration", data["residual_vibration"]))):
        yield Chart(f"modes-{k}", name, modes, [Curve("", lines, values, Look(2 * k), mark="dot")],
                    Axis("distance", "m", log=True))  # fmt: skip
    largest = data["peak_torque"].max("motor").values
    yield Chart("modes-torque", f"largest {effort.name}", modes, [Curve("", lines, largest, Look(1), mark="bar")],
                Axis(effort.name, effort.unit, effort.symbol, low=0.0))  # fmt: skip


@figure("motion of the end-effector, desired and actual (Fig. 16)", takes="mode", written_as="end_effector_motion",
        points="point", panels="choices", height=33.0)  # fmt: skip
def end_effector_motion(data: xr.Dataset, point: str | None = None) -> Iterator[Chart]:
    """Yield charts of displacement, velocity and acceleration of the end-effector in x and y (Fig. 16).

    Parameters
    ----------
    point : str, optional
        Point "body.point" in place of the end-effector; it has no desired motion.
    """
    data = of_point(data, point)
    for name in _MOTION:
        yield _of_directions(data, [name], point)


@figure("phase diagrams of the end-effector (Fig. 17)", takes="mode", written_as="phase_diagrams", points="point",
        panels="choices", height=50.0)  # fmt: skip
def phase_diagrams(data: xr.Dataset, point: str | None = None) -> Iterator[Chart]:
    """Yield charts of velocity over displacement and acceleration over velocity in x and y (Fig. 17).

    Parameters
    ----------
    point : str, optional
        Point "body.point" in place of the end-effector; it has no desired motion.
    """
    data = of_point(data, point)
    for names in pairwise(_MOTION):
        yield _of_directions(data, names, point)


def _of_directions(data: xr.Dataset, names: Sequence[str], point: str | None) -> Chart:
    """Return the chart of a variable of the end-effector over time, or of the second of two over the first.

    It shows one direction at a time.
    """
    actual = [data[name].values for name in names]
    desired = [data[f"{name}_desired"].values[0] for name in names if f"{name}_desired" in data]
    directions, curves = moving_directions(data), []
    for k, direction in enumerate(directions):
        a = names_of(data, "axis").index(direction)
        wanted = [each[:, a] for each in desired]
        curves += of_member(data, k, [each[..., a] for each in actual], wanted, point, starts_as_desired=True)
    *extents, extent = (peak(each) if len(names) > 1 else peak(ranges(each, axis=-2)) for each in desired or actual)
    word, unit, dots = _MOTION[names[-1]]
    chart = Chart(
        "-".join(names), word.capitalize(),
        [Axis(word, unit, f"{direction}{dots}", extent=extent) for direction in directions], curves,
        choices=directions, choosing="direction",
    )  # fmt: skip
    if extents:
        return replace(chart, x=Axis(*_MOTION[names[0]][:2], extent=extents[0]))
    return replace(chart, spans=after_motion(data))


def errors(data: xr.Dataset) -> xr.DataArray:
    """Return the distance of the end-effector from its desired position [m], over the dimensions of runs and time."""
    gaps = (data["end_effector"] - data["end_effector_desired"]).transpose(..., "axis")
    return gaps.reduce(np.linalg.norm, "axis").assign_attrs(units="m")
