"""Compilation of users' control laws, with array bounds checked, and their C entry points for the time loop."""

from __future__ import annotations

import re
from collections.abc import Callable
from types import CellType, CodeType, FunctionType, ModuleType
from typing import Any
from weakref import WeakKeyDictionary

from numba import cfunc, njit, types
from numba.core.errors import NumbaError
from numba.extending import is_jitted
from numba.np.numpy_support import carray

from paraflex.errors import InputError

MOST_STATES = 100_000

_POINTER = types.CPointer(types.float64)
_SIGNATURE = types.int64(types.int64, types.float64, _POINTER, _POINTER, _POINTER)
# Escape sequences for colours in Numba's messages.
_STYLES = re.compile(r"\x1b\[[0-9;]*m")
# Numba options that affect the machine code, as opposed to caching and calling.
_KEPT = ("error_model", "fastmath", "locals")


class CompiledFunction:
    """Compiled function of (k, t, y, x, torques) that evaluates a control law: see `CompiledLaw`.

    Parameters
    ----------
    function : callable
        Function compiled by Numba, or one that Numba can compile.
    """

    def __init__(self, function: Callable[..., None]) -> None:
        self._entries: dict[tuple[int, int, int], Any] = {}
        self.function: Any = checked(function if is_jitted(function) else njit(function), {})

    def entry(self, inputs: int, states: int, outputs: int) -> Any:
        """Return the C function for given numbers of inputs, states and outputs.

        It takes numbers and pointers, and returns 0, or 1 where an exception was raised.

        Parameters
        ----------
        inputs, states, outputs : int
            Numbers of readings, of states and of torques.

        Raises
        ------
        InputError
            A function that Numba cannot compile.
        """
        sizes, law = (inputs, states, outputs), self.function
        if sizes in self._entries:
            return self._entries[sizes]

        def entry(k, t, y, x, torques):
            try:
                law(k, t, carray(y, inputs), carray(x, states), carray(torques, outputs))
            except Exception:
                return 1
            return 0

        try:
            self._entries[sizes] = cfunc(_SIGNATURE)(entry)
        except NumbaError as error:
            cause = " ".join(_STYLES.sub("", str(error)).split())[:200]
            raise InputError(f"cannot be compiled: {cause}", field="law", value=law.__name__,
                             remedy="write it as Numba takes functions, or give a law in Python") from None  # fmt: skip
        return self._entries[sizes]


_FUNCTIONS: WeakKeyDictionary[Any, CompiledFunction] = WeakKeyDictionary()


def compiled_function(function: Callable[..., None]) -> CompiledFunction:
    """Return the compiled function of a control law, compiled once and cached."""
    if function not in _FUNCTIONS:
        _FUNCTIONS[function] = CompiledFunction(function)
    return _FUNCTIONS[function]


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
