"""Records of sampled controllers in datasets of runs, each with its own sample times."""

from __future__ import annotations

import json
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import TYPE_CHECKING, Any

import numpy as np
import xarray as xr

from paraflex.arrays import Array, Brief
from paraflex.errors import InputError
from .formulas import largest_norm
from .numbers import finite_or_none, largest, name_units

if TYPE_CHECKING:
    from paraflex.control.loop.run_loop import ControllerRecord

# Attribute of a dataset that describes its controllers by name.
CONTROLLERS = "controllers"
# Part of the torques that only strains links against one another.
INTERNAL = "internal_torque"
# Dimensions of a controller NAME, as KIND_NAME; the coordinate of SAMPLE holds the sample times.
SAMPLE, INPUT, OUTPUT = "sample", "input", "output"
# Variables of a controller, as KIND_NAME: dimension in addition to that of samples, field of its record, and meaning.
READINGS, REQUESTED, APPLIED = "reading", "wanted_torque", "given_torque"
_VARIABLES = {
    READINGS: (INPUT, "readings", "reading of a sensor that the law receives, quantised and filtered"),
    REQUESTED: (OUTPUT, "requested", "torque of the law"),
    APPLIED: (OUTPUT, "applied", "torque within the limits"),
}
_ACTS = "acts after the delay, from one sample to the next; on the joint's second body, as `torque`"


@dataclass(frozen=True)
class ControllerData(Brief):
    """Controller in a dataset.

    Attributes
    ----------
    name, law : str
        Name of the controller, and description of its control law.
    period, delay : float
        Sampling period and delay [s].
    limits : mapping of str to pair
        Lowest and highest torque of each motor [N m, N]; None where there is no limit.
    rates : mapping of str to float or None
        Rate limit of each motor's torque [N m/s, N/s]; None where there is no limit.
    units : mapping of str to str
        Unit of each sensor and motor.
    data : xarray.Dataset
        Sample times `sample`, and over them `reading`, `wanted_torque` (before limiting) and `given_torque` (after
        saturation and rate limiting); the times are common to all modes.
    """

    name: str
    law: str
    period: float
    delay: float
    limits: Mapping[str, Sequence[float | None]]
    rates: Mapping[str, float | None]
    units: Mapping[str, str]
    data: xr.Dataset

    @property
    def limited(self) -> xr.DataArray:
        """Boolean array of the samples at which a limit was active."""
        return (self.data[REQUESTED] != self.data[APPLIED]).where(self.data[APPLIED].notnull(), False).any(OUTPUT)

    @property
    def samples(self) -> xr.DataArray:
        """Number of samples of each run."""
        return self.data[APPLIED].notnull().any(OUTPUT).sum(SAMPLE)

    @property
    def times(self) -> Array:
        """Sample times [s]."""
        return self.data[SAMPLE].values

    def signals(self, variable: str) -> tuple[list[str], Array]:
        """Return the names of the sensors or motors of a variable, and its values (modes, signals, samples)."""
        dim, *_ = _VARIABLES[variable]
        return list(map(str, self.data[dim].values)), self.data[variable].transpose("mode", dim, SAMPLE).values


def dimension(kind: str, controller: str) -> str:
    """Return the name of a dimension or variable of a controller."""
    return f"{kind}_{controller}"


def with_controllers(data: xr.Dataset, runs: Sequence[Sequence[ControllerRecord]], motors: Sequence[str]) -> xr.Dataset:
    """Return a dataset with the records of the controllers of its runs; unchanged if there are no controllers.

    Parameters
    ----------
    data : xarray.Dataset
        Results of runs along a path, or of one run without a path, which has no modes.
    runs : sequence of sequences of ControllerRecord
        Records of each run, in the order of the modes. In the dataset, samples that a run did not reach and motors that
        are not active in its mode are NaN.
    motors : sequence of str
        Names of the mechanism's motors, in their order.

    Raises
    ------
    InputError
        Controllers with the same name have different periods, delays or laws.
    """
    names = list(dict.fromkeys(one.name for records in runs for one in records))
    described = {}
    for name in names:
        own = [next((one for one in records if one.name == name), None) for records in runs]
        array, about = _controller(name, own, motors)
        if "mode" not in data.dims:
            array = array.isel(mode=0)
        data, described[name] = data.assign(array), about
    return data.assign_attrs({CONTROLLERS: json.dumps(described)}) if described else data


