"""Labelled dataset of linear models, one for each actuation mode: matrices, poles, zeros, responses, mode shapes."""

from __future__ import annotations

import json
from collections.abc import Sequence
from importlib.metadata import version
from typing import Any

import numpy as np
import xarray as xr

from paraflex.arguments import checked_arguments
from paraflex.arrays import Array, Complex, Numbers
from paraflex.errors import InputError
from paraflex.linear.branches import pole_branches
from paraflex.linear.model import LinearModel
from paraflex.linear.motions import Motions
from .drawing import Drawing, drawing_coordinates, system_drawing
from .linear_summary import ENCODERS, END_EFFECTOR, HOLDINGS
from .storage import origin

# Number of undamped modes with mode shapes, and of logarithmically spaced frequencies of the response.
_SHAPES, _EVEN = 8, 300
# The response ranges from _BELOW times the lowest natural frequency to _ABOVE times that of the last mode shape, with
# additional frequencies at the relative distances _NEAR from every pole and zero.
_BELOW, _ABOVE, _NEAR = 0.1, 2.0, (3e-4, 3e-3, 2e-2)
# Least ratio of the highest to the lowest frequency of the response.
_LEAST = 1e3
# Step of the central difference of drawn points, relative to the units of the coordinates.
_STEP = 1e-5
# Drawn quantities by their names in `Drawing`, of the pose and of the undamped modes, with their dimensions.
DRAWN: dict[str, tuple[str, ...]] = {
    "shape": ("station", "axis"),
    "joints": ("joint", "axis"),
    "directions": ("joint",),
    "springs": ("spring", "end", "axis"),
}

UNITS = {
    "A": ("state matrix", "unit of the state per s, by that of the other state"),
    "B": ("input matrix", "unit of the state per s, by that of the input"),
    "C": ("output matrix", "unit of the output, by that of the state"),
    "D": ("feed-through", "unit of the output, by that of the input"),
    "natural_frequency": ("undamped natural frequency", "Hz"),
    "pole_real": ("real part of a pole", "1/s"),
    "pole_imag": ("imaginary part of a pole", "rad/s"),
    "zero_real": ("real part of a transmission zero of a mode's motors", "1/s"),
    "zero_imag": ("imaginary part of a transmission zero of a mode's motors", "rad/s"),
    "response_real": ("real part of the frequency response", "unit of the output, by that of the input"),
    "response_imag": ("imaginary part of the frequency response", "unit of the output, by that of the input"),
    "unbalanced": ("initial acceleration of the mechanism if it were released", "m/s^2"),
    "branch_real": ("real part of a pole along the motion", "1/s"),
    "branch_imag": ("imaginary part of a pole along the motion", "rad/s"),
    "frequency": ("frequency of the response", "Hz"),
    "moment": ("time of a point of the motion", "s"),
    **{f"pose_{name}": (f"{name} at the pose", "rad" if name == "directions" else "m") for name in DRAWN},
    **{f"modal_{name}": (f"change of {name} in an undamped mode, the largest of a point is 1", "1") for name in DRAWN},
}


@checked_arguments()
def linear_dataset(
    models: Sequence[LinearModel],
    *,
    along: Sequence[Sequence[LinearModel]] = (),
    parameters: dict[str, Any] | None = None,
) -> xr.Dataset:
    """Return the labelled dataset of linear models of one mechanism, one for each actuation mode.

    Parameters
    ----------
    models : sequence of LinearModel
        Linear models of different actuation modes.
    along : sequence of sequence of LinearModel
        Linear models of every mode at the same instants of a motion, whose poles are connected to branches; none by
        default.
    parameters : dict, optional
        Requested options, stored as provenance.

    Returns
    -------
    xarray.Dataset
        Dimensions mode, state, state_of, input, output, holding (motors free or held), order, pole, map (motors to
        encoders, to the end-effector), zero, frequency, station, joint, spring, moment, branch. Values are NaN where a
        mode has no such input, pole or zero. The attributes of every variable give units; `state_unit`, `input_unit`
        and `output_unit` give those of states, inputs and outputs.

    Raises
    ------
    InputError
        There is no model, or the models are of equal modes or of several mechanisms.
    """
    _check(models)
    first = models[0]
    free, held = ([model.motions(motors) for model, motors in each] for each in (
        ((model, ()) for model in models), ((model, motors_of(model)) for model in models)
    ))  # fmt: skip
    maps = [zero_maps(model) for model in models]
    # Names and units of all models.
    names = {
        key: {one.name: one.unit for model in models for one in getattr(model, key)}
        for key in ("states", "inputs", "outputs")
    }
    data = _matrices(models, names) | _motions(free, held) | _zeros(maps) | _drawings(models, free, held)
    data["unbalanced"] = ("mode", np.array([model.unbalanced for model in models]))
    frequency = _frequencies(free, held, [zero for each in maps for zero in each.values()])
    data |= _responses(models, frequency, names)
    coordinates: dict[str, Any] = {
        "mode": [model.mode for model in models], "holding": list(HOLDINGS), "frequency": frequency,
        "map": list(dict.fromkeys(name for each in maps for name in each)), "axis": ["x", "y"],
        "state_of": [*names["states"]],
        **drawing_coordinates(first.minimal.system.mechanism),
    }  # fmt: skip
    for key, own in names.items():
        coordinates[key[:-1]] = [*own]
        coordinates[f"{key[:-1]}_unit"] = (key[:-1], [*own.values()])
    if along:
        data |= _along(along)
        coordinates["moment"] = [model.time for model in along[0]]
    out = xr.Dataset(data, coords=coordinates, attrs=_provenance(first, parameters))
    for name in (str(each) for each in out.variables if each in UNITS):
        out[name].attrs = dict(zip(("long_name", "units"), UNITS[name], strict=True))
    return out


