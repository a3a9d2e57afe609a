"""Vectors of eight numbers, for loops that compilers do not vectorise.

Loops over the few flexible coordinates of a body are too short for automatic vectorisation: they end before the vector
units are in use. Arrays for such loops are therefore one-dimensional, laid out in groups of `LANES` and padded with
zeros, and are processed by these functions, which become single instructions of the width that the machine has.
"""

from typing import Any

from llvmlite import ir
from numba import types
from numba.core import cgutils
from numba.extending import intrinsic, models, register_jitable, register_model

from .compiling import FAST_MATH

LANES = 8
# Numba supplies the first argument of an intrinsic; type checkers do not know that.
operation: Any = intrinsic
_VECTOR, _INDEX = ir.VectorType(ir.DoubleType(), LANES), ir.IntType(32)
_FLAGS = tuple(sorted(FAST_MATH))


@register_jitable
def padded(count: int) -> int:
    """Return the smallest multiple of LANES that is not less than a count."""
    return -(-count // LANES) * LANES


class _Vector(types.Type):
    """Numba type of a vector."""

    def __init__(self) -> None:
        super().__init__(name=f"Vector{LANES}")


_vector = _Vector()


@register_model(_Vector)
class _VectorModel(models.PrimitiveModel):
    def __init__(self, dmm, fe_type) -> None:
        super().__init__(dmm, fe_type, _VECTOR)


def _pointer(context, builder, array_type, array, index):
    data = context.make_array(array_type)(context, builder, array).data
    return builder.bitcast(builder.gep(data, [index]), _VECTOR.as_pointer())


def _spread(builder, scalar):
    nothing = ir.Constant(_VECTOR, ir.Undefined)
    first = builder.insert_element(nothing, scalar, ir.Constant(_INDEX, 0))
    return builder.shuffle_vector(first, nothing, ir.Constant(ir.VectorType(_INDEX, LANES), [0] * LANES))


def _add_product(builder, total, a, b):
    return builder.fadd(total, builder.fmul(a, b, flags=_FLAGS), flags=_FLAGS)


@operation
def zeros(typingctx):
    """Return a vector of zeros."""

    def generate(context, builder, signature, arguments):
        return ir.Constant(_VECTOR, [0.0] * LANES)

    return _vector(), generate


@operation
def load(typingctx, array, index):
    """Return the vector array[index : index + LANES]."""

    def generate(context, builder, signature, arguments):
        return builder.load(_pointer(context, builder, signature.args[0], *arguments), align=8)

    return _vector(array, types.intp), generate


@operation
def store(typingctx, array, index, vector):
    """Write a vector to array[index : index + LANES]."""

    def generate(context, builder, signature, arguments):
        builder.store(arguments[2], _pointer(context, builder, signature.args[0], *arguments[:2]), align=8)
        return context.get_dummy_value()

    return types.void(array, types.intp, _vector), generate


@operation
def add_scaled(typingctx, total, vector, scale):
    """Return total + vector * scale, with a scalar scale."""

    def generate(context, builder, signature, arguments):
        total, vector, scale = arguments
        return _add_product(builder, total, vector, _spread(builder, scale))

    return _vector(_vector, _vector, types.float64), generate


@operation
def add_product(typingctx, total, a, b):
    """Return total + a * b, entry by entry."""

    def generate(context, builder, signature, arguments):
        return _add_product(builder, *arguments)

    return _vector(_vector, _vector, _vector), generate


@operation
def summed(typingctx, vector):
    """Return the sum of a vector's entries."""

    def generate(context, builder, signature, arguments):
        kind = ir.FunctionType(ir.DoubleType(), [ir.DoubleType(), _VECTOR])
        reduce = cgutils.get_or_insert_function(builder.module, kind, f"llvm.vector.reduce.fadd.v{LANES}f64")
        return builder.call(reduce, [ir.Constant(ir.DoubleType(), -0.0), arguments[0]], fastmath=_FLAGS)

    return types.float64(_vector), generate
