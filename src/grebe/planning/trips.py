"""Make trips from a harbour cheaper together: ruin and recreate under simulated annealing.

Strings of neighbouring cells are taken out of trips that lie beside each other and are put back,
each where it costs least and the trip may still grow; the result is kept as annealing has it (slack
induction by string removals; Christiaens and Vanden Berghe 2020). Moving cells, exchanging them
and exchanging the ends of trips are all special cases. A trip may not last longer than its limit,
and from each of its cells the way home must fit into what is left of it.
"""

# Kernels do not annotate their parameters: numba infers the types when it compiles them.
# pyright: reportMissingParameterType=false

from __future__ import annotations

from typing import TYPE_CHECKING, NamedTuple

import numpy as np

from grebe.core.copies import put
from grebe.core.kernels import inlined_machine_code, machine_code
from grebe.planning.costs import Costs, leg

if TYPE_CHECKING:
    from numpy.typing import NDArray

# Mean number of cells that are taken out at a time, and the longest string of them.
MEAN_REMOVED, LONGEST_STRING = 10, 10
# How often the best place for a cell is passed over, so that not every recreation is the same.
BLINK = 0.01
# Annealing's first temperature, that of trips that are nearly good, and the last, as shares of the
# time from a cell to the next.
HOT, WARM, COLD = 3.0, 0.3, 0.003
# What a cell that is in no trip costs, in pitches: more than any way there.
ABSENT_PITCHES = 1000.0
# Of more cells without a trip than these only those beside the place of the ruin look for one: a
# round that tried thousands of them would take a hundred times as long.
MOST_TRIED = 20


class Ports(NamedTuple):
    """Seconds from each harbour to each cell, `out` (h, n), and `back`; `home` (h, n) is what must
    be left at a cell for the way home in the worst weather. `beside` (n, m) are the cells nearest
    to each; `limit_s` bounds a trip. `at` (trips,) is the harbour of each trip.
    """

    out: NDArray[np.float64]
    back: NDArray[np.float64]
    home: NDArray[np.float64]
    beside: NDArray[np.int64]
    limit_s: float
    pitch_s: float


class Fleet(NamedTuple):
    """Trips as they stand: `routes` (trips, n) of cells with their `sizes`; `spent` (trips, n) the
    seconds at each cell, and `takes` (trips,) those of the whole trip. `over` (trips, n + 1) is by
    how much longer the trip would take if it turned for home, in the worst weather, at the worst of
    the cells from there on, or nothing.
    """

    routes: NDArray[np.int64]
    sizes: NDArray[np.int64]
    spent: NDArray[np.float64]
    takes: NDArray[np.float64]
    over: NDArray[np.float64]


def _fleet(trips: int, cells: int) -> Fleet:
    return Fleet(
        routes=np.full((trips, cells), -1),
        sizes=np.zeros(trips, dtype=np.int64),
        spent=np.zeros((trips, cells)),
        takes=np.zeros(trips),
        over=np.zeros((trips, cells + 1)),
    )


def improved_trips(
    costs: Costs,
    ports: Ports,
    trips: list[NDArray[np.int64]],
    harbours: NDArray[np.int64],
    rounds: int,
    hot: float = HOT,
) -> tuple[list[NDArray[np.int64]], NDArray[np.int64]]:
    """Return cheaper trips, and the cells for which there is no room in them.

    `harbours` (trips,) are the trips' own; cells that no trip holds are taken in where they can
    be. `hot` is the annealing's first temperature.
    """
    n = len(costs.places) - 1
    now, kept = _fleet(len(trips), n), _fleet(len(trips), n)
    for t, trip in enumerate(trips):
        now.routes[t, : len(trip)] = trip
        now.sizes[t] = len(trip)
    members = np.concatenate([*trips, np.zeros(0, dtype=np.int64)])
    absent = np.setdiff1d(np.flatnonzero(ports.beside[:, 0] >= 0), members).astype(np.int64)
    waiting = np.full(n, -1)
    waiting[: len(absent)] = absent
    old = _fleet(len(trips), n)
    count = _anneal(costs, ports, now, old, kept, harbours, waiting, len(absent), rounds, hot)
    found = [r[:size].copy() for r, size in zip(kept.routes, kept.sizes, strict=True)]
    return found, waiting[:count].copy()


@machine_code
def trip_s(costs, ports, harbour, route, size):
    """Seconds of a trip from its harbour through its cells and back."""
    if size == 0:
        return 0.0
    total = ports.out[harbour, route[0]] + ports.back[harbour, route[size - 1]]
    for k in range(size - 1):
        total += leg(costs, route[k], route[k + 1])
    return total


@machine_code
def shortest_stretch(costs, ports, harbour, route):
    """First and last but one place of the shortest stretch without which a trip keeps its limit,
    with the way home from each of its cells; both are 0 where it does so whole.
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
                saved = spent[j] - _reached(costs, ports, fleet, harbour, 0, i, route[j])
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
    _clock(costs, ports, fleet, harbour, 0)
    return fleet


@machine_code
def _clock(costs, ports, fleet, harbour, t):
    """Work out what a trip has spent at each cell, and how much longer the ways home take."""
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
def _copy(source, target, t):
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
def _take_out(costs, ports, fleet, trip_of, place_of, harbour, t, first, length, waiting, count):
    """Take a string out of a trip and let it wait."""
    size, behind = fleet.sizes[t], first + length
    for k in range(first, behind):
        waiting[count] = fleet.routes[t, k]
        trip_of[fleet.routes[t, k]] = -1
        count += 1
    saved = 0.0
    if behind < size:
        saved = fleet.spent[t, behind] - _reached(
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
def _reached(costs, ports, fleet, harbour, t, k, cell):
    """When a cell is reached that is the k-th of a trip."""
    if k == 0:
        return ports.out[harbour, cell]
    return fleet.spent[t, k - 1] + leg(costs, fleet.routes[t, k - 1], cell)


@machine_code
def _look_home(ports, fleet, harbour, t, last):
    """Work out how much longer the ways home take from a trip's cells up to the last."""
    for k in range(last, -1, -1):
        home = fleet.spent[t, k] + ports.home[harbour, fleet.routes[t, k]] - fleet.takes[t]
        fleet.over[t, k] = max(home, fleet.over[t, k + 1])


