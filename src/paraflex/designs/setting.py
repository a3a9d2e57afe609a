"""Common settings of all runs of a study: mechanism, parameters, and options of the runs."""

import hashlib
import json
from collections.abc import Mapping
from dataclasses import dataclass, field, replace
from functools import cache, cached_property
from importlib.metadata import version
from pathlib import Path as FilePath
from typing import Any

from paraflex.arrays import Brief
from paraflex.equilibria.conditions import chosen_over
from paraflex.errors import InputError, suggestion, within
from paraflex.expressions.evaluate import ExpressionError, evaluate
from paraflex.files import Model, StudyDefaults, library_names, model_from
from paraflex.files.generators import is_generated
from paraflex.files.model import read_model
from paraflex.files.overlay import Place, find_place, overlaid
from paraflex.files.read import exists
from paraflex.files.schema import NumberOfText
from paraflex.findings import Verdict
from paraflex.integrators import IntegrationOptions, check_times
from paraflex.limits import WHOLE, at_most, of_size
from paraflex.mechanism.quantities import known
from paraflex.results.dataset import part_of
from paraflex.results.following import PathPart
from paraflex.results.metrics import METRICS, MOTION, PATH, STATICS, MetricMembers, metric_unit
from paraflex.validity import implausible_numbers
from .measure import metrics_of
from .own_motion import own_duration
from .samples import SweptParameter
from .schema import SweepTable, VaryTable, check_of_statics
from .units import check_unit_of, unit_of

# Default limit of attempted steps, so that a single design with violent motion does not delay a study.
DESIGN_MOST_STEPS = 200_000
# Table of a study's own integration options, and those of them that may be parameters.
INTEGRATION = "integration"
INTEGRATION_NUMBERS = ("tolerance", "step", "alpha", "beta")
# Columns of every table of designs that are neither parameters nor metrics.
FIXED_COLUMNS = ("run", "id", "design", "path", "mode", "status", "reason", "time_reached")
# Names of the path and of the mode of a run without a path.
NO_PATH, NO_MODE = "", ""
# Packages that results depend on.
_RESULT_PACKAGES = ("paraflex", "numpy", "scipy", "numba", "llvmlite")


@dataclass(frozen=True)
class Setting(Brief):
    """Inputs of a run except the values of its design; sent to worker processes.

    Attributes
    ----------
    data : mapping
        Parsed contents of the mechanism's file.
    source : str
        Name of the file.
    names : tuple of str
        Names of the parameters.
    places : tuple
        Places in the data that each parameter sets.
    whole : tuple of bool
        Whether each parameter is an integer.
    paths, modes : tuple of str
        Names of the paths and of the actuation modes.
    duration : float or None
        Duration of the runs [s]; None for that of the mechanism's file.
    samples : int or None
        Number of samples of a run; None for that of the mechanism's file.
    assembly : str or None
        Name of the assembly; None for that of the mechanism's file.
    integration : mapping
        Fields of `IntegrationOptions` that override those of the mechanism's [study] table.
    metrics : tuple of str
        Names of metrics in `METRICS`.
    trajectories : bool
        Whether datasets of whole runs are kept.
    versions : mapping of str to str
        Versions of the packages that results depend on.
    text : str
        Text of the mechanism's file, for its comments.
    balanced : bool
        Whether runs without a path start in the deflections of steady running.
    statics : bool
        Whether static equilibria are computed instead of runs, as the [statics] table of the data describes.
    """

    data: Mapping[str, Any]
    source: str
    names: tuple[str, ...]
    places: tuple[tuple[Place, ...], ...]
    whole: tuple[bool, ...]
    paths: tuple[str, ...]
    modes: tuple[str, ...]
    duration: float | None
    samples: int | None
    assembly: str | None
    integration: Mapping[str, Any]
    metrics: tuple[str, ...]
    trajectories: bool
    versions: Mapping[str, str]
    text: str = field(default="", repr=False, compare=False)
    balanced: bool = False
    statics: bool = False

    @property
    def has_path(self) -> bool:
        """Whether runs are along paths rather than a mechanism's own motion."""
        return self.paths != (NO_PATH,)

    @cached_property
    def identity(self) -> str:
        """Digest of the common settings of all runs, part of their ids."""
        settings = [self.duration, self.samples, self.assembly, dict(self.integration), dict(self.versions)]
        more = [name for name in ("balanced", "statics") if getattr(self, name)]
        return digest([dict(self.data), *settings, *more])

    @property
    def parameter_units(self) -> dict[str, str]:
        """SI units of the parameters by name; empty where there is none, or the fields have different ones."""
        units = {name: {unit_of(self.data, place) for place in places}
                 for name, places in zip(self.names, self.places, strict=True)}  # fmt: skip
        return {name: one.pop() if len(one) == 1 else "" for name, one in units.items()}

    def units(self, members: MetricMembers) -> dict[str, str]:
        """Return the SI units of the parameters and of the columns of all metrics."""
        columns = (column for name in self.metrics for column in METRICS[name].columns(members))
        return self.parameter_units | {column: metric_unit(column, members) for column in columns}

    def numbers(self, values: tuple[float, ...]) -> list[tuple[Place, float | int]]:
        """Return all places in the data that a design sets, with their values."""
        return [
            (place, int(value) if whole else value)
            for places, whole, value in zip(self.places, self.whole, values, strict=True)
            for place in places
        ]

    def design(self, values: tuple[float, ...]) -> tuple[Model, IntegrationOptions]:
        """Return the model of a design, and the integration options of its runs.

        Raises
        ------
        InputError
            The values are invalid.
        """
        numbers = self.numbers(values)
        inside = [(place, number) for place, number in numbers if place[0] != INTEGRATION]
        chosen = {str(place[1]): number for place, number in numbers if place[0] == INTEGRATION}
        model = model_from(overlaid(dict(self.data), inside), self.source, self.text)
        return model, self.options(model, chosen)

    def own_study(self, model: Model) -> StudyDefaults:
        """Return the study of a design without a path."""
        return model.study.filled(duration=self.duration, samples=self.samples, assembly=self.assembly)

    def parts(self) -> dict[str, PathPart]:
        """Return the covered part of each path that runs do not complete, for the design that the file describes."""
        model = model_from(dict(self.data), self.source)
        paths = {name: model.path(name) for name in (self.paths if self.has_path else ())}
        found = {name: part_of(path, model.duration(path, self.duration)) for name, path in paths.items()}
        return {name: part for name, part in found.items() if part is not None}

    def verdict(self) -> Verdict:
        """Return findings on the design that the file describes, and on paths that runs do not complete."""
        model = model_from(dict(self.data), self.source)
        parts = [part.finding(f"path.{name}") for name, part in self.parts().items()]
        duration = None if self.has_path or self.statics else own_duration(self.own_study(model))
        return Verdict([*implausible_numbers(model.mechanism, duration), *parts])

    def options(self, model: Model, chosen: Mapping[str, float] | None = None) -> IntegrationOptions:
        """Return the integration options of a design: its own, else those of the study, else those of its file.

        Raises
        ------
        InputError
            The options are inconsistent.
        """
        return model.study.integration(dict(self.integration) | dict(chosen or {}))


