"""Compilation of the solver's kernels in parts, so that two processes can share the work.

A kernel loads the kernels that it calls from disk if they are there. `optimise` calls all the
others: `compile_horizon` and `compile_quadratic` compile two halves of them and can run at the same
time. Both only list the argument types to compile for. A kernel that `optimise` calls with other
types is compiled later, together with `optimise`.
"""

from __future__ import annotations

from typing import Any

from numba.core import types

from grebe.control.solvers.fast import interior, sqp

_NUMBER, _COUNT, _TRUTH = types.float64, types.int64, types.boolean
_LIST, _ROWS, _STAGES = (types.Array(_NUMBER, axes, "C") for axes in (1, 2, 3))
_COUNTS = types.Array(_COUNT, 1, "C")
# A column of the result of `numpy.nonzero`, which is not contiguous.
_NODES = types.Array(_COUNT, 1, "A")


def compile_quadratic() -> None:
    """Compile the interior point, its starting values, and the kernels that they call."""
    hess, grad, sens, gap = _STAGES, _ROWS, _STAGES, _ROWS
    families = _ROWS, _COUNTS, _NODES, _LIST, _LIST
    base, box, pairs, slacks = _LIST, (_ROWS, _ROWS), (_LIST, _LIST), (_LIST, _LIST)
    found = _ROWS, _ROWS, _ROWS, _STAGES
    _compile(
        interior.minimise, hess, grad, sens, gap, *families, base, *box, *pairs, *slacks, *found,
        _NUMBER,
    )  # fmt: skip
    _compile(interior.start_rows, _COUNTS, _LIST, _LIST, base, *pairs, *slacks)
    _compile(interior.start_box, *box, *pairs)


def compile_horizon() -> None:
    """Compile the kernels of a horizon: the model's derivatives, the cost and the step."""
    inner, outer = types.Array(_NUMBER, 4, "C"), _STAGES
    shooting = _named(
        sqp.Shooting, sens=_STAGES, gap=_ROWS, stage_sens=inner, stage_states=outer, jacs=inner
    )
    terms, states = _terms(), _ROWS
    inputs = costate = dx = dw = grad = _ROWS
    hess = gain = _STAGES
    _compile(sqp.shoot, terms, states, inputs, shooting)
    _compile(sqp.quadratic, terms, inputs, costate, shooting, _NUMBER, _TRUTH, _TRUTH, hess, grad)
    _compile(
        sqp.search, terms, states, inputs, dx, dw, gain, _TRUTH, _NUMBER, _NUMBER, _NUMBER,
        states, inputs,
    )  # fmt: skip
    _compile(sqp.unfinished, terms, gain, states, inputs, _NUMBER, _COUNT)


def compile_optimise() -> None:
    """Compile the solver, with the two halves from disk or else together with them."""
    states = inputs = costate = _ROWS
    _compile(sqp.optimise, _terms(), states, inputs, costate, _COUNT, _NUMBER)


def _terms() -> Any:
    return _named(
        sqp.Terms,
        p=_LIST, substeps=_COUNT, rows=_ROWS, first=_COUNTS, node=_NODES, weight=_LIST,
        price=_LIST, effort=_ROWS, timing=_ROWS, limits=_LIST, bounds=_STAGES,
        regularisation=_NUMBER,
    )  # fmt: skip


def _named(kind: Any, **members: Any) -> Any:
    """Numba type of a named tuple."""
    return types.NamedTuple([members[name] for name in kind._fields], kind)


def _compile(kernel: Any, *arguments: Any) -> None:
    # In plain Python, without a compiler, a kernel is a function.
    if hasattr(kernel, "compile"):
        kernel.compile(arguments)
