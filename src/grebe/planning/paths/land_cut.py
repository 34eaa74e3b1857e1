"""Cut a corridor: take a box around a leg's hull and remove the land from it by straight cuts.

The nearest land is cut off first, each time along the line through its nearest point that leaves
the hull intact. The rest is convex, contains the hull and is water.
"""

from __future__ import annotations

import math
from typing import TYPE_CHECKING

import numpy as np
import shapely

from grebe.core.crossing import crossing
from grebe.core.kernels import machine_code
from grebe.core.sets import polygons_of

if TYPE_CHECKING:
    from numpy.typing import NDArray

    Floats = NDArray[np.float64]
    Integers = NDArray[np.integer]

MOST_CUTS = 12
MOST_SIDES = 12
# Shore that reaches into a box by no more than this counts as outside it [m].
BESIDE_M = 1e-7
# Land no farther from a hull than this counts as touching it [m].
TOUCHING_M = 1e-3


def without_land(
    hulls: NDArray[np.object_], boxes: NDArray[np.object_], water: shapely.Polygon
) -> NDArray[np.object_]:
    """Cut the land off boxes, each around a convex hull of water. If that takes too many cuts or
    leaves too many sides, the result is the hull itself.
    """
    shore = _shore(water)
    box, side = shapely.STRtree(np.asarray(shapely.linestrings(shore))).query(boxes)
    order = np.argsort(box, kind="stable")
    near = np.searchsorted(box[order], np.arange(len(boxes) + 1))
    rings = shapely.get_exterior_ring(shapely.orient_polygons(hulls))
    corners, ring = shapely.get_coordinates(rings, return_index=True)
    starts = np.searchsorted(ring, np.arange(len(hulls) + 1))
    found, sides = _cut_all(
        corners, starts, np.asarray(shapely.bounds(boxes)), shore, side[order], near
    )
    done = np.flatnonzero(sides)
    left = hulls.copy()
    left[done] = polygons_of([found[k, : sides[k]].tolist() for k in done.tolist()])
    return left


def _shore(water: shapely.Polygon) -> Floats:
    """The sides of the water's rings, (n, 2, 2)."""
    rings = [shapely.get_coordinates(one) for one in (water.exterior, *water.interiors)]
    return np.concatenate([np.stack([one[:-1], one[1:]], axis=1) for one in rings])


@machine_code
def _cut_all(
    corners: Floats, starts: Integers, bounds: Floats, shore: Floats, side: Integers, near: Integers
) -> tuple[Floats, Integers]:
    """The rest of each box with `bounds` (n, 4): its corners (n, `MOST_SIDES`, 2) and their number,
    which is 0 if the cut failed. The ring of hull i is corners[starts[i]:starts[i + 1]], closed and
    anticlockwise; the shore beside it is shore[side[near[i]:near[i + 1]]].
    """
    n = len(bounds)
    found, sides = np.zeros((n, MOST_SIDES, 2)), np.zeros(n, dtype=np.int64)
    # Each cut adds at most one corner, and the ring repeats its first corner at the end.
    region, spare = np.empty((5 + MOST_CUTS, 2)), np.empty((5 + MOST_CUTS, 2))
    for i in range(n):
        for k in range(5):
            region[k, 0] = bounds[i, 2 if k in (1, 2) else 0]
            region[k, 1] = bounds[i, 3 if k in (2, 3) else 1]
        count = 4
        hull, beside = corners[starts[i] : starts[i + 1]], side[near[i] : near[i + 1]]
        for cut in range(MOST_CUTS + 1):
            away, ax, ay, b = _nearest_land(hull, region[: count + 1], shore, beside)
            if away == np.inf:
                sides[i] = count if count <= MOST_SIDES else 0
                break
            if cut == MOST_CUTS:
                break
            count = _clipped(region, count, ax, ay, b, spare)
            region, spare = spare, region
        for k in range(sides[i]):
            found[i, k, 0], found[i, k, 1] = region[k, 0], region[k, 1]
    return found, sides


