"""Requests of commands for studies of many runs."""

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
    """Options common to the commands on study files."""

    study: StudyArgument
    output: OutputOption = None
    allow_outside: OutsideOption = False

    @property
    def folder(self) -> Path:
        """Results folder: the one given, else results/ and the name of the study's file without suffix."""
        return Path("results") / Path(self.study).stem if self.output is None else Path(self.output)


@dataclass(frozen=True, kw_only=True)
class SensitivityRequest(StudyRequest):
    """Options of `paraflex sensitivity`."""

    study: Annotated[str, Argument(metavar="STUDY.toml", help="Study file: runs, and parameters of the derivatives.")]
    at: Annotated[
        list[str],
        Option(
            metavar="NAME=VALUE", help="Value at which derivatives are taken; repeatable. Default: the mechanism's."
        ),
    ] = field(default_factory=list)
    metrics: Annotated[
        list[str], Option(metavar="NAME,...", help="Metrics to differentiate; repeatable. Default: the study's.")
    ] = field(default_factory=list)
    force: ReplaceOption = False
    json: Json = False


@dataclass(frozen=True, kw_only=True)
class SweepRequest(StudyRequest):
    """Options of `paraflex sweep`."""

    study: Annotated[str, Argument(metavar="STUDY.toml", help="Study file: parameters, runs, metrics.")]
    workers: WorkersChoice = field(default_factory=WorkersChoice)
    limit: Annotated[int | None, Option(metavar="N", help="Number of runs this time, rounded up to whole designs.")] = (
        None
    )
    report: ReportOption = True
    json: Json = False


@dataclass(frozen=True, kw_only=True)
class SearchRequest(StudyRequest):
    """Options of the commands that search for a design."""

    workers: WorkersChoice = field(default_factory=WorkersChoice)
    json: Json = False


@dataclass(frozen=True, kw_only=True)
class IndicesRequest(StudyRequest):
    """Options of `paraflex indices`."""

    metrics: Annotated[
        list[str], Option("--metric", metavar="NAME", help="A metric; repeatable. Default: the study's.")
    ] = field(default_factory=list)
    samples: Annotated[
        int | None, Option(metavar="N", help="Base samples, a power of two; (parameters + 2) N designs are run.")
    ] = None
    seed: Annotated[int | None, Option(metavar="N", help="Seed of the samples. Default: the study's.")] = None
    workers: WorkersChoice = field(default_factory=WorkersChoice)
    json: Json = False
