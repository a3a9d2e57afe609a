"""Control laws as described in a model file: each kind of law is a class here, listed in `LAWS`."""

from __future__ import annotations

from abc import ABC, abstractmethod
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from typing import TYPE_CHECKING, Any, ClassVar, NamedTuple

import numpy as np

from paraflex.arguments import CheckedFields
from paraflex.control.loop.together import Numbers
from paraflex.errors import InputError
from paraflex.mechanism.quantities import all_known, known

if TYPE_CHECKING:
    from paraflex.control.laws.computed_torque import ComputedTorque
    from paraflex.control.laws.designed import DesignedLQG
    from paraflex.control.laws.discrete import DiscreteModel
    from paraflex.control.laws.joints import JointPID
    from paraflex.control.laws.rates import RateFeedback

Rows = Sequence[Sequence[float]]
# Gains of a PID law.
_GAINS = ("stiffness", "damping", "integral")


class LawNames(NamedTuple):
    """Names of sensors and motors against which a description is checked.

    Attributes
    ----------
    inputs, outputs : sequence of str
        Sensors and motors that the description names itself; may be empty.
    sensors, motors : sequence of str
        All sensors and motors of the mechanism.
    encoders : sequence of str
        Encoders of the motors that the description names, or of all motors if it names none.
    points : sequence of str
        Points of bodies, such as "link.tip".
    """

    inputs: Sequence[str]
    outputs: Sequence[str]
    sensors: Sequence[str]
    motors: Sequence[str]
    encoders: Sequence[str]
    points: Sequence[str]


class DescribedLaw(CheckedFields, ABC):
    """Base class of control laws as described in a file; each kind of law is a subclass listed in `LAWS`.

    Attributes
    ----------
    kind : str
        Value of `type` in files.
    whole_torque : bool
        Whether the law gives the whole torque, so that no planned torque acts as well.
    """

    kind: ClassVar[str]
    whole_torque: ClassVar[bool] = False

    @abstractmethod
    def check(self, names: LawNames) -> None:
        """Check the numbers and names of the description.

        Raises
        ------
        InputError
            A number out of range, or an unknown motor or sensor.
        """

    @abstractmethod
    def made(self, outputs: Sequence[str], period: float) -> Any:
        """Return a law for `SampledController` that drives the motors `outputs` at a period [s]."""


@dataclass(frozen=True)
class PIDDescription(DescribedLaw):
    """PID control of motor angles, with feedback of errors from the planned motion: see `JointPID`.

    Attributes
    ----------
    stiffness, damping, integral : float or mapping of str to float
        Gains Kp [N m/rad, N/m], Kd [N m s/rad, N s/m] and Ki [N m/(rad s), N/(m s)], of all motors or by motor.
    project : bool
        Whether torques that only strain links are removed.
    cutoff : float or None
        Cut-off frequency of the low-pass filter of rates [Hz]; no filter if None.
    """

    kind: ClassVar[str] = "pid"
    stiffness: Numbers
    damping: Numbers = 0.0
    integral: Numbers = 0.0
    project: bool = True
    cutoff: float | None = None

    def check(self, names: LawNames) -> None:
        """Check the gains and pairs of readings and motors: see `DescribedLaw.check`."""
        from paraflex.control.laws.joints import check_pairs, gains_of

        for name in _GAINS:
            gains_of(getattr(self, name), names.motors, name)
        self.made(names.motors, 1.0)
        if names.inputs and names.outputs:
            check_pairs(names.inputs, names.outputs)

    def made(self, outputs: Sequence[str], period: float) -> JointPID:
        """Return the law: see `DescribedLaw.made`."""
        from paraflex.control.laws.joints import JointPID

        gains: dict[str, Any] = {name: of_names(getattr(self, name), outputs) for name in _GAINS}
        return JointPID(**gains, project=self.project, cutoff=self.cutoff)


