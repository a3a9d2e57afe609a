"""Functions of laws, compiled with bounds of arrays checked, and their entries for the compiled time loop."""

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
# Colours in messages of Numba.
_STYLES = re.compile(r"\x1b\[[0-9;]*m")
# Options of Numba that say how the machine code is, not where it is kept or what may call it.
_KEPT = ("error_model", "fastmath", "locals")


class CompiledFunction:
    """A function of (k, t, y, x, torques) for laws: see `CompiledLaw`.

    Parameters
    ----------
    function : callable
        Compiled by Numba, or such that Numba can compile it.
    """

    def __init__(self, function: Callable[..., None]) -> None:
        self._entries: dict[tuple[int, int, int], Any] = {}
        self.function: Any = checked(function if is_jitted(function) else njit(function), {})

    def entry(self, inputs: int, states: int, outputs: int) -> Any:
        """The function for C, of numbers and pointers: 0, or 1 where an exception was raised.

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
    """A function for laws, compiled once for all of them."""
    if function not in _FUNCTIONS:
        _FUNCTIONS[function] = CompiledFunction(function)
    return _FUNCTIONS[function]


def checked(function: Any, done: dict[int, Any]) -> Any:
    """A compiled function with bounds of arrays checked, in it and in compiled functions that it calls by name.

    Parameters
    ----------
    function : numba dispatcher
    done : dict
        Checked functions made so far, by the `id` of the original; functions may call one another.
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
    """A compiled function as `checked` has it, a module with such functions among names that are read; or as it is."""
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
    """All global names and attributes that code, and functions within it, read."""
    inner = (_names(each) for each in code.co_consts if isinstance(each, CodeType))
    return set(code.co_names).union(*inner)
