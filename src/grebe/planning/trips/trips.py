"""Reduce the total cost of trips from harbours: ruin and recreate under simulated annealing.

Strings of neighbouring cells are taken out of neighbouring trips. Then each cell is put back where
it costs least and the trip has room. Simulated annealing decides whether the result is kept (slack
induction by string removals; Christiaens and Vanden Berghe 2020). Moving cells, exchanging them and
exchanging the ends of trips are all special cases. No trip exceeds its limit.
"""

# Kernels do not annotate their parameters: numba infers the types when it compiles them.
# pyright: reportMissingParameterType=false

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from grebe.core.copies import copy_vector
from grebe.core.kernels import inlined_machine_code, machine_code
from grebe.planning.route.costs import Costs, leg
from grebe.planning.trips.trip_times import (
    Depots,
    copy_trip,
    empty_table,
    insert_cell,
    reached_s,
    remove_cells,
    update_times,
)

if TYPE_CHECKING:
    from numpy.typing import NDArray

# Mean number of cells that are taken out at a time, and the longest string.
MEAN_REMOVED, LONGEST_STRING = 10, 10
# Probability of passing over a place for a cell, so that not every recreation is the same.
BLINK = 0.01
# Temperatures of the annealing: the first one, the first for trips that are nearly good, and the
# last, as multiples of the time from a cell to the next.
HOT, WARM, COLD = 3.0, 0.3, 0.003
# Cost of a cell that is in no trip, in pitches: more than any path to it.
ABSENT_PITCHES = 1000.0
# If more cells than this are without a trip, only those beside the place of the ruin look for one:
# a round that tried thousands of them would take a hundred times as long.
MOST_TRIED = 20


def improved_trips(
    costs: Costs,
    depots: Depots,
    trips: list[NDArray[np.int64]],
    harbours: NDArray[np.int64],
    rounds: int,
    hot: float = HOT,
) -> tuple[list[NDArray[np.int64]], NDArray[np.int64]]:
    """Return cheaper trips, and the cells for which there is no room in them.

    `harbours` (trips,) are those of the trips. Cells that are in no trip are taken in if possible.
    `hot` is the first temperature of the annealing.
    """
    n = len(costs.places) - 1
    now, kept = empty_table(len(trips), n), empty_table(len(trips), n)
    for t, trip in enumerate(trips):
        now.routes[t, : len(trip)] = trip
        now.sizes[t] = len(trip)
    members = np.concatenate([*trips, np.zeros(0, dtype=np.int64)])
    absent = np.setdiff1d(np.flatnonzero(depots.beside[:, 0] >= 0), members).astype(np.int64)
    waiting = np.full(n, -1)
    waiting[: len(absent)] = absent
    old = empty_table(len(trips), n)
    count = _anneal(costs, depots, now, old, kept, harbours, waiting, len(absent), rounds, hot)
    found = [r[:size].copy() for r, size in zip(kept.routes, kept.sizes, strict=True)]
    return found, waiting[:count].copy()


