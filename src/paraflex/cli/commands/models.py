"""Requests of commands on models, most of which need no run."""

from dataclasses import dataclass, field
from typing import ClassVar

from .options import FilesChoice, ModelChoice, NamedChoice, assembly_option, json_switch, path_option
from .requests import argument, option, repeatable, switch


@dataclass(frozen=True)
class LibraryChoice(ModelChoice):
    """Choice of a model, or of the whole library."""

    source: str | None = argument(
        "NAME|FILE", "A library mechanism or a TOML file. Default: list the library.", default=None
    )


@dataclass(frozen=True, kw_only=True)
class InfoRequest:
    """Options of `paraflex info`."""

    model: LibraryChoice = field(default_factory=LibraryChoice)
    assembly: str | None = assembly_option()
    path: str | None = path_option()
    at: float | None = option(
        "--at S", "Time of the pose, on the path or by prescribed angles, for frequencies.", unit="s"
    )
    balanced: bool = switch("--balanced", "Frequencies about static equilibrium with motors held; else undeformed.")
    json: bool = json_switch()


@dataclass(frozen=True, kw_only=True)
class DrawRequest:
    """Options of `paraflex draw`."""

    model: ModelChoice = field(default_factory=ModelChoice)
    assembly: str | None = assembly_option()
    path: str | None = path_option()
    output: str | None = option("--output --out FILE", "FILE.html, .svg, .png or .pdf. Default: a temporary page.")
    theme: str = option("--theme light|dark", "Colours.", default="light")
    open: bool | None = switch(
        "--open/--no-open", "Show it in a browser, or not. Default: without --output, at a screen.", default=None
    )
    watch: bool = switch("--watch", "Draw on a page again whenever the file is saved; sliders for its [parameters].")
    force: bool = switch("--force", "Overwrite an existing file.")


@dataclass(frozen=True, kw_only=True)
class EditRequest:
    """Options of `paraflex edit`."""

    source: str | None = argument(
        "NAME|FILE", "A library mechanism or a TOML file, which need not exist. Default: an empty sheet.", default=None
    )
    open: bool = switch("--open/--no-open", "Open the page in the browser, or print its address only.", default=True)


@dataclass(frozen=True, kw_only=True)
class ModesRequest:
    """Options of `paraflex modes`."""

    model: ModelChoice = field(default_factory=ModelChoice)
    path: str | None = path_option()
    json: bool = json_switch()


@dataclass(frozen=True, kw_only=True)
class LinearRequest:
    """Options common to the commands on linear models."""

    model: ModelChoice = field(default_factory=ModelChoice)
    modes: list[str] = repeatable(
        "--mode MODE|all",
        "Actuation mode whose motors are inputs; repeatable, or all. Default: the study's with most motors.",
    )
    pose: str | None = option(
        "--pose NAME|start|X,Y",
        "Pose at rest: an assembly, the file's [start], or the end-effector's position. Default: the model's start.",
    )
    balanced: bool = switch(
        "--balanced", "Use the static equilibrium near the pose, the mode's motors held; else the pose."
    )
    at: float | None = option(
        "--at S", "Time in the planned motion, or in the run of a model without a path or of results.", unit="s"
    )
    along: ClassVar[int | None] = None
    path: str | None = path_option()
    assembly: str | None = assembly_option()
    forces: list[str] = repeatable(
        "--force-at BODY.POINT", "Point whose forces along x and y are also inputs; repeatable."
    )
    coordinates: str = option(
        "--coordinates motors|task",
        "First states: angles of the motors' joints, or the end-effector's position.",
        default="motors",
    )
    prescribed: list[str] = repeatable(
        "--prescribed NAME", "Prescribed motion whose acceleration is an input; repeatable."
    )


@dataclass(frozen=True, kw_only=True)
class LineariseRequest(LinearRequest):
    """Options of `paraflex linearise`."""

    along: int | None = option(  # type: ignore[misc]
        "--along N", "Number of times in the motion at which poles are also computed, as branches."
    )
    files: FilesChoice = field(default_factory=FilesChoice)


