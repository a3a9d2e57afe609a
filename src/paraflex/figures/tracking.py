"""Charts and tables of runs along a path: results of every mode, errors, motion of the end-effector, torques."""

import math
from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import replace
from itertools import pairwise
from typing import Any, NamedTuple

import numpy as np
import xarray as xr

from paraflex.errors import InputError
from paraflex.formatting import ROUNDING, display_unit, number, peak, quantity, text_symbol
from paraflex.results.beside import PLACES, Beside, beside_of
from paraflex.results.controllers import controller_names
from paraflex.results.following import headline, ranked_by_motion
from paraflex.results.formulas import during_motion
from .charts import DASHED, Axis, Chart, Curve, Look, look
from .entry import figure
from .run_motion import actual_name, deflections_of, effort_axis, energy_scale, of_member, start_mark
from .runs import after_motion, check_magnification, compared, followed, ranges, round_magnification, stopped_runs
from .selection import moving_directions, names_of, of_point, samples
from .tables import Cell, Column, Table


class _Row(NamedTuple):
    """Run of a mode along a path; no data if it could not start."""

    path: str
    mode: str
    run: xr.Dataset | None


class Runs:
    """Runs in modes along paths, as rows of tables.

    Parameters
    ----------
    data : mapping of str to xarray.Dataset
        Results by path; the name of a single path may be empty. Runs have a dimension of modes.
    failed : mapping of str to sequence of str, optional
        Modes that could not start, by path.
    """

    def __init__(self, data: Mapping[str, xr.Dataset], failed: Mapping[str, Sequence[str]] | None = None) -> None:
        self.data: list[xr.Dataset] = list(data.values())
        self.rows: list[_Row] = [
            row for path, one in data.items() for row in (
                *(_Row(path, mode, one.isel(mode=r)) for r, mode in enumerate(names_of(one, "mode"))),
                *(_Row(path, mode, None) for mode in (failed or {}).get(path, ())),
            )
        ]  # fmt: skip

    @property
    def whole(self) -> bool:
        """Whether all runs are complete."""
        return all(row.run is not None and row.run["status"].item() == "complete" for row in self.rows)

    def names(self) -> list[Column]:
        """Return the columns that name the runs; none for a run without modes."""
        columns = [Column("path", [row.path for row in self.rows]), Column("mode", [row.mode for row in self.rows])]
        return [column for column in columns if any(column.cells)]

    def status(self) -> list[Column]:
        """Return the column of the states of the runs, if any is incomplete."""
        states = ["failed" if row.run is None else str(row.run["status"].item()) for row in self.rows]
        return [] if self.whole else [Column("status", states)]

    def column(self, name: str, value: str | Callable[[xr.Dataset], Cell], unit: str = "", **more: Any) -> Column:
        """Return a column of a variable of the runs, or of a function of them."""
        take = (lambda run: float(run[value].item()) if value in run else None) if isinstance(value, str) else value
        return Column(name, [None if row.run is None else take(row.run) for row in self.rows], unit, **more)

    def counts(self, name: str, variable: str) -> Column:
        """Return a column of whole numbers."""
        return self.column(name, lambda run: int(run[variable].item()))

    def scale(self, variable: str) -> float:
        """Return the largest magnitude of a variable of all runs, for the rounding of its differences."""
        return max(peak(one[variable]) for one in self.data)


