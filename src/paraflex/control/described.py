"""Controllers as a model file describes them: frozen, without states, for any mode."""

from __future__ import annotations

from collections.abc import Callable, Iterable, Mapping, Sequence
from dataclasses import dataclass, field
from typing import TYPE_CHECKING, Any, ClassVar, Protocol

import numpy as np

from paraflex.arguments import CheckedFields, given_as
from paraflex.control.together import check_name, multiple_of
from paraflex.errors import InputError
from paraflex.mechanism import AngleLaw, Mechanism
from paraflex.mechanism.loads import InTime
from paraflex.mechanism.measured import encoders_of, measured_sensors
from paraflex.mechanism.quantities import known

if TYPE_CHECKING:
    from paraflex.control.chain import SampledController
    from paraflex.control.discrete import DiscreteModel
    from paraflex.control.laws import JointPID

# Where a model file has controllers; and the word for none of them.
TABLE, NONE = "controller", "none"
Numbers = float | Mapping[str, float]
Rows = Sequence[Sequence[float]]


class DescribedLaw(Protocol):
    """What computes torques from readings, as a file describes it; a kind of law is such a class in `LAWS`.

    Attributes
    ----------
    kind : str
        `type` in files.
    """

    kind: ClassVar[str]

    def check(self, inputs: Sequence[str], outputs: Sequence[str], motors: Sequence[str]) -> None:
        """Check its numbers and names, for sensors and motors that are named, where they are, and all motors.

        Raises
        ------
        InputError
            A number that makes no sense, an unknown motor.
        """
        ...

    def made(self, outputs: Sequence[str], period: float) -> Any:
        """A law for `SampledController` that drives some motors."""
        ...


@given_as("a law", "a description of a law: PIDDescription or StateSpaceDescription")
@dataclass(frozen=True)
class PIDDescription(CheckedFields):
    """A PID law of the angles of motors, with feedback of errors from the planned motion: see `JointPID`.

    Attributes
    ----------
    stiffness, damping, integral : float or mapping of str to float
        Kp [N m/rad, N/m], Kd [N m s/rad, N s/m] and Ki [N m/(rad s), N/(m s)], of all motors or by motor.
    project : bool
        Whether torques that only strain links are taken out.
    cutoff : float or None
        Of the low-pass filter of rates [Hz].
    """

    kind: ClassVar[str] = "pid"
    stiffness: Numbers
    damping: Numbers = 0.0
    integral: Numbers = 0.0
    project: bool = True
    cutoff: float | None = None

    def check(self, inputs: Sequence[str], outputs: Sequence[str], motors: Sequence[str]) -> None:
        """See `DescribedLaw`."""
        from paraflex.control.laws import gains_of

        for name, gain in self._gains(motors, only=False).items():
            gains_of(gain, motors, name)
        self.made(motors, 1.0)
        if inputs and outputs and len(inputs) != len(outputs):
            raise InputError(
                f"{len(inputs)} readings for {len(outputs)} motors", field="inputs", value=", ".join(inputs),
                remedy="name the encoder of each motor, in their order, or leave it out",
            )  # fmt: skip

    def made(self, outputs: Sequence[str], period: float) -> JointPID:
        """See `DescribedLaw`."""
        from paraflex.control.laws import JointPID

        return JointPID(**self._gains(outputs), project=self.project, cutoff=self.cutoff)

    def _gains(self, motors: Sequence[str], *, only: bool = True) -> dict[str, Any]:
        found = {name: getattr(self, name) for name in ("stiffness", "damping", "integral")}
        return {name: _of(gain, motors) for name, gain in found.items()} if only else found


