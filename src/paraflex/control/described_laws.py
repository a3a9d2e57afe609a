"""Control laws as a model file describes them: a kind of law is a class here, listed in `LAWS`."""

from __future__ import annotations

from abc import ABC, abstractmethod
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from typing import TYPE_CHECKING, Any, ClassVar, NamedTuple

import numpy as np

from paraflex.arguments import CheckedFields
from paraflex.control.together import Numbers
from paraflex.errors import InputError
from paraflex.mechanism.quantities import all_known, known

if TYPE_CHECKING:
    from paraflex.control.computed_torque import ComputedTorque
    from paraflex.control.designed import DesignedLQG
    from paraflex.control.discrete import DiscreteModel
    from paraflex.control.laws import JointPID
    from paraflex.control.rates import RateFeedback

Rows = Sequence[Sequence[float]]
# Of a PID law.
_GAINS = ("stiffness", "damping", "integral")


class LawNames(NamedTuple):
    """Sensors and motors that a description names.

    Attributes
    ----------
    inputs, outputs : sequence of str
        Those that it names itself, which may be none.
    sensors, motors : sequence of str
        All that the mechanism has.
    encoders : sequence of str
        Of its motors, of all motors where it names none.
    points : sequence of str
        Of bodies, as "link.tip".
    """

    inputs: Sequence[str]
    outputs: Sequence[str]
    sensors: Sequence[str]
    motors: Sequence[str]
    encoders: Sequence[str]
    points: Sequence[str]


class DescribedLaw(CheckedFields, ABC):
    """What computes torques from readings, as a file describes it; a kind of law is such a class in `LAWS`.

    Attributes
    ----------
    kind : str
        `type` in files.
    whole_torque : bool
        Whether it gives the whole torque, so that no planned torque acts besides.
    """

    kind: ClassVar[str]
    whole_torque: ClassVar[bool] = False

    @abstractmethod
    def check(self, names: LawNames) -> None:
        """Check its numbers and names.

        Raises
        ------
        InputError
            A number that makes no sense, an unknown motor.
        """

    @abstractmethod
    def made(self, outputs: Sequence[str], period: float) -> Any:
        """A law for `SampledController` that drives some motors."""


@dataclass(frozen=True)
class PIDDescription(DescribedLaw):
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

    def check(self, names: LawNames) -> None:
        """See `DescribedLaw`."""
        from paraflex.control.laws import check_pairs, gains_of

        for name in _GAINS:
            gains_of(getattr(self, name), names.motors, name)
        self.made(names.motors, 1.0)
        if names.inputs and names.outputs:
            check_pairs(names.inputs, names.outputs)

    def made(self, outputs: Sequence[str], period: float) -> JointPID:
        """See `DescribedLaw`."""
        from paraflex.control.laws import JointPID

        gains: dict[str, Any] = {name: of_names(getattr(self, name), outputs) for name in _GAINS}
        return JointPID(**gains, project=self.project, cutoff=self.cutoff)


@dataclass(frozen=True)
class StateSpaceDescription(DescribedLaw):
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

    def check(self, names: LawNames) -> None:
        """See `DescribedLaw`."""
        self._model(1.0).check(names.inputs, names.outputs, 1.0)

    def made(self, outputs: Sequence[str], period: float) -> DiscreteModel:
        """See `DescribedLaw`."""
        return self._model(period)

    def _model(self, period: float) -> DiscreteModel:
        from paraflex.control.discrete import DiscreteModel, matrices_of

        return DiscreteModel(*matrices_of(self), period, (), ())


@dataclass(frozen=True)
class ComputedTorqueDescription(DescribedLaw):
    """Computed torque of the rigid mechanism in task space: see `ComputedTorque`.

    Attributes
    ----------
    frequency : float
        Of the end-effector's error, as of an oscillator [Hz].
    damping_ratio : float
        Of it.
    cutoff : float or None
        Of the low-pass filter of rates [Hz].
    """

    kind: ClassVar[str] = "computed-torque"
    whole_torque: ClassVar[bool] = True
    frequency: float
    damping_ratio: float = 0.7
    cutoff: float | None = None

    def check(self, names: LawNames) -> None:
        """See `DescribedLaw`."""
        self.made(names.motors, 1.0)

    def made(self, outputs: Sequence[str], period: float) -> ComputedTorque:
        """See `DescribedLaw`."""
        from paraflex.control.computed_torque import ComputedTorque

        return ComputedTorque(self.frequency, self.damping_ratio, cutoff=self.cutoff)


