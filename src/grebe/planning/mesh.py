"""Mesh a region into cells: the target sets' footprints (section 6.2 of the paper).

Squares of any size and orientation, clipped to the water. The cells are disjoint and cover
the region; the targets made of them have at most eight sides and may lose a sliver.
"""

from __future__ import annotations

import math
from collections.abc import Iterable
from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np
import shapely
from shapely import affinity

from grebe.errors import PlanError
from grebe.sets import ring_vertices

if TYPE_CHECKING:
    from numpy.typing import NDArray

MAX_SIDES = 8
# A clipped piece smaller than this share of a full cell joins a neighbour.
SMALLEST_SHARE = 0.25
MAX_CELLS = 200_000
# Of the grid over the region's bounds, most of which may be land.
MAX_GRID = 2_000_000


@dataclass(frozen=True, kw_only=True)
class Cell:
    """One cell of a mesh: its place in the grid and its convex footprint (x north, y east)."""

    row: int
    column: int
    footprint: shapely.Polygon


def mesh_squares(water: shapely.Polygon, cell_m: float, angle_deg: float = 0.0) -> list[Cell]:
    """Cut convex water into squares of side `cell_m`.

    Rows run along `angle_deg`, clockwise from north. Pieces at the shore that are small
    join the neighbour they share the longest edge with; in convex water the union of two
    neighbours of a row or a column is convex again. Raises `PlanError` when the region is
    smaller than a cell or holds too many.
    """
    if not (math.isfinite(cell_m) and cell_m > 0 and math.isfinite(angle_deg)):
        raise PlanError(f"A cell of {cell_m} m at {angle_deg} degrees is no cell; give metres.")
    if water.area < cell_m**2:
        raise PlanError(
            f"The region has {water.area:.1f} m2, less than one cell of {cell_m:g} m x "
            f"{cell_m:g} m; choose smaller cells."
        )
    if water.area / cell_m**2 > MAX_CELLS:
        raise PlanError(
            f"Cells of {cell_m:g} m would be {water.area / cell_m**2:,.0f}, more than "
            f"{MAX_CELLS:,}; choose larger cells."
        )
    upright = affinity.rotate(water, -angle_deg, origin=(0, 0))
    x0, y0, x1, y1 = upright.bounds
    if (x1 - x0) * (y1 - y0) / cell_m**2 > MAX_GRID:
        raise PlanError(
            f"The region's bounds hold {(x1 - x0) * (y1 - y0) / cell_m**2:,.0f} cells of "
            f"{cell_m:g} m, more than {MAX_GRID:,}; choose larger cells or another angle."
        )
    pieces = _join_small(_clip(upright, cell_m), SMALLEST_SHARE * cell_m**2)
    return [
        Cell(row=row, column=column, footprint=affinity.rotate(piece, angle_deg, origin=(0, 0)))
        for (row, column), piece in pieces.items()
    ]


def _clip(water: shapely.Polygon, cell_m: float) -> dict[tuple[int, int], shapely.Polygon]:
    """Intersect the water with a grid that is centred on its bounds; x is along a row."""
    x0, y0, x1, y1 = water.bounds
    across, up = _lines(x0, x1, cell_m), _lines(y0, y1, cell_m)
    row, column = (index.ravel() for index in np.indices((len(up) - 1, len(across) - 1)))
    boxes = shapely.box(across[column], up[row], across[column + 1], up[row + 1])
    pieces = shapely.intersection(boxes, water)
    return {
        (int(r), int(c)): piece
        for r, c, piece in zip(row, column, pieces, strict=True)
        if isinstance(piece, shapely.Polygon) and piece.area > 0
    }


def _lines(low: float, high: float, cell_m: float) -> NDArray[np.floating]:
    """Grid lines centred on [low, high]; an excess of less than a fiftieth of a cell is no new
    row: the outermost cells take it.
    """
    count = max(1, math.ceil((high - low) / cell_m - 0.02))
    lines = (low + high - count * cell_m) / 2 + cell_m * np.arange(count + 1)
    lines[0], lines[-1] = min(lines[0], low), max(lines[-1], high)
    return lines


def _join_small(
    pieces: dict[tuple[int, int], shapely.Polygon], smallest_m2: float
) -> dict[tuple[int, int], shapely.Polygon]:
    """Join each piece below `smallest_m2` to a neighbour, smallest first."""
    joined = dict(pieces)
    for place in sorted(pieces, key=lambda key: pieces[key].area):
        piece = joined[place]
        if piece.area >= smallest_m2:
            continue
        neighbours = [n for n in _neighbours(place) if n in joined]
        convex = {n: u for n in neighbours if (u := _convex_union(joined[n], piece)) is not None}
        if convex:
            best = max(convex, key=lambda n: shared_edge_m(joined[n], piece))
            joined[best] = convex[best]
            del joined[place]
    return joined


def _neighbours(place: tuple[int, int]) -> Iterable[tuple[int, int]]:
    row, column = place
    return (row, column - 1), (row, column + 1), (row - 1, column), (row + 1, column)


def shared_edge_m(a: shapely.Polygon, b: shapely.Polygon) -> float:
    """Return the length of the border that two touching cells share."""
    return float(shapely.intersection(a, b).length)


def _convex_union(a: shapely.Polygon, b: shapely.Polygon) -> shapely.Polygon | None:
    """The union of two cells where it is convex, without the vertices of their seam."""
    union = shapely.union(a, b)
    hull = union.convex_hull
    if isinstance(hull, shapely.Polygon) and union.area >= hull.area * (1 - 1e-9):
        return hull
    return None


def target_footprint(cell: shapely.Polygon) -> tuple[tuple[float, float], ...]:
    """Return a convex polygon of at most eight sides inside a cell, losing as little as can be.

    Leaving out a vertex of a convex polygon cuts off the triangle it makes with its
    neighbours; the smallest triangle goes first, vertices on a straight line before all.
    """
    vertices = list(ring_vertices(cell))
    tiny = 1e-9 * cell.area
    while len(vertices) > 3:
        areas = [_corner_area(vertices, i) for i in range(len(vertices))]
        smallest = int(np.argmin(areas))
        if areas[smallest] > tiny and len(vertices) <= MAX_SIDES:
            break
        del vertices[smallest]
    return tuple(vertices)


def _corner_area(vertices: list[tuple[float, float]], i: int) -> float:
    (x0, y0), (x1, y1) = vertices[i - 1], vertices[i]
    x2, y2 = vertices[(i + 1) % len(vertices)]
    return 0.5 * abs((x1 - x0) * (y2 - y0) - (x2 - x0) * (y1 - y0))
