"""Arguments and options common to several commands."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, field
from typing import TYPE_CHECKING, Annotated, Any

from typer import Argument, BadParameter, Option

from paraflex.errors import InputError

if TYPE_CHECKING:
    from paraflex.campaign import Workers


def measured(unit: str) -> Callable[[Any], float]:
    """Return a parser of option values: a number in `unit`, or one with a unit of the same dimension."""

    def number(text: Any) -> float:
        try:
            return float(text)
        except ValueError:
            from paraflex.files.fields import number_in  # not needed for the help

            try:
                return number_in(text, unit)
            except InputError as error:
                raise BadParameter(f"{error.problem}: {text!r}; {error.remedy}") from None

    return number


SECONDS, METRES, PER_SECOND = measured("s"), measured("m"), measured("1/s")

# Model of a command for which none is named.
DEFAULT_MODEL = "raparm_i"

Json = Annotated[bool, Option("--json", help="Print JSON instead of tables.")]
PathOption = Annotated[
    str | None,
    Option(
        "--path", metavar="NAME|FILE", help="A path of the model (square, line, circle, ...) or a TOML file with one."
    ),
]
ToleranceOption = Annotated[
    float | None,
    Option("--tol", metavar="METRES", parser=METRES, help="Tolerance. Default: the study's, else 4e-5 of the size."),
]
MethodOption = Annotated[str | None, Option(metavar="NAME", help="Method of integration: paraflex methods lists them.")]
AssemblyOption = Annotated[str | None, Option(metavar="NAME", help="Assembly (configuration) of the mechanism.")]
StudyArgument = Annotated[str, Argument(metavar="STUDY.toml", help="Study file: free parameters, their bounds, runs.")]
OutputOption = Annotated[
    str | None, Option("--output", "--out", metavar="DIR", help="Folder for results. Default: results/STUDY.")
]
ReplaceOption = Annotated[bool, Option("--force", help="Replace results of another kind that the folder holds.")]
ReportOption = Annotated[bool, Option("--report/--no-report", help="Write report.html, or leave it out.")]
OutsideOption = Annotated[bool, Option("--allow-outside", help="Read tables outside the model's folder that it names.")]


@dataclass(frozen=True)
class DrawnChoice:
    """Choice of figures and report of results."""

    figures: Annotated[bool, Option("--figures/--no-figures", help="Draw figures, or leave them out.")] = True
    report: ReportOption = True


@dataclass(frozen=True)
class ModelChoice:
    """Choice of a model by an argument or by --mechanism.

    Raises
    ------
    InputError
        Argument and option name different models.
    """

    source: Annotated[
        str | None, Argument(metavar="NAME|FILE", help=f"A library mechanism or a TOML file. Default: {DEFAULT_MODEL}.")
    ] = None
    mechanism: Annotated[
        str | None, Option("--mechanism", "-m", metavar="NAME|FILE", help="The same, given as an option.")
    ] = None

    settings: Annotated[
        list[str],
        Option("--set", metavar="FIELD=VALUE", help='Value in place of the file\'s, "link1.length=80 mm"; repeatable.'),
    ] = field(default_factory=list)
    allow_outside: OutsideOption = False

    def __post_init__(self) -> None:
        if self.source is not None and self.mechanism is not None and self.source != self.mechanism:
            raise InputError(
                f"two models are named, {self.source!r} and --mechanism {self.mechanism!r}", field="--mechanism",
                remedy="name one of them"
            )  # fmt: skip

    @property
    def given(self) -> str | None:
        """Name of the model; None if none is given."""
        return self.mechanism if self.source is None else self.source

    @property
    def name(self) -> str:
        """Name of the model, or of the default one."""
        return self.given or DEFAULT_MODEL


@dataclass(frozen=True)
class PlanChoice:
    """Options passed to `Model.plan`; None takes the model's value."""

    duration: Annotated[float | None, Option(metavar="S", parser=SECONDS, help="Duration including dwell.")] = None
    samples: Annotated[int | None, Option(metavar="N", help="Number of samples.")] = None
    assembly: AssemblyOption = None


@dataclass(frozen=True)
class FramesChoice:
    """Choice of frames and curvature of all beams; None takes the model's."""

    reference: Annotated[
        str | None,
        Option(metavar="pinned|cantilever|free", help="How frames are fixed to beams. Default: the model's."),
    ] = None
    curvature: Annotated[
        str | None,
        Option(metavar="separate|shared", help="Curvature of beams at lumped inertias. Default: the model's."),
    ] = None


@dataclass(frozen=True)
class FilesChoice:
    """Choice of files and output of one dataset; without a folder no files are written."""

    out: Annotated[
        str | None,
        Option("--out", "--output", metavar="DIR", help="Folder for data, their summary as JSON, figures and report."),
    ] = None
    force: ReplaceOption = False
    drawn: DrawnChoice = field(default_factory=DrawnChoice)
    json: Json = False


@dataclass(frozen=True)
class WorkersChoice:
    """Choice of the workers that compute the runs of a study."""

    engine: Annotated[
        str, Option("--engine", metavar="threads|processes|dask", help="Engine that computes; results are the same.")
    ] = "threads"
    workers: Annotated[
        int | None, Option("--workers", metavar="N", help="Number of workers. Default: one per processor.")
    ] = None
    cluster: Annotated[
        str | None,
        Option(
            "--cluster",
            metavar="ADDRESS",
            help="Address of a Dask scheduler, tcp://host:8786. Default: one on this machine.",
        ),
    ] = None

    @property
    def chosen(self) -> Workers:
        """Workers in the form that studies take; an address of a cluster selects Dask in place of threads."""
        from paraflex.campaign import Workers  # needed when a study is run, not for the help

        engine = "dask" if self.cluster is not None and self.engine == "threads" else self.engine
        return Workers(engine, self.workers, self.cluster)
