"""Results of a comparison of methods: one row per run, the reference, and the wall time needed for an error."""

import os
import platform
from contextlib import suppress
from dataclasses import asdict, dataclass, fields
from importlib.metadata import PackageNotFoundError, version
from pathlib import Path
from typing import Any

import numpy as np
import xarray as xr

from paraflex.campaign import Result
from paraflex.folders import COMPARISON
from paraflex.integrators import DEFAULT_METHOD, METHODS

# Errors at which wall times are compared [m], and the one used in the table.
LEVELS, TABLE_LEVEL = (1e-3, 1e-4, 1e-5, 1e-6), 1e-5
# Fields of a measurement that are not numbers.
_TEXTS = ("method", "status", "reason")
# Packages whose versions influence the wall times.
_TIMING_PACKAGES = ("paraflex", "numpy", "scipy", "numba", "scikit-sundae")


@dataclass(frozen=True)
class Reference:
    """Converged reference run; errors are distances from it.

    Attributes
    ----------
    method, check_method : str
        Methods of the reference run and of a second run that it is checked against.
    tolerance, check_tolerance : float
        Tolerances of the two runs [m].
    uncertainty : float
        Largest distance between the two runs [m]; smaller errors cannot be distinguished from that of the reference.
    wall_time : float
        Wall time of the reference run [s].
    """

    method: str
    tolerance: float
    check_method: str
    check_tolerance: float
    uncertainty: float
    wall_time: float


@dataclass(frozen=True)
class Measurement:
    """Measured run of one method at one tolerance or step size.

    Attributes
    ----------
    method : str
        Name of the method.
    tolerance, step : float or None
        Tolerance [m] or step size [s] of the run, the other one being None; both None if the method cannot run at all.
    status : str
        "complete"; "failed"; "too slow" if stopped at the time limit; "skipped" if a looser setting was too slow
        already; "unavailable".
    reason : str
        Reason why the run is not complete.
    wall_time : float or None
        Wall time of the fastest repetition [s]; None, like the following counts, if the run did not reach its end.
    error : float or None
        Largest distance from the reference at the samples [m].
    steps, rejected, newton_iterations, factorisations, evaluations : int or None
        Counts of the solver; see `Solution`.
    constraint_position_max, constraint_velocity_max, energy_balance_max : float or None
        Largest constraint violations and energy imbalance; see `Solution`.
    repetitions : int
        Number of repetitions that were run.
    warnings : tuple of str
        Warnings issued during the run, each once.
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
        Short description of the integrated motion, and name of the mechanism.
    duration : float
        Duration of the motion [s].
    samples : int
        Number of output samples.
    coordinates, rows : int
        Numbers of generalised coordinates and of constraint rows of the system; the rows include those of springs.
    reference : Reference or None
        Reference run; None if the comparison was interrupted before it was computed.
    measurements : tuple of Measurement
        Measured runs.
    interrupted : bool
        Whether the user stopped the comparison; runs that were not started are missing.
    parameters : mapping or None
        Parameters stored as provenance.
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
        """All runs, along dimension `run`: method, tolerance or step, status, error, time, work; NaN where missing."""
        columns = {}
        for name in (each.name for each in fields(Measurement) if each.name != "warnings"):
            values = [getattr(run, name) for run in self.measurements]
            columns[name] = ("run", np.array(values, dtype=str if name in _TEXTS else float))
        return xr.Dataset(columns, attrs={"case": self.case, "mechanism": self.mechanism})

    @property
    def methods(self) -> tuple[str, ...]:
        """Names of the methods, in the order of their runs."""
        return tuple(dict.fromkeys(run.method for run in self.measurements))

    def time_to_reach(self, method: str, error: float) -> float | None:
        """Return the wall time that a method needs for an error [s]; None if no run of it was as accurate.

        The time is interpolated linearly in the logarithms of time and error along the Pareto front of the runs. If the
        fastest run is already more accurate, its time is returned. Errors of runs that are below the uncertainty of the
        reference count as that uncertainty.

        Parameters
        ----------
        method : str
            Name of the method.
        error : float
            Error to reach [m].
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
        """Return `time_to_reach` as a multiple of that of the default method; None if either is missing."""
        own, default = self.time_to_reach(method, error), self.time_to_reach(DEFAULT_METHOD, error)
        return None if own is None or default is None else own / default

    def fastest(self, error: float) -> str | None:
        """Return the method that reaches an error [m] in the least wall time; None if no method reaches it."""
        times = {method: self.time_to_reach(method, error) for method in self.methods}
        reached = {method: time for method, time in times.items() if time is not None}
        return min(reached, key=lambda method: reached[method]) if reached else None

    def to_dict(self) -> dict[str, Any]:
        """Return the comparison as plain values: the content of `compare-methods.json`."""
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
    """Return the description of this machine: processor, number of processors, operating system, Python version."""
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
    out: dict[str, str | None] = dict.fromkeys(_TIMING_PACKAGES)
    for package in out:
        with suppress(PackageNotFoundError):
            out[package] = version(package)
    return out
