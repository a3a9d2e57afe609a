"""Compilation of users' control laws, with array bounds checked, and their C entry points for the time loop."""

import re
from collections.abc import Callable
from dataclasses import dataclass
from types import CellType, CodeType, FunctionType, ModuleType
from typing import Any
from weakref import WeakKeyDictionary

import numpy as np
from numba import cfunc, njit, types
from numba.core.errors import NumbaError
from numba.extending import is_jitted
from numba.np.numpy_support import carray

from paraflex.arrays import Array
from paraflex.errors import InputError
from .controllers import Plant
from .law import Law, StartedLaw

MOST_STATES = 100_000

_POINTER = types.CPointer(types.float64)
_SIGNATURE = types.int64(types.int64, types.float64, _POINTER, _POINTER, _POINTER)
# Escape sequences for colours in Numba's messages.
_STYLES = re.compile(r"\x1b\[[0-9;]*m")
# Numba options that affect the machine code, as opposed to caching and calling.
_KEPT = ("error_model", "fastmath", "locals")


@dataclass(frozen=True)
class CompiledLaw(Law):
    """User-defined law that runs in the compiled time loop: a law for `SampledController`.

    Attributes
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

    _own = ("function",)

    function: Callable[..., None]
    states: int = 0

    def __post_init__(self) -> None:
        super().__post_init__()
        if not (is_jitted(self.function) or isinstance(self.function, FunctionType)):
            raise InputError("is not a function", field="function", value=self.function,
                             remedy="give one of (k, t, y, x, torques)")  # fmt: skip
        if not 0 <= self.states <= MOST_STATES:
            raise InputError("is out of range", field="states", value=self.states,
                             remedy=f"give the number of states, at most {MOST_STATES}")  # fmt: skip

    def start(self, plant: Plant) -> "CompiledInRun":
        """Return the law in a run: see `Law.start`."""
        return CompiledInRun(self.function, len(plant.inputs), self.states, len(plant.outputs))


class CompiledInRun(StartedLaw):
    """Compiled function in a run, whose state is the array x (states,).

    Parameters
    ----------
    function : callable
        Function of a `CompiledLaw`.
    inputs, states, outputs : int
        Numbers of readings, of states and of torques.

    Raises
    ------
    InputError
        A function that Numba cannot compile.
    """

    def __init__(self, function: Callable[..., None], inputs: int, states: int, outputs: int) -> None:
        if function not in _COMPILED:
            _COMPILED[function] = checked(function if is_jitted(function) else njit(function), {}), {}
        self._function, entries = _COMPILED[function]
        sizes = inputs, states, outputs
        if sizes not in entries:
            entries[sizes] = _entry(self._function, *sizes)
        self._entry, self._outputs = entries[sizes], outputs
        self.states: int = states
        name = getattr(function, "__name__", "")
        self.title: str = f"compiled {name if name.isidentifier() else 'function'}"

    @property
    def address(self) -> int:
        """Address of the machine code."""
        return int(self._entry.address)

    def step(self, state: Array | None, k: int, t: float, y: Array) -> tuple[Array, Array]:
        """Return the torques of a sample, and the states after it: see `StartedLaw.step`."""
        x, torques = np.zeros(self.states) if state is None else state.copy(), np.zeros(self._outputs)
        self._function(k, t, y.copy(), x, torques)
        return torques, x


def _entry(law: Any, inputs: int, states: int, outputs: int) -> Any:
    """Return the C function of numbers and pointers, which returns 0, or 1 where an exception was raised."""

    def entry(k, t, y, x, torques):
        try:
            law(k, t, carray(y, inputs), carray(x, states), carray(torques, outputs))
        except Exception:
            return 1
        return 0

    try:
        return cfunc(_SIGNATURE)(entry)
    except NumbaError as error:
        cause = " ".join(_STYLES.sub("", str(error)).split())[:200]
        raise InputError(f"cannot be compiled: {cause}", field="law", value=law.__name__,
                         remedy="write it as Numba takes functions, or give a law in Python") from None  # fmt: skip


# Checked functions, and their C functions by the numbers of inputs, states and outputs: each is compiled once.
_COMPILED: WeakKeyDictionary[Any, tuple[Any, dict[tuple[int, int, int], Any]]] = WeakKeyDictionary()


def checked(function: Any, done: dict[int, Any]) -> Any:
    """Recompile a function with array bounds checked, together with the compiled functions that it calls by name.

    Parameters
    ----------
    function : numba dispatcher
        Compiled function.
    done : dict
        Functions recompiled so far, by the `id` of the original, as functions may call one another.
    """
    if id(function) in done:
        return done[id(function)]
    python = function.py_func
    names, cells = dict(python.__globals__), [CellType() for _ in python.__closure__ or ()]
    copy = FunctionType(python.__code__, names, python.__name__, python.__defaults__, tuple(cells))
    copy.__module__, copy.__qualname__ = python.__module__, python.__qualname__
    options = {name: function.targetoptions[name] for name in _KEPT if name in function.targetoptions}
    done[id(function)] = njit(copy, boundscheck=True, **options)
    read = _names(python.__code__)
    names |= {name: _checked_within(names[name], read, done) for name in read & names.keys()}
    for own, cell in zip(python.__closure__ or (), cells, strict=True):
        cell.cell_contents = _checked_within(own.cell_contents, read, done)
    return done[id(function)]


def _checked_within(value: Any, read: set[str], done: dict[int, Any]) -> Any:
    """Return a compiled function, or a module that holds some, with bounds checked; other values unchanged."""
    if is_jitted(value):
        return checked(value, done)
    if isinstance(value, ModuleType):
        found = {name: checked(vars(value)[name], done) for name in read & vars(value).keys()
                 if is_jitted(vars(value)[name])}  # fmt: skip
        if found:
            module = ModuleType(value.__name__)
            vars(module).update(vars(value) | found)
            return module
    return value


def _names(code: CodeType) -> set[str]:
    """Return all names of globals and attributes that a code object reads, inner functions included."""
    inner = (_names(each) for each in code.co_consts if isinstance(each, CodeType))
    return set(code.co_names).union(*inner)
