"""Controllers in the compiled time loop: a single sampled controller with a linear law or a compiled function."""

from __future__ import annotations

from collections.abc import Callable
from types import FunctionType
from typing import Any

import numpy as np
import scipy
from numba.extending import is_jitted

from paraflex.arguments import checked_arguments
from paraflex.arrays import Array
from paraflex.control.laws.compiled import MOST_STATES, compiled_function
from paraflex.control.laws.controllers import Plant
from paraflex.control.laws.discrete import DiscreteModel
from paraflex.control.laws.linear_law import LinearLaw
from paraflex.control.loop.chain import SampledController
from paraflex.control.loop.readings import Readings
from paraflex.control.loop.references import AtSamples
from paraflex.control.loop.together import SAME, periods_in, whole_and_part
from paraflex.errors import InputError
from paraflex.kernel.arrays import apart
from paraflex.kernel.sampled import NOT_FINITE, RAISED, SAMPLED, WRONG, SampledLaw


class CompiledLaw:
    """User-defined law that runs in the compiled time loop: a law for `SampledController`.

    Parameters
    ----------
    function : callable
        Function of (k, t, y, x, torques), compiled by Numba or such that Numba can compile it. From the errors y
        (inputs,) of sample k at time t [s] and the states x (states,), which start at zero, it writes the torques
        (outputs,) [N m, N], which are zero before, and updates x. It is compiled with array bounds checked, and so are
        the functions that it calls; an exception ends the run.
    states : int
        Number of states.

    Raises
    ------
    InputError
        An object that is not a function, or a number of states below zero or above `MOST_STATES`; when started, a
        function that Numba cannot compile.
    """

    @checked_arguments()
    def __init__(self, function: Callable[..., None], states: int = 0) -> None:
        if not (is_jitted(function) or isinstance(function, FunctionType)):
            raise InputError("is not a function", field="function", value=function,
                             remedy="give one of (k, t, y, x, torques)")  # fmt: skip
        if not 0 <= states <= MOST_STATES:
            raise InputError("is out of range", field="states", value=states,
                             remedy=f"give the number of states, at most {MOST_STATES}")  # fmt: skip
        self._compiled = compiled_function(function)
        self.states: int = states
        name = getattr(function, "__name__", "")
        self.title: str = f"compiled {name if name.isidentifier() else 'function'}"
        self._entry: Any = None

    def start(self, plant: Plant) -> None:
        """Prepare for a run: see `Controller.start`."""
        self.x: Array = np.zeros(self.states)
        self._outputs = len(plant.outputs)
        self._entry = self._compiled.entry(len(plant.inputs), self.states, self._outputs)

    def step(self, k: int, t: float, y: Array) -> Array:
        """Compute the torques of a sample: see `Controller.step`."""
        torques = np.zeros(self._outputs)
        self._compiled.function(k, t, np.array(y), self.x, torques)
        return torques

    @property
    def address(self) -> int:
        """Address of the machine code, available once started."""
        return int(self._entry.address)

    def __deepcopy__(self, memo: dict[int, Any]) -> CompiledLaw:
        """Return a copy with its own states and the same function."""
        other = object.__new__(type(self))
        vars(other).update(vars(self))
        other.x = self.x.copy()
        return other


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
    law: Any = getattr(controller, "law", None)
    linear = _linear(law)
    if type(controller) is not SampledController or "step" in vars(controller) or not readings.simple:
        return None
    if linear is None and type(law) is not CompiledLaw:
        return None
    inputs, start, period = len(plant.inputs), plant.state.time, plant.period
    count = periods_in(end - start, period)
    filters = _filters(controller, inputs)
    given = _law_arrays(linear, law, inputs, len(outputs))
    states, kept = given["A"].shape[0], filters["filter_A"].shape[0]
    whole, part = whole_and_part(plant.delay / period)
    lowest, highest = controller.bounds[0].T
    address = 0 if linear is not None else law.address
    projector = None if linear is None else linear.projector
    arrays: dict[str, Any] = {
        "clock": np.array([start, period, part, SAME * period]),
        "counts": np.array([0, 0, whole, 0, address], np.int64),
        "resolution": controller.resolution,
        "reference": _reference_table(controller, start + period * np.arange(float(count))),
        "projector": np.zeros((0, 0, 0)) if projector is None else projector[_rows(count, len(projector))],
        "lowest": lowest, "highest": highest, "most": controller.bounds[1] * period,
        "outputs": np.array(outputs, np.int64), "base": base,
        "filtered": np.zeros(kept), "x": np.zeros(states), "last": controller.holding_torques, "held": held,
        "scratch": np.zeros((2, max(kept, states, inputs, len(outputs)))),
        "t": np.zeros(count), "acted": np.zeros(count), "readings": np.zeros((count, inputs)),
        "wanted": np.zeros((count, len(outputs))), "given": np.zeros((count, len(outputs))),
        **_read(readings), **filters, **given,
    }  # fmt: skip
    return SampledLaw(**{name: _apart(array) for name, array in arrays.items()})


