"""Linear control laws with limits, stepped here and, from the same matrices, by the compiled time loop."""

from dataclasses import dataclass, field
from typing import NamedTuple

import numpy as np

from paraflex.arrays import Array
from .law import StartedLaw


def _zero() -> Array:
    return np.zeros(0)


class LinearState(NamedTuple):
    """State of a linear law after a sample.

    Attributes
    ----------
    x : (n,) array
        States before the sample.
    errors : (inputs,) array
        Errors of the readings at the sample.
    wanted, given : (outputs,) arrays
        Torques of the sample before and after limits.
    """

    x: Array
    errors: Array
    wanted: Array
    given: Array


@dataclass(frozen=True)
class LinearLaw(StartedLaw):
    """Linear law x' = A x + B e + E (w - g), w = P (h + C x + D e), with g the torques w after limits.

    Attributes
    ----------
    A, B, C, D : (n, n), (n, inputs), (outputs, n) and (outputs, inputs) arrays
        State, input, output and feed-through matrices; e are errors of readings.
    E : (n, outputs) array
        Gain of the feedback from limiting; zero by default: states do not depend on it (no anti-windup).
    first : (n, inputs) array
        Matrix from the first errors to the states before the first sample; zero by default.
    holding : (outputs,) array
        Constant torques h; zero by default.
    waiting : (n,) array
        One for states that stay constant while a torque is limited, zero for others; zero by default.
    projector : (samples, outputs, outputs) array or None
        Projectors P by sample, the last one kept afterwards; None for the identity.
    """

    A: Array
    B: Array
    C: Array
    D: Array
    E: Array = field(default_factory=_zero)
    first: Array = field(default_factory=_zero)
    holding: Array = field(default_factory=_zero)
    waiting: Array = field(default_factory=_zero)
    projector: Array | None = None

    def __post_init__(self) -> None:
        (outputs, inputs), n = self.D.shape, len(self.A)
        shapes = {"A": (n, n), "B": (n, inputs), "C": (outputs, n), "D": (outputs, inputs), "E": (n, outputs),
                  "first": (n, inputs), "holding": (outputs,), "waiting": (n,)}  # fmt: skip
        for name, shape in shapes.items():
            given = getattr(self, name)
            object.__setattr__(self, name, given.reshape(shape).astype(float) if given.size else np.zeros(shape))

    @property
    def holding_torques(self) -> Array:  # pyright: ignore[reportIncompatibleVariableOverride]
        """Constant torques h, which act before the first sample as well."""
        return self.holding

    def step(self, state: LinearState | None, k: int, t: float, y: Array) -> tuple[Array, LinearState]:
        """Return the torques of a sample, and the state after it: see `StartedLaw.step`."""
        x = self.first @ y if state is None else self.following(state)
        torques = self.holding + self.C @ x + self.D @ y
        if self.projector is not None:
            torques = self.projector[min(k, len(self.projector) - 1)] @ torques
        return torques, LinearState(x, y, torques, torques)

    def limited(self, state: LinearState, torques: Array) -> LinearState:
        """Return the state after a sample whose torques are limited: see `StartedLaw.limited`."""
        return state._replace(given=torques)

    def following(self, state: LinearState) -> Array:
        """Return the states (n,) before the next sample, as `go_on_to_next` of `kernel.sampled` computes them."""
        x = self.A @ state.x + self.B @ state.errors
        excess = state.wanted - state.given
        return np.where(self.waiting == 1.0, state.x, x + self.E @ excess) if np.any(excess) else x
