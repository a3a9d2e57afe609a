"""Control laws: the base class of all kinds of laws, and the form in which a law acts in a run."""

from __future__ import annotations

from abc import ABC, abstractmethod
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import MISSING, dataclass, field, fields, replace
from typing import TYPE_CHECKING, Any, ClassVar, Literal, Self

import numpy as np

from paraflex.arguments import CheckedFields, named_in_errors
from paraflex.arrays import Array
from paraflex.errors import InputError
from paraflex.mechanism import Mechanism
from paraflex.mechanism.measured import encoders_of, measured_sensors
from paraflex.mechanism.quantities import all_known, enter_kind, field_metadata
from .controllers import Plant

# Kinds of control laws by their names in files; `kinds` imports the modules that define those of paraflex.
LAWS: dict[str, type[Law]] = {}

_NO_NAMES: tuple[str, ...] = ()
# Names that the keys of a field are: motors; motors that the law drives; sensors; sensors that the law reads.
By = Literal["motors", "outputs", "sensors", "inputs"]


def given(description: str, check: Any = None, unit: str = "", *, by: By | None = None, default: Any = MISSING) -> Any:
    """Return a field of a law.

    Parameters
    ----------
    description, check, unit
        Description in files with the unit after "in", check of each number, and unit that its error asks for.
    by : "motors", "outputs", "sensors" or "inputs", optional
        Names that the keys of a field with numbers by name are.
    default : any, optional
        Default value; by default the field is required.
    """
    value: Any = {"default_factory": dict} if default == {} else {"default": default}
    return field(**value, metadata=field_metadata(description, check, unit) | {"by": by})


class StartedLaw(ABC):
    """Control law in a run. It does not change in the run: its state is data that `step` takes and returns.

    Attributes
    ----------
    title : str
        Short description of the law, if it is not that of its class.
    holding_torques : (outputs,) array or float
        Torques that hold the equilibrium at the start, part of those of the law; they act before the first sample.
    """

    title: str = ""
    holding_torques: Any = 0.0

    @abstractmethod
    def step(self, state: Any, k: int, t: float, y: Array) -> tuple[Any, Any]:
        """Return the torques (outputs,) of a sample, and the state after it.

        Parameters
        ----------
        state : any
            State that the last sample returned; None at the first one. It is never changed in place.
        k : int
            Number of the sample.
        t : float
            Time of the sample [s].
        y : (inputs,) array
            Readings less their references.
        """

    def limited(self, state: Any, torques: Array) -> Any:
        """Return the state after a sample whose torques (outputs,) are limited to those given."""
        return state

    def __deepcopy__(self, memo: dict[int, Any]) -> Self:
        return self


@named_in_errors("a control law", "a law of any kind, say JointPID")
@dataclass(frozen=True)
class Law(CheckedFields, ABC):
    """Control law for `SampledController` and for files: the base class of all kinds.

    A subclass such as `class JointPID(Law, kind="pid", title="PID of joints")` defines a kind of law: its fields and
    its method `start`, and `check`, `inputs` and `outputs` if the defaults do not apply. The metadata of the fields
    (`given`) describe them in files and check their numbers. Fields by motor are narrowed to the motors of a mode.

    Attributes
    ----------
    kind : str
        Value of `type` in files; empty for a law that files do not have.
    title : str
        Short description of the law in results.
    whole_torque : bool
        Whether the law gives the whole torque, so that no planned torque acts as well.
    absolute : bool
        Whether the law takes the readings themselves, without a reference.
    reference : "plan", "open-loop" or None
        Reference that is subtracted from the readings unless the controller has another.
    inputs, outputs : tuple of str
        Sensors and motors that the law names itself; empty if it names none.
    """

    kind: ClassVar[str] = ""
    title: ClassVar[str] = ""
    whole_torque: ClassVar[bool] = False
    absolute: ClassVar[bool] = False
    reference: ClassVar[str | None] = None
    if TYPE_CHECKING:
        inputs: ClassVar[Any]
        outputs: ClassVar[Any]
    else:
        # Without annotations, so that a subclass may have fields of these names in its own order.
        inputs, outputs = _NO_NAMES, _NO_NAMES

    def __init_subclass__(cls, *, kind: str = "", title: str = "") -> None:
        super().__init_subclass__()
        if "step" in vars(cls):
            raise TypeError(f"{cls.__name__} has a method `step`: give it to the object that `start` returns")
        cls.title = title or cls.title
        if kind:
            enter_kind(LAWS, kind, cls, "law")
            cls.kind = kind

    def __post_init__(self) -> None:
        super().__post_init__()
        for each in fields(self):
            if (check := each.metadata.get("check")) is not None:
                for place, number in _numbers(getattr(self, each.name), each.name):
                    check(number, place)

    def __deepcopy__(self, memo: dict[int, Any]) -> Self:
        return self

    @abstractmethod
    def start(self, plant: Plant) -> StartedLaw:
        """Return the law in the form in which it acts in a run: a `LinearLaw` if it is linear.

        Raises
        ------
        InputError
            A law that does not fit the plant.
        """

    def check(self, mechanism: Mechanism, inputs: Sequence[str], outputs: Sequence[str]) -> None:
        """Check the names of motors and sensors in the fields; numbers are checked when the law is made.

        Parameters
        ----------
        mechanism : Mechanism
            Mechanism to be controlled.
        inputs, outputs : sequence of str
            Sensors and motors that the controller names itself; may be empty.

        Raises
        ------
        InputError
            An unknown motor or sensor.
        """
        motors = [motor.name for motor in mechanism.motors]
        sensors = [sensor.name for sensor in measured_sensors(mechanism)]
        among = {"motors": motors, "outputs": motors, "sensors": sensors,
                 "inputs": inputs or encoders_of(mechanism, outputs or motors)}  # fmt: skip
        for each in fields(self):
            wanted, given = each.metadata.get("by"), getattr(self, each.name)
            if wanted and isinstance(given, Mapping):
                all_known(given, among[wanted], each.name, "motor" if among[wanted] is motors else "sensor")

    def of_motors(self, motors: Sequence[str]) -> Self:
        """Return the law with the entries of some motors only.

        Raises
        ------
        InputError
            No entry of these motors in a field that names those that the law drives.
        """
        changes = {}
        for each in fields(self):
            wanted, given = each.metadata.get("by"), getattr(self, each.name)
            if wanted in ("motors", "outputs") and isinstance(given, Mapping):
                changes[each.name] = found = of_names(given, motors)
                if wanted == "outputs" and given and not found:
                    raise InputError("names no active motor", field=each.name, value=", ".join(given),
                                     remedy=f"give some of {', '.join(motors)}")  # fmt: skip
        return replace(self, **changes)


def of_names(given: Any, names: Sequence[str]) -> Any:
    """Return the entries of a mapping for some names only; other values unchanged."""
    return {name: each for name, each in given.items() if name in names} if isinstance(given, Mapping) else given


def _numbers(given: Any, place: str) -> Iterator[tuple[str, Any]]:
    """Yield the numbers of a field with their places: one for all, one for each, by name, or none."""
    if isinstance(given, Mapping):
        for name, each in given.items():
            yield from _numbers(each, f"{place}.{name}")
    elif isinstance(given, Sequence | np.ndarray):
        yield from ((place, each) for each in np.ravel(np.asarray(given, dtype=float)))
    elif given is not None:
        yield place, given
