"""The state of trips from harbours: when each cell is reached, and whether the boat gets home.

A trip may not exceed its limit, and at each of its cells the path home must fit into the time that
is left. Cells are inserted and removed without computing a whole trip again.
"""

# Kernels do not annotate their parameters: numba infers the types when it compiles them.
# pyright: reportMissingParameterType=false

from __future__ import annotations

from typing import TYPE_CHECKING, NamedTuple

import numpy as np

from grebe.core.kernels import machine_code
from grebe.planning.route.costs import leg

if TYPE_CHECKING:
    from numpy.typing import NDArray


class Ports(NamedTuple):
    """The harbours as the exchange between trips sees them.

    `out` (h, n) and `back` (h, n): seconds from each harbour to each cell, and back; `home` (h, n):
    seconds that must be left at a cell for the path home in the worst weather; `beside` (n, m): the
    cells nearest to each; `limit_s`: the limit of a trip; `pitch_s`: seconds from a cell to the
    next, approximately.
    """

    out: NDArray[np.float64]
    back: NDArray[np.float64]
    home: NDArray[np.float64]
    beside: NDArray[np.int64]
    limit_s: float
    pitch_s: float


class Fleet(NamedTuple):
    """The state of all trips.

    `routes` (trips, n): cells in order; `sizes` (trips,): how many; `spent` (trips, n): seconds at
    which each cell is reached; `takes` (trips,): seconds of each trip; `over` (trips, n + 1): how
    much longer than `takes` the trip would last if it turned for home, in the worst weather, at
    the worst of the cells from there on, and 0 if no longer.
    """

    routes: NDArray[np.int64]
    sizes: NDArray[np.int64]
    spent: NDArray[np.float64]
    takes: NDArray[np.float64]
    over: NDArray[np.float64]


def empty_fleet(trips: int, cells: int) -> Fleet:
    """Return empty trips, with room for `cells` each."""
    return Fleet(
        routes=np.full((trips, cells), -1),
        sizes=np.zeros(trips, dtype=np.int64),
        spent=np.zeros((trips, cells)),
        takes=np.zeros(trips),
        over=np.zeros((trips, cells + 1)),
    )


@machine_code
def trip_s(costs, ports, harbour, route, size):
    """Seconds of a trip from its harbour through its cells and back to it."""
    if size == 0:
        return 0.0
    total = ports.out[harbour, route[0]] + ports.back[harbour, route[size - 1]]
    for k in range(size - 1):
        total += leg(costs, route[k], route[k + 1])
    return total


@machine_code
def shortest_stretch(costs, ports, harbour, route):
    """The shortest stretch [first, last) without which a trip keeps its limit, also with the path
    home from each of its cells; (0, 0) if the complete trip does.
    """
    size = route.shape[0]
    fleet = _fleet_of(costs, ports, harbour, route)
    spent, takes, over = fleet.spent[0], fleet.takes[0], fleet.over[0]
    if takes + over[0] <= ports.limit_s:
        return 0, 0
    best, first = size, 0
    before = -np.inf
    for i in range(size):
        for j in range(i + 1, min(size, i + best - 1) + 1):
            if j < size:
                saved = spent[j] - reached_s(costs, ports, fleet, harbour, 0, i, route[j])
            elif i > 0:
                saved = takes - spent[i - 1] - ports.back[harbour, route[i - 1]]
            else:
                saved = takes
            if takes + over[j] - saved <= ports.limit_s:
                best, first = j - i, i
                break
        before = max(before, spent[i] + ports.home[harbour, route[i]])
        if before > ports.limit_s:
            break
    return first, first + best


@machine_code
def _fleet_of(costs, ports, harbour, route):
    """One trip as a fleet."""
    size = route.shape[0]
    fleet = Fleet(
        np.zeros((1, size), dtype=np.int64),
        np.zeros(1, dtype=np.int64),
        np.zeros((1, size)),
        np.zeros(1),
        np.zeros((1, size + 1)),
    )
    fleet.routes[0] = route
    fleet.sizes[0] = size
    clock(costs, ports, fleet, harbour, 0)
    return fleet


