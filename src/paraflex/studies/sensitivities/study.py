"""Sensitivities of a study: every metric of every run, differentiated by every parameter."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import NDArray

from paraflex.arguments import checked_arguments
from paraflex.designs.derivatives.gradient import ModeGradients, mode_gradients
from paraflex.designs.derivatives.plans import nominal_values
from paraflex.designs.measure import SMOOTH, check_metric, check_smooth, metric_of, smooth_metrics
from paraflex.designs.run import Task
from paraflex.designs.samples import Varied
from paraflex.designs.schema import SweepTable, study_table
from paraflex.designs.setting import Setting, make_setting
from paraflex.display import Shown
from paraflex.errors import InputError, suggestion
from paraflex.results.summary import finite_or_none

if TYPE_CHECKING:
    import pandas as pd

Array = NDArray[np.float64]


@dataclass(frozen=True)
class SensitivityStudy:
    """What is differentiated by what.

    Attributes
    ----------
    name : str
    setting : Setting
        Of its metrics those that have derivatives.
    parameters : tuple of Varied
    """

    name: str
    setting: Setting
    parameters: tuple[Varied, ...]


@dataclass(frozen=True)
class Sensitivities(Shown):
    """Metrics of runs and their derivatives by parameters.

    Attributes
    ----------
    name, mechanism : str
    rows : tuple of (path, mode)
    parameters : tuple of str
    nominal : (parameters,) array
        Where derivatives are taken.
    fields : tuple of tuples of str
        Of the mechanism's file that each parameter sets.
    metrics : tuple of str
        Columns; those per motor are called NAME.MOTOR.
    units : tuple of str
        Of the metrics.
    values : (rows, metrics) array
    derivatives : (rows, metrics, parameters) array
        In the units of a metric over those of a parameter's field.
    errors : (rows, metrics, parameters) array
        Estimates of what differences left in them: see docs/sensitivities.md.
    unsettled : (rows,) array
        What the equations of a stage are solved to, as a part of the accelerations.
    """

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
    unsettled: Array

    @property
    def relative(self) -> Array:
        """Elasticities (rows, metrics, parameters): how many per cent a metric changes by with one of a parameter.

        NaN where the metric is zero.
        """
        values = np.where(self.values == 0.0, np.nan, self.values)[:, :, None]
        return self.nominal * self.derivatives / values

    def to_frame(self) -> pd.DataFrame:
        """One line for each row, metric and parameter."""
        import pandas as pd

        return pd.DataFrame(list(self._lines()))

    def told(self) -> dict[str, Any]:
        """Everything as plain values; None for what is no number."""
        parameters = zip(self.parameters, self.nominal, self.fields, strict=True)
        return {
            "name": self.name,
            "mechanism": self.mechanism,
            "parameters": {name: {"value": float(value), "fields": list(fields)} for name, value, fields in parameters},
            "units": dict(zip(self.metrics, self.units, strict=True)),
            "runs": [
                {
                    "path": path,
                    "mode": mode,
                    "unsettled": float(self.unsettled[i]),
                    "metrics": {name: self._metric(i, j) for j, name in enumerate(self.metrics)},
                }
                for i, (path, mode) in enumerate(self.rows)
            ],
        }

    def _metric(self, i: int, j: int) -> dict[str, Any]:
        arrays = {"derivatives": self.derivatives, "relative": self.relative, "errors": self.errors}
        told = {
            kind: {name: finite_or_none(value) for name, value in zip(self.parameters, array[i, j], strict=True)}
            for kind, array in arrays.items()
        }
        return {"value": finite_or_none(self.values[i, j]), **told}

    def _lines(self):
        relative = self.relative
        for i, (path, mode) in enumerate(self.rows):
            for j, metric in enumerate(self.metrics):
                for k, parameter in enumerate(self.parameters):
                    yield {
                        "path": path,
                        "mode": mode,
                        "metric": metric,
                        "unit": self.units[j],
                        "parameter": parameter,
                        "nominal": self.nominal[k],
                        "value": self.values[i, j],
                        "derivative": self.derivatives[i, j, k],
                        "relative": relative[i, j, k],
                        "error": self.errors[i, j, k],
                    }


@checked_arguments()
def load_sensitivities(file: str | Path, metrics: Sequence[str] = ()) -> SensitivityStudy:
    """Read a study file: that of a sweep, in which parameters need no values and nothing is sampled.

    Parameters
    ----------
    file : str or Path
        TOML; see docs/sensitivities.md.
    metrics : sequence of str
        Instead of the file's.

    Raises
    ------
    InputError
        Anything in it that does not fit the file or the mechanism: it names file, field, value and remedy.
    """
    with study_table(SweepTable, file) as (table, folder):
        chosen = list(metrics) or table.metrics
        _check_names(chosen)
        setting, parameters, _ = make_setting(table.model_copy(update={"metrics": chosen}), folder)
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
def sensitivities(study: SensitivityStudy | str | Path, *, at: Mapping[str, float] | None = None) -> Sensitivities:
    """Derivatives of the metrics of a study's runs by its parameters.

    Parameters
    ----------
    study : SensitivityStudy, or str or Path of its file
    at : mapping of str to float, optional
        Values of parameters, where they are not to be those of the mechanism's file.

    Raises
    ------
    InputError
        An unknown parameter, or one without a derivative; a method without.
    NumericalError
        A run that cannot be made.
    """
    if not isinstance(study, SensitivityStudy):
        study = load_sensitivities(study)
    setting, values = study.setting, _values(study.setting, at or {})
    sizes = [_size(parameter, value) for parameter, value in zip(study.parameters, values, strict=True)]
    rows, found = [], []
    for number, path in enumerate(setting.paths):
        for each in mode_gradients(setting, Task(number, 0, values, path), sizes):
            rows.append((path, each.mode))
            found.append(each)
    return _gathered(study, values, rows, found)


def _check_names(names: Sequence[str]) -> None:
    for name in names:
        check_metric(name, known=SMOOTH)
    check_smooth(tuple(names))


def _values(setting: Setting, at: Mapping[str, float]) -> tuple[float, ...]:
    for name, value in at.items():
        if name not in setting.names:
            raise InputError(
                "unknown parameter", field="--at", value=name, remedy=suggestion(name, list(setting.names))
            )
        if not np.isfinite(value):
            raise InputError("not a number", field="--at", value=f"{name}={value}", remedy="give a finite one")
    return tuple(
        float(at[name]) if name in at else nominal
        for name, nominal in zip(setting.names, nominal_values(setting, at), strict=True)
    )


def _size(parameter: Varied, value: float) -> float | None:
    """What steps are parts of, where the value is zero: the parameter's range, if it has one."""
    if value != 0.0 or parameter.low is None or parameter.high is None:
        return None
    return parameter.high - parameter.low


def _gathered(
    study: SensitivityStudy, values: tuple[float, ...], rows: list[tuple[str, str]], found: list[ModeGradients]
) -> Sensitivities:
    columns = tuple(found[0].gradients)
    return Sensitivities(
        name=study.name,
        mechanism=study.setting.source,
        rows=tuple(rows),
        parameters=study.setting.names,
        nominal=np.array(values),
        fields=tuple(parameter.fields for parameter in study.parameters),
        metrics=columns,
        units=tuple(metric_of(name).unit for name in columns),
        values=np.array([[each.values[name] for name in columns] for each in found]),
        derivatives=np.array([[each.gradients[name] for name in columns] for each in found]),
        errors=np.array([[each.errors[name] for name in columns] for each in found]),
        unsettled=np.array([each.unsettled for each in found]),
    )
