"""Eight numbers in one register, for kernels with rows of up to eight numbers.

A row of a stage's sensitivities has seven numbers, which fit a register of eight or two of four.
The compiler does not vectorise them by itself: numba disables that pass, which has produced wrong
code before. So a kernel requests it: the compiler takes the results of `eight` and `loaded` as
vectors, with `+`, `-` and multiplication by a number; `stored` writes a vector back. In plain
Python, without a compiler, a vector is an array of eight numbers.

A shorter row is padded to eight numbers, and the padding takes part in the arithmetic: it must be
finite, or never be read.
"""

from __future__ import annotations

import operator
from typing import TYPE_CHECKING, Any

import numpy as np
from llvmlite import ir
from numba.core import types
from numba.extending import lower_builtin, models, register_model, type_callable

from grebe.core.kernels import inlined_machine_code

if TYPE_CHECKING:
    from numpy.typing import NDArray

    Array = NDArray[np.float64]

WIDTH = 8
_DOUBLE, _INDEX = ir.DoubleType(), ir.IntType(32)
_VECTOR = ir.VectorType(_DOUBLE, WIDTH)
# A row may begin at any element of an array of doubles.
_ALIGNMENT = 8


def eight(a: float, b: float, c: float, d: float, e: float, f: float, g: float, h: float) -> Array:
    """Return eight numbers as one vector."""
    return np.array([a, b, c, d, e, f, g, h])


def loaded(rows: Array, row: int, column: int) -> Array:
    """Return eight numbers of a row of `rows` (n, m), from `column` on.

    Indices are not checked, and negative ones do not count from the end.
    """
    return rows[row, column : column + WIDTH].copy()


def stored(numbers: Array, rows: Array, row: int, column: int) -> None:
    """Write eight numbers into a row of `rows` (n, m), from `column` on; see `loaded`."""
    rows[row, column : column + WIDTH] = numbers


class _Eight(types.Type):
    """Numba type of eight numbers."""

    def __init__(self) -> None:
        super().__init__(name="eight")


_EIGHT = _Eight()


@register_model(_Eight)
class _Model(models.PrimitiveModel):  # pyright: ignore[reportUnusedClass]
    def __init__(self, manager: Any, kind: Any) -> None:
        super().__init__(manager, kind, _VECTOR)


# Eight numbers are loaded from and stored to contiguous rows of doubles only.


def _is_rows(kind: Any) -> bool:
    lies_so = isinstance(kind, types.Array) and kind.ndim == 2 and kind.layout == "C"
    return lies_so and kind.dtype == types.float64


def _are_numbers(*kinds: Any) -> bool:
    return all(kind == types.float64 for kind in kinds)


def _are_places(*kinds: Any) -> bool:
    return all(isinstance(kind, types.Integer) for kind in kinds)


# Numba asks the inner functions for a call's return type; None rejects the argument types.


@type_callable(operator.add)
@type_callable(operator.sub)
def _sum_of(_context: Any) -> Any:
    return lambda one, other: _EIGHT if one == other == _EIGHT else None


@type_callable(operator.mul)
def _product_of(_context: Any) -> Any:
    return lambda by, numbers: _EIGHT if numbers == _EIGHT and _are_numbers(by) else None


@type_callable(eight)
def _gathered_of(_context: Any) -> Any:
    return lambda a, b, c, d, e, f, g, h: _EIGHT if _are_numbers(a, b, c, d, e, f, g, h) else None


@type_callable(loaded)
def _loaded_of(_context: Any) -> Any:
    return lambda rows, row, column: _EIGHT if _is_rows(rows) and _are_places(row, column) else None


@type_callable(stored)
def _stored_of(_context: Any) -> Any:
    return lambda numbers, rows, row, column: (
        types.none
        if numbers == _EIGHT and _is_rows(rows) and rows.mutable and _are_places(row, column)
        else None
    )


@lower_builtin(operator.add, _Eight, _Eight)
def _add(_context: Any, builder: Any, _signature: Any, given: Any) -> Any:
    return builder.fadd(*given)


@lower_builtin(operator.sub, _Eight, _Eight)
def _subtract(_context: Any, builder: Any, _signature: Any, given: Any) -> Any:
    return builder.fsub(*given)


@lower_builtin(operator.mul, types.Float, _Eight)
def _scale(_context: Any, builder: Any, _signature: Any, given: Any) -> Any:
    number, numbers = given
    first = builder.insert_element(ir.Constant(_VECTOR, ir.Undefined), number, _INDEX(0))
    everywhere = ir.Constant(ir.VectorType(_INDEX, WIDTH), [0] * WIDTH)
    return builder.fmul(builder.shuffle_vector(first, first, everywhere), numbers)


@lower_builtin(eight, *[types.Float] * WIDTH)
def _gather(_context: Any, builder: Any, _signature: Any, given: Any) -> Any:
    vector = ir.Constant(_VECTOR, ir.Undefined)
    for i, number in enumerate(given):
        vector = builder.insert_element(vector, number, _INDEX(i))
    return vector


@lower_builtin(loaded, types.Array, types.Integer, types.Integer)
def _load(context: Any, builder: Any, signature: Any, given: Any) -> Any:
    return builder.load(_place(context, builder, signature.args, given), align=_ALIGNMENT)


@lower_builtin(stored, _Eight, types.Array, types.Integer, types.Integer)
def _store(context: Any, builder: Any, signature: Any, given: Any) -> Any:
    numbers, *where = given
    place = _place(context, builder, signature.args[1:], where)
    builder.store(numbers, place, align=_ALIGNMENT)
    return context.get_dummy_value()


def _place(context: Any, builder: Any, kinds: Any, given: Any) -> Any:
    """Pointer to a row's eight numbers."""
    rows_kind, *index_kinds = kinds
    rows = context.make_array(rows_kind)(context, builder, given[0])
    row, column = (
        context.cast(builder, index, kind, types.intp)
        for index, kind in zip(given[1:], index_kinds, strict=True)
    )
    (_, width) = (builder.extract_value(rows.shape, axis) for axis in range(2))
    first = builder.add(builder.mul(row, width), column)
    return builder.bitcast(builder.gep(rows.data, [first]), _VECTOR.as_pointer())


@inlined_machine_code
def sum_of_four(rows: Array, w0: float, w1: float, w2: float, w3: float) -> Array:
    """Weighted sum of four rows of eight numbers."""
    return (w0 * loaded(rows, 0, 0) + w1 * loaded(rows, 1, 0)) + (
        w2 * loaded(rows, 2, 0) + w3 * loaded(rows, 3, 0)
    )


@inlined_machine_code
def sum_of_six(
    rows: Array, w0: float, w1: float, w2: float, w3: float, w4: float, w5: float
) -> Array:
    """Weighted sum of six rows of eight numbers."""
    return (
        (w0 * loaded(rows, 0, 0) + w1 * loaded(rows, 1, 0))
        + (w2 * loaded(rows, 2, 0) + w3 * loaded(rows, 3, 0))
        + (w4 * loaded(rows, 4, 0) + w5 * loaded(rows, 5, 0))
    )