@given_as("a law", "a description of a law: PIDDescription or StateSpaceDescription")
@dataclass(frozen=True)
class StateSpaceDescription(CheckedFields):
    """A discrete model in state space: x_k+1 = A x_k + B y_k, torques C x_k + D y_k.

    Attributes
    ----------
    D : (outputs, inputs) rows
        From readings, less their references, to torques.
    A : (n, n) rows
        None of a model without states.
    B : (n, inputs) rows
    C : (outputs, n) rows
    """

    kind: ClassVar[str] = "state-space"
    _own = ("A", "B", "C", "D")
    D: Rows
    A: Rows = ()
    B: Rows = ()
    C: Rows = ()

    def __post_init__(self) -> None:
        super().__post_init__()
        D = _matrix(self.D, "D")
        n = len(self.A)
        for name, shape in (("A", (n, n)), ("B", (n, D.shape[1])), ("C", (D.shape[0], n))):
            found = _matrix(getattr(self, name), name)
            if found.size != shape[0] * shape[1] or (found.size and found.shape != shape):
                raise InputError(
                    f"has {_size(found.shape)}, not {_size(shape)}", field=name,
                    remedy="give A of n rows of n numbers, B with a row a state, C and D with a row a motor",
                )  # fmt: skip
        for name in ("A", "B", "C", "D"):
            rows = tuple(tuple(map(float, row)) for row in getattr(self, name))
            object.__setattr__(self, name, rows if any(rows) else ())

    def check(self, inputs: Sequence[str], outputs: Sequence[str], motors: Sequence[str]) -> None:
        """See `DescribedLaw`."""
        self._model(1.0).check(inputs, outputs, 1.0)

    def made(self, outputs: Sequence[str], period: float) -> DiscreteModel:
        """See `DescribedLaw`."""
        return self._model(period)

    def _model(self, period: float) -> DiscreteModel:
        from paraflex.control.discrete import DiscreteModel

        D, n = np.array(self.D), len(self.A)
        A, B, C = (np.reshape(rows, shape) if n else np.zeros(shape) for rows, shape in (
            (self.A, (n, n)), (self.B, (n, D.shape[1])), (self.C, (D.shape[0], n))))  # fmt: skip
        return DiscreteModel(A, B, C, D, period, (), ())


# What `type` may be in files.
LAWS: Mapping[str, type[Any]] = {law.kind: law for law in (PIDDescription, StateSpaceDescription)}


