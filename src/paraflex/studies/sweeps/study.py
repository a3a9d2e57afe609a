"""A sweep, read from its file and checked against the mechanism it varies."""

from __future__ import annotations

import hashlib
import json
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from functools import cache, cached_property
from importlib.metadata import version
from pathlib import Path as FilePath
from typing import Any

import numpy as np
from numpy.typing import NDArray

from paraflex.arguments import checked_arguments, given_as
from paraflex.errors import InputError, as_enum, suggestion
from paraflex.files import Model, library_names, load_data, model_from
from paraflex.files.generators import is_generated
from paraflex.files.read import read_toml, validate
from paraflex.findings import Verdict
from paraflex.integrators import IntegrationOptions
from paraflex.mechanism import parse_mode
from paraflex.results.dataset import part_of
from paraflex.results.metrics import HEADLINE, ErrorSpan, Part
from paraflex.studies.sweeps.metrics import METRICS, VALIDITY
from paraflex.studies.sweeps.overlay import Place, find_place, overlaid
from paraflex.studies.sweeps.samples import Varied, check_varied, designs
from paraflex.studies.sweeps.schema import SweepTable, VaryTable
from paraflex.studies.sweeps.table import FIXED_COLUMNS
from paraflex.validity import doubtful_numbers

# Attempted steps before a run is given up, unless the study says: a design that flails about must not hold up the rest.
MOST_STEPS = 200_000
# A field of this table is one of the study's own [integration], and may be one of these.
INTEGRATION = "integration"
INTEGRATION_NUMBERS = ("tolerance", "step", "alpha", "beta")
# What results depend on besides the study.
_PACKAGES = ("paraflex", "numpy", "scipy", "numba", "llvmlite")