def _controller(
    name: str, runs: Sequence[ControllerRecord | None], motors: Sequence[str]
) -> tuple[xr.Dataset, dict[str, Any]]:
    """Return the variables of a controller over modes and samples, and its description."""
    done = [one for one in runs if one is not None]
    first = max(done, key=lambda one: one.t.size)
    for one in done:
        for field in ("law", "period", "delay"):
            if getattr(one, field) != getattr(first, field):
                raise InputError(
                    "controllers of one name differ", field=f"{name}.{field}", value=getattr(one, field),
                    remedy="give each a name of its own",
                )  # fmt: skip
    inputs = {sensor: unit for one in done for sensor, unit in zip(one.inputs, one.input_units, strict=True)}
    outputs = {motor: unit for one in done for motor, unit in zip(one.outputs, one.output_units, strict=True)}
    outputs = {motor: outputs[motor] for motor in motors if motor in outputs}
    labels = {INPUT: inputs, OUTPUT: outputs}
    out = xr.Dataset(coords={dimension(SAMPLE, name): first.t})
    out[dimension(SAMPLE, name)].attrs = {"long_name": f"times of samples of controller {name}", "units": "s"}
    for variable, (kind, field, meaning) in _VARIABLES.items():
        values = np.full((len(runs), first.t.size, len(labels[kind])), np.nan)
        for row, one in zip(values, runs, strict=True):
            if one is not None:
                columns = [list(labels[kind]).index(label) for label in (one.inputs if kind == INPUT else one.outputs)]
                row[: one.t.size, columns] = getattr(one, field)
        dims = ("mode", dimension(SAMPLE, name), dimension(kind, name))
        units = list(labels[kind].values())
        array = xr.DataArray(values, {dims[2]: list(labels[kind])}, dims)
        array.attrs["long_name"] = f"{meaning}, controller {name}"
        name_units(array, list(dict.fromkeys(units)), units)
        array.attrs |= {} if kind == INPUT else {"comment": _ACTS}
        array.attrs |= {"period": first.period, "delay": first.delay}
        out[dimension(variable, name)] = array
    return out, _about(done, outputs) | {"inputs": inputs, "outputs": outputs}


def _about(done: Sequence[ControllerRecord], outputs: Mapping[str, str]) -> dict[str, Any]:
    """Return law, period, delay and bounds of a controller; None where a torque has no bound."""
    first = done[0]
    limits, rates = {}, {}
    for motor in outputs:
        one = next(each for each in done if motor in each.outputs)
        at = one.outputs.index(motor)
        limits[motor] = [finite_or_none(float(bound)) for bound in one.limits[at]]
        rates[motor] = finite_or_none(float(one.rates[at]))
    return {"law": first.law, "period": first.period, "delay": first.delay, "limits": limits, "rates": rates}


def controllers_of(data: xr.Dataset) -> list[ControllerData]:
    """Return the controllers of a dataset or of one of its runs; an empty list if there are none."""
    found = []
    for name, about in json.loads(data.attrs.get(CONTROLLERS, "{}")).items():
        own = {dimension(kind, name): kind for kind in (SAMPLE, INPUT, OUTPUT, *_VARIABLES)}
        part = data[[dimension(variable, name) for variable in _VARIABLES]].rename(own)
        units = about["inputs"] | about["outputs"]
        numbers = (about["period"], about["delay"], about["limits"], about["rates"])
        found.append(ControllerData(name, about["law"], *numbers, units, part))
    return found


def controller_names(data: xr.Dataset) -> list[str]:
    """Return the names of the controllers of a dataset."""
    return list(json.loads(data.attrs.get(CONTROLLERS, "{}")))


def controller_variables(name: str) -> list[str]:
    """Return the names of the variables of a controller."""
    return [dimension(variable, name) for variable in _VARIABLES]


def controller_figures(run: xr.Dataset) -> dict[str, Any]:
    """Return the controllers of one run as plain numbers; empty if results have none.

    Returns
    -------
    dict
        `controllers.<name>` with law, period and delay [s], samples, saturated_share, and for each motor `torques` with
        unit, wanted_max, given_max, lowest, highest and rate, None where there is no limit; and, if the dataset has
        internal torques, `internal_torque_max`, the largest norm of their vector.
    """
    figures = {}
    for one in controllers_of(run):
        samples = int(one.samples)
        figures[one.name] = {
            "law": one.law,
            "period": one.period,
            "delay": one.delay,
            "samples": samples,
            "saturated_share": float(one.limited.sum()) / samples if samples else None,
            "torques": {motor: _torque(one, motor) for motor in map(str, one.data[OUTPUT].values)},
        }
    internal: dict[str, Any] = {}
    if INTERNAL in run:
        known = run[INTERNAL].transpose("time", "motor").values
        known = known[np.isfinite(known).all(axis=1)]
        internal["internal_torque_max"] = float(largest_norm(known)) if len(known) else None
    return internal | ({CONTROLLERS: figures} if figures else {})


def _torque(one: ControllerData, motor: str) -> dict[str, Any]:
    lowest, highest = one.limits[motor]
    most = {f"{key}_max": largest(one.data[name].sel({OUTPUT: motor}).values)
            for key, name in (("wanted", REQUESTED), ("given", APPLIED))}  # fmt: skip
    return {"unit": one.units[motor], **most, "lowest": lowest, "highest": highest, "rate": one.rates[motor]}