def motors_of(model: LinearModel) -> list[str]:
    """Return the names of the motors among a model's inputs."""
    own = [motor.name for motor in model.minimal.system.mechanism.motors]
    return [one.name for one in model.inputs if one.name in own]


def zero_maps(model: LinearModel) -> dict[str, Complex]:
    """Return the transmission zeros of a mode's motors to their encoders and to the end-effector.

    Without motors, the zeros are those of all inputs.
    """
    mechanism = model.minimal.system.mechanism
    motors, outputs = motors_of(model), [one.name for one in model.outputs]
    joints = {motor.name: motor.joint for motor in mechanism.motors}
    inputs = motors or [one.name for one in model.inputs]
    requested = {ENCODERS: [joints[name] for name in motors], END_EFFECTOR: end_effector_outputs(model)}
    return {
        name: model.zeros(inputs, chosen)
        for name, chosen in requested.items()
        if chosen and all(one in outputs for one in chosen)
    }


def end_effector_outputs(model: LinearModel) -> list[str]:
    """Return the names of the outputs that are the end-effector's coordinates."""
    effector = model.minimal.system.mechanism.end_effector
    return [] if effector is None else [axis for axis in ("x", "y") if axis in effector.coordinates]


def _check(models: Sequence[LinearModel]) -> None:
    modes, mechanisms = [model.mode for model in models], {model.mechanism for model in models}
    if not models or len(set(modes)) < len(modes) or len(mechanisms) > 1:
        raise InputError(
            "not linear models of different modes of one mechanism", field="models", value=", ".join(modes) or "none",
            remedy="give one of pf.linearise for each mode",
        )  # fmt: skip


def _matrices(models: Sequence[LinearModel], named: dict[str, dict[str, str]]) -> dict[str, Any]:
    """Return A, B, C and D over the states, inputs and outputs of all modes."""
    names = {key: list(own) for key, own in named.items()}
    out = {}
    for matrix, (rows, columns) in {
        "A": ("states", "states"), "B": ("states", "inputs"), "C": ("outputs", "states"), "D": ("outputs", "inputs")
    }.items():  # fmt: skip
        values = np.full((len(models), len(names[rows]), len(names[columns])), np.nan)
        for k, model in enumerate(models):
            places = (_places(getattr(model, key), names[key]) for key in (rows, columns))
            values[k][np.ix_(*places)] = getattr(model, matrix)
        across = "state_of" if columns == "states" else columns[:-1]
        out[matrix] = (("mode", rows[:-1], across), values)
    return out


def _places(some: Sequence[Any], names: list[str]) -> list[int]:
    return [names.index(one.name) for one in some]


def _motions(free: Sequence[Motions], held: Sequence[Motions]) -> dict[str, Any]:
    pairs = list(zip(free, held, strict=True))
    poles = padded([[one.poles for one in pair] for pair in pairs])
    frequencies = padded([[one.frequencies / (2.0 * np.pi) for one in pair] for pair in pairs]).real
    return {
        "natural_frequency": (("mode", "holding", "order"), frequencies),
        "pole_real": (("mode", "holding", "pole"), poles.real),
        "pole_imag": (("mode", "holding", "pole"), poles.imag),
    }


def _zeros(maps: Sequence[dict[str, Complex]]) -> dict[str, Any]:
    names, none = dict.fromkeys(name for each in maps for name in each), np.zeros(0)
    values = padded([[each.get(name, none) for name in names] for each in maps])
    return {f"zero_{part}": (("mode", "map", "zero"), getattr(values, part)) for part in ("real", "imag")}


def padded(rows: Sequence[Sequence[Numbers]]) -> Complex:
    """Combine rows of arrays of different sizes to one array, padded with NaN."""
    sizes = [one.shape for row in rows for one in row] or [(0,)]
    out = np.full((len(rows), len(rows[0]), *np.max(sizes, axis=0)), complex(np.nan, np.nan))
    for i, row in enumerate(rows):
        for j, one in enumerate(row):
            out[(i, j, *map(slice, one.shape))] = one
    return out


