"""The length of the shortest path through the water from every cell to a harbour.

The shortest paths over linked cells are straightened as they are built: a cell skips its
predecessor, and comes directly from that one's last bend, if the line of sight to it is water
(Nash, Koenig and Tovey 2010, Lazy Theta*).
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np
import shapely
from scipy.sparse.csgraph import dijkstra

from grebe.planning.ways.network import ROUNDING_M, Network

if TYPE_CHECKING:
    from numpy.typing import NDArray


@dataclass(frozen=True, kw_only=True)
class WaysHome:
    """Paths between a harbour and the cells.

    `ways_m` (n,): their lengths; `before` (n,): the cell before each on the shortest path from the
    harbour over links (-1: the harbour); `bends` (n,): the cell at which each path from the harbour
    last bends (-1: the harbour itself).
    """

    place: tuple[float, float]
    cell: int
    ways_m: NDArray[np.float64]
    before: NDArray[np.int64]
    bends: NDArray[np.int64]


def ways_home(
    network: Network, water: shapely.Polygon, place: tuple[float, float], cell: int
) -> WaysHome:
    """Measure the paths to a place (north, east) within a cell."""
    lengths, before = dijkstra(network.matrix(), indices=cell, return_predecessors=True)
    before = before.astype(np.int64)
    allowed = water.buffer(ROUNDING_M, join_style="mitre")
    shapely.prepare(allowed)
    n = len(network)
    places = np.vstack([network.centres, place])
    ways, bends = np.full(n, np.inf), np.full(n, -1)
    ways[cell] = float(np.hypot(*(network.centres[cell] - place)))
    for i in np.argsort(lengths, kind="stable").tolist():
        if i == cell or not np.isfinite(lengths[i]):
            continue
        behind = int(before[i])
        bend = int(bends[behind])
        if allowed.covers(shapely.LineString([places[bend], places[i]])):
            so_far = 0.0 if bend < 0 else ways[bend]
            bends[i] = bend
            ways[i] = so_far + float(np.hypot(*(places[i] - places[bend])))
        else:
            bends[i] = behind
            # The length over the link, since a link that is not open is longer than straight.
            ways[i] = ways[behind] + lengths[i] - lengths[behind]
    return WaysHome(place=place, cell=cell, ways_m=ways, before=before, bends=bends)


def around_the_harbour(
    network: Network, ways: WaysHome, wanted: NDArray[np.bool_]
) -> NDArray[np.int64]:
    """Return the wanted cells in the order in which a ray that turns around the harbour meets them.

    Where paths bend around land, the ray turns around each bend in the same manner. A stretch of
    this order is then a wedge of the water with its tip at the harbour (the sweep of Gillett and
    Miller 1974, around land).
    """
    bearings: dict[int, tuple[float, ...]] = {-1: ()}
    first = _first_bearing(network, ways, wanted)

    def of(cell: int) -> tuple[float, ...]:
        """Bearings of the bends on the path to a cell, and of the cell from the last of them."""
        chain = [cell]
        while chain[-1] not in bearings:
            chain.append(int(ways.bends[chain[-1]]))
        for one in reversed(chain[:-1]):
            bend = int(ways.bends[one])
            bearings[one] = (*bearings[bend], _bearing(network, ways, bend, one, first))
        return bearings[cell]

    members = np.flatnonzero(wanted & np.isfinite(ways.ways_m)).tolist()
    return np.array(
        sorted(members, key=lambda cell: (of(cell), float(ways.ways_m[cell]))), dtype=np.int64
    )


def _first_bearing(network: Network, ways: WaysHome, wanted: NDArray[np.bool_]) -> float:
    """The bearing of the middle of the widest gap between the cells in sight of the harbour, which
    is mostly land.
    """
    way = (network.centres - np.array(ways.place))[wanted & (ways.bends < 0)]
    if len(way) < 2:
        return 0.0
    bearings = np.sort(np.arctan2(way[:, 1], way[:, 0]))
    gaps = np.diff(bearings, append=bearings[0] + 2 * np.pi)
    widest = int(np.argmax(gaps))
    return float(bearings[widest] + 0.5 * gaps[widest])


def _bearing(network: Network, ways: WaysHome, bend: int, cell: int, first: float) -> float:
    """Bearing [rad] of a cell from the last bend before it: at the harbour clockwise from `first`,
    at a bend relative to the leg that leads there.
    """
    if bend < 0:
        way = network.centres[cell] - np.array(ways.place)
        return float((np.arctan2(way[1], way[0]) - first) % (2 * np.pi))
    way = network.centres[cell] - network.centres[bend]
    behind = int(ways.bends[bend])
    before = network.centres[behind] if behind >= 0 else np.array(ways.place)
    came = network.centres[bend] - before
    return float(np.arctan2(came[0] * way[1] - came[1] * way[0], came @ way))
