"""Deflections of bodies along a planned motion, and the errors of the end-effector's position without them.

At an instant of the rigid motion the forces f = -(M a + h) of inertia, loads and motors are in balance. They deflect
the mechanism, undeformed in its nominal pose, by x, the sum of phi (phi^T f) / omega^2 over the elastic vibrations of
the pose: among solutions of K x + Phi_q^T mu = f that differ by free motions, the one without momentum. A force at the
end-effector is balanced by the inertia of the free motion that it causes (inertia relief). In large mechanisms x
follows from (K + e M) x + Phi_q^T mu = f, with a multiple e of the mass that is small against the stiffness, and the
vibrations are the best combinations of deflections under the loads, and under the inertia of these: load-dependent Ritz
vectors (Wilson, Yuan and Dickens 1982, Earthquake Eng. Struct. Dyn. 10, 813-821).

Let the shapes of bodies hold deflections but for parts eta of their strain energy. The end-effector then deviates from
its position with all shapes by four errors of first order in eta, which are averaged over poses and added up. T is the
duration, L the length of the path, m an effective mass of the free motion at the end-effector.

- Static: x misses x^T K w, with w the deflection under a unit force at the end-effector. Of this product at most
  sqrt(x^T K x w^T K w) (eta_x + eta_w) / 2 is missing, body by body.
- Forces on the free motion: x changes them by g^T K_t x, with g the free motion by a unit force at the end-effector and
  K_t the tangent stiffness of the motion. After T they have moved the end-effector by T^2 / 2 times that; what is
  missing follows as above, with w under the forces K_t^T g T^2 / 2.
- Phase of vibrations: a frequency is too high by at most its eta / 2 (Rayleigh's quotient). A vibration by which a unit
  force deflects the end-effector by c swings by c p, with the amplitude p of vibration in the response to the forces.
  After T its phase is wrong by omega T eta / 2, which displaces the end-effector by two swings at most.
- Energy of vibrations: it follows their frequency (an adiabatic invariant) at the expense of the free motion. An error
  U eta / 2 of the energy U = p^2 / 2 moves the end-effector by T^2 U eta / (2 m L) at most.

The constants are estimates, not bounds: `benchmarks/reduced_runs.py` compares them with runs.
"""

from functools import cached_property
from itertools import pairwise
from typing import NamedTuple

import numpy as np
import scipy
from scipy.sparse import csr_matrix as Sparse

from paraflex.arrays import Array, Mask
from paraflex.dynamics import System, acting_loads, inputs_of, joint_coordinate, steep_times, still_signals
from paraflex.dynamics.linearise import DENSE_COORDINATES, all_modes, typical_square
from paraflex.dynamics.points import marker_place
from paraflex.dynamics.sparse import Saddle, elastic_stiffness, sparse_jacobian, sparse_mass, stiffness_diagonal
from paraflex.dynamics.tangents import MotionPoint, Tangency
from paraflex.integrators.run import jump_times
from paraflex.kernel.bodies import motion_forces
from paraflex.kernel.packed import make_scratch
from paraflex.mechanism import ActuationMode
from paraflex.mechanism.actuation_modes import check_torques
from paraflex.tracking import TrackingTask, undeformed_at

# Largest number of instants whose forces act in each pose.
_INSTANTS = 8
# Multiple of the mass, relative to the squared lowest frequency of any body: its relative effect on a deflection.
_FREE = 1e-6
# Deflections under forces, and twice those under their own inertia.
_LEVELS = 3
# Combinations of deflections with less than this part of the strain energy are rounding.
_INDEPENDENT = 1e-9


