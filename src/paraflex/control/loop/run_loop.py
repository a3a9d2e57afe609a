"""Schedule of the sampled controllers of a simulation: sample times, delayed torques and records of each."""

import copy
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from typing import Any, NamedTuple

import numpy as np

from paraflex.arrays import Array, Brief
from paraflex.control.laws.controllers import Controller, Plant
from paraflex.control.laws.discrete import DiscreteModel
from paraflex.errors import InputError
from paraflex.kernel.sampled import ACTED, RAISED, SAMPLED, WRONG, SampledLaw
from paraflex.mechanism.quantities import not_negative
from .chain import CHANGING, ChainSample, SampledController, as_law
from .inside import exception_of, linear_model
from .together import check_distinct, check_name, check_whole, checked_number, multiple_of, real_numbers, whole_and_part


class PendingTorques(NamedTuple):
    """Torques (outputs,) of a controller, given by its index, that act from an instant on.

    The instant is `tick` + `part` shortest periods after the start.
    """

    tick: int
    part: float
    controller: int
    torques: Array


@dataclass(frozen=True)
class ControllerRecord(Brief):
    """Record of a controller in a run.

    Attributes
    ----------
    name : str
        Name of the controller.
    period, delay : float
        Sampling period, and delay from a sample until its torques act [s].
    inputs, outputs : tuple of str
        Sensors and motors.
    input_units, output_units : tuple of str
        Units of readings and torques.
    t : (k,) array
        Sample times [s].
    readings : (k, inputs) array
        Readings, after quantisation and filters if the controller has such a chain.
    requested : (k, outputs) array
        Torques that the law returned [N m, N].
    applied : (k, outputs) array
        Torques after saturation and rate limiting, applied from t + delay on [N m, N].
    law : str
        Short description of the law.
    limits : (outputs, 2) array
        Lowest and highest torque [N m, N]; infinite without limits.
    rates : (outputs,) array
        Largest rate of the torques [N m/s, N/s]; infinite without limits.
    linear : DiscreteModel or None
        Law from readings to torques, as at the first sample; None if it is not linear or readings are filtered.
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
    requested: Array
    applied: Array
    law: str
    limits: Array
    rates: Array
    linear: DiscreteModel | None = None

    @property
    def limited(self) -> Array:
        """Whether a limit was active, for each sample (k,)."""
        return np.any(self.applied != self.requested, axis=1)


class LawFailure(Exception):
    """Error of a controller that raised an exception or returned invalid torques, with the cause as its message."""


class Loop:
    """Schedule of controllers: samples at multiples of the shortest period, and actuation instants after their delays.

    Parameters
    ----------
    controllers : sequence
        Controllers: each a `Controller`, or a law accepted by `SampledController` that has a period.
    plant : callable
        Function that returns the `Plant` of a controller.
    sensors, motors : tuple of str
        Names of all sensors and motors, in the order of readings and of torques.
    start : float
        Time of the first sample [s].

    Raises
    ------
    InputError
        A period that is not a multiple of the shortest one, unknown sensors or motors, a name given twice, or two laws
        each of which gives the whole torque.
    LawFailure
        A controller that raised an exception when started.
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
        self.plants: list[Plant] = []
        for name, each in zip(self.names, self.controllers, strict=True):
            try:
                self.plants.append(plant(each))
                each.start(self.plants[-1])
            except InputError as error:
                raise error.within(name) from None
            except Exception as error:
                raise _raised(name, error) from error
        # Sensors that the controllers read, in the order of the readings for `act`.
        self.read: tuple[str, ...] = tuple(dict.fromkeys(name for plant in self.plants for name in plant.inputs))
        self._inputs = [[self.read.index(name) for name in plant.inputs] for plant in self.plants]
        self._outputs = [[motors.index(name) for name in plant.outputs] for plant in self.plants]
        self.period: float = min(each.period for each in self.controllers)
        self._every = [
            multiple_of(name, each.period, self.period) for name, each in zip(self.names, self.controllers, strict=True)
        ]
        self._delays = [whole_and_part(each.delay / self.period) for each in self.controllers]
        # Index of the next sample of each controller, delayed torques, and acting torques of each.
        self._next = [0] * len(self.controllers)
        self._due: list[PendingTorques] = []
        self.acting: Array = np.zeros((len(self.controllers), len(motors)))
        for k, each in enumerate(self.controllers):
            self.acting[k, self._outputs[k]] = getattr(each, "holding_torques", 0.0)
        # Samples of each controller: times, readings, torques of the law and after limits.
        self.kept: list[list[tuple[float, Array, Array, Array]]] = [[] for _ in self.controllers]
        # Arrays of the compiled time loop, if that runs the controller.
        self.inside: SampledLaw | None = None

    @property
    def failure(self) -> LawFailure | None:
        """Failure that ended a run in the compiled time loop; None without one."""
        law = self.inside
        if law is None or not law.counts[WRONG]:
            return None
        if law.counts[WRONG] == RAISED:
            return _raised(self.names[0], exception_of(law, self.controllers[0]))
        return _not_finite(self.names[0], self.plants[0].outputs, law.wanted[law.counts[SAMPLED]])

    @property
    def whole(self) -> list[str]:
        """Names of the controllers that give the whole torque."""
        pairs = zip(self.names, self.controllers, strict=True)
        return [name for name, each in pairs if getattr(each, "whole_torque", False)]

    @property
    def _instant(self) -> tuple[int, float]:
        """Next instant, as whole shortest periods and a fraction of one."""
        samples = min(every * number for every, number in zip(self._every, self._next, strict=True))
        return min([(samples, 0.0), *((due.tick, due.part) for due in self._due)])

    @property
    def next(self) -> float:
        """Time of the next instant [s]."""
        tick, part = self._instant
        return self._start + (tick + part) * self.period

    def act(self, readings: Callable[[], Array]) -> Array | None:
        """Take the samples due at this instant, then update the acting torques.

        Parameters
        ----------
        readings : callable
            Function that returns the readings of the sensors in `read`.

        Returns
        -------
        (motors,) array or None
            Torques of all motors [N m, N]; None if none changes.

        Raises
        ------
        LawFailure
            A controller that raised an exception, or returned torques that are not finite or of a wrong number.
        """
        tick, part = self._instant
        sampled = [k for k, (every, number) in enumerate(zip(self._every, self._next, strict=True))
                   if part == 0.0 and every * number == tick]  # fmt: skip
        if sampled:
            y = readings()
            for k in sampled:
                torques = self._step(k, self._next[k], self._start + tick * self.period, y[self._inputs[k]])
                whole, rest = self._delays[k]
                self._due.append(PendingTorques(tick + whole, rest, k, torques))
                self._next[k] += 1
        acting = [due for due in self._due if (due.tick, due.part) <= (tick, part)]
        if not acting:
            return None
        self._due = [due for due in self._due if (due.tick, due.part) > (tick, part)]
        for due in acting:
            self.acting[due.controller, self._outputs[due.controller]] = due.torques
        return self.acting.sum(axis=0)

    def _step(self, k: int, number: int, t: float, y: Array) -> Array:
        name, controller, outputs = self.names[k], self.controllers[k], self.plants[k].outputs
        try:
            returned = controller.step(number, t, y)
        except Exception as error:
            raise _raised(name, error) from error
        torques = real_numbers(returned)
        if torques is None:
            kind = "complex numbers" if np.iscomplexobj(returned) else type(returned).__name__
            raise LawFailure(f'controller "{name}" returned {kind}, not torques')
        torques = np.atleast_1d(torques)
        if torques.shape != (len(outputs),):
            count = "one" if torques.size == 1 else " x ".join(map(str, torques.shape))
            raise LawFailure(f'controller "{name}" returned {count} in place of {len(outputs)} torques')
        if not np.all(np.isfinite(torques)):
            raise _not_finite(name, outputs, torques)
        last = getattr(controller, "last", None)
        record = last if isinstance(last, ChainSample) else ChainSample(y, torques, torques)
        self.kept[k].append((t, record.readings, record.requested, torques))
        return torques

    def note_inside(self, known: int, note: Callable[[float, Array], None]) -> None:
        """Give the controller in the compiled time loop its last sample, and note the torques that acted there.

        Parameters
        ----------
        known : int
            Number of changes of torques that are known already.
        note : callable
            Function of a time [s] and of the torques (motors,) of all motors that act from then on.
        """
        law, controller = self.inside, self.controllers[0]
        if law is None or not law.counts[SAMPLED]:
            return
        k = int(law.counts[SAMPLED]) - 1
        assert isinstance(controller, SampledController)
        last = ChainSample(law.readings[k].copy(), law.wanted[k].copy(), law.given[k].copy())
        controller.chain_state = controller.chain_state._replace(last=last)
        for k in range(known, int(law.counts[ACTED])):
            torques = np.zeros(law.held.size)
            torques[law.outputs] = law.given[k]
            note(float(law.acted[k]), torques)

    def records(self, units: Callable[[str], str]) -> tuple[ControllerRecord, ...]:
        """Return the record of each controller.

        Parameters
        ----------
        units : callable
            Function that returns the unit of a motor's torque by name.
        """
        return tuple(self._record(k, units) for k in range(len(self.controllers)))

    def _record(self, k: int, units: Callable[[str], str]) -> ControllerRecord:
        controller, plant = self.controllers[k], self.plants[k]
        inside = self.inside
        if inside is None:
            t, readings, requested, applied = list(zip(*self.kept[k], strict=True)) or [()] * 4
        else:
            kept = (inside.t, inside.readings, inside.wanted, inside.given)
            t, readings, requested, applied = (each[: inside.counts[SAMPLED]] for each in kept)
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
            requested=_columns(requested, plant.outputs),
            applied=_columns(applied, plant.outputs),
            law=law,
            limits=limits,
            rates=rates,
            linear=linear_model(controller, plant),
        )

    def saved(self) -> Any:
        """Return the states of all controllers and of the schedule."""
        state = [_changing(each) for each in self.controllers]
        own = (self._next, self._due, self.acting, self.kept)
        # Plants, with tasks and mechanisms, are not copied.
        memo = {id(value): value for plant in self.plants for value in (plant, *vars(plant).values())}
        inside = None if self.inside is None else [array.copy() for array in self.inside]
        return copy.deepcopy((state, own), memo), inside

    def restore(self, saved: Any) -> None:
        """Return to a state that `saved` returned."""
        memo = {id(value): value for plant in self.plants for value in (plant, *vars(plant).values())}
        outside, inside = saved
        states, own = copy.deepcopy(outside, memo)
        self._next, self._due, self.acting, self.kept = own
        for controller, state in zip(self.controllers, states, strict=True):
            for name in _changing(controller):
                del vars(controller)[name]
            vars(controller).update(state)
        if self.inside is not None:
            for mine, array in zip(self.inside, inside, strict=True):
                mine[...] = array


