"""Results of a comparison of methods: a row for each run, the reference, times for an error."""

from __future__ import annotations

import os
import platform
from dataclasses import asdict, dataclass, fields
from importlib.metadata import PackageNotFoundError, version
from pathlib import Path
from typing import Any

import numpy as np
import xarray as xr

from paraflex.campaign import Result
from paraflex.folders import COMPARISON
from paraflex.integrators import DEFAULT_METHOD, METHODS

# Errors at which times are compared [m], and the one in the table.
LEVELS, TABLE_LEVEL = (1e-3, 1e-4, 1e-5, 1e-6), 1e-5
# Fields of a measurement that are not numbers.
_TEXTS = ("method", "status", "reason")
# Packages whose version has a part in the times.
_TIMING_PACKAGES = ("paraflex", "numpy", "scipy", "numba", "scikit-sundae")


@dataclass(frozen=True)
class Reference:
    """The converged run from which errors are distances.

    Attributes
    ----------
    method, check_method : str
        Of the run, and of a second one that it is held against.
    tolerance, check_tolerance : float
        [m]
    uncertainty : float
        Largest distance between the two [m]: smaller errors are not distinguishable from the reference's own.
    wall_time : float
        Of the run [s].
    """

    method: str
    tolerance: float
    check_method: str
    check_tolerance: float
    uncertainty: float
    wall_time: float


@dataclass(frozen=True)
class Measurement:
    """One method at one tolerance or step.

    Attributes
    ----------
    method : str
    tolerance, step : float or None
        Which of the two was chosen, in metres or seconds; both None where the method cannot run at all.
    status : str
        "complete"; "failed"; "too slow" for one stopped at the limit of time; "skipped", as what is looser was too slow
        already; "unavailable".
    reason : str
        Why it is not complete.
    wall_time : float or None
        Of the fastest repetition [s]; None, like all that follows, where the run did not get to its end.
    error : float or None
        Largest distance from the reference at the samples [m].
    steps, rejected, newton_iterations, factorisations, evaluations : int or None
    constraint_position_max, constraint_velocity_max, energy_balance_max : float or None
        See `Solution`.
    repetitions : int
    warnings : tuple of str
        What was warned of on the way, each once.
    """

    method: str
    tolerance: float | None = None
    step: float | None = None
    status: str = "complete"
    reason: str = ""
    wall_time: float | None = None
    error: float | None = None
    steps: int | None = None
    rejected: int | None = None
    newton_iterations: int | None = None
    factorisations: int | None = None
    evaluations: int | None = None
    constraint_position_max: float | None = None
    constraint_velocity_max: float | None = None
    energy_balance_max: float | None = None
    repetitions: int = 0
    warnings: tuple[str, ...] = ()


