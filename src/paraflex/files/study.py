"""The study that a model proposes: what a run of it does unless asked otherwise."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field, replace
from typing import Any

from paraflex.control.shaping import Shaper
from paraflex.errors import InputError, renamed, within
from paraflex.integrators import DEFAULT_METHOD, IntegrationOptions, check_times, find_method
from paraflex.kinematics import Path
from paraflex.mechanism import Mechanism, parse_mode
from paraflex.mechanism.loads import InTime
from paraflex.mechanism.quantities import known


@dataclass(frozen=True)
class StudyDefaults:
    """What a study of the model does unless asked otherwise.

    Attributes
    ----------
    path : str or None
        The name of one of the model's paths.
    paths : tuple of str
        In its place names of several: `paraflex run` and studies of many designs take all, what takes one the first.
    modes : tuple of str
    duration : float or None
        [s]; the path's own where None.
    samples : int
    assembly : str or None
        The first of the mechanism where None.
    torques : mapping of str to float or AngleLaw
        Motor torques of a run without a path, constant or in time [N m].
    orientation : float
        Angle of the end-effector along the path, where it is a task coordinate [rad].
    method : str or None
        Of integration; the program's own where None.
    tolerance : float or None
        Of the integration [m].
    tolerance_per, control : str or None
        Of the integration: see `IntegrationOptions`.
    step : float or None
        Fixed [s].
    after : str
        What the active motors do after the path: "free" or "hold".
    reduced : int or None
        Flexible coordinates that runs keep of all bodies together; all where None or 0.
    error : str
        Which tracking error ranks modes: that of the "motion", or of the "whole" run.
    controllers : tuple of str
        Names of the model's controllers that act, beside the torques planned along a path.
    shaper : Shaper or None
        Of the torques planned along a path: see `shape_torques`.
    """

    path: str | None = None
    paths: tuple[str, ...] = ()
    modes: tuple[str, ...] = ()
    duration: float | None = None
    samples: int = 701
    assembly: str | None = None
    torques: Mapping[str, InTime] = field(default_factory=dict)
    orientation: float = 0.0
    method: str | None = None
    tolerance: float | None = None
    tolerance_per: str | None = None
    control: str | None = None
    step: float | None = None
    after: str = "free"
    reduced: int | None = None
    error: str = "motion"
    controllers: tuple[str, ...] = ()
    shaper: Shaper | None = None

    @property
    def first_path(self) -> str | None:
        """The name of its path, or of the first of several; None where it names none."""
        return self.path or next(iter(self.paths), None)

    def filled(self, **chosen: Any) -> StudyDefaults:
        """The study with what a caller chooses of it; what is None stays as the study says."""
        return replace(self, **{name: value for name, value in chosen.items() if value not in (None, "")})

    def integration(self, chosen: Mapping[str, Any] | None = None) -> IntegrationOptions:
        """How runs are integrated: as a caller chooses, then as the study says, else as `IntegrationOptions` has it.

        A step goes with a method: where another method is chosen the study's step is left out, and where the method or
        the step chosen leaves `tolerance_per` or `control` without effect the study's as well. `parameters` of the
        method are in the words of files and commands.

        Raises
        ------
        InputError
            Options that do not go together.
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
    """Check that a study names what the mechanism and its paths have, and that its numbers can be."""
    if study.path is not None:
        known(study.path, paths, "study.path", "path")
        if study.paths:
            raise InputError("stands beside path", field="study.paths", remedy="leave one of them out")
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
    if study.reduced is not None and study.reduced < 0:
        raise InputError(
            "no such number of flexible coordinates", field="study.reduced", value=study.reduced,
            remedy="say how many to keep, 0 or nothing for all",
        )  # fmt: skip
    with within("study"):
        check_times(study.duration, study.samples)
        study.integration()
