"""Linear models of mechanisms: poles, zeros, frequency responses, and the same for other programs."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from functools import cached_property
from typing import Any

import numpy as np
import scipy
from numpy.typing import ArrayLike, NDArray
from scipy.sparse import csr_matrix

from paraflex.arguments import checked_arguments
from paraflex.arrays import Array
from paraflex.dynamics.joint_coordinates import joint_coordinate
from paraflex.dynamics.linearise import slowest, typical_square, undamped_modes
from paraflex.dynamics.sensors import SensorRows
from paraflex.dynamics.sparse import stiffness_diagonal
from paraflex.errors import InputError
from paraflex.linear.bases import kernel
from paraflex.linear.coordinates import Variable
from paraflex.linear.descriptor import poles_near, response_at
from paraflex.linear.minimal import Minimal
from paraflex.linear.motions import Motions, SecondOrder, driven_equations, modal_damping, motions
from paraflex.linear.named import NamedModel, not_at_poles, numbers_of, places_in_s
from paraflex.linear.zeros import StateSpace, Vibrating, by_size, vibrating_zeros, zeros

Complex = NDArray[np.complex128]
# Stiffness is symmetric at rest but for this part of it.
_SYMMETRIC = 1e-7
# With more degrees of freedom sparse matrices are faster than dense ones.
_DENSE_FREEDOMS = 200


@dataclass(frozen=True)
class LinearModel(NamedModel):
    """Small changes of a mechanism's motion: x' = A x + B u, y = C x + D u.

    States are minimal coordinates and then their rates: angles and travels of the joints with motors, elastic
    coordinates of bodies (of unit modal mass in their body), coordinates that are driven. No pole belongs to a
    constraint. All are changes from the point of the motion the model is about.

    Attributes
    ----------
    mechanism, mode : str
    about : str
        What the model is about: "a pose at rest", "static equilibrium", "a planned motion", "a run".
    unbalanced : float
        Of a pose at rest: what the mechanism would start with if let go [m/s^2]; forces that do not change hold it.
    states, inputs, outputs : tuple of Variable
        Names and units.
    minimal : Minimal
        The equations that it was made from.
    rows : SensorRows
        How the outputs depend on the motion.
    wanted : (inputs, outputs) tuple of arrays of int
        Which inputs of `minimal` and which of `rows` these are.
    """

    mechanism: str
    mode: str
    about: str
    unbalanced: float
    states: tuple[Variable, ...]
    inputs: tuple[Variable, ...]
    outputs: tuple[Variable, ...]
    minimal: Minimal
    rows: SensorRows
    wanted: tuple[NDArray[np.int64], NDArray[np.int64]]

    def __repr__(self) -> str:
        return f"LinearModel({self.title}: {len(self.states)} states)"

    @property
    def title(self) -> str:
        """Which mechanism it is of, in which mode, and what it is about."""
        return f"{self.mechanism}, mode {self.mode}, about {self.about}"

    @property
    def time(self) -> float:
        """Time of the point of the motion [s]."""
        return self.minimal.point.time

    @property
    def at_rest(self) -> bool:
        """Whether it is about a pose at rest."""
        return self.minimal.point.at_rest

    @cached_property
    def A(self) -> Array:
        """State matrix (2f, 2f)."""
        second, f = self.minimal.changes.second, len(self.states) // 2
        return np.vstack([np.eye(f, 2 * f, f), second[:, : 2 * f]])

    @cached_property
    def B(self) -> Array:
        """Input matrix (2f, inputs)."""
        second = self.minimal.changes.second[:, len(self.states) :][:, self.wanted[0]]
        return np.vstack([np.zeros_like(second), second])

    @cached_property
    def C(self) -> Array:
        """Output matrix (outputs, 2f)."""
        return self._outputs[0]

    @cached_property
    def D(self) -> Array:
        """Feed-through (outputs, inputs): of accelerations, strains and forces."""
        return self._outputs[1]

    @property
    def state_space(self) -> StateSpace:
        """A, B, C and D."""
        return StateSpace(self.A, self.B, self.C, self.D)

    @cached_property
    def _outputs(self) -> tuple[Array, Array]:
        changes, n = self.minimal.changes, len(self.states)
        rows = SensorRows(*(part[self.wanted[1]] for part in self.rows))
        whole = rows.a @ changes.a + rows.multipliers @ changes.multipliers
        motors = self.minimal.motors
        whole[:, n : n + motors.size] += rows.torques.toarray()[:, motors]
        return whole[:, :n] + rows.q @ changes.q + rows.v @ changes.v, whole[:, n:][:, self.wanted[0]]

    @property
    def place_outputs(self) -> Array:
        """What outputs (outputs, f) are of the coordinates y, but for accelerations, constraint forces and torques."""
        changes, f = self.minimal.changes, len(self.states) // 2
        rows = SensorRows(*(part[self.wanted[1]] for part in self.rows))
        return rows.q @ changes.q[:, :f] + rows.v @ changes.v[:, :f]

    # --- Properties ---------------------------------------------------------------------------------------------------

    @cached_property
    def _reduced(self) -> tuple[Array, Array, Array]:
        """Mass, damping and stiffness (f, f) in the minimal coordinates; of a motion without terms of its rates."""
        Z, whole, minimal = self.minimal.directions, self.minimal.tangents.whole, self.minimal
        parts = Z.T @ (whole.mass @ Z), Z.T @ (whole.damping @ Z), Z.T @ (whole.stiffness @ Z)
        last = minimal.chosen.joints.size
        return driven_equations(*parts, np.arange(last - minimal.driven, last)) if minimal.driven else parts

    @cached_property
    def _typical(self) -> float:
        """Square of a low frequency [rad^2/s^2], by which frequencies are measured."""
        whole = self.minimal.tangents.whole
        return typical_square(stiffness_diagonal(self.minimal.system), whole.stiffness, whole.mass)

    @property
    def low_frequency(self) -> float:
        """A low frequency, by which others are measured [rad/s]."""
        return float(np.sqrt(self._typical))

    @cached_property
    def _modes(self) -> tuple[Array, Array]:
        """Squares of the undamped frequencies (f,), ascending, and shapes (f, f) of unit mass, in the coordinates y."""
        return self._undamped(np.eye(len(self.states) // 2))

    def _undamped(self, basis: Array) -> tuple[Array, Array]:
        """Squares and shapes of the undamped modes in the motions y of a basis (f, free)."""
        mass, _, stiffness = (basis.T @ part @ basis for part in self._reduced)
        return undamped_modes(mass, 0.5 * (stiffness + stiffness.T), self._typical)

    @cached_property
    def _is_vibrating(self) -> bool:
        """Whether it is a mechanism at rest whose stiffness derives from a potential."""
        stiffness = self._reduced[2]
        size = np.linalg.norm(stiffness)
        return self.at_rest and bool(np.linalg.norm(stiffness - stiffness.T) <= _SYMMETRIC * size)

    @cached_property
    def _modal_damping(self) -> Array:
        """Damping (f, f) of the undamped modes."""
        return modal_damping(self._reduced[1], self._modes[1])

    @cached_property
    def modal_states(self) -> tuple[Array, Array]:
        """States in undamped modes of unit mass from states, and the reverse, (2f, 2f) each.

        Displacements are multiplied by their frequencies. The sum of squares is twice the energy;
        what is free has a low frequency in place of zero.
        """
        shapes, omega = self._modes[1], self._modal_sizes
        inverse = shapes.T @ self._reduced[0]
        there = scipy.linalg.block_diag(omega[:, None] * inverse, inverse)
        return there, scipy.linalg.block_diag(shapes / omega, shapes)

    @property
    def _modal_sizes(self) -> Array:
        """By what displacements of undamped modes (f,) are multiplied in `modal_states` [rad/s]."""
        return np.sqrt(np.maximum(self._modes[0], 0.0) + self._typical)

    @cached_property
    def scaled(self) -> StateSpace:
        """The model in modes of its mass and stiffness, whose displacements are multiplied by their frequencies."""
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
        """Undamped natural frequencies (f,), inputs zero [rad/s]; zero for motions that are free or grow."""
        return np.sqrt(np.maximum(self._modes[0], 0.0))

    @cached_property
    def shapes(self) -> Array:
        """Changes of all coordinates of the system (n, f) in the undamped modes, of unit modal mass."""
        return self.minimal.directions @ self._modes[1]

    @checked_arguments()
    def held_frequencies(self, motors: Sequence[str] | None = None) -> Array:
        """Undamped natural frequencies with motors held [rad/s].

        Parameters
        ----------
        motors : sequence of str, optional
            By default all that are inputs.

        Raises
        ------
        InputError
            A motor that the mechanism does not have.
        """
        return np.sqrt(np.maximum(self._undamped(self._held(motors))[0], 0.0))

    @checked_arguments()
    def held_compliance(self, point: str, motors: Sequence[str] | None = None) -> Array:
        """Displacement (2, 2) of a point along x and y under unit forces there along x and y, motors held [m/N].

        Parameters
        ----------
        point : str
            One of the `forces` of the model.
        motors : sequence of str, optional
            That are held: by default all that are inputs.
        """
        forces = self.select([f"{point}.{axis}" for axis in ("x", "y")])._force_rows
        basis = self._held(motors)
        moved = basis.T @ forces
        return np.asarray(moved.T @ scipy.linalg.solve(basis.T @ self._reduced[2] @ basis, moved))

    def _held(self, motors: Sequence[str] | None) -> Array:
        """Basis (f, free) of the motions with motors held, by default all that are inputs."""
        return kernel(self.joint_rows(self.motor_joints(motors)), 1.0 / np.sqrt(np.diag(self._reduced[0])))

    @checked_arguments()
    def motor_joints(self, motors: Sequence[str] | None = None) -> list[str]:
        """Joints of motors, by default of all that are inputs.

        Raises
        ------
        InputError
            A motor that the mechanism does not have.
        """
        joints = {motor.name: motor.joint for motor in self.minimal.system.mechanism.motors}
        names = [one.name for one in self.inputs if one.name in joints] if motors is None else motors
        for name in names:
            if name not in joints:
                raise InputError("is no motor", field="motors", value=name, remedy="choose from " + ", ".join(joints))
        return [joints[name] for name in names]

    @checked_arguments()
    def joint_rows(self, joints: Sequence[str]) -> Array:
        """Changes of joints' coordinates (h, f) with the coordinates y."""
        q, Z = self.minimal.point.q[None], self.minimal.directions
        rows = [joint_coordinate(self.minimal.system, joint, q).rows[0] @ Z for joint in joints]
        return np.array(rows).reshape(-1, Z.shape[1])

    @checked_arguments()
    def poles(self, count: int | None = None) -> Complex:
        """Poles (2f,), by magnitude [rad/s].

        Parameters
        ----------
        count : int, optional
            Only so many of the slowest: with more than 200 degrees of freedom these are found without A.
        """
        return self._slow_poles(count) if count is not None and self._is_large else self.motions().poles[:count]

    @checked_arguments()
    def motions(self, held: Sequence[str] = ()) -> Motions:
        """Undamped modes and poles, with their shapes in all coordinates of the system.

        Parameters
        ----------
        held : sequence of str
            Motors that are held; of motors that move only as others do, one is enough.

        Raises
        ------
        InputError
            A motor that the mechanism does not have.
        """
        basis = self._held(held)
        return motions(self.second_order.within(basis), self.minimal.directions @ basis)

    @cached_property
    def second_order(self) -> SecondOrder:
        """The equations with inputs zero; of a motion with the terms of its rates."""
        mass, damping, stiffness = self._reduced
        if not self._is_vibrating:
            f = mass.shape[0]
            stiffness, damping = -mass @ self.A[f:, :f], -mass @ self.A[f:, f:]
        return SecondOrder(mass, damping, stiffness, self._typical, self._is_vibrating)

    @property
    def frozen(self) -> SecondOrder:
        """The equations of which `frequencies` are: of a motion without the terms of its rates."""
        return SecondOrder(*self._reduced, self._typical, self._is_vibrating)

    def _slow_poles(self, count: int) -> Complex:
        """The slowest poles by sparse matrices."""
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
        """Transmission zeros between some inputs and some outputs, by default all, by magnitude [rad/s].

        Of any number of each: more inputs than outputs, or fewer, mostly have none. At rest, and of outputs that are
        places, angles or derivatives of these, they are found from the second-order equations, else from
        the state space, and up to a tenth of the fastest pole. Where the response has a smaller rank than inputs or
        outputs, as of motors at geared joints, they are the s at which it loses more; a response that is zero has none.
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
        """Forces of the inputs in the directions of the coordinates y (f, inputs)."""
        return self._reduced[0] @ self.B[len(self.states) // 2 :]

    @property
    def _displacements(self) -> Array | None:
        """What outputs (outputs, f) are of y, or derivatives of that; None where one is more than that."""
        rows = SensorRows(*(part[self.wanted[1]] for part in self.rows))
        parts = [np.asarray(part @ self.minimal.directions) for part in (rows.q, rows.v, rows.a)]
        mixed = np.sum([np.any(part, axis=1) for part in parts], axis=0) != 1
        if np.any(mixed) or rows.multipliers.nnz or rows.torques.nnz or self.minimal.driven:
            return None
        return np.sum(parts, axis=0)

    @checked_arguments()
    def frequency_response(self, frequencies: ArrayLike) -> Complex:
        """Response C (s - A)^-1 B + D (k, outputs, inputs).

        With more than 200 degrees of freedom from sparse equations at each frequency, without A.

        Parameters
        ----------
        frequencies : (k,) array
            Angular frequencies omega, for s = i omega [rad/s]; complex numbers are taken as s.

        Raises
        ------
        InputError
            A pole, where the response is infinite.
        """
        points = places_in_s(frequencies)
        out = np.empty((points.size, len(self.outputs), len(self.inputs)), dtype=complex)
        if self._is_large:
            rows = SensorRows(*(part[self.wanted[1]] for part in self.rows))
            for k, s in enumerate(points):
                with not_at_poles(s):
                    out[k] = response_at(self.minimal, rows, self.wanted[0], s)
            return out
        A, B, C, D = self.scaled
        upper, basis = scipy.linalg.schur(A, output="complex")
        inputs, outputs, eye = basis.conj().T @ B, C @ basis, np.eye(len(A))
        for k, s in enumerate(points):
            with not_at_poles(s):
                out[k] = outputs @ scipy.linalg.solve_triangular(s * eye - upper, inputs) + D
        return out

    @property
    def _is_large(self) -> bool:
        """Whether sparse matrices are faster."""
        return len(self.states) > 2 * _DENSE_FREEDOMS

    # --- The same in other forms --------------------------------------------------------------------------------------

    @checked_arguments()
    def select(self, inputs: Sequence[str] | None = None, outputs: Sequence[str] | None = None) -> LinearModel:
        """The model with some inputs and outputs, in the order given; all by default."""
        chosen = [numbers_of(named, have, what) for named, have, what in
                  ((inputs, self.inputs, "input"), (outputs, self.outputs, "output"))]  # fmt: skip
        return replace(
            self,
            inputs=tuple(self.inputs[k] for k in chosen[0]),
            outputs=tuple(self.outputs[k] for k in chosen[1]),
            wanted=(self.wanted[0][chosen[0]], self.wanted[1][chosen[1]]),
        )

    @property
    def _attributes(self) -> dict[str, Any]:
        return {"mechanism": self.mechanism, "mode": self.mode, "about": self.about, "time": self.time}
