"""What can be said without a run."""

from __future__ import annotations

from typing import Annotated

import typer

from paraflex.cli.commands.options import (
    DEFAULT_MODEL,
    AssemblyOption,
    Json,
    MechanismOption,
    ModelArgument,
    PathOption,
    model_named,
)


def modes(
    source: ModelArgument = None, mechanism: MechanismOption = None, path: PathOption = None, json: Json = False
) -> None:
    """List the actuation modes and how well each can drive the path."""
    from paraflex.cli.modes import modes_command

    modes_command(model_named(source, mechanism) or DEFAULT_MODEL, path, json)


def methods(json: Json = False) -> None:
    """List the methods of integration, what each takes and what keeps the constraints."""
    from paraflex.cli.methods import methods_command

    methods_command(json)


def info(
    source: Annotated[
        str | None, typer.Argument(metavar="NAME|FILE", help="A library mechanism or a TOML file; all of the library.")
    ] = None,
    mechanism: MechanismOption = None,
    assembly: AssemblyOption = None,
    path: PathOption = None,
    at: Annotated[
        float | None, typer.Option(metavar="S", help="Frequencies where the path, or prescribed angles, lead by then.")
    ] = None,
    balanced: Annotated[
        bool, typer.Option("--balanced", help="Frequencies about static equilibrium, motors held; else undeformed.")
    ] = False,
    json: Json = False,
) -> None:
    """Describe a mechanism and its study, and judge them: sound, doubtful or wrong, each reason with its remedy.

    Exit code 1 where it is wrong. Without a name: what the library has.
    """
    from paraflex.cli.inspect import InfoRequest, info_command

    raise typer.Exit(info_command(InfoRequest(model_named(source, mechanism), assembly, path, at, balanced, json)))


def new(
    name: Annotated[str, typer.Argument(metavar="NAME", help="Of the file to write, NAME.toml.")],
    template: Annotated[
        str, typer.Option("--from", metavar="NAME", help="Library mechanism to start from.")
    ] = "five_bar",
) -> None:
    """Write a commented model file to edit."""
    from paraflex.cli.create import new_command

    new_command(name, template)


def schema() -> None:
    """Print the JSON Schema of model files, for editors to complete and check them."""
    from paraflex.cli.create import schema_command

    schema_command()
