"""Linear models of few states: Craig-Bampton, modal and balanced reduction of a mechanism as a whole."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from enum import Enum
from functools import cached_property
from typing import TYPE_CHECKING, Any

import numpy as np
import scipy
from numpy.typing import ArrayLike, NDArray

from paraflex.arguments import checked_arguments
from paraflex.arrays import Array
from paraflex.errors import InputError, as_enum
from paraflex.limits import solvable
from paraflex.linear.balancing import balanced
from paraflex.linear.bases import Basis, craig_bampton, independent_rows, kernel, lowest_modes, rubin
from paraflex.linear.coordinates import Variable
from paraflex.linear.model import LinearModel
from paraflex.linear.motions import SecondOrder, motions
from paraflex.linear.named import Names, control_model, labelled_model, numbers_of, places_in_s
from paraflex.linear.zeros import StateSpace, zeros

if TYPE_CHECKING:
    import xarray as xr

Complex = NDArray[np.complex128]


class ReductionMethod(Enum):
    """How states are left out."""

    CRAIG_BAMPTON = "craig-bampton"
    RUBIN = "rubin"
    MODAL = "modal"
    BALANCED = "balanced"


@dataclass(frozen=True)
class ReducedModel:
    """A linear model of few states: x' = A x + B u, y = C x + D u.

    Attributes
    ----------
    full : LinearModel
        That it stands for.
    method : ReductionMethod
    states : tuple of Variable
        Coordinates of the motors' joints, amplitudes of modes, and rates of these; or amplitudes of balanced states.
    state_space : StateSpace
    basis : (f, k) array, optional
        Coordinates of the full model with those of this one; none of balanced states.
    hankel : array, optional
        Hankel singular values of balanced truncation, in units of outputs over inputs.
    bound : float, optional
        Of balanced truncation: the largest gain of the error over all frequencies is not above.
    """

    full: LinearModel
    method: ReductionMethod
    states: tuple[Variable, ...]
    state_space: StateSpace
    basis: Array | None = None
    hankel: Array | None = None
    bound: float | None = None

    @property
    def inputs(self) -> tuple[Variable, ...]:
        """Names and units, as of the full model."""
        return self.full.inputs

    @property
    def outputs(self) -> tuple[Variable, ...]:
        """Names and units, as of the full model."""
        return self.full.outputs

    @property
    def A(self) -> Array:
        """State matrix (states, states)."""
        return self.state_space.A

    @property
    def B(self) -> Array:
        """Input matrix (states, inputs)."""
        return self.state_space.B

    @property
    def C(self) -> Array:
        """Output matrix (outputs, states)."""
        return self.state_space.C

    @property
    def D(self) -> Array:
        """Feed-through (outputs, inputs)."""
        return self.state_space.D

    @cached_property
    def _second_order(self) -> tuple[SecondOrder, Array]:
        """The equations and the basis."""
        if self.basis is None:
            raise InputError(
                "has no coordinates whose rates are states too", field="method", value=self.method.value,
                remedy=f"choose {ReductionMethod.CRAIG_BAMPTON.value} or {ReductionMethod.MODAL.value}",
            )  # fmt: skip
        return self.full.second_order.within(self.basis), self.basis

    @property
    def frequencies(self) -> Array:
        """Undamped natural frequencies, inputs zero [rad/s].

        Raises
        ------
        InputError
            A model of balanced states.
        """
        return self._frequencies([])

    @checked_arguments()
    def held_frequencies(self, motors: Sequence[str] | None = None) -> Array:
        """Undamped natural frequencies with motors held, by default all that are inputs [rad/s].

        Raises
        ------
        InputError
            A motor that the mechanism does not have, or a model of balanced states.
        """
        return self._frequencies(self.full.motor_joints(motors))

    def _frequencies(self, joints: Sequence[str]) -> Array:
        equations, basis = self._second_order
        rows = self.full.joint_rows(joints) @ basis
        free = kernel(rows, 1.0 / np.sqrt(np.diag(equations.mass)))
        return motions(equations.within(free), free).frequencies

    def poles(self) -> Complex:
        """Poles, by magnitude [rad/s]."""
        found = np.asarray(scipy.linalg.eigvals(self.A), dtype=complex)
        return found[np.argsort(np.abs(found), kind="stable")]

    def zeros(self, inputs: Sequence[str] | None = None, outputs: Sequence[str] | None = None) -> Complex:
        """Transmission zeros between some inputs and some outputs, by default all: see `LinearModel.zeros`."""
        balance = scipy.linalg.matrix_balance(self.A, permute=False, separate=True)
        scaled, size = balance[0], np.asarray(balance[1][0])
        columns, rows = numbers_of(inputs, self.inputs, "input"), numbers_of(outputs, self.outputs, "output")
        B, C = self.B[:, columns] / size[:, None], self.C[rows] * size
        return zeros(StateSpace(scaled, B, C, self.D[np.ix_(rows, columns)]), 0.7 * self.full.low_frequency)

    @checked_arguments()
    def frequency_response(self, frequencies: ArrayLike) -> Complex:
        """Response C (s - A)^-1 B + D (k, outputs, inputs): see `LinearModel.frequency_response`."""
        points = places_in_s(frequencies)
        eye = np.eye(len(self.A))
        return np.array([self.C @ np.linalg.solve(s * eye - self.A, self.B) + self.D for s in points])

    @checked_arguments()
    def error(self, frequencies: ArrayLike, outputs: Sequence[str] | None = None) -> Array:
        """Largest gain of the error over the largest gain of the full model (k,), at each frequency.

        Parameters
        ----------
        frequencies : (k,) array
            Angular frequencies [rad/s], or complex s.
        outputs : sequence of str, optional
            Of one unit; all by default.
        """
        rows = numbers_of(outputs, self.outputs, "output")
        full = self.full.frequency_response(frequencies)[:, rows]
        few = self.frequency_response(frequencies)[:, rows]
        return np.linalg.norm(few - full, 2, axis=(1, 2)) / np.linalg.norm(full, 2, axis=(1, 2))

    def to_scipy(self) -> scipy.signal.StateSpace:
        """The model as SciPy's."""
        return scipy.signal.StateSpace(*self.state_space)

    def to_control(self) -> Any:
        """The model as python-control's: see `LinearModel.to_control`."""
        return control_model(self.full.mechanism, self.state_space, self._names)

    def to_xarray(self) -> xr.Dataset:
        """A, B, C and D by names of states, inputs and outputs, with units."""
        full = self.full
        attrs = {
            "mechanism": full.mechanism, "mode": full.mode, "about": full.about, "time": full.time,
            "method": self.method.value, **({} if self.bound is None else {"bound": self.bound}),
        }  # fmt: skip
        return labelled_model(self.state_space, self._names, attrs)

    @property
    def _names(self) -> Names:
        return Names(self.states, self.inputs, self.outputs)


