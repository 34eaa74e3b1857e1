"""What an order of the cells costs: the time of its legs.

Legs lead through the cells' centres, at the ground speed that current and wind leave, and around
land by the shortest way. Turns are free: a boat that need only have been in each cell cuts its
corners, and gains more by them than it loses (docs/theory.md). `grebe.planning.route.polish` makes
the sum smaller.
"""

# Kernels do not annotate their parameters: numba infers the types when it compiles them.
# pyright: reportMissingParameterType=false

from __future__ import annotations

import math
from typing import TYPE_CHECKING, NamedTuple

import numpy as np

from grebe.core.kernels import inlined_machine_code, machine_code
from grebe.planning.ways.graph import Links
from grebe.planning.ways.network import Network
from grebe.planning.ways.travel import BEARINGS, Travel

if TYPE_CHECKING:
    from numpy.typing import NDArray

# A way between cells that are not linked is led around: longer than straight, with transits.
DETOUR, DETOUR_PITCHES = 1.5, 1.5
# What a gate costs besides its way: it must be hit.
GATE_PITCHES = 0.1
# Moves are tried towards so many neighbours of a cell.
MOST_NEAREST = 10


class Costs(NamedTuple):
    """What the kernels read: places (n + 1, 2) with the start as the last, the links with each
    one's seconds, the `MOST_NEAREST` nearest neighbours of each cell (n, m) with theirs, infinite
    where there are fewer, slowness by bearing, the detour's seconds, whether
    there and back take different times, whether the path ends where it started, and whether it
    may start anywhere.
    """

    places: NDArray[np.float64]
    starts: NDArray[np.int64]
    neighbours: NDArray[np.int64]
    link_s: NDArray[np.float64]
    nearest: NDArray[np.int64]
    nearest_s: NDArray[np.float64]
    slowness: NDArray[np.float64]
    detour_s: float
    windy: bool
    returns: bool
    anywhere: bool


def costs_of(
    network: Network,
    travel: Travel,
    start: tuple[float, float],
    *,
    returns: bool,
    anywhere: bool = False,
) -> Costs:
    """Gather what the kernels read."""
    slowness = travel.slowness
    opposite = np.roll(slowness, BEARINGS // 2)
    pitch_s = network.pitch_m * float(slowness.mean())
    links, is_open = _links(network)
    first = links.first
    way = network.centres[links.neighbours] - network.centres[first]
    winding = links.values / np.maximum(np.hypot(*way.T), 1e-9)
    gate_s = np.where(is_open, 0.0, GATE_PITCHES * pitch_s)
    link_s = winding * travel.leg_s(way) + gate_s
    nearest, nearest_s = _nearest(links, first, link_s)
    return Costs(
        places=np.vstack([network.centres, start]),
        starts=links.starts.astype(np.int64),
        neighbours=links.neighbours.astype(np.int64),
        link_s=link_s,
        nearest=nearest,
        nearest_s=nearest_s,
        slowness=slowness,
        detour_s=DETOUR_PITCHES * pitch_s,
        windy=bool(np.abs(slowness - opposite).max() > 1e-9),
        returns=returns,
        anywhere=anywhere and not returns,
    )


def _links(network: Network) -> tuple[Links, NDArray[np.bool_]]:
    """Lengths of the network's links and of the ways around land beside them, and which of them
    are open.
    """
    around, links = network.around, network.links(network.ways_m)
    row = np.append(links.first, around.first)
    column = np.append(links.neighbours, around.neighbours)
    length = np.append(links.values, around.values)
    is_open = np.append(network.is_open, np.zeros(len(around.values), dtype=bool))
    # Of two ways between the same cells the link counts, which comes first.
    _, place = np.unique(row.astype(np.int64) * len(network) + column, return_index=True)
    starts = np.searchsorted(row[place], np.arange(len(network) + 1))
    both = Links(starts=starts, neighbours=column[place], values=length[place])
    return both, is_open[place]


def _nearest(
    links: Links, first: NDArray[np.int64], link_s: NDArray[np.float64]
) -> tuple[NDArray[np.int64], NDArray[np.float64]]:
    """Each cell's nearest neighbours, nearest first, and their seconds."""
    by_time = np.lexsort([link_s, first])
    rank = np.arange(len(first)) - links.starts[first]
    kept, rank = by_time[rank < MOST_NEAREST], rank[rank < MOST_NEAREST]
    shape = (len(links), MOST_NEAREST)
    nearest, nearest_s = np.zeros(shape, dtype=np.int64), np.full(shape, np.inf)
    nearest[first[kept], rank] = links.neighbours[kept]
    nearest_s[first[kept], rank] = link_s[kept]
    return nearest, nearest_s


@machine_code
def order_cost(costs, path):
    """Cost [s] of a path that begins at the start (index n)."""
    return window_cost(costs, path, 0, path.shape[0])


@machine_code
def window_cost(costs, path, low, high):
    """Cost of the legs between two places, with the way home beyond the last."""
    low, last = max(low, 0), path.shape[0] - 1
    total = 0.0
    for k in range(low, min(high, last)):
        total += leg(costs, path[k], path[k + 1])
    if high > last and costs.returns:
        total += leg(costs, path[last], path[0])
    return total


@inlined_machine_code
def leg(costs, a, b):
    """Seconds from place a to place b; a cell's neighbours stand in order."""
    n = costs.places.shape[0] - 1
    if costs.anywhere and n in (a, b):
        return 0.0
    if a != n:
        low, high = costs.starts[a], costs.starts[a + 1]
        while low < high:
            middle = (low + high) // 2
            if costs.neighbours[middle] < b:
                low = middle + 1
            else:
                high = middle
        if low < costs.starts[a + 1] and costs.neighbours[low] == b:
            return costs.link_s[low]
    dx = costs.places[b, 0] - costs.places[a, 0]
    dy = costs.places[b, 1] - costs.places[a, 1]
    seconds = math.sqrt(dx * dx + dy * dy) * _slow(costs, dx, dy)
    return seconds if n in (a, b) else DETOUR * seconds + costs.detour_s


@inlined_machine_code
def _slow(costs, dx, dy):
    if not costs.windy:
        return costs.slowness[0]
    place = math.atan2(dy, dx) * (BEARINGS / (2 * math.pi))
    if place < 0:
        place += BEARINGS
    whole = int(place)
    share = place - whole
    low = costs.slowness[whole % BEARINGS]
    return low + share * (costs.slowness[(whole + 1) % BEARINGS] - low)


@inlined_machine_code
def at(path, k):
    """The cell at a place of the path, or -1 beyond its end."""
    return path[k] if 0 <= k < path.shape[0] else -1


@inlined_machine_code
def join(costs, a, b):
    """Leg between two cells; the way home where the second lies beyond the path's end."""
    if a < 0:
        return 0.0
    if b < 0:
        return leg(costs, a, costs.places.shape[0] - 1) if costs.returns else 0.0
    return leg(costs, a, b)
