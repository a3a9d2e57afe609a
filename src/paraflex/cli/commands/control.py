"""Requests of commands on control laws."""

from __future__ import annotations

from dataclasses import dataclass, field
from typing import Annotated

from typer import Option

from paraflex.cli.commands.options import (
    SECONDS,
    Json,
    MethodOption,
    ModelChoice,
    PlanChoice,
    ReplaceOption,
    ToleranceOption,
)


@dataclass(frozen=True, kw_only=True)
class CompareLawsRequest:
    """Options of `paraflex control compare`; None stands for the default of the model or the program."""

    model: ModelChoice = field(default_factory=ModelChoice)
    controllers: Annotated[
        list[str],
        Option(
            "--controller",
            metavar="NAME",
            help="A controller of the model, or several that act together, a+b; repeatable. Default: each alone. "
            "The open loop is always run, with none as the only law.",
        ),
    ] = field(default_factory=list)
    modes: Annotated[
        list[str],
        Option("--mode", "--modes", metavar="MODE", help="Actuation mode; repeatable. Default: the study's."),
    ] = field(default_factory=list)
    paths: Annotated[
        list[str],
        Option(
            "--path",
            metavar="NAME|FILE",
            help="A path of the model or a TOML file with one; repeatable, with one row per law and path. Default: "
            "the study's first.",
        ),
    ] = field(default_factory=list)
    metrics: Annotated[
        list[str],
        Option(
            "--metric",
            metavar="NAME",
            help="A metric, as in studies; repeatable. Default: errors, vibration, settling, torques, energy.",
        ),
    ] = field(default_factory=list)
    tolerance: ToleranceOption = None
    method: MethodOption = None
    step: Annotated[
        float | None,
        Option(metavar="S", parser=SECONDS, help="Fixed step. Default: the study's, else error control."),
    ] = None
    plan: PlanChoice = field(default_factory=PlanChoice)
    workers: Annotated[
        int | None,
        Option(metavar="N", help="Number of parallel runs. Default: one per processor; results are the same."),
    ] = None
    out: Annotated[str, Option("--output", "--out", metavar="DIR", help="Folder for table and figure.")] = "laws"
    force: ReplaceOption = False
    json: Json = False
