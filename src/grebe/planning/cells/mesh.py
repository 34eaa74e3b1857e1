"""Mesh a region into cells: the target sets' footprints (section 6.2 of the paper).

Tiles of any shape, size and orientation are clipped to the water. Tiles that the shore cuts are
divided into convex pieces. Small pieces join a neighbour if the union stays convex; the smallest
of those that cannot are no targets, but may be passed through. The cells are disjoint and cover
the water. The targets made of them have at most eight sides and may lose a sliver.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np
import shapely
from shapely import affinity

from grebe.core.errors import PlanError
from grebe.core.plan_settings import Shape
from grebe.planning.cells import lattice
from grebe.planning.cells.convex import convex_growth, convex_pieces, convex_union, shared_edge_m

Ring = tuple[tuple[float, float], ...]

MAX_SIDES = 8
# Vertices nearer to each other than this [m] count as one.
SHORTEST_SIDE_M = 1e-5
# A clipped piece smaller than this share of a full cell joins a neighbour ...
SMALLEST_SHARE = 0.25
# ... and one that cannot join is no target below this share.
SPECK_SHARE = 0.04
LEAST_RADIUS_M = 0.5
# A piece thinner than this [m] that joins no neighbour cannot even be passed, and is left out.
THINNEST_M = 0.03
MAX_CELLS = 200_000
# Largest number of cells in the lattice over the region's bounds, most of which may be land.
MAX_GRID = 2_000_000


@dataclass(frozen=True, kw_only=True)
class Cell:
    """One cell of a mesh: its place in the lattice and its convex footprint (x north, y east).

    `whole`: the shore does not cut its tile; `is_speck`: it is too small to be a target, and only
    connects others.
    """

    row: int
    column: int
    footprint: shapely.Polygon
    whole: bool = False
    is_speck: bool = False


def mesh_water(
    water: shapely.Polygon,
    cell_m: float,
    *,
    shape: Shape = "square",
    angle_deg: float = 0.0,
    keeps_slivers: bool = False,
) -> list[Cell]:
    """Cut water, possibly concave and with islands, into convex cells of area cell_m^2.

    Rows run along `angle_deg`, clockwise from north. With `keeps_slivers`, pieces too thin to be
    passed are added to a neighbour. Raises `PlanError` when the region is smaller than a cell or
    holds too many.
    """
    _check_size(water, cell_m, angle_deg)
    upright = affinity.rotate(water, -angle_deg, origin=(0, 0))
    _check_grid(upright, cell_m)
    row, column, corners = lattice.tiles(shape, upright.bounds, cell_m)
    boxes = lattice.polygons(corners)
    shapely.prepare(upright)
    inside = shapely.covers(upright, boxes)
    cells = [
        Cell(row=r, column=c, footprint=box, whole=True)
        for r, c, box in zip(
            row[inside].tolist(), column[inside].tolist(), boxes[inside], strict=True
        )
    ]
    cut = ~inside & shapely.intersects(upright, boxes)
    for r, c, piece in zip(
        row[cut].tolist(), column[cut].tolist(),
        shapely.intersection(boxes[cut], upright), strict=True,
    ):  # fmt: skip
        cells += [Cell(row=r, column=c, footprint=part) for part in _polygons(piece)]
    return _turned(_tidy(cells, cell_m**2, keeps_slivers=keeps_slivers), angle_deg)


def _check_size(water: shapely.Polygon, cell_m: float, angle_deg: float) -> None:
    if not (math.isfinite(cell_m) and cell_m > 0 and math.isfinite(angle_deg)):
        raise PlanError(
            f"A cell of {cell_m} m at {angle_deg} degrees is impossible; give a positive size "
            "and a finite angle."
        )
    if water.area < cell_m**2:
        raise PlanError(
            f"The region has {water.area:.1f} m2, less than one cell of {cell_m:g} m x "
            f"{cell_m:g} m; choose smaller cells."
        )
    if water.area / cell_m**2 > MAX_CELLS:
        raise PlanError(
            f"Cells of {cell_m:g} m would number {water.area / cell_m**2:,.0f}, more than "
            f"{MAX_CELLS:,}; choose larger cells."
        )


def _check_grid(upright: shapely.Polygon, cell_m: float) -> None:
    x0, y0, x1, y1 = upright.bounds
    if (x1 - x0) * (y1 - y0) / cell_m**2 > MAX_GRID:
        raise PlanError(
            f"The region's bounding box holds {(x1 - x0) * (y1 - y0) / cell_m**2:,.0f} cells "
            f"of {cell_m:g} m, more than {MAX_GRID:,}; choose larger cells or another angle."
        )


def _polygons(piece: shapely.Geometry) -> list[shapely.Polygon]:
    """The convex pieces of a tile's part in the water."""
    parts = [p for p in shapely.get_parts(piece) if isinstance(p, shapely.Polygon) and p.area > 0]
    return [convex for part in parts for convex in convex_pieces(part)]


