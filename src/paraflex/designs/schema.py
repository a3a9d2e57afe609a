"""Pydantic schema of the study file of a sweep, and a function that reads study files."""

from collections.abc import Callable, Collection, Iterator, Mapping
from contextlib import contextmanager
from pathlib import Path
from typing import Annotated, Any, ClassVar, Literal, TypeVar

from pydantic import BaseModel, ConfigDict, Field, WrapValidator

from paraflex.errors import InputError
from paraflex.files import Model
from paraflex.files.overlay import plain
from paraflex.files.read import naming, read_toml, validate
from paraflex.files.schema import Count, Number, NumberOfFields, Text, Yes
from paraflex.mechanism import Mechanism

T = TypeVar("T", bound=BaseModel)
# Study file, or its content.
StudyFile = str | Path | Mapping[str, Any]
# Name of a study whose file does not give one.
DEFAULT_NAME = "sweep"
# Fields of a study that apply to runs only.
_OF_RUNS = ("paths", "modes", "duration", "samples", "balanced", "integration")


class FileTable(BaseModel):
    """Base class of the tables of a study file."""

    model_config: ClassVar[ConfigDict] = ConfigDict(extra="forbid", frozen=True)


class VaryTable(FileTable):
    """Table of a parameter."""

    fields: list[Text] = Field(default=[], description="fields of the mechanism's file, all given the same number")
    values: list[Any] | None = Field(default=None, description="a list of numbers, in the unit of its fields")
    low: NumberOfFields | None = Field(default=None, description="the smallest value, in the unit of its fields")
    high: NumberOfFields | None = Field(default=None, description="the largest value, in the unit of its fields")
    number: Count | None = Field(default=None, description="the number of values of a grid from low to high")
    scale: Literal["linear", "log"] = Field(default="linear", description='"linear" or "log"')
    whole: Yes = Field(default=False, description="true for whole numbers only")


class SamplingTable(FileTable):
    """Table of the sampling of the parameters' ranges."""

    kind: Literal["grid", "list", "random", "sobol"] = Field(
        default="grid", description='"grid", "list", "random" or "sobol"'
    )
    number: Count | None = Field(default=None, description="the number of designs")
    seed: Count = Field(default=0, description="a non-negative whole number")


class IntegrationTable(FileTable):
    """Table of integration options; the defaults are those of the mechanism's [study] table, then of the program."""

    method: Text | None = Field(default=None, description="the method of integration: paraflex methods lists them")
    tolerance: Number | None = Field(default=None, description="the tolerance in m")
    tolerance_per: Text | None = Field(default=None, description='"cycle" or "run": see [study]')
    control: Text | None = Field(default=None, description='"positions" or "forces": see [study]')
    step: Number | None = Field(default=None, description="a fixed step in s, with methods that take one")
    constraints: Text | None = Field(default=None, description='"baumgarte", "projection" or "ggl"')
    alpha: Number | None = Field(default=None, description="Baumgarte's coefficient alpha in 1/s")
    beta: Number | None = Field(default=None, description="Baumgarte's coefficient beta in 1/s")
    automatic_gains: Yes | None = Field(default=None, description="true or false")
    max_steps: Count | None = Field(default=None, description="the maximum number of steps of a run")
    parameters: dict[str, Number] = Field(default={}, description="the method's own parameters")


def _mechanism(value: Any, check: Callable[[Any], Any]) -> Any:
    """Return a model or mechanism, which a study described in Python may hold, or the checked name of one."""
    return value if isinstance(value, Model | Mechanism) else check(str(value) if isinstance(value, Path) else value)


class SweepTable(FileTable):
    """Contents of a study file."""

    name: Text = Field(default=DEFAULT_NAME, description="a name for the study")
    mechanism: Annotated[Text, WrapValidator(_mechanism)] = Field(
        description="a library mechanism or a file, relative to the study file's folder"
    )
    set: dict[str, Any] = Field(default={}, description="values in place of those of the mechanism's file, by field")
    paths: list[Text] = Field(
        default=[], description="paths of the mechanism's file by name; by default those of its [study]"
    )
    modes: list[Text] = Field(default=[], description="actuation modes by name, signs or motor names")
    duration: Number | None = Field(default=None, description="the duration in s, dwell included")
    samples: Count | None = Field(default=None, description="the number of samples of each run")
    assembly: Text | None = Field(default=None, description="the name of an assembly")
    balanced: Yes = Field(
        default=False,
        description="true to start a mechanism without a path with the deflections of steady running",
    )
    metrics: list[Text] = Field(default=[], description="names of the metrics to keep, validity always; all by default")
    trajectories: Yes = Field(default=False, description="true to keep every run as a netCDF file")
    statics: dict[str, Any] | None = Field(
        default=None,
        description="equilibria in place of runs: fields that differ from [statics] of the mechanism's file, each in "
        "the unit of its field there",
    )
    sampling: SamplingTable = SamplingTable()
    integration: IntegrationTable = IntegrationTable()
    vary: dict[str, VaryTable] = Field(default={}, description="a [vary.NAME] table for each parameter")


def check_of_statics(given: Collection[str]) -> None:
    """Check that a study of equilibria has no fields for runs, from the names of the fields given.

    Raises
    ------
    InputError
        A field applies to runs only; the error names it.
    """
    for name in _OF_RUNS:
        if name in given:
            remedy = "leave it out, or the [statics] table"
            raise InputError("equilibria have none: the study is of statics", field=name, remedy=remedy)


@contextmanager
def study_table(kind: type[T], file: StudyFile) -> Iterator[tuple[T, Path]]:
    """Provide the contents of a study file and its folder; input errors raised in the context name the file.

    Parameters
    ----------
    kind : type
        Schema of the file.
    file : str, Path or mapping
        Study file; or its contents, whose mechanism may be an object, and whose folder is the current one.

    Raises
    ------
    InputError
        The file cannot be read, or a field does not fit.
    """
    source, folder = ("", Path()) if isinstance(file, Mapping) else (str(file), Path(file).parent)
    with naming(source):
        yield validate(kind, plain(file) if isinstance(file, Mapping) else read_toml(Path(file)), source), folder
