"""Arguments and options that several commands have."""

from __future__ import annotations

from typing import Annotated

import typer

Json = Annotated[bool, typer.Option("--json", help="Print JSON instead of tables.")]
PathOption = Annotated[
    str | None,
    typer.Option(
        "--path", metavar="NAME|FILE", help="A path of the model (square, line, circle, ...) or a TOML file with one."
    ),
]
MechanismOption = Annotated[
    str, typer.Option("--mechanism", "-m", metavar="NAME|FILE", help="A library mechanism or a TOML file.")
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
Source = Annotated[str, typer.Argument(metavar="NAME|FILE", help="A library mechanism or a TOML file.")]
ReferenceOption = Annotated[
    str | None,
    typer.Option(metavar="pinned|cantilever|free", help="How frames are fixed to beams. Default: the model's."),
]
CurvatureOption = Annotated[
    str | None,
    typer.Option(metavar="separate|shared", help="Curvature of beams at lumped inertias. Default: the model's."),
]
