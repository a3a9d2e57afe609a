"""Arguments and options that several commands have."""

from __future__ import annotations

from typing import Annotated

import typer

from paraflex.errors import InputError

# What a command runs of which no model is named.
DEFAULT_MODEL = "raparm_i"

Json = Annotated[bool, typer.Option("--json", help="Print JSON instead of tables.")]
PathOption = Annotated[
    str | None,
    typer.Option(
        "--path", metavar="NAME|FILE", help="A path of the model (square, line, circle, ...) or a TOML file with one."
    ),
]
ModelArgument = Annotated[
    str | None,
    typer.Argument(metavar="NAME|FILE", help=f"A library mechanism or a TOML file. Default: {DEFAULT_MODEL}."),
]
MechanismOption = Annotated[
    str | None, typer.Option("--mechanism", "-m", metavar="NAME|FILE", help="The same, named by an option.")
]
DurationOption = Annotated[float | None, typer.Option(metavar="S", help="Duration, dwell included.")]
SamplesOption = Annotated[int | None, typer.Option(metavar="N", help="Samples kept.")]
MethodOption = Annotated[
    str | None, typer.Option(metavar="NAME", help="Method of integration: paraflex methods lists them.")
]
AssemblyOption = Annotated[str | None, typer.Option(metavar="NAME", help="Which way the mechanism is put together.")]
StudyArgument = Annotated[
    str, typer.Argument(metavar="STUDY.toml", help="What is free within which bounds, what is run.")
]
OutputOption = Annotated[
    str | None, typer.Option("--output", "--out", metavar="DIR", help="Folder for results. Default: results/STUDY.")
]
EngineOption = Annotated[
    str, typer.Option("--engine", metavar="threads|processes|dask", help="Who computes; results are the same.")
]
WorkersOption = Annotated[
    int | None, typer.Option("--workers", metavar="N", help="How many. Default: one a processor.")
]
ClusterOption = Annotated[
    str | None,
    typer.Option(
        "--cluster", metavar="ADDRESS", help="Of a Dask scheduler, tcp://host:8786. Default: one on this machine."
    ),
]
ReportOption = Annotated[bool, typer.Option("--report/--no-report", help="Write report.html, or leave it out.")]
ReferenceOption = Annotated[
    str | None,
    typer.Option(metavar="pinned|cantilever|free", help="How frames are fixed to beams. Default: the model's."),
]
CurvatureOption = Annotated[
    str | None,
    typer.Option(metavar="separate|shared", help="Curvature of beams at lumped inertias. Default: the model's."),
]


def model_named(argument: str | None, option: str | None) -> str | None:
    """The model that a command line names, by its argument or by --mechanism; None where it names none.

    Raises
    ------
    InputError
        Both name one, and not the same.
    """
    if argument is not None and option is not None and argument != option:
        raise InputError(
            f"two models are named, {argument!r} and --mechanism {option!r}", field="--mechanism",
            remedy="name one of them",
        )  # fmt: skip
    return option if argument is None else argument
