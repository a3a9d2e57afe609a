"""The `paraflex` command."""

from __future__ import annotations

import sys
from typing import Annotated

import typer

from paraflex.errors import InputError, ParaflexError

app = typer.Typer(
    name="paraflex",
    help="Rigid-flexible dynamics of planar mechanisms with closed loops and several actuation modes.",
    no_args_is_help=True,
    pretty_exceptions_enable=False,
    rich_markup_mode=None,
)

BAD_INPUT, TROUBLE, INTERRUPTED = 2, 1, 130

Json = Annotated[bool, typer.Option("--json", help="Print JSON instead of tables.")]
PathOption = Annotated[
    str | None,
    typer.Option(
        "--path", metavar="NAME|FILE", help="A path of the model (square, line, circle, ...) or a TOML file with one."
    ),
]
Source = Annotated[str, typer.Argument(metavar="NAME|FILE", help="A library mechanism or a TOML file.")]


def _show_version(wanted: bool) -> None:
    if wanted:
        from importlib.metadata import version

        typer.echo(version("paraflex"))
        raise typer.Exit


@app.callback()
def _options(
    version: Annotated[
        bool, typer.Option("--version", callback=_show_version, is_eager=True, help="Show the version and exit.")
    ] = False,
) -> None:
    pass


@app.command()
def run(
    mechanism: Annotated[
        str, typer.Option("--mechanism", "-m", metavar="NAME|FILE", help="A library mechanism or a TOML file.")
    ] = "raparm_i",
    path: PathOption = None,
    mode: Annotated[
        list[str] | None,
        typer.Option(
            metavar="MODE",
            help="Actuation mode: signs (+-+-) or motor names (tau1,tau5); repeatable. Default: the study's.",
        ),
    ] = None,
    tol: Annotated[float | None, typer.Option(metavar="METRES", help="Tolerance of the integration.")] = None,
    duration: Annotated[float | None, typer.Option(metavar="S", help="Duration, dwell included.")] = None,
    samples: Annotated[int | None, typer.Option(metavar="N", help="Samples kept.")] = None,
    assembly: Annotated[
        str | None, typer.Option(metavar="NAME", help="Which way the mechanism is put together.")
    ] = None,
    alpha: Annotated[float | None, typer.Option(metavar="1/S", help="Baumgarte coefficient alpha.")] = None,
    beta: Annotated[float | None, typer.Option(metavar="1/S", help="Baumgarte coefficient beta.")] = None,
    max_steps: Annotated[int | None, typer.Option(metavar="N", help="Steps before a run is given up.")] = None,
    rigid: Annotated[bool, typer.Option("--rigid", help="Take all bodies as rigid.")] = False,
    geometry: Annotated[
        str | None, typer.Option(metavar="linear|second-order", help="Shape of the beams. Default: the model's.")
    ] = None,
    out: Annotated[str, typer.Option(metavar="DIR", help="Folder for results and figures.")] = "results",
    json: Json = False,
) -> None:
    """Simulate a path in several actuation modes; write summary.json, results.nc and figures/."""
    from paraflex.cli.run import RunRequest, run_command

    request = RunRequest(
        mechanism,
        path,
        mode or [],
        tol,
        duration,
        samples,
        assembly,
        alpha,
        beta,
        max_steps,
        rigid,
        geometry,
        out,
        json,
    )
    raise typer.Exit(run_command(request))


@app.command()
def modes(source: Source = "raparm_i", path: PathOption = None, json: Json = False) -> None:
    """List the actuation modes and how well each can drive the path."""
    from paraflex.cli.inspect import modes_command

    modes_command(source, path, json)


@app.command()
def info(source: Source = "raparm_i", json: Json = False) -> None:
    """Describe a mechanism: bodies, coordinates, constraints, degrees of freedom, frequencies, mass."""
    from paraflex.cli.inspect import info_command

    info_command(source, json)


def main() -> None:
    """Run the command line; every error that is ours becomes one line."""
    try:
        app()
    except InputError as error:
        _complain(error)
        sys.exit(BAD_INPUT)
    except ParaflexError as error:
        _complain(error)
        sys.exit(TROUBLE)
    except KeyboardInterrupt:
        typer.echo("interrupted", err=True)
        sys.exit(INTERRUPTED)


def _complain(error: Exception) -> None:
    typer.echo(f"error: {error}", err=True)