class PlannedDeflections:
    """Deflections of bodies along a task's planned motion.

    Parameters
    ----------
    task : TrackingTask
        Task with all flexible coordinates.
    poses : int
        Number of poses, evenly spaced along the path without its ends.

    Attributes
    ----------
    task : TrackingTask
        Task.
    samples : list of int
        Numbers of the poses, among the task's sample times.
    """

    def __init__(self, task: TrackingTask, poses: int) -> None:
        system, motion, effector = task.system, task.motion, task.mechanism.end_effector
        assert effector is not None
        self.task: TrackingTask = task
        self._motion = undeformed_at(system, motion, list(range(motion.t.size)))
        last = int(np.searchsorted(motion.t, task.path.duration, side="right")) - 1
        self.samples: list[int] = np.unique(np.linspace(0, last, poses + 2).astype(int)[1:-1]).tolist()
        places, rows = marker_place(system, system.marker(effector.point), self._motion[0])
        self._rows: Array = rows[self.samples]
        travel = float(np.sum(np.linalg.norm(np.diff(places, axis=0), axis=1)))
        self._length: float = travel or system.size
        self._structures = [_Structure(system, pose) for pose in self._motion[0][self.samples]]
        self._tangency = Tangency(system)

    def loading(self, mode: ActuationMode) -> "Loading":
        """Return the forces along the plan with the torques of a mode.

        Raises
        ------
        ActuationError, SingularActuationError
            The mode cannot drive the mechanism along the path.
        """
        check_torques(mode, "the choice of few coordinates", self.task.mechanism.motors)
        system, times, (q, v, a) = self.task.system, self.task.motion.t, self._motion
        torques, forces = self.task.torques(mode).evaluate(times), np.zeros_like(q)
        loads = acting_loads(system.mechanism, times)
        motion_forces(system.packed, q, v, a, loads, forces, make_scratch(system.packed))
        for motor, torque in zip(system.mechanism.motors, torques.T, strict=True):
            forces -= torque[:, None] * joint_coordinate(system, motor.joint, q).rows
        loads[:, : torques.shape[1]] = torques
        return Loading(-forces, loads)

    def under(self, loading: "Loading") -> Array:
        """Return the static deflections (poses, n) under a loading."""
        return self._displacements(loading.forces[self.samples][:, None])

    def of_end_effector(self) -> Array:
        """Return the static deflections (2 poses, n) under unit forces at the end-effector along x and y."""
        return self._displacements(self._rows)

    def _displacements(self, forces: Array) -> Array:
        pairs = zip(self._structures, forces, strict=True)
        return np.concatenate([structure.static_displacements(acting) for structure, acting in pairs])

    def with_inertia(self, statics: Array) -> Array:
        """Return static deflections (k poses, n), and those under their own inertia, scaled to a vibration's.

        These are load-dependent Ritz vectors, which tend to the lowest vibrations that the forces excite.
        """
        second = []
        for structure, x in zip(
            self._structures, statics.reshape(len(self.samples), -1, statics.shape[1]), strict=True
        ):
            inertia = structure.inertia(x)
            moving, stored = np.sum(x * inertia, axis=1), structure.energy_roots(x) ** 2
            squares = np.divide(stored, moving, out=np.zeros_like(stored), where=moving > 0.0)
            second.append(squares[:, None] * structure.static_displacements(inertia))
        return np.concatenate([statics, *second])

    def contributions(self, loading: "Loading") -> "Contributions":
        """Return deflections under a loading, and vibrations by it, with the deviations that they cause."""
        times = self.task.motion.t
        # Between two poses the forces act in the nearer one.
        bounds = [0, *((one + other) // 2 + 1 for one, other in pairwise(self.samples)), times.size]
        found, half = [], (times[-1] - times[0]) ** 2 / 2.0
        for rows, structure, sample, (begin, end) in zip(
            self._rows, self._structures, self.samples, pairwise(bounds), strict=True
        ):
            instants = np.unique(np.linspace(begin, end - 1, _INSTANTS).astype(int))
            at_effector, free = structure.static_displacements(rows), structure.free_displacements(rows)
            acting = loading.forces[instants]
            statics = structure.static_displacements(acting)
            turned = free @ self._tangent_stiffness(sample, loading, structure)
            drift = structure.static_displacements(half * turned)
            found.append(self._products(statics, np.concatenate([at_effector, drift]), instants.size))
            units, omega = structure.vibrations(np.concatenate([statics, at_effector]))
            vibrating = _vibrating(times, loading.forces @ units.T, omega, self._jumping)
            swing = np.linalg.norm(rows @ units.T, axis=0) * vibrating
            found.append(Contributions(units, swing * omega * (times[-1] - times[0]) / 2.0, 2.0 * swing))
            pushed = np.linalg.norm(rows @ free.T, 2) * half * vibrating**2 / (2.0 * self._length)
            found.append(Contributions(units, pushed, pushed))
        deflections, slopes, caps = (np.concatenate(parts) for parts in zip(*found, strict=True))
        return Contributions(deflections, slopes / len(self._structures), caps / len(self._structures))

    @cached_property
    def _jumping(self) -> Mask:
        """Mask of the intervals between samples that hold a jump of a load or end with one, or hold a steep rise."""
        mechanism, times = self.task.mechanism, self.task.motion.t
        signals, knots = still_signals(mechanism, float(times[-1]))
        jumps = jump_times(signals, inputs_of(mechanism), np.array(knots))
        rises = np.setdiff1d(steep_times(mechanism, float(times[-1])), jumps)
        ends = [*np.searchsorted(times, jumps), *np.searchsorted(times, rises, side="right")]
        return np.isin(np.arange(1, times.size), ends)

    def _tangent_stiffness(self, sample: int, loading: "Loading", structure: "_Structure") -> Sparse:
        """Return the derivative (n, n) of the equations of motion by the coordinates, at constant multipliers."""
        q, v, a = (part[sample] for part in self._motion)
        lam = structure.multipliers(loading.forces[sample])
        point = MotionPoint(float(self.task.motion.t[sample]), q, v, a, lam, loading.acting[sample])
        return self._tangency.stiffness(point)

    def _products(self, statics: Array, others: Array, number: int) -> "Contributions":
        """Return deflections (k, n) and (l, n) body by body, for the mean of the products of each with all others."""
        found = []
        for body in self.task.system.bodies:
            parts = [np.zeros_like(each) for each in (statics, others)]
            for part, each in zip(parts, (statics, others), strict=True):
                part[:, body.flexible] = each[:, body.flexible]
            sizes = [np.sqrt(part[:, body.flexible] ** 2 @ body.modes.omega**2) for part in parts]
            for part, own, partners in zip(parts, sizes, sizes[::-1], strict=True):
                nonzero = own > 0.0
                slopes = own[nonzero] * np.sum(partners) / (2.0 * number)
                found.append(Contributions(part[nonzero] / own[nonzero, None], slopes, slopes))
        return Contributions(*(np.concatenate(parts) for parts in zip(*found, strict=True)))


def _vibrating(times: Array, forces: Array, omega: Array, jumping: Mask) -> Array:
    """Return the part of modal forces (samples, f) that vibrates, as its largest amplitude (f,).

    Vibrations begin at jumps of the forces, which are given by the intervals (samples - 1,) that hold one, and at each
    change of their slope: elsewhere forces are linear between samples.
    """
    changes = np.diff(forces, axis=0)
    jumps = np.where(jumping[:, None], changes, 0.0)
    slopes = (changes - jumps) / np.diff(times)[:, None]
    kinks = np.concatenate([slopes[:1], np.diff(slopes, axis=0)]) / omega
    cosines, sines = np.cos(turns := np.outer(times[:-1], omega)), np.sin(turns)
    swings = kinks * cosines + jumps * sines, jumps * cosines - kinks * sines
    swings[1][0] += forces[0]
    return np.max(np.hypot(*np.cumsum(swings, axis=1)), axis=0, initial=0.0)


class Loading(NamedTuple):
    """Forces along a plan, in balance, that deflect the mechanism.

    Attributes
    ----------
    forces : (samples, n) array
        Forces of inertia, loads and motors.
    acting : (samples, acting) array
        Torques of motors, then loads in time: see `dynamics.inputs`.
    """

    forces: Array
    acting: Array


class Contributions(NamedTuple):
    """Deflections, and the deviations of the end-effector that their omission causes.

    Attributes
    ----------
    deflections : (k, n) array
        Deflections x of the coordinates, with x^T K x = 1.
    slopes, caps : (k,) arrays
        Deviation of the end-effector if a part of that energy is missing: slope times part, at most the cap [m].
    """

    deflections: Array
    slopes: Array
    caps: Array


class _Structure:
    """Elastic equations of a pose; displacements and forces are rows (any, n)."""

    def __init__(self, system: System, q: Array) -> None:
        elastic = stiffness_diagonal(system)
        self._mass = sparse_mass(system, q)
        self._stiffness = elastic_stiffness(system, q, every_spring=True)
        self._jacobian = Sparse(system.jacobian(q)) if system.n <= DENSE_COORDINATES else sparse_jacobian(system, q)
        self._rigid, self._m = elastic == 0.0, system.m
        typical = typical_square(elastic, self._stiffness, self._mass)
        # All vibrations of a mechanism that is not large, with x^T K x = 1, and its free motions of unit mass.
        self._modes: tuple[Array, Array] | None = None
        if system.n <= DENSE_COORDINATES:
            squares, shapes = all_modes(self._stiffness, self._mass, self._jacobian, elastic, typical)
            moving = squares > 0.0
            self._free: Array = shapes[:, ~moving].T
            self._modes = shapes[:, moving].T / np.sqrt(squares[moving])[:, None], np.sqrt(squares[moving])
            return
        self._little = _FREE * typical
        shifted = scipy.sparse.csr_matrix(self._stiffness + self._little * self._mass)
        self._saddle = Saddle(shifted, self._jacobian)

    def static_displacements(self, forces: Array) -> Array:
        """Return static displacements under forces that the inertia of free motions balances."""
        if self._modes is not None:
            units, _ = self._modes
            return forces @ units.T @ units
        # Under unbalanced forces nearly all of this is free motion, whose inertia holds the mechanism in place.
        return self._displacements(forces - self._little * self.inertia(self._displacements(forces)))

    def _displacements(self, forces: Array) -> Array:
        return self._saddle.solve(forces.T, np.zeros((self._m, len(forces))))[0].T

    def inertia(self, displacements: Array) -> Array:
        """Return the products of displacements with the mass matrix."""
        return (self._mass @ displacements.T).T

    def free_displacements(self, forces: Array) -> Array:
        """Return accelerations of free motion by forces."""
        if self._modes is not None:
            return forces @ self._free.T @ self._free
        return self._little * self._displacements(forces)

    def multipliers(self, force: Array) -> Array:
        """Return the multipliers (m,) of rows that bear a force (n,) which is in balance, bodies being rigid."""
        rows = self._jacobian.toarray()[:, self._rigid]
        return np.linalg.lstsq(rows.T, force[self._rigid], rcond=None)[0]

    def energy_roots(self, displacements: Array) -> Array:
        """Return the square roots of twice the strain energies of displacements."""
        return np.sqrt(np.maximum(0.0, np.sum(displacements.T * (self._stiffness @ displacements.T), axis=0)))

    def vibrations(self, statics: Array) -> tuple[Array, Array]:
        """Return shapes (f, n) with x^T K x = 1, and angular frequencies (f,), of vibrations.

        These are all, or in a large mechanism the best in the space of the static displacements under the loads and of
        those under the inertia of these.
        """
        if self._modes is not None:
            return self._modes
        levels = [statics]
        for _ in range(_LEVELS - 1):
            levels.append(self.static_displacements(self.inertia(levels[-1])))
            levels[-1] /= np.maximum(self.energy_roots(levels[-1]), np.finfo(float).tiny)[:, None]
        together = np.concatenate(levels)
        sizes = self.energy_roots(together)
        together = together[sizes > 0.0] / sizes[sizes > 0.0, None]
        energies, mixed = np.linalg.eigh(together @ (self._stiffness @ together.T))
        kept = energies > _INDEPENDENT * np.max(energies, initial=0.0)
        together = (mixed[:, kept] / np.sqrt(energies[kept])).T @ together
        squares, mixed = np.linalg.eigh(together @ (self._mass @ together.T))
        moving = squares > 0.0
        return mixed.T[moving] @ together, 1.0 / np.sqrt(squares[moving])
