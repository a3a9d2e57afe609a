"""Balanced start: static equilibrium if drives are at rest, else the quasi-static deflection in their motion."""

from collections.abc import Iterable, Mapping
from dataclasses import replace
from functools import partial
from typing import NamedTuple

import numpy as np

from paraflex.arrays import Array
from paraflex.mechanism import Load, PrescribedAngle, TimeProfile
from paraflex.mechanism.profiles import HeldAngle, SampledAngle
from .equilibrium import largest_move, moving_equilibrium, static_equilibrium
from .joint_coordinates import joint_coordinate, joint_value
from .projection import LeastChange, constraint_change, project, second_rates
from .rank import dependence
from .signals import moment_signals
from .state import VELOCITY_STIFFNESS, State
from .system import System, build_system

# Motion of the mechanism for a central difference [sizes of the mechanism, rad].
_DIFFERENCE_MOVE = 1e-3


class JointMotion(NamedTuple):
    """Rate and acceleration of a driven joint [rad/s, rad/s^2; m/s, m/s^2]; zero for a joint that is held."""

    rate: float = 0.0
    acceleration: float = 0.0


def _accelerating(time: float, value: float, motion: JointMotion) -> SampledAngle:
    """Return the profile with a value, rate and acceleration at a time [s], continued with constant acceleration."""
    rate, acceleration = motion
    return SampledAngle(
        lambda t: value + rate * (t - time) + 0.5 * acceleration * (t - time) ** 2,
        lambda t: rate + acceleration * (t - time),
        lambda t: np.full(t.shape, acceleration),
    )


def joint_motions(system: System, q: Array, v: Array, a: Array, joints: Iterable[str]) -> dict[str, JointMotion]:
    """Return rates J v and accelerations J a + J' v of joints in a motion q, v, a (n,).

    J is constant for angles; for travels J' v is computed by finite differences along the motion.
    """
    motions = {}
    step = 1e-4 / max(1.0, float(np.max(np.abs(v), initial=0.0)))
    places = np.array([q - step * v, q, q + step * v])
    for name in joints:
        found = joint_coordinate(system, name, places, np.array([v, v, v]))
        turning = (found.rate[2] - found.rate[0]) / (2.0 * step)
        motions[name] = JointMotion(float(found.rate[1]), float(found.rows[1] @ a + turning))
    return motions


def balanced_state(system: System, start: State, driven: Mapping[str, JointMotion]) -> State:
    """Return a start from which links hardly vibrate.

    If every drive is at rest, it is `static_equilibrium` with the joints held at their angles. If a drive moves, links
    are deflected quasi-statically for its motion, q with

        M a + h(q, v) + K q + Phi_q^T lambda = Q(q, v),   Phi(q, t) = 0,   Phi' = 0,   Phi'' = 0,

    v and a the motion of the drives with links that keep their shape (the least v and a in the metric M + s K that
    constraints allow). Weight, loads and inertia forces are balanced, with dampers and friction at joints. The
    velocities of the start are those with which this pose follows the drives, by central differences, projected onto
    the constraints: velocities of drives equal their profiles to rounding. The inertia forces of the changing shape are
    neglected, a fraction (Omega / omega)^2 of the deflection for drives of angular frequency Omega and links of omega.

    Springs at joints count as elastic. If drives leave other degrees of freedom, the motion of these is not given: the
    pose is then that of static equilibrium, with the velocities of least kinetic energy.

    Parameters
    ----------
    system : System
        System of the mechanism.
    start : State
        State that starts the search; its v has no effect.
    driven : mapping of str to JointMotion
        Joints without a prescribed motion that keep their coordinate of the start, slopes of beams included,
        and their motion there.

    Raises
    ------
    AssemblyError
        No equilibrium is found near the start.
    """
    prescribed = {one.joint: one for one in system.mechanism.prescribed}
    driven = {joint: motion for joint, motion in driven.items() if joint not in prescribed}
    now = np.array([start.time])
    rates = [one.profile.evaluate(now)[1][0] for one in prescribed.values()]
    if not np.any([*rates, *(motion.rate for motion in driven.values())]):
        return static_equilibrium(system, start, list(driven))
    drives = _driven(system, start, driven)
    if not _prescribes_all(drives, start):
        still = static_equilibrium(system, start, list(driven))
        return replace(still, v=_Motion(drives, start.time).velocities(still.q))
    return _moving(drives, start)


