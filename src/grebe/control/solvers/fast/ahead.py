"""The solver's kernels compiled part by part, so that two processes can share the work.

A kernel that calls others takes them from disk where it finds them. `optimise` calls all of the
solver's: `compile_horizon` and `compile_quadratic` are two halves of them, and may be compiled at
once. Both only say which arguments the kernels are to be compiled for: one that `optimise` calls
otherwise is compiled with it, later.
"""

from __future__ import annotations

from typing import Any

from numba.core import types

from grebe.control.solvers.fast import interior, sqp

_NUMBER, _COUNT, _TRUTH = types.float64, types.int64, types.boolean
_LIST, _ROWS, _STAGES = (types.Array(_NUMBER, axes, "C") for axes in (1, 2, 3))
_COUNTS = types.Array(_COUNT, 1, "C")
# One column of what numpy found, rows by columns.
_NODES = types.Array(_COUNT, 1, "A")


def compile_quadratic() -> None:
    """Compile the interior point, where it starts, and what it calls."""
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
    """Compile what `optimise` asks of a horizon: the model's derivatives, the cost and the step."""
    inner, outer = types.Array(_NUMBER, 4, "C"), _STAGES
    shooting = _named(sqp.Shooting, sens=_STAGES, gap=_ROWS, points=inner, slopes=outer, jacs=inner)
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
    """Compile the solver, of the two halves that are on disk by now, or else with them."""
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
    """What a named tuple is to numba."""
    return types.NamedTuple([members[name] for name in kind._fields], kind)


def _compile(kernel: Any, *arguments: Any) -> None:
    # Run by Python, without a compiler, a kernel is a function.
    if hasattr(kernel, "compile"):
        kernel.compile(arguments)
