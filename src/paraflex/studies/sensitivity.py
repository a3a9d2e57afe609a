"""Sensitivity study: every metric of every run, differentiated with respect to every parameter."""

from __future__ import annotations

import time
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field, replace
from pathlib import Path
from typing import TYPE_CHECKING, Any, ClassVar

import numpy as np
import xarray as xr

from paraflex.arguments import checked_arguments
from paraflex.arrays import Array
from paraflex.campaign import OnProgress, Progress, Result, WholeStudy, Workers, no_workers
from paraflex.designs.derivatives.gradient import ModeGradients, mode_gradients
from paraflex.designs.derivatives.plans import check_has_path, nominal_values
from paraflex.designs.measure import SMOOTH, check_metric, check_smooth, smooth_metrics
from paraflex.designs.run import Task
from paraflex.designs.samples import SweptParameter
from paraflex.designs.schema import StudyFile, SweepTable, study_table
from paraflex.designs.setting import Setting, digest, make_setting
from paraflex.errors import InputError
from paraflex.findings import Verdict
from paraflex.folders import SENSITIVITY
from paraflex.mechanism.quantities import known
from paraflex.results.metrics import MetricMembers, metric_unit
from paraflex.results.numbers import finite_or_none
from paraflex.results.tables import spreadsheet_text, write_parquet
from paraflex.writing import whole_file

if TYPE_CHECKING:
    import pandas as pd

_COLUMNS = ("path", "mode", "metric", "unit", "parameter", "nominal", "value", "derivative", "relative", "error")
TABLE, LINES, FIGURES = "sensitivity.csv", "sensitivity.parquet", "figures"


