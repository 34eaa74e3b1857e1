"""Copies of arrays within kernels.

These replace assignments to slices. A slice assignment also compiles the error message for unequal
shapes, and this string code takes an eighth as long as all the other machine code.
"""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from grebe.core.kernels import inlined_machine_code

if TYPE_CHECKING:
    from numpy.typing import NDArray

    Array = NDArray[np.floating]


@inlined_machine_code
def copy_vector(to: Array, of: Array) -> None:
    """Copy a vector (n,) into another."""
    for i in range(to.shape[0]):
        to[i] = of[i]


@inlined_machine_code
def copy_matrix(to: Array, of: Array) -> None:
    """Copy a matrix (n, m) into another."""
    for i in range(to.shape[0]):
        for j in range(to.shape[1]):
            to[i, j] = of[i, j]