@given_as("a description of a controller", "a ControllerDescription, as [controller.NAME] of a model file is read")
@dataclass(frozen=True)
class ControllerDescription(CheckedFields):
    """A sampled controller as a model file describes it: a law and its chain, see `SampledController`.

    What is given by motor or sensor is used of those that a mode has.

    Attributes
    ----------
    name : str
    law : PIDDescription or StateSpaceDescription
    period, delay : float
        [s]
    inputs, outputs : tuple of str
        Sensors and motors; none for the encoders of its motors, and for all motors of a mode.
    reference : "plan" or mapping of str to float or AngleLaw, optional
        What is taken off the readings; by default the law's own.
    limits : float, pair or mapping of str to either, optional
        [N m, N]
    rates : float or mapping of str to float, optional
        [N m/s, N/s]
    quantise : float or mapping of str to float, optional
        Resolution of readings.
    filters : mapping of str to float, or to numerator and denominator
        [Hz]
    """

    _own = ("law", "reference", "limits", "filters")
    name: str
    law: Any
    period: float
    delay: float = 0.0
    inputs: tuple[str, ...] = ()
    outputs: tuple[str, ...] = ()
    reference: str | Mapping[str, InTime] | None = None
    limits: Any = None
    rates: Numbers | None = None
    quantise: Numbers | None = None
    filters: Mapping[str, Any] = field(default_factory=dict)

    def check(self, mechanism: Mechanism) -> None:
        """Check its names and numbers.

        Raises
        ------
        InputError
            A sensor or a motor that the mechanism does not have, a number that makes no sense.
        """
        motors = [motor.name for motor in mechanism.motors]
        sensors = [sensor.name for sensor in measured_sensors(mechanism)]
        try:
            self._check(sensors, motors)
        except InputError as error:
            raise error.within(f"{TABLE}.{self.name}") from None

    def _check(self, sensors: Sequence[str], motors: Sequence[str]) -> None:
        for field_name, names, what in (("inputs", sensors, "sensor"), ("outputs", motors, "motor")):
            for name in getattr(self, field_name):
                known(name, names, field_name, what)
        self.law.check(self.inputs, self.outputs, motors)
        among = self.inputs or sensors
        if isinstance(self.reference, Mapping):
            for name in self.reference:
                known(name, among, "reference", "sensor")
        self._sampled(self.law.made(self.outputs or motors, self.period), {}).check(among, self.outputs or motors)

    def made(self, mechanism: Mechanism, motors: Sequence[str]) -> SampledController:
        """The controller for a mode with some motors of a mechanism.

        Parameters
        ----------
        mechanism : Mechanism
        motors : sequence of str

        Raises
        ------
        InputError
            See `check`.
        """
        outputs = self.outputs or tuple(motors)
        inputs = self.inputs or encoders_of(mechanism, outputs)
        chosen = {
            "reference": _functions(_of(self.reference, inputs)),
            "limits": _of(self.limits, outputs),
            "rates": _of(self.rates, outputs),
            "quantise": _of(self.quantise, inputs),
            "filters": _of(self.filters, inputs),
        }
        return self._sampled(self.law.made(outputs, self.period), chosen)

    def _sampled(self, law: Any, chosen: Mapping[str, Any]) -> SampledController:
        from paraflex.control.chain import SampledController

        more = {name: getattr(self, name) for name in ("limits", "rates", "quantise", "filters")} | dict(chosen)
        return SampledController(
            law, period=self.period, delay=self.delay, inputs=self.inputs, outputs=self.outputs, name=self.name, **more
        )


def check_controllers(controllers: Mapping[str, ControllerDescription], mechanism: Mechanism) -> None:
    """Check the controllers of a model; see `ControllerDescription.check`.

    Raises
    ------
    InputError
        And a name that stands for none.
    """
    for name, one in controllers.items():
        try:
            check_name(name)
        except InputError as error:
            raise error.at(TABLE) from None
        if name == NONE:
            raise InputError("is the word for no controller", field=f"{TABLE}.{name}", remedy="call it otherwise")
        one.check(mechanism)


def check_periods(controllers: Iterable[ControllerDescription]) -> None:
    """Check that periods of controllers that act together are multiples of the shortest.

    Raises
    ------
    InputError
        One that is not.
    """
    several = list(controllers)
    for one in several:
        try:
            multiple_of(one.name, one.period, min(each.period for each in several))
        except InputError as error:
            raise error.within(TABLE) from None


def _of(given: Any, names: Sequence[str]) -> Any:
    """What is given by name, of some names alone; other values as they are."""
    return {name: each for name, each in given.items() if name in names} if isinstance(given, Mapping) else given


def _functions(reference: Any) -> Any:
    """References with functions of time in place of laws."""
    if not isinstance(reference, Mapping):
        return reference
    return {name: _value(each) if isinstance(each, AngleLaw) else each for name, each in reference.items()}


def _value(law: AngleLaw) -> Callable[[float], float]:
    return lambda t: float(law.evaluate(np.array([t]))[0][0])


def _matrix(rows: Any, name: str) -> np.ndarray:
    try:
        found = np.array([*rows], dtype=float)
    except (TypeError, ValueError):
        found = np.full(1, np.nan)
    if not np.all(np.isfinite(found)) or (found.size and found.ndim != 2) or (name == "D" and not found.size):
        raise InputError("is no matrix of numbers", field=name, value=rows,
                         remedy="give a list of rows, all of one length")  # fmt: skip
    return found


def _size(shape: Sequence[int]) -> str:
    return " x ".join(map(str, shape))
