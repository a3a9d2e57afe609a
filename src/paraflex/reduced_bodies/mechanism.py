"""Mechanism with reduced flexible coordinates, chosen for a planned motion or from runs.

Deflections u of a body, in modes of unit mass and frequencies omega, have the strain energy |omega u|^2 / 2. The
singular value decomposition of omega u over all deflections gives directions and their shares of the energy (proper
orthogonal decomposition). The directions with the largest shares are kept, over all bodies together.

Deflections along a planned motion are computed without a run. At an instant of the rigid motion the forces
-(M a + h) of inertia, loads and motors are in balance. They deflect the mechanism, undeformed in its nominal pose, by

    (K + e M) x + Phi_q^T mu = f,    Phi_q x = 0

with a multiple e of the mass that is small against the stiffness: among solutions that differ by free motions, x is the
one without momentum. A force at the end-effector is balanced by the inertia of the free motion that it causes (inertia
relief).

Bodies also vibrate. Each x is complemented by the deflection y under its own inertia, with M x in place of f, times x^T
K x / x^T M x: load-dependent Ritz vectors (Wilson, Yuan and Dickens 1982, Earthquake Eng. Struct. Dyn. 10, 813-821),
which tend to the lowest modes that the forces excite.
"""

from collections.abc import Iterable, Sequence
from dataclasses import replace
from typing import NamedTuple

import numpy as np
import scipy

from paraflex.arguments import checked_arguments
from paraflex.arrays import Array
from paraflex.dynamics import State, System, acting_loads, dependence, joint_coordinate
from paraflex.dynamics.linearise import typical_square
from paraflex.dynamics.points import marker_place
from paraflex.dynamics.sparse import Saddle, elastic_stiffness, sparse_jacobian, sparse_mass, stiffness_diagonal
from paraflex.errors import ActuationError, InputError, SingularActuationError
from paraflex.kernel.bodies import motion_forces
from paraflex.kernel.packed import make_scratch
from paraflex.mechanism import ActuationMode, Mechanism, mode_of_motors
from paraflex.motion import MotionRun
from paraflex.tracking import TrackingRun, TrackingTask, undeformed_at

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


# Directions with less than this fraction of the largest root of energy are rounding.
_ROUNDING = 1e-10


@checked_arguments()
def reduced_mechanism(
    along: TrackingTask | TrackingRun | MotionRun | Sequence[TrackingRun | MotionRun],
    coordinates: int = 16,
    *,
    modes: Sequence[str | ActuationMode] | None = None,
) -> Mechanism:
    """Return the mechanism with few flexible coordinates in total; equations, joints and geometry are unchanged.

    The kept shapes are those with the most strain energy: in static deflections under inertia, loads and torques of a
    planned motion, so that no run is needed; or in runs (proper orthogonal decomposition). Deflections under forces at
    the end-effector have the same weight, as they show what moves it. A body that hardly deflects keeps no shapes. The
    mechanism suits motions like the given one: `TrackingTask.remodelled` applies the plan to it, `simulate_motion`
    accepts it.

    Parameters
    ----------
    along : TrackingTask, or one or several runs
        Planned motion, or runs of one mechanism, for which the reduction is chosen.
    coordinates : int
        Number of flexible coordinates kept, over all bodies together.
    modes : sequence of str or ActuationMode, optional
        Actuation modes of a plan; by default those of the mechanism, or all motors. A mode that cannot drive the
        mechanism along the path is left out, unless no mode can.

    Returns
    -------
    Mechanism
        Reduced mechanism.

    Raises
    ------
    InputError
        All bodies are rigid; the number of coordinates is out of range or above the number of directions in the motion;
        runs are of several mechanisms; or modes are given with runs.
    ActuationError, SingularActuationError
        No mode can drive the mechanism along the path.
    """
    if isinstance(along, TrackingTask):
        return _along_plan(along, coordinates, modes)
    if modes is not None:
        raise InputError("are those of the runs", field="modes", value=modes, remedy="leave them out")
    return _from_runs([along] if isinstance(along, TrackingRun | MotionRun) else list(along), coordinates)


