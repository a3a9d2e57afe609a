"""LQG controller that is designed when a run starts, for the linear model of the mechanism in that run."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

from paraflex.arguments import checked_arguments
from paraflex.arrays import Array
from paraflex.control.design.coloured import deviation_and_filter
from paraflex.control.design.regulators import LQGDesign, lqg
from paraflex.control.laws.controllers import Plant
from paraflex.control.laws.estimators import quantisation_noise
from paraflex.control.laws.linear_law import LinearLaw
from paraflex.control.loop.references import OPEN_LOOP
from paraflex.control.loop.together import Numbers, numbers_by_name
from paraflex.errors import InputError
from paraflex.linear import LinearModel, linearise, reduce
from paraflex.mechanism import mode_of_motors
from paraflex.mechanism.quantities import finite, not_negative, positive


class DesignedLQG:
    """LQG design for the linear model of the mechanism that it controls: a law for `SampledController`.

    It is designed when it starts, for its sensors, motors, period and delay: about the start of the planned motion, or
    about the initial pose of a run without a path, on a reduced model. Motors of other modes are not inputs.

    Parameters
    ----------
    deviations, effort, disturbance, integrators
        See `lqr` and `lqg`. Integrators of sensors that it does not read are ignored.
    noise : float or mapping of str to float, optional
        Standard deviations of readings in their units, of all or by sensor; by default `quantisation_noise` of the
        controller's resolution.
    coloured : mapping of str to (float, Filter), optional
        Coloured disturbances at motors, and at points such as "link.point.x": see `lqg`. Motors that it does not drive
        are ignored.
    states : int, optional
        Number of states of the reduced model; 16 by default, or all if there are fewer.
    at : float, optional
        Time of the planned motion about which the model is linearised [s]; its start by default.

    Attributes
    ----------
    design : LQGDesign or None
        Design, available once started.

    Raises
    ------
    InputError
        Numbers that are not positive; when started, see `lqg` and `reduce`, readings without noise, or a time without a
        plan.
    """

    reference: str | None = OPEN_LOOP

    @checked_arguments()
    def __init__(
        self,
        deviations: Mapping[str, float],
        effort: Numbers,
        *,
        noise: Numbers | None = None,
        disturbance: Numbers | None = None,
        integrators: Mapping[str, float] | None = None,
        coloured: Mapping[str, Any] | None = None,
        states: int | None = None,
        at: float | None = None,
    ) -> None:
        if not deviations:
            raise InputError("are none", field="deviations", remedy="give the largest that are allowed, by sensor")
        if isinstance(effort, Mapping) and not effort:
            raise InputError("there is no motor", field="effort", remedy="name one with its largest torque")
        for field, given, unit, check in (
            ("deviations", deviations, "the unit of the sensor", positive),
            ("effort", effort, "N m or N", positive),
            ("noise", noise, "the unit of the sensor", positive),
            ("integrators", integrators, "s", positive),
            ("disturbance", disturbance, "N m or N", not_negative),
        ):
            if given is not None:
                numbers_by_name(given, tuple(given) if isinstance(given, Mapping) else (), field, unit, check)
        for name, each in (coloured or {}).items():
            deviation_and_filter(name, each)
        finite(at or 0.0, "at")
        if states is not None and states < 1:
            raise InputError(
                "no such number of states", field="states", value=states, remedy="give 16, or leave it out"
            )
        self.outputs: tuple[str, ...] = tuple(effort) if isinstance(effort, Mapping) else ()
        self._weights = {"deviations": deviations, "effort": effort, "disturbance": disturbance}
        self._integrators: Mapping[str, float] = integrators or {}
        self._coloured: Mapping[str, Any] = coloured or {}
        self._noise, self._states, self._at = noise, states, at
        self.design: LQGDesign | None = None

    @property
    def title(self) -> str:
        """Short description of the law, with the number of states of the model once designed."""
        return "LQG" if self.design is None else f"LQG of {self.design.regulator.plant.own} states"

    def start(self, plant: Plant) -> None:
        """Design the controller and prepare for a run: see `Controller.start`."""
        own = [motor.name for motor in plant.mechanism.motors]
        coloured = {name: each for name, each in self._coloured.items() if name in plant.outputs or name not in own}
        points = tuple(dict.fromkeys(name.rpartition(".")[0] for name in coloured if name not in own))
        full = self._model(plant, points)
        flexible = any(body.nf for body in full.minimal.system.bodies)
        few = reduce(full, self._states) if flexible else full
        integrators = {name: time for name, time in self._integrators.items() if name in plant.inputs}
        self.design = lqg(few, plant.period, delay=plant.delay, measured=plant.inputs, noise=self._noise_of(plant),
                          integrators=integrators, coloured=coloured, **self._weights)  # fmt: skip
        self._law = self.design.law()
        self._law.start(plant)
        self.holding_torques: Array = self._law.holding_torques

    def step(self, k: int, t: float, y: Array) -> Array:
        """Compute the torques of a sample from errors y of readings: see `Controller.step`."""
        return self._law.step(k, t, y)

    def limited(self, torques: Array) -> None:
        """Record the torques after limits: see `LQGLaw.limited`."""
        self._law.limited(torques)

    def linear_law(self) -> LinearLaw:
        """Return the law for the compiled time loop: see `LQGLaw.linear_law`."""
        return self._law.linear_law()

    def _model(self, plant: Plant, points: tuple[str, ...]) -> LinearModel:
        """Return the full linear model, with its motors and forces at points as inputs."""
        mode = mode_of_motors(plant.mechanism, plant.outputs)
        if plant.task is not None:
            return linearise(plant.task, mode=mode, at=self._at, forces=points)
        if self._at is not None:
            raise InputError("there is no planned motion", field="at", value=self._at, remedy="leave it out")
        return linearise(plant.mechanism, mode=mode, start=plant.state, forces=points)

    def _noise_of(self, plant: Plant) -> dict[str, float]:
        """Return the standard deviations of readings by sensor: the given ones, else those of rounding."""
        given = self._noise if isinstance(self._noise, Mapping) else {}
        if self._noise is not None and not isinstance(self._noise, Mapping):
            return dict.fromkeys(plant.inputs, self._noise)
        resolution = plant.resolution or (0.0,) * len(plant.inputs)
        rounding = {name: quantisation_noise(one) for name, one in zip(plant.inputs, resolution, strict=True) if one}
        missing = [name for name in plant.inputs if name not in rounding and name not in given]
        if missing:
            raise InputError("has no noise", field="noise", value=missing[0],
                             remedy="give its standard deviation, or quantise, the resolution of readings")  # fmt: skip
        return {name: given.get(name, rounding.get(name, 0.0)) for name in plant.inputs}
