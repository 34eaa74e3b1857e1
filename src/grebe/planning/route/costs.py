"""The cost of an order of the cells: the time of its legs.

Legs lead through the cells' centres, at the ground speed that current and wind allow, and around
land by the shortest path. Turns are free: a boat that only has to enter each cell cuts corners,
and gains more by that than its turns cost (docs/theory.md). `grebe.planning.route.polish` reduces
the sum.
"""

# Kernels do not annotate their parameters: numba infers the types when it compiles them.
# pyright: reportMissingParameterType=false

from __future__ import annotations

import math
from typing import TYPE_CHECKING, NamedTuple

import numpy as np

from grebe.core.kernels import inlined_machine_code, machine_code
from grebe.planning.paths.graph import Links
from grebe.planning.paths.network import Network
from grebe.planning.paths.travel import BEARINGS, Travel

if TYPE_CHECKING:
    from numpy.typing import NDArray

# A path between cells that are not linked leads around something. Its cost is the straight line's,
# times a factor, plus some pitches for its transits.
DETOUR, DETOUR_PITCHES = 1.5, 1.5
# The cost of a gate besides its path, in pitches: it must be hit.
GATE_PITCHES = 0.1
# Moves are tried towards this many neighbours of a cell.
MOST_NEAREST = 10


class Costs(NamedTuple):
    """The input of the kernels.

    `places` (n + 1, 2): the cells' centres, and the start as the last; `starts`, `neighbours` and
    `link_s`: the links, with their seconds; `nearest` and `nearest_s` (n, m): the `MOST_NEAREST`
    nearest neighbours of each cell, and their seconds, infinite if there are fewer; `slowness` by
    bearing; `detour_s`: the fixed cost of a detour; `windy`: there and back take different times;
    `returns`: the path ends where it started; `anywhere`: it may start anywhere.
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
    """Collect the input of the kernels."""
    slowness = travel.slowness
    opposite = np.roll(slowness, BEARINGS // 2)
    pitch_s = network.pitch_m * float(slowness.mean())
    links, is_open = _links(network)
    first = links.first
    offsets = network.centres[links.neighbours] - network.centres[first]
    winding = links.values / np.maximum(np.hypot(*offsets.T), 1e-9)
    gate_s = np.where(is_open, 0.0, GATE_PITCHES * pitch_s)
    link_s = winding * travel.leg_s(offsets) + gate_s
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
    """Lengths of the network's links and of the paths around land, and which of them are open."""
    around, links = network.around, network.links(network.lengths_m)
    row = np.append(links.first, around.first)
    column = np.append(links.neighbours, around.neighbours)
    length = np.append(links.values, around.values)
    is_open = np.append(network.is_open, np.zeros(len(around.values), dtype=bool))
    # Of two paths between the same cells the first counts, which is the link.
    _, place = np.unique(row.astype(np.int64) * len(network) + column, return_index=True)
    starts = np.searchsorted(row[place], np.arange(len(network) + 1))
    both = Links(starts=starts, neighbours=column[place], values=length[place])
    return both, is_open[place]


def _nearest(
    links: Links, first: NDArray[np.int64], link_s: NDArray[np.float64]
) -> tuple[NDArray[np.int64], NDArray[np.float64]]:
    """The nearest neighbours of each cell, nearest first, and their seconds."""
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
    """Cost [s] of the legs between two places of a path, with the leg home beyond the last."""
    low, last = max(low, 0), path.shape[0] - 1
    total = 0.0
    for k in range(low, min(high, last)):
        total += leg(costs, path[k], path[k + 1])
    if high > last and costs.returns:
        total += leg(costs, path[last], path[0])
    return total


@inlined_machine_code
def leg(costs, a, b):
    """Seconds from place a to place b; the neighbours of a cell are sorted."""
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
    """The cell at place k of the path, or -1 beyond its ends."""
    return path[k] if 0 <= k < path.shape[0] else -1


@inlined_machine_code
def join(costs, a, b):
    """Seconds of the leg between two cells, or of the leg home if the second is beyond the end."""
    if a < 0:
        return 0.0
    if b < 0:
        return leg(costs, a, costs.places.shape[0] - 1) if costs.returns else 0.0
    return leg(costs, a, b)
