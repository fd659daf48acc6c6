"""Sixteen floating-point numbers at a time: a Numba type for one number of each of sixteen matrices.

Compilers seldom vectorise the loops of small linear algebra by themselves. With this type a kernel reads like scalar
code and is vector code for certain: every `Lanes` is one LLVM vector, which the processor holds in two, four or eight
registers. Sixteen, because one rotation is a long chain of dependent operations, and two or more independent chains
keep the units busy.

This is the only file that reaches into Numba (`numba.core`, `numba.np`) and llvmlite, and importing it is all there is
to it: it registers what the words of `words` mean for sixteen matrices. Where it cannot be imported, kernels are
compiled for one matrix at a time, see `maniport.spd.kernels`. Every lane goes through the same instructions whatever
the others hold: a matrix gets the same bits in any batch.
"""

import operator
from collections.abc import Callable
from typing import Any

from llvmlite import ir  # type: ignore[import-untyped]
from numba import types
from numba.core import cgutils
from numba.extending import lower_builtin, models, register_model, type_callable
from numba.np.arrayobj import make_array

from maniport.spd.kernels.words import (
    LANES,
    LOWEST_BITS,
    anywhere,
    everywhere,
    exponent,
    gather,
    load,
    magnitude,
    mantissa,
    nearest,
    power_of_two,
    root,
    scatter,
    spread,
    store,
    where,
)

_double, _integer = ir.VectorType(ir.DoubleType(), LANES), ir.VectorType(ir.IntType(64), LANES)
_bits = ir.VectorType(ir.IntType(1), LANES)
_CONTRACT = ("contract",)  # a multiplication and an addition may become one instruction, rounded once


class LanesType(types.Type):  # type: ignore[misc]  # Numba is untyped
    """Sixteen doubles."""

    def __init__(self) -> None:
        super().__init__(name=f"Lanes({LANES})")


class MaskType(types.Type):  # type: ignore[misc]
    """Sixteen truth values."""

    def __init__(self) -> None:
        super().__init__(name=f"Mask({LANES})")


lanes, mask = LanesType(), MaskType()
block, batch = types.Array(types.float64, 2, "C"), types.Array(types.float64, 3, "C")


@register_model(LanesType)
class _LanesModel(models.PrimitiveModel):  # type: ignore[misc]
    def __init__(self, manager: Any, kind: Any) -> None:
        super().__init__(manager, kind, _double)


@register_model(MaskType)
class _MaskModel(models.PrimitiveModel):  # type: ignore[misc]
    def __init__(self, manager: Any, kind: Any) -> None:
        super().__init__(manager, kind, _bits)


def _compiled(function: Any, result: Any, *signatures: tuple[Any, ...]) -> Callable[[Any], Any]:
    """Register the code of a function or operator for some argument types: emit(context, builder, *values)."""

    def register(emit: Callable[..., Any]) -> Callable[..., Any]:
        def typing(context: Any) -> Any:
            typers = {  # Numba wants to count the arguments
                1: lambda x: result if (x,) in signatures else None,
                2: lambda x, y: result if (x, y) in signatures else None,
                3: lambda x, y, z: result if (x, y, z) in signatures else None,
                4: lambda x, y, z, w: result if (x, y, z, w) in signatures else None,
            }
            return typers[len(signatures[0])]

        def lower(context: Any, builder: Any, signature: Any, values: Any) -> Any:
            if lanes in signature.args:  # beside sixteen numbers, a single one stands for sixteen equal ones
                pairs = zip(values, signature.args, strict=True)
                values = [_emit_spread(context, builder, x) if kind == types.float64 else x for x, kind in pairs]
            return emit(context, builder, *values)

        type_callable(function)(typing)
        for signature in signatures:
            lower_builtin(function, *signature)(lower)
        return emit

    return register


def _intrinsic(name: str) -> Callable[..., Any]:
    def emit(context: Any, builder: Any, x: Any) -> Any:
        kind = ir.FunctionType(_double, [_double])
        return builder.call(cgutils.get_or_insert_function(builder.module, kind, f"llvm.{name}.v{LANES}f64"), [x])

    return emit


@_compiled(spread, lanes, (types.float64, block))
def _emit_spread(context: Any, builder: Any, x: Any, _: Any = None) -> Any:
    undefined = ir.Constant(_double, ir.Undefined)
    first = builder.insert_element(undefined, x, ir.Constant(ir.IntType(32), 0))
    return builder.shuffle_vector(first, undefined, ir.Constant(ir.VectorType(ir.IntType(32), LANES), [0] * LANES))


