"""Drift of universal kriging: what a quantity's mean may depend on, besides a constant."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from typing import TYPE_CHECKING

import numpy as np

if TYPE_CHECKING:
    from numpy.typing import NDArray

    Array = NDArray[np.floating]

DriftFunction = Callable[["Array"], "Array"]


def linear(positions: Array) -> Array:
    """The two coordinates: a plane across the lake, (n, 2)."""
    return np.asarray(positions, dtype=float)


def inflow(place: tuple[float, float]) -> DriftFunction:
    """Logarithm of the distance to an inflow, (n, 1), as what spreads from it thins out.

    Constant within a metre of the inflow.
    """

    def distance(positions: Array) -> Array:
        return np.log(np.maximum(np.hypot(*(positions - place).T), 1.0))[:, None]

    return distance


def combined(functions: Sequence[DriftFunction]) -> DriftFunction | None:
    """Several drifts side by side; None if there are none."""
    if not functions:
        return None
    return lambda positions: np.column_stack([function(positions) for function in functions])
