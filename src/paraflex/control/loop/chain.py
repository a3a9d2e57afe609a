"""Signal chain between a mechanism and a control law, as in a real controller.

The order is: sample, quantise, filter, law, saturate, limit the rate, delay, hold. The delay and the hold belong to the
loop that runs the controller.
"""

import copy
import inspect
from collections.abc import Callable, Mapping, Sequence
from dataclasses import replace
from functools import partial
from typing import Any, NamedTuple

import numpy as np
import scipy

from paraflex.arguments import checked_arguments
from paraflex.arrays import Array
from paraflex.control.laws.controllers import Plant
from paraflex.control.laws.discrete import DiscreteModel, check_discrete, is_model, matrices_of
from paraflex.control.laws.estimators import rounded
from paraflex.control.laws.law import Law, StartedLaw
from paraflex.dynamics.state_space import StateSpace
from paraflex.errors import InputError
from paraflex.mechanism.quantities import not_negative
from paraflex.motion import MotionRun
from paraflex.tracking import TrackingRun
from .amplifiers import largest_commands
from .filters import transfer_function
from .references import Reference, references
from .together import by_name, checked_number, is_number, real_numbers

# Attributes of a `SampledController` that hold its state: a law may step itself.
CHANGING = ("law", "started", "chain_state")


class ChainSample(NamedTuple):
    """Signals of one sample of a controller with its chain.

    Attributes
    ----------
    readings : (inputs,) array
        Readings after quantisation and filters, before references are subtracted.
    requested : (outputs,) array
        Torques that the law returns.
    applied : (outputs,) array
        Torques after saturation and rate limiting, which act after the delay.
    """

    readings: Array
    requested: Array
    applied: Array


class ChainState(NamedTuple):
    """State of a controller between samples. None of its values is changed in place.

    Attributes
    ----------
    law : any
        State of the law: see `StartedLaw.step`.
    filtered : list of array or None
        States of the filter of each reading; None without a filter and before the first sample.
    given : (outputs,) array
        Torques of the last sample.
    last : ChainSample or None
        Signals of the last sample; None before the first one.
    """

    law: Any
    filtered: list[Array | None]
    given: Array
    last: ChainSample | None


