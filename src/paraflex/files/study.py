"""Default settings of the runs of a model, from its [study] table."""

from collections.abc import Mapping
from dataclasses import dataclass, replace
from typing import Any, Literal

from paraflex.control.shaping.shapers import Shaper
from paraflex.errors import InputError, renamed, within
from paraflex.integrators import DEFAULT_METHOD, IntegrationOptions, check_times, find_method
from paraflex.mechanism import Mechanism, parse_mode
from paraflex.mechanism.loads import InTime
from paraflex.mechanism.quantities import known, optional
from paraflex.paths import Path


@dataclass(frozen=True)
class StudyDefaults:
    """Default settings of runs and studies of a model.

    Attributes
    ----------
    path : str or None
        Name of one of the model's paths.
    paths : tuple of str
        Names of several paths, in place of `path`. `paraflex run` and studies of many designs use all of them, other
        functions the first.
    modes : tuple of str
        Names of actuation modes; empty for all modes of the mechanism.
    duration : float or None
        Duration including the dwell [s]; None for that of the path.
    samples : int
        Number of output samples.
    assembly : str or None
        Name of the assembly; None for the first one of the mechanism.
    torques : mapping of str to float or TimeProfile
        Motor torques of a run without a path, constant or as profiles [N m].
    orientation : float
        Angle of the end-effector along the path, if it is a task coordinate [rad].
    method : str or None
        Integration method; None for the default.
    tolerance : float or None
        Tolerance of the integration [m]; None for the default.
    tolerance_per, control : str or None
        Options of the error control; see `IntegrationOptions`.
    step : float or None
        Fixed step size [s]; None for steps chosen by the method.
    after : str
        State of the active motors after the path: "free" or "hold".
    reduced : int or None
        Number of flexible coordinates that runs keep, of all bodies together; None or 0 for all.
    error : str
        Time span of the tracking error that ranks modes: the "motion", or the "whole" run.
    controllers : tuple of str
        Names of the model's controllers that act in addition to the torques planned along a path.
    shaper : Shaper or None
        Input shaper of the torques planned along a path; see `shape_torques`.
    """

    path: str | None = optional(None, "the name of a [path.NAME] table")
    paths: tuple[str, ...] = optional(
        (), "several names in place of path: runs and studies of many designs take all, others the first"
    )
    modes: tuple[str, ...] = optional((), "actuation modes by name, signs or motor names")
    duration: float | None = optional(None, "the duration in s, dwell included")
    samples: int = optional(701, "the number of samples kept")
    assembly: str | None = optional(None, "the name of an [assembly.NAME] table")
    torques: Mapping[str, InTime] = optional(
        {}, "torques of motors in N m, without a path: numbers, expressions of the time t, or tables"
    )
    orientation: float = optional(0.0, "the end-effector's angle along the path in rad, where it is a task coordinate")
    method: str | None = optional(None, "the method of integration, by default esdirk5: see paraflex methods")
    tolerance: float | None = optional(
        None, "the tolerance of the integration in m, 4e-5 of the mechanism's size by default"
    )
    tolerance_per: Literal["cycle", "run"] | None = optional(
        None,
        'the time over which errors may accumulate to it: a "cycle" of the motion or the "run"; own methods only',
    )
    control: Literal["positions", "forces"] | None = optional(
        None,
        'the errors that control the steps: "positions", or "forces" as well, the default of damped beams and ESDIRK '
        "methods",
    )
    step: float | None = optional(None, "a fixed step in s, with methods that take one")
    after: Literal["free", "hold"] = optional(
        "free", 'what the active motors do after the path: "free" or "hold", by brakes'
    )
    reduced: int | Literal["auto"] | None = optional(
        None,
        'the number of flexible coordinates kept, all bodies together, or "auto" for as few as the tolerance allows; '
        "all by default, or with 0",
    )
    error: Literal["motion", "whole"] = optional(
        "motion", 'the tracking error that ranks modes: of the "motion", or the "whole" run with dwell'
    )
    controllers: tuple[str, ...] = optional(
        (), "names of active [controller.NAME] tables, in addition to torques planned along a path"
    )
    shaper: Shaper | None = optional(
        None,
        'the input shaper of torques planned along a path, as { type = "zvd", frequencies = ["9 Hz"] }: none by '
        "default",
    )

    @property
    def first_path(self) -> str | None:
        """Name of the path, or of the first of several; None if there is none."""
        return self.path or next(iter(self.paths), None)

    def filled(self, **chosen: Any) -> "StudyDefaults":
        """Return the study with the chosen values replaced; None and empty strings leave a value unchanged."""
        return replace(self, **{name: value for name, value in chosen.items() if value not in (None, "")})

    def integration(self, chosen: Mapping[str, Any] | None = None) -> IntegrationOptions:
        """Return the integration options: those chosen, else those of the study, else the defaults.

        A step size belongs to a method: if another method is chosen, the study's step is ignored. If `tolerance_per` or
        `control` has no effect with the chosen method or step, the study's value is ignored as well.

        Parameters
        ----------
        chosen : mapping, optional
            Options that replace those of the study, by name. `parameters` of the method are written as in files and
            commands.

        Raises
        ------
        InputError
            Incompatible options.
        """
        given = {name: value for name, value in (chosen or {}).items() if value is not None}
        own = {name: getattr(self, name) for name in ("method", "tolerance", "tolerance_per", "control", "step")}
        if given.get("method", self.method) != self.method:
            own["step"] = None
        options = {name: value for name, value in own.items() if value is not None} | given
        method = find_method(options.pop("method", DEFAULT_METHOD), options.pop("parameters", None))
        if given.keys() & {"method", "step"}:
            chosen_steps = IntegrationOptions(method=method, step=options.get("step"))
            applies = {"tolerance_per": chosen_steps.controls_errors, "control": chosen_steps.estimates_forces}
            options = {name: value for name, value in options.items() if name in given or applies.get(name, True)}
        return IntegrationOptions(**options, method=method)


def check_study(mechanism: Mechanism, paths: Mapping[str, Path], study: StudyDefaults) -> None:
    """Check that a study refers to existing paths and members of the mechanism, and that its numbers are valid.

    Raises
    ------
    InputError
        Unknown name, or invalid number or combination of options.
    """
    if study.path is not None:
        known(study.path, paths, "study.path", "path")
        if study.paths:
            raise InputError("is given together with path", field="study.paths", remedy="leave one of them out")
    for name in study.paths:
        known(name, paths, "study.paths", "path")
        if study.paths.count(name) > 1:
            raise InputError("is named twice", field="study.paths", value=name, remedy="name each path once")
    for mode in study.modes:
        with renamed("study.modes"):
            parse_mode(mechanism, mode)
    if study.shaper is not None and not paths:
        raise InputError(
            "is for torques planned along a path, and the model has none", field="study.shaper",
            value=study.shaper.kind.value, remedy="leave it out, or add a [path.NAME] table",
        )  # fmt: skip
    motors = [motor.name for motor in mechanism.motors]
    for name in study.torques:
        known(name, motors, "study.torques", "motor")
    if study.assembly is not None:
        known(study.assembly, [one.name for one in mechanism.assemblies], "study.assembly", "assembly")
    if isinstance(study.reduced, int) and study.reduced < 0:
        raise InputError(
            "no such number of flexible coordinates", field="study.reduced", value=study.reduced,
            remedy='give the number to keep, "auto", or 0 or nothing for all',
        )  # fmt: skip
    with within("study"):
        check_times(study.duration, study.samples)
        study.integration()
