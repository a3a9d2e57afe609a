"""Requests for studies of many runs."""

from __future__ import annotations

from dataclasses import dataclass, field
from pathlib import Path
from typing import Annotated

from typer import Argument, Option

from paraflex.cli.commands.options import (
    Json,
    OutputOption,
    OutsideOption,
    ReplaceOption,
    ReportOption,
    StudyArgument,
    WorkersChoice,
)


@dataclass(frozen=True, kw_only=True)
class StudyRequest:
    """What requests of study files have in common."""

    study: StudyArgument
    output: OutputOption = None
    allow_outside: OutsideOption = False

    @property
    def folder(self) -> Path:
        """Folder of the results: the one given, else results/ and the name of the study's file."""
        return Path("results") / Path(self.study).stem if self.output is None else Path(self.output)


@dataclass(frozen=True, kw_only=True)
class SensitivityRequest(StudyRequest):
    """What `paraflex sensitivity` is asked for."""

    study: Annotated[str, Argument(metavar="STUDY.toml", help="What is run, and by what it is differentiated.")]
    at: Annotated[
        list[str],
        Option(metavar="NAME=VALUE", help="Where derivatives are taken; repeatable. Default: the mechanism's."),
    ] = field(default_factory=list)
    metrics: Annotated[
        list[str], Option(metavar="NAME,...", help="What is differentiated; repeatable. Default: the study's.")
    ] = field(default_factory=list)
    force: ReplaceOption = False
    json: Json = False


@dataclass(frozen=True, kw_only=True)
class SweepRequest(StudyRequest):
    """What `paraflex sweep` is asked for."""

    study: Annotated[str, Argument(metavar="STUDY.toml", help="What varies, what is run, what is kept.")]
    workers: WorkersChoice = field(default_factory=WorkersChoice)
    limit: Annotated[int | None, Option(metavar="N", help="Runs this time, rounded up to whole designs.")] = None
    report: ReportOption = True
    json: Json = False


@dataclass(frozen=True, kw_only=True)
class SearchRequest(StudyRequest):
    """What a command that looks for a design is asked for."""

    workers: WorkersChoice = field(default_factory=WorkersChoice)
    json: Json = False


@dataclass(frozen=True, kw_only=True)
class IndicesRequest(StudyRequest):
    """What `paraflex indices` is asked for."""

    metrics: Annotated[
        list[str], Option("--metric", metavar="NAME", help="A metric; repeatable. Default: the study's.")
    ] = field(default_factory=list)
    samples: Annotated[
        int | None, Option(metavar="N", help="Base samples, a power of two; (parameters + 2) N designs are run.")
    ] = None
    seed: Annotated[int | None, Option(metavar="N", help="Of the samples. Default: the study's.")] = None
    workers: WorkersChoice = field(default_factory=WorkersChoice)
    json: Json = False
