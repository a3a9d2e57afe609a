"""Requests for what can be said without a run."""

from __future__ import annotations

from dataclasses import dataclass, field
from typing import Annotated

from typer import Argument, Option

from paraflex.cli.commands.options import SECONDS, AssemblyOption, Json, ModelChoice, PathOption


@dataclass(frozen=True)
class LibraryChoice(ModelChoice):
    """A model, or all of the library."""

    source: Annotated[
        str | None, Argument(metavar="NAME|FILE", help="A library mechanism or a TOML file; all of the library.")
    ] = None


@dataclass(frozen=True, kw_only=True)
class InfoRequest:
    """What `paraflex info` is asked for."""

    model: LibraryChoice = field(default_factory=LibraryChoice)
    assembly: AssemblyOption = None
    path: PathOption = None
    at: Annotated[
        float | None,
        Option(metavar="S", parser=SECONDS, help="Frequencies where the path, or prescribed angles, lead by then."),
    ] = None
    balanced: Annotated[
        bool, Option("--balanced", help="Frequencies about static equilibrium, motors held; else undeformed.")
    ] = False
    json: Json = False


@dataclass(frozen=True, kw_only=True)
class DrawRequest:
    """What `paraflex draw` is asked for."""

    model: ModelChoice = field(default_factory=ModelChoice)
    assembly: AssemblyOption = None
    path: PathOption = None
    output: Annotated[
        str | None,
        Option("--output", "--out", metavar="FILE", help="FILE.html, .svg, .png or .pdf. Default: a temporary page."),
    ] = None
    theme: Annotated[str, Option(metavar="light|dark", help="Colours.")] = "light"
    open: Annotated[
        bool | None,
        Option("--open/--no-open", help="Show it in a browser, or not. Default: without --output, at a screen."),
    ] = None
    force: Annotated[bool, Option("--force", help="Write over a file that is there.")] = False


@dataclass(frozen=True, kw_only=True)
class ModesRequest:
    """What `paraflex modes` is asked for."""

    model: ModelChoice = field(default_factory=ModelChoice)
    path: PathOption = None
    json: Json = False


@dataclass(frozen=True)
class MethodsRequest:
    """What `paraflex methods` is asked for."""

    json: Json = False


@dataclass(frozen=True)
class NewRequest:
    """What `paraflex new` is asked for."""

    name: Annotated[str, Argument(metavar="NAME", help="Of the file to write, NAME.toml.")]
    template: Annotated[str, Option("--from", metavar="NAME", help="Library mechanism to start from.")] = "five_bar"


@dataclass(frozen=True)
class SchemaRequest:
    """Nothing is asked of `paraflex schema`."""
