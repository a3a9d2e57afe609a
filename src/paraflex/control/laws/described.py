"""Controllers as described in a model file: frozen, without states, for any actuation mode."""

from __future__ import annotations

from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass, fields
from typing import TYPE_CHECKING, Any

from paraflex.arguments import CheckedFields, named_in_errors
from paraflex.control.loop.together import Numbers, check_distinct, check_name, check_whole, multiple_of
from paraflex.errors import InputError, renamed, within
from paraflex.mechanism import Mechanism
from paraflex.mechanism.loads import InTime
from paraflex.mechanism.measured import encoders_of, measured_sensors
from paraflex.mechanism.quantities import all_known
from .kinds import LAWS
from .law import Law, given, of_names

if TYPE_CHECKING:
    from paraflex.control.loop.chain import SampledController

# Table of a model file that holds the controllers; and the word that selects none of them.
TABLE, NONE = "controller", "none"

References = str | Mapping[str, InTime]
Limits = float | tuple[float, float] | Mapping[str, float | tuple[float, float]]
_DEFAULTS = ", ".join(f'"{law.reference}" with "{kind}"' for kind, law in LAWS.items() if law.reference)


@named_in_errors(
    "a description of a controller", "a ControllerDescription, as [controller.NAME] of a model file is read"
)
@dataclass(frozen=True)
class ControllerDescription(CheckedFields):
    """Sampled controller as a model file describes it: a control law and its signal chain, see `SampledController`.

    Entries given by motor or sensor are used for those motors and sensors that a mode has.

    The fields are arguments of `SampledController`.

    Attributes
    ----------
    law : Law
        Control law, of a kind in `kinds.LAWS` if a file is to hold it.
    inputs, outputs : tuple of str
        Sensors and motors. If empty, those of the law, else the encoders of its motors and all motors of a mode.
    """

    _own = ("reference", "limits", "filters")
    name: str
    law: Law
    period: float = given("the time between samples in s")
    delay: float = given("the time from a sample until its torques act in s", default=0.0)
    inputs: tuple[str, ...] = given(
        'sensors, also joints of motors (their encoders), "x" and "y" of the end-effector; by default the encoders of '
        "its motors", default=(),
    )  # fmt: skip
    outputs: tuple[str, ...] = given("motors; by default all of a mode", default=())
    reference: References | None = given(
        'the reference subtracted from readings: "plan", the planned motion; "open-loop", the readings where the '
        "planned torques alone drive the mechanism; or by sensor a number or an expression of the time t, in the unit "
        f"of the sensor; by default {_DEFAULTS}, nothing with others", by="inputs", default=None,
    )  # fmt: skip
    limits: Limits | None = given(
        "the largest magnitude of torques in N m or N, or a pair of the lowest and the highest; of all motors or by "
        "motor", by="motors", default=None,
    )  # fmt: skip
    rates: Numbers | None = given(
        "the largest change of torques in N m/s or N/s, of all motors or by motor", by="motors", default=None
    )
    quantise: Numbers | None = given(
        "the resolution of readings, in the unit of the sensor, of all or by sensor", by="inputs", default=None
    )
    filters: Mapping[str, float | Sequence[Sequence[float]]] = given(
        "by sensor the cut-off frequency of a low-pass of first order in Hz, or lists of the coefficients of numerator "
        "and denominator in descending powers of s", by="inputs", default={},
    )  # fmt: skip

    @property
    def whole_torque(self) -> bool:
        """Whether the law gives the whole torque, so that no planned torque acts as well."""
        return self.law.whole_torque

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
        with within(f"{TABLE}.{self.name}"):
            check_distinct(self.inputs, sensors, "inputs", "sensor")
            check_distinct(self.outputs, motors, "outputs", "motor")
            self.law.check(mechanism, self.inputs, self.outputs)
            sampled = self._sampled(self.law.of_motors(self.outputs or motors))
            among = sampled.inputs or sensors
            if isinstance(self.reference, Mapping):
                all_known(self.reference, among, "reference", "sensor")
            sampled.check(among, sampled.outputs or motors)

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
        law = self.law.of_motors(self.outputs or tuple(motors))
        outputs = self.outputs or law.outputs or tuple(motors)
        inputs = self.inputs or law.inputs or encoders_of(mechanism, outputs)
        among = {"inputs": inputs, "motors": outputs}
        chosen = {each.name: of_names(getattr(self, each.name), among[each.metadata["by"]])
                  for each in fields(self) if each.metadata.get("by")}  # fmt: skip
        return self._sampled(law, **chosen)

    def _sampled(self, law: Law, **chosen: Any) -> SampledController:
        from paraflex.control.loop.chain import SampledController

        names = ("name", "period", "delay", "reference", "limits", "rates", "quantise", "filters")
        own = {name: getattr(self, name) for name in names} | chosen
        return SampledController(law, inputs=self.inputs or None, outputs=self.outputs or None, **own)


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