@machine_code
def _best_place(costs, depots, table, harbours, trip_of, place_of, cell, choice, at_s):
    """Write the cheapest place for a cell, as trip and place, to `choice`, and the time at which it
    is reached there to `at_s`; returns the seconds it adds. The ends of all trips are tried only if
    no trip beside the cell has room.
    """
    best = np.inf
    trips, near = table.sizes.shape[0], depots.beside.shape[1]
    for s in range(2 * near + 2 * trips):
        if s >= 2 * near and np.isfinite(best):
            break
        if s < 2 * near:
            other = depots.beside[cell, s // 2]
            if other < 0 or trip_of[other] < 0:
                continue
            t, k = trip_of[other], place_of[other] + s % 2
        else:
            t = (s - 2 * near) // 2
            k = 0 if s % 2 == 0 else table.sizes[t]
        if np.random.random() < BLINK:
            continue
        h, size = harbours[t], table.sizes[t]
        after = table.routes[t, k] if k < size else -1
        here = reached_s(costs, depots, table, h, t, k, cell)
        if after >= 0:
            added_s = here + leg(costs, cell, after) - table.arrival[t, k]
        else:
            added_s = here + depots.back[h, cell] - table.duration[t]
        fits = here + depots.home[h, cell] <= depots.limit_s
        if (
            added_s < best
            and fits
            and table.duration[t] + table.overrun[t, k] + added_s <= depots.limit_s
        ):
            best = added_s
            choice[0], choice[1] = t, k
            at_s[0] = here
    return best


@machine_code
def _place_of_ruin(cells, waiting, count):
    """A random cell; if many wait for a trip, every other time one of those."""
    if count > MOST_TRIED and np.random.random() < 0.5:
        return waiting[np.random.randint(0, count)]
    return np.random.randint(0, cells)


@machine_code
def _set_aside(depots, waiting, count, seed):
    """Put the waiting cells too far from the place of the ruin first; returns their number."""
    if count <= MOST_TRIED:
        return 0
    resting = count
    k = 0
    while k < resting:
        if _is_beside(depots, seed, waiting[k]):
            resting -= 1
            waiting[k], waiting[resting] = waiting[resting], waiting[k]
        else:
            k += 1
    return resting


@inlined_machine_code
def _is_beside(depots, seed, cell):
    found = cell == seed
    for s in range(depots.beside.shape[1]):
        found = found or depots.beside[seed, s] == cell
    return found


@machine_code
def _ruin(costs, depots, table, harbours, trip_of, place_of, waiting, count, touched, seed):
    """Take strings out of some trips around a cell; returns the number of waiting cells."""
    strings = np.random.randint(1, max(2, int(4 * MEAN_REMOVED / (1 + LONGEST_STRING))) + 1)
    for s in range(depots.beside.shape[1] + 1):
        cell = seed if s == 0 else depots.beside[seed, s - 1]
        if cell < 0 or trip_of[cell] < 0 or touched[trip_of[cell]]:
            continue
        t = trip_of[cell]
        length = np.random.randint(1, min(table.sizes[t], LONGEST_STRING) + 1)
        low = max(0, place_of[cell] - length + 1)
        high = min(place_of[cell], table.sizes[t] - length)
        first = np.random.randint(low, high + 1)
        touched[t] = True
        count = remove_cells(
            costs, depots, table, trip_of, place_of, harbours[t], t, first, length, waiting, count
        )
        strings -= 1
        if strings == 0:
            break
    return count


@machine_code
def _sort_waiting(depots, waiting, first, count, keys):
    """Sort the cells that look for a trip: at random, farthest from home or nearest first."""
    kind = np.random.randint(0, 7)
    for i in range(first, count):
        away = depots.out[:, waiting[i]].min()
        keys[i] = np.random.random() if kind < 4 else (-away if kind < 6 else away)
    copy_vector(waiting[first:count], waiting[first:count][np.argsort(keys[first:count])])


@machine_code
def _recreate(costs, depots, table, harbours, trip_of, place_of, waiting, first, count, touched):
    """Put the cells that look for a trip where each costs least; returns how many still wait."""
    choice, at_s = np.zeros(2, dtype=np.int64), np.zeros(1)
    left = first
    for w in range(first, count):
        cell = waiting[w]
        added_s = _best_place(costs, depots, table, harbours, trip_of, place_of, cell, choice, at_s)
        if np.isfinite(added_s):
            t = choice[0]
            insert_cell(
                depots, table, trip_of, place_of, harbours[t], t, choice[1], cell, added_s, at_s[0]
            )
            touched[t] = True
        else:
            waiting[left] = cell
            left += 1
    return left


@machine_code
def _cost(depots, table, count):
    """The total time of the trips; a cell that waits costs more than any path to it."""
    total = ABSENT_PITCHES * depots.pitch_s * count
    for t in range(table.sizes.shape[0]):
        total += table.duration[t]
    return total


@machine_code
def _all_in_time(depots, table, touched):
    """Whether the touched trips keep the limit. They may not: between two cells that are not
    linked, the path through a cell that was taken out may have been the shorter one.
    """
    for t in range(table.sizes.shape[0]):
        if touched[t] and table.duration[t] + table.overrun[t, 0] > depots.limit_s:
            return False
    return True


@machine_code
def _restore(table, old, trip_of, place_of, touched):
    """Restore the trips that were touched."""
    for t in range(table.sizes.shape[0]):
        if touched[t]:
            for k in range(table.sizes[t]):
                trip_of[table.routes[t, k]] = -1
    for t in range(table.sizes.shape[0]):
        if touched[t]:
            copy_trip(old, table, t)
            for k in range(table.sizes[t]):
                trip_of[table.routes[t, k]], place_of[table.routes[t, k]] = t, k


@machine_code
def _anneal(costs, depots, table, old, kept, harbours, waiting, count, rounds, hot):
    """Improve trips and store the best in `kept`; returns how many cells still wait for a trip."""
    np.random.seed(0)
    trips, n = table.routes.shape
    trip_of, place_of, keys = np.full(n, -1), np.full(n, -1), np.zeros(n)
    for t in range(trips):
        update_times(costs, depots, table, harbours[t], t)
        for k in range(table.sizes[t]):
            trip_of[table.routes[t, k]], place_of[table.routes[t, k]] = t, k
        copy_trip(table, old, t)
        copy_trip(table, kept, t)
    total = _cost(depots, table, count)
    best, kept_count = total, count
    old_waiting, kept_waiting = waiting.copy(), waiting.copy()
    touched, changed = np.zeros(trips, dtype=np.bool_), np.zeros(trips, dtype=np.bool_)
    for i in range(rounds):
        heat = depots.pitch_s * hot * (COLD / hot) ** (i / rounds)
        touched[:] = False
        before = count
        seed = _place_of_ruin(n, waiting, count)
        resting = _set_aside(depots, waiting, count, seed)
        count = _ruin(
            costs, depots, table, harbours, trip_of, place_of, waiting, count, touched, seed
        )
        _sort_waiting(depots, waiting, resting, count, keys)
        count = _recreate(
            costs, depots, table, harbours, trip_of, place_of, waiting, resting, count, touched
        )
        now = _cost(depots, table, count)
        dear = now >= total - heat * np.log(np.random.random())
        if dear or not _all_in_time(depots, table, touched):
            _restore(table, old, trip_of, place_of, touched)
            count = before
            copy_vector(waiting[:count], old_waiting[:count])
            continue
        total = now
        copy_vector(old_waiting[:count], waiting[:count])
        for t in range(trips):
            if touched[t]:
                copy_trip(table, old, t)
                changed[t] = True
        if total < best - 1e-9:
            best, kept_count = total, count
            copy_vector(kept_waiting[:count], waiting[:count])
            for t in range(trips):
                if changed[t]:
                    copy_trip(table, kept, t)
                    changed[t] = False
    copy_vector(waiting, kept_waiting)
    return kept_count
