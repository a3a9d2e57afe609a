"""Mechanism with reduced flexible coordinates, chosen for a planned motion or from runs.

Deflections u of a body, in modes of unit mass and frequencies omega, have the strain energy |omega u|^2 / 2. The
singular value decomposition of omega u over all deflections gives directions and their shares of the energy (proper
orthogonal decomposition). The directions with the largest shares are kept, over all bodies together.
"""

from collections.abc import Sequence
from dataclasses import replace
from typing import NamedTuple

import numpy as np

from paraflex.arguments import checked_arguments
from paraflex.arrays import Array
from paraflex.dynamics import State, System, dependence
from paraflex.dynamics.sparse import stiffness_diagonal
from paraflex.errors import ActuationError, InputError, SingularActuationError
from paraflex.mechanism import ActuationMode, Mechanism, mode_of_motors
from paraflex.motion import MotionRun
from paraflex.tracking import TrackingRun, TrackingTask
from .deflections import PlannedDeflections

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