class SampledController:
    """Control law with the signal chain of a real controller: a `Controller`.

    At every sample its sensors are read, the readings are quantised and filtered, and references are subtracted. Then
    the law is evaluated, and the torques and their rates are limited.

    Parameters
    ----------
    law : object
        Control law: a `Law`, such as `JointPID`; a discrete model of python-control or SciPy from readings to torques,
        as state space or transfer function; a function of (k, t, y), with y (inputs,) the readings of sample k at time
        t, that returns torques (outputs,); or an object with such a method `step`. The object may have `start(plant)`,
        which is called first, `limited(torques)`, which receives the torques after limits, any of the attributes
        below, `whole_torque` if no planned torque may act as well, and `absolute` if it takes readings without a
        reference. Its attributes are its state.
    period : float, optional
        Sampling period [s]; the law's own by default.
    delay : float
        Delay from a sample until its torques act [s]; the law's own by default, else zero.
    inputs : sequence of str, optional
        Sensors. By default the law's own, or the names of a model's inputs, else the encoders of the mode's motors.
    outputs : sequence of str, optional
        Motors. By default the law's own, or the names of a model's outputs, else all motors of the mode.
    reference : mapping of str to float or callable, "plan", "open-loop", or a run, optional
        Reference that is subtracted from the readings: numbers or functions of time by sensor; "plan", the values on
        the planned motion (angles and travels of joints, their rates, and the end-effector's coordinates); "open-loop",
        the readings where the planned torques alone drive the flexible mechanism; or the readings in another run. The
        law's own by default.
    quantise : float or mapping of str to float, optional
        Resolution of all readings or by sensor, to whose multiples they are rounded; not quantised by default.
    filters : mapping of str to Filter, optional
        Filters by sensor: cut-off frequency of a first-order low-pass filter [Hz], or coefficients (numerator,
        denominator) in descending powers of s. A filter starts in steady state at the first reading, and is sampled
        with a first-order hold (readings are linear between samples).
    limits : float, pair or mapping of str to either, optional
        Limits of all torques or by motor: largest magnitude, or (lowest, highest) [N m, N]. They never exceed the
        limits of the motors' amplifiers, n k_t I or n k_t U/R.
    rates : float or mapping of str to float, optional
        Largest rates of the torques [N m/s, N/s]; unlimited by default.
    name : str
        Name in results and errors.

    Attributes
    ----------
    started : StartedLaw
        Law in the present run, available once started.
    chain_state : ChainState
        State of the chain and of the law.

    Raises
    ------
    InputError
        A number out of range, a continuous model, or one with other numbers of inputs and outputs. Names that the
        mechanism does not have are reported when the controller starts.
    """

    @checked_arguments()
    def __init__(
        self,
        law: Any,
        *,
        period: float | None = None,
        delay: float | None = None,
        inputs: Sequence[str] | None = None,
        outputs: Sequence[str] | None = None,
        reference: Mapping[str, Any] | TrackingRun | MotionRun | str | None = None,
        quantise: float | Mapping[str, float] | None = None,
        filters: Mapping[str, Any] | None = None,
        limits: Any = None,
        rates: float | Mapping[str, float] | None = None,
        name: str = "controller",
    ) -> None:
        self.name: str = name
        self.law: Any = as_law(law)
        period = getattr(self.law, "period", None) if period is None else period
        self.period: float = checked_number(period, "period", "s")
        delay = getattr(self.law, "delay", 0.0) if delay is None else delay
        self.delay: float = checked_number(delay, "delay", "s", not_negative)
        self.inputs: tuple[str, ...] = tuple(getattr(self.law, "inputs", ()) if inputs is None else inputs)
        self.outputs: tuple[str, ...] = tuple(getattr(self.law, "outputs", ()) if outputs is None else outputs)
        reference = getattr(self.law, "reference", None) if reference is None else reference
        self.reference: Mapping[str, Any] | TrackingRun | MotionRun | str | None = reference
        if self.reference and getattr(self.law, "absolute", False):
            raise InputError(f"{self.title} uses the readings themselves", field="reference", value=reference,
                             remedy="leave it out")  # fmt: skip
        self.quantise: Any = quantise
        self.filters: Mapping[str, Any] = filters or {}
        self.limits: Any = limits
        self.rates: Any = rates
        # The attributes named in `CHANGING` are all that a run changes.
        self.chain_state: ChainState = ChainState(None, [], np.zeros(0), None)
        if isinstance(self.law, DiscreteModel):
            self.law.check_size(self.inputs, self.outputs, self.period)

    def check(self, inputs: Sequence[str], outputs: Sequence[str]) -> tuple[list[Any], ...]:
        """Return the components of the chain in the order of sensors and motors, None where there is none.

        They are the resolutions of readings, their filters (numerator, denominator), the limits (lowest, highest) of
        torques [N m, N], and the limits of their rates [N m/s, N/s].

        Parameters
        ----------
        inputs, outputs : sequence of str
            Sensors and motors.

        Raises
        ------
        InputError
            Unknown names, or numbers out of range.
        """
        return (
            _in_order(self.quantise, inputs, "quantise", "sensor", partial(checked_number, unit="the sensor's unit")),
            _in_order(self.filters, inputs, "filters", "sensor", transfer_function),
            _in_order(self.limits, outputs, "limits", "motor", _range),
            _in_order(self.rates, outputs, "rates", "motor", partial(checked_number, unit="N m/s or N/s")),
        )

    def start(self, plant: Plant) -> None:
        """Prepare for a run: see `Controller.start`.

        Raises
        ------
        InputError
            Names that the plant does not have.
        """
        self.found_references: list[Reference | None] = references(self.reference, plant)
        resolution, filters, limits, rates = self.check(plant.inputs, plant.outputs)
        self.resolution: Array = np.array([one or 0.0 for one in resolution])
        self.filter_models: list[StateSpace | None] = [
            None if given is None else _filter_model(given, plant.period) for given in filters
        ]
        most = largest_commands(plant.mechanism, plant.outputs)
        self._lowest = np.maximum([-np.inf if one is None else one[0] for one in limits], -most)
        self._highest = np.minimum([np.inf if one is None else one[1] for one in limits], most)
        self._most = np.array([np.inf if one is None else one * plant.period for one in rates])
        resolution = tuple(self.resolution.tolist())
        self.started: StartedLaw = _started(self.law, replace(plant, resolution=resolution if any(resolution) else ()))
        # Torques with which the law holds an equilibrium act from before the first sample.
        self.holding_torques: Array = np.clip(self.started.holding_torques, self._lowest, self._highest)
        self.chain_state: ChainState = ChainState(None, [None] * len(filters), self.holding_torques, None)

    @property
    def whole_torque(self) -> bool:
        """Whether the law gives the whole torque, so that no planned torque acts as well."""
        return bool(getattr(self.law, "whole_torque", False))

    @property
    def title(self) -> str:
        """Short description of the law."""
        started: StartedLaw | None = getattr(self, "started", None)
        return str((started and started.title) or getattr(self.law, "title", "") or type(self.law).__name__)

    @property
    def last(self) -> ChainSample | None:
        """Signals of the last sample; None before the first one."""
        return self.chain_state.last

    @property
    def bounds(self) -> tuple[Array, Array]:
        """Lowest and highest torques (outputs, 2), and largest rates (outputs,); available once started."""
        return np.stack([self._lowest, self._highest], axis=1), self._most / self.period

    def step(self, k: int, t: float, y: Array) -> Any:
        """Evaluate the chain and the law at a sample: see `Controller.step`."""
        y, filtered = rounded(np.array(y, dtype=float), self.resolution), list(self.chain_state.filtered)
        for i, model in enumerate(self.filter_models):
            if model is not None:
                y[i], filtered[i] = _filtered(model, filtered[i], y[i])
        errors = y.copy()
        for i, reference in enumerate(self.found_references):
            if reference is not None:
                errors[i] -= reference(t)
        torques, state = self.started.step(self.chain_state.law, k, t, errors)
        self.chain_state = self.chain_state._replace(law=state, filtered=filtered)
        wanted = real_numbers(torques)
        if wanted is None:
            return torques  # The loop reports the error.
        before = self.chain_state.given
        if wanted.shape != before.shape or not np.all(np.isfinite(wanted)):
            return wanted
        given = np.clip(wanted, self._lowest, self._highest)
        given = np.clip(given, before - self._most, before + self._most)
        self.chain_state = ChainState(
            self.started.limited(state, given), filtered, given, ChainSample(y, wanted, given)
        )
        return given