def _moving(drives: System, start: State) -> State:
    """Return the moving equilibrium, with its velocities."""

    def at(time: float, q: Array) -> Array:
        return moving_equilibrium(drives, State(time, q, np.zeros_like(q)), _Motion(drives, time))

    motion, q = _Motion(drives, start.time), at(start.time, start.q)
    v = motion.velocities(q)
    step = _DIFFERENCE_MOVE / largest_move(drives, v)
    before, after = (at(start.time + h, q + h * v) for h in (-step, step))
    return State(start.time, q, motion.velocities(q, (after - before) / (2.0 * step)))


class _Motion:
    """Velocities and accelerations imposed by drives on a system whose links keep their shape."""

    def __init__(self, system: System, time: float) -> None:
        self.system, self.time, self.signals = system, time, moment_signals(system.mechanism, time)

    def __call__(self, q: Array) -> tuple[Array, Array]:
        """Return velocities and accelerations (n,) at coordinates (n,)."""
        change, rest = self._change(q), np.zeros(self.system.n)
        v = project(change, rest, partial(self._rates, q))
        return v, project(change, rest, partial(second_rates, self.system, self.signals, self.time, q, v))

    def velocities(self, q: Array, near: Array | None = None) -> Array:
        """Return the admissible velocities (n,) at coordinates (n,) nearest to given ones, by default to zero."""
        return project(self._change(q), np.zeros(self.system.n) if near is None else near, partial(self._rates, q))

    def _change(self, q: Array) -> LeastChange:
        return constraint_change(self.system, q, VELOCITY_STIFFNESS, every_spring=True)

    def _rates(self, q: Array, v: Array) -> Array:
        return self.system.constraints(self.signals, self.time, q, v)[1]


def _driven(system: System, start: State, driven: Mapping[str, JointMotion]) -> System:
    """Return the system with the joints driven too; drives and loads follow smooth profiles from the start."""
    own = tuple(
        replace(prescribed, profile=_smooth(prescribed.profile, start.time))
        for prescribed in system.mechanism.prescribed
    )
    more = tuple(
        PrescribedAngle(f"drive of {name}", name, _accelerating(start.time, joint_value(system, name, start.q), motion))
        for name, motion in driven.items()
    )
    loads = tuple(_smooth_load(load, start.time) for load in system.mechanism.loads)
    return build_system(replace(system.mechanism, prescribed=(*own, *more), loads=loads), system)


def _smooth_load(load: Load, time: float) -> Load:
    parts = [_smooth(part, time) if isinstance(part, TimeProfile) else part for part in load.components]
    return replace(load, **{load.kind: tuple(parts) if len(parts) > 1 else parts[0]})


def _smooth(profile: TimeProfile, time: float) -> SampledAngle:
    value, rate, acceleration = (float(x[0]) for x in profile.evaluate(np.array([time])))
    return _accelerating(time, value, JointMotion(rate, acceleration))


def _prescribes_all(drives: System, start: State) -> bool:
    """Return whether drives and springs at joints determine the motion of rigid bodies."""
    mechanism = drives.mechanism
    taken = {prescribed.joint for prescribed in mechanism.prescribed}
    springs = {spring.joint for spring in mechanism.springs} - taken
    locks = tuple(PrescribedAngle(f"spring of {name}", name, HeldAngle(0.0)) for name in springs)
    rigid = build_system(replace(mechanism, prescribed=(*mechanism.prescribed, *locks)).rigid())
    frames = np.concatenate([start.q[body.offset : body.offset + 3] for body in drives.bodies])
    return dependence(rigid, frames).rank == rigid.n
