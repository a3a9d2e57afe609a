"""Named tuples that kernels receive by reference: a pointer instead of some hundred machine words.

Numba splits a named tuple into its fields, and every array into seven words, at each call. Tuples of classes decorated
with `@by_reference` are split only once, where Python calls a kernel. Kernels read their fields and do not create such
tuples.
"""

from hashlib import blake2b
from typing import Any, TypeVar

import numpy as np
from llvmlite import ir
from numba import types
from numba.core import cgutils
from numba.core.imputils import lower_getattr_generic
from numba.core.typing.templates import AttributeTemplate, infer_getattr
from numba.extending import NativeValue, models, register_model, typeof_impl, unbox

R = TypeVar("R", bound=type)
# Numba types of arrays by what they depend on: Numba takes twenty times longer to find one, and a run has hundreds.
_ARRAYS: dict[tuple[Any, ...], types.Type | None] = {}


class _Reference(types.Type):
    """Numba type of a reference to a named tuple."""

    def __init__(self, record: type, fields: tuple[types.Type, ...]) -> None:
        self.record, self.fields = record, dict(zip(record._fields, fields, strict=True))
        # The name is a part of those of all functions, so it has a digest in place of some thousand letters.
        inside = blake2b(", ".join(map(str, fields)).encode(), digest_size=8).hexdigest()
        super().__init__(name=f"{record.__module__}.{record.__qualname__}&{inside}")


@register_model(_Reference)
class _ReferenceModel(models.PrimitiveModel):
    def __init__(self, dmm, fe_type) -> None:
        fields = [dmm[field].get_data_type() for field in fe_type.fields.values()]
        super().__init__(dmm, fe_type, ir.LiteralStructType(fields).as_pointer())


@infer_getattr
class _Attributes(AttributeTemplate):
    key = _Reference

    def generic_resolve(self, typ, attr):
        return typ.fields.get(attr)


def _type_of(field: Any, context: Any) -> types.Type | None:
    if type(field) is not np.ndarray:
        return typeof_impl(field, context)
    flags = field.flags
    kind = field.dtype, field.ndim, flags.c_contiguous, flags.f_contiguous, flags.writeable, flags.aligned
    if kind not in _ARRAYS:
        _ARRAYS[kind] = typeof_impl(field, context)
    return _ARRAYS[kind]


def by_reference(record: R) -> R:
    """Register a named tuple to be passed to kernels by reference."""

    @typeof_impl.register(record)
    def _(value, context):
        fields = tuple(_type_of(field, context) for field in value)
        return None if None in fields else _Reference(record, fields)

    return record


@unbox(_Reference)
def _unbox(typ, obj, c):
    builder = c.builder
    fields = c.context.data_model_manager[typ].get_value_type().pointee
    place = cgutils.alloca_once(builder, fields)
    failed = cgutils.alloca_once_value(builder, cgutils.false_bit)
    for k, field in enumerate(typ.fields.values()):
        item = c.pyapi.tuple_getitem(obj, k)
        target = cgutils.gep_inbounds(builder, place, 0, k)
        if isinstance(field, types.Array):
            # No reference counting: the tuple keeps its arrays alive as long as the kernel runs.
            kind = ir.FunctionType(ir.IntType(32), [c.pyapi.pyobj, c.pyapi.voidptr])
            adapt = cgutils.get_or_insert_function(builder.module, kind, "numba_adapt_ndarray")
            code = builder.call(adapt, [item, builder.bitcast(target, c.pyapi.voidptr)])
            wrong = cgutils.is_not_null(builder, code)
            with builder.if_then(wrong, likely=False):
                c.pyapi.err_set_string("PyExc_TypeError", "a field of a record is not an array")
        else:
            native = c.unbox(field, item)
            builder.store(c.context.data_model_manager[field].as_data(builder, native.value), target)
            wrong = native.is_error
        builder.store(builder.or_(builder.load(failed), wrong), failed)
    return NativeValue(_sealed(builder, place), is_error=builder.load(failed))


def _sealed(builder, place):
    """Return the address, hidden from the compiler, which must not load a field before all are stored."""
    kind = ir.FunctionType(place.type, [place.type])
    return builder.asm(kind, "", "=r,0,~{memory}", [place], side_effect=True)


@lower_getattr_generic(_Reference)
def _field(context, builder, typ, value, attr):
    field = typ.fields[attr]
    place = cgutils.gep_inbounds(builder, value, 0, list(typ.fields).index(attr))
    model = context.data_model_manager[field]
    if isinstance(field, types.Array):
        array = cgutils.create_struct_proxy(field)(context, builder)
        for k, name in enumerate(model._fields):
            if name in ("meminfo", "parent"):
                setattr(array, name, ir.Constant(getattr(array, name).type, None))
            else:
                setattr(array, name, _load(builder, cgutils.gep_inbounds(builder, place, 0, k)))
        return array._getvalue()
    return model.from_data(builder, _load(builder, place))


def _load(builder, place):
    """Load the value at an address, marked as invariant."""
    kind = place.type.pointee
    if isinstance(kind, (ir.LiteralStructType, ir.ArrayType)):
        count = kind.count if isinstance(kind, ir.ArrayType) else len(kind.elements)
        whole = ir.Constant(kind, ir.Undefined)
        for k in range(count):
            whole = builder.insert_value(whole, _load(builder, cgutils.gep_inbounds(builder, place, 0, k)), k)
        return whole
    value = builder.load(place)
    value.set_metadata("invariant.load", builder.module.add_metadata([]))
    return value
