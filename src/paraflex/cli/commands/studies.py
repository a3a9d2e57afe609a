"""Requests of commands for studies of many runs."""

from dataclasses import dataclass, field
from pathlib import Path

from .options import WorkersChoice, json_switch, outside_switch, replace_switch, report_switch, units_option
from .requests import argument, option, repeatable


@dataclass(frozen=True, kw_only=True)
class StudyRequest:
    """Options common to the commands on study files."""

    study: str = argument("STUDY.toml", "Study file: free parameters, their bounds, runs.")
    output: str | None = option("--output --out DIR", "Folder for results. Default: results/STUDY.")
    allow_outside: bool = outside_switch()
    units: str | None = units_option()

    @property
    def folder(self) -> Path:
        """Results folder: the one given, else results/ and the name of the study's file without suffix."""
        return Path("results") / Path(self.study).stem if self.output is None else Path(self.output)


@dataclass(frozen=True, kw_only=True)
class SensitivityRequest(StudyRequest):
    """Options of `paraflex sensitivity`."""

    study: str = argument("STUDY.toml", "Study file: runs, and parameters of the derivatives.")
    at: list[str] = repeatable(
        "--at NAME=VALUE", "Value at which derivatives are taken; repeatable. Default: the mechanism's."
    )
    metrics: list[str] = repeatable("--metrics NAME,...", "Metrics to differentiate; repeatable. Default: the study's.")
    force: bool = replace_switch()
    json: bool = json_switch()


@dataclass(frozen=True, kw_only=True)
class SweepRequest(StudyRequest):
    """Options of `paraflex sweep`."""

    study: str = argument("STUDY.toml", "Study file: parameters, runs, metrics.")
    workers: WorkersChoice = field(default_factory=WorkersChoice)
    limit: int | None = option("--limit N", "Number of runs this time, rounded up to whole designs.")
    shard: str | None = option(
        "--shard I/N", "Part I of N of the runs, in a folder of its own, for arrays of batch jobs; without it the same "
        "command joins the parts."
    )  # fmt: skip
    report: bool = report_switch()
    json: bool = json_switch()


@dataclass(frozen=True, kw_only=True)
class SearchRequest(StudyRequest):
    """Options of the commands that search for a design."""

    workers: WorkersChoice = field(default_factory=WorkersChoice)
    json: bool = json_switch()


@dataclass(frozen=True, kw_only=True)
class IndicesRequest(StudyRequest):
    """Options of `paraflex indices`."""

    metrics: list[str] = repeatable("--metric NAME", "A metric; repeatable. Default: the study's.")
    samples: int | None = option("--samples N", "Base samples, a power of two; (parameters + 2) N designs are run.")
    seed: int | None = option("--seed N", "Seed of the samples. Default: the study's.")
    workers: WorkersChoice = field(default_factory=WorkersChoice)
    json: bool = json_switch()