def make_setting(table: SweepTable, folder: FilePath) -> tuple[Setting, tuple[SweptParameter, ...], Model]:
    """Return the common settings of a study, its parameters, and the mechanism's model as in its file.

    Raises
    ------
    InputError
        A field does not fit the mechanism, independently of the designs.
    """
    named: Any = table.mechanism
    if isinstance(named, str):
        own = named not in library_names() and not is_generated(named) and exists(folder / named)
        named = str(folder / named) if own else named
    model = read_model(named, table.set)
    runs = STATICS
    if table.statics is not None:
        check_of_statics(table.model_fields_set)
        model, paths = _with_statics(model, table.statics), (NO_PATH,)
    else:
        paths = _paths(model, table.paths)
        runs = MOTION if paths == (NO_PATH,) else PATH
    data = model.parameters
    parameters = tuple(_varied(name, entry, data) for name, entry in table.vary.items())
    duration = table.duration
    # Runs last as long as the file describes, unless designs vary it.
    if runs != STATICS and not any(field.startswith(("path.", "study.")) for one in parameters for field in one.fields):
        own = model.study.duration
        duration = own if runs == MOTION and duration is None else min(model.duration(path, duration) for path in paths)
    setting = Setting(
        data=data,
        source=model.source,
        names=tuple(parameter.name for parameter in parameters),
        places=tuple(_places(data, parameter.name, parameter.fields) for parameter in parameters),
        whole=tuple(parameter.whole for parameter in parameters),
        paths=paths,
        modes=_modes(model, table.modes, paths),
        duration=table.duration,
        samples=table.samples,
        assembly=table.assembly,
        integration=_integration(table),
        metrics=metrics_of(table.metrics, model.study.error, model.mechanism, runs, duration),
        trajectories=table.trajectories,
        versions=versions(),
        text=model.text,
        balanced=table.balanced,
        statics=table.statics is not None,
    )
    _check(setting, model)
    _check_columns(parameters)
    if setting.statics and any(place[0] == INTEGRATION for places in setting.places for place in places):
        check_of_statics([INTEGRATION])
    return setting, parameters, model


@cache
def versions() -> Mapping[str, str]:
    """Return the versions of the packages that results depend on."""
    return {name: version(name) for name in _RESULT_PACKAGES}


def digest(content: Any) -> str:
    """Return the SHA-256 digest of plain values, independent of the order of keys."""
    return hashlib.sha256(json.dumps(content, sort_keys=True, default=str).encode()).hexdigest()


def _with_statics(model: Model, changes: Mapping[str, Any]) -> Model:
    """Return the model with its [statics] table, if any, overridden by that of the study."""
    data = dict(model.parameters) | {"statics": chosen_over(model.parameters.get("statics", {}), changes)}
    try:
        return replace(model_from(data, model.source, model.text), settings=model.settings)
    except InputError as error:
        raise error.in_file("") from None