@dataclass(frozen=True)
class RateFeedbackDescription(DescribedLaw):
    """Feedback of rates of readings: see `RateFeedback`.

    Attributes
    ----------
    gains : mapping of str to mapping of str to float
        By motor and sensor: torque by rate of the reading [N m s by the sensor's unit]. Of a mode those of its motors.
    cutoff : float or None
        Of the low-pass filter of rates [Hz].
    """

    kind: ClassVar[str] = "rate-feedback"
    gains: Mapping[str, Mapping[str, float]]
    cutoff: float | None = None

    def check(self, names: LawNames) -> None:
        """See `DescribedLaw`."""
        for motor, row in self.gains.items():
            known(motor, names.motors, "gains", "motor")
            for sensor in row:
                known(sensor, names.sensors, f"gains.{motor}", "sensor")
        law = self.made(names.motors, 1.0)
        for field_name, given, own in (("inputs", names.inputs, law.inputs), ("outputs", names.outputs, law.outputs)):
            if given and set(given) != set(own):
                raise InputError("are not those of the gains", field=field_name, value=", ".join(given),
                                 remedy="leave it out")  # fmt: skip

    def made(self, outputs: Sequence[str], period: float) -> RateFeedback:
        """See `DescribedLaw`."""
        from paraflex.control.rates import RateFeedback

        return RateFeedback(_some_of(self.gains, outputs, "gains"), cutoff=self.cutoff)


@dataclass(frozen=True)
class LQGDescription(DescribedLaw):
    """LQG designed as a run starts, on the linear model of the mechanism in its mode: see `DesignedLQG`.

    Attributes
    ----------
    deviations : mapping of str to float
        Largest that are allowed of sensors, in their units.
    effort : float or mapping of str to float
        Largest torques or forces [N m, N]. Of a mapping motors that it does not name are not used.
    noise : float or mapping of str to float, optional
        Standard deviations of readings in their units; by default those of rounding to the controller's `quantise`.
    disturbance : float or mapping of str to float, optional
        Standard deviations of random efforts at motors [N m, N]; by default a tenth of `effort`.
    integrators : mapping of str to float
        Sensors whose errors are to vanish under constant loads, with its time constant: see `lqr` [s].
    coloured : mapping of str to (float, float or numerator and denominator)
        Disturbances that last, by motor or by point and axis, "link.tip.x": standard deviation [N m, N], and the
        filter that makes them of noise.
    states : int or None
        Of the reduced model: 16 where None, all if the mechanism has fewer.
    at : float or None
        Time of the planned motion that it is designed about [s]: its start where None.
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
        """See `DescribedLaw`."""
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
            raise InputError("are not those of effort", field="outputs", value=", ".join(names.outputs),
                             remedy="leave it out, or give the effort of each")  # fmt: skip

    def made(self, outputs: Sequence[str], period: float) -> DesignedLQG:
        """See `DescribedLaw`."""
        from paraflex.control.designed import DesignedLQG

        return DesignedLQG(
            self.deviations, _some_of(self.effort, outputs, "effort"), noise=self.noise,
            disturbance=of_names(self.disturbance, outputs), integrators=self.integrators,
            coloured=self.coloured, states=self.states, at=self.at,
        )  # fmt: skip


# What `type` may be in files.
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
    """What is given by name, of some names alone; other values as they are."""
    return {name: each for name, each in given.items() if name in names} if isinstance(given, Mapping) else given


def _some_of(given: Any, names: Sequence[str], field: str) -> Any:
    """What is given by name, of some names, at least of one."""
    found = of_names(given, names)
    if isinstance(given, Mapping) and given and not found:
        raise InputError("none of the motors that act", field=field, value=", ".join(given),
                         remedy=f"give some of {', '.join(names)}")  # fmt: skip
    return found


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
