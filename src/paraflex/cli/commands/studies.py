"""Studies of many runs."""

from __future__ import annotations

from typing import Annotated

import typer

from paraflex.cli.commands.options import (
    ClusterOption,
    EngineOption,
    Json,
    OutputOption,
    ReportOption,
    StudyArgument,
    WorkersOption,
)


def sensitivity(
    study: Annotated[str, typer.Argument(metavar="STUDY.toml", help="What is run, and by what it is differentiated.")],
    output: OutputOption = None,
    at: Annotated[
        list[str] | None,
        typer.Option(metavar="NAME=VALUE", help="Where derivatives are taken; repeatable. Default: the mechanism's."),
    ] = None,
    metrics: Annotated[
        list[str] | None,
        typer.Option(metavar="NAME,...", help="What is differentiated; repeatable. Default: the study's."),
    ] = None,
    json: Json = False,
) -> None:
    """Differentiate what runs are judged by; write sensitivity.json, a table and figures/."""
    from paraflex.cli.sensitivity import SensitivityRequest, sensitivity_command

    raise typer.Exit(sensitivity_command(SensitivityRequest(study, output, at or [], metrics or [], json)))


def sweep(
    study: Annotated[str, typer.Argument(metavar="STUDY.toml", help="What varies, what is run, what is kept.")],
    output: OutputOption = None,
    engine: EngineOption = "threads",
    workers: WorkersOption = None,
    cluster: ClusterOption = None,
    limit: Annotated[int | None, typer.Option(metavar="N", help="Runs this time, rounded up to whole designs.")] = None,
    report: ReportOption = True,
    json: Json = False,
) -> None:
    """Run a mechanism thousands of times with other numbers; the same command goes on where it was stopped.

    Writes report.html, results.parquet and summary.json, and trajectories/ where the study says so.
    """
    from paraflex.cli.sweep import SweepRequest, sweep_command

    raise typer.Exit(
        sweep_command(SweepRequest(study, output, _engine(engine, cluster), workers, cluster, limit, report, json))
    )


def optimise(
    study: StudyArgument,
    output: OutputOption = None,
    engine: EngineOption = "threads",
    workers: WorkersOption = None,
    cluster: ClusterOption = None,
    json: Json = False,
) -> None:
    """Look for the design whose metrics are least; the same command goes on where it was stopped.

    Writes result.json, best.toml, results.parquet and figures/.
    """
    from paraflex.cli.optimise import optimise_command
    from paraflex.cli.search import SearchRequest

    request = SearchRequest(study, output, _engine(engine, cluster), workers, cluster, json)
    raise typer.Exit(optimise_command(request))


def identify(
    study: StudyArgument,
    output: OutputOption = None,
    engine: EngineOption = "threads",
    workers: WorkersOption = None,
    cluster: ClusterOption = None,
    json: Json = False,
) -> None:
    """Look for the parameters that reproduce given metrics; the same command goes on where it was stopped.

    Writes result.json, best.toml, results.parquet and figures/.
    """
    from paraflex.cli.identify import identify_command
    from paraflex.cli.search import SearchRequest

    request = SearchRequest(study, output, _engine(engine, cluster), workers, cluster, json)
    raise typer.Exit(identify_command(request))


def indices(
    study: StudyArgument,
    metric: Annotated[
        list[str] | None, typer.Option(metavar="NAME", help="A metric; repeatable. Default: the study's.")
    ] = None,
    samples: Annotated[
        int | None, typer.Option(metavar="N", help="Base samples, a power of two; (parameters + 2) N designs are run.")
    ] = None,
    seed: Annotated[int | None, typer.Option(metavar="N", help="Of the samples. Default: the study's.")] = None,
    output: OutputOption = None,
    engine: EngineOption = "threads",
    workers: WorkersOption = None,
    cluster: ClusterOption = None,
    json: Json = False,
) -> None:
    """Tell which parameters metrics depend on: first-order and total Sobol indices over their ranges.

    Writes indices.json, indices.parquet, results.parquet and figures/.
    """
    from paraflex.cli.indices import IndicesRequest, indices_command

    chosen = _engine(engine, cluster)
    request = IndicesRequest(study, output, metric or [], samples, seed, chosen, workers, cluster, json)
    raise typer.Exit(indices_command(request))


def _engine(name: str, cluster: str | None) -> str:
    """The engine asked for; a cluster is Dask's."""
    return "dask" if cluster is not None and name == "threads" else name
