"""Lattices of equal tiles: squares, hexagons, triangles.

A tile of size s has the area s^2 whatever its shape, so plans with different shapes have equally
many targets. Tiles form rows along the first axis.
"""

from __future__ import annotations

import math
from collections.abc import Callable
from typing import TYPE_CHECKING, Any

import numpy as np
import shapely

from grebe.core.plan_settings import Shape

if TYPE_CHECKING:
    from numpy.typing import NDArray

    Array = NDArray[np.float64]
    Indices = NDArray[np.signedinteger[Any]]
    # Row and column of each tile, and its corners (n, m, 2).
    Tiles = tuple[Indices, Indices, Array]

# If less than this share of a cell remains beyond the last row, no new row is made.
SLIVER = 0.02

# Sides of a regular hexagon and triangle of unit area.
_HEXAGON_SIDE = math.sqrt(2 / (3 * math.sqrt(3)))
_TRIANGLE_SIDE = 2 / 3**0.25


def tiles(shape: Shape, bounds: tuple[float, float, float, float], size_m: float) -> Tiles:
    """Return the rows, columns and corners of the tiles that cover `bounds` (x0, y0, x1, y1)."""
    makers: dict[Shape, Callable[[Array, float], Tiles]] = {
        "square": _squares,
        "hexagon": _hexagons,
        "triangle": _triangles,
    }
    return makers[shape](np.asarray(bounds, dtype=float), size_m)


def polygons(corners: Array) -> NDArray[np.object_]:
    """Return shapely polygons of (n, m, 2) corners."""
    return np.asarray(shapely.polygons(corners), dtype=object)


def _squares(bounds: Array, size: float) -> Tiles:
    x0, y0, x1, y1 = bounds
    across, up = _lines(x0, x1, size), _lines(y0, y1, size)
    row, column = (index.ravel() for index in np.indices((len(up) - 1, len(across) - 1)))
    left, right, low, high = across[column], across[column + 1], up[row], up[row + 1]
    corners = np.stack(
        [
            np.stack(pair, axis=-1)
            for pair in ((left, low), (right, low), (right, high), (left, high))
        ],
        axis=1,
    )
    return row, column, corners


def _lines(low: float, high: float, size: float) -> Array:
    """Grid lines centred on [low, high]; the outermost tiles are stretched over a sliver."""
    count = max(1, math.ceil((high - low) / size - SLIVER))
    lines = (low + high - count * size) / 2 + size * np.arange(count + 1)
    lines[0], lines[-1] = min(lines[0], low), max(lines[-1], high)
    return np.asarray(lines, dtype=np.float64)


def _hexagons(bounds: Array, size: float) -> Tiles:
    """Hexagons with flat sides across the rows, so that the centres of a row are on a line."""
    side = _HEXAGON_SIDE * size
    half_wide, half_side = 0.5 * math.sqrt(3) * side, 0.5 * side
    x0, y0, x1, y1 = bounds
    rows = math.ceil((y1 - y0) / (3 * half_side)) + 1
    columns = math.ceil((x1 - x0) / (2 * half_wide)) + 1
    row, column = (index.ravel() for index in np.indices((rows, columns)))
    across = 2 * column + row % 2
    ring = np.array([(1, 1), (0, 2), (-1, 1), (-1, -1), (0, -2), (1, -1)])
    origin = (
        (x0 + x1 - (2 * columns - 1) * half_wide) / 2,
        (y0 + y1 - 3 * (rows - 1) * half_side) / 2,
    )
    corners = _placed(across, 3 * row, ring, origin, (half_wide, half_side))
    return row, column, corners


def _triangles(bounds: Array, size: float) -> Tiles:
    """Triangles that stand alternately on their base and on their tip."""
    side = _TRIANGLE_SIDE * size
    half, tall = 0.5 * side, 0.5 * math.sqrt(3) * side
    x0, y0, x1, y1 = bounds
    rows = max(1, math.ceil((y1 - y0) / tall - SLIVER))
    columns = 2 * math.ceil((x1 - x0) / side) + 3
    row, column = (index.ravel() for index in np.indices((rows, columns)))
    origin = ((x0 + x1 - (columns - 1) * half) / 2, (y0 + y1 - rows * tall) / 2)
    upright = ((row + column) % 2 == 0)[:, None, None]
    standing = _placed(column, row, np.array([(-1, 0), (1, 0), (0, 1)]), origin, (half, tall))
    hanging = _placed(column, row, np.array([(-1, 1), (0, 0), (1, 1)]), origin, (half, tall))
    return row, column, np.where(upright, standing, hanging)


def _placed(
    across: Indices,
    up: Indices,
    ring: Indices,
    origin: tuple[float, float],
    unit: tuple[float, float],
) -> Array:
    """Corners at integer multiples of units, so that neighbours share exactly the same corners."""
    steps = np.stack([across, up], axis=-1)[:, None, :] + ring
    return np.asarray(np.asarray(origin) + steps * np.asarray(unit), dtype=np.float64)
