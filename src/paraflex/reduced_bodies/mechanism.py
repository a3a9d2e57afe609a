"""Mechanism with reduced flexible coordinates, chosen for a planned motion or from runs.

Deflections u of a body, in modes of unit mass and frequencies omega, have the strain energy |omega u|^2 / 2. The
singular value decomposition of omega u over all deflections gives directions and their shares of the energy (proper
orthogonal decomposition). The directions with the largest shares are kept, over all bodies together.

Deflections of a planned motion need no run: see `planned`. If they are weighted by the errors of the end-effector's
position that their omission causes, the shares of the omitted directions add up to an estimate of this error.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace
from typing import NamedTuple

import numpy as np

from paraflex.arguments import checked_arguments
from paraflex.arrays import Array, brief
from paraflex.dynamics import State, System, dependence
from paraflex.dynamics.sparse import stiffness_diagonal
from paraflex.errors import ActuationError, InputError, SingularActuationError
from paraflex.mechanism import ActuationMode, Mechanism, mode_of_motors
from paraflex.motion import MotionRun
from paraflex.tracking import TrackingRun, TrackingTask
from .planned import Contributions, Loading, PlannedDeflections

# Directions with less than this fraction of the largest root of energy are rounding.
_ROUNDING = 1e-10
# Numbers of poses along a path: for a number of coordinates, and for an estimated deviation.
_POSES, _POSES_OF_ESTIMATE = 12, 6
# Decompositions, each with weights that follow from the one before.
_PASSES = 3
# In place of the number of coordinates: as few as the tolerance allows.
AUTO = "auto"
# Number of coordinates kept if neither it nor a deviation is given.
_COORDINATES = 16


@checked_arguments()
def reduced_mechanism(
    along: TrackingTask | TrackingRun | MotionRun | Sequence[TrackingRun | MotionRun],
    coordinates: int | None = None,
    *,
    modes: Sequence[str | ActuationMode] | None = None,
    deviation: float | None = None,
) -> Mechanism:
    """Return the mechanism with few flexible coordinates in total; equations, joints and geometry are unchanged.

    The kept shapes are those with the most strain energy: in static deflections under inertia, loads and torques of a
    planned motion, so that no run is needed; or in runs (proper orthogonal decomposition). Deflections under forces at
    the end-effector have the same weight, as they show what moves it. With a deviation they are those without which the
    planned motion would deviate most, see `planned_reduction`. A body that hardly deflects keeps no shapes. The
    mechanism suits motions like the given one: `TrackingTask.remodelled` applies the plan to it, `simulate_motion`
    accepts it.

    Parameters
    ----------
    along : TrackingTask, or one or several runs
        Planned motion, or runs of one mechanism, for which the reduction is chosen.
    coordinates : int, optional
        Number of flexible coordinates kept, over all bodies together; 16 if no deviation is given either.
    modes : sequence of str or ActuationMode, optional
        Actuation modes of a plan; by default those of the mechanism, or all motors. A mode that cannot drive the
        mechanism along the path is left out, unless no mode can.
    deviation : float, optional
        Estimated deviation of the end-effector, along a plan, from its positions with all coordinates [m]: as few
        coordinates are kept as it allows. A mechanism of rigid bodies is returned unchanged.

    Returns
    -------
    Mechanism
        Reduced mechanism.

    Raises
    ------
    InputError
        All bodies are rigid; the number of coordinates is out of range or above the number of directions in the motion;
        runs are of several mechanisms; modes or a deviation are given with runs; or both a number and a deviation.
    ActuationError, SingularActuationError
        No mode can drive the mechanism along the path.
    """
    count = _COORDINATES if coordinates is None else coordinates
    if isinstance(along, TrackingTask):
        if deviation is None:
            return _along_plan(along, count, modes)
        if coordinates is not None:
            raise InputError("determines the number of coordinates", field="deviation", value=deviation,
                             remedy="give one of both")  # fmt: skip
        return planned_reduction(along, deviation, modes=modes).mechanism
    if modes is not None:
        raise InputError("are those of the runs", field="modes", value=modes, remedy="leave them out")
    if deviation is not None:
        raise InputError("is estimated for a plan, not for runs", field="deviation", value=deviation,
                         remedy="leave it out, or give the task")  # fmt: skip
    return _from_runs([along] if isinstance(along, TrackingRun | MotionRun) else list(along), count)


def _along_plan(task: TrackingTask, count: int, modes: Sequence[str | ActuationMode] | None) -> Mechanism:
    _check_flexible(task.system)
    planned = PlannedDeflections(task, _POSES)
    driven = [planned.with_inertia(planned.under(loading)) for loading in _loadings(planned, modes)]
    groups = [_normalised(task.system, driven), planned.with_inertia(planned.of_end_effector())]
    return _with_directions(task.system, groups, count)


def _loadings(planned: PlannedDeflections, modes: Sequence[str | ActuationMode] | None) -> list[Loading]:
    """Return the loadings of the modes that can drive the mechanism along the path, at least of one."""
    mechanism = planned.task.mechanism
    chosen = modes or mechanism.modes or [mode_of_motors(mechanism, [motor.name for motor in mechanism.motors])]
    driven, refused = [], None
    for mode in chosen:
        try:
            driven.append(planned.loading(planned.task.mode(mode)))
        except (ActuationError, SingularActuationError) as error:
            refused = error
    if refused is not None and not driven:
        raise refused
    return driven


def _from_runs(runs: Sequence[TrackingRun | MotionRun], count: int) -> Mechanism:
    """Reduce by proper orthogonal decomposition of the runs, and of forces at the end-effector along a path."""
    systems = [run.task.system if isinstance(run, TrackingRun) else run.system for run in runs]
    if not systems or any(system.mechanism != systems[0].mechanism for system in systems):
        raise InputError("are not of one mechanism", field="along", remedy="give one or several runs of one")
    _check_flexible(systems[0])
    groups = [_normalised(systems[0], [run.solution.q for run in runs])]
    for run in runs[:1]:
        if isinstance(run, TrackingRun):
            planned = PlannedDeflections(run.task, _POSES)
            groups.append(planned.with_inertia(planned.of_end_effector()))
    return _with_directions(systems[0], groups, count)


def _with_directions(system: System, groups: Sequence[Array], count: int) -> Mechanism:
    """Return the mechanism with the directions of most energy in groups of deflections of equal weight."""
    found = _directions(system, _normalised(system, groups))
    return replace(system.described, bases=_bases(system, found[: _checked_count(system, found, count)]))


def reduced_task(
    task: TrackingTask, reduced: int | str, tolerance: float, modes: Sequence[str | ActuationMode] | None
) -> tuple[TrackingTask, Reduction | None]:
    """Return the task with a number of coordinates, or with `AUTO` as few as a tolerance allows [m].

    `AUTO` does not change a task of rigid bodies; otherwise it also returns the reduction with its estimate.
    """
    if reduced != AUTO:
        return task.remodelled(reduced_mechanism(task, int(reduced), modes=modes)), None
    if not task.system.n_flexible:
        return task, None
    reduction = planned_reduction(task, tolerance, modes=modes)
    return task.remodelled(reduction.mechanism), reduction


class Reduction(NamedTuple):
    """Mechanism with few flexible coordinates for a planned motion.

    Attributes
    ----------
    mechanism : Mechanism
        Reduced mechanism.
    full : TrackingTask
        Task with all flexible coordinates.
    deviation : float
        Estimated deviation of the end-effector from its positions with all coordinates [m].
    energy : float
        Largest strain energy of static deflections along the plan [J], which the estimate assumes.
    """

    mechanism: Mechanism
    full: TrackingTask
    deviation: float
    energy: float
    __repr__ = brief


@checked_arguments()
def planned_reduction(
    task: TrackingTask, deviation: float, *, modes: Sequence[str | ActuationMode] | None = None
) -> Reduction:
    """Return the reduction of a plan's mechanism to as few coordinates as an estimated deviation allows.

    Parameters
    ----------
    task, deviation, modes
        See `reduced_mechanism`, also for the errors.
    """
    if not (np.isfinite(deviation) and deviation > 0.0):
        raise InputError("is not a positive length", field="deviation", value=deviation,
                         remedy="give a length in metres, say 1e-5")  # fmt: skip
    if not task.system.n_flexible:
        return Reduction(task.mechanism, task, 0.0, 0.0)
    planned = PlannedDeflections(task, _POSES_OF_ESTIMATE)
    driven = _loadings(planned, modes)
    found, left = _fewest_directions(task.system, [planned.contributions(each) for each in driven], deviation)
    energies = [planned.under(loading) ** 2 @ stiffness_diagonal(task.system) / 2.0 for loading in driven]
    mechanism = replace(task.mechanism, bases=_bases(task.system, found))
    return Reduction(mechanism, task, left, float(np.max(energies)))


def _fewest_directions(
    system: System, modes: Sequence[Contributions], deviation: float
) -> tuple[list[_Direction], float]:
    """Return the fewest directions with an estimated deviation in all modes, and their largest one [m].

    The error due to a deflection is limited by its cap: further shapes for a vibration that cannot be kept in phase are
    of little use. The weights of each decomposition are therefore the slopes between zero and the errors that remain
    with the directions of the one before.
    """
    every = Contributions(*(np.concatenate(parts) for parts in zip(*modes, strict=True)))
    begins = np.cumsum([0, *(one.slopes.size for one in modes[:-1])])
    weights, kept, left = every.slopes, [], 0.0
    for _ in range(_PASSES):
        found = _directions(system, np.sqrt(weights)[:, None] * every.deflections)
        roots = np.array([every.deflections[:, one.coordinates] @ one.energies for one in found]).T
        parts = np.cumsum(np.column_stack([np.zeros(len(roots)), roots**2]), axis=1)
        parts = np.maximum(0.0, parts[:, -1:] - parts)
        each = np.add.reduceat(np.minimum(every.slopes[:, None] * parts, every.caps[:, None]), begins, axis=0)
        missed = np.max(each, axis=0)
        kept = found[: min(max(1, int(np.argmax(missed <= deviation))), _independent(found))]
        left = float(missed[len(kept)])
        weights = np.minimum(every.slopes, every.caps / np.maximum(parts[:, len(kept)], np.finfo(float).tiny))
    return kept, left


class _Direction(NamedTuple):
    """Direction of deflections of a body.

    Attributes
    ----------
    size : float
        Root of the energy of deflections in this direction.
    body : str
        Name of the body.
    coordinates : slice
        Flexible coordinates u of the body in the system.
    energies : array
        Product with u that gives the root of energy of a deflection in this direction.
    shape : array
        Direction in the coordinates of the body's reference condition.
    """

    size: float
    body: str
    coordinates: slice
    energies: Array
    shape: Array


def _directions(system: System, deflections: Array) -> list[_Direction]:
    """Return the directions of deflections (k, n) of each body, by decreasing size."""
    found = []
    for body in system.bodies:
        omega = body.modes.omega
        triangle = np.transpose(np.linalg.qr(omega * deflections[:, body.flexible], mode="r"))
        directions, sizes, _ = np.linalg.svd(triangle, full_matrices=False)
        shapes = body.modes.vectors @ (directions / omega[:, None])
        found += [
            _Direction(size, body.name, body.flexible, omega * directions[:, k], shapes[:, k])
            for k, size in enumerate(sizes.tolist())
        ]
    # Equal directions keep the order of their bodies.
    return sorted(found, key=lambda one: -one.size)


def _checked_count(system: System, found: Sequence[_Direction], count: int) -> int:
    """Return a number of coordinates to keep, checked against those of the system and the independent directions."""
    if not 1 <= count <= system.n_flexible:
        raise InputError(
            "no such number of flexible coordinates", field="coordinates", value=count,
            remedy=f"from 1 to {system.n_flexible}",
        )  # fmt: skip
    known = _independent(found)
    if count > known:
        raise InputError(
            f"are more than the {known} directions in which the motion bends the bodies", field="coordinates",
            value=count, remedy=f"keep at most {known}" if known else "it does not bend them at all",
        )  # fmt: skip
    return count


def _independent(found: Sequence[_Direction]) -> int:
    return sum(one.size > _ROUNDING * found[0].size for one in found)


def _bases(system: System, kept: Sequence[_Direction]) -> dict[str, tuple[tuple[float, ...], ...]]:
    """Return directions as reduced coordinates (own, kept) of every body, in those of its reference condition."""
    return {
        body.name: _rows([one.shape for one in kept if one.body == body.name], len(body.modes.vectors))
        for body in system.bodies
        if body.nf
    }


def _check_flexible(system: System) -> None:
    if not system.n_flexible:
        raise InputError("has rigid bodies only", field="mechanism", value=system.mechanism.name,
                         remedy="give it flexible ones")  # fmt: skip


def _normalised(system: System, parts: Sequence[Array]) -> Array:
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
