"""Tables of runs: results of every mode along paths, what happens after the motion, and the integration."""

from collections.abc import Callable, Mapping, Sequence
from dataclasses import replace
from typing import Any, NamedTuple

import numpy as np
import xarray as xr

from paraflex.formatting import peak
from paraflex.results.controllers import controller_names
from paraflex.results.following import headline, ranked_by_motion
from paraflex.results.formulas import during_motion
from .run_motion import deflections_of, effort_axis, energy_scale
from .selection import names_of
from .tables import Cell, Column, Table
from .tracking import errors


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