@dataclass(frozen=True)
class Sensitivities(Result):
    """Metrics of runs and their derivatives with respect to parameters.

    Attributes
    ----------
    name, mechanism : str
        Names of the study and of the mechanism.
    rows : tuple of (path, mode)
        Path and mode of each run.
    parameters : tuple of str
        Names of the parameters.
    nominal : (parameters,) array
        Parameter values at which the derivatives are taken.
    fields : tuple of tuples of str
        Fields of the mechanism's file that each parameter sets.
    metrics : tuple of str
        Columns of the metrics; a metric per motor is named NAME.MOTOR.
    units : tuple of str
        Units of the metrics.
    values : (rows, metrics) array
        Values of the metrics.
    derivatives : (rows, metrics, parameters) array
        Derivatives, in the unit of the metric per unit of the parameter's field.
    errors : (rows, metrics, parameters) array
        Estimated errors of the derivatives due to finite differences; see docs/sensitivities.md.
    residual : (rows,) array
        Residual to which the stage equations are solved, relative to the accelerations.
    content : str
        Digest of everything that the results depend on.
    verdict : Verdict
        Doubts about the design that the file describes.
    """

    kept_as = SENSITIVITY
    values_file = "sensitivity.json"
    name: str
    mechanism: str
    rows: tuple[tuple[str, str], ...]
    parameters: tuple[str, ...]
    nominal: Array
    fields: tuple[tuple[str, ...], ...]
    metrics: tuple[str, ...]
    units: tuple[str, ...]
    values: Array
    derivatives: Array
    errors: Array
    residual: Array
    content: str = ""
    verdict: Verdict = field(default_factory=lambda: Verdict(()))

    @property
    def complete(self) -> bool:
        """Whether the results are complete: always True, because a missing derivative is an error."""
        return True

    @property
    def data(self) -> xr.Dataset:
        """Dataset of values (run, metric), and of derivatives, elasticities and errors (run, metric, parameter)."""
        of_run, of_metric = ("run", "metric"), ("run", "metric", "parameter")
        path, mode = zip(*self.rows, strict=True)
        return xr.Dataset(
            {
                "value": (of_run, self.values),
                "derivative": (of_metric, self.derivatives),
                "relative": (of_metric, self.relative),
                "error": (of_metric, self.errors),
                "residual": ("run", self.residual),
            },
            {
                "path": ("run", list(path)),
                "mode": ("run", list(mode)),
                "metric": list(self.metrics),
                "unit": ("metric", list(self.units)),
                "parameter": list(self.parameters),
                "nominal": ("parameter", self.nominal),
            },
            {"name": self.name, "mechanism": self.mechanism},
        )

    @property
    def relative(self) -> Array:
        """Elasticities (rows, metrics, parameters): relative change of a metric per relative change of a parameter.

        They are NaN where the metric is zero.
        """
        values = np.where(self.values == 0.0, np.nan, self.values)[:, :, None]
        return self.nominal * self.derivatives / values

    def to_frame(self) -> pd.DataFrame:
        """Return a data frame with one line for each row, metric and parameter."""
        dims = ["run", "metric", "parameter"]
        return self.data.drop_vars("residual").to_dataframe(dims).reset_index().reindex(columns=list(_COLUMNS))

    def to_dict(self) -> dict[str, Any]:
        """Return all results as plain values, with None for NaN and infinity."""
        parameters = zip(self.parameters, self.nominal, self.fields, strict=True)
        return {
            "content": self.content,
            "verdict": self.verdict.to_dict(),
            "name": self.name,
            "mechanism": self.mechanism,
            "parameters": {name: {"value": float(value), "fields": list(fields)} for name, value, fields in parameters},
            "units": dict(zip(self.metrics, self.units, strict=True)),
            "runs": [
                {
                    "path": path,
                    "mode": mode,
                    "residual": float(self.residual[i]),
                    "metrics": {name: self._metric(i, j) for j, name in enumerate(self.metrics)},
                }
                for i, (path, mode) in enumerate(self.rows)
            ],
        }

    def write_files(self, folder: Path) -> None:
        """Write `sensitivity.json`, and the data frame as CSV and Parquet files; see `Result.save`."""
        import pyarrow as pa

        super().write_files(folder)
        lines = self.to_frame()
        with whole_file(folder / TABLE) as unfinished:
            cells = lines.map(lambda cell: spreadsheet_text(cell) if isinstance(cell, str) else cell)
            cells.to_csv(unfinished, index=False)
        write_parquet(pa.Table.from_pandas(lines, preserve_index=False), folder / LINES)

    def _metric(self, i: int, j: int) -> dict[str, Any]:
        arrays = {"derivatives": self.derivatives, "relative": self.relative, "errors": self.errors}
        by_parameter = {
            kind: {name: finite_or_none(value) for name, value in zip(self.parameters, array[i, j], strict=True)}
            for kind, array in arrays.items()
        }
        return {"value": finite_or_none(self.values[i, j]), **by_parameter}


