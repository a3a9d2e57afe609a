"""Arguments and options common to several commands."""

from __future__ import annotations

from dataclasses import dataclass, field
from functools import partial
from typing import TYPE_CHECKING

from paraflex.errors import InputError
from .requests import FieldMaker, argument, option, repeatable, switch

if TYPE_CHECKING:
    from paraflex.campaign import Workers

# Model of a command for which none is named.
DEFAULT_MODEL = "raparm_i"

# Functions that return the field of a request.
json_switch: FieldMaker = partial(switch, "--json", "Print JSON instead of tables.")
path_option: FieldMaker = partial(
    option, "--path NAME|FILE", "A path of the model (square, line, circle, ...) or a TOML file with one."
)
tolerance_option: FieldMaker = partial(
    option, "--tol METRES", "Tolerance. Default: the study's, else 4e-5 of the size.", unit="m"
)
method_option: FieldMaker = partial(option, "--method NAME", "Method of integration: paraflex methods lists them.")
assembly_option: FieldMaker = partial(option, "--assembly NAME", "Assembly (configuration) of the mechanism.")
replace_switch: FieldMaker = partial(switch, "--force", "Replace results of another kind that the folder holds.")
report_switch: FieldMaker = partial(switch, "--report/--no-report", "Write report.html, or leave it out.", default=True)
units_option: FieldMaker = partial(option, "--units UNIT,...", 'Units of tables, figures and CSV files, "deg,mm,kN".')
outside_switch: FieldMaker = partial(switch, "--allow-outside", "Read tables outside the model's folder that it names.")


@dataclass(frozen=True)
class DrawnChoice:
    """Choice of figures and report of results."""

    figures: bool = switch("--figures/--no-figures", "Draw figures, or leave them out.", default=True)
    report: bool = report_switch()


@dataclass(frozen=True)
class ModelChoice:
    """Choice of a model by an argument or by --mechanism.

    Raises
    ------
    InputError
        Argument and option name different models.
    """

    source: str | None = argument(
        "NAME|FILE", f"A library mechanism or a TOML file. Default: {DEFAULT_MODEL}.", default=None
    )
    mechanism: str | None = option("--mechanism -m NAME|FILE", "The same, given as an option.")
    settings: list[str] = repeatable(
        "--set FIELD=VALUE", 'Value in place of the file\'s, "link1.length=80 mm"; repeatable.'
    )
    allow_outside: bool = outside_switch()
    units: str | None = units_option()

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
class NamedChoice(ModelChoice):
    """Choice of a model; there is no default."""

    source: str | None = argument(
        "NAME|FILE", "A library mechanism or a TOML file. Without one: list what can be run.", default=None
    )


@dataclass(frozen=True)
class PlanChoice:
    """Options passed to `Model.plan`; None takes the model's value."""

    duration: float | None = option("--duration S", "Duration including dwell.", unit="s")
    samples: int | None = option("--samples N", "Number of samples.")
    assembly: str | None = assembly_option()


@dataclass(frozen=True)
class FramesChoice:
    """Choice of frames and curvature of all beams; None takes the model's."""

    reference: str | None = option(
        "--reference pinned|cantilever|free", "How frames are fixed to beams. Default: the model's."
    )
    curvature: str | None = option(
        "--curvature separate|shared", "Curvature of beams at lumped inertias. Default: the model's."
    )


@dataclass(frozen=True)
class FilesChoice:
    """Choice of files and output of one dataset; without a folder no files are written."""

    out: str | None = option("--out --output DIR", "Folder for data, their summary as JSON, figures and report.")
    force: bool = replace_switch()
    drawn: DrawnChoice = field(default_factory=DrawnChoice)
    json: bool = json_switch()


@dataclass(frozen=True)
class WorkersChoice:
    """Choice of the workers that compute the runs of a study."""

    engine: str | None = option(
        "--engine threads|processes|dask",
        "Engine that computes; results are the same. Default: threads, or dask with --cluster.",
    )
    workers: int | None = option("--workers N", "Number of workers. Default: one per processor.")
    cluster: str | None = option(
        "--cluster ADDRESS", "Address of a Dask scheduler, tcp://host:8786. Default: one on this machine."
    )

    @property
    def chosen(self) -> Workers:
        """Workers in the form that studies take."""
        from paraflex.campaign import Workers  # needed when a study is run, not for the help

        engine = "threads" if self.cluster is None else "dask"
        return Workers(self.engine or engine, self.workers, self.cluster)