class _Function:
    """Adapter from a function to a law with a method `step`."""

    def __init__(self, function: Callable[[int, float, Array], Any]) -> None:
        self.step = function
        name = getattr(function, "__name__", "")
        self.title: str = name if name.isidentifier() else "function"


class _OwnSteps(StartedLaw):
    """Adapter from a law that steps itself: its attributes are its state."""

    def __init__(self, law: Any) -> None:
        self._law = law

    def __deepcopy__(self, memo: dict[int, Any]) -> "_OwnSteps":
        return _OwnSteps(copy.deepcopy(self._law, memo))

    @property
    def holding_torques(self) -> Any:
        return getattr(self._law, "holding_torques", 0.0)

    def step(self, state: Any, k: int, t: float, y: Array) -> tuple[Any, Any]:
        return self._law.step(k, t, y), None

    def limited(self, state: Any, torques: Array) -> Any:
        if hasattr(self._law, "limited"):
            self._law.limited(torques)


def _started(law: Any, plant: Plant) -> StartedLaw:
    """Return the law in a run: what its `start` returns, or the law itself with its own steps."""
    started = law.start(plant) if hasattr(law, "start") else None
    if isinstance(law, Law) and not isinstance(started, StartedLaw):
        raise TypeError(f"its `start` returned {type(started).__name__}, not a LinearLaw or another StartedLaw")
    return started if isinstance(started, StartedLaw) and "step" not in vars(law) else _OwnSteps(law)


def as_law(given: Any) -> Any:
    """Return the law for an object that is accepted as one: see `SampledController`.

    Raises
    ------
    InputError
        Any other object, or a continuous model.
    """
    # Models of SciPy have a method "step" as well, their step response.
    if is_model(given):
        return _discrete_model(given)
    if isinstance(given, Law) or (callable(getattr(given, "step", None)) and not inspect.isclass(given)):
        return given
    if callable(given) and not inspect.isclass(given):
        return _Function(given)
    raise InputError(
        "is not a control law", field="law", value=given,
        remedy="give a function of (k, t, y), an object with a method step, or a discrete model",
    )  # fmt: skip


def _discrete_model(given: Any) -> DiscreteModel:
    """Return a model of python-control or SciPy as a control law.

    Raises
    ------
    InputError
        A continuous model, or one with numbers that are not finite.
    """
    check_discrete(given.dt, given, "law", "model")
    labels = [tuple(getattr(given, name, None) or ()) for name in ("input_labels", "output_labels")]
    # Labels such as u[0] and y[0] are python-control's defaults, not names.
    names = [() if any(label[:2] in ("u[", "y[") for label in each) else each for each in labels]
    return DiscreteModel(*matrices_of(given), None if given.dt is True else float(given.dt), *names)


def _filter_model(given: tuple[Array, Array], period: float) -> StateSpace:
    """Return a transfer function, sampled with a first-order hold, as a discrete model."""
    *matrices, _ = scipy.signal.cont2discrete(scipy.signal.tf2ss(*given), period, method="foh")
    return StateSpace(*matrices)


def _filtered(model: StateSpace, x: Array | None, value: float) -> tuple[float, Array]:
    """Return a filtered value and the states of the filter after it, which is in steady state at the first value."""
    A, B, C, D = model
    x = np.asarray(np.linalg.solve(np.eye(len(A)) - A, B * value) if x is None else x, dtype=float)
    return float((C @ x + D * value).item()), np.asarray(A @ x + B * value, dtype=float)


def _in_order(given: Any, names: Sequence[str], field: str, what: str, take: Callable[[Any, str], Any]) -> list[Any]:
    """Return values in the order of the names, from one value for all or values by name; None for names without one."""
    found = {} if given is None else by_name(given, names, field, what, take)
    return [found.get(name) for name in names]


def _range(value: Any, field: str) -> tuple[float, float]:
    """Return the lowest and the highest torque, from such a pair or from the largest magnitude."""
    if not isinstance(value, Sequence | np.ndarray) or isinstance(value, str):
        most = checked_number(value, field, "N m or N")
        return -most, most
    if len(value) != 2 or not all(is_number(one) for one in value):
        raise InputError("is not a pair of numbers", field=field, value=value, remedy="give the lowest and the highest")
    low, high = float(value[0]), float(value[1])
    if not low < high:
        raise InputError("the lowest must be below the highest", field=field, value=value, remedy="exchange them")
    return low, high
