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


class Depots(NamedTuple):
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


class TripTable(NamedTuple):
    """The state of all trips.

    `routes` (trips, n): cells in order; `sizes` (trips,): how many; `arrival` (trips, n): seconds
    at which each cell is reached; `duration` (trips,): seconds of each trip; `overrun` (trips, n +
    1): how much longer than `duration` the trip would last if it turned for home, in the worst
    weather, at the worst of the cells from there on, and 0 if no longer.
    """

    routes: NDArray[np.int64]
    sizes: NDArray[np.int64]
    arrival: NDArray[np.float64]
    duration: NDArray[np.float64]
    overrun: NDArray[np.float64]


def empty_table(trips: int, cells: int) -> TripTable:
    """Return empty trips, with room for `cells` each."""
    return TripTable(
        routes=np.full((trips, cells), -1),
        sizes=np.zeros(trips, dtype=np.int64),
        arrival=np.zeros((trips, cells)),
        duration=np.zeros(trips),
        overrun=np.zeros((trips, cells + 1)),
    )


@machine_code
def trip_s(costs, depots, harbour, route, size):
    """Seconds of a trip from its harbour through its cells and back to it."""
    if size == 0:
        return 0.0
    total = depots.out[harbour, route[0]] + depots.back[harbour, route[size - 1]]
    for k in range(size - 1):
        total += leg(costs, route[k], route[k + 1])
    return total


@machine_code
def shortest_stretch(costs, depots, harbour, route):
    """The shortest stretch [first, last) without which a trip keeps its limit, also with the path
    home from each of its cells; (0, 0) if the complete trip does.
    """
    size = route.shape[0]
    table = _table_of(costs, depots, harbour, route)
    arrival, duration, overrun = table.arrival[0], table.duration[0], table.overrun[0]
    if duration + overrun[0] <= depots.limit_s:
        return 0, 0
    best, first = size, 0
    before = -np.inf
    for i in range(size):
        for j in range(i + 1, min(size, i + best - 1) + 1):
            if j < size:
                saved = arrival[j] - reached_s(costs, depots, table, harbour, 0, i, route[j])
            elif i > 0:
                saved = duration - arrival[i - 1] - depots.back[harbour, route[i - 1]]
            else:
                saved = duration
            if duration + overrun[j] - saved <= depots.limit_s:
                best, first = j - i, i
                break
        before = max(before, arrival[i] + depots.home[harbour, route[i]])
        if before > depots.limit_s:
            break
    return first, first + best


@machine_code
def _table_of(costs, depots, harbour, route):
    """One trip as a table."""
    size = route.shape[0]
    table = TripTable(
        np.zeros((1, size), dtype=np.int64),
        np.zeros(1, dtype=np.int64),
        np.zeros((1, size)),
        np.zeros(1),
        np.zeros((1, size + 1)),
    )
    table.routes[0] = route
    table.sizes[0] = size
    update_times(costs, depots, table, harbour, 0)
    return table


@machine_code
def update_times(costs, depots, table, harbour, t):
    """Compute when a trip reaches each cell, and how much longer the paths home take."""
    size = table.sizes[t]
    if size == 0:
        table.duration[t] = table.overrun[t, 0] = 0.0
        return
    arrival = depots.out[harbour, table.routes[t, 0]]
    for k in range(size):
        if k > 0:
            arrival += leg(costs, table.routes[t, k - 1], table.routes[t, k])
        table.arrival[t, k] = arrival
    table.duration[t] = arrival + depots.back[harbour, table.routes[t, size - 1]]
    table.overrun[t, size] = 0.0
    _update_overrun(depots, table, harbour, t, size - 1)


@machine_code
def copy_trip(source, target, t):
    """Copy a trip from one table to another."""
    size = source.sizes[t]
    target.sizes[t] = size
    for k in range(size):
        target.routes[t, k] = source.routes[t, k]
        target.arrival[t, k] = source.arrival[t, k]
        target.overrun[t, k] = source.overrun[t, k]
    target.overrun[t, size] = 0.0
    target.duration[t] = source.duration[t]


@machine_code
def remove_cells(
    costs, depots, table, trip_of, place_of, harbour, t, first, length, waiting, count
):
    """Take a string of cells out of a trip and add it to those that wait; returns their number."""
    size, behind = table.sizes[t], first + length
    for k in range(first, behind):
        waiting[count] = table.routes[t, k]
        trip_of[table.routes[t, k]] = -1
        count += 1
    saved = 0.0
    if behind < size:
        saved = table.arrival[t, behind] - reached_s(
            costs, depots, table, harbour, t, first, table.routes[t, behind]
        )
    for k in range(behind, size):
        cell = table.routes[t, k]
        table.routes[t, k - length] = cell
        table.arrival[t, k - length] = table.arrival[t, k] - saved
        table.overrun[t, k - length] = table.overrun[t, k]
        place_of[cell] = k - length
    left = size - length
    table.sizes[t] = left
    table.overrun[t, left] = 0.0
    if behind < size:
        table.duration[t] -= saved
    elif left > 0:
        last = table.routes[t, left - 1]
        table.duration[t] = table.arrival[t, left - 1] + depots.back[harbour, last]
    else:
        table.duration[t] = 0.0
    _update_overrun(depots, table, harbour, t, first - 1)
    return count


@machine_code
def reached_s(costs, depots, table, harbour, t, k, cell):
    """Seconds at which a cell is reached if it is at place k of a trip."""
    if k == 0:
        return depots.out[harbour, cell]
    return table.arrival[t, k - 1] + leg(costs, table.routes[t, k - 1], cell)


@machine_code
def _update_overrun(depots, table, harbour, t, last):
    """Compute how much longer the paths home take from a trip's cells up to place `last`."""
    for k in range(last, -1, -1):
        home = table.arrival[t, k] + depots.home[harbour, table.routes[t, k]] - table.duration[t]
        table.overrun[t, k] = max(home, table.overrun[t, k + 1])


@machine_code
def insert_cell(depots, table, trip_of, place_of, harbour, t, k, cell, added_s, at_s):
    """Insert a cell at place k of a trip, reached at `at_s`, which adds `added_s` seconds."""
    size = table.sizes[t]
    for j in range(size, k, -1):
        moved = table.routes[t, j - 1]
        table.routes[t, j] = moved
        place_of[moved] = j
        table.arrival[t, j] = table.arrival[t, j - 1] + added_s
    for j in range(size + 1, k, -1):
        table.overrun[t, j] = table.overrun[t, j - 1]
    table.routes[t, k] = cell
    table.arrival[t, k] = at_s
    trip_of[cell], place_of[cell] = t, k
    table.sizes[t] = size + 1
    table.duration[t] += added_s
    # The trip is longer now, the paths home from the cells before place k are not. If the worst of
    # all cells comes later, nothing changes for them.
    if k > 0 and added_s >= 0 and table.overrun[t, 0] == table.overrun[t, k + 1]:
        home = at_s + depots.home[harbour, cell] - table.duration[t]
        if home <= table.overrun[t, k + 1]:
            table.overrun[t, k] = table.overrun[t, k + 1]
            return
    _update_overrun(depots, table, harbour, t, k)
