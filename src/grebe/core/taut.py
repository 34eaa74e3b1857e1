"""The taut way: the shortest path that touches every target in turn.

A target is reached when the boat has been in it, so a flown way leads through the targets' corners
rather than their centres. How long it takes is predicted from the shortest such way (a touring
polygons problem; Dror et al. 2003), which is a convex problem solved by sweeps: each place moves
to where the way between its two neighbours is shortest.
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

# The controller enters a set by more than a hair: sets are drawn this much towards their centres.
DRAWN_IN = 0.05
MOST_SWEEPS = 200
# Sweeps end when none of them moves a place by more than this share of the mean leg. A rough way is
# longer by up to 5 in 100,000.
STEADY, ROUGHLY = 1e-3, 1e-2


def way_through(survey: Survey) -> NDArray[np.float64]:
    """Return the taut way (n + 1, 2) [m] of a planned survey, from its start on."""
    assert survey.start is not None
    return taut_way((survey.start.north_m, survey.start.east_m), footprints_of(survey.sets))


def taut_way(
    start: tuple[float, float],
    footprints: Sequence[shapely.Polygon] | NDArray[np.object_],
    centred: Sequence[bool] | None = None,
) -> NDArray[np.float64]:
    """Return the shortest way from `start` that touches convex footprints in turn, (n + 1, 2) [m].

    Where `centred` says so it leads through the footprint's centroid instead.
    """
    held = np.zeros(len(footprints), dtype=bool) if centred is None else np.array(centred)
    return TautWays(footprints).through(start, np.arange(len(footprints)), held)


class TautWays:
    """Taut ways through the same convex footprints in one order and another."""

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
        """Return the shortest way from `start` that touches the footprints in an order (n,), or
        leads through the centroids of those that are `held`, (n + 1, 2) [m].
        """
        held = np.zeros(len(order), dtype=bool) if held is None else held
        way = np.vstack([start, self._centroids[order]])
        moved = steady * float(np.mean(np.hypot(*np.diff(way, axis=0).T)))
        firsts, lasts = self._starts[order], self._starts[order + 1]
        _tighten(way, firsts, lasts, self._corners, held, moved)
        return way


@machine_code
def _tighten(
    way: NDArray[np.float64],
    firsts: NDArray[np.integer],
    lasts: NDArray[np.integer],
    corners: NDArray[np.float64],
    held: NDArray[np.bool_],
    steady: float,
) -> None:
    """Move each place that is not held to where it lengthens the way least, there and back,
    until nothing moves; the ring of place i + 1 is corners[firsts[i]:lasts[i]], closed and
    anticlockwise.
    """
    n = way.shape[0]
    for sweep in range(MOST_SWEEPS):
        farthest = 0.0
        for s in range(1, n):
            i = s if sweep % 2 == 0 else n - s
            if held[i - 1]:
                continue
            x, y = way[i, 0], way[i, 1]
            _settle(way, i, corners, firsts[i - 1], lasts[i - 1] - 1)
            farthest = max(farthest, (way[i, 0] - x) ** 2 + (way[i, 1] - y) ** 2)
        if farthest < steady**2:
            break


@inlined_machine_code
def _settle(
    way: NDArray[np.float64], i: int, ring: NDArray[np.float64], first: int, last: int
) -> None:
    """Put place i on the inside of its ring[first : last + 1], or its edge, where the way by it is
    shortest.
    """
    ax, ay = way[i - 1, 0], way[i - 1, 1]
    # The last place has nobody behind it: it comes as near to the one before as it may.
    behind = i + 1 if i + 1 < way.shape[0] else i - 1
    bx, by = way[behind, 0], way[behind, 1]
    enter, leave = crossing(ax, ay, bx, by, ring, first, last, 0.0)
    if enter <= leave:
        # Anywhere between is as good: half-way between where it stands and the middle.
        dx, dy = bx - ax, by - ay
        square = dx * dx + dy * dy
        along = ((way[i, 0] - ax) * dx + (way[i, 1] - ay) * dy) / square if square > 0 else 0.0
        along = min(max(0.5 * along + 0.25, enter), leave)
        way[i, 0], way[i, 1] = ax + along * dx, ay + along * dy
        return
    shortest = np.inf
    for k in range(first, last):
        x, y = _beside(ax, ay, bx, by, ring, k)
        by_it = _length(x - ax, y - ay) + _length(x - bx, y - by)
        if by_it < shortest:
            shortest = by_it
            way[i, 0], way[i, 1] = x, y


@inlined_machine_code
def _length(x: float, y: float) -> float:
    """Of a leg. The library's own minds overflow, which no lake is near, at several times the
    price.
    """
    return math.sqrt(x * x + y * y)


@inlined_machine_code
def _beside(
    ax: float, ay: float, bx: float, by: float, ring: NDArray[np.float64], k: int
) -> tuple[float, float]:
    """The place on the edge behind a ring's corner k from which the ways to a and to b are shortest
    together: where the way from a to b's mirror image crosses it.
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