def wide_pieces(water: shapely.Geometry) -> list[shapely.Polygon]:
    """The convex pieces of water that are wide enough to be passed."""
    return [one for one in _polygons(water) if 2 * one.area / one.length >= THINNEST_M]


def _turned(cells: list[Cell], angle_deg: float) -> list[Cell]:
    """Turn cells from the lattice's axes to north and east, all at once."""
    if angle_deg == 0:
        return cells
    turn = math.radians(angle_deg)
    matrix = np.array([[math.cos(turn), math.sin(turn)], [-math.sin(turn), math.cos(turn)]])
    footprints = shapely.transform([cell.footprint for cell in cells], lambda xy: xy @ matrix)
    return [
        replace(cell, footprint=footprint)
        for cell, footprint in zip(cells, footprints, strict=True)
    ]


def _tidy(cells: list[Cell], full_m2: float, *, keeps_slivers: bool) -> list[Cell]:
    """Join each small piece to a neighbour, smallest first; pieces that stay tiny are specks."""
    footprints: list[shapely.Polygon | None] = [cell.footprint for cell in cells]
    whole = [cell.whole for cell in cells]
    areas = np.array([cell.footprint.area for cell in cells])
    tree = shapely.STRtree([cell.footprint for cell in cells])
    for i in np.argsort(areas).tolist():
        piece = footprints[i]
        if areas[i] >= SMALLEST_SHARE * full_m2:
            break
        if piece is None or piece.area >= SMALLEST_SHARE * full_m2:
            continue
        near = [j for j in tree.query(piece).tolist() if j != i and footprints[j] is not None]
        unions = {j: u for j in near if (u := convex_union(footprints[j], piece)) is not None}
        if unions:
            best = max(unions, key=lambda j: shared_edge_m(footprints[j], piece))
            footprints[best], whole[best] = unions[best], False
            footprints[i] = None
        elif 2 * piece.area / piece.length < THINNEST_M:
            footprints[i] = None
            grown = _grown(footprints, near, piece) if keeps_slivers else None
            if grown is not None:
                footprints[grown[0]], whole[grown[0]] = grown[1], False
    return [
        Cell(
            row=cell.row,
            column=cell.column,
            footprint=footprint,
            whole=own,
            is_speck=footprint.area < SPECK_SHARE * full_m2 or (not own and _is_thin(footprint)),
        )
        for cell, footprint, own in zip(cells, footprints, whole, strict=True)
        if footprint is not None
    ]


def _grown(
    footprints: Sequence[shapely.Polygon | None], near: Sequence[int], piece: shapely.Polygon
) -> tuple[int, shapely.Polygon] | None:
    """The cell among `near` that can take the most of a piece, and its footprint with it."""
    grown = [
        (shape.area - one.area, j, shape)
        for j in near
        if (one := footprints[j]) is not None and (shape := convex_growth(one, piece)) is not None
    ]
    return max(grown)[1:] if grown else None


def _is_thin(footprint: shapely.Polygon) -> bool:
    """Whether a cell is too thin for a boat to turn: no circle of `LEAST_RADIUS_M` fits in it."""
    return shapely.maximum_inscribed_circle(footprint).length < LEAST_RADIUS_M


def target_footprint(ring: Ring) -> Ring:
    """Return a convex polygon of at most eight sides inside a convex ring, losing little area.

    Leaving out a vertex of a convex polygon cuts off the triangle that it forms with its
    neighbours. The smallest triangle is cut off first, so vertices on a straight line go first.
    """
    vertices = list(ring)
    tiny = 1e-9 * shapely.Polygon(ring).area
    while len(vertices) > 3:
        areas = [_loss_m2(vertices, i) for i in range(len(vertices))]
        smallest = int(np.argmin(areas))
        if areas[smallest] > tiny and len(vertices) <= MAX_SIDES:
            break
        del vertices[smallest]
    return tuple(vertices)


def _loss_m2(vertices: list[tuple[float, float]], i: int) -> float:
    """The area lost by leaving out a vertex; zero if it coincides with the one before it."""
    (x0, y0), (x1, y1) = vertices[i - 1], vertices[i]
    if math.hypot(x1 - x0, y1 - y0) < SHORTEST_SIDE_M:
        return 0.0
    x2, y2 = vertices[(i + 1) % len(vertices)]
    return 0.5 * abs((x1 - x0) * (y2 - y0) - (x2 - x0) * (y1 - y0))
