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
    Ports,
    clock,
    copy_trip,
    empty_fleet,
    put_in,
    reached_s,
    take_out,
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
    ports: Ports,
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
    now, kept = empty_fleet(len(trips), n), empty_fleet(len(trips), n)
    for t, trip in enumerate(trips):
        now.routes[t, : len(trip)] = trip
        now.sizes[t] = len(trip)
    members = np.concatenate([*trips, np.zeros(0, dtype=np.int64)])
    absent = np.setdiff1d(np.flatnonzero(ports.beside[:, 0] >= 0), members).astype(np.int64)
    waiting = np.full(n, -1)
    waiting[: len(absent)] = absent
    old = empty_fleet(len(trips), n)
    count = _anneal(costs, ports, now, old, kept, harbours, waiting, len(absent), rounds, hot)
    found = [r[:size].copy() for r, size in zip(kept.routes, kept.sizes, strict=True)]
    return found, waiting[:count].copy()


@machine_code
def _best_place(costs, ports, fleet, harbours, trip_of, place_of, cell, choice, at_s):
    """Write the cheapest place for a cell, as trip and place, to `choice`, and the time at which it
    is reached there to `at_s`; returns the seconds it adds. The ends of all trips are tried only if
    no trip beside the cell has room.
    """
    best = np.inf
    trips, near = fleet.sizes.shape[0], ports.beside.shape[1]
    for s in range(2 * near + 2 * trips):
        if s >= 2 * near and np.isfinite(best):
            break
        if s < 2 * near:
            other = ports.beside[cell, s // 2]
            if other < 0 or trip_of[other] < 0:
                continue
            t, k = trip_of[other], place_of[other] + s % 2
        else:
            t = (s - 2 * near) // 2
            k = 0 if s % 2 == 0 else fleet.sizes[t]
        if np.random.random() < BLINK:
            continue
        h, size = harbours[t], fleet.sizes[t]
        after = fleet.routes[t, k] if k < size else -1
        here = reached_s(costs, ports, fleet, h, t, k, cell)
        if after >= 0:
            adds = here + leg(costs, cell, after) - fleet.spent[t, k]
        else:
            adds = here + ports.back[h, cell] - fleet.takes[t]
        fits = here + ports.home[h, cell] <= ports.limit_s
        if adds < best and fits and fleet.takes[t] + fleet.over[t, k] + adds <= ports.limit_s:
            best = adds
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
def _rest(ports, waiting, count, seed):
    """Put the waiting cells too far from the place of the ruin first; returns their number."""
    if count <= MOST_TRIED:
        return 0
    resting = count
    k = 0
    while k < resting:
        if _is_beside(ports, seed, waiting[k]):
            resting -= 1
            waiting[k], waiting[resting] = waiting[resting], waiting[k]
        else:
            k += 1
    return resting


@inlined_machine_code
def _is_beside(ports, seed, cell):
    found = cell == seed
    for s in range(ports.beside.shape[1]):
        found = found or ports.beside[seed, s] == cell
    return found


@machine_code
def _ruin(costs, ports, fleet, harbours, trip_of, place_of, waiting, count, touched, seed):
    """Take strings out of some trips around a cell; returns the number of waiting cells."""
    strings = np.random.randint(1, max(2, int(4 * MEAN_REMOVED / (1 + LONGEST_STRING))) + 1)
    for s in range(ports.beside.shape[1] + 1):
        cell = seed if s == 0 else ports.beside[seed, s - 1]
        if cell < 0 or trip_of[cell] < 0 or touched[trip_of[cell]]:
            continue
        t = trip_of[cell]
        length = np.random.randint(1, min(fleet.sizes[t], LONGEST_STRING) + 1)
        low = max(0, place_of[cell] - length + 1)
        high = min(place_of[cell], fleet.sizes[t] - length)
        first = np.random.randint(low, high + 1)
        touched[t] = True
        count = take_out(
            costs, ports, fleet, trip_of, place_of, harbours[t], t, first, length, waiting, count
        )
        strings -= 1
        if strings == 0:
            break
    return count


@machine_code
def _sort_waiting(ports, waiting, first, count, keys):
    """Sort the cells that look for a trip: at random, farthest from home or nearest first."""
    kind = np.random.randint(0, 7)
    for i in range(first, count):
        away = ports.out[:, waiting[i]].min()
        keys[i] = np.random.random() if kind < 4 else (-away if kind < 6 else away)
    copy_vector(waiting[first:count], waiting[first:count][np.argsort(keys[first:count])])


@machine_code
def _recreate(costs, ports, fleet, harbours, trip_of, place_of, waiting, first, count, touched):
    """Put the cells that look for a trip where each costs least; returns how many still wait."""
    choice, at_s = np.zeros(2, dtype=np.int64), np.zeros(1)
    left = first
    for w in range(first, count):
        cell = waiting[w]
        adds = _best_place(costs, ports, fleet, harbours, trip_of, place_of, cell, choice, at_s)
        if np.isfinite(adds):
            t = choice[0]
            put_in(ports, fleet, trip_of, place_of, harbours[t], t, choice[1], cell, adds, at_s[0])
            touched[t] = True
        else:
            waiting[left] = cell
            left += 1
    return left


@machine_code
def _cost(ports, fleet, count):
    """The total time of the trips; a cell that waits costs more than any path to it."""
    total = ABSENT_PITCHES * ports.pitch_s * count
    for t in range(fleet.sizes.shape[0]):
        total += fleet.takes[t]
    return total


@machine_code
def _all_in_time(ports, fleet, touched):
    """Whether the touched trips keep the limit. They may not: between two cells that are not
    linked, the path through a cell that was taken out may have been the shorter one.
    """
    for t in range(fleet.sizes.shape[0]):
        if touched[t] and fleet.takes[t] + fleet.over[t, 0] > ports.limit_s:
            return False
    return True


@machine_code
def _take_back(fleet, old, trip_of, place_of, touched):
    """Restore the trips that were touched."""
    for t in range(fleet.sizes.shape[0]):
        if touched[t]:
            for k in range(fleet.sizes[t]):
                trip_of[fleet.routes[t, k]] = -1
    for t in range(fleet.sizes.shape[0]):
        if touched[t]:
            copy_trip(old, fleet, t)
            for k in range(fleet.sizes[t]):
                trip_of[fleet.routes[t, k]], place_of[fleet.routes[t, k]] = t, k


@machine_code
def _anneal(costs, ports, fleet, old, kept, harbours, waiting, count, rounds, hot):
    """Improve trips and store the best in `kept`; returns how many cells still wait for a trip."""
    np.random.seed(0)
    trips, n = fleet.routes.shape
    trip_of, place_of, keys = np.full(n, -1), np.full(n, -1), np.zeros(n)
    for t in range(trips):
        clock(costs, ports, fleet, harbours[t], t)
        for k in range(fleet.sizes[t]):
            trip_of[fleet.routes[t, k]], place_of[fleet.routes[t, k]] = t, k
        copy_trip(fleet, old, t)
        copy_trip(fleet, kept, t)
    total = _cost(ports, fleet, count)
    best, kept_count = total, count
    old_waiting, kept_waiting = waiting.copy(), waiting.copy()
    touched, changed = np.zeros(trips, dtype=np.bool_), np.zeros(trips, dtype=np.bool_)
    for i in range(rounds):
        heat = ports.pitch_s * hot * (COLD / hot) ** (i / rounds)
        touched[:] = False
        before = count
        seed = _place_of_ruin(n, waiting, count)
        resting = _rest(ports, waiting, count, seed)
        count = _ruin(
            costs, ports, fleet, harbours, trip_of, place_of, waiting, count, touched, seed
        )
        _sort_waiting(ports, waiting, resting, count, keys)
        count = _recreate(
            costs, ports, fleet, harbours, trip_of, place_of, waiting, resting, count, touched
        )
        now = _cost(ports, fleet, count)
        dear = now >= total - heat * np.log(np.random.random())
        if dear or not _all_in_time(ports, fleet, touched):
            _take_back(fleet, old, trip_of, place_of, touched)
            count = before
            copy_vector(waiting[:count], old_waiting[:count])
            continue
        total = now
        copy_vector(old_waiting[:count], waiting[:count])
        for t in range(trips):
            if touched[t]:
                copy_trip(fleet, old, t)
                changed[t] = True
        if total < best - 1e-9:
            best, kept_count = total, count
            copy_vector(kept_waiting[:count], waiting[:count])
            for t in range(trips):
                if changed[t]:
                    copy_trip(fleet, kept, t)
                    changed[t] = False
    copy_vector(waiting, kept_waiting)
    return kept_count