@dataclass(frozen=True)
class SensitivityStudy(WholeStudy[Sensitivities]):
    """Sensitivity study: runs, metrics and parameters.

    The paths are processed one after the other; workers are not accepted.

    Attributes
    ----------
    name : str
        Name of the study.
    setting : Setting
        Settings of the runs, with metrics that have derivatives.
    parameters : tuple of SweptParameter
        Parameters to differentiate with respect to.
    at : mapping of str to float
        Parameter values that replace those of the mechanism's file.

    Raises
    ------
    InputError
        Unknown parameter, or parameter or integration method without derivatives; raised by `run`.
    NumericalError
        Failed run; raised by `run`.
    """

    gives: ClassVar[type[Result]] = Sensitivities
    name: str
    setting: Setting
    parameters: tuple[SweptParameter, ...]
    at: Mapping[str, float] = field(default_factory=dict)

    def content(self) -> str:
        """Return a digest of everything that the results depend on."""
        setting = self.setting
        places = [[list(place) for place in places] for places in setting.places]
        parts = [setting.identity, places, setting.names, setting.paths, setting.modes, setting.metrics]
        return digest([*parts, dict(self.at)])

    def _prepare(self, workers: Workers | None) -> Callable[[OnProgress | None], Sensitivities]:
        no_workers(workers, "paths are differentiated one after another")
        return self._run

    def _run(self, on_progress: OnProgress | None) -> Sensitivities:
        setting, values = self.setting, _values(self.setting, self.at)
        sizes = [_size(parameter, value) for parameter, value in zip(self.parameters, values, strict=True)]
        rows: list[tuple[str, str]] = []
        found: list[ModeGradients] = []
        began = time.perf_counter()
        for number, path in enumerate(setting.paths):
            if on_progress is not None:
                spent = time.perf_counter() - began
                on_progress(Progress(number, len(setting.paths), number, spent, f"path {path}"))
            for each in mode_gradients(setting, Task(number, 0, values, path), sizes):
                rows.append((path, each.mode))
                found.append(each)
        columns, members = tuple(found[0].gradients), MetricMembers(setting.design(values)[0].mechanism)
        return Sensitivities(
            name=self.name,
            mechanism=setting.source,
            rows=tuple(rows),
            parameters=setting.names,
            nominal=np.array(values),
            fields=tuple(parameter.fields for parameter in self.parameters),
            metrics=columns,
            units=tuple(metric_unit(name, members) for name in columns),
            values=np.array([[each.values[name] for name in columns] for each in found]),
            derivatives=np.array([[each.gradients[name] for name in columns] for each in found]),
            errors=np.array([[each.errors[name] for name in columns] for each in found]),
            residual=np.array([each.residual for each in found]),
            content=self.content(),
            verdict=setting.verdict(),
        )


@checked_arguments()
def load_sensitivities(file: StudyFile, metrics: Sequence[str] = ()) -> SensitivityStudy:
    """Read a sensitivity study from the file of a sweep, in which parameters need no values; sampling is ignored.

    Parameters
    ----------
    file : str, Path or mapping
        Study file, TOML; see docs/sensitivities.md.
    metrics : sequence of str
        Metrics that replace those of the file.

    Raises
    ------
    InputError
        Invalid entry, or one that does not fit the mechanism. The error names file, field, value and remedy.
    """
    with study_table(SweepTable, file) as (table, folder):
        chosen = list(metrics) or table.metrics
        for name in chosen:
            check_metric(name, known=SMOOTH)
        check_smooth(chosen)
        setting, parameters, _ = make_setting(table.model_copy(update={"metrics": chosen}), folder)
        check_has_path(setting)
        if not chosen:
            setting = replace(setting, metrics=smooth_metrics(setting.metrics))
        if not parameters:
            raise InputError(
                "no parameters to differentiate by",
                field="vary",
                remedy="give each a table: [vary.NAME] fields = [...]",
            )
        return SensitivityStudy(table.name, setting, parameters)


@checked_arguments()
def sensitivities(study: SensitivityStudy | StudyFile, *, at: Mapping[str, float] | None = None) -> Sensitivities:
    """Compute the derivatives of the metrics of a study's runs with respect to its parameters.

    Parameters
    ----------
    study : SensitivityStudy, str, Path or mapping
        Study, its file, or the contents of one.
    at : mapping of str to float, optional
        Parameter values that replace those of the mechanism's file.
    """
    if not isinstance(study, SensitivityStudy):
        study = load_sensitivities(study)
    return (study if at is None else replace(study, at=at)).run()


def _values(setting: Setting, at: Mapping[str, float]) -> tuple[float, ...]:
    for name, value in at.items():
        known(name, setting.names, "--at", "parameter")
        if not np.isfinite(value):
            raise InputError("not a number", field="--at", value=f"{name}={value}", remedy="give a finite one")
    return tuple(
        float(at[name]) if name in at else nominal
        for name, nominal in zip(setting.names, nominal_values(setting, at), strict=True)
    )


def _size(parameter: SweptParameter, value: float) -> float | None:
    """Return the size from which the step of a parameter with value zero is chosen: its range, or None."""
    if value != 0.0 or parameter.low is None or parameter.high is None:
        return None
    return parameter.high - parameter.low
