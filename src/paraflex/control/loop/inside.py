"""Controllers in the compiled time loop: a single sampled controller with a linear law or a compiled function."""

from typing import Any

import numpy as np
import scipy

from paraflex.arrays import Array
from paraflex.control.laws.compiled import CompiledInRun
from paraflex.control.laws.controllers import Plant
from paraflex.control.laws.discrete import DiscreteModel
from paraflex.control.laws.linear_law import LinearLaw
from paraflex.kernel.arrays import apart
from paraflex.kernel.sampled import SAMPLED, SampledLaw
from .chain import SampledController
from .readings import Readings
from .references import AtSamples
from .together import SAME, periods_in, whole_and_part

_MATRICES = ("A", "B", "C", "D", "E", "first", "holding", "waiting")


def sampled_law(
    controller: Any, plant: Plant, readings: Readings, outputs: list[int], base: Array, held: Array, end: float
) -> SampledLaw | None:
    """Return a started controller in the form of the time loop; None if it must run outside.

    Parameters
    ----------
    controller : Controller
        Started controller.
    plant : Plant
        Plant of the controller.
    readings : Readings
        Readings of its inputs.
    outputs : list of int
        Indices of its motors among all of the mechanism.
    base : (breaks,) array
        Constant coefficients of the signals without its torques.
    held : (motors,) array
        Torques of all motors that act at the start [N m, N].
    end : float
        End time of the run [s].
    """
    if type(controller) is not SampledController or "step" in vars(controller) or not readings.simple:
        return None
    inputs, start, period = len(plant.inputs), plant.state.time, plant.period
    started, address = controller.started, 0
    law = _linear(started)
    if law is None:
        if type(started) is not CompiledInRun:
            return None
        address, n = started.address, started.states
        law = LinearLaw(np.zeros((n, n)), np.zeros(0), np.zeros(0), np.zeros((len(outputs), inputs)))
    count = periods_in(end - start, period)
    filters = _filters(controller, inputs)
    states, kept = len(law.A), filters["filter_A"].shape[0]
    whole, part = whole_and_part(plant.delay / period)
    lowest, highest = controller.bounds[0].T
    arrays: dict[str, Any] = {
        "clock": np.array([start, period, part, SAME * period]),
        "counts": np.array([0, 0, whole, 0, address], np.int64),
        "resolution": controller.resolution,
        "reference": _reference_table(controller, start + period * np.arange(float(count))),
        "projector": np.zeros((0, 0, 0)) if law.projector is None else law.projector[_rows(count, len(law.projector))],
        "lowest": lowest, "highest": highest, "most": controller.bounds[1] * period,
        "outputs": np.array(outputs, np.int64), "base": base,
        "filtered": np.zeros(kept), "x": np.zeros(states), "last": controller.holding_torques, "held": held,
        "scratch": np.zeros((2, max(kept, states, inputs, len(outputs)))),
        "t": np.zeros(count), "acted": np.zeros(count), "readings": np.zeros((count, inputs)),
        "wanted": np.zeros((count, len(outputs))), "given": np.zeros((count, len(outputs))),
        **packed_readings(readings), **filters, **{name: getattr(law, name) for name in _MATRICES},
    }  # fmt: skip
    return SampledLaw(**{name: _apart(array) for name, array in arrays.items()})


def linear_model(controller: Any, plant: Plant) -> DiscreteModel | None:
    """Return the law of a started controller at the first sample; None if it is not linear or readings are filtered."""
    if type(controller) is not SampledController or any(controller.filter_models):
        return None
    law = _linear(controller.started)
    if law is None:
        return None
    P = np.eye(len(plant.outputs)) if law.projector is None else law.projector[0]
    return DiscreteModel(law.A, law.B, P @ law.C, P @ law.D, plant.period, plant.inputs, plant.outputs)


def exception_of(law: SampledLaw, controller: Any) -> Exception:
    """Return the exception of a compiled function that ended a run, by repeating the last sample."""
    k, started = int(law.counts[SAMPLED]), controller.started
    try:
        started.step(law.scratch[1, : started.states], k, float(law.t[k]), law.readings[k] - law.reference[k])
    except Exception as error:
        return error
    return RuntimeError("an exception that does not come again")


def _linear(law: Any) -> LinearLaw | None:
    """Return a started law if it is linear and its class does not step it otherwise; else None."""
    own = isinstance(law, LinearLaw) and all(
        getattr(type(law), name) is getattr(LinearLaw, name) for name in ("step", "limited", "following")
    )
    return law if own else None


def packed_readings(readings: Readings) -> dict[str, np.ndarray]:
    """Return the arrays of the readings: rows of the linear ones, zero for others, and point positions."""
    linear, count = readings.affine, len(readings.names)
    given = {"value": linear.value, "rows_q": linear.q, "rows_v": linear.v, "rows_a": linear.a,
             "turning": linear.turning, "angle": linear.angle.astype(np.int64)}  # fmt: skip
    found: dict[str, np.ndarray] = {}
    for name, rows in given.items():
        found[name] = np.zeros((count, *rows.shape[1:]), rows.dtype)
        found[name][readings.linear] = rows
    points, numbers = [], []
    for one in readings.places:
        body, marker = readings.system.bodies[one.marker.body], one.marker
        bending = np.zeros((body.nf, body.nf)) if marker.bending is None else marker.bending
        points.append([one.sensor, body.offset, body.angle, body.flexible.start, body.nf])
        numbers.append(np.concatenate([one.axis, marker.x0, marker.N.ravel(), bending.ravel()]))
    found["points"] = np.array(points, np.int64).reshape(len(numbers), 5)
    found["shapes"] = np.zeros((len(numbers), max((row.size for row in numbers), default=0)))
    for place, row in zip(found["shapes"], numbers, strict=True):
        place[: row.size] = row
    return found


def _filters(controller: SampledController, inputs: int) -> dict[str, Array]:
    """Return the matrices of all filters of readings together; empty without filters."""
    several = controller.filter_models
    if not any(several):
        shapes = {"A": (0, 0), "B": (0, inputs), "C": (inputs, 0), "D": 0, "start": (0, inputs)}
        return {f"filter_{name}": np.zeros(shape) for name, shape in shapes.items()}
    passed = (np.zeros((0, 0)), np.zeros((0, 1)), np.zeros((1, 0)), np.eye(1))
    A, B, C, D = (scipy.linalg.block_diag(*matrices) for matrices in
                  zip(*(each or passed for each in several), strict=True))  # fmt: skip
    steady = np.linalg.solve(np.eye(len(A)) - A, B)
    return {"filter_A": A, "filter_B": B, "filter_C": C, "filter_D": np.diag(D), "filter_start": steady}


def _reference_table(controller: SampledController, times: Array) -> Array:
    """Return the references (samples, inputs) at given sample times."""
    table = np.zeros((times.size, len(controller.found_references)))
    for i, reference in enumerate(controller.found_references):
        if isinstance(reference, AtSamples):
            table[:, i] = reference.values[_rows(times.size, len(reference.values))]
        elif reference is not None:
            table[:, i] = [reference(float(t)) for t in times]
    return table


def _rows(count: int, there: int) -> np.ndarray:
    """Return row indices for samples; the last row is kept afterwards."""
    return np.minimum(np.arange(count), there - 1)


def _apart(array: np.ndarray) -> Any:
    """Return a copy in separate memory: see `kernel.arrays`."""
    copy = apart(array.shape, array.dtype.type)
    copy[...] = array
    return copy
