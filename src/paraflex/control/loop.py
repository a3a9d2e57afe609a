"""Controllers that act on a simulation, each at its own instants."""

from __future__ import annotations

import copy
from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass
from typing import Any, NamedTuple

import numpy as np

from paraflex.arrays import Array
from paraflex.control.chain import ChainSample, SampledController, as_law
from paraflex.control.controllers import Controller, Plant
from paraflex.control.discrete import DiscreteModel
from paraflex.control.inside import exception_of, linear_model, wrong_torques
from paraflex.control.together import (
    check_distinct,
    check_name,
    check_whole,
    checked_number,
    multiple_of,
    real_numbers,
    whole_and_part,
)
from paraflex.errors import InputError
from paraflex.kernel.sampled import ACTED, SAMPLED, SampledLaw
from paraflex.mechanism.quantities import not_negative


class Due(NamedTuple):
    """Torques (outputs,) of a controller, by its number, that act from an instant on."""

    tick: int
    part: float
    controller: int
    torques: Array


@dataclass(frozen=True)
class ControllerRecord:
    """What a controller did in a run.

    Attributes
    ----------
    name : str
    period, delay : float
        [s]
    inputs, outputs : tuple of str
        Sensors and motors.
    input_units, output_units : tuple of str
    t : (k,) array
        Of its samples [s].
    readings : (k, inputs) array
        Quantised and filtered, where it has such a chain.
    wanted : (k, outputs) array
        Torques of the law.
    given : (k, outputs) array
        Those within the limits, which acted from t + delay on.
    law : str
        What it computes torques by, in a few words.
    limits : (outputs, 2) array
        Lowest and highest torque [N m, N]; infinite without.
    rates : (outputs,) array
        Largest change of torques in a second [N m/s, N/s]; infinite without.
    linear : DiscreteModel or None
        Its law from readings to torques, as at the first sample, if that is linear and readings are not filtered.
    """

    name: str
    period: float
    delay: float
    inputs: tuple[str, ...]
    outputs: tuple[str, ...]
    input_units: tuple[str, ...]
    output_units: tuple[str, ...]
    t: Array
    readings: Array
    wanted: Array
    given: Array
    law: str
    limits: Array
    rates: Array
    linear: DiscreteModel | None = None

    @property
    def limited(self) -> Array:
        """At which samples (k,) a limit was met."""
        return np.any(self.given != self.wanted, axis=1)


class LawFailure(Exception):
    """A controller that raised, or returned what cannot be torques; the cause in words."""


