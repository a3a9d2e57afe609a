"""Base class of optimisation and identification studies, and reading of their files."""

from abc import abstractmethod
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path as FilePath
from typing import Any, ClassVar, get_args

import numpy as np

from paraflex.arrays import Array
from paraflex.campaign.study import R_co, Study
from paraflex.designs.measure import check_metric, metric_of
from paraflex.designs.samples import RANDOM, SweptParameter
from paraflex.designs.schema import SamplingTable
from paraflex.designs.setting import INTEGRATION, Setting
from paraflex.designs.sweep import SweepStudy, make_study
from paraflex.errors import InputError, renamed, suggestion
from paraflex.files.overlay import Place, number_at
from paraflex.limits import DESIGNS, at_most
from paraflex.mechanism import quantities
from paraflex.results.metrics import MetricMembers
from .schema import GradientsName, MethodName, ParameterTable, SearchTable, StudyTable


@dataclass(frozen=True)
class Search:
    """Settings of a search.

    Attributes
    ----------
    method : str or None
        Optimisation method; None for the default.
    evaluations : int
        Largest number of evaluated designs.
    samples : int
        Number of Sobol samples evaluated first.
    seed : int
        Seed of the samples and of stochastic methods.
    tolerance : float or None
        Relative change at which the search ends; None for the default of the method.
    gradients : str or None
        Kind of derivatives, "differences" or "exact"; None for exact derivatives in an identification if available,
        else differences.
    difference : float or None
        Step of finite differences as a fraction of a parameter's range; None for a step adapted to noise.
    """

    method: str | None = None
    evaluations: int = 200
    samples: int = 0
    seed: int = 0
    tolerance: float | None = None
    gradients: str | None = None
    difference: float | None = None

    def __post_init__(self) -> None:
        if self.method is not None:
            quantities.known(self.method, get_args(MethodName), "search.method", "method")
        if self.gradients is not None:
            quantities.known(self.gradients, get_args(GradientsName), "search.gradients", "kind of derivatives")


@dataclass(frozen=True)
class DesignStudy(Study[R_co]):
    """Search study: a mechanism, parameters within bounds, and the settings of the search.

    Attributes
    ----------
    base : SweepStudy
        Sweep that defines the runs of a design; its only design is the start.
    search : Search
        Settings of the search.
    """

    base: SweepStudy
    search: Search
    # Whether the search is a least-squares problem, for which exact derivatives are worth their cost.
    least_squares: ClassVar[bool] = False

    @property
    def name(self) -> str:
        """Name of the study."""
        return self.base.name

    @property
    def setting(self) -> Setting:
        """Settings common to all runs."""
        return self.base.setting

    @property
    def parameters(self) -> tuple[SweptParameter, ...]:
        """Parameters with their ranges."""
        return self.base.parameters

    @property
    def start(self) -> tuple[float, ...]:
        """Design from which the search starts."""
        return tuple(self.base.designs[0].tolist())

    @property
    @abstractmethod
    def columns(self) -> tuple[str, ...]:
        """Metrics of the objective or targets."""

    @abstractmethod
    def goal(self) -> dict[str, Any]:
        """Return the objective or the targets as plain values."""

    def design(self, unit: Array) -> tuple[float, ...]:
        """Map a point of the unit cube to parameter values, on a logarithmic scale for logarithmic parameters."""
        inside = np.clip(unit, 0.0, 1.0)
        return tuple(_rounded(p, float(p.spread(x))) for p, x in zip(self.parameters, inside, strict=True))

    def unit(self, design: Sequence[float]) -> Array:
        """Map a design to its point in the unit cube (parameters,)."""
        return np.array([_share(p, value) for p, value in zip(self.parameters, design, strict=True)])

    def per_unit(self, design: Sequence[float]) -> Array:
        """Compute the derivatives of the parameter values by their unit-cube coordinates (parameters,)."""
        ranges = [(p.log, *p.ends) for p in self.parameters]
        sizes = zip(ranges, design, strict=True)
        return np.array([value * np.log(high / low) if log else high - low for (log, low, high), value in sizes])

    def content(self) -> dict[str, Any]:
        """Return everything that the results depend on as plain values, without the limit of evaluations."""
        search = {name: value for name, value in vars(self.search).items() if name != "evaluations"}
        ranges = [[p.low, p.high, p.log] for p in self.parameters]
        goal = {"objective": None, "targets": []} | self.goal()
        return self.base.content() | {"ranges": ranges} | goal | {"search": search}


