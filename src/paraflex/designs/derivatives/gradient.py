"""Gradients of the metrics of a design's runs with respect to its parameters."""

from collections.abc import Sequence
from dataclasses import dataclass, replace
from typing import Any

import numpy as np

from paraflex.arrays import Array, Brief
from paraflex.designs.measure import measure, metric_columns, metric_values, smooth_metrics
from paraflex.designs.run import Task, plan_task
from paraflex.designs.setting import Setting
from paraflex.dynamics import numbers_of, with_numbers
from paraflex.errors import InputError, Moment, NumericalError
from paraflex.integrators.sensitivity import (
    Direction,
    Motion,
    RunDerivatives,
    check_differentiable,
    energies,
    run_derivatives,
)
from paraflex.integrators.solution import Solution
from paraflex.mechanism.actuation_modes import check_torques
from paraflex.results.run_traces import RunTraces, run_traces
from paraflex.tracking import TrackingRun, simulate
from .changes import Change, ModeChange
from .plans import RunInputs, check_has_path, check_open_and_whole, run_inputs, size_of
from .stencil import STENCILS
from .steps import part, stepped


@dataclass(frozen=True)
class ModeGradients(Brief):
    """Metrics of one run and their gradients.

    Attributes
    ----------
    mode : str
        Name of the actuation mode.
    values : dict of str to float
        Metrics by column, including those that are not differentiable.
    gradients : dict of str to (parameters,) array
        Gradients with respect to the parameters by column.
    errors : dict of str to (parameters,) array
        Estimated errors of `gradients` from difference formulas, applied to numbers of the file and to signals.
    residual : float
        Largest relative last correction of the stage equations; see `RunDerivatives`.
    """

    mode: str
    values: dict[str, float]
    gradients: dict[str, Array]
    errors: dict[str, Array]
    residual: float


def metric_gradients(
    setting: Setting, task: Task, *, sizes: Sequence[float | None] | None = None
) -> list[tuple[str, dict[str, float], dict[str, Array]]]:
    """Return the metrics of a design's runs along a path and their gradients, mode by mode.

    Parameters
    ----------
    setting, task
        Common settings of the study, and design and path; see `designs.run.run_task`.
    sizes : sequence of float, optional
        Size of each parameter, to which difference steps are relative; the magnitude of its value by default.

    Returns
    -------
    list of (mode, values, gradients)
        Name of the mode, metrics by column, and gradients (parameters,) by column, in the order of `setting.names`;
        metrics that are not differentiable have no gradient.

    Raises
    ------
    InputError
        A parameter or option is not differentiable, or the values are invalid.
    NumericalError
        A run failed.
    """
    return [(each.mode, each.values, each.gradients) for each in mode_gradients(setting, task, sizes)]


def mode_gradients(setting: Setting, task: Task, sizes: Sequence[float | None] | None = None) -> list[ModeGradients]:
    """Return metrics, gradients and their estimated errors, mode by mode; see `metric_gradients`."""
    check_has_path(setting)
    check_open_and_whole(setting.design(task.values)[0])
    planned, options = plan_task(setting, task)
    check_differentiable(options)
    if planned.holds:
        raise InputError(
            "derivatives do not go through the engagement of brakes", field="study.after", value=planned.after.value,
            remedy='write after = "free", or a duration that ends with the path',
        )  # fmt: skip
    for mode in setting.modes:
        check_torques(planned.mode(mode), "a derivative", planned.mechanism.motors)
    sizes = [None] * len(setting.names) if sizes is None else sizes
    sizes = [size_of(setting, task, k, size) for k, size in enumerate(sizes)]
    changes = [Change(setting, task, planned, k, size) for k, size in enumerate(sizes)]
    return [_of_mode(setting, run_inputs(planned, options, planned.torques(mode)), changes) for mode in setting.modes]


def _of_mode(setting: Setting, nominal: RunInputs, changes: Sequence[Change]) -> ModeGradients:
    run = simulate(nominal.task, nominal.torques.mode, options=nominal.options, warning=False)
    if run.solution.singular_positions:
        time = run.solution.singular_positions[0]
        raise NumericalError(
            "the run passes a singular position, where joint forces grow without bound and nothing has derivatives,",
            Moment(time, run.solution.steps),
            remedy="shorten the run, or change lengths or the path so that it passes none",
        )
    of_mode = [change.of_mode(nominal) for change in changes]
    found = run_derivatives(nominal.problem, nominal.options, [each.direction for each in of_mode])
    names = metric_columns(run, smooth_metrics(setting.metrics))
    # The motion whose steps are solved to rounding.
    motion = found.motion
    energy = energies(nominal.problem.system.packed, motion.q, motion.v, motion.multipliers)
    solution = _with_motion(run.solution, motion, energy)
    here = run_traces(replace(run, torques=nominal.torques, condition=nominal.condition, solution=solution))
    slopes = [_slopes(setting, run, here, nominal, found, k, each) for k, each in enumerate(of_mode)]
    sizes = np.array([change.size for change in changes])
    values = np.array(slopes).reshape(len(changes), len(names)).T / sizes
    errors = np.abs(values) * np.array([each.error for each in of_mode])
    return ModeGradients(
        mode=run.mode.name,
        values=measure(run, setting.metrics),
        gradients=dict(zip(names, values, strict=True)),
        errors=dict(zip(names, errors, strict=True)),
        residual=found.residual,
    )


def _with_motion(solution: Solution, motion: Motion, energy: Array, **more: Any) -> Solution:
    """Return the solution with another motion, its `energies`, and other fields."""
    return replace(
        solution, q=motion.q, v=motion.v, a=motion.a, multipliers=motion.multipliers, kinetic_energy=energy[:, 0],
        strain_energy=energy[:, 1], work=motion.work + energy[:, 2] - energy[0, 2], **more,
    )  # fmt: skip


def _slopes(
    setting: Setting,
    run: TrackingRun,
    here: RunTraces,
    nominal: RunInputs,
    found: RunDerivatives,
    k: int,
    change: ModeChange,
) -> Array:
    """Return the derivatives of the metrics by parameter k, times its size, from a run with a complex step."""
    direction, along = change.direction, Motion(*(each[k] for each in found.derivatives))
    motion = Motion(*(stepped(x, dx) for x, dx in zip(found.motion, along, strict=True)))
    energy = _stepped_energies(nominal, found.motion, along, direction)
    solution = _with_motion(run.solution, motion, energy, t=stepped(nominal.problem.times, direction.times))
    moved = TrackingRun(change.task, change.torques, change.condition, solution, run.method)
    values = metric_values(run_traces(moved), here, smooth_metrics(setting.metrics))
    # The derivative of a metric that is NaN is NaN.
    return np.where(np.isnan(np.real(values)), np.nan, part(values))


def _stepped_energies(nominal: RunInputs, motion: Motion, along: Motion, direction: Direction) -> Array:
    """Return `energies` with a complex step by differences, which are exact to rounding for products and sines."""
    packed, stencil = nominal.problem.system.packed, STENCILS[0]
    numbers = numbers_of(packed)

    def at(place: float) -> Array:
        moved = (x + place * dx for x, dx in zip(motion, along, strict=True))
        q, v, _, multipliers, _ = moved
        return energies(with_numbers(packed, numbers + place * direction.packed), q, v, multipliers)

    return stepped(at(0.0), stencil.derivative([at(place) for place in stencil.places]).value)
