"""Natural frequencies that `paraflex info` prints, and the pose that they refer to."""

from typing import Any

import numpy as np

from paraflex.arrays import Array
from paraflex.checks import BALANCED
from paraflex.dynamics import (
    State,
    System,
    Vibration,
    assembled_position,
    natural_frequencies,
    static_equilibrium,
    undeformed,
)
from paraflex.dynamics.linearise import LOWEST
from paraflex.dynamics.signals import moment_signals
from paraflex.errors import AssemblyError, InputError
from paraflex.files import Model
from paraflex.kinematics import follow_path
from paraflex.motion import UNBALANCED
from .commands.models import InfoRequest
from .request import check_time


def frequencies(
    model: Model, system: System, rigid: System, start: State, assembly: str, request: InfoRequest
) -> dict[str, Any]:
    """Return natural frequencies with motors held and free, and time, acceleration and equilibrium of their pose."""
    motors = list(dict.fromkeys(motor.joint for motor in model.mechanism.motors))
    state = start if request.at is None else _pose_at(model, rigid, start, assembly, request.at, request.path)
    state = undeformed(system, rigid, state)
    if request.balanced:
        try:
            state = static_equilibrium(system, state, motors)
        except AssemblyError as error:
            raise InputError(error.cause, field="--balanced", remedy=UNBALANCED) from error
    held = natural_frequencies(system, state, motors, count=LOWEST) if motors else None
    free = natural_frequencies(system, state, torque_at=motors, count=LOWEST)
    is_equilibrium = free.acceleration < BALANCED
    return {
        "time": state.time,
        "balanced": request.balanced,
        "acceleration": free.acceleration,
        "is_equilibrium": is_equilibrium,
        "equilibrium_nearby": is_equilibrium or _has_equilibrium(system, state, motors),
        "motors_held_hz": None if held is None else hertz(held.frequencies),
        "motors_free_hz": hertz(free.frequencies),
        "growing": max(_growing(free), 0 if held is None else _growing(held)),
    }


def _has_equilibrium(system: System, state: State, held: list[str]) -> bool:
    """Return whether `--balanced` would find an equilibrium from a pose."""
    try:
        static_equilibrium(system, state, held)
    except AssemblyError:
        return False
    return True


def _pose_at(model: Model, rigid: System, start: State, assembly: str, at: float, path: str | None) -> State:
    """Return the pose of the rigid mechanism at the time `at` [s], on its path or by its prescribed angles."""
    check_time(at)
    if path is not None or model.paths:
        motion = follow_path(model.mechanism, model.path(path), [0.0, at] if at else [0.0], assembly=assembly)
        return State(at, motion.q[-1], np.zeros(rigid.n))
    if rigid.n != rigid.n_constraints:
        raise InputError(
            "the model has no path, and its prescribed angles do not give its pose at later times",
            field="--at",
            value=at,
            remedy="leave it out",
        )
    q = assembled_position(rigid, moment_signals(rigid.mechanism, at), at, start.q)
    return State(at, q, np.zeros(rigid.n))


def _growing(vibration: Vibration) -> int:
    return int(np.sum(vibration.squares < 0.0))


def hertz(omega: Array) -> list[float]:
    """Convert angular frequencies [rad/s] to frequencies [Hz]."""
    return [float(w) / (2.0 * np.pi) for w in omega]