def linear_model(controller: Any, plant: Plant) -> DiscreteModel | None:
    """Return the law of a started controller at the first sample; None if it is not linear or readings are filtered."""
    if type(controller) is not SampledController or any(controller.filter_models):
        return None
    law = _linear(controller.law)
    if law is None:
        return None
    P = np.eye(len(plant.outputs)) if law.projector is None else law.projector[0]
    return DiscreteModel(law.A, law.B, P @ law.C, P @ law.D, plant.period, plant.inputs, plant.outputs)


def wrong_torques(law: SampledLaw) -> list[int]:
    """Return the indices among the outputs of torques that are not finite, if these ended a run; else none."""
    if law.counts[WRONG] != NOT_FINITE:
        return []
    return np.flatnonzero(~np.isfinite(law.wanted[law.counts[SAMPLED]])).tolist()


def exception_of(law: SampledLaw, controller: Any) -> Exception | None:
    """Return the exception of a compiled function that ended a run, by repeating the last sample; None without one."""
    if law.counts[WRONG] != RAISED:
        return None
    k, function = int(law.counts[SAMPLED]), controller.law
    function.x = law.scratch[1, : function.states].copy()
    try:
        function.step(k, float(law.t[k]), law.readings[k] - law.reference[k])
    except Exception as error:
        return error
    return RuntimeError("an exception that does not come again")


def _linear(law: Any) -> LinearLaw | None:
    """Return a law in linear form; None if a class overrides its steps without its linear form."""
    if not hasattr(law, "linear_law") or "step" in vars(law):
        return None
    owners = [next((each for each in type(law).__mro__ if name in vars(each)), None)
              for name in ("linear_law", "step", "start", "limited")]  # fmt: skip
    return law.linear_law() if len({each for each in owners if each is not None}) == 1 else None


def _law_arrays(linear: LinearLaw | None, law: Any, inputs: int, outputs: int) -> dict[str, Array]:
    if linear is None:
        n, linear = law.states, LinearLaw(*(np.zeros((0, 0)) for _ in range(4)))
    else:
        n = len(linear.A)
    shapes = {"A": (n, n), "B": (n, inputs), "C": (outputs, n), "D": (outputs, inputs), "E": (n, outputs),
              "holding": (outputs,), "first": (n, inputs), "waiting": (n,)}  # fmt: skip
    found = {name: getattr(linear, name) for name in shapes}
    return {name: np.reshape(array, shapes[name]).astype(float) if array.size else np.zeros(shapes[name])
            for name, array in found.items()}  # fmt: skip


def _read(readings: Readings) -> dict[str, np.ndarray]:
    """Return the arrays of the readings: rows of the linear ones, zero for others, and point positions."""
    linear, count = readings.affine, len(readings.names)
    given = {"value": linear.value, "rows_q": linear.q, "rows_v": linear.v, "rows_a": linear.a,
             "turning": linear.turning, "angle": linear.angle.astype(np.int64)}  # fmt: skip
    found: dict[str, np.ndarray] = {}
    for name, rows in given.items():
        found[name] = np.zeros((count, *rows.shape[1:]), rows.dtype)
        found[name][readings.linear] = rows
    numbers = [np.concatenate([one.axis, one.x0, one.N.ravel(), one.B.ravel()]) for one in readings.places]
    found["points"] = np.array([[one.sensor, one.offset, one.angle, one.first, len(one.B)] for one in readings.places],
                               np.int64).reshape(len(numbers), 5)  # fmt: skip
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