def _along_plan(task: TrackingTask, count: int, modes: Sequence[str | ActuationMode] | None) -> Mechanism:
    mechanism, planned = task.mechanism, PlannedDeflections(task)
    chosen = modes or mechanism.modes or [mode_of_motors(mechanism, [motor.name for motor in mechanism.motors])]
    driven, refused = [], None
    for mode in chosen:
        try:
            driven.append(planned.of_mode(task.mode(mode)))
        except (ActuationError, SingularActuationError) as error:
            refused = error
    if refused is not None and not driven:
        raise refused
    groups = [normalised_by_energy(task.system, driven), planned.of_end_effector()]
    return replace(mechanism, bases=bases_of(task.system, groups, count))


def _from_runs(runs: Sequence[TrackingRun | MotionRun], count: int) -> Mechanism:
    """Reduce by proper orthogonal decomposition of the runs, and of forces at the end-effector along a path."""
    systems = [run.task.system if isinstance(run, TrackingRun) else run.system for run in runs]
    if not systems or any(system.mechanism != systems[0].mechanism for system in systems):
        raise InputError("are not of one mechanism", field="along", remedy="give one or several runs of one")
    groups = [normalised_by_energy(systems[0], [run.solution.q for run in runs])]
    groups += [PlannedDeflections(run.task).of_end_effector() for run in runs[:1] if isinstance(run, TrackingRun)]
    return replace(systems[0].described, bases=bases_of(systems[0], groups, count))


def bases_of(system: System, deflections: Sequence[Array], count: int) -> dict[str, tuple[tuple[float, ...], ...]]:
    """Return reduced flexible coordinates (own, kept) of every flexible body, in those of its reference condition.

    Parameters
    ----------
    system : System
        System with all flexible coordinates.
    deflections : sequence of (k, n) arrays
        Coordinates of the system; all arrays have equal weight by their strain energy.
    count : int
        Number of coordinates kept, over all bodies together.

    Raises
    ------
    InputError
        The count exceeds the number of flexible coordinates, or of independent directions in the deflections.
    """
    if not system.n_flexible:
        raise InputError("has rigid bodies only", field="mechanism", value=system.mechanism.name,
                         remedy="give it flexible ones")  # fmt: skip
    if not 1 <= count <= system.n_flexible:
        raise InputError(
            "no such number of flexible coordinates", field="coordinates", value=count,
            remedy=f"from 1 to {system.n_flexible}",
        )  # fmt: skip
    together = normalised_by_energy(system, deflections)
    found = []
    for body in system.bodies:
        energies = body.modes.omega * together[:, body.flexible]
        directions, sizes, _ = np.linalg.svd(energies.T, full_matrices=False)
        shapes = body.modes.vectors @ (directions / body.modes.omega[:, None])
        found += [(size, body.name, shapes[:, k]) for k, size in enumerate(sizes.tolist())]
    # Equal directions keep the order of their bodies.
    kept = sorted(found, key=lambda one: -one[0])[:count]
    if not kept or kept[-1][0] <= _ROUNDING * kept[0][0]:
        known = sum(size > _ROUNDING * kept[0][0] for size, _, _ in found) if kept else 0
        raise InputError(
            f"are more than the {known} directions in which the motion bends the bodies", field="coordinates",
            value=count, remedy=f"keep at most {known}" if known else "it does not bend them at all",
        )  # fmt: skip
    return {
        body.name: _rows([shape for _, name, shape in kept if name == body.name], len(body.modes.vectors))
        for body in system.bodies
        if body.nf
    }


def normalised_by_energy(system: System, parts: Sequence[Array]) -> Array:
    """Scale deflections (k, n) to one unit of strain energy in total, with equal shares of each part (any, n)."""
    stiffness = stiffness_diagonal(system)
    energies = [np.sum(part**2 @ stiffness) for part in parts]
    bent = [part / np.sqrt(energy) for part, energy in zip(parts, energies, strict=True) if energy > 0.0]
    return np.concatenate([np.zeros((0, system.n)), *bent]) / np.sqrt(max(1, len(bent)))


def _rows(shapes: list[Array], own: int) -> tuple[tuple[float, ...], ...]:
    return tuple(map(tuple, np.array(shapes).T.tolist())) if shapes else ((),) * own


class Size(NamedTuple):
    """Number of flexible coordinates of a system, and of states of its motion at a pose."""

    flexible_coordinates: int
    states: int


def size_of(system: System, state: State) -> Size:
    """Return the size of a system at a state; the states are twice the degrees of freedom."""
    return Size(system.n_flexible, 2 * (system.n - dependence(system, state.q).rank))
