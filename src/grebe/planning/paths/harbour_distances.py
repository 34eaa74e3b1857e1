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

from grebe.planning.paths.network import ROUNDING_M, Network

if TYPE_CHECKING:
    from numpy.typing import NDArray


@dataclass(frozen=True, kw_only=True)
class HarbourDistances:
    """Paths between a harbour and the cells.

    `distances_m` (n,): their lengths; `before` (n,): the cell before each on the shortest path from
    the harbour over links (-1: the harbour); `bends` (n,): the cell at which each path from the
    harbour last bends (-1: the harbour itself).
    """

    place: tuple[float, float]
    cell: int
    distances_m: NDArray[np.float64]
    before: NDArray[np.int64]
    bends: NDArray[np.int64]


def harbour_distances(
    network: Network, water: shapely.Polygon, place: tuple[float, float], cell: int
) -> HarbourDistances:
    """Measure the paths to a place (north, east) within a cell."""
    lengths, before = dijkstra(network.matrix(), indices=cell, return_predecessors=True)
    before = before.astype(np.int64)
    allowed = water.buffer(ROUNDING_M, join_style="mitre")
    shapely.prepare(allowed)
    n = len(network)
    places = np.vstack([network.centres, place])
    distances_m, bends = np.full(n, np.inf), np.full(n, -1)
    distances_m[cell] = float(np.hypot(*(network.centres[cell] - place)))
    for i in np.argsort(lengths, kind="stable").tolist():
        if i == cell or not np.isfinite(lengths[i]):
            continue
        behind = int(before[i])
        bend = int(bends[behind])
        if allowed.covers(shapely.LineString([places[bend], places[i]])):
            so_far = 0.0 if bend < 0 else distances_m[bend]
            bends[i] = bend
            distances_m[i] = so_far + float(np.hypot(*(places[i] - places[bend])))
        else:
            bends[i] = behind
            # The length over the link, since a link that is not open is longer than straight.
            distances_m[i] = distances_m[behind] + lengths[i] - lengths[behind]
    return HarbourDistances(
        place=place, cell=cell, distances_m=distances_m, before=before, bends=bends
    )


def around_the_harbour(
    network: Network, distances: HarbourDistances, wanted: NDArray[np.bool_]
) -> NDArray[np.int64]:
    """Return the wanted cells in the order in which a ray that turns around the harbour meets them.

    Where paths bend around land, the ray turns around each bend in the same manner. A stretch of
    this order is then a wedge of the water with its tip at the harbour (the sweep of Gillett and
    Miller 1974, around land).
    """
    bearings: dict[int, tuple[float, ...]] = {-1: ()}
    first = _first_bearing(network, distances, wanted)

    def of(cell: int) -> tuple[float, ...]:
        """Bearings of the bends on the path to a cell, and of the cell from the last of them."""
        chain = [cell]
        while chain[-1] not in bearings:
            chain.append(int(distances.bends[chain[-1]]))
        for one in reversed(chain[:-1]):
            bend = int(distances.bends[one])
            bearings[one] = (*bearings[bend], _bearing(network, distances, bend, one, first))
        return bearings[cell]

    members = np.flatnonzero(wanted & np.isfinite(distances.distances_m)).tolist()
    return np.array(
        sorted(members, key=lambda cell: (of(cell), float(distances.distances_m[cell]))),
        dtype=np.int64,
    )


def _first_bearing(
    network: Network, distances: HarbourDistances, wanted: NDArray[np.bool_]
) -> float:
    """The bearing of the middle of the widest gap between the cells in sight of the harbour, which
    is mostly land.
    """
    offset = (network.centres - np.array(distances.place))[wanted & (distances.bends < 0)]
    if len(offset) < 2:
        return 0.0
    bearings = np.sort(np.arctan2(offset[:, 1], offset[:, 0]))
    gaps = np.diff(bearings, append=bearings[0] + 2 * np.pi)
    widest = int(np.argmax(gaps))
    return float(bearings[widest] + 0.5 * gaps[widest])


def _bearing(
    network: Network, distances: HarbourDistances, bend: int, cell: int, first: float
) -> float:
    """Bearing [rad] of a cell from the last bend before it: at the harbour clockwise from `first`,
    at a bend relative to the leg that leads there.
    """
    if bend < 0:
        offset = network.centres[cell] - np.array(distances.place)
        return float((np.arctan2(offset[1], offset[0]) - first) % (2 * np.pi))
    offset = network.centres[cell] - network.centres[bend]
    behind = int(distances.bends[bend])
    before = network.centres[behind] if behind >= 0 else np.array(distances.place)
    came = network.centres[bend] - before
    return float(np.arctan2(came[0] * offset[1] - came[1] * offset[0], came @ offset))