@machine_code
def _nearest_land(
    hull: Floats, region: Floats, shore: Floats, beside: Integers
) -> tuple[float, float, float, float]:
    """The distance from a hull to the nearest shore within a convex region (a closed ring), or
    infinity, and the line a x + b y = c that separates them: (distance, a, b, c).
    """
    nearest, a, b, c = np.inf, 0.0, 0.0, 0.0
    for k in beside:
        (px, py), (qx, qy) = shore[k]
        enter, leave = crossing(px, py, qx, qy, region, 0, len(region) - 1, BESIDE_M)
        if enter >= leave:
            continue
        dx, dy = qx - px, qy - py
        px, py, qx, qy = px + enter * dx, py + enter * dy, px + leave * dx, py + leave * dy
        away, x, y, gap_x, gap_y = _gap(hull, px, py, qx, qy)
        if away >= nearest:
            continue
        nearest = away
        if away > TOUCHING_M:
            a, b = gap_x / away, gap_y / away
            c = a * x + b * y
        else:
            a, b, c = _own_side(hull, px, py, qx, qy)
    return nearest, a, b, c


@machine_code
def _gap(
    hull: Floats, px: float, py: float, qx: float, qy: float
) -> tuple[float, float, float, float, float]:
    """The distance from a hull to the segment from p to q outside it, the nearest point of the
    segment, and the vector to it: (distance, x, y, way x, way y).
    """
    nearest, x, y, vector_x, vector_y = np.inf, px, py, 0.0, 0.0
    for k in range(len(hull) - 1):
        (ax, ay), (bx, by) = hull[k], hull[k + 1]
        for ex, ey in ((px, py), (qx, qy)):
            fx, fy = _foot(ax, ay, bx, by, ex, ey)
            if math.hypot(ex - fx, ey - fy) < nearest:
                nearest, x, y = math.hypot(ex - fx, ey - fy), ex, ey
                vector_x, vector_y = ex - fx, ey - fy
        fx, fy = _foot(px, py, qx, qy, ax, ay)
        if math.hypot(fx - ax, fy - ay) < nearest:
            nearest, x, y = math.hypot(fx - ax, fy - ay), fx, fy
            vector_x, vector_y = fx - ax, fy - ay
    return nearest, x, y, vector_x, vector_y


@machine_code
def _foot(ax: float, ay: float, bx: float, by: float, x: float, y: float) -> tuple[float, float]:
    """The point of the segment from a to b that is nearest to (x, y)."""
    dx, dy = bx - ax, by - ay
    square = dx * dx + dy * dy
    share = ((x - ax) * dx + (y - ay) * dy) / square if square > 0 else 0.0
    share = min(max(share, 0.0), 1.0)
    return ax + share * dx, ay + share * dy


@machine_code
def _own_side(
    hull: Floats, px: float, py: float, qx: float, qy: float
) -> tuple[float, float, float]:
    """The hull's own side (a, b, c) that has the segment from p to q farthest beyond it: the cut
    for land that the hull touches.
    """
    best, a, b, c = -np.inf, 0.0, 0.0, 0.0
    for k in range(len(hull) - 1):
        nx, ny = hull[k + 1, 1] - hull[k, 1], hull[k, 0] - hull[k + 1, 0]
        length = math.hypot(nx, ny)
        if length <= 0:
            continue
        nx, ny = nx / length, ny / length
        offset = nx * hull[k, 0] + ny * hull[k, 1]
        beyond = min(nx * px + ny * py, nx * qx + ny * qy) - offset
        if beyond > best:
            best, a, b, c = beyond, nx, ny, offset
    return a, b, c


@machine_code
def _clipped(region: Floats, count: int, a: float, b: float, c: float, out: Floats) -> int:
    """Write the part of a convex region where a x + b y <= c to `out` and return its number of
    corners (Sutherland and Hodgman 1974). Both rings are closed: the first corner follows the last
    once more and is not counted.
    """
    kept = 0
    for k in range(count):
        x, y = region[k]
        to_x, to_y = region[k + 1]
        here, ahead = a * x + b * y - c, a * to_x + b * to_y - c
        if here <= 0:
            out[kept, 0], out[kept, 1] = x, y
            kept += 1
        if (here < 0 < ahead) or (ahead < 0 < here):
            share = here / (here - ahead)
            out[kept, 0] = x + share * (to_x - x)
            out[kept, 1] = y + share * (to_y - y)
            kept += 1
    if kept:
        out[kept, 0], out[kept, 1] = out[0]
    return kept
