"""Derivatives of the metrics of a design's runs by its parameters."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from paraflex.dynamics import blocks_of, numbers_of, with_numbers
from paraflex.errors import Moment, NumericalError
from paraflex.integrators.solution import Solution
from paraflex.integrators.variation import (
    Direction,
    Motion,
    RunDerivatives,
    check_differentiable,
    energies,
    run_derivatives,
)
from paraflex.kernel.packed import PackedSystem
from paraflex.simulate import TrackingRun, simulate
from paraflex.studies.sensitivities.metrics import columns, smooth_values
from paraflex.studies.sensitivities.plans import Given, Neighbours, given, given_like, neighbours
from paraflex.studies.sensitivities.stencil import Difference
from paraflex.studies.sweeps.metrics import make_traces, measure
from paraflex.studies.sweeps.run import Task, plan_task
from paraflex.studies.sweeps.study import Setting

Array = NDArray[np.float64]


@dataclass(frozen=True)
class ModeGradients:
    """Metrics of one run and their derivatives.

    Attributes
    ----------
    mode : str
    values : dict of str to float
        By column; also of metrics that have no derivatives.
    gradients : dict of str to (parameters,) array
    errors : dict of str to (parameters,) array
        Estimates of what differences leave in `gradients`: of those over metrics, and of those over what the run is
        given as a part of the derivative.
    steps : int
    unsettled : float
        See `RunDerivatives`.
    """

    mode: str
    values: dict[str, float]
    gradients: dict[str, Array]
    errors: dict[str, Array]
    steps: int
    unsettled: float


def metric_gradients(
    setting: Setting, task: Task, *, sizes: Sequence[float | None] | None = None
) -> list[tuple[str, dict[str, float], dict[str, Array]]]:
    """Metrics of a design's runs along a path and their derivatives by its parameters, mode by mode.

    Parameters
    ----------
    setting, task
        As for `sweeps.run_task`.
    sizes : sequence of float, optional
        What steps of each parameter are parts of; its value where there is none.

    Returns
    -------
    list of (mode, values, gradients)
        Gradients (parameters,) by column, in the order of `setting.names`; metrics that have none are left out.

    Raises
    ------
    InputError
        Parameters or options that have no derivatives, and numbers that cannot be.
    NumericalError
        A run that cannot be made.
    """
    return [(each.mode, each.values, each.gradients) for each in mode_gradients(setting, task, sizes)]


def mode_gradients(setting: Setting, task: Task, sizes: Sequence[float | None] | None = None) -> list[ModeGradients]:
    """See `metric_gradients`."""
    planned, options = plan_task(setting, task)
    check_differentiable(options)
    sizes = [None] * len(setting.names) if sizes is None else sizes
    around = [neighbours(setting, task, planned.system, k, size) for k, size in enumerate(sizes)]
    return [_of_mode(setting, given(planned, options, mode), mode, around) for mode in setting.modes]


def _of_mode(setting: Setting, nominal: Given, mode: str, around: Sequence[Neighbours]) -> ModeGradients:
    run = simulate(nominal.task, mode, options=nominal.options)
    if run.solution.singular_positions:
        time = run.solution.singular_positions[0]
        raise NumericalError(
            "the run passes a singular position, where constraint forces have a pole: no derivatives",
            Moment(time, run.solution.steps),
        )
    near = [[given_like(planned, options, nominal, each.name) for planned, options in each.plans] for each in around]
    differences = [_direction(nominal, each, plans) for each, plans in zip(around, near, strict=True)]
    found = run_derivatives(nominal.problem, nominal.options, [direction for direction, _ in differences])
    names = columns(run, setting.metrics)
    changes = [
        _metric_changes(setting, run, nominal, found, k, direction, each, plans)
        for k, (each, plans, (direction, _)) in enumerate(zip(around, near, differences, strict=True))
    ]
    sizes = np.array([each.size for each in around])
    values = np.array([change.value for change in changes]).reshape(len(around), len(names)).T / sizes
    errors = np.array([change.error for change in changes]).reshape(len(around), len(names)).T / sizes
    errors += np.abs(values) * np.array([error for _, error in differences])
    return ModeGradients(
        mode=run.mode.name,
        values=measure(run, setting.metrics),
        gradients=dict(zip(names, values, strict=True)),
        errors=dict(zip(names, errors, strict=True)),
        steps=found.steps,
        unsettled=found.unsettled,
    )


def _direction(nominal: Given, around: Neighbours, plans: list[Given]) -> tuple[Direction, float]:
    """How what is given changes with a parameter as a part of its size, and the largest relative error of that."""
    found = [around.stencil.derivative(list(parts)) for parts in zip(*(plan.direction for plan in plans), strict=True)]
    found[0] = around.wide.derivative([numbers_of(system.packed) for system in around.systems])
    times = nominal.problem.times
    torques = around.stencil.derivative([plan.torques.evaluate(plan.problem.times) for plan in plans])
    packed, here = nominal.problem.system.packed, nominal.direction
    # Of signals the torques they give: coefficients of high powers are nothing but rounding.
    errors = [_relative(torques, nominal.torques.evaluate(times)), *map(_relative, found[2:], here[2:])]
    blocks = (blocks_of(packed, numbers) for numbers in (found[0].value, found[0].error, here.packed))
    errors += [_relative(Difference(value, error), numbers) for value, error, numbers in zip(*blocks, strict=True)]
    return Direction(*(difference.value for difference in found)), max(errors)


def _relative(difference: Difference, numbers: Array) -> float:
    """The largest error of numbers of one kind, as a part of the largest of them or of their derivatives."""
    size = max(np.max(np.abs(difference.value), initial=0.0), np.max(np.abs(numbers), initial=0.0))
    return float(np.max(difference.error, initial=0.0) / size) if size > 0.0 else 0.0


def _metric_changes(
    setting: Setting, run: TrackingRun, nominal: Given, found: RunDerivatives, k: int, direction: Direction,
    around: Neighbours, plans: list[Given],
) -> Difference:  # fmt: skip
    """Derivatives of the numbers that metrics give by parameter k as a part of its size."""
    change = Motion(*(part[k] for part in found.derivatives))
    packed = nominal.problem.system.packed
    here = make_traces(_moved_run(run, nominal, packed, found.motion, change, 0.0))
    values = []
    for place, plan in zip(around.stencil.places, plans, strict=True):
        # Energies need stiffnesses more exact than those of the plan.
        near = with_numbers(packed, numbers_of(packed) + place * direction.packed)
        moved = make_traces(_moved_run(run, plan, near, found.motion, change, place))
        values.append(smooth_values(moved, here, setting.metrics))
    return around.stencil.derivative(values)


def _moved_run(
    run: TrackingRun, plan: Given, packed: PackedSystem, motion: Motion, change: Motion, share: float
) -> TrackingRun:
    """The run of a plan near by, but for what is of second order in how far it is."""
    q, v, a, multipliers, work = (x + share * dx for x, dx in zip(motion, change, strict=True))
    energy = energies(packed, q, v, multipliers)
    solution: Solution = replace(
        run.solution, t=plan.problem.times, q=q, v=v, a=a, multipliers=multipliers,
        kinetic_energy=energy[:, 0], strain_energy=energy[:, 1], work=work + energy[:, 2] - energy[0, 2],
    )  # fmt: skip
    return TrackingRun(plan.task, plan.torques, plan.condition, solution, run.method)
