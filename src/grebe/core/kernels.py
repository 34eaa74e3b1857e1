"""How the numerical kernels are compiled: by numba, once, and kept on disk."""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path
from typing import Any

import numba

# Sums may be reordered and multiplications fused; NaN and infinity keep their meaning, the
# solver's tests for them rely on it.
_FASTMATH = {"contract", "reassoc", "arcp", "nsz"}


# Where the compiled controller is kept, below the package.
CONTROLLER = "control/solvers/fast/__pycache__"


def compiled(function: Callable[..., Any]) -> Callable[..., Any]:
    """Compile a kernel on first use; later processes load it from the cache.

    While it runs, other threads do too: the one that ends a command when it is told to.
    """
    return numba.njit(cache=True, fastmath=_FASTMATH, error_model="numpy", nogil=True)(function)


def compiled_inline(function: Callable[..., Any]) -> Callable[..., Any]:
    """Compile a small kernel into those that call it: a record of arrays costs more to hand over
    than such a kernel takes.
    """
    return numba.njit(cache=True, fastmath=_FASTMATH, error_model="numpy", forceinline=True)(
        function
    )


def is_compiled() -> bool:
    """Whether the solver lies in the cache beside its source, so that it starts at once."""
    return any((Path(__file__).parents[1] / CONTROLLER).glob("sqp.optimise*.nbi"))
