"""Designs without a path, ready to run: the mechanism moves under loads, prescribed motions and given torques."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass

from paraflex.control import ControllerDescription, simulate_controlled_motion
from paraflex.dynamics import State, build_system
from paraflex.errors import InputError
from paraflex.files import Model
from paraflex.integrators import IntegrationOptions
from paraflex.mechanism import Mechanism
from paraflex.mechanism.loads import InTime
from paraflex.motion import MotionRun, simulate_motion, state_at


@dataclass(frozen=True)
class OwnMotion:
    """Run of a model without a path, as by `paraflex run`.

    Attributes
    ----------
    mechanism : Mechanism
        Mechanism to simulate.
    start : State
        Initial state.
    duration : float
        Duration [s].
    samples : int
        Number of samples.
    torques : mapping of str to float or TimeProfile
        Torque [N m] or force [N] of each motor by name, constant or over time.
    controllers : sequence of ControllerDescription
        Sampled controllers, which replace the torques; none by default.
    """

    mechanism: Mechanism
    start: State
    duration: float
    samples: int
    torques: Mapping[str, InTime]
    controllers: Sequence[ControllerDescription] = ()

    def simulate(self, options: IntegrationOptions, watch: Callable[[float], None] | None) -> MotionRun:
        """Integrate the motion; `watch` is called with the time reached [s]."""
        if self.controllers:
            return simulate_controlled_motion(
                self.mechanism, self.duration, self.controllers, samples=self.samples, start=self.start,
                options=options, on_progress=watch,
            )  # fmt: skip
        return simulate_motion(
            self.mechanism, self.duration, samples=self.samples, torques=self.torques, start=self.start,
            options=options, on_progress=watch, warning=False,
        )  # fmt: skip


def own_motion(
    model: Model, duration: float | None, samples: int | None, assembly: str | None, *, balanced: bool
) -> OwnMotion:
    """Return the run of a model without a path.

    Parameters
    ----------
    model : Model
        Model as read.
    duration : float or None
        Duration [s]; None for that of the [study] table.
    samples : int or None
        Number of samples; None for that of the [study] table.
    assembly : str or None
        Name of the assembly; None for that of the [study] table.
    balanced : bool
        Whether the run starts in the deflections of steady running.

    Raises
    ------
    InputError
        There is no duration; see also `motion.state_at`.
    AssemblyError
        The loops do not close.
    """
    study = model.study.filled(duration=duration, samples=samples, assembly=assembly)
    start = state_at(build_system(model.mechanism), model.start, study.assembly, balanced=balanced)
    return OwnMotion(
        model.mechanism, start, own_duration(model, duration), study.samples, study.torques, model.acting()
    )


def own_duration(model: Model, duration: float | None) -> float:
    """Return the duration [s] of a model without a path: the given one, else that of its [study] table.

    Raises
    ------
    InputError
        There is neither.
    """
    duration = model.study.duration if duration is None else duration
    if duration is None:
        raise InputError("the model has no path, and no duration is given", field="duration", remedy="give it in s")
    return duration
