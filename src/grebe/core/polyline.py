"""Distances and positions along a polyline."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

if TYPE_CHECKING:
    from numpy.typing import NDArray

    Array = NDArray[np.floating]


def passed_m(polyline: Array) -> Array:
    """Distance along a polyline (n, 2) at each of its vertices, (n,) [m]."""
    return np.concatenate([[0.0], np.cumsum(np.hypot(*np.diff(polyline, axis=0).T))])


def places_at(polyline: Array, distances_m: Array) -> NDArray[np.float64]:
    """Positions (m, 2) at distances (m,) along a polyline (n, 2)."""
    passed = passed_m(polyline)
    return np.column_stack([np.interp(distances_m, passed, column) for column in polyline.T])