class Loop:
    """Controllers with their instants: multiples of the shortest period, and those plus delays.

    Parameters
    ----------
    controllers : sequence
        Each a `Controller`, or what `SampledController` takes for a law that says its period.
    plant : callable
        Gives the `Plant` of a controller's inputs, outputs, period and delay.
    sensors, motors : tuple of str
        In the order of readings and of torques.
    start : float
        Time of the first sample [s].

    Raises
    ------
    InputError
        A period that is no multiple of the shortest one, unknown sensors or motors, a name twice, two laws each of
        which gives the whole torque.
    LawFailure
        A controller that raises as it starts.
    """

    def __init__(
        self,
        controllers: Sequence[Any],
        plant: Callable[[Controller], Plant],
        sensors: tuple[str, ...],
        motors: tuple[str, ...],
        start: float,
    ) -> None:
        self.controllers: list[Controller] = [_controller(each, sensors, motors) for each in controllers]
        self.names: list[str] = _names(self.controllers)
        check_whole(self.whole)
        self._start = start
        self._plants: list[Plant] = []
        for name, each in zip(self.names, self.controllers, strict=True):
            try:
                self._plants.append(plant(each))
                each.start(self._plants[-1])
            except InputError as error:
                raise error.within(name) from None
            except Exception as error:
                raise _raised(name, error) from error
        # Names of the sensors that controllers read, in the order of the readings that `act` needs.
        self.read: tuple[str, ...] = tuple(dict.fromkeys(name for plant in self._plants for name in plant.inputs))
        self._inputs = [[self.read.index(name) for name in plant.inputs] for plant in self._plants]
        self._outputs = [[motors.index(name) for name in plant.outputs] for plant in self._plants]
        self.period: float = min(each.period for each in self.controllers)
        self._every = [
            multiple_of(name, each.period, self.period) for name, each in zip(self.names, self.controllers, strict=True)
        ]
        self._delays = [whole_and_part(each.delay / self.period) for each in self.controllers]
        # Number of the next sample of each, torques to come, and those of each that act.
        self._next = [0] * len(self.controllers)
        self._due: list[Due] = []
        self.acting: Array = np.zeros((len(self.controllers), len(motors)))
        for k, each in enumerate(self.controllers):
            self.acting[k, self._outputs[k]] = getattr(each, "holding_torques", 0.0)
        # Of each its samples: times, readings, torques wanted and given.
        self.kept: list[list[tuple[float, Array, Array, Array]]] = [[] for _ in self.controllers]
        # Where the compiled time loop runs the controller.
        self.inside: SampledLaw | None = None

    @property
    def alone(self) -> tuple[Controller, Plant] | None:
        """The controller with its plant, where there is but one."""
        return (self.controllers[0], self._plants[0]) if len(self.controllers) == 1 else None

    @property
    def failure(self) -> LawFailure | None:
        """What ended a run in the compiled time loop."""
        if self.inside is None:
            return None
        raised = exception_of(self.inside, self.controllers[0])
        if raised is not None:
            return _raised(self.names[0], raised)
        wrong = wrong_torques(self.inside)
        return _not_finite(self.names[0], [self._plants[0].outputs[k] for k in wrong]) if wrong else None

    @property
    def whole(self) -> list[str]:
        """Names of controllers that give the whole torque."""
        pairs = zip(self.names, self.controllers, strict=True)
        return [name for name, each in pairs if getattr(each, "whole_torque", False)]

    @property
    def _instant(self) -> tuple[int, float]:
        """The next instant, in shortest periods."""
        samples = min(every * number for every, number in zip(self._every, self._next, strict=True))
        return min([(samples, 0.0), *((due.tick, due.part) for due in self._due)])

    @property
    def next(self) -> float:
        """Time of the next instant [s]."""
        tick, part = self._instant
        return self._start + (tick + part) * self.period

    def act(self, readings: Callable[[], Array]) -> Array | None:
        """Take the samples of this instant, then let torques act; those of all motors, None where nothing changes.

        Parameters
        ----------
        readings : callable
            Gives readings of the sensors in `read`.

        Raises
        ------
        LawFailure
            A controller that raises, or whose torques are no finite numbers, or too few or many.
        """
        tick, part = self._instant
        sampled = [k for k, (every, number) in enumerate(zip(self._every, self._next, strict=True))
                   if part == 0.0 and every * number == tick]  # fmt: skip
        if sampled:
            y = readings()
            for k in sampled:
                torques = self._step(k, self._next[k], self._start + tick * self.period, y[self._inputs[k]])
                whole, rest = self._delays[k]
                self._due.append(Due(tick + whole, rest, k, torques))
                self._next[k] += 1
        acting = [due for due in self._due if (due.tick, due.part) <= (tick, part)]
        if not acting:
            return None
        self._due = [due for due in self._due if (due.tick, due.part) > (tick, part)]
        for due in acting:
            self.acting[due.controller, self._outputs[due.controller]] = due.torques
        return self.acting.sum(axis=0)

    def _step(self, k: int, number: int, t: float, y: Array) -> Array:
        name, controller, outputs = self.names[k], self.controllers[k], self._plants[k].outputs
        try:
            given = controller.step(number, t, y)
        except Exception as error:
            raise _raised(name, error) from error
        torques = None if given is None else real_numbers(given)
        if torques is None:
            kind = "complex numbers" if given is not None and np.iscomplexobj(given) else type(given).__name__
            raise LawFailure(f'controller "{name}" returned {kind}, no torques')
        torques = np.atleast_1d(torques)
        if torques.shape != (len(outputs),):
            count = "one" if torques.size == 1 else " x ".join(map(str, torques.shape))
            raise LawFailure(f'controller "{name}" returned {count} in place of {len(outputs)} torques')
        wrong = [motor for motor, value in zip(outputs, torques, strict=True) if not np.isfinite(value)]
        if wrong:
            raise _not_finite(name, wrong)
        last = getattr(controller, "last", None)
        record = last if isinstance(last, ChainSample) else ChainSample(y, torques, torques)
        self.kept[k].append((t, record.readings, record.wanted, torques))
        return torques

    def keep_last(self) -> None:
        """Let the controller in the compiled time loop have its last sample, as outside of it."""
        law, controller = self.inside, self.controllers[0]
        if law is None or not law.counts[SAMPLED]:
            return
        k = int(law.counts[SAMPLED]) - 1
        assert isinstance(controller, SampledController)
        controller.last = ChainSample(law.readings[k].copy(), law.wanted[k].copy(), law.given[k].copy())

    def torques_acted(self, after: int) -> Iterator[tuple[float, Array]]:
        """Times at which torques (motors,) of all motors began to act in the compiled time loop, after so many."""
        law = self.inside
        if law is None:
            return
        for k in range(after, int(law.counts[ACTED])):
            torques = np.zeros(law.held.size)
            torques[law.outputs] = law.given[k]
            yield float(law.acted[k]), torques

    def records(self, units: Callable[[str], str]) -> tuple[ControllerRecord, ...]:
        """What each controller has done."""
        return tuple(self._record(k, units) for k in range(len(self.controllers)))

    def _record(self, k: int, units: Callable[[str], str]) -> ControllerRecord:
        controller, plant = self.controllers[k], self._plants[k]
        inside = self.inside
        if inside is None:
            t, readings, wanted, given = list(zip(*self.kept[k], strict=True)) or [()] * 4
        else:
            kept = (inside.t, inside.readings, inside.wanted, inside.given)
            t, readings, wanted, given = (each[: inside.counts[SAMPLED]] for each in kept)
        law, limits, rates = _bounds(controller, len(plant.outputs))
        return ControllerRecord(
            name=self.names[k],
            period=controller.period,
            delay=controller.delay,
            inputs=plant.inputs,
            outputs=plant.outputs,
            input_units=plant.input_units,
            output_units=tuple(units(motor) for motor in plant.outputs),
            t=np.array(t, dtype=float),
            readings=_columns(readings, plant.inputs),
            wanted=_columns(wanted, plant.outputs),
            given=_columns(given, plant.outputs),
            law=law,
            limits=limits,
            rates=rates,
            linear=linear_model(controller, plant),
        )

    def saved(self) -> Any:
        """State of all controllers and of what is to come."""
        state = [vars(each) for each in self.controllers]
        own = (self._next, self._due, self.acting, self.kept)
        # Plants, with tasks and mechanisms, stay what they are.
        memo = {id(value): value for plant in self._plants for value in (plant, *vars(plant).values())}
        inside = None if self.inside is None else [array.copy() for array in self.inside]
        return copy.deepcopy((state, own), memo), inside

    def restore(self, saved: Any) -> None:
        """Go back to what `saved` gave."""
        memo = {id(value): value for plant in self._plants for value in (plant, *vars(plant).values())}
        outside, inside = saved
        states, own = copy.deepcopy(outside, memo)
        self._next, self._due, self.acting, self.kept = own
        for controller, state in zip(self.controllers, states, strict=True):
            vars(controller).clear()
            vars(controller).update(state)
        if self.inside is not None:
            for mine, array in zip(self.inside, inside, strict=True):
                mine[...] = array