def _changing(controller: Controller) -> dict[str, Any]:
    """Return the attributes that are the state of a controller: all of a user's class."""
    own = vars(controller)
    return {name: own[name] for name in CHANGING} if type(controller) is SampledController else dict(own)


def _raised(name: str, error: Exception) -> LawFailure:
    message = " ".join(str(error).split())
    return LawFailure(f'controller "{name}" raised {type(error).__name__}: {message}')


def _not_finite(name: str, outputs: Sequence[str], torques: Array) -> LawFailure:
    wrong = [motor for motor, value in zip(outputs, torques, strict=True) if not np.isfinite(value)]
    return LawFailure(f'controller "{name}" returned torques that are not finite, for {", ".join(wrong)}')


def _controller(given: Any, sensors: tuple[str, ...], motors: tuple[str, ...]) -> Controller:
    """Return a controller as it is, or make one from a law that has the required attributes."""
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
            raise InputError("is not a list of names", field=f"{name}.{field_name}", value=names, remedy="give a tuple")
        check_distinct(names, among, f"{name}.{field_name}", what)
    return controller


def _columns(rows: Sequence[Array] | Array, names: Sequence[str]) -> Array:
    """Return rows (k, names) of samples; k may be zero."""
    return np.array(rows).reshape(len(rows), len(names))


def _bounds(controller: Controller, outputs: int) -> tuple[str, Array, Array]:
    """Return the description of a controller's law, and the limits (outputs, 2) and rates (outputs,) of its torques."""
    if isinstance(controller, SampledController):
        return controller.title, *controller.bounds
    return type(controller).__name__, np.tile([-np.inf, np.inf], (outputs, 1)), np.full(outputs, np.inf)


def _names(controllers: Sequence[Controller]) -> list[str]:
    """Return the names of controllers, numbered where names are equal."""
    names = [getattr(each, "name", "controller") for each in controllers]
    for name in names:
        check_name(name)
    return [f"{name}{names[: k + 1].count(name)}" if names.count(name) > 1 else name for k, name in enumerate(names)]