def _varied(name: str, entry: VaryTable, data: Mapping[str, Any]) -> SweptParameter:
    fields = tuple(entry.fields) or (name,)
    for place in _places(data, name, fields):
        for key in ("low", "high", "start"):
            value = getattr(entry, key, None)
            if isinstance(value, NumberOfText):
                check_unit_of(data, place, value.text, f"vary.{name}.{key}")
    values = None if entry.values is None else [_value(name, value, data, fields) for value in entry.values]
    whole = entry.whole or (bool(values) and all(isinstance(value, int) for value in values or ()))
    if entry.whole and any(value % 1 for value in values or []):
        raise InputError(
            "not all of them whole", field=f"vary.{name}.values", value=values, remedy="leave out whole = true"
        )
    for value in (*(values or ()), entry.low or 0.0, entry.high or 0.0) if whole else ():
        at_most(abs(value), WHOLE, f"vary.{name}", "too large for a whole number")
    return SweptParameter(
        name=name,
        fields=fields,
        values=None if values is None else tuple(map(float, values)),
        low=None if entry.low is None else float(entry.low),
        high=None if entry.high is None else float(entry.high),
        number=entry.number,
        log=entry.scale == "log",
        whole=whole,
    )


def _value(name: str, value: Any, data: Mapping[str, Any], fields: tuple[str, ...]) -> float | int:
    """Return a value of a list in SI units."""
    field, remedy = f"vary.{name}.values", "give a list of numbers"
    if isinstance(value, str):
        try:
            number = evaluate(value, {})
        except ExpressionError as error:
            why = f"{remedy} ({error.problem}; {error.remedy})"
            raise InputError("not a number", field=field, value=value, remedy=why) from None
        for place in _places(data, name, fields):
            check_unit_of(data, place, value, field)
        value = number
    if isinstance(value, bool) or not isinstance(value, (int, float)):
        raise InputError("not a number", field=field, value=value, remedy=remedy)
    of_size(value, field)
    return value


def _places(data: Mapping[str, Any], name: str, fields: tuple[str, ...]) -> tuple[Place, ...]:
    try:
        return tuple(_place(data, field) for field in fields)
    except InputError as error:
        given = f"vary.{name}.fields" if fields != (name,) else f"vary.{name}"
        raise InputError(error.problem, field=given, value=error.field, remedy=error.remedy) from None


def _place(data: Mapping[str, Any], field: str) -> Place:
    table, _, name = field.partition(".")
    if table != INTEGRATION:
        return find_place(data, field)
    if name not in INTEGRATION_NUMBERS:
        raise InputError(
            "not a numeric option of the integration", field=field, remedy=suggestion(name, INTEGRATION_NUMBERS)
        )
    return INTEGRATION, name


def _paths(model: Model, names: list[str]) -> tuple[str, ...]:
    if not names:
        return model.study.paths or ((model.path_name(),) if model.paths else (NO_PATH,))
    for name in names:
        known(name, model.paths, "paths", "path")
    return tuple(dict.fromkeys(names))


def _modes(model: Model, names: list[str], paths: tuple[str, ...]) -> tuple[str, ...]:
    """Return the names of the modes, a single empty one for runs without a path."""
    if paths == (NO_PATH,):
        if names:
            raise InputError(
                "a mechanism without a path has no actuation modes: its torques are given", field="modes",
                value=names[0], remedy="leave it out, or add a [path.NAME] table to the mechanism's file",
            )  # fmt: skip
        return (NO_MODE,)
    try:
        modes = model.modes(names)
    except InputError as error:
        raise error.at("modes") from None
    if not modes:
        raise InputError("no actuation mode to run", field="modes", remedy="name one")
    return tuple(mode.name for mode in modes)


def _integration(table: SweepTable) -> dict[str, Any]:
    given = {name: getattr(table.integration, name) for name in table.integration.model_fields_set}
    return {"max_steps": DESIGN_MOST_STEPS} | {name: value for name, value in given.items() if value not in (None, {})}


def _check(setting: Setting, model: Model) -> None:
    if setting.has_path:
        model.check_start()
    with within("integration"):
        setting.options(model)
    check_times(setting.duration, setting.samples)
    if setting.has_path and setting.balanced:
        raise InputError(
            "runs along a path start on the planned motion", field="balanced", value=True, remedy="leave it out"
        )
    if not (setting.has_path or setting.statics):
        own_duration(setting.own_study(model))
        if model.study.reduced:
            raise InputError(
                "few flexible coordinates are chosen from a planned path, and there is none",
                field="study.reduced", value=model.study.reduced, source=setting.source,
                remedy='leave it out, or write reduction = "craig-bampton" and modes in the tables of beams',
            )  # fmt: skip
    model.mechanism.assembly(setting.assembly)


def _check_columns(parameters: tuple[SweptParameter, ...]) -> None:
    # The columns of a metric of members are NAME.MEMBER, so a parameter may have the name of such a metric.
    taken = {*FIXED_COLUMNS, *(metric.name for metric in METRICS.values() if not metric.each)}
    for parameter in parameters:
        if parameter.name in taken:
            raise InputError(
                "a column of the table has that name", field=f"vary.{parameter.name}", remedy="choose another; write "
                "fields = [...]",
            )  # fmt: skip