@dataclass(frozen=True, kw_only=True)
class ReduceRequest(LinearRequest):
    """Options of `paraflex reduce`."""

    states: int | None = option("--states N", "Number of states of the reduced models. Default: 16, or all if fewer.")
    methods: list[str] = repeatable(
        "--method NAME",
        "craig-bampton, rubin, modal or balanced (of damped models); repeatable. Default: first and third.",
    )
    until: float = option("--until HZ", "Highest frequency [Hz].", default=40.0)
    error: float = option("--error PART", "Error that determines the states needed.", default=0.01)
    along: int | None = option(  # type: ignore[misc]
        "--along N", "Number of poses along the path at which the basis of one pose is also tested."
    )
    basis: str | None = option(
        "--basis NAME|start|X,Y", "The pose whose basis is used along the path. Default: its first pose."
    )
    files: FilesChoice = field(default_factory=FilesChoice)


@dataclass(frozen=True, kw_only=True)
class StaticsRequest:
    """Options of `paraflex statics`; those that are not given are taken from [statics] of the model's file."""

    model: ModelChoice = field(default_factory=ModelChoice)
    loads: list[str] = repeatable(
        "--load NAME=VALUE", 'Force or torque at a joint or at a point\'s coordinate: "stage.T.x=10.5 N"; repeatable.'
    )
    torques: list[str] = repeatable("--torque MOTOR=VALUE", "Torque or force of a motor; repeatable.")
    moved: list[str] = repeatable(
        "--move NAME=VALUE",
        'Travel of a joint or of a point\'s coordinate from the start: "stage.T.x=10 mm"; repeatable.',
    )
    held: list[str] | None = option(
        "--hold NAME|none",
        "Joint or point's coordinate held fixed; repeatable. Default: joints of motors without --torque.",
    )
    steps: int | None = option("--steps N", "Number of equal steps of all loads and travels. Default: 10.")
    stiffness: list[str] | None = option(
        "--stiffness NAME",
        "Coordinate whose stiffness is computed; repeatable. Default: those loaded or moved, else the end-effector's.",
    )
    buckling: int | None = option("--buckling N", "Number of buckling factors about every equilibrium. Default: 1.")
    metrics: list[str] = repeatable(
        "--metric EXPRESSION", 'A number of all steps: a metric of studies, or "max(abs(stage.T.y))"; repeatable.'
    )
    assembly: str | None = assembly_option()
    files: FilesChoice = field(default_factory=FilesChoice)


@dataclass(frozen=True, kw_only=True)
class KinematicsRequest:
    """Options of `paraflex kinematics`."""

    model: NamedChoice = field(default_factory=NamedChoice)
    drive: list[str] = repeatable(
        "--drive JOINT[=VALUE]",
        "Joint that moves at constant speed, or one held at a value, or that moves meanwhile, JOINT=FIRST:LAST; "
        "repeatable. Default: the prescribed motions, the path, or the only motor's joint.",
    )
    path: str | None = path_option()
    start: str | None = option(
        "--from VALUE", 'First angle or travel of the drive: "-30 deg". Default: the assembly\'s.'
    )
    end: str | None = option(
        "--to VALUE", "Last angle or travel of the drive. Default: after a whole turn, else between limits of reach."
    )
    speed: str | None = option(
        "--speed VALUE", 'Speed of the drive: "60 rpm". Default: that of its prescribed motion, else 1 rad/s or m/s.'
    )
    duration: float | None = option(
        "--duration S",
        "Duration, of the drive in place of --to. Default: the study's, or the path's.",
        unit="s",
    )
    samples: int = option("--samples N", "Number of positions.", default=361)
    assembly: str | None = assembly_option()
    assemblies: bool = switch("--assemblies", "Search for all assemblies with the drive at its start.")
    files: FilesChoice = field(default_factory=FilesChoice)


@dataclass(frozen=True, kw_only=True)
class TorquesRequest(KinematicsRequest):
    """Options of `paraflex torques`."""

    mode: str | None = option("--mode MODE", "Actuation mode along a path. Default: the study's first.")
    fluctuation: float | None = option(
        "--fluctuation RATIO", "Range of the speed over its mean for which a flywheel is computed, such as 0.02."
    )


@dataclass(frozen=True)
class MethodsRequest:
    """Options of `paraflex methods`."""

    json: bool = json_switch()


@dataclass(frozen=True)
class NewRequest:
    """Options of `paraflex new`."""

    name: str = argument("NAME", "Name of the file to write, NAME.toml.")
    template: str = option("--from NAME", "Library mechanism to start from.", default="five_bar")


@dataclass(frozen=True)
class SchemaRequest:
    """Request of `paraflex schema`, which has no options."""
