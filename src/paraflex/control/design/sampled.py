"""Exact sampling of linear models with zero-order hold and input delay."""

from collections.abc import Sequence
from dataclasses import dataclass
from functools import cached_property
from typing import Any, NamedTuple

import numpy as np
import scipy

from paraflex.arguments import checked_arguments
from paraflex.arrays import Array, Complex
from paraflex.control.loop.together import check_distinct, same_period, whole_and_part
from paraflex.dynamics.state_space import StateSpace
from paraflex.errors import InputError
from paraflex.limits import PLANT_STATES, at_most
from paraflex.linear.model import LinearModel
from paraflex.mechanism.quantities import not_negative, positive


class NamedMatrices(NamedTuple):
    """Matrices of a model with the names of its states, inputs and outputs."""

    matrices: StateSpace
    states: tuple[str, ...]
    inputs: tuple[str, ...]
    outputs: tuple[str, ...]


class WithPoles:
    """Base class of discrete systems with `poles` z."""

    @property
    def spectral_radius(self: Any) -> float:
        """Largest magnitude of the poles; a loop is stable if it is below one."""
        return float(np.max(np.abs(self.poles), initial=0.0))


@dataclass(frozen=True)
class SampledPlant:
    """Sampled linear plant x_k+1 = A x_k + B u_k with readings y_k = C x_k, as seen by a digital controller.

    Torques u_k, computed at sample k, act from k `period` + `delay` on until the next ones do. Readings are taken
    before torques change: the feed-through of the model acts on the previous torques, so that there is no algebraic
    loop.

    Attributes
    ----------
    A : (n, n) array
        State matrix.
    B : (n, inputs) array
        Input matrix.
    C : (outputs, n) array
        Output matrix.
    G : (n, inputs) array
        Disturbance matrix: effect of efforts at the inputs that act over the whole period, without delay.
    states : tuple of str
        Names of the states: those of the model, then delayed torques, the oldest first: "tau1(k-2)".
    inputs, outputs : tuple of str
        Names of inputs and outputs.
    period, delay : float
        Sampling period and input delay [s].
    own : int
        Number of states of the model itself, which come first.
    """

    A: Array
    B: Array
    C: Array
    G: Array
    states: tuple[str, ...]
    inputs: tuple[str, ...]
    outputs: tuple[str, ...]
    period: float
    delay: float
    own: int

    def __repr__(self) -> str:
        late = f", {1e3 * self.delay:g} ms late" if self.delay else ""
        return f"SampledPlant({len(self.states)} states, every {1e3 * self.period:g} ms{late})"

    @property
    def D(self) -> Array:
        """Feed-through matrix (outputs, inputs), which is zero."""
        return np.zeros((len(self.outputs), len(self.inputs)))

    @property
    def dt(self) -> float:
        """Sampling period [s], by the name of python-control and SciPy."""
        return self.period

    @cached_property
    def poles(self) -> Complex:
        """Eigenvalues z (n,) of A; those of delayed torques are zero."""
        own = np.linalg.eigvals(self.A[: self.own, : self.own])
        return np.concatenate([own, np.zeros(len(self.states) - self.own)]).astype(complex)

    @checked_arguments()
    def rows(self, names: Sequence[str], field: str = "outputs") -> Array:
        """Return the rows of C (names, n) of some outputs.

        Raises
        ------
        InputError
            An unknown output.
        """
        return self.C[places(names, self.outputs, field, "output")]

    @checked_arguments()
    def select(self, inputs: Sequence[str] | None = None, outputs: Sequence[str] | None = None) -> "SampledPlant":
        """Return the plant with some inputs and outputs only; the torques of other inputs are zero.

        Raises
        ------
        InputError
            An unknown input or output.
        """
        columns = places(self.inputs if inputs is None else inputs, self.inputs, "inputs", "input")
        rows = places(self.outputs if outputs is None else outputs, self.outputs, "outputs", "output")
        width = len(self.inputs)
        late = range((len(self.states) - self.own) // width) if width else range(0)
        kept = [*range(self.own), *(self.own + width * k + j for k in late for j in columns)]
        return SampledPlant(
            self.A[np.ix_(kept, kept)], self.B[np.ix_(kept, columns)], self.C[np.ix_(rows, kept)],
            self.G[np.ix_(kept, columns)], tuple(self.states[k] for k in kept),
            tuple(self.inputs[j] for j in columns), tuple(self.outputs[j] for j in rows),
            self.period, self.delay, self.own,
        )  # fmt: skip


@checked_arguments()
def discretise(model: Any, period: float, delay: float = 0.0) -> SampledPlant:
    """Sample a linear model with torques that are held and act after a delay, as a digital controller sees it.

    The sampling is exact, by exponentials of [A, B; 0, 0]: for a delay of d periods and a fraction f, x_k+1 = Phi x_k +
    Phi(T - f) Gamma(f) u_k-d-1 + Gamma(T - f) u_k-d (Åström and Wittenmark, Computer-Controlled Systems, section 2.3).

    Parameters
    ----------
    model : LinearModel, ReducedModel, state space or (A, B, C, D)
        Continuous model of paraflex, python-control or SciPy. Names of states, inputs and outputs are kept.
    period : float
        Sampling period T [s].
    delay : float
        Delay from a sample until its torques act [s]: any number of periods, fractions included.

    Returns
    -------
    SampledPlant
        Sampled model, with delayed torques as additional states.

    Raises
    ------
    InputError
        A period that is not positive, a negative delay, a model that is sampled already, or matrices of inconsistent
        sizes.
    """
    named = named_matrices(model)
    positive(period, "period", "s")
    not_negative(delay, "delay", "s")
    whole, part = whole_and_part(delay / period)
    scaled, back = _scaled(model, named.matrices)
    late, early, over = (_held(scaled, time) for time in (period * part, period * (1.0 - part), period))
    old, new = (back @ each for each in (early[0] @ late[1], early[1]))
    n, m, p = len(named.states), len(named.inputs), len(named.outputs)
    feeds = bool(np.any(named.matrices.D))
    # Delayed inputs: those of samples k - d, ..., k - 1, and that of k - d - 1 if it acts in this period or is read.
    oldest = whole + (1 if part or feeds else 0)
    size = n + m * oldest
    at_most(size, PLANT_STATES, "delay", "too long for the period: pending torques add too many states")
    A, B, C, G = np.zeros((size, size)), np.zeros((size, m)), np.zeros((p, size)), np.zeros((size, m))
    A[:n, :n] = back @ over[0] @ np.linalg.inv(back) if n else over[0]
    C[:, :n], G[:n] = named.matrices.C, back @ over[1]
    A[n : size - m, n + m :] = np.eye(max(size - n - m, 0))
    if oldest:
        B[size - m :] = np.eye(m)
    if oldest > whole:
        A[:n, n : n + m], C[:, n : n + m] = old, named.matrices.D
    if whole:
        last = n + m * (oldest - whole)
        A[:n, last : last + m] = new
    else:
        B[:n] = new
    under_way = tuple(f"{name}(k-{k})" for k in range(oldest, 0, -1) for name in named.inputs)
    return SampledPlant(A, B, C, G, (*named.states, *under_way), named.inputs, named.outputs, float(period),
                        float(delay), n)  # fmt: skip


def as_sampled(model: Any, period: float, delay: float) -> SampledPlant:
    """Return a sampled plant as it is, or sample a linear model.

    Raises
    ------
    InputError
        A plant of another period; see `discretise`.
    """
    if not isinstance(model, SampledPlant):
        return discretise(model, period, delay)
    if not same_period(model.period, period):
        raise InputError(f"is sampled every {model.period:g} s", field="model", value=model,
                         remedy=f"give the continuous model, or one sampled every {period:g} s")  # fmt: skip
    return model


def named_matrices(model: Any) -> NamedMatrices:
    """Return the matrices and names of a continuous model.

    Raises
    ------
    InputError
        An object that is not a linear model, a sampled model, or matrices that are of inconsistent sizes or not finite.
    """
    if isinstance(model, NamedMatrices):
        return model
    given = model if isinstance(model, tuple | list) else [getattr(model, name, None) for name in ("A", "B", "C", "D")]
    if len(given) != 4 or any(each is None for each in given):
        raise InputError("is not a linear model", field="model", value=model,
                         remedy="give one that pf.linearise makes, a state space, or (A, B, C, D)")  # fmt: skip
    dt = getattr(model, "dt", None)
    if dt is not None and (dt is True or dt > 0.0):
        raise InputError("is sampled already", field="model", value=model, remedy="give the continuous model")
    try:
        A, B, C, D = matrices = StateSpace.of(*given)
    except (TypeError, ValueError):
        raise InputError(
            "has matrices that are not numeric", field="model", value=model, remedy="give numbers"
        ) from None
    n, m, p = len(A), D.shape[1], D.shape[0]
    fits = A.shape == (n, n) and B.shape == (n, m) and C.shape == (p, n)
    if not fits or not all(np.all(np.isfinite(each)) for each in matrices):
        shapes = ", ".join(f"{each.shape[0]} x {each.shape[1]}" for each in matrices)
        raise InputError("has matrices that do not fit together, or are not finite", field="model", value=shapes,
                         remedy="give A (n, n), B (n, m), C (p, n), D (p, m)")  # fmt: skip
    names = (names_of(model, what, letter, count) for what, letter, count in
             (("state", "x", n), ("input", "u", m), ("output", "y", p)))  # fmt: skip
    return NamedMatrices(matrices, *names)


def names_of(model: Any, what: str, letter: str, count: int) -> tuple[str, ...]:
    """Return the names of a model's states, inputs or outputs; x1, x2, ... for a model without names."""
    have = getattr(model, f"{what}_labels", None) or getattr(model, f"{what}s", None)
    if isinstance(have, Sequence) and not isinstance(have, str) and len(have) == count:
        return tuple(str(getattr(one, "name", one)) for one in have)
    return tuple(f"{letter}{k + 1}" for k in range(count))


def places(names: Sequence[str], among: Sequence[str], field: str, what: str) -> list[int]:
    """Return the indices of names among others.

    Raises
    ------
    InputError
        An unknown name, or one given twice.
    """
    check_distinct(names, among, field, what)
    return [list(among).index(name) for name in names]


def _scaled(model: Any, matrices: StateSpace) -> tuple[StateSpace, Array]:
    """Return the model in balanced states, and the transformation (n, n) back to its own.

    Axial vibrations of links at tens of kHz, in metres beside rates, would cost the exponentials their accuracy.
    """
    if isinstance(model, LinearModel):
        return model.scaled, model.modal_states[1]
    if not len(matrices.A):
        return matrices, np.zeros((0, 0))
    A, (sizes, _) = scipy.linalg.matrix_balance(matrices.A, permute=False, separate=True)
    return StateSpace(A, matrices.B / sizes[:, None], matrices.C * sizes, matrices.D), np.diag(sizes)


def _held(matrices: StateSpace, time: float) -> tuple[Array, Array]:
    """Return Phi (n, n) and Gamma (n, m) over a time [s] with inputs held; loading `scipy.signal` takes longer."""
    n, m = matrices.B.shape
    both = np.zeros((n + m, n + m))
    both[:n, :n], both[:n, n:] = matrices.A, matrices.B
    whole = scipy.linalg.expm(both * time)
    return whole[:n, :n], whole[:n, n:]