def _frequencies(free: Sequence[Motions], held: Sequence[Motions], zeros: Sequence[Complex]) -> Array:
    """Return the frequencies of the response [Hz]: logarithmically spaced, and near poles and zeros."""
    natural = np.sort(np.concatenate([one.frequencies for one in (*free, *held)]))
    natural = natural[natural > 0.0] / (2.0 * np.pi)
    low = _BELOW * natural.min(initial=1.0 if not natural.size else np.inf)
    drawn = max(one.frequencies[:_SHAPES].max(initial=0.0) for one in free) / (2.0 * np.pi)
    high = max(_ABOVE * drawn, _LEAST * low)
    even = np.geomspace(low, high, _EVEN)
    peaks = np.abs(np.concatenate([*(one.poles for one in free), *zeros])) / (2.0 * np.pi)
    peaks = np.unique(np.round(peaks[(peaks > low) & (peaks < high)], 9))
    near = [peaks * (1.0 + sign * part) for part in _NEAR for sign in (-1.0, 1.0)]
    return np.unique(np.concatenate([even, *near]))


def _responses(models: Sequence[LinearModel], frequency: Array, names: dict[str, dict[str, str]]) -> dict[str, Any]:
    inputs, outputs = list(names["inputs"]), list(names["outputs"])
    values = np.full((len(models), frequency.size, len(outputs), len(inputs)), complex(np.nan, np.nan))
    for k, model in enumerate(models):
        places = np.ix_(range(frequency.size), _places(model.outputs, outputs), _places(model.inputs, inputs))
        values[k][places] = model.frequency_response(2.0 * np.pi * frequency)
    dims = ("mode", "frequency", "output", "input")
    return {f"response_{part}": (dims, getattr(values, part)) for part in ("real", "imag")}


def _along(along: Sequence[Sequence[LinearModel]]) -> dict[str, Any]:
    """Return the branches of poles along a motion, with motors free and held."""
    found = [[pole_branches(each, held) for held in ((), motors_of(each[0]))] for each in along]
    values = padded(found)
    dims = ("mode", "holding", "moment", "branch")
    return {f"branch_{part}": (dims, getattr(values, part)) for part in ("real", "imag")}


def _drawings(models: Sequence[LinearModel], free: Sequence[Motions], held: Sequence[Motions]) -> dict[str, Any]:
    """Return the drawn quantities at the poses, and their changes in the lowest undamped modes."""
    poses = [_drawn(model, np.zeros((model.minimal.system.n, 0))) for model in models]
    modal = [
        [_drawn(model, one.shapes[:, :_SHAPES]) for one in pair]
        for model, pair in zip(models, zip(free, held, strict=True), strict=True)
    ]
    out: dict[str, Any] = {}
    for name, dims in DRAWN.items():
        if not poses[0][name].size:
            continue
        values = padded([[one[name] for one in each] for each in modal]).real
        out[f"pose_{name}"] = (("mode", *dims), np.concatenate([pose[name] for pose in poses]))
        out[f"modal_{name}"] = (("mode", "holding", "drawn", *dims), values)
    return out


def _drawn(model: LinearModel, shapes: Array) -> dict[str, Array]:
    """Return drawn quantities at the pose (1, ...), or their changes (k, ...) in mode shapes (n, k).

    Changes are scaled so that the largest displacement of a station is one.
    """
    system, q = model.minimal.system, model.minimal.point.q
    if not shapes.shape[1]:
        return {name: getattr(system_drawing(system, q[None]), name) for name in DRAWN}
    steps = (_STEP / np.max(np.abs(shapes / system.units[:, None]), axis=0) * shapes).T
    one, other = (system_drawing(system, q + sign * steps) for sign in (1.0, -1.0))
    size = np.max(np.linalg.norm(one.shape - other.shape, axis=-1), axis=-1)
    return {name: _change(name, one, other) / size.reshape(-1, *[1] * len(dims)) for name, dims in DRAWN.items()}


def _change(name: str, one: Drawing, other: Drawing) -> Array:
    values = getattr(one, name) - getattr(other, name)
    return np.arctan2(np.sin(values), np.cos(values)) if name == "directions" else values


def _provenance(model: LinearModel, parameters: dict[str, Any] | None) -> dict[str, Any]:
    mechanism = model.minimal.system.mechanism
    motors = {motor.name: motor.joint for motor in mechanism.motors}
    return {
        "kind": "linear",
        "mechanism": mechanism.name,
        "about": model.about,
        "time": model.time,
        "motor_joints": json.dumps(motors),
        "end_effector_outputs": json.dumps(end_effector_outputs(model)),
        **({} if mechanism.end_effector is None else {"end_effector_point": str(mechanism.end_effector.point)}),
        **origin(parameters),
        "numpy_version": version("numpy"),
    }