def _raised(name: str, error: Exception) -> LawFailure:
    said = " ".join(str(error).split())
    return LawFailure(f'controller "{name}" raised {type(error).__name__}: {said}')


def _not_finite(name: str, motors: Sequence[str]) -> LawFailure:
    return LawFailure(f'controller "{name}" returned torques that are not finite, for {", ".join(motors)}')


def _controller(given: Any, sensors: tuple[str, ...], motors: tuple[str, ...]) -> Controller:
    """A controller from itself, or from a law that says all that it needs."""
    if all(hasattr(given, name) for name in ("period", "delay", "inputs", "outputs", "start", "step")):
        controller: Controller = given
    else:
        controller = SampledController(as_law(given))
    name = getattr(given, "name", "controller")
    checked_number(controller.period, f"{name}.period", "s")
    checked_number(controller.delay, f"{name}.delay", "s", not_negative)
    for field_name, among, what in (("inputs", sensors, "sensor"), ("outputs", motors, "motor")):
        names = getattr(controller, field_name)
        if not isinstance(names, tuple | list):
            raise InputError("is no list of names", field=f"{name}.{field_name}", value=names, remedy="give a tuple")
        check_distinct(names, among, f"{name}.{field_name}", what)
    return controller


def _columns(rows: Sequence[Array] | Array, names: Sequence[str]) -> Array:
    """Rows (k, names) of samples, which may be none."""
    return np.array(rows).reshape(len(rows), len(names))


def _bounds(controller: Controller, outputs: int) -> tuple[str, Array, Array]:
    """Words for a controller's law, limits (outputs, 2) and rates (outputs,) of its torques."""
    if isinstance(controller, SampledController):
        return controller.title, *controller.bounds
    return type(controller).__name__, np.tile([-np.inf, np.inf], (outputs, 1)), np.full(outputs, np.inf)


def _names(controllers: Sequence[Controller]) -> list[str]:
    """Names of controllers, with numbers where they have none of their own."""
    given = [getattr(each, "name", "controller") for each in controllers]
    for name in given:
        check_name(name)
    if len(set(given)) == len(given):
        return given
    twice = [name for name in given if given.count(name) > 1]
    numbers = dict.fromkeys(twice, 0)
    found = []
    for name in given:
        if name in numbers:
            numbers[name] += 1
            name = f"{name}{numbers[name]}"
        found.append(name)
    return found
