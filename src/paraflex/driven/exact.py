"""Motion of a driven mechanism at any time, from the closure of its loops."""

import math
from dataclasses import dataclass, replace
from functools import cached_property
from typing import NamedTuple

import numpy as np

from paraflex.arrays import Array, Brief
from paraflex.dynamics import System, build_system
from paraflex.dynamics.soundness import Mobility, mobility
from paraflex.dynamics.state import State
from paraflex.integrators import Solution
from paraflex.mechanism import ConstantSpeed
from paraflex.paths.loops import LoopClosure

NO_TASKS = np.zeros(0, dtype=np.int64)


def no_target(times: Array) -> Array:
    """Return the task coordinates (times, 3, 0) of a motion that drives alone determine."""
    return np.zeros((times.size, 3, 0))


class ExactState(NamedTuple):
    """Coordinates, velocities and accelerations (k, n) at some times."""

    q: Array
    v: Array
    a: Array


@dataclass(frozen=True)
class Drive:
    """Joint that moves the mechanism, at constant speed.

    Attributes
    ----------
    name, joint : str
        Name of the prescribed motion, and of its joint.
    start, end : float
        First and last angle [rad] or travel [m] of the joint.
    speed : float
        Speed, positive [rad/s, m/s].
    unit : str
        Unit of its coordinate: "rad" or "m".
    reach : tuple of float or None
        Lowest and highest angle or travel that the mechanism allows in this assembly, None for those that do not lie
        in the range examined.
    """

    name: str
    joint: str
    start: float
    end: float
    speed: float
    unit: str
    reach: tuple[float | None, float | None] = (None, None)

    @property
    def turns(self) -> float:
        """Number of turns; zero for a travel."""
        return abs(self.end - self.start) / (2.0 * math.pi) if self.unit == "rad" else 0.0

    @property
    def full_turn(self) -> bool:
        """Whether the joint makes a whole turn, after which the motion repeats."""
        return math.isclose(self.turns, 1.0, rel_tol=1e-9)

    @property
    def duration(self) -> float:
        """Time of the travel [s]."""
        return abs(self.end - self.start) / self.speed

    @property
    def profile(self) -> ConstantSpeed:
        """Angle or travel over time."""
        return ConstantSpeed(self.start, math.copysign(self.speed, self.end - self.start))

    def at(self, t: float) -> float:
        """Return the angle or travel at a time [s]."""
        return self.start + t * self.profile.speed


@dataclass(frozen=True)
class ExactMotion(Brief):
    """Motion of a driven mechanism, at samples and between them.

    Attributes
    ----------
    system : System
        System of the rigid mechanism.
    solution : Solution
        Motion at the samples.
    drive : Drive, optional
        Joint that moves at constant speed; None for other prescribed motions.
    loops : LoopClosure
        Equations that determine the motion.
    """

    system: System
    solution: Solution
    drive: Drive | None
    loops: LoopClosure

    @cached_property
    def mobility(self) -> Mobility:
        """Degrees of freedom without the drives, and redundant constraints, at the first sample."""
        mechanism = replace(self.loops.system.mechanism, prescribed=())
        return mobility(build_system(mechanism), State(0.0, self.solution.q[0], self.solution.v[0]))

    def at(self, t: float) -> ExactState:
        """Return the motion (1, n) at a time within the samples [s], exact to rounding."""
        k = int(np.clip(np.searchsorted(self.solution.t, t) - 1, 0, self.solution.t.size - 1))
        times = np.array([self.solution.t[k], t])
        found = self.loops.follow(no_target, times, np.array([False, True]), self.solution.q[k].copy())
        return ExactState(*found.arrays[1:4])
