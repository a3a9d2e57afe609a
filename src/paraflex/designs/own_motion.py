"""A design without a path, ready to run: its mechanism moves under its loads, prescribed motions and given torques."""

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
    """What `paraflex run` runs of a model without a path.

    Attributes
    ----------
    mechanism : Mechanism
    start : State
    duration : float
        [s]
    samples : int
    torques : mapping of str to float or AngleLaw
        Of motors by name.
    controllers : sequence of ControllerDescription
        In place of torques.
    """

    mechanism: Mechanism
    start: State
    duration: float
    samples: int
    torques: Mapping[str, InTime]
    controllers: Sequence[ControllerDescription] = ()

    def simulate(self, options: IntegrationOptions, watch: Callable[[float], None] | None) -> MotionRun:
        """Integrate it; `watch` is called with the time reached [s]."""
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
    """The motion of a model without a path; what is None is as its [study] has it.

    Raises
    ------
    InputError
        There is no duration; or see `motion.state_at`.
    AssemblyError
        The loops do not close.
    """
    study = model.study.filled(duration=duration, samples=samples, assembly=assembly)
    start = state_at(build_system(model.mechanism), model.start, study.assembly, balanced=balanced)
    return OwnMotion(
        model.mechanism, start, own_duration(model, duration), study.samples, study.torques, model.acting()
    )


def own_duration(model: Model, duration: float | None) -> float:
    """How long a model without a path runs [s]: as asked, else as its [study] has it.

    Raises
    ------
    InputError
        Neither says it.
    """
    duration = model.study.duration if duration is None else duration
    if duration is None:
        raise InputError(
            "the model has no path, and nothing says how long it is to run", field="duration", remedy="give it in s"
        )
    return duration
