"""Discrete-time models along motions: transition matrices of A(t) and B(t) over each sampling period.

Each step applies the fourth-order commutator-free method of Blanes and Moan (2006), Fourth- and sixth-order
commutator-free Magnus integrators for linear and non-linear dynamical systems, to (x, u, u'). It consists of two
exponentials of averages of the matrices in the step, so it is exact for constant matrices, however fast vibrations are.
"""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from enum import Enum
from itertools import pairwise
from typing import TYPE_CHECKING, Any, NamedTuple

import numpy as np
import scipy

from paraflex.arguments import checked_arguments
from paraflex.arrays import Array, Brief
from paraflex.errors import InputError
from paraflex.mechanism.quantities import known
from .coordinates import Variable
from .named import labelled, matrices_of

if TYPE_CHECKING:
    import xarray as xr

# Gauss points of a step, and weights of the matrices there in the second exponential; reversed in the first one.
_PLACES = (0.5 - math.sqrt(3.0) / 6.0, 0.5 + math.sqrt(3.0) / 6.0)
_WEIGHTS = (0.25 - math.sqrt(3.0) / 6.0, 0.25 + math.sqrt(3.0) / 6.0)
# Richardson: steps of twice the size with splines of every second sample have 16 times the error (fourth order).
_RICHARDSON = 15.0
# Relative excess of a period over the spacing of samples up to which it is not divided.
_SAME = 1e-6


class InputHold(Enum):
    """Hold of the inputs between samples: zero-order (constant) or first-order (linear)."""

    ZERO = "zero"
    FIRST = "first"


class Prediction(NamedTuple):
    """Predicted perturbation: times (k,) [s], states (k, 2f) and outputs (k, outputs)."""

    times: Array
    states: Array
    outputs: Array


class Transitions(NamedTuple):
    """Transition matrix, input matrices for u at the start and at the end, and estimated error of each period."""

    Phi: Array
    Gamma: Array
    Gamma_next: Array
    error: Array


@dataclass(frozen=True)
class SampledModel(Brief):
    """Discrete-time model along a motion: x_k+1 = Phi_k x_k + Gamma_k u_k + Gamma_next_k u_k+1, z = C x + D u.

    Attributes
    ----------
    states, inputs, outputs : tuple of Variable
        Names and units of states, inputs and outputs.
    times : (k,) array
        Sample times [s].
    hold : InputHold
        Hold of the inputs between samples.
    Phi : (k - 1, 2f, 2f) array
        Transition matrix of each period.
    Gamma, Gamma_next : (k - 1, 2f, inputs) arrays
        Input matrices of each period, for the inputs at its start and end; the latter is zero for a zero-order hold.
    C, D : (k, outputs, 2f) and (k, outputs, inputs) arrays
        Output and feed-through matrices at the samples.
    error : (k - 1,) array
        Estimated relative error of each period's matrices (norm of a perturbation: root of its energy), of the
        exponentials and of the splines between the samples of A and B.
    """

    states: tuple[Variable, ...]
    inputs: tuple[Variable, ...]
    outputs: tuple[Variable, ...]
    times: Array
    hold: InputHold
    Phi: Array
    Gamma: Array
    Gamma_next: Array
    C: Array
    D: Array
    error: Array

    @checked_arguments()
    def predict(
        self, x0: Mapping[str, float] | Array | None = None, du: Mapping[str, float | Array] | Array | None = None
    ) -> Prediction:
        """Predict the response to small changes of the initial state and of the inputs.

        Parameters
        ----------
        x0 : (2f,) array or mapping of str to float, optional
            Change of the states at the first sample, of all or by name; zero by default.
        du : (k, inputs) array or mapping of str to float or (k,) array, optional
            Changes of the inputs at the samples, of all or by name; zero by default.

        Raises
        ------
        InputError
            A name is unknown, or the number of values is not that of states, inputs or samples.
        """
        x = _by_name(x0, self.states, "x0", ())
        u = _by_name(du, self.inputs, "du", self.times.shape)
        states = np.empty((self.times.size, x.size))
        states[0] = x
        for k in range(self.times.size - 1):
            states[k + 1] = self.Phi[k] @ states[k] + self.Gamma[k] @ u[k] + self.Gamma_next[k] @ u[k + 1]
        outputs = np.einsum("kij,kj->ki", self.C, states) + np.einsum("kij,kj->ki", self.D, u)
        return Prediction(self.times, states, outputs)

    def to_xarray(self) -> xr.Dataset:
        """Return all matrices as a dataset labelled by time and by names of states, inputs and outputs, with units."""
        data = {
            "Phi": (("period", "state", "state_of"), self.Phi), "Gamma": (("period", "state", "input"), self.Gamma),
            "Gamma_next": (("period", "state", "input"), self.Gamma_next), "error": ("period", self.error),
            **matrices_of(self, "CD", ("time",)),
        }  # fmt: skip
        return labelled(self, data, {"hold": self.hold.value}, time=self.times, period=self.times[:-1])