def base_study(table: StudyTable, folder: FilePath, columns: Mapping[str, str]) -> SweepStudy:
    """Build the sweep of a search, with the start as its only design.

    Its metrics are those of the table and those of the objective or targets, given in `columns` by field of the file.
    """
    for name, entry in table.vary.items():
        _check_range(f"vary.{name}", entry)
    sampling = SamplingTable(kind=RANDOM, number=1)

    def study(metrics: list[str]) -> SweepStudy:
        return make_study(table.model_copy(update={"sampling": sampling, "metrics": metrics}), folder)

    base = study(table.metrics)
    for field, column in columns.items():
        check_metric(column, field, members=base.members)
        with renamed(field, only="metrics"):
            _check_column(field, column, base.members)
    fields = {metric_of(column).name: field for field, column in columns.items()}
    missing = [name for name in fields if name not in base.setting.metrics]
    try:
        base = study([*(table.metrics or base.setting.metrics), *missing]) if missing else base
    except InputError as error:
        at = fields.get(str(error.value))
        raise (error if at is None else error.at(at)) from None
    start = [
        _start(base.setting, places, p, table.vary[p.name].start)
        for p, places in zip(base.parameters, base.setting.places, strict=True)
    ]
    return SweepStudy(base.name, base.setting, base.parameters, "search", np.array([start]), base.members)


def _check_range(field: str, entry: ParameterTable) -> None:
    for key in ("values", "number", "whole"):
        if value := getattr(entry, key):
            remedy = "give only low and high"
            raise InputError("only sweeps have it", field=f"{field}.{key}", value=value, remedy=remedy)
    if entry.low is not None and entry.low == entry.high:
        raise InputError("low and high are equal", field=f"{field}.high", value=entry.high, remedy="leave it out")


def _check_column(field: str, column: str, members: MetricMembers) -> None:
    """Check that a column is one scalar of each run; a metric per motor, drive or joint needs the name of one."""
    metric, known = metric_of(column), metric_of(column).columns(members)
    if column in known:
        return
    problem, remedy = "not a metric per motor, drive or joint", f'write "{metric.name}"'
    if metric.each:
        problem = f"this metric is one of each {metric.each}, and no {metric.each} is named"
        remedy = suggestion(column, known)
    raise InputError(problem, field=field, value=column, remedy=remedy)


def _nominal(setting: Setting, place: Place, field: str) -> float:
    """Return the number at a place in the mechanism's file or in the study's own [integration]."""
    if place[0] != INTEGRATION:
        return number_at(setting.data, place)
    value = setting.integration.get(str(place[1]))
    if value is None:
        raise InputError("the study's [integration] has no such number", field=field, remedy="give a start")
    return float(value)


def _start(setting: Setting, places: tuple[Place, ...], parameter: SweptParameter, given: float | None) -> float:
    """Return the start of a parameter: that given in the study, else the value in the mechanism's file."""
    field = f"vary.{parameter.name}.start"
    found = {_nominal(setting, place, field) for place in places} if given is None else {given}
    if len(found) > 1:
        problem = "its fields have different values in the mechanism's file, so that there is no start"
        raise InputError(problem, field=field, value=sorted(found), remedy="give a start")
    (start,) = found
    low, high = parameter.ends
    if not low <= start <= high:
        raise InputError(
            f"outside the bounds, {low:g} to {high:g}", field=field, value=start,
            remedy="give a start within, or other bounds",
        )  # fmt: skip
    return _rounded(parameter, start)


def _share(parameter: SweptParameter, value: float) -> float:
    low, high = parameter.ends
    return float(np.log(value / low) / np.log(high / low)) if parameter.log else (value - low) / (high - low)


def _rounded(parameter: SweptParameter, value: float) -> float:
    """Round a value to twelve digits, within the bounds, so that equal designs do not differ by rounding."""
    low, high = parameter.ends
    return min(max(float(f"{value:.12g}"), low), high)


def read_search(table: SearchTable) -> Search:
    """Read the settings of a search from the table of its file."""
    for name in ("evaluations", "difference", "tolerance"):
        value = getattr(table, name)
        if value is not None and not value > 0:
            raise InputError("must be positive", field=f"search.{name}", value=value, remedy="leave it out")
    for name in ("samples", "seed"):
        if (value := getattr(table, name)) < 0:
            raise InputError("must not be negative", field=f"search.{name}", value=value, remedy="leave it out")
    at_most(table.samples, DESIGNS, "search.samples", "too many designs")
    if table.difference is not None and table.difference > 0.1:
        raise InputError(
            "too large for a derivative", field="search.difference", value=table.difference, remedy="give 1e-3"
        )
    return Search(**{name: getattr(table, name) for name in SearchTable.model_fields})