def result_table(runs: Runs, *, brief: bool = False) -> Table:
    """Return the table of tracking error, torques and deflection of every run.

    Parameters
    ----------
    runs : Runs
        Runs along paths.
    brief : bool
        Whether the table has steps and wall time in place of RMS torques, deflections and energies.
    """
    first = runs.data[0]
    words, wide = headline(first)[1], runs.scale("end_effector_desired")
    motors, effort = names_of(first, "motor"), runs.scale("peak_torque")
    each = first["torque"].attrs.get("units_each", "")
    units = each.split(", ") if each else [effort_axis(first).unit] * len(motors)
    columns = [*runs.names(), *runs.status()]
    columns.append(runs.column("error", lambda run: float(headline(run)[0]), "m", beside=wide))
    if not brief:
        columns.append(runs.column("largest", _largest_error, "m", beside=wide))
    for k, (motor, unit) in enumerate(zip(motors, units, strict=True)):
        largest, rms = (runs.column(motor, lambda run, key=key, k=k: float(run[key].values[k]), unit, beside=effort)
                        for key in ("peak_torque", "rms_torque"))  # fmt: skip
        columns.append(largest if brief else replace(largest, below=rms.cells))
    word = effort_axis(first).name
    if brief:
        columns += [runs.counts("steps", "steps"), runs.column("wall", "wall_time", "s", digits=3)]
        return Table(f"tracking error {words}, and peak {word}s", columns)
    columns += [
        runs.column("deflection", lambda run: peak(deflections_of(run)) or None, "m", beside=wide),
        runs.column("of", most_bent),
        runs.column("strain energy", lambda run: peak(run["strain_energy"]), "J",
                    beside=max(map(energy_scale, runs.data))),
    ]  # fmt: skip
    note = (
        f"Error, RMS, and the largest one: {words}. {effort_axis(first).name.capitalize()}s: peak and, below it, RMS. "
    )
    note += "Deflection: the largest, from a link's chord. Strain energy: peak."
    note += "" if runs.whole else " For a mode that stopped early: until then."
    return Table("Modes" if len(runs.rows) > 1 else "Run", columns, note,
                 {row.mode: r for r, row in enumerate(runs.rows) if row.run is not None})  # fmt: skip


def beside_table(data: xr.Dataset) -> Table:
    """Return the table of tracking errors in another geometry beside those of the runs; empty if there are none."""
    beside, modes = beside_of(data), names_of(data, "mode")
    if beside is None:
        return Table("", ())
    columns = [Column("mode", modes)]
    for geometry, errors in _by_geometry(data, beside).items():
        for name, by_mode in ({geometry.replace("-", " "): errors} | beside.elsewhere.get(geometry, {})).items():
            columns.append(Column(name, [by_mode.get(mode) for mode in modes], "m"))
    note = f"RMS tracking error {headline(data)[1]}."
    return Table("Which geometry to trust", columns, note, {mode: k for k, mode in enumerate(modes)}).in_one_unit()


def _by_geometry(data: xr.Dataset, beside: Beside) -> dict[str, dict[str, float | None]]:
    """Return the tracking errors of runs by mode [m], by geometry: those beside the dataset's first."""
    own: dict[str, float | None] = dict(zip(names_of(data, "mode"), map(float, headline(data)[0].values), strict=True))
    return {beside.other: beside.errors, beside.geometry: own}


def beside_words(data: xr.Dataset) -> str:
    """Return sentences on which geometry to trust; empty without runs in another geometry."""
    beside = beside_of(data)
    if beside is None:
        return ""
    right, own = _by_geometry(data, beside).values()
    if not beside.sound:
        failed = ", ".join(mode for mode, error in right.items() if error is None)
        return f"Runs in {beside.other} geometry {f'fail in {failed}' if failed else 'are doubtful as well'}."
    known = beside.elsewhere.get(beside.other, {})
    within = " and ".join(f"within {number(100.0 * (factor - 1.0), 2)} % of {source}"
                          for source, by_mode in known.items() for factor, _ in _farthest(right, by_mode))  # fmt: skip
    words = f"Trust {beside.other} geometry: no check gives reason for doubt"
    words += f", and its errors are {within}." if within else "."
    for factor, mode in _farthest(own, right):
        words += f" {beside.geometry.capitalize()} geometry, with which all else here is computed, is off by up to a "
        words += f"factor of {number(factor, 2)} (mode {mode})."
    return words


def _farthest(errors: Mapping[str, float | None], others: Mapping[str, float | None]) -> list[tuple[float, str]]:
    """Return the largest factor between errors of the same mode, and its mode, in a list; an empty one without any."""
    ratios = [(error / other, mode) for mode, error in errors.items() if error and (other := others.get(mode))]
    factors = [(max(ratio, 1.0 / ratio), mode) for ratio, mode in ratios if math.isfinite(ratio)]
    return [max(factors)] if factors else []


