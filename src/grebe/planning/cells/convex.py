"""Cut polygons into convex pieces, and join pieces whose union is convex.

Target sets are convex (section 6.3); water is not. A polygon is triangulated without new
vertices (constrained Delaunay), and the triangles are joined again, across the longest edges
first, as long as the union stays convex (after Hertel and Mehlhorn 1983). This gives at most four
times the minimum number of pieces, mostly far fewer.
"""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np
import shapely

if TYPE_CHECKING:
    from numpy.typing import NDArray

    Corners = NDArray[np.float64]

# A piece that touches an edge may reach this far beyond it by rounding [m].
ROUNDING_M = 1e-6
# A union counts as convex when its hull's area exceeds its own by no more than this share.
CONVEXITY_SHARE = 1e-9


def is_convex(polygon: shapely.Polygon) -> bool:
    """Whether a polygon has no holes and equals its convex hull."""
    hull = polygon.convex_hull
    return not polygon.interiors and polygon.area >= hull.area * (1 - CONVEXITY_SHARE)


def convex_union(a: shapely.Polygon, b: shapely.Polygon) -> shapely.Polygon | None:
    """The union of two pieces without the vertices of their seam, or None if it is not convex."""
    union = shapely.union(a, b)
    hull = union.convex_hull
    if isinstance(hull, shapely.Polygon) and union.area >= hull.area * (1 - CONVEXITY_SHARE):
        return hull
    return None


def convex_growth(a: shapely.Polygon, b: shapely.Polygon) -> shapely.Polygon | None:
    """Piece `a` extended into its neighbour `b` as far as it stays convex: by the part of `b`
    between the extended sides of `a` next to their common edge. None if they do not share a
    complete edge of `a`.
    """
    corners = shapely.get_coordinates(shapely.normalize(a).exterior)[::-1]
    edges = np.diff(corners, axis=0)
    long_enough = np.hypot(*edges.T) > ROUNDING_M
    corners, edges = corners[:-1][long_enough], edges[long_enough]
    inwards = np.column_stack([-edges[:, 1], edges[:, 0]]) / np.hypot(*edges.T)[:, None]
    part = shapely.get_coordinates(b.exterior)
    beyond = (((part[:, None] - corners) * inwards).sum(axis=2) <= ROUNDING_M).all(axis=0)
    if beyond.sum() != 1:
        return None
    for corner, inward in zip(corners[~beyond], inwards[~beyond], strict=True):
        part = _clipped(part, corner, inward)
    grown = shapely.convex_hull(shapely.MultiPoint(np.vstack([corners, part])))
    room_m2 = a.area * (1 + CONVEXITY_SHARE) + shapely.Polygon(part).area if len(part) > 3 else 0.0
    return grown if isinstance(grown, shapely.Polygon) and grown.area <= room_m2 else None


def _clipped(ring: Corners, corner: Corners, inward: Corners) -> Corners:
    """The part of a closed convex ring (n, 2) on the inner side of a line: a closed ring, or an
    empty array.
    """
    away = (ring - corner) @ inward
    kept: list[Corners] = []
    for k in range(len(ring) - 1):
        if away[k] >= 0:
            kept.append(ring[k])
        if away[k] * away[k + 1] < 0:
            kept.append(ring[k] + away[k] / (away[k] - away[k + 1]) * (ring[k + 1] - ring[k]))
    return np.array([*kept, kept[0]]) if kept else np.empty((0, 2))


def convex_pieces(polygon: shapely.Polygon) -> list[shapely.Polygon]:
    """Cut a polygon into disjoint convex pieces that cover it."""
    if is_convex(polygon):
        return [polygon]
    triangles = shapely.get_parts(shapely.constrained_delaunay_triangles(polygon))
    return _joined([t for t in triangles if t.area > 0])


def _joined(pieces: list[shapely.Polygon]) -> list[shapely.Polygon]:
    """Join neighbours across their shared edges, the longest first, while convex."""
    alive = dict(enumerate(pieces))
    tree = shapely.STRtree(pieces)
    first, second = tree.query(pieces, predicate="intersects")
    pairs = [(i, j) for i, j in zip(first.tolist(), second.tolist(), strict=True) if i < j]
    edges = [(shared_edge_m(pieces[i], pieces[j]), i, j) for i, j in pairs]
    home = list(range(len(pieces)))
    for length, i, j in sorted(edges, reverse=True):
        a, b = _root(home, i), _root(home, j)
        if length <= 0 or a == b:
            continue
        union = convex_union(alive[a], alive[b])
        if union is not None:
            alive[a] = union
            del alive[b]
            home[b] = a
    return list(alive.values())


def _root(home: list[int], i: int) -> int:
    while home[i] != i:
        i = home[i]
    return i


def shared_edge_m(a: shapely.Polygon, b: shapely.Polygon) -> float:
    """Return the length of the border that two touching pieces share."""
    return float(shapely.intersection(a, b).length)