@machine_code
def clock(costs, ports, fleet, harbour, t):
    """Compute when a trip reaches each cell, and how much longer the paths home take."""
    size = fleet.sizes[t]
    if size == 0:
        fleet.takes[t] = fleet.over[t, 0] = 0.0
        return
    spent = ports.out[harbour, fleet.routes[t, 0]]
    for k in range(size):
        if k > 0:
            spent += leg(costs, fleet.routes[t, k - 1], fleet.routes[t, k])
        fleet.spent[t, k] = spent
    fleet.takes[t] = spent + ports.back[harbour, fleet.routes[t, size - 1]]
    fleet.over[t, size] = 0.0
    _look_home(ports, fleet, harbour, t, size - 1)


@machine_code
def copy_trip(source, target, t):
    """Copy a trip from one fleet to another."""
    size = source.sizes[t]
    target.sizes[t] = size
    for k in range(size):
        target.routes[t, k] = source.routes[t, k]
        target.spent[t, k] = source.spent[t, k]
        target.over[t, k] = source.over[t, k]
    target.over[t, size] = 0.0
    target.takes[t] = source.takes[t]


@machine_code
def take_out(costs, ports, fleet, trip_of, place_of, harbour, t, first, length, waiting, count):
    """Take a string of cells out of a trip and add it to those that wait; returns their number."""
    size, behind = fleet.sizes[t], first + length
    for k in range(first, behind):
        waiting[count] = fleet.routes[t, k]
        trip_of[fleet.routes[t, k]] = -1
        count += 1
    saved = 0.0
    if behind < size:
        saved = fleet.spent[t, behind] - reached_s(
            costs, ports, fleet, harbour, t, first, fleet.routes[t, behind]
        )
    for k in range(behind, size):
        cell = fleet.routes[t, k]
        fleet.routes[t, k - length] = cell
        fleet.spent[t, k - length] = fleet.spent[t, k] - saved
        fleet.over[t, k - length] = fleet.over[t, k]
        place_of[cell] = k - length
    left = size - length
    fleet.sizes[t] = left
    fleet.over[t, left] = 0.0
    if behind < size:
        fleet.takes[t] -= saved
    elif left > 0:
        last = fleet.routes[t, left - 1]
        fleet.takes[t] = fleet.spent[t, left - 1] + ports.back[harbour, last]
    else:
        fleet.takes[t] = 0.0
    _look_home(ports, fleet, harbour, t, first - 1)
    return count


@machine_code
def reached_s(costs, ports, fleet, harbour, t, k, cell):
    """Seconds at which a cell is reached if it is at place k of a trip."""
    if k == 0:
        return ports.out[harbour, cell]
    return fleet.spent[t, k - 1] + leg(costs, fleet.routes[t, k - 1], cell)


@machine_code
def _look_home(ports, fleet, harbour, t, last):
    """Compute how much longer the paths home take from a trip's cells up to place `last`."""
    for k in range(last, -1, -1):
        home = fleet.spent[t, k] + ports.home[harbour, fleet.routes[t, k]] - fleet.takes[t]
        fleet.over[t, k] = max(home, fleet.over[t, k + 1])


@machine_code
def put_in(ports, fleet, trip_of, place_of, harbour, t, k, cell, adds, at_s):
    """Insert a cell at place k of a trip, where it is reached at `at_s` and adds `adds` seconds."""
    size = fleet.sizes[t]
    for j in range(size, k, -1):
        moved = fleet.routes[t, j - 1]
        fleet.routes[t, j] = moved
        place_of[moved] = j
        fleet.spent[t, j] = fleet.spent[t, j - 1] + adds
    for j in range(size + 1, k, -1):
        fleet.over[t, j] = fleet.over[t, j - 1]
    fleet.routes[t, k] = cell
    fleet.spent[t, k] = at_s
    trip_of[cell], place_of[cell] = t, k
    fleet.sizes[t] = size + 1
    fleet.takes[t] += adds
    # The trip is longer now, the paths home from the cells before place k are not. If the worst of
    # all cells comes later, nothing changes for them.
    if k > 0 and adds >= 0 and fleet.over[t, 0] == fleet.over[t, k + 1]:
        home = at_s + ports.home[harbour, cell] - fleet.takes[t]
        if home <= fleet.over[t, k + 1]:
            fleet.over[t, k] = fleet.over[t, k + 1]
            return
    _look_home(ports, fleet, harbour, t, k)
