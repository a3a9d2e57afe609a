"""What a run is given, near a design: planned motions, torques, systems whose coordinates mean the same."""

from __future__ import annotations

from collections.abc import Collection
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from paraflex.actuation import FeedForward, actuation_condition
from paraflex.dynamics import System, build_system, numbers_of, pack_signals, same_layout
from paraflex.errors import InputError, ParaflexError
from paraflex.integrators import IntegrationOptions
from paraflex.integrators.run import Problem, make_problem
from paraflex.integrators.variation import Direction
from paraflex.simulate import TrackingTask
from paraflex.studies.sensitivities.stencil import STENCILS, Stencil
from paraflex.studies.sweeps.overlay import Place, number_at
from paraflex.studies.sweeps.run import Task, plan_task
from paraflex.studies.sweeps.study import INTEGRATION, Setting

Array = NDArray[np.float64]

# Numbers of an integration that a run's steps depend on, which stay as they are.
_OF_STEPS = ("tolerance", "step")


@dataclass(frozen=True)
class Given:
    """All that a run of one mode is given.

    Attributes
    ----------
    task : TrackingTask
    options : IntegrationOptions
    torques : FeedForward
    condition : (k,) array
        Of the actuation matrix.
    problem : Problem
    """

    task: TrackingTask
    options: IntegrationOptions
    torques: FeedForward
    condition: Array
    problem: Problem

    @property
    def direction(self) -> Direction:
        """Its numbers, in the order of what is differentiated."""
        problem = self.problem
        return Direction(
            packed=numbers_of(problem.system.packed),
            signals=numbers_of(problem.signals),
            q=problem.initial.q,
            v=problem.initial.v,
            stops=problem.stops,
            times=problem.times,
            gains=np.array([self.options.alpha, self.options.beta]),
        )


@dataclass(frozen=True)
class Neighbours:
    """Plans of a design with one parameter moved.

    Attributes
    ----------
    name : str
        Of the parameter.
    size : float
        What its steps are parts of.
    stencil : Stencil
    plans : tuple
        At the stencil's places, planned motion and options; coordinates mean the same in all of them.
    wide : Stencil
    systems : tuple of System
        At the places of the wide one.
    """

    name: str
    size: float
    stencil: Stencil
    plans: tuple[tuple[TrackingTask, IntegrationOptions], ...]
    wide: Stencil
    systems: tuple[System, ...]


def nominal_values(setting: Setting, chosen: Collection[str] = ()) -> tuple[float, ...]:
    """Values of the parameters in the mechanism's file, or in the study's [integration].

    Parameters
    ----------
    setting : Setting
    chosen : collection of str
        Parameters that are given a value elsewhere: NaN here.

    Raises
    ------
    InputError
        Several fields of one parameter hold different numbers.
    """
    return tuple(
        float("nan") if name in chosen else _nominal(setting, name, places)
        for name, places in zip(setting.names, setting.places, strict=True)
    )


def neighbours(setting: Setting, task: Task, system: System, k: int, size: float | None = None) -> Neighbours:
    """Plans around a design, its parameter k moved to both sides, or to one where the other cannot be.

    Parameters
    ----------
    setting : Setting
    task : Task
    system : System
        Of the design itself.
    k : int
    size : float, optional
        What steps are parts of; the parameter's value by default.

    Raises
    ------
    InputError
        A parameter that has no derivative, or is zero where no size is given.
    """
    name, value = setting.names[k], task.values[k]
    where = f"vary.{name}"
    if setting.whole[k] or any(place[0] == INTEGRATION and place[1] in _OF_STEPS for place in setting.places[k]):
        raise InputError("has no derivative", field=where, value=value, remedy="leave it out")
    size = abs(value) if size is None else abs(size)
    if not size > 0.0:
        raise InputError(
            "is zero: how small are steps?", field=where, value=value,
            remedy="give low and high, whose distance is taken for its size",
        )  # fmt: skip
    trouble: ParaflexError | None = None
    for stencil, wide in STENCILS:
        try:
            plans = tuple(_plan(setting, _moved(task, k, place * size), system) for place in stencil.places)
            systems = tuple(_system(setting, _moved(task, k, place * size), system) for place in wide.places)
            return Neighbours(name, size, stencil, plans, wide, systems)
        except ParaflexError as error:
            trouble = trouble or error
    raise InputError(f"has no derivative, for near it {trouble}", field=where, value=value, remedy="leave it out")


def given(planned: TrackingTask, options: IntegrationOptions, mode: str) -> Given:
    """What the run of a mode is given."""
    return _given(planned, options, planned.torques(mode))


def given_like(planned: TrackingTask, options: IntegrationOptions, nominal: Given, name: str) -> Given:
    """The same near by: coordinates, splines and stops go with those of the nominal one.

    Raises
    ------
    InputError
        They cannot: something else than numbers has changed.
    """
    if np.size(planned.plan.knots) == np.size(nominal.torques.knots):
        torques = planned.plan.feed_forward_like(nominal.torques)
        near = _given(planned, options, torques)
        pairs = (
            (near.problem.system.packed, nominal.problem.system.packed),
            (near.problem.signals, nominal.problem.signals),
            ((near.problem.stops, near.problem.times), (nominal.problem.stops, nominal.problem.times)),
        )
        if all(same_layout(*pair) for pair in pairs):
            return near
    raise InputError(
        "more than numbers changes with it: no derivative", field=f"vary.{name}", remedy="move it a little with --at"
    )


def _given(planned: TrackingTask, options: IntegrationOptions, torques: FeedForward) -> Given:
    """As `simulate` makes them."""
    times = planned.motion.t
    signals, knots = pack_signals(planned.mechanism, torques.signals, float(times[-1]))
    stops = np.sort(np.concatenate([torques.knots, knots]))
    problem = make_problem(planned.system, signals, planned.start, times, stops)
    return Given(planned, options, torques, actuation_condition(planned.effort, torques.mode), problem)


def _moved(task: Task, k: int, by: float) -> Task:
    values = task.values
    return task._replace(values=(*values[:k], values[k] + by, *values[k + 1 :]))


def _plan(setting: Setting, task: Task, like: System) -> tuple[TrackingTask, IntegrationOptions]:
    planned, options = plan_task(setting, task)
    return replace(planned, system=build_system(planned.mechanism, like)), options


def _system(setting: Setting, task: Task, like: System) -> System:
    return build_system(setting.design(task.values)[0].mechanism, like)


def _nominal(setting: Setting, name: str, places: tuple[Place, ...]) -> float:
    values = [_value(setting, place) for place in places]
    if any(value != values[0] for value in values):
        raise InputError(
            "its fields hold different numbers: which is the nominal one?", field=f"vary.{name}.fields",
            value=values, remedy=f"say --at {name}=VALUE, or give each a parameter of its own",
        )  # fmt: skip
    return values[0]


def _value(setting: Setting, place: Place) -> float:
    if place[0] == INTEGRATION:
        return float(setting.integration.get(str(place[1]), getattr(IntegrationOptions(), str(place[1])) or 0.0))
    return number_at(setting.data, place)
