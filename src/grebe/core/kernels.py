"""How the numerical kernels are compiled: by numba, once, and kept on disk."""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path
from typing import ParamSpec, TypeVar, cast

import numba

_Arguments = ParamSpec("_Arguments")
_Result = TypeVar("_Result")

# Sums may be reordered and multiplications fused. NaN and infinity keep their meaning: the
# solver tests for them.
_FASTMATH = {"contract", "reassoc", "arcp", "nsz"}
# Where the compiled controller is kept, below the package.
CONTROLLER = "control/solvers/fast/__pycache__"


def machine_code(function: Callable[_Arguments, _Result]) -> Callable[_Arguments, _Result]:
    """Turn a kernel into machine code at its first call; later processes load it from disk.

    While it runs, other threads do too: the one that ends a command when it is told to.
    """
    kernel = numba.njit(cache=True, fastmath=_FASTMATH, error_model="numpy", nogil=True)(function)
    return cast("Callable[_Arguments, _Result]", kernel)


def inlined_machine_code(function: Callable[_Arguments, _Result]) -> Callable[_Arguments, _Result]:
    """Like `machine_code`, copied into each kernel that calls it. For small kernels: handing
    over a record of arrays takes longer than they do.
    """
    kernel = numba.njit(cache=True, fastmath=_FASTMATH, error_model="numpy", forceinline=True)(
        function
    )
    return cast("Callable[_Arguments, _Result]", kernel)


def is_compiled() -> bool:
    """Whether the solver's machine code is on disk, so that the controller starts at once."""
    return any((Path(__file__).parents[1] / CONTROLLER).glob("sqp.optimise*.nbi"))