@dataclass(frozen=True)
class Setting:
    """All that a run needs besides its own numbers; goes to worker processes.

    Attributes
    ----------
    data : mapping
        The mechanism's file as parsed.
    source : str
        Its name.
    names : tuple of str
        Of the parameters.
    places : tuple
        For each of them the places in the data that it sets.
    whole : tuple of bool
        Which parameters are whole numbers.
    paths, modes : tuple of str
        By name.
    duration : float or None
        [s]; the mechanism's own where None.
    samples : int or None
    assembly : str or None
    integration : mapping
        Of `IntegrationOptions`, what is not to be as the mechanism's [study] has it.
    metrics : tuple of str
        Names of `METRICS`.
    trajectories : bool
        Whether whole runs are kept.
    versions : mapping of str to str
        Of the packages that results depend on.
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

    @cached_property
    def identity(self) -> str:
        """Of what all runs have in common, for their ids."""
        asked = [self.duration, self.samples, self.assembly, dict(self.integration), dict(self.versions)]
        return digest([dict(self.data), *asked])

    def numbers(self, values: tuple[float, ...]) -> list[tuple[Place, float | int]]:
        """Every place that a design sets, and to what."""
        return [
            (place, int(value) if whole else value)
            for places, whole, value in zip(self.places, self.whole, values, strict=True)
            for place in places
        ]

    def design(self, values: tuple[float, ...]) -> tuple[Model, IntegrationOptions]:
        """A design's model, and how its runs are integrated.

        Raises
        ------
        InputError
            Numbers that cannot be.
        """
        numbers = self.numbers(values)
        inside = [(place, number) for place, number in numbers if place[0] != INTEGRATION]
        chosen = {str(place[1]): number for place, number in numbers if place[0] == INTEGRATION}
        model = model_from(overlaid(dict(self.data), inside), self.source)
        return model, self.options(model, chosen)

    def parts(self) -> dict[str, Part]:
        """Of the paths that runs are too short for, which part they do: of the design that the file describes."""
        model = model_from(dict(self.data), self.source)
        found = {}
        for name in self.paths:
            path = model.path(name)
            found[name] = part_of(path, model.duration(name, path) if self.duration is None else self.duration)
        return {name: part for name, part in found.items() if part is not None}

    def verdict(self) -> Verdict:
        """What is doubtful about the design that the file describes, and which paths runs are too short for."""
        model = model_from(dict(self.data), self.source)
        parts = [part.finding(f"path.{name}") for name, part in self.parts().items()]
        return Verdict([*doubtful_numbers(model.mechanism), *parts])

    def options(self, model: Model, chosen: Mapping[str, float] | None = None) -> IntegrationOptions:
        """How the runs of a design are integrated: as the design chooses, then as the study says, else as its file.

        Raises
        ------
        InputError
            They do not go together.
        """
        study = model.study
        wanted = dict(self.integration) | dict(chosen or {})
        given: dict[str, Any] = {"method": study.method, "tolerance": study.tolerance, "step": study.step}
        given |= wanted
        # A step goes with a method: naming another method leaves the mechanism's step out.
        if "step" not in wanted and given["method"] != study.method:
            given["step"] = None
        return IntegrationOptions(**{name: value for name, value in given.items() if value is not None})


@given_as("a sweep", "a SweepStudy")
@dataclass(frozen=True)
class SweepStudy:
    """A sweep: a mechanism, what varies in it, what is run and what is kept.

    Attributes
    ----------
    name : str
    setting : Setting
    parameters : tuple of Varied
    kind : str
        Of sampling.
    designs : (k, parameters) array
    motors : tuple of str
        Of the mechanism.
    """

    name: str
    setting: Setting
    parameters: tuple[Varied, ...]
    kind: str
    designs: NDArray[np.float64]
    motors: tuple[str, ...]

    @property
    def runs(self) -> int:
        """Number of runs: designs times paths times modes."""
        return len(self.designs) * len(self.setting.paths) * len(self.setting.modes)

    def model(self) -> Model:
        """The mechanism as its file has it."""
        return model_from(dict(self.setting.data), self.setting.source)

    def content(self) -> dict[str, Any]:
        """What the results depend on, in plain values: the same content gives the same table."""
        setting = self.setting
        return {
            "mechanism": dict(setting.data),
            "paths": list(setting.paths),
            "modes": list(setting.modes),
            "duration": setting.duration,
            "samples": setting.samples,
            "assembly": setting.assembly,
            "integration": dict(setting.integration),
            "metrics": list(setting.metrics),
            "trajectories": setting.trajectories,
            "parameters": [
                {"name": p.name, "places": [list(place) for place in places], "whole": p.whole}
                for p, places in zip(self.parameters, setting.places, strict=True)
            ],
            "designs": hashlib.sha256(np.ascontiguousarray(self.designs, dtype="<f8").tobytes()).hexdigest(),
        }


@checked_arguments()
def load_sweep(file: str | FilePath) -> SweepStudy:
    """Read a study file.

    Parameters
    ----------
    file : str or Path
        TOML; see docs/sweeps.md.

    Raises
    ------
    InputError
        Anything in it that does not fit the file or the mechanism: it names file, field, value and remedy.
    """
    source = str(file)
    table = validate(SweepTable, read_toml(FilePath(file), source), source)
    try:
        return make_study(table, FilePath(file).parent)
    except InputError as error:
        raise (error if error.source else error.in_file(source)) from None


def make_study(table: SweepTable, folder: FilePath) -> SweepStudy:
    """A study as a file in a folder says it; see `load_sweep`."""
    setting, parameters, model = make_setting(table, folder)
    for parameter in parameters:
        check_varied(parameter, table.sampling.kind)
    sampling = table.sampling
    return SweepStudy(
        name=table.name,
        setting=setting,
        parameters=parameters,
        kind=sampling.kind,
        designs=designs(parameters, sampling.kind, sampling.number, sampling.seed),
        motors=tuple(motor.name for motor in model.mechanism.motors),
    )


def make_setting(table: SweepTable, folder: FilePath) -> tuple[Setting, tuple[Varied, ...], Model]:
    """What all runs of a study have in common, its parameters, and the mechanism's model as its file has it.

    Raises
    ------
    InputError
        Anything that does not fit the mechanism, whatever designs are taken.
    """
    data, source = load_data(_mechanism(table.mechanism, folder))
    model = model_from(data, source)
    parameters = tuple(_varied(name, entry) for name, entry in table.vary.items())
    setting = Setting(
        data=data,
        source=source,
        names=tuple(parameter.name for parameter in parameters),
        places=tuple(_places(data, parameter) for parameter in parameters),
        whole=tuple(parameter.whole for parameter in parameters),
        paths=_paths(model, table.paths),
        modes=_modes(model, table.modes),
        duration=table.duration,
        samples=table.samples,
        assembly=table.assembly,
        integration=_integration(table),
        metrics=metrics_of(table.metrics, model.study.error),
        trajectories=table.trajectories,
        versions=versions(),
    )
    _check(setting, model)
    _check_columns(parameters)
    return setting, parameters, model


@cache
def versions() -> Mapping[str, str]:
    """Of the packages that results depend on."""
    return {name: version(name) for name in _PACKAGES}


def digest(content: Any) -> str:
    """SHA-256 of plain values, whatever the order of keys."""
    return hashlib.sha256(json.dumps(content, sort_keys=True, default=str).encode()).hexdigest()


def _mechanism(name: str, folder: FilePath) -> str:
    beside = folder / name
    return str(beside) if name not in library_names() and not is_generated(name) and beside.exists() else name


def _varied(name: str, entry: VaryTable) -> Varied:
    values = entry.values
    for value in values or []:
        if isinstance(value, bool) or not isinstance(value, (int, float)) or not np.isfinite(value):
            raise InputError("not a number", field=f"vary.{name}.values", value=value, remedy="give a list of numbers")
    whole = entry.whole or (bool(values) and all(isinstance(value, int) for value in values))
    if entry.whole and any(value % 1 for value in values or []):
        raise InputError(
            "not all of them whole", field=f"vary.{name}.values", value=values, remedy="leave out whole = true"
        )
    return Varied(
        name=name,
        fields=tuple(entry.fields) or (name,),
        values=None if values is None else tuple(map(float, values)),
        low=entry.low,
        high=entry.high,
        number=entry.number,
        log=entry.scale == "log",
        whole=whole,
    )


def _places(data: Mapping[str, Any], parameter: Varied) -> tuple[Place, ...]:
    try:
        return tuple(_place(data, field) for field in parameter.fields)
    except InputError as error:
        given = f"vary.{parameter.name}.fields" if parameter.fields != (parameter.name,) else f"vary.{parameter.name}"
        raise InputError(error.problem, field=given, value=error.field, remedy=error.remedy) from None


def _place(data: Mapping[str, Any], field: str) -> Place:
    table, _, name = field.partition(".")
    if table != INTEGRATION:
        return find_place(data, field)
    if name not in INTEGRATION_NUMBERS:
        raise InputError("no such number of the integration", field=field, remedy=suggestion(name, INTEGRATION_NUMBERS))
    return INTEGRATION, name


def _paths(model: Model, names: list[str]) -> tuple[str, ...]:
    if not names:
        path = model.path()
        return (next(name for name, each in model.paths.items() if each is path),)
    for name in names:
        if name not in model.paths:
            raise InputError("unknown path", field="paths", value=name, remedy=suggestion(name, list(model.paths)))
    return tuple(dict.fromkeys(names))


def _modes(model: Model, names: list[str]) -> tuple[str, ...]:
    wanted = names or list(model.study.modes) or [mode.name for mode in model.mechanism.modes]
    if not wanted:
        raise InputError("no actuation mode to run", field="modes", remedy="name one")
    try:
        return tuple(dict.fromkeys(parse_mode(model.mechanism, name).name for name in wanted))
    except InputError as error:
        raise InputError(error.problem, field="modes", value=error.value, remedy=error.remedy) from None


def metrics_of(names: Sequence[str], error: ErrorSpan | str) -> tuple[str, ...]:
    """Metrics in the order asked for; all where none is, that error first.

    Raises
    ------
    InputError
        An unknown name.
    """
    for name in names:
        if name not in METRICS:
            raise InputError("unknown metric", field="metrics", value=name, remedy=suggestion(name, list(METRICS)))
    return tuple(dict.fromkeys([*(names or [HEADLINE[as_enum(ErrorSpan, error, "error")], *METRICS]), VALIDITY]))


def _integration(table: SweepTable) -> dict[str, Any]:
    given = {name: getattr(table.integration, name) for name in table.integration.model_fields_set}
    return {"max_steps": MOST_STEPS} | {name: value for name, value in given.items() if value not in (None, {})}


def _check(setting: Setting, model: Model) -> None:
    """Nothing, if what every run has in common can be."""
    if model.start is not None:
        raise InputError(
            "a path says where and how the mechanism starts", field="start", source=model.source,
            remedy="drop the [start] table",
        )  # fmt: skip
    try:
        setting.options(model)
    except InputError as error:
        raise error.within("integration") from None
    if setting.duration is not None and not setting.duration > 0.0:
        raise InputError("must be positive", field="duration", value=setting.duration, remedy="give it in s")
    if setting.samples is not None and setting.samples < 2:
        raise InputError("too few samples", field="samples", value=setting.samples, remedy="ask for at least 2")
    model.mechanism.assembly(setting.assembly)


def _check_columns(parameters: tuple[Varied, ...]) -> None:
    taken = {*FIXED_COLUMNS, *METRICS}
    for parameter in parameters:
        if parameter.name in taken:
            raise InputError(
                "a column of the table has that name", field=f"vary.{parameter.name}", remedy="choose another, and say "
                "fields = [...]",
            )  # fmt: skip
