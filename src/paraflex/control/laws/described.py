"""Controllers as described in a model file: frozen, without states, for any actuation mode."""

from __future__ import annotations

from collections.abc import Callable, Iterable, Mapping, Sequence
from dataclasses import dataclass, field
from typing import TYPE_CHECKING, Any

import numpy as np

from paraflex.arguments import CheckedFields, named_in_errors
from paraflex.control.laws.described_laws import LawNames, of_names
from paraflex.control.loop.together import Numbers, check_distinct, check_name, check_whole, multiple_of
from paraflex.errors import InputError, renamed, within
from paraflex.mechanism import Mechanism, TimeProfile
from paraflex.mechanism.loads import InTime
from paraflex.mechanism.measured import encoders_of, measured_sensors
from paraflex.mechanism.quantities import all_known

if TYPE_CHECKING:
    from paraflex.control.loop.chain import SampledController

# Table of a model file that holds the controllers; and the word that selects none of them.
TABLE, NONE = "controller", "none"


@named_in_errors(
    "a description of a controller", "a ControllerDescription, as [controller.NAME] of a model file is read"
)
@dataclass(frozen=True)
class ControllerDescription(CheckedFields):
    """Sampled controller as a model file describes it: a control law and its signal chain, see `SampledController`.

    Entries given by motor or sensor are used for those motors and sensors that a mode has.

    Attributes
    ----------
    name : str
        Name of the controller.
    law : DescribedLaw
        Control law, one of the descriptions in `LAWS`.
    period, delay : float
        Sampling period, and delay from a sample until its torques act [s].
    inputs, outputs : tuple of str
        Sensors and motors. If empty, those of the law, else the encoders of its motors and all motors of a mode.
    reference : "plan", "open-loop" or mapping of str to float or TimeProfile, optional
        Reference that is subtracted from the readings; the law's own by default.
    limits : float, pair or mapping of str to either, optional
        Limits of the torques [N m, N]; none by default.
    rates : float or mapping of str to float, optional
        Limits of the rates of the torques [N m/s, N/s]; none by default.
    quantise : float or mapping of str to float, optional
        Resolution of the readings; not quantised by default.
    filters : mapping of str to float, or to numerator and denominator
        Filters of the readings by sensor: cut-off frequency [Hz], or a transfer function.
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

    @property
    def whole_torque(self) -> bool:
        """Whether the law gives the whole torque, so that no planned torque acts as well."""
        return bool(self.law.whole_torque)

    def check(self, mechanism: Mechanism) -> None:
        """Check the names and numbers of the description.

        Parameters
        ----------
        mechanism : Mechanism
            Mechanism to be controlled.

        Raises
        ------
        InputError
            A sensor or a motor that the mechanism does not have, or a number out of range.
        """
        motors = [motor.name for motor in mechanism.motors]
        sensors = [sensor.name for sensor in measured_sensors(mechanism)]
        encoders = encoders_of(mechanism, self.outputs or motors)
        points = [f"{body.name}.{point}" for body in mechanism.bodies for point in body.points]
        with within(f"{TABLE}.{self.name}"):
            self._check(LawNames(self.inputs, self.outputs, sensors, motors, encoders, points))

    def _check(self, names: LawNames) -> None:
        for field_name, all_names, what in (("inputs", names.sensors, "sensor"), ("outputs", names.motors, "motor")):
            check_distinct(getattr(self, field_name), all_names, field_name, what)
        self.law.check(names)
        law = self.law.made(self.outputs or names.motors, self.period)
        sampled = self._sampled(law, {"reference": self.reference})
        among = sampled.inputs or names.sensors
        if isinstance(self.reference, Mapping):
            all_known(self.reference, among, "reference", "sensor")
        sampled.check(among, sampled.outputs or names.motors)

    def made(self, mechanism: Mechanism, motors: Sequence[str]) -> SampledController:
        """Return the controller for a mode with some motors of a mechanism.

        Parameters
        ----------
        mechanism : Mechanism
            Mechanism to be controlled.
        motors : sequence of str
            Motors of the mode.

        Raises
        ------
        InputError
            See `check`.
        """
        law = self.law.made(self.outputs or tuple(motors), self.period)
        outputs = self.outputs or tuple(getattr(law, "outputs", ())) or tuple(motors)
        inputs = self.inputs or tuple(getattr(law, "inputs", ())) or encoders_of(mechanism, outputs)
        chosen = {
            "reference": _functions(of_names(self.reference, inputs)),
            "limits": of_names(self.limits, outputs),
            "rates": of_names(self.rates, outputs),
            "quantise": of_names(self.quantise, inputs),
            "filters": of_names(self.filters, inputs),
        }
        return self._sampled(law, chosen)

    def _sampled(self, law: Any, chosen: Mapping[str, Any]) -> SampledController:
        from paraflex.control.loop.chain import SampledController

        more = {name: getattr(self, name) for name in ("limits", "rates", "quantise", "filters")} | dict(chosen)
        return SampledController(
            law, period=self.period, delay=self.delay, inputs=self.inputs or None, outputs=self.outputs or None,
            name=self.name, **more,
        )  # fmt: skip


def check_controllers(controllers: Mapping[str, ControllerDescription], mechanism: Mechanism) -> None:
    """Check the controllers of a model: see `ControllerDescription.check`.

    Raises
    ------
    InputError
        An error of a description, or the reserved name "none".
    """
    for name, one in controllers.items():
        with renamed(TABLE):
            check_name(name)
        if name == NONE:
            raise InputError("is reserved for open loop", field=f"{TABLE}.{name}", remedy="choose another name")
        one.check(mechanism)


def check_together(controllers: Iterable[ControllerDescription]) -> None:
    """Check that controllers may act together.

    Raises
    ------
    InputError
        A period that is not a multiple of the shortest one, or two laws each of which gives the whole torque.
    """
    several = list(controllers)
    with within(TABLE):
        for one in several:
            multiple_of(one.name, one.period, min(each.period for each in several))
        check_whole([one.name for one in several if one.whole_torque])


def _functions(reference: Any) -> Any:
    """Return references with angle laws replaced by functions of time."""
    if not isinstance(reference, Mapping):
        return reference
    return {name: _value(each) if isinstance(each, TimeProfile) else each for name, each in reference.items()}


def _value(law: TimeProfile) -> Callable[[float], float]:
    return lambda t: float(law.evaluate(np.array([t]))[0][0])
