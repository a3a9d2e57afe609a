"""Kernels run as Python on numbers that count: what floating-point operations their own source asks for.

Of vectors only what is done with entries that are not zero counts: they are padded with zeros.
"""

from __future__ import annotations

import math
import types

import numpy as np

from paraflex.kernel import vectors


class Counted(float):
    """A number that counts what is done with it."""

    operations = 0


def _counting(name):
    plain = getattr(float, name)

    def operation(self, other):
        Counted.operations += 1
        return Counted(plain(self, float(other)))

    return operation


for _name in ("add", "radd", "sub", "rsub", "mul", "rmul", "truediv", "rtruediv"):
    setattr(Counted, f"__{_name}__", _counting(f"__{_name}__"))
Counted.__neg__ = lambda self: Counted(-float(self))


def _counted(function):
    def call(*arguments):
        Counted.operations += 1
        return Counted(function(*map(float, arguments)))

    return call


class Array:
    """An array whose entries are counted numbers, integers, or records of them with names."""

    def __init__(self, values):
        self.values, self.size, self.shape = values, values.size, values.shape

    def __getitem__(self, index):
        found = self.values[index]
        if isinstance(found, np.ndarray):
            return Array(found)
        if isinstance(found, np.void):
            return types.SimpleNamespace(**{name: _number(found[name]) for name in found.dtype.names})
        return _number(found)

    def __setitem__(self, index, value):
        self.values[index] = value


def _add_product(total, a, b):
    Counted.operations += np.count_nonzero(a * b) + np.count_nonzero((total != 0.0) & (a * b != 0.0))
    return total + a * b


def _store(array, index, vector):
    array.values[index : index + vectors.LANES] = vector


def _summed(vector):
    Counted.operations += max(np.count_nonzero(vector) - 1, 0)
    return Counted(vector.sum())


_VECTORS = {
    vectors.zeros: lambda: np.zeros(vectors.LANES),
    vectors.load: lambda array, index: array.values[index : index + vectors.LANES].copy(),
    vectors.store: _store,
    vectors.add_scaled: lambda total, vector, scale: _add_product(total, vector, float(scale)),
    vectors.add_product: _add_product,
    vectors.summed: _summed,
}


def _number(value):
    return Counted(value) if isinstance(value, np.floating) else int(value)


def counting(value):
    """An array, a named tuple of arrays or a number, as kernels run as Python can read it."""
    if hasattr(value, "_asdict"):
        return types.SimpleNamespace(**{name: counting(part) for name, part in value._asdict().items()})
    if isinstance(value, np.ndarray):
        return Array(value)
    return Counted(value) if isinstance(value, float) else value


def operations_of(kernel, *arguments):
    """How many operations a call takes."""
    Counted.operations = 0
    _as_python(kernel, {})(*map(counting, arguments))
    return Counted.operations


def _as_python(kernel, known):
    """The kernel's source with those it calls, and with functions that count."""
    if kernel not in known:
        source = kernel.py_func
        names = dict(source.__globals__)
        known[kernel] = types.FunctionType(source.__code__, names, source.__name__, source.__defaults__)
        _count_names(names, known)
    return known[kernel]


def _count_names(names, known):
    """Replace what counts among the names of a module, and in the kernels' modules among them."""
    for name, value in list(names.items()):
        if hasattr(value, "py_func"):
            names[name] = _as_python(value, known)
        elif isinstance(value, types.ModuleType) and value.__name__.startswith("paraflex.kernel."):
            if value not in known:
                known[value] = types.SimpleNamespace(**vars(value))
                _count_names(vars(known[value]), known)
            names[name] = known[value]
        elif value in (math.sin, math.cos, math.sqrt):
            names[name] = _counted(value)
        elif callable(value) and value in _VECTORS:
            names[name] = _VECTORS[value]