@checked_arguments()
@solvable("a reduced model")
def reduce(
    model: LinearModel,
    states: int = 16,
    *,
    method: ReductionMethod | str = ReductionMethod.CRAIG_BAMPTON,
    feed_through: bool = True,
) -> ReducedModel:
    """A linear model of few states that stands for one of many.

    Parameters
    ----------
    model : LinearModel
        As `linearise` makes it.
    states : int
        How many are kept; even but for balanced truncation.
    method : str
        "craig-bampton": static shapes of all motors' coordinates, whatever the mode, and vibrations with all motors
        held. "rubin": these static shapes, and shapes with which the lowest modes with motors free are exact. "modal":
        these modes alone. "balanced": what inputs move and outputs see most of the stable part, with a bound of the
        error.
    feed_through : bool
        What is left out bends as forces and inertia forces want it, so that torques have places, angles and strains
        jump a little (`D`). Without, these are combinations of the states. Balanced states have no such part.

    Raises
    ------
    InputError
        Fewer states than motors, or more than the model has; a mechanism without flexible links; balanced truncation of
        a mechanism without damping.
    """
    method, most = as_enum(ReductionMethod, method, "method"), len(model.states)
    if not any(body.nf for body in model.minimal.system.bodies):
        raise InputError(
            "has rigid links only, so that no state can be left out", field="model", value=model.mechanism,
            remedy="give it flexible links",
        )  # fmt: skip
    if not 1 <= states <= most:
        raise InputError("no such number of states", field="states", value=states, remedy=f"choose one up to {most}")
    if method is ReductionMethod.BALANCED:
        found = balanced(model.scaled, states, model.low_frequency)
        there, back = model.modal_states
        left, right = found.left @ there, back @ found.right
        space = StateSpace(left @ model.A @ right, left @ model.B, model.C @ right, model.D)
        names = tuple(Variable(f"balanced{k + 1}", "1") for k in range(len(left)))
        return ReducedModel(model, method, names, space, hankel=found.hankel, bound=found.bound)
    if states % 2:
        raise InputError(
            "is odd, but every coordinate brings its rate", field="states", value=states, remedy=f"say {states + 1}"
        )
    basis, names = _basis(model, states // 2, method)
    rates = tuple(Variable(f"{one.name}_rate", f"{one.unit}/s") for one in names)
    space = _projected(model, basis, feed_through)
    return ReducedModel(model, method, (*names, *rates), space, basis=basis.shapes)


def _basis(model: LinearModel, count: int, method: ReductionMethod) -> tuple[Basis, tuple[Variable, ...]]:
    """So many coordinates, and their names."""
    equations = model.second_order
    stiffness = 0.5 * (equations.stiffness + equations.stiffness.T)
    if method is ReductionMethod.MODAL:
        basis = lowest_modes(equations.mass, stiffness, count, equations.typical)
        return basis, tuple(Variable(f"mode{k + 1}", "m kg^0.5") for k in range(count))
    joints = list(dict.fromkeys(motor.joint for motor in model.minimal.system.mechanism.motors))
    rows = model.joint_rows(joints)
    kept = independent_rows(rows, 1.0 / np.sqrt(np.diag(equations.mass)))
    if count < len(kept):
        raise InputError(
            f"are fewer than the {2 * len(kept)} of the coordinates of {len(kept)} motors and their rates",
            field="states", value=2 * count, remedy=f"keep at least {2 * len(kept)}, better {2 * len(kept) + 8}",
        )  # fmt: skip
    mechanism = model.minimal.system.mechanism
    names = [Variable(joints[k], "m" if mechanism.joint(joints[k]).slides else "rad") for k in kept]
    names += [Variable(f"held_mode{k + 1}", "m kg^0.5") for k in range(count - len(kept))]
    make = rubin if method is ReductionMethod.RUBIN else craig_bampton
    return make(equations.mass, stiffness, rows[kept], count - len(kept), equations.typical), tuple(names)


def _projected(model: LinearModel, basis: Basis, feed_through: bool) -> StateSpace:
    """The equations in y = T z; outputs see y = T z + G (F u - K T z - D T z' - M T z''), F u the forces of inputs.

    With the flexibility G vibrations that are left out bend as forces and inertia forces want it, without being states
    (mode acceleration, Craig 1981): so bent, accelerations T z'' and constraint forces are in balance. Without
    feed-through this is left out where outputs are places, angles and strains.
    """
    T, f, k = basis.shapes, len(basis.shapes), basis.shapes.shape[1]
    equations = model.second_order
    full = np.hstack([model.A[f:, :f] @ T, model.A[f:, f:] @ T, model.B[f:]])
    few = scipy.linalg.solve(T.T @ equations.mass @ T, T.T @ equations.mass @ full)
    bent = basis.flexibility @ equations.mass @ (full - T @ few)
    outputs = np.hstack([model.C[:, :f] @ T, model.C[:, f:] @ T, model.D]) + model.C[:, :f] @ bent
    if not feed_through:
        outputs -= model.place_outputs @ bent
    A = np.vstack([np.eye(k, 2 * k, k), few[:, : 2 * k]])
    B = np.vstack([np.zeros((k, few.shape[1] - 2 * k)), few[:, 2 * k :]])
    return StateSpace(A, B, outputs[:, : 2 * k], outputs[:, 2 * k :])
