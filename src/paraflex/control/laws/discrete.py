"""Discrete state-space models as control laws."""

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
import scipy

from paraflex.arrays import Array
from paraflex.control.loop.together import same_period
from paraflex.dynamics.state_space import StateSpace
from paraflex.errors import InputError
from .controllers import Plant
from .law import Law
from .linear_law import LinearLaw


@dataclass(frozen=True, eq=False)
class DiscreteModel(Law, title="state space"):
    """Discrete linear control law x_k+1 = A x_k + B y_k with torques C x_k + D y_k.

    Attributes
    ----------
    A, B, C, D : arrays
        State, input, output and feed-through matrices.
    period : float or None
        Sampling period [s]; None if the model does not specify it.
    inputs, outputs : tuple of str
        Names of sensors and motors; empty if the model has none.
    """

    A: Array
    B: Array
    C: Array
    D: Array
    period: float | None
    inputs: tuple[str, ...]  # pyright: ignore[reportIncompatibleVariableOverride]
    outputs: tuple[str, ...]  # pyright: ignore[reportIncompatibleVariableOverride]

    def check_size(self, inputs: Sequence[str], outputs: Sequence[str], period: float) -> None:
        """Check that the size and the period of the model are as required.

        Raises
        ------
        InputError
            Another number of inputs or outputs, or another period.
        """
        for names, count, field in ((inputs, self.B.shape[1], "inputs"), (outputs, self.C.shape[0], "outputs")):
            if names and len(names) != count:
                raise InputError(f"the model has {count}", field=field, value=", ".join(names), remedy="name as many")
        if self.period is not None and not same_period(self.period, period):
            raise InputError(f"the model is sampled every {self.period:g} s", field="period", value=period,
                             remedy="leave it out")  # fmt: skip

    def start(self, plant: Plant) -> LinearLaw:
        """Return the law in a run: see `Law.start`."""
        self.check_size(plant.inputs, plant.outputs, plant.period)
        return LinearLaw(self.A, self.B, self.C, self.D)


def is_model(given: Any) -> bool:
    """Whether an object is a state space or a transfer function of python-control or SciPy."""
    return hasattr(given, "dt") and (hasattr(given, "to_ss") or all(hasattr(given, name) for name in "ABCD"))


def side_by_side(laws: Sequence[DiscreteModel]) -> DiscreteModel:
    """Combine named laws of one period into one law; torques for one motor add up.

    Raises
    ------
    InputError
        Laws of different periods.
    """
    period = laws[0].period
    for one in laws:
        if one.period is not None and period is not None and not same_period(one.period, period):
            raise InputError(f"differs from that of another law, {period:g} s", field="period",
                             value=one.period, remedy="design both for one period")  # fmt: skip
    inputs, outputs = (tuple(dict.fromkeys(name for one in laws for name in getattr(one, what)))
                       for what in ("inputs", "outputs"))  # fmt: skip
    read = [np.array([[name == own for name in inputs] for own in one.inputs], dtype=float) for one in laws]
    given = [np.array([[name == own for own in one.outputs] for name in outputs], dtype=float) for one in laws]
    A = scipy.linalg.block_diag(*(one.A for one in laws))
    B = np.vstack([one.B @ each for one, each in zip(laws, read, strict=True)])
    C = np.hstack([each @ one.C for one, each in zip(laws, given, strict=True)])
    D = sum(to @ one.D @ of for one, to, of in zip(laws, given, read, strict=True))
    return DiscreteModel(A, B, C, np.asarray(D), period, inputs, outputs)


def check_discrete(dt: Any, given: Any, field: str, name: str) -> None:
    """Check that a model with this time step is discrete, by the conventions of python-control and SciPy.

    Raises
    ------
    InputError
        A continuous model.
    """
    if dt is None or (dt is not True and not dt > 0.0):
        # The method that discretises a continuous model has one name in SciPy, the other in python-control.
        method = "to_discrete" if hasattr(given, "to_discrete") else "sample"
        raise InputError("is a continuous model", field=field, value=given,
                         remedy=f"discretise it with {name}.{method}(1e-3)")  # fmt: skip


def matrices_of(model: Any) -> StateSpace:
    """Return the matrices of a state-space model, which may have no states, or of a proper transfer function.

    Raises
    ------
    InputError
        A transfer function that is not proper, or numbers that are not finite.
    """
    try:
        model = model if hasattr(model, "A") else model.to_ss()
    except (ValueError, NotImplementedError) as error:
        raise InputError(f"has no state space: {error}", field="model", value=model,
                         remedy="give a proper transfer function, or a state space") from None  # fmt: skip
    found = StateSpace.of(model.A, model.B, model.C, model.D)
    if not all(np.all(np.isfinite(each)) for each in found):
        raise InputError("holds numbers that are not finite", field="model", remedy="look at how it was computed")
    return found