@machine_code
def _put_in(ports, fleet, trip_of, place_of, harbour, t, k, cell, adds, at_s):
    """Put a cell before place k of a trip, where it is reached at `at_s`."""
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
    # The way home from what comes before is no longer than it was, and the trip is: where the worst
    # of all cells comes later, nothing changes for them.
    if k > 0 and adds >= 0 and fleet.over[t, 0] == fleet.over[t, k + 1]:
        home = at_s + ports.home[harbour, cell] - fleet.takes[t]
        if home <= fleet.over[t, k + 1]:
            fleet.over[t, k] = fleet.over[t, k + 1]
            return
    _look_home(ports, fleet, harbour, t, k)


@machine_code
def _best_place(costs, ports, fleet, harbours, trip_of, place_of, cell, choice, at_s):
    """Write the cheapest place for a cell, trip and place, to `choice`, and when it is reached
    there to `at_s`; returns what it adds. The ends of trips elsewhere are looked at where none of
    those beside it has room.
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
        here = _reached(costs, ports, fleet, h, t, k, cell)
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
    """A random cell; where many wait for a trip, every other time one of them."""
    if count > MOST_TRIED and np.random.random() < 0.5:
        return waiting[np.random.randint(0, count)]
    return np.random.randint(0, cells)


@machine_code
def _rest(ports, waiting, count, seed):
    """Put those that wait too far from the place of the ruin first; returns how many they are."""
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
    """Take strings out of some trips around a cell."""
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
        count = _take_out(
            costs, ports, fleet, trip_of, place_of, harbours[t], t, first, length, waiting, count
        )
        strings -= 1
        if strings == 0:
            break
    return count


@machine_code
def _sort_waiting(ports, waiting, first, count, keys):
    """Those that look for a trip in a random order, or the farthest from home first, or the
    nearest.
    """
    kind = np.random.randint(0, 7)
    for i in range(first, count):
        away = ports.out[:, waiting[i]].min()
        keys[i] = np.random.random() if kind < 4 else (-away if kind < 6 else away)
    put(waiting[first:count], waiting[first:count][np.argsort(keys[first:count])])


@machine_code
def _recreate(costs, ports, fleet, harbours, trip_of, place_of, waiting, first, count, touched):
    """Put those that look for a trip where each costs least; returns how many wait on."""
    choice, at_s = np.zeros(2, dtype=np.int64), np.zeros(1)
    left = first
    for w in range(first, count):
        cell = waiting[w]
        adds = _best_place(costs, ports, fleet, harbours, trip_of, place_of, cell, choice, at_s)
        if np.isfinite(adds):
            t = choice[0]
            _put_in(ports, fleet, trip_of, place_of, harbours[t], t, choice[1], cell, adds, at_s[0])
            touched[t] = True
        else:
            waiting[left] = cell
            left += 1
    return left


@machine_code
def _cost(ports, fleet, count):
    """What the trips take together; a cell that waits costs more than any way to it."""
    total = ABSENT_PITCHES * ports.pitch_s * count
    for t in range(fleet.sizes.shape[0]):
        total += fleet.takes[t]
    return total


@machine_code
def _all_in_time(ports, fleet, touched):
    """Whether the trips that were touched keep the limit: where two cells are not linked, what
    lay between them may have been the shorter way.
    """
    for t in range(fleet.sizes.shape[0]):
        if touched[t] and fleet.takes[t] + fleet.over[t, 0] > ports.limit_s:
            return False
    return True


@machine_code
def _take_back(fleet, old, trip_of, place_of, touched):
    """Put the trips that were touched back as they were."""
    for t in range(fleet.sizes.shape[0]):
        if touched[t]:
            for k in range(fleet.sizes[t]):
                trip_of[fleet.routes[t, k]] = -1
    for t in range(fleet.sizes.shape[0]):
        if touched[t]:
            _copy(old, fleet, t)
            for k in range(fleet.sizes[t]):
                trip_of[fleet.routes[t, k]], place_of[fleet.routes[t, k]] = t, k


@machine_code
def _anneal(costs, ports, fleet, old, kept, harbours, waiting, count, rounds, hot):
    """Improve trips; the best are `kept`. Returns how many cells still wait for one."""
    np.random.seed(0)
    trips, n = fleet.routes.shape
    trip_of, place_of, keys = np.full(n, -1), np.full(n, -1), np.zeros(n)
    for t in range(trips):
        _clock(costs, ports, fleet, harbours[t], t)
        for k in range(fleet.sizes[t]):
            trip_of[fleet.routes[t, k]], place_of[fleet.routes[t, k]] = t, k
        _copy(fleet, old, t)
        _copy(fleet, kept, t)
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
            put(waiting[:count], old_waiting[:count])
            continue
        total = now
        put(old_waiting[:count], waiting[:count])
        for t in range(trips):
            if touched[t]:
                _copy(fleet, old, t)
                changed[t] = True
        if total < best - 1e-9:
            best, kept_count = total, count
            put(kept_waiting[:count], waiting[:count])
            for t in range(trips):
                if changed[t]:
                    _copy(fleet, kept, t)
                    changed[t] = False
    put(waiting, kept_waiting)
    return kept_count
