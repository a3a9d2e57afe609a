"""Requests of commands that simulate a mechanism."""

from __future__ import annotations

from dataclasses import dataclass, field
from typing import Annotated

from typer import Option

from paraflex.cli.commands.options import (
    METRES,
    PER_SECOND,
    SECONDS,
    DrawnChoice,
    FramesChoice,
    Json,
    MethodOption,
    ModelChoice,
    PathOption,
    PlanChoice,
    ReplaceOption,
    ToleranceOption,
)


@dataclass(frozen=True, kw_only=True)
class RunRequest:
    """Options of `paraflex run`; None stands for the default of the model or the program."""

    model: ModelChoice = field(default_factory=ModelChoice)
    paths: Annotated[
        list[str],
        Option(
            "--path",
            metavar="NAME|FILE",
            help="A path of the model or a TOML file with one; repeatable: each is run in all modes, into a folder of "
            "its name in --out. Default: the study's.",
        ),
    ] = field(default_factory=list)
    modes: Annotated[
        list[str],
        Option(
            "--mode",
            metavar="MODE",
            help="Actuation mode: signs (+-+-) or motor names (tau1,tau5); repeatable. Default: the study's.",
        ),
    ] = field(default_factory=list)
    controllers: Annotated[
        list[str],
        Option(
            "--controller",
            metavar="NAME",
            help="A controller of the model, in addition to planned torques; repeatable; none for no controller. "
            "Default: the study's.",
        ),
    ] = field(default_factory=list)
    tolerance: ToleranceOption = None
    tolerance_per: Annotated[
        str | None,
        Option(
            metavar="cycle|run",
            help="Time over which errors may accumulate to the tolerance. Default: cycle, or run for a given "
            "tolerance.",
        ),
    ] = None
    control: Annotated[
        str | None,
        Option(
            metavar="positions|forces",
            help="Errors that control the steps: of positions, or of forces as well, the default of damped beams.",
        ),
    ] = None
    plan: PlanChoice = field(default_factory=PlanChoice)
    alpha: Annotated[float | None, Option(metavar="1/S", parser=PER_SECOND, help="Baumgarte coefficient alpha.")] = None
    beta: Annotated[float | None, Option(metavar="1/S", parser=PER_SECOND, help="Baumgarte coefficient beta.")] = None
    max_steps: Annotated[
        int | None, Option(metavar="N", help="Maximum number of steps of a run. Default: ten million.")
    ] = None
    method: MethodOption = None
    parameters: Annotated[
        list[str], Option("--method-parameter", metavar="NAME=VALUE", help="A parameter of the method; repeatable.")
    ] = field(default_factory=list)
    step: Annotated[
        float | None,
        Option(metavar="S", parser=SECONDS, help="Fixed step. Default: steps controlled by their errors."),
    ] = None
    constraints: Annotated[
        str | None,
        Option(metavar="baumgarte|projection|ggl", help="Treatment of the constraints. Default: the method's."),
    ] = None
    automatic_gains: Annotated[
        bool, Option("--automatic-gains", help="Adapt the Baumgarte coefficients to the step.")
    ] = False
    stop_at: Annotated[
        list[str],
        Option(
            metavar="EVENT",
            help="Event that ends the run: joint:NAME=LOW..HIGH, deflection:BODY=METRES, singular=DISTANCE, "
            "singular:MOTOR,...=DISTANCE; units as in files, ..80 deg; repeatable.",
        ),
    ] = field(default_factory=list)
    rigid: Annotated[bool, Option("--rigid", help="Treat all bodies as rigid.")] = False
    geometry: Annotated[
        str | None, Option(metavar="second-order|linear", help="Shape of the beams. Default: the model's.")
    ] = None
    frames: FramesChoice = field(default_factory=FramesChoice)
    reduced: Annotated[
        int | None,
        Option(
            metavar="N",
            help="Keep N flexible coordinates of all bodies together, and report the error. Default: the "
            "study's, else all; 0 for all.",
        ),
    ] = None
    segments: Annotated[
        int | None, Option(metavar="N", help="Cut beams into finite segments, N for the longest (the paper's: 8).")
    ] = None
    ked: Annotated[bool, Option("--ked", help="Kineto-elastodynamics: active motors held on the rigid motion.")] = False
    balanced: Annotated[
        bool,
        Option(
            "--balanced", help="Start balanced, active motors held, or moving as drives prescribe; else undeformed."
        ),
    ] = False
    after: Annotated[
        str | None,
        Option(metavar="free|hold", help="Active motors after the path: free, or held by brakes. Default: free."),
    ] = None
    out: Annotated[str, Option(metavar="DIR", help="Folder for results and figures.")] = "results"
    force: ReplaceOption = False
    drawn: DrawnChoice = field(default_factory=DrawnChoice)
    json: Json = False


@dataclass(frozen=True, kw_only=True)
class VerifyRequest:
    """Options of `paraflex verify`."""

    model: ModelChoice = field(default_factory=ModelChoice)
    path: PathOption = None
    modes: Annotated[
        list[str],
        Option("--mode", metavar="MODE", help="Actuation mode; repeatable. Default: the study's with most motors."),
    ] = field(default_factory=list)
    engines: Annotated[
        list[str], Option("--engine", metavar="exudyn|mujoco", help="Another engine to compare with; repeatable.")
    ] = field(default_factory=list)
    fidelities: Annotated[
        list[str],
        Option(
            "--model",
            metavar="NAME",
            help="Fidelity: rigid, ked, linear, second-order, segments; repeatable. Default: all of them.",
        ),
    ] = field(default_factory=list)
    tolerance: Annotated[
        float | None, Option("--tol", metavar="METRES", parser=METRES, help="Tolerance of runs with error control.")
    ] = None
    method: MethodOption = None
    segments: Annotated[int | None, Option(metavar="N", help="Finite segments on the longest beam.")] = None
    frames: FramesChoice = field(default_factory=FramesChoice)
    plan: PlanChoice = field(default_factory=PlanChoice)
    out: Annotated[str, Option(metavar="DIR", help="Folder for numbers and figures.")] = "verification"
    force: ReplaceOption = False
    drawn: DrawnChoice = field(default_factory=DrawnChoice)
    json: Json = False


@dataclass(frozen=True, kw_only=True)
class CompareMethodsRequest:
    """Options of `paraflex compare-methods`."""

    model: ModelChoice = field(default_factory=ModelChoice)
    path: PathOption = None
    mode: Annotated[
        str | None, Option(metavar="MODE", help="Actuation mode. Default: the study's with most motors.")
    ] = None
    methods: Annotated[
        list[str], Option("--method", metavar="NAME", help="Method of integration; repeatable. Default: all of them.")
    ] = field(default_factory=list)
    tolerances: Annotated[
        list[float],
        Option(
            "--tol", metavar="METRES", parser=METRES, help="Tolerance; repeatable. Default: 1e-3, 1e-4, 1e-5, 1e-6."
        ),
    ] = field(default_factory=list)
    steps: Annotated[
        list[float],
        Option(
            "--step",
            metavar="S",
            parser=SECONDS,
            help="Fixed step; repeatable. Without --tol only fixed steps are run.",
        ),
    ] = field(default_factory=list)
    limit: Annotated[
        float | None, Option(metavar="S", parser=SECONDS, help="Limit on the wall time of a run. Default: 60.")
    ] = None
    plan: PlanChoice = field(default_factory=PlanChoice)
    out: Annotated[str, Option(metavar="DIR", help="Folder for numbers and figure.")] = "comparison"
    force: ReplaceOption = False
    json: Json = False
