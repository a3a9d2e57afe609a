"""Linear models of mechanisms: state space, poles, zeros and frequency responses."""

from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace
from functools import cached_property, partial
from typing import Any

import numpy as np
import scipy
from scipy.sparse import csr_matrix

from paraflex.arguments import checked_arguments
from paraflex.arrays import Array, Complex, Indices
from paraflex.dynamics import SensorRows, joint_coordinate
from paraflex.dynamics.linearise import slowest, typical_square, undamped_modes
from paraflex.dynamics.sparse import stiffness_diagonal
from paraflex.dynamics.state_space import StateSpace
from paraflex.mechanism.quantities import all_listed
from .bases import kernel
from .coordinates import Variable, numbers_of
from .descriptor import poles_near, response_at
from .minimal import MinimalEquations
from .motions import Motions, SecondOrder, driven_equations, modal_damping, motions
from .named import NamedModel
from .zeros import Vibrating, by_size, vibrating_zeros, zeros

# Admissible relative asymmetry of a stiffness matrix that is regarded as symmetric.
_SYMMETRIC = 1e-7
# Sparse matrices are faster than dense ones with more degrees of freedom.
_DENSE_FREEDOMS = 200


@dataclass(frozen=True)
class LinearModel(NamedModel):
    """Linear state-space model of a mechanism: x' = A x + B u, y = C x + D u.

    The states are minimal coordinates and then their rates: angles and travels of the joints with motors, elastic
    coordinates of bodies (of unit modal mass in their body), and driven coordinates. There are no poles of constraints.
    All variables are deviations from the operating point.

    Attributes
    ----------
    mechanism, mode : str
        Names of the mechanism and of the actuation mode.
    about : str
        Operating point: "a pose at rest", "static equilibrium", "a planned motion" or "a run".
    unbalanced : float
        Initial acceleration of the mechanism if released from a pose at rest [m/s^2]; the model contains constant
        forces that hold it.
    states, inputs, outputs : tuple of Variable
        Names and units of states, inputs and outputs.
    minimal : MinimalEquations
        Linearised equations in minimal coordinates.
    rows : SensorRows
        Derivatives of the outputs, which are sensor readings, with respect to the motion.
    selected : array of int
        Indices of the model's inputs in `minimal`.
    """

    mechanism: str
    mode: str
    about: str
    unbalanced: float
    states: tuple[Variable, ...]
    inputs: tuple[Variable, ...]
    outputs: tuple[Variable, ...]
    minimal: MinimalEquations
    rows: SensorRows
    selected: Indices

    def __repr__(self) -> str:
        return f"LinearModel({self.title}: {len(self.states)} states)"

    @property
    def title(self) -> str:
        """Mechanism, actuation mode and operating point of the model, as a text."""
        return f"{self.mechanism}, mode {self.mode}, about {self.about}"

    @property
    def time(self) -> float:
        """Time of the operating point [s]."""
        return self.minimal.point.time

    @property
    def at_rest(self) -> bool:
        """Whether the operating point is a pose at rest."""
        return self.minimal.point.at_rest

    @cached_property
    def state_space(self) -> StateSpace:
        """State-space matrices A, B, C and D."""
        changes, rows, motors, n = self.minimal.changes, self.rows, self.minimal.motors, len(self.states)
        outputs = rows.a @ changes.a + rows.multipliers @ changes.multipliers
        outputs[:, n : n + motors.size] += rows.torques.toarray()[:, motors]
        forced = changes.second[:, n:][:, self.selected]
        return StateSpace(
            A=np.vstack([np.eye(n // 2, n, n // 2), changes.second[:, :n]]),
            B=np.vstack([np.zeros_like(forced), forced]),
            C=outputs[:, :n] + rows.q @ changes.q + rows.v @ changes.v,
            D=outputs[:, n:][:, self.selected],
        )

    @property
    def place_outputs(self) -> Array:
        """Output matrix (outputs, f) of the coordinates y, without accelerations, constraint forces and torques."""
        changes, f = self.minimal.changes, len(self.states) // 2
        return self.rows.q @ changes.q[:, :f] + self.rows.v @ changes.v[:, :f]

    # --- Properties ---------------------------------------------------------------------------------------------------

    @cached_property
    def _reduced(self) -> tuple[Array, Array, Array]:
        """Mass, damping and stiffness (f, f) in minimal coordinates, without terms of the rates of a motion."""
        Z, whole, minimal = self.minimal.directions, self.minimal.tangents.whole, self.minimal
        parts = Z.T @ (whole.mass @ Z), Z.T @ (whole.damping @ Z), Z.T @ (whole.stiffness @ Z)
        last = minimal.chosen.joints.size
        return driven_equations(*parts, np.arange(last - minimal.driven, last)) if minimal.driven else parts

    @cached_property
    def _typical(self) -> float:
        """Square of a typical low frequency, the scale of frequencies [rad^2/s^2]."""
        whole = self.minimal.tangents.whole
        return typical_square(stiffness_diagonal(self.minimal.system), whole.stiffness, whole.mass)

    @property
    def low_frequency(self) -> float:
        """Typical low frequency, the scale of frequencies [rad/s]."""
        return float(np.sqrt(self._typical))

    @cached_property
    def _modes(self) -> tuple[Array, Array]:
        """Squares of the undamped frequencies (f,), ascending, and mode shapes of unit mass (f, f) in coordinates y."""
        return self._undamped(np.eye(len(self.states) // 2))

    def _undamped(self, basis: Array) -> tuple[Array, Array]:
        """Compute squared frequencies and shapes of the undamped modes in the subspace of a basis (f, free)."""
        mass, _, stiffness = (basis.T @ part @ basis for part in self._reduced)
        return undamped_modes(mass, 0.5 * (stiffness + stiffness.T), self._typical)

    @cached_property
    def _is_vibrating(self) -> bool:
        """Whether the operating point is at rest and the stiffness symmetric, hence derived from a potential."""
        stiffness = self._reduced[2]
        size = np.linalg.norm(stiffness)
        return self.at_rest and bool(np.linalg.norm(stiffness - stiffness.T) <= _SYMMETRIC * size)

    @cached_property
    def _modal_damping(self) -> Array:
        """Damping matrix (f, f) in the undamped modes."""
        return modal_damping(self._reduced[1], self._modes[1])

    @cached_property
    def modal_states(self) -> tuple[Array, Array]:
        """Transformation of states to undamped modes of unit mass, and its inverse, (2f, 2f) each.

        Modal displacements are multiplied by their frequencies, with a low frequency in place of zero for rigid
        motions. The sum of squares of the transformed states is twice the energy.
        """
        shapes, omega = self._modes[1], self._modal_sizes
        inverse = shapes.T @ self._reduced[0]
        there = scipy.linalg.block_diag(omega[:, None] * inverse, inverse)
        return there, scipy.linalg.block_diag(shapes / omega, shapes)

    @property
    def _modal_sizes(self) -> Array:
        """Scale factors (f,) of the modal displacements in `modal_states` [rad/s]."""
        return np.sqrt(np.maximum(self._modes[0], 0.0) + self._typical)

    @cached_property
    def scaled(self) -> StateSpace:
        """State-space matrices in the scaled modal states of `modal_states`."""
        there, back = self.modal_states
        if self._is_vibrating:
            omega, f = self._modal_sizes, self._modes[0].size
            place = -np.diag(self._modes[0] / omega)
            A = np.block([[np.zeros((f, f)), np.diag(omega)], [place, -self._modal_damping]])
        else:
            A = there @ self.A @ back
        return StateSpace(A, there @ self.B, self.C @ back, self.D)

    @cached_property
    def frequencies(self) -> Array:
        """Undamped natural frequencies (f,) with zero inputs [rad/s]; zero for free and unstable motions."""
        return np.sqrt(np.maximum(self._modes[0], 0.0))

    @cached_property
    def shapes(self) -> Array:
        """Undamped mode shapes of unit modal mass (n, f) in all coordinates of the system."""
        return self.minimal.directions @ self._modes[1]

    @checked_arguments()
    def held_frequencies(self, motors: Sequence[str] | None = None) -> Array:
        """Compute the undamped natural frequencies with motors held [rad/s].

        Parameters
        ----------
        motors : sequence of str, optional
            Names of the motors held; by default all that are inputs.

        Raises
        ------
        InputError
            The mechanism does not have a motor.
        """
        return np.sqrt(np.maximum(self._undamped(self._held(motors))[0], 0.0))

    @checked_arguments()
    def held_compliance(self, point: str, motors: Sequence[str] | None = None) -> Array:
        """Compute the compliance (2, 2) of a point along x and y with motors held [m/N].

        Parameters
        ----------
        point : str
            Point whose forces are inputs of the model, see `forces` of `linearise`.
        motors : sequence of str, optional
            Names of the motors held; by default all that are inputs.
        """
        forces = self.select([f"{point}.{axis}" for axis in ("x", "y")])._force_rows
        basis = self._held(motors)
        moved = basis.T @ forces
        return np.asarray(moved.T @ scipy.linalg.solve(basis.T @ self._reduced[2] @ basis, moved))

    def _held(self, motors: Sequence[str] | None) -> Array:
        """Return a basis (f, free) of the motions with motors held, by default all that are inputs."""
        return kernel(self.joint_rows(self.motor_joints(motors)), 1.0 / np.sqrt(np.diag(self._reduced[0])))

    @checked_arguments()
    def motor_joints(self, motors: Sequence[str] | None = None) -> list[str]:
        """Return the joints of motors, by default of all that are inputs.

        Raises
        ------
        InputError
            The mechanism does not have a motor.
        """
        joints = {motor.name: motor.joint for motor in self.minimal.system.mechanism.motors}
        names = [one.name for one in self.inputs if one.name in joints] if motors is None else motors
        all_listed(names, joints, "motors", "is not a motor")
        return [joints[name] for name in names]

    @checked_arguments()
    def joint_rows(self, joints: Sequence[str]) -> Array:
        """Return the derivatives (h, f) of joint coordinates with respect to the coordinates y."""
        q, Z = self.minimal.point.q[None], self.minimal.directions
        rows = [joint_coordinate(self.minimal.system, joint, q).rows[0] @ Z for joint in joints]
        return np.array(rows).reshape(-1, Z.shape[1])

    @checked_arguments()
    def poles(self, count: int | None = None) -> Complex:
        """Compute the poles (2f,), sorted by magnitude [rad/s].

        Parameters
        ----------
        count : int, optional
            Number of slowest poles to return, by default all. With a number and more than 200 degrees of freedom the
            poles are computed from sparse matrices, without A.
        """
        return self._slow_poles(count) if count is not None and self._is_large else self.motions().poles[:count]

    @checked_arguments()
    def motions(self, held: Sequence[str] = ()) -> Motions:
        """Compute undamped modes and poles, with their shapes in all coordinates of the system.

        Parameters
        ----------
        held : sequence of str
            Names of the motors held, by default none; one of several kinematically coupled motors is enough.

        Raises
        ------
        InputError
            The mechanism does not have a motor.
        """
        basis = self._held(held)
        return motions(self.second_order.within(basis), self.minimal.directions @ basis)

    @cached_property
    def second_order(self) -> SecondOrder:
        """Second-order equations with zero inputs, including the terms of the rates of a motion."""
        mass, damping, stiffness = self._reduced
        if not self._is_vibrating:
            f = mass.shape[0]
            stiffness, damping = -mass @ self.A[f:, :f], -mass @ self.A[f:, f:]
        return SecondOrder(mass, damping, stiffness, self._typical, self._is_vibrating)

    @property
    def frozen(self) -> SecondOrder:
        """Second-order equations of `frequencies`, without the terms of the rates of a motion."""
        return SecondOrder(*self._reduced, self._typical, self._is_vibrating)

    def _slow_poles(self, count: int) -> Complex:
        """Compute the slowest poles from sparse matrices."""
        whole, driven = self.minimal.tangents.whole, self.minimal.driven
        slow = slowest(
            csr_matrix(0.5 * (whole.stiffness + whole.stiffness.T)), whole.mass, self.minimal.held_rows.jacobian,
            self._typical, count, self.minimal.chosen.freedoms - driven,
        )  # fmt: skip
        uneven = scipy.sparse.linalg.norm(whole.stiffness - whole.stiffness.T)
        vibrates = self.at_rest and uneven <= _SYMMETRIC * scipy.sparse.linalg.norm(whole.stiffness)
        if vibrates and not np.any(whole.damping.data):
            root = np.sqrt(-slow.squares.astype(complex))
            return by_size(np.concatenate([np.zeros(2 * driven, dtype=complex), root, -root]))[:count]
        found = by_size(poles_near(self.minimal, np.sqrt(slow.shift), count + 2))
        free = (slow.squares == 0.0) & ~np.any(whole.damping @ slow.shapes, axis=0) & vibrates
        found[: 2 * (int(free.sum()) + (driven if vibrates else 0))] = 0.0
        return found[:count]

    def zeros(self, inputs: Sequence[str] | None = None, outputs: Sequence[str] | None = None) -> Complex:
        """Compute the transmission zeros between inputs and outputs, by default all, sorted by magnitude [rad/s].

        A model with different numbers of inputs and outputs usually has no zeros. At rest, and for outputs that are
        positions, angles or derivatives of these, zeros are computed from the second-order equations; otherwise from
        the state space, up to a tenth of the fastest pole. If the rank of the response is less than the number of
        inputs or outputs at every s, as for motors at geared joints, zeros are the s at which the rank is smaller
        still; a response of zero has none.
        """
        chosen = self.select(inputs, outputs)
        shift = 0.7 * self.low_frequency
        displacements = chosen._displacements if self._is_vibrating else None
        if displacements is None:
            return zeros(chosen.scaled, shift)
        squares, shapes = chosen._modes
        return vibrating_zeros(
            Vibrating(squares, chosen._modal_damping, shapes.T @ chosen._force_rows, displacements @ shapes), shift
        )

    @property
    def _force_rows(self) -> Array:
        """Generalised forces (f, inputs) of the inputs in the coordinates y."""
        return self._reduced[0] @ self.B[len(self.states) // 2 :]

    @property
    def _displacements(self) -> Array | None:
        """Output matrix (outputs, f) of y, or of one derivative of y per output; None if an output is more general."""
        rows = self.rows
        parts = [np.asarray(part @ self.minimal.directions) for part in (rows.q, rows.v, rows.a)]
        mixed = np.sum([np.any(part, axis=1) for part in parts], axis=0) != 1
        if np.any(mixed) or rows.multipliers.nnz or rows.torques.nnz or self.minimal.driven:
            return None
        return np.sum(parts, axis=0)

    @property
    def _response(self) -> Callable[[complex], Complex]:
        """Response as a function of s: of a large model from sparse equations at each s, without A."""
        if self._is_large:
            return partial(response_at, self.minimal, self.rows, self.selected)
        return self.scaled.triangular().at

    @property
    def _is_large(self) -> bool:
        """Whether the model is so large that sparse matrices are faster."""
        return len(self.states) > 2 * _DENSE_FREEDOMS

    # --- Other forms of the model -------------------------------------------------------------------------------------

    @checked_arguments()
    def select(self, inputs: Sequence[str] | None = None, outputs: Sequence[str] | None = None) -> "LinearModel":
        """Return the model with the named inputs and outputs, in the order given; by default all."""
        chosen = [numbers_of(named, have, what) for named, have, what in
                  ((inputs, self.inputs, "input"), (outputs, self.outputs, "output"))]  # fmt: skip
        return replace(
            self,
            inputs=tuple(self.inputs[k] for k in chosen[0]),
            outputs=tuple(self.outputs[k] for k in chosen[1]),
            rows=SensorRows(*(part[chosen[1]] for part in self.rows)),
            selected=self.selected[chosen[0]],
        )

    @property
    def _attributes(self) -> dict[str, Any]:
        return {"mechanism": self.mechanism, "mode": self.mode, "about": self.about, "time": self.time}