def after_table(runs: Runs) -> Table:
    """Return the table of errors during the motion and after it, drift and vibration, and energy of brakes.

    Runs with controllers also have settling time and overshoot. The table is empty if the runs end with the motion.
    """
    if not any(np.isfinite(one["tracking_rms_after"].values).any() for one in runs.data if "tracking_rms_after" in one):
        return Table("After the motion", ())
    first, wide = runs.data[0], runs.scale("end_effector_desired")
    note = "Error, RMS, in the motion and after it; drift: mean speed after it; vibration: RMS about the drift."
    columns = [
        *runs.names(),
        runs.column("motion", "tracking_rms_motion", "m", beside=wide),
        runs.column("after", "tracking_rms_after", "m", beside=wide),
        runs.column("drift", "drift_speed", "m/s"),
        runs.column("vibration", "residual_vibration", "m", beside=wide),
    ]
    if any("brake_energy" in one and peak(one["brake_energy"]) for one in runs.data):
        columns.append(runs.column("brakes", "brake_energy", "J"))
    if controller_names(first):
        columns += [runs.column("settling", "settling_time", "s"), runs.column("overshoot", "overshoot", "m")]
        note += " Settling: until within 5 % of the largest error; overshoot: beyond the end of the path."
    return Table("After the motion", columns, note).filled()


def solver_table(runs: Runs) -> Table:
    """Return the table of the solver's statistics for every run, and of its errors in energy and constraints."""
    wide = runs.scale("end_effector_desired" if "end_effector_desired" in runs.data[0] else "point_position")
    note = "Imbalance: largest, of energy and work. Constraints: largest violation; 0 is below rounding."
    return Table("Integration", [
        *runs.names(),
        runs.column("energy imbalance", "energy_balance_max", "J", beside=max(map(energy_scale, runs.data))),
        runs.column("position violation", "constraint_position_max", "m", beside=wide),
        runs.column("velocity violation", "constraint_velocity_max", "m/s"),
        *(runs.counts(name.replace("_", " ").replace("newton", "Newton"), name)
          for name in ("steps", "rejected", "newton_iterations", "factorisations")),
        runs.column("wall time", "wall_time", "s", digits=3),
    ], note)  # fmt: skip


def _largest_error(run: xr.Dataset) -> float:
    """Return the largest tracking error over the time span that ranks the runs [m]."""
    gaps = errors(run).values
    in_span = during_motion(run["time"].values, run.attrs["motion_end"]) if ranked_by_motion(run) else ...
    return peak(gaps[in_span])


def most_bent(run: xr.Dataset) -> str:
    """Return the body with the largest deflection; empty if none bends."""
    peaks = [peak(one) for one in deflections_of(run).T]
    return names_of(run, "body")[int(np.argmax(peaks))] if max(peaks, default=0.0) else ""


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


@figure("desired and actual path, deviation magnified", paper=15, heading=_FOLLOWING, takes="mode",
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
    beside = beside_of(data) if point is None else None
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
            magnified = f"deviation × {number(times)}"
            if times != 1.0:
                x, y = (desired[r] + times * away).T
                curves.append(Curve(magnified, y, x, Look(1), run=r, shown=(r,)))
            if beside is not None:
                x, y = (desired[r] + times * (data[PLACES].values[r] - desired[r])).T
                name = f"{beside.other.replace('-', ' ')}{f', {magnified}' * (times != 1.0)}"
                curves.append(Curve(name, y, x, Look(2), run=r, shown=(r,)))
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


@figure("torque of every motor over time, one panel per mode", paper=12, heading=_MOTORS, written_as="motor_torques",
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


@figure("tracking error in x and y over time, one panel per mode", paper=18, written_as="tracking_errors",
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


@figure("motion of the end-effector, desired and actual", paper=16, takes="mode", written_as="end_effector_motion",
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


@figure("phase diagrams of the end-effector", paper=17, takes="mode", written_as="phase_diagrams", points="point",
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
