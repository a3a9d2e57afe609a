"""Requests of commands that simulate a mechanism."""

from dataclasses import dataclass, field

from .options import (
    DrawnChoice,
    FramesChoice,
    ModelChoice,
    NamedChoice,
    PlanChoice,
    json_switch,
    method_option,
    path_option,
    replace_switch,
    tolerance_option,
)
from .requests import option, repeatable, switch


@dataclass(frozen=True, kw_only=True)
class RunRequest:
    """Options of `paraflex run`; None stands for the default of the model or the program."""

    model: NamedChoice = field(default_factory=NamedChoice)
    paths: list[str] = repeatable(
        "--path NAME|FILE",
        "A path of the model or a TOML file with one; repeatable: each is run in all modes, into a folder of its name "
        "in --out. Default: the study's.",
    )
    modes: list[str] = repeatable(
        "--mode MODE", "Actuation mode: signs (+-+-) or motor names (tau1,tau5); repeatable. Default: the study's."
    )
    controllers: list[str] = repeatable(
        "--controller NAME",
        "A controller of the model, in addition to planned torques; repeatable; none for no controller. Default: the "
        "study's.",
    )
    tolerance: float | None = tolerance_option()
    tolerance_per: str | None = option(
        "--tolerance-per cycle|run",
        "Time over which errors may accumulate to the tolerance. Default: cycle, or run for a given tolerance.",
    )
    control: str | None = option(
        "--control positions|forces",
        "Errors that control the steps: of positions, or of forces as well, the default of damped beams.",
    )
    plan: PlanChoice = field(default_factory=PlanChoice)
    alpha: float | None = option("--alpha 1/S", "Baumgarte coefficient alpha.", unit="1/s")
    beta: float | None = option("--beta 1/S", "Baumgarte coefficient beta.", unit="1/s")
    max_steps: int | None = option("--max-steps N", "Maximum number of steps of a run. Default: ten million.")
    method: str | None = method_option()
    parameters: list[str] = repeatable("--method-parameter NAME=VALUE", "A parameter of the method; repeatable.")
    step: float | None = option("--step S", "Fixed step. Default: steps controlled by their errors.", unit="s")
    constraints: str | None = option(
        "--constraints baumgarte|projection|ggl", "Treatment of the constraints. Default: the method's."
    )
    automatic_gains: bool = switch("--automatic-gains", "Adapt the Baumgarte coefficients to the step.")
    metrics: list[str] = repeatable(
        "--metric EXPRESSION", 'A number of each complete run: a metric of studies, or "max(abs(A1.rate))"; repeatable.'
    )
    stop_at: list[str] = repeatable(
        "--stop-at EVENT",
        "Event that ends the run: joint:NAME=LOW..HIGH, deflection:BODY=METRES, singular=DISTANCE, "
        "singular:MOTOR,...=DISTANCE; units as in files, ..80 deg; repeatable.",
    )
    rigid: bool = switch("--rigid", "Treat all bodies as rigid.")
    geometry: str | None = option("--geometry second-order|linear", "Shape of the beams. Default: the model's.")
    frames: FramesChoice = field(default_factory=FramesChoice)
    reduced: str | None = option(
        "--reduced N|auto",
        "Keep N flexible coordinates of all bodies together and report the error, or as few as the tolerance allows. "
        "Default: the study's, else all; 0 for all.",
    )
    segments: int | None = option("--segments N", "Cut beams into finite segments, N for the longest (the paper's: 8).")
    servo: bool = switch(
        "--servo", 'Also run each mode with its motors held on the planned motion; the same as --mode "MODE servo".'
    )
    ked: bool = switch("--ked", "Kineto-elastodynamics: active motors held on the rigid motion.")
    balanced: bool = switch(
        "--balanced", "Start balanced, active motors held, or moving as drives prescribe; else undeformed."
    )
    after: str | None = option(
        "--after free|hold", "Active motors after the path: free, or held by brakes. Default: free."
    )
    out: str = option("--out DIR", "Folder for results and figures.", default="results")
    force: bool = replace_switch()
    drawn: DrawnChoice = field(default_factory=DrawnChoice)
    json: bool = json_switch()


