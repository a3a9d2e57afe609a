"""Requests of commands on models, most of which need no run."""

from __future__ import annotations

from dataclasses import dataclass, field
from typing import Annotated, ClassVar

from typer import Argument, Option

from paraflex.cli.commands.options import (
    SECONDS,
    AssemblyOption,
    FilesChoice,
    Json,
    ModelChoice,
    PathOption,
)


@dataclass(frozen=True)
class LibraryChoice(ModelChoice):
    """Choice of a model, or of the whole library."""

    source: Annotated[
        str | None, Argument(metavar="NAME|FILE", help="A library mechanism or a TOML file. Default: list the library.")
    ] = None


@dataclass(frozen=True, kw_only=True)
class InfoRequest:
    """Options of `paraflex info`."""

    model: LibraryChoice = field(default_factory=LibraryChoice)
    assembly: AssemblyOption = None
    path: PathOption = None
    at: Annotated[
        float | None,
        Option(
            metavar="S", parser=SECONDS, help="Time of the pose, on the path or by prescribed angles, for frequencies."
        ),
    ] = None
    balanced: Annotated[
        bool, Option("--balanced", help="Frequencies about static equilibrium with motors held; else undeformed.")
    ] = False
    json: Json = False


@dataclass(frozen=True, kw_only=True)
class DrawRequest:
    """Options of `paraflex draw`."""

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
    force: Annotated[bool, Option("--force", help="Overwrite an existing file.")] = False


@dataclass(frozen=True, kw_only=True)
class ModesRequest:
    """Options of `paraflex modes`."""

    model: ModelChoice = field(default_factory=ModelChoice)
    path: PathOption = None
    json: Json = False


@dataclass(frozen=True, kw_only=True)
class LinearRequest:
    """Options common to the commands on linear models."""

    model: ModelChoice = field(default_factory=ModelChoice)
    modes: Annotated[
        list[str],
        Option(
            "--mode",
            metavar="MODE|all",
            help="Actuation mode whose motors are inputs; repeatable, or all. Default: the study's with most motors.",
        ),
    ] = field(default_factory=list)
    pose: Annotated[
        str | None,
        Option(
            metavar="NAME|start|X,Y",
            help="Pose at rest: an assembly, the file's [start], or the end-effector's position. "
            "Default: the model's start.",
        ),
    ] = None
    balanced: Annotated[
        bool,
        Option("--balanced", help="Use the static equilibrium near the pose, the mode's motors held; else the pose."),
    ] = False
    at: Annotated[
        float | None,
        Option(
            metavar="S",
            parser=SECONDS,
            help="Time in the planned motion, or in the run of a model without a path or of results.",
        ),
    ] = None
    along: ClassVar[int | None] = None
    path: PathOption = None
    assembly: AssemblyOption = None
    forces: Annotated[
        list[str],
        Option(
            "--force-at", metavar="BODY.POINT", help="Point whose forces along x and y are also inputs; repeatable."
        ),
    ] = field(default_factory=list)
    coordinates: Annotated[
        str,
        Option(
            metavar="motors|task", help="First states: angles of the motors' joints, or the end-effector's position."
        ),
    ] = "motors"
    prescribed: Annotated[
        list[str],
        Option("--prescribed", metavar="NAME", help="Prescribed motion whose acceleration is an input; repeatable."),
    ] = field(default_factory=list)


@dataclass(frozen=True, kw_only=True)
class LineariseRequest(LinearRequest):
    """Options of `paraflex linearise`."""

    along: Annotated[  # type: ignore[misc]
        int | None,
        Option(metavar="N", help="Number of times in the motion at which poles are also computed, as branches."),
    ] = None
    files: FilesChoice = field(default_factory=FilesChoice)


@dataclass(frozen=True, kw_only=True)
class ReduceRequest(LinearRequest):
    """Options of `paraflex reduce`."""

    states: Annotated[
        int | None, Option(metavar="N", help="Number of states of the reduced models. Default: 16, or all if fewer.")
    ] = None
    methods: Annotated[
        list[str],
        Option(
            "--method",
            metavar="NAME",
            help="craig-bampton, rubin, modal or balanced (of damped models); repeatable. Default: first and third.",
        ),
    ] = field(default_factory=list)
    until: Annotated[float, Option(metavar="HZ", help="Highest frequency [Hz].")] = 40.0
    error: Annotated[float, Option(metavar="PART", help="Error that determines the states needed.")] = 0.01
    along: Annotated[  # type: ignore[misc]
        int | None,
        Option(metavar="N", help="Number of poses along the path at which the basis of one pose is also tested."),
    ] = None
    basis: Annotated[
        str | None,
        Option(metavar="NAME|start|X,Y", help="The pose whose basis is used along the path. Default: its first pose."),
    ] = None
    files: FilesChoice = field(default_factory=FilesChoice)


@dataclass(frozen=True, kw_only=True)
class StaticsRequest:
    """Options of `paraflex statics`; those that are not given are taken from [statics] of the model's file."""

    model: ModelChoice = field(default_factory=ModelChoice)
    loads: Annotated[
        list[str],
        Option(
            "--load",
            metavar="NAME=VALUE",
            help='Force or torque at a joint or at a point\'s coordinate: "stage.T.x=10.5 N"; repeatable.',
        ),
    ] = field(default_factory=list)
    torques: Annotated[
        list[str], Option("--torque", metavar="MOTOR=VALUE", help="Torque or force of a motor; repeatable.")
    ] = field(default_factory=list)
    moved: Annotated[
        list[str],
        Option(
            "--move",
            metavar="NAME=VALUE",
            help='Travel of a joint or of a point\'s coordinate from the start: "stage.T.x=10 mm"; repeatable.',
        ),
    ] = field(default_factory=list)
    held: Annotated[
        list[str] | None,
        Option(
            "--hold",
            metavar="NAME|none",
            help="Joint or point's coordinate held fixed; repeatable. Default: joints of motors without --torque.",
        ),
    ] = None
    steps: Annotated[
        int | None, Option(metavar="N", help="Number of equal steps of all loads and travels. Default: 10.")
    ] = None
    stiffness: Annotated[
        list[str] | None,
        Option(
            "--stiffness",
            metavar="NAME",
            help="Coordinate whose stiffness is computed; repeatable. Default: those loaded or moved, "
            "else the end-effector's.",
        ),
    ] = None
    buckling: Annotated[
        int | None, Option(metavar="N", help="Number of buckling factors about every equilibrium. Default: 1.")
    ] = None
    assembly: AssemblyOption = None
    files: FilesChoice = field(default_factory=FilesChoice)


@dataclass(frozen=True)
class MethodsRequest:
    """Options of `paraflex methods`."""

    json: Json = False


@dataclass(frozen=True)
class NewRequest:
    """Options of `paraflex new`."""

    name: Annotated[str, Argument(metavar="NAME", help="Name of the file to write, NAME.toml.")]
    template: Annotated[str, Option("--from", metavar="NAME", help="Library mechanism to start from.")] = "five_bar"


@dataclass(frozen=True)
class SchemaRequest:
    """Request of `paraflex schema`, which has no options."""
