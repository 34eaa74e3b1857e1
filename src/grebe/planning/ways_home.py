"""How far it is from every cell to a harbour, along the water.

The shortest ways over linked cells are pulled straight on the way: each cell looks past the cell
before it to where that one came from, as far as the line of sight is water (Nash, Koenig and Tovey
2010, Lazy Theta*).
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np
import shapely
from scipy.sparse.csgraph import dijkstra

from grebe.planning.network import ROUNDING_M, Network

if TYPE_CHECKING:
    from numpy.typing import NDArray


@dataclass(frozen=True, kw_only=True)
class WaysHome:
    """Ways between a harbour and the cells: `ways_m` (n,) their lengths, `before` (n,) the cell
    before each on the shortest way from the harbour over links (-1: the harbour), and `bends`
    (n,) the place at which each one's way last bends, a cell, or -1 for the harbour itself.
    """

    place: tuple[float, float]
    cell: int
    ways_m: NDArray[np.float64]
    before: NDArray[np.int64]
    bends: NDArray[np.int64]


def ways_home(
    network: Network, water: shapely.Polygon, place: tuple[float, float], cell: int
) -> WaysHome:
    """Measure the ways to a place (north, east) within a cell."""
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
            # By the links: a link that is not open is longer than straight.
            ways[i] = ways[behind] + lengths[i] - lengths[behind]
    return WaysHome(place=place, cell=cell, ways_m=ways, before=before, bends=bends)


def around_the_tree(network: Network, ways: WaysHome, wanted: NDArray[np.bool_]) -> list[int]:
    """Return the wanted cells as a walk around the tree of shortest ways meets them.

    The branches at each cell follow each other clockwise, so that a stretch of the walk is a
    wedge of the water with its tip at the harbour.
    """
    branches: list[list[int]] = [[] for _ in range(len(network))]
    for i, behind in enumerate(ways.before.tolist()):
        if behind >= 0:
            branches[behind].append(i)
    found: list[int] = []
    waiting = [ways.cell]
    while waiting:
        here = waiting.pop()
        if wanted[here]:
            found.append(here)
        behind = int(ways.before[here])
        came = network.centres[here] - network.centres[behind] if behind >= 0 else np.ones(2)
        waiting += sorted(
            branches[here], key=lambda b: _bearing(network.centres[b] - network.centres[here], came)
        )
    return found


def _bearing(way: NDArray[np.float64], came: NDArray[np.float64]) -> float:
    """Angle from the direction in which one came to a way, in (-pi, pi]."""
    cross = came[0] * way[1] - came[1] * way[0]
    return float(np.arctan2(cross, came @ way))
