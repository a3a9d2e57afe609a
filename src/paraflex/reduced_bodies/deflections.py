"""Deflections along a planned motion without a run: static deflections under its inertia, loads and torques.

At an instant of the rigid motion the forces -(M a + h) of inertia, loads and motors are in balance. They deflect the
mechanism, undeformed in its nominal pose, by

    (K + e M) x + Phi_q^T mu = f,    Phi_q x = 0

with a multiple e of the mass that is small against the stiffness: among solutions that differ by free motions, x is the
one without momentum. A force at the end-effector is balanced by the inertia of the free motion that it causes (inertia
relief).

Bodies also vibrate. Each x is complemented by the deflection y under its own inertia, with M x in place of f, times x^T
K x / x^T M x: load-dependent Ritz vectors (Wilson, Yuan and Dickens 1982, Earthquake Eng. Struct. Dyn. 10, 813-821),
which tend to the lowest modes that the forces excite.
"""

from collections.abc import Iterable

import numpy as np
import scipy

from paraflex.arrays import Array
from paraflex.dynamics import System, acting_loads, joint_coordinate
from paraflex.dynamics.linearise import typical_square
from paraflex.dynamics.points import marker_place
from paraflex.dynamics.sparse import Saddle, elastic_stiffness, sparse_jacobian, sparse_mass, stiffness_diagonal
from paraflex.kernel.bodies import motion_forces
from paraflex.kernel.packed import make_scratch
from paraflex.mechanism import ActuationMode
from paraflex.tracking import TrackingTask, undeformed_at

# Number of instants of the motion along the path.
_INSTANTS = 12
# Multiple of the mass, relative to the squared lowest frequency of any body: its relative effect on a deflection.
_FREE = 1e-6


class PlannedDeflections:
    """Static deflections (k, n) of bodies at instants of a task's planned motion.

    Attributes
    ----------
    samples : list of int
        Numbers of the instants among the task's sample times.
    """

    def __init__(self, task: TrackingTask) -> None:
        motion = task.motion
        self.task: TrackingTask = task
        self.samples: list[int] = _instants(motion.t, task.path.duration)
        self._q, self._v, self._a = undeformed_at(task.system, motion, self.samples)
        self._structures = [_Structure(task.system, pose) for pose in self._q]

    def of_mode(self, mode: ActuationMode) -> Array:
        """Return deflections (2 instants, n) by a mode's torques, inertia and loads, then by their own inertia.

        Raises
        ------
        ActuationError, SingularActuationError
            The mode cannot drive the mechanism along the path.
        """
        system, times = self.task.system, self.task.motion.t[self.samples]
        torques, forces = self.task.torques(mode).evaluate(times), np.zeros_like(self._q)
        loads, scratch = acting_loads(system.mechanism, times), make_scratch(system.packed)
        motion_forces(system.packed, self._q, self._v, self._a, loads, forces, scratch)
        for motor, torque in zip(system.mechanism.motors, torques.T, strict=True):
            forces -= torque[:, None] * joint_coordinate(system, motor.joint, self._q).rows
        return _ritz_vectors(zip(self._structures, -forces, strict=True))

    def of_end_effector(self) -> Array:
        """Return deflections (4 instants, n) by unit end-effector forces along x and y, then by their own inertia.

        They deflect bodies in proportion to the effect of these deflections on the end-effector's position.
        """
        system = self.task.system
        effector = system.mechanism.end_effector
        assert effector is not None
        rows = marker_place(system, system.marker(effector.point), self._q)[1]
        pairs = zip(self._structures, rows, strict=True)
        return _ritz_vectors((each, row) for each, pair in pairs for row in pair)


def _instants(t: Array, end: float) -> list[int]:
    """Return samples evenly spaced within the motion along the path, without its ends."""
    last = int(np.searchsorted(t, end, side="right")) - 1
    return np.unique(np.linspace(0, last, _INSTANTS + 2).astype(int)[1:-1]).tolist()


class _Structure:
    """Factorised equations of a pose."""

    def __init__(self, system: System, q: Array) -> None:
        self.mass = sparse_mass(system, q)
        stiffness = elastic_stiffness(system, q, every_spring=True)
        self.elastic = stiffness_diagonal(system)
        self._little = _FREE * typical_square(self.elastic, stiffness, self.mass) * self.mass
        self._saddle = Saddle(scipy.sparse.csr_matrix(stiffness + self._little), sparse_jacobian(system, q))

    def static_displacements(self, force: Array) -> Array:
        """Return static displacements (n,) under forces (n,) that the inertia of free motions balances."""
        # Under unbalanced forces nearly all of this is free motion, whose inertia holds the mechanism in place.
        moved = self._saddle.solve(force)[0]
        return self._saddle.solve(force - self._little @ moved)[0]


def _ritz_vectors(loaded: Iterable[tuple[_Structure, Array]]) -> Array:
    """Return static displacements under forces, then under their own inertia, scaled to the same size (2 k, n)."""
    first, second = [], []
    for structure, force in loaded:
        x = structure.static_displacements(force)
        inertia = structure.mass @ x
        moving = x @ inertia
        first.append(x)
        second.append(
            (x**2 @ structure.elastic / moving if moving > 0.0 else 0.0) * structure.static_displacements(inertia)
        )
    return np.array(first + second)