_PAIRS = ((lanes, lanes), (lanes, types.float64), (types.float64, lanes))
_compiled(operator.add, lanes, *_PAIRS)(lambda _, builder, x, y: builder.fadd(x, y, flags=_CONTRACT))
_compiled(operator.sub, lanes, *_PAIRS)(lambda _, builder, x, y: builder.fsub(x, y, flags=_CONTRACT))
_compiled(operator.mul, lanes, *_PAIRS)(lambda _, builder, x, y: builder.fmul(x, y, flags=_CONTRACT))
_compiled(operator.truediv, lanes, *_PAIRS)(lambda _, builder, x, y: builder.fdiv(x, y))
_compiled(operator.neg, lanes, (lanes,))(lambda _, builder, x: builder.fsub(ir.Constant(_double, [-0.0] * LANES), x))
_compiled(operator.gt, mask, *_PAIRS)(lambda _, builder, x, y: builder.fcmp_ordered(">", x, y))
_compiled(operator.lt, mask, *_PAIRS)(lambda _, builder, x, y: builder.fcmp_ordered("<", x, y))
_compiled(where, lanes, *((mask, *pair) for pair in _PAIRS))(lambda _, builder, *choice: builder.select(*choice))
_compiled(magnitude, lanes, (lanes,))(_intrinsic("fabs"))
_compiled(root, lanes, (lanes,))(_intrinsic("sqrt"))
_compiled(nearest, lanes, (lanes,))(_intrinsic("rint"))


def _address(context: Any, builder: Any, rows: Any, row: Any) -> Any:
    start = builder.mul(row, ir.Constant(row.type, LANES))
    return builder.bitcast(builder.gep(make_array(block)(context, builder, rows).data, [start]), _double.as_pointer())


def _addresses(context: Any, builder: Any, matrices: Any, first: Any, step: Any) -> list[Any]:
    data = make_array(batch)(context, builder, matrices).data
    return [
        builder.gep(data, [builder.add(first, builder.mul(step, ir.Constant(step.type, lane)))])
        for lane in range(LANES)
    ]


@_compiled(load, lanes, (block, types.intp))
def _emit_load(context: Any, builder: Any, rows: Any, row: Any) -> Any:
    value = builder.load(_address(context, builder, rows, row))
    value.align = 8
    return value


@_compiled(store, types.none, (block, types.intp, lanes))
def _emit_store(context: Any, builder: Any, rows: Any, row: Any, x: Any) -> Any:
    builder.store(x, _address(context, builder, rows, row)).align = 8
    return context.get_dummy_value()


@_compiled(gather, lanes, (batch, types.intp, types.intp, block))
def _emit_gather(context: Any, builder: Any, *where_from: Any) -> Any:
    value = ir.Constant(_double, ir.Undefined)
    for lane, address in enumerate(_addresses(context, builder, *where_from[:3])):
        value = builder.insert_element(value, builder.load(address), ir.Constant(ir.IntType(32), lane))
    return value


@_compiled(scatter, types.none, (batch, types.intp, types.intp, lanes))
def _emit_scatter(context: Any, builder: Any, matrices: Any, first: Any, step: Any, x: Any) -> Any:
    for lane, address in enumerate(_addresses(context, builder, matrices, first, step)):
        builder.store(builder.extract_element(x, ir.Constant(ir.IntType(32), lane)), address)
    return context.get_dummy_value()


@_compiled(anywhere, types.boolean, (mask,))
def _emit_anywhere(context: Any, builder: Any, condition: Any) -> Any:
    together = builder.bitcast(condition, ir.IntType(LANES))
    return builder.icmp_unsigned("!=", together, ir.Constant(together.type, 0))


@_compiled(everywhere, types.boolean, (mask,))
def _emit_everywhere(context: Any, builder: Any, condition: Any) -> Any:
    together = builder.bitcast(condition, ir.IntType(LANES))
    return builder.icmp_unsigned("==", together, ir.Constant(together.type, 2**LANES - 1))


def _constant(value: int) -> Any:
    return ir.Constant(_integer, [value] * LANES)


def _split(builder: Any, x: Any) -> tuple[Any, Any]:
    """Take the bits of x apart: those of x itself and, counted from √½, those of the power of two."""
    together = builder.bitcast(x, _integer)
    return together, builder.ashr(builder.sub(together, _constant(LOWEST_BITS)), _constant(52))


@_compiled(mantissa, lanes, (lanes,))
def _emit_mantissa(context: Any, builder: Any, x: Any) -> Any:
    together, power = _split(builder, x)
    return builder.bitcast(builder.sub(together, builder.shl(power, _constant(52))), _double)


@_compiled(exponent, lanes, (lanes,))
def _emit_exponent(context: Any, builder: Any, x: Any) -> Any:
    return builder.sitofp(_split(builder, x)[1], _double)


@_compiled(power_of_two, lanes, (lanes,))
def _emit_power_of_two(context: Any, builder: Any, k: Any) -> Any:
    biased = builder.add(builder.fptosi(k, _integer), _constant(1023))
    return builder.bitcast(builder.shl(biased, _constant(52)), _double)
