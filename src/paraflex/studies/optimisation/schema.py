"""The schema of a search's study file in pydantic: that of a sweep with further tables."""

from typing import Literal

from pydantic import Field

from paraflex.designs.schema import FileTable, SweepTable, VaryTable, Yes
from paraflex.files.schema import Count, Number, NumberOfFields, Text

MethodName = Literal["slsqp", "trust-constr", "l-bfgs-b", "nelder-mead", "differential-evolution", "optuna"]
GradientsName = Literal["differences", "exact"]


class ParameterTable(VaryTable):
    """A parameter of the search."""

    start: NumberOfFields | None = Field(
        default=None, description="where the search starts, in the unit of its fields; the file's number by default"
    )


class AtMostTable(FileTable):
    """A metric with a limit."""

    metric: Text = Field(description="a metric; one per motor as NAME.MOTOR")
    value: NumberOfFields = Field(description="its limit, in the unit of the metric")


class SoughtTable(FileTable):
    """A metric that shall have a value."""

    metric: Text = Field(description="a metric; one per motor as NAME.MOTOR")
    target: NumberOfFields = Field(description="the value sought, in the unit of the metric")
    weight: Number = Field(default=1.0, description="weight of the square of its relative difference")


class ObjectiveTable(FileTable):
    """The objective."""

    minimise: dict[str, Number] = Field(default={}, description="metrics and their weights")
    targets: list[SoughtTable] = Field(default=[], description="values that metrics shall have, [[objective.targets]]")
    over: Literal["worst", "mean"] = Field(
        default="worst", description='"worst" or "mean" of all paths and modes, of each metric'
    )
    relative: Yes = Field(default=True, description="false for metrics not divided by those of the start")
    at_most: list[AtMostTable] = Field(default=[], description="limits, [[objective.at_most]]")


class TargetTable(FileTable):
    """A number to be reproduced."""

    metric: Text = Field(description="a metric; one per motor as NAME.MOTOR")
    value: NumberOfFields = Field(description="its target value, in the unit of the metric")
    mode: Text | None = Field(default=None, description="the actuation mode, where the study has several")
    path: Text | None = Field(default=None, description="the path, where the study has several")
    weight: Number = Field(default=1.0, description="weight of its residual")
    relative: Yes = Field(default=True, description="false for the difference itself, not divided by the value")


class SearchTable(FileTable):
    """Settings of the search."""

    method: MethodName | None = Field(
        default=None,
        description='"slsqp", "trust-constr", "l-bfgs-b", "nelder-mead", "differential-evolution" or "optuna"',
    )
    evaluations: Count = Field(default=200, description="largest number of designs")
    samples: Count = Field(default=0, description="Sobol samples evaluated first; the search starts from the best")
    seed: Count = Field(default=0, description="a whole number, 0 or more")
    tolerance: Number | None = Field(default=None, description="the relative change at which the search ends")
    gradients: GradientsName | None = Field(
        default=None,
        description='"differences" or "exact"; an identification takes exact ones where its metrics have them',
    )
    difference: Number | None = Field(
        default=None,
        description="the step of differences, as a share of a parameter's range; 1e-3, or in an identification chosen "
        "against the noise of the metrics",
    )


class StudyTable(SweepTable):
    """A study file."""

    vary: dict[str, ParameterTable] = Field(  # pyright: ignore[reportIncompatibleVariableOverride]
        default={}, description="a [vary.NAME] table for each parameter"
    )
    objective: ObjectiveTable | None = Field(default=None, description="[objective], for paraflex optimise")
    target: list[TargetTable] = Field(default=[], description="[[target]] tables, for paraflex identify")
    search: SearchTable = SearchTable()