@dataclass(frozen=True)
class StateSpaceDescription(DescribedLaw):
    """Discrete state-space model x_k+1 = A x_k + B y_k with torques C x_k + D y_k.

    Attributes
    ----------
    D : (outputs, inputs) rows
        Feed-through matrix, from readings less their references to torques.
    A : (n, n) rows
        State matrix; empty for a model without states.
    B : (n, inputs) rows
        Input matrix.
    C : (outputs, n) rows
        Output matrix.
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
                    remedy="give A of n rows of n numbers, B with one row per state, C and D with one per motor",
                )  # fmt: skip
        for name in ("A", "B", "C", "D"):
            rows = tuple(tuple(map(float, row)) for row in getattr(self, name))
            object.__setattr__(self, name, rows if any(rows) else ())

    def check(self, names: LawNames) -> None:
        """Check the numbers of sensors and motors: see `DescribedLaw.check`."""
        self._model(1.0).check(names.inputs, names.outputs, 1.0)

    def made(self, outputs: Sequence[str], period: float) -> DiscreteModel:
        """Return the law: see `DescribedLaw.made`."""
        return self._model(period)

    def _model(self, period: float) -> DiscreteModel:
        from paraflex.control.laws.discrete import DiscreteModel, matrices_of

        return DiscreteModel(*matrices_of(self), period, (), ())


@dataclass(frozen=True)
class ComputedTorqueDescription(DescribedLaw):
    """Computed torque control of the rigid mechanism in task space: see `ComputedTorque`.

    Attributes
    ----------
    frequency : float
        Natural frequency of the end-effector's error dynamics [Hz].
    damping_ratio : float
        Damping ratio of the error dynamics.
    cutoff : float or None
        Cut-off frequency of the low-pass filter of rates [Hz]; no filter if None.
    """

    kind: ClassVar[str] = "computed-torque"
    whole_torque: ClassVar[bool] = True
    frequency: float
    damping_ratio: float = 0.7
    cutoff: float | None = None

    def check(self, names: LawNames) -> None:
        """Check the numbers: see `DescribedLaw.check`."""
        self.made(names.motors, 1.0)

    def made(self, outputs: Sequence[str], period: float) -> ComputedTorque:
        """Return the law: see `DescribedLaw.made`."""
        from paraflex.control.laws.computed_torque import ComputedTorque

        return ComputedTorque(self.frequency, self.damping_ratio, cutoff=self.cutoff)


@dataclass(frozen=True)
class RateFeedbackDescription(DescribedLaw):
    """Feedback of the rates of readings: see `RateFeedback`.

    Attributes
    ----------
    gains : mapping of str to mapping of str to float
        Gains by motor and sensor: torque per rate of the reading [N m s per unit of the sensor]. A mode uses those of
        its motors.
    cutoff : float or None
        Cut-off frequency of the low-pass filter of rates [Hz]; no filter if None.
    """

    kind: ClassVar[str] = "rate-feedback"
    gains: Mapping[str, Mapping[str, float]]
    cutoff: float | None = None

    def check(self, names: LawNames) -> None:
        """Check the gains and names: see `DescribedLaw.check`."""
        for motor, row in self.gains.items():
            known(motor, names.motors, "gains", "motor")
            for sensor in row:
                known(sensor, names.sensors, f"gains.{motor}", "sensor")
        law = self.made(names.motors, 1.0)
        for field_name, given, own in (("inputs", names.inputs, law.inputs), ("outputs", names.outputs, law.outputs)):
            if given and set(given) != set(own):
                raise InputError("differ from those of the gains", field=field_name, value=", ".join(given),
                                 remedy="leave it out")  # fmt: skip

    def made(self, outputs: Sequence[str], period: float) -> RateFeedback:
        """Return the law: see `DescribedLaw.made`."""
        from paraflex.control.laws.rates import RateFeedback

        return RateFeedback(_some_of(self.gains, outputs, "gains"), cutoff=self.cutoff)


@dataclass(frozen=True)
class LQGDescription(DescribedLaw):
    """LQG controller designed when a run starts, for the mechanism's linear model in its mode: see `DesignedLQG`.

    Attributes
    ----------
    deviations : mapping of str to float
        Largest allowed deviations of sensors, in their units.
    effort : float or mapping of str to float
        Largest torques or forces [N m, N]. Motors that a mapping does not name are not used.
    noise : float or mapping of str to float, optional
        Standard deviations of readings in their units; by default those of rounding to the controller's `quantise`.
    disturbance : float or mapping of str to float, optional
        Standard deviations of random efforts at motors [N m, N]; a tenth of `effort` by default.
    integrators : mapping of str to float
        Sensors whose errors are to vanish under constant loads, with the time constants of that decay [s]: see `lqr`.
    coloured : mapping of str to (float, float or numerator and denominator)
        Coloured disturbances by motor, or by point and axis such as "link.tip.x": standard deviation [N m, N], and the
        filter that shapes the noise.
    states : int or None
        Number of states of the reduced model: 16 if None, or all if the mechanism has fewer.
    at : float or None
        Time of the planned motion about which the model is linearised [s]; its start if None.
    """

    kind: ClassVar[str] = "lqg"
    deviations: Mapping[str, float]
    effort: Numbers
    noise: Numbers | None = None
    disturbance: Numbers | None = None
    integrators: Mapping[str, float] = field(default_factory=dict)
    coloured: Mapping[str, Any] = field(default_factory=dict)
    states: int | None = None
    at: float | None = None

    def check(self, names: LawNames) -> None:
        """Check the names: see `DescribedLaw.check`."""
        among = {"effort": names.motors, "disturbance": names.motors, "deviations": names.sensors,
                 "noise": names.inputs or names.encoders, "integrators": names.inputs or names.encoders}  # fmt: skip
        for field_name, known_names in among.items():
            given = getattr(self, field_name)
            if isinstance(given, Mapping):
                all_known(given, known_names, field_name, "motor" if known_names is names.motors else "sensor")
        places = [*names.motors, *(f"{point}.{axis}" for point in names.points for axis in "xy")]
        all_known(self.coloured, places, "coloured", "motor or point")
        used = self.made(names.outputs or names.motors, 1.0).outputs
        if names.outputs and used and set(used) != set(names.outputs):
            raise InputError("differ from those of effort", field="outputs", value=", ".join(names.outputs),
                             remedy="leave it out, or give the effort of each")  # fmt: skip

    def made(self, outputs: Sequence[str], period: float) -> DesignedLQG:
        """Return the law: see `DescribedLaw.made`."""
        from paraflex.control.laws.designed import DesignedLQG

        return DesignedLQG(
            self.deviations, _some_of(self.effort, outputs, "effort"), noise=self.noise,
            disturbance=of_names(self.disturbance, outputs), integrators=self.integrators,
            coloured=self.coloured, states=self.states, at=self.at,
        )  # fmt: skip


# Classes of laws by `type` in files.
LAWS: Mapping[str, type[Any]] = {
    law.kind: law
    for law in (
        PIDDescription,
        StateSpaceDescription,
        ComputedTorqueDescription,
        RateFeedbackDescription,
        LQGDescription,
    )
}


def of_names(given: Any, names: Sequence[str]) -> Any:
    """Return the entries of a mapping for some names only; other values unchanged."""
    return {name: each for name, each in given.items() if name in names} if isinstance(given, Mapping) else given


def _some_of(given: Any, names: Sequence[str], field: str) -> Any:
    """Return the entries of a mapping for some names, and check that there is at least one."""
    found = of_names(given, names)
    if isinstance(given, Mapping) and given and not found:
        raise InputError("names no active motor", field=field, value=", ".join(given),
                         remedy=f"give some of {', '.join(names)}")  # fmt: skip
    return found


def _matrix(rows: Any, name: str) -> np.ndarray:
    try:
        found = np.array([*rows], dtype=float)
    except (TypeError, ValueError):
        found = np.full(1, np.nan)
    if not np.all(np.isfinite(found)) or (found.size and found.ndim != 2) or (name == "D" and not found.size):
        raise InputError("is not a matrix of numbers", field=name, value=rows,
                         remedy="give a list of rows, all of one length")  # fmt: skip
    return found


def _size(shape: Sequence[int]) -> str:
    return " x ".join(map(str, shape))
