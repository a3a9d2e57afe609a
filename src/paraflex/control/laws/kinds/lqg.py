"""LQG controller that is designed when a run starts, for the linear model of the mechanism in that run."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import TYPE_CHECKING, ClassVar

from paraflex.control.laws.controllers import Plant
from paraflex.control.laws.estimators import quantisation_noise
from paraflex.control.laws.law import Law, given
from paraflex.control.loop.together import OPEN_LOOP, Numbers
from paraflex.errors import InputError
from paraflex.mechanism import Mechanism, mode_of_motors
from paraflex.mechanism.quantities import all_known, finite, not_negative, positive

if TYPE_CHECKING:
    from paraflex.control.laws.lqg_law import LQGInRun
    from paraflex.linear import LinearModel

_OWN_UNIT = "the unit of the sensor"
# Standard deviation, and cut-off frequency or coefficients of numerator and denominator of a filter.
Coloured = tuple[float, float | Sequence[Sequence[float]]]


def _some(value: int, field: str) -> None:
    if value < 1:
        raise InputError("no such number of states", field=field, value=value, remedy="give 16, or leave it out")


@dataclass(frozen=True)
class DesignedLQG(Law, kind="lqg", title="LQG"):
    """LQG control, designed at the start of a run for the linear model of the mechanism in its mode.

    It is designed for its sensors, motors, period and delay: about the start of the planned motion, or about the
    initial pose of a run without a path, on a reduced model. Motors of other modes are not inputs.

    Attributes
    ----------
    deviations, effort, disturbance, integrators
        See `lqr` and `lqg`. Motors that a mapping of efforts does not name are not used; integrators of sensors that it
        does not read are ignored.
    noise : float or mapping of str to float, optional
        Standard deviations of readings in their units, of all or by sensor; by default `quantisation_noise` of the
        controller's resolution.
    coloured : mapping of str to (float, Filter)
        Coloured disturbances at motors, and at points such as "link.point.x": see `lqg`. Motors that it does not drive
        are ignored.
    states : int, optional
        Number of states of the reduced model; 16 by default, or all if there are fewer.
    at : float, optional
        Time of the planned motion about which the model is linearised [s]; its start by default.

    Raises
    ------
    InputError
        Numbers that are not positive; when started, see `lqg` and `reduce`, readings without noise, or a time without a
        plan.
    """

    _own = ("coloured",)
    reference: ClassVar[str | None] = OPEN_LOOP

    deviations: Mapping[str, float] = given(
        "by sensor the largest deviation allowed, in the unit of the sensor", positive, _OWN_UNIT, by="sensors"
    )
    effort: Numbers = given(
        "the largest torque in N m or N, of all motors or by motor; those not named are not used",
        positive, "N m or N", by="outputs",
    )  # fmt: skip
    noise: Numbers | None = given(
        "the standard deviation of readings, in the unit of the sensor, of all or by sensor; by default of rounding to "
        "quantise", positive, _OWN_UNIT, by="inputs", default=None,
    )  # fmt: skip
    disturbance: Numbers | None = given(
        "the standard deviation of random torques in N m or N, of all motors or by motor; by default a tenth of effort",
        not_negative, "N m or N", by="motors", default=None,
    )  # fmt: skip
    integrators: Mapping[str, float] = given(
        "by sensor the time constant in s with which its error under constant loads decays",
        positive, "s", by="inputs", default={},
    )  # fmt: skip
    coloured: Mapping[str, Coloured] = given(
        'coloured disturbances, by motor or as "link.tip.x" by point and axis: the standard deviation in N m or N and '
        "the cut-off frequency in Hz, or lists of the coefficients of numerator and denominator of a filter in "
        "descending powers of s", default={},
    )  # fmt: skip
    states: int | None = given(
        "the number of states of the reduced model, by default 16, or all if fewer", _some, default=None
    )
    at: float | None = given(
        "the time of the planned motion for which it is designed in s, by default its start", finite, default=None
    )

    def __post_init__(self) -> None:
        super().__post_init__()
        if not self.deviations:
            raise InputError("are none", field="deviations", remedy="give the largest that are allowed, by sensor")
        if isinstance(self.effort, Mapping) and not self.effort:
            raise InputError("there is no motor", field="effort", remedy="name one with its largest torque")
        if self.coloured:
            from paraflex.control.design.coloured import deviation_and_filter

            for name, each in self.coloured.items():
                deviation_and_filter(name, each)

    @property
    def outputs(self) -> tuple[str, ...]:  # pyright: ignore[reportIncompatibleVariableOverride]
        """Motors that the efforts name; empty for one effort of all."""
        return tuple(self.effort) if isinstance(self.effort, Mapping) else ()

    def check(self, mechanism: Mechanism, inputs: Sequence[str], outputs: Sequence[str]) -> None:
        """Check the names: see `Law.check`."""
        super().check(mechanism, inputs, outputs)
        motors = [motor.name for motor in mechanism.motors]
        points = [f"{body.name}.{point}" for body in mechanism.bodies for point in body.points]
        places = [*motors, *(f"{point}.{axis}" for point in points for axis in "xy")]
        all_known(self.coloured, places, "coloured", "motor or point")
        used = self.of_motors(outputs or motors).outputs
        if outputs and used and set(used) != set(outputs):
            raise InputError("differ from those of effort", field="outputs", value=", ".join(outputs),
                             remedy="leave it out, or give the effort of each")  # fmt: skip

    def start(self, plant: Plant) -> LQGInRun:
        """Design the controller, and return it in a run: see `Law.start`."""
        from paraflex.control.design.regulators import lqg
        from paraflex.linear import reduce

        own = [motor.name for motor in plant.mechanism.motors]
        coloured = {name: each for name, each in self.coloured.items() if name in plant.outputs or name not in own}
        points = tuple(dict.fromkeys(name.rpartition(".")[0] for name in coloured if name not in own))
        full = self._model(plant, points)
        flexible = any(body.nf for body in full.minimal.system.bodies)
        few = reduce(full, self.states) if flexible else full
        integrators = {name: time for name, time in self.integrators.items() if name in plant.inputs}
        design = lqg(few, plant.period, delay=plant.delay, measured=plant.inputs, deviations=self.deviations,
                     effort=self.effort, noise=self._noise_of(plant), disturbance=self.disturbance,
                     integrators=integrators, coloured=coloured)  # fmt: skip
        return design.in_run(plant)

    def _model(self, plant: Plant, points: tuple[str, ...]) -> LinearModel:
        """Return the full linear model, with its motors and forces at points as inputs."""
        from paraflex.linear import linearise

        mode = mode_of_motors(plant.mechanism, plant.outputs)
        if plant.task is not None:
            return linearise(plant.task, mode=mode, at=self.at, forces=points)
        if self.at is not None:
            raise InputError("there is no planned motion", field="at", value=self.at, remedy="leave it out")
        return linearise(plant.mechanism, mode=mode, start=plant.state, forces=points)

    def _noise_of(self, plant: Plant) -> dict[str, float]:
        """Return the standard deviations of readings by sensor: the given ones, else those of rounding."""
        if self.noise is not None and not isinstance(self.noise, Mapping):
            return dict.fromkeys(plant.inputs, self.noise)
        pairs = zip(plant.inputs, plant.resolution or (0.0,) * len(plant.inputs), strict=True)
        noise = {name: quantisation_noise(one) for name, one in pairs if one} | dict(self.noise or {})
        if missing := [name for name in plant.inputs if name not in noise]:
            raise InputError("has no noise", field="noise", value=missing[0],
                             remedy="give its standard deviation, or quantise, the resolution of readings")  # fmt: skip
        return {name: noise[name] for name in plant.inputs}