@dataclass(frozen=True)
class MethodComparison(Result):
    """Wall time and error of several methods on one motion.

    Attributes
    ----------
    case, mechanism : str
        What was integrated, in words, and of which mechanism.
    duration : float
        [s]
    samples : int
    coordinates, rows : int
        Of the system: generalised coordinates and constraint rows, those of springs among them.
    reference : Reference or None
        None where the comparison was interrupted before there was one.
    measurements : tuple of Measurement
    interrupted : bool
        Whether the user stopped it; runs that were not begun are missing.
    parameters : mapping or None
        Kept as provenance.
    """

    kept_as = COMPARISON
    values_file = "compare-methods.json"
    case: str
    mechanism: str
    duration: float
    samples: int
    coordinates: int
    rows: int
    reference: Reference | None
    measurements: tuple[Measurement, ...]
    interrupted: bool = False
    parameters: dict[str, Any] | None = None

    @property
    def complete(self) -> bool:
        """Whether every run was started."""
        return not self.interrupted

    @property
    def begun(self) -> bool:
        """Whether any run was measured."""
        return bool(self.measurements)

    @property
    def data(self) -> xr.Dataset:
        """Every run, (run,): method, tolerance or step, status, error, time and work; NaN for missing values."""
        columns = {}
        for name in (each.name for each in fields(Measurement) if each.name != "warnings"):
            values = [getattr(run, name) for run in self.measurements]
            columns[name] = ("run", np.array(values, dtype=str if name in _TEXTS else float))
        return xr.Dataset(columns, attrs={"case": self.case, "mechanism": self.mechanism})

    @property
    def methods(self) -> tuple[str, ...]:
        """The methods in the order of their runs."""
        return tuple(dict.fromkeys(run.method for run in self.measurements))

    def time_to_reach(self, method: str, error: float) -> float | None:
        """Wall time of a method for an error [s]; None if no run of it was so accurate.

        Straight lines in the logarithms of both between the runs none of which is slower and less close than another;
        that of the fastest run where it is closer already.
        """
        assert self.reference is not None or not self.measurements
        floor = self.reference.uncertainty if self.reference is not None else 0.0
        points = sorted(
            (run.wall_time, max(run.error, floor))
            for run in self.measurements
            if run.method == method and run.wall_time is not None and run.error is not None
        )
        best: list[tuple[float, float]] = []
        for time, reached in points:
            if not best or reached < best[-1][1]:
                best.append((time, reached))
        if not best or best[-1][1] > error:
            return None
        times, errors = np.log(np.maximum(np.array(best), 1e-300)).T
        return float(np.exp(np.interp(-np.log(error), -errors, times)))

    def relative_time(self, method: str, error: float = TABLE_LEVEL) -> float | None:
        """`time_to_reach` as a multiple of the default method's."""
        own, default = self.time_to_reach(method, error), self.time_to_reach(DEFAULT_METHOD, error)
        return None if own is None or default is None else own / default

    def fastest(self, error: float) -> str | None:
        """The method that reaches an error first; None if none does."""
        times = {method: self.time_to_reach(method, error) for method in self.methods}
        reached = {method: time for method, time in times.items() if time is not None}
        return min(reached, key=lambda method: reached[method]) if reached else None

    def to_dict(self) -> dict[str, Any]:
        """The comparison in plain values: the content of `compare-methods.json`."""
        out = {
            "mechanism": self.mechanism,
            "case": self.case,
            "duration": self.duration,
            "samples": self.samples,
            "coordinates": self.coordinates,
            "rows": self.rows,
            "interrupted": self.interrupted,
            "reference": None if self.reference is None else asdict(self.reference),
            "methods": {name: self._of_method(name) for name in self.methods},
            "fastest": {f"{level:g}": self.fastest(level) for level in LEVELS},
            "machine": machine(),
            "versions": _versions(),
        }
        return out if self.parameters is None else out | {"parameters": self.parameters}

    def _of_method(self, name: str) -> dict[str, Any]:
        method = METHODS[name]
        return {
            "title": method.title,
            "family": method.family.value,
            "form": method.form,
            "order": method.order,
            "time_to_reach": {f"{level:g}": self.time_to_reach(name, level) for level in LEVELS},
            "relative_time": self.relative_time(name),
            "runs": [
                {field: value for field, value in asdict(run).items() if field != "method"}
                for run in self.measurements
                if run.method == name
            ],
        }


def machine() -> dict[str, Any]:
    """The machine of the measurements."""
    model = platform.processor() or platform.machine()
    listing = Path("/proc/cpuinfo")
    if listing.exists():
        lines = (line.partition(":") for line in listing.read_text(encoding="utf-8").splitlines())
        model = next((value.strip() for key, _, value in lines if key.strip() == "model name"), model)
    return {
        "processor": model,
        "processors": os.cpu_count(),
        "system": platform.platform(),
        "python": platform.python_version(),
    }


def _versions() -> dict[str, str | None]:
    out: dict[str, str | None] = {}
    for package in _TIMING_PACKAGES:
        try:
            out[package] = version(package)
        except PackageNotFoundError:
            out[package] = None
    return out