def _by_name(given: Any, variables: Sequence[Variable], field: str, shape: tuple[int, ...]) -> Array:
    """Return values (*shape, variables), given as an array or by name; zero by default."""
    out = np.zeros((*shape, len(variables)))
    names = [one.name for one in variables]
    if isinstance(given, Mapping):
        for name, value in given.items():
            known(name, names, field, "name")
            out[..., names.index(name)] = _fitting(value, f"{field}.{name}", shape)
    elif given is not None:
        out[:] = _fitting(given, field, out.shape)
    return out


def _fitting(value: Any, field: str, shape: tuple[int, ...]) -> Array:
    array = np.asarray(value, dtype=float)
    if array.shape not in (shape, ()) or not np.all(np.isfinite(array)):
        raise InputError("has the wrong shape, or is not finite", field=field, value=array.shape,
                         remedy=f"give {' x '.join(map(str, shape)) or 'one'} finite numbers")  # fmt: skip
    return array


# --- Exponentials -----------------------------------------------------------------------------------------------------


def transitions(times: Array, A: Array, B: Array, ends: Array, hold: InputHold) -> Transitions:
    """Compute the transition matrices of x' = A x + B u between given times.

    Parameters
    ----------
    times : (k,) array
        Times of the matrices, at least four [s].
    A, B : (k, n, n) and (k, n, m) arrays
        Matrices at these times, for states of equal scale: the error is relative to their Euclidean norm.
    ends : (p + 1,) array
        Ends of the periods [s].
    hold : InputHold
        Hold of the inputs in each period.
    """
    unit = float(np.mean(np.diff(ends)))
    parts = max(1, math.ceil(unit * (times.size - 1) / (times[-1] - times[0]) - _SAME))
    if parts > 1 or ends.size == 2:
        parts = 2 * math.ceil(0.5 * parts)
    grid = np.interp(np.arange((ends.size - 1) * parts + 1) / parts, np.arange(ends.size), ends)
    halved = np.unique([*range(0, times.size, 2), times.size - 1])
    every, second = (_Held(times[k], A[k], B[k], unit) for k in (slice(None), halved))
    steps = np.array([every.step(*step) for step in pairwise(grid)])
    n, m = B.shape[1:]
    whole = _composed(steps, parts)
    rising = whole[:, :n, n + m :] * (unit / np.diff(ends))[:, None, None] * (hold is InputHold.FIRST)
    error = _errors(second, grid, steps, parts, n)
    return Transitions(whole[:, :n, :n], whole[:, :n, n : n + m] - rising, rising, error)


class _Held:
    """Augmented system (x, u, unit u')' = M(t) (x, u, unit u'), with M(t) interpolated by splines."""

    def __init__(self, times: Array, A: Array, B: Array, unit: float) -> None:
        degree = min(3, times.size - 1)
        self._A, self._B = (scipy.interpolate.make_interp_spline(times, each, k=degree) for each in (A, B))
        n, m = B.shape[1:]
        self._inputs = np.hstack([np.zeros((m, n + m)), np.eye(m) / unit])
        self._last = np.zeros((m, n + 2 * m))

    def _at(self, t: float) -> Array:
        B = self._B(t)
        return np.vstack([np.hstack([self._A(t), B, np.zeros_like(B)]), self._inputs, self._last])

    def step(self, start: float, end: float) -> Array:
        """Return the transition matrix over a step from `start` to `end` [s]."""
        h = end - start
        first, last = (self._at(start + place * h) for place in _PLACES)
        earlier, later = (h * (_WEIGHTS[k] * first + _WEIGHTS[1 - k] * last) for k in (1, 0))
        return scipy.linalg.expm(later) @ scipy.linalg.expm(earlier)


def _composed(steps: Array, parts: int) -> Array:
    """Return the transition matrices over `parts` steps each."""
    whole = steps[::parts]
    for part in range(1, parts):
        whole = steps[part::parts] @ whole
    return whole


def _errors(coarse: _Held, grid: Array, steps: Array, parts: int, n: int) -> Array:
    """Estimate the errors of periods of `parts` steps from steps of twice the size with every second sample.

    Periods of one step are compared in pairs; the last of an odd number is paired with the previous one.
    """
    span, count = max(parts, 2), len(steps)
    error = np.zeros(count // parts)
    for start in [*range(0, count - span + 1, span), *([count - span] if count % span else [])]:
        fine = _composed(steps[start : start + span], span)[0, :n]
        twice = np.array([coarse.step(*ends) for ends in pairwise(grid[start : start + span + 1 : 2])])
        apart = fine - _composed(twice, span // 2)[0, :n]
        inputs = max(float(np.linalg.norm(fine[:, n:], 2)), np.finfo(float).tiny)
        size = max(np.linalg.norm(apart[:, :n], 2), np.linalg.norm(apart[:, n:], 2) / inputs) / _RICHARDSON
        first = start // parts
        error[first : first + span // parts] = size * parts / span
    return error