@dataclass(frozen=True, kw_only=True)
class VerifyRequest:
    """Options of `paraflex verify`."""

    model: ModelChoice = field(default_factory=ModelChoice)
    path: str | None = path_option()
    modes: list[str] = repeatable("--mode MODE", "Actuation mode; repeatable. Default: the study's with most motors.")
    engines: list[str] = repeatable("--engine exudyn|mujoco", "Another engine to compare with; repeatable.")
    fidelities: list[str] = repeatable(
        "--model NAME", "Fidelity: rigid, ked, linear, second-order, segments; repeatable. Default: all of them."
    )
    tolerance: float | None = option("--tol METRES", "Tolerance of runs with error control.", unit="m")
    method: str | None = method_option()
    segments: int | None = option("--segments N", "Finite segments on the longest beam.")
    frames: FramesChoice = field(default_factory=FramesChoice)
    plan: PlanChoice = field(default_factory=PlanChoice)
    out: str = option("--out DIR", "Folder for numbers and figures.", default="verification")
    force: bool = replace_switch()
    drawn: DrawnChoice = field(default_factory=DrawnChoice)
    json: bool = json_switch()


@dataclass(frozen=True, kw_only=True)
class CompareMethodsRequest:
    """Options of `paraflex compare-methods`."""

    model: ModelChoice = field(default_factory=ModelChoice)
    path: str | None = path_option()
    mode: str | None = option("--mode MODE", "Actuation mode. Default: the study's with most motors.")
    methods: list[str] = repeatable("--method NAME", "Method of integration; repeatable. Default: all of them.")
    tolerances: list[float] = repeatable(
        "--tol METRES", "Tolerance; repeatable. Default: 1e-3, 1e-4, 1e-5, 1e-6.", unit="m"
    )
    steps: list[float] = repeatable(
        "--step S", "Fixed step; repeatable. Without --tol only fixed steps are run.", unit="s"
    )
    limit: float | None = option("--limit S", "Limit on the wall time of a run. Default: 60.", unit="s")
    plan: PlanChoice = field(default_factory=PlanChoice)
    out: str = option("--out DIR", "Folder for numbers and figure.", default="comparison")
    force: bool = replace_switch()
    json: bool = json_switch()


@dataclass(frozen=True, kw_only=True)
class CompareLawsRequest:
    """Options of `paraflex control compare`; None stands for the default of the model or the program."""

    model: ModelChoice = field(default_factory=ModelChoice)
    controllers: list[str] = repeatable(
        "--controller NAME",
        "A controller of the model, or several that act together, a+b; repeatable. Default: each alone. The open loop "
        "is always run, with none as the only law.",
    )
    modes: list[str] = repeatable("--mode --modes MODE", "Actuation mode; repeatable. Default: the study's.")
    paths: list[str] = repeatable(
        "--path NAME|FILE",
        "A path of the model or a TOML file with one; repeatable, with one row per law and path. Default: the study's "
        "first.",
    )
    metrics: list[str] = repeatable(
        "--metric NAME", "A metric, as in studies; repeatable. Default: errors, vibration, settling, torques, energy."
    )
    tolerance: float | None = tolerance_option()
    method: str | None = method_option()
    step: float | None = option("--step S", "Fixed step. Default: the study's, else error control.", unit="s")
    plan: PlanChoice = field(default_factory=PlanChoice)
    workers: int | None = option(
        "--workers N", "Number of parallel runs. Default: one per processor; results are the same."
    )
    out: str = option("--output --out DIR", "Folder for table and figure.", default="laws")
    force: bool = replace_switch()
    json: bool = json_switch()
