"""The shortest (taut) path that touches every target in turn.

A target is reached once the boat has been in it, so a boat cuts the targets' corners instead of
visiting their centres. The time of a mission is predicted from the shortest such path (a touring
polygons problem; Dror et al. 2003). This convex problem is solved by sweeps: each point moves to
where the path between its two neighbours is shortest.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from typing import TYPE_CHECKING

import numpy as np
import shapely

from grebe.core.crossing import crossing
from grebe.core.kernels import inlined_machine_code, machine_code
from grebe.core.sets import footprints_of
from grebe.core.survey import Survey

if TYPE_CHECKING:
    from numpy.typing import NDArray

# The controller enters a set by some margin, so footprints are shrunk by this share.
DRAWN_IN = 0.05
MOST_SWEEPS = 200
# Sweeps end when one moves no point by more than this share of the mean leg. A rough path is up to
# 5 in 100,000 longer.
STEADY, ROUGHLY = 1e-3, 1e-2


def path_through(survey: Survey) -> NDArray[np.float64]:
    """Return the taut path (n + 1, 2) [m] of a planned survey, from its start on."""
    assert survey.start is not None
    return taut_path((survey.start.north_m, survey.start.east_m), footprints_of(survey.sets))


def taut_path(
    start: tuple[float, float],
    footprints: Sequence[shapely.Polygon] | NDArray[np.object_],
    centred: Sequence[bool] | None = None,
) -> NDArray[np.float64]:
    """Return the shortest path (n + 1, 2) [m] from `start` that touches convex footprints in turn.

    It leads through the centroids of the footprints that are `centred`.
    """
    held = np.zeros(len(footprints), dtype=bool) if centred is None else np.array(centred)
    return TautPaths(footprints).through(start, np.arange(len(footprints)), held)


class TautPaths:
    """Taut paths through the same convex footprints in different orders."""

    def __init__(self, footprints: Sequence[shapely.Polygon] | NDArray[np.object_]) -> None:
        shapes = np.array(footprints, dtype=object)
        rings = shapely.get_exterior_ring(shapely.orient_polygons(shapes))
        corners, ring = shapely.get_coordinates(rings, return_index=True)
        self._starts = np.searchsorted(ring, np.arange(len(shapes) + 1))
        self._centroids = shapely.get_coordinates(shapely.centroid(shapes))
        self._corners = corners + DRAWN_IN * (self._centroids[ring] - corners)

    def through(
        self,
        start: tuple[float, float],
        order: NDArray[np.int64],
        held: NDArray[np.bool_] | None = None,
        *,
        steady: float = STEADY,
    ) -> NDArray[np.float64]:
        """Return the shortest path (n + 1, 2) [m] from `start` through the footprints in an order.

        `order` (n,) gives their indices. The path touches each, and leads through the centroids of
        those that are `held`.
        """
        held = np.zeros(len(order), dtype=bool) if held is None else held
        path = np.vstack([start, self._centroids[order]])
        moved = steady * float(np.mean(np.hypot(*np.diff(path, axis=0).T)))
        firsts, lasts = self._starts[order], self._starts[order + 1]
        _tighten(path, firsts, lasts, self._corners, held, moved)
        return path


@machine_code
def _tighten(
    path: NDArray[np.float64],
    firsts: NDArray[np.integer],
    lasts: NDArray[np.integer],
    corners: NDArray[np.float64],
    held: NDArray[np.bool_],
    steady: float,
) -> None:
    """Move each point that is not held to where the path is shortest, until nothing moves.

    Sweeps alternate in direction. The ring of point i + 1 is corners[firsts[i]:lasts[i]], closed
    and anticlockwise.
    """
    n = path.shape[0]
    for sweep in range(MOST_SWEEPS):
        farthest = 0.0
        for s in range(1, n):
            i = s if sweep % 2 == 0 else n - s
            if held[i - 1]:
                continue
            x, y = path[i, 0], path[i, 1]
            _move_point(path, i, corners, firsts[i - 1], lasts[i - 1] - 1)
            farthest = max(farthest, (path[i, 0] - x) ** 2 + (path[i, 1] - y) ** 2)
        if farthest < steady**2:
            break


@inlined_machine_code
def _move_point(
    path: NDArray[np.float64], i: int, ring: NDArray[np.float64], first: int, last: int
) -> None:
    """Put point i where the path is shortest, inside ring[first : last + 1] or on its edge."""
    ax, ay = path[i - 1, 0], path[i - 1, 1]
    # The last point has no successor: it moves as near to its predecessor as it may.
    behind = i + 1 if i + 1 < path.shape[0] else i - 1
    bx, by = path[behind, 0], path[behind, 1]
    enter, leave = crossing(ax, ay, bx, by, ring, first, last, 0.0)
    if enter <= leave:
        # Any point between is as good; take the one half-way from the present one to the middle.
        dx, dy = bx - ax, by - ay
        square = dx * dx + dy * dy
        along = ((path[i, 0] - ax) * dx + (path[i, 1] - ay) * dy) / square if square > 0 else 0.0
        along = min(max(0.5 * along + 0.25, enter), leave)
        path[i, 0], path[i, 1] = ax + along * dx, ay + along * dy
        return
    shortest = np.inf
    for k in range(first, last):
        x, y = _beside(ax, ay, bx, by, ring, k)
        by_it = _length(x - ax, y - ay) + _length(x - bx, y - by)
        if by_it < shortest:
            shortest = by_it
            path[i, 0], path[i, 1] = x, y


@inlined_machine_code
def _length(x: float, y: float) -> float:
    """Length of a leg. `math.hypot` also guards against overflow, at several times the cost."""
    return math.sqrt(x * x + y * y)


@inlined_machine_code
def _beside(
    ax: float, ay: float, bx: float, by: float, ring: NDArray[np.float64], k: int
) -> tuple[float, float]:
    """Point on the edge after corner k of a ring with the least sum of distances to a and b.

    The straight line from a to b's mirror image crosses the edge there.
    """
    px, py = ring[k, 0], ring[k, 1]
    ex, ey = ring[k + 1, 0] - px, ring[k + 1, 1] - py
    square = ex * ex + ey * ey
    if square <= 0.0:
        return px, py
    along_a = ((ax - px) * ex + (ay - py) * ey) / square
    along_b = ((bx - px) * ex + (by - py) * ey) / square
    off_a = abs((ax - px) * ey - (ay - py) * ex)
    off_b = abs((bx - px) * ey - (by - py) * ex)
    share = off_a / (off_a + off_b) if off_a + off_b > 0 else 0.5
    along = min(max(along_a + (along_b - along_a) * share, 0.0), 1.0)
    return px + along * ex, py + along * ey
