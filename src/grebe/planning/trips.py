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

from grebe.core.kernels import inlined_machine_code, machine_code
from grebe.planning.costs import Costs, leg

if TYPE_CHECKING:
    from numpy.typing import NDArray

# Mean number of cells that are taken out at a time, and the longest string of them.
MEAN_REMOVED, LONGEST_STRING = 10, 10
# How often the best place for a cell is passed over, so that not every recreation is the same.
BLINK = 0.01
# Annealing's first and last temperature, as shares of the time from a cell to the next.
HOT, COLD = 0.3, 0.003
# What a cell that is in no trip costs, in pitches: more than any way there.
ABSENT_PITCHES = 1000.0


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


def improved_trips(
    costs: Costs,
    ports: Ports,
    trips: list[NDArray[np.int64]],
    harbours: NDArray[np.int64],
    rounds: int,
    seed: int = 0,
) -> tuple[list[NDArray[np.int64]], NDArray[np.int64]]:
    """Return cheaper trips, and the cells for which there is no room in them.

    `harbours` (trips,) are the trips' own; cells that no trip holds are taken in where they can be.
    """
    n = len(costs.places) - 1
    routes = np.full((len(trips), n), -1)
    sizes = np.array([len(trip) for trip in trips])
    for route, trip in zip(routes, trips, strict=True):
        route[: len(trip)] = trip
    members = np.concatenate([*trips, np.zeros(0, dtype=np.int64)])
    wanted = np.setdiff1d(np.arange(n), np.flatnonzero(ports.beside[:, 0] < 0))
    absent = np.setdiff1d(wanted, members).astype(np.int64)
    waiting = np.full(n, -1)
    waiting[: len(absent)] = absent
    count = _anneal(costs, ports, routes, sizes, harbours, waiting, len(absent), rounds, seed)
    found = [route[:size].copy() for route, size in zip(routes, sizes, strict=True)]
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
def comes_home(costs, ports, harbour, route, size):
    """Whether the way home fits into what is left of the trip's limit at each of its cells."""
    if size == 0:
        return True
    spent = ports.out[harbour, route[0]]
    for k in range(size):
        if k > 0:
            spent += leg(costs, route[k - 1], route[k])
        if spent + ports.home[harbour, route[k]] > ports.limit_s:
            return False
    return spent + ports.back[harbour, route[size - 1]] <= ports.limit_s


@inlined_machine_code
def _insertion(costs, ports, harbour, route, size, k, cell):
    """What putting a cell before place k adds."""
    if size == 0:
        return ports.out[harbour, cell] + ports.back[harbour, cell]
    if k == 0:
        after = leg(costs, cell, route[0])
        return ports.out[harbour, cell] + after - ports.out[harbour, route[0]]
    before = leg(costs, route[k - 1], cell)
    if k == size:
        return before + ports.back[harbour, cell] - ports.back[harbour, route[size - 1]]
    return before + leg(costs, cell, route[k]) - leg(costs, route[k - 1], route[k])


@machine_code
def _take_out(routes, sizes, trip_of, place_of, trip, first, length, waiting, count):
    """Take a string out of a trip and let it wait."""
    for k in range(first, first + length):
        waiting[count] = routes[trip, k]
        trip_of[routes[trip, k]] = -1
        count += 1
    for k in range(first + length, sizes[trip]):
        cell = routes[trip, k]
        routes[trip, k - length] = cell
        place_of[cell] = k - length
    sizes[trip] -= length
    return count


@machine_code
def _put_in(routes, sizes, trip_of, place_of, trip, k, cell):
    for j in range(sizes[trip], k, -1):
        moved = routes[trip, j - 1]
        routes[trip, j] = moved
        place_of[moved] = j
    routes[trip, k] = cell
    trip_of[cell], place_of[cell] = trip, k
    sizes[trip] += 1


@machine_code
def _best_place(costs, ports, routes, sizes, seconds, harbours, trip_of, place_of, cell, choice):
    """Write the cheapest place for a cell, trip and place, to `choice`; returns what it adds."""
    best = np.inf
    trips, near = sizes.shape[0], ports.beside.shape[1]
    for s in range(2 * near + 2 * trips):
        if s < 2 * near:
            other = ports.beside[cell, s // 2]
            if other < 0 or trip_of[other] < 0:
                continue
            trip, k = trip_of[other], place_of[other] + s % 2
        else:
            trip = (s - 2 * near) // 2
            k = 0 if s % 2 == 0 else sizes[trip]
        if np.random.random() < BLINK:
            continue
        adds = _insertion(costs, ports, harbours[trip], routes[trip], sizes[trip], k, cell)
        if adds < best and seconds[trip] + adds <= ports.limit_s:
            best = adds
            choice[0], choice[1] = trip, k
    return best


@machine_code
def _ruin(costs, ports, routes, sizes, trip_of, place_of, waiting, count, touched):
    """Take strings out of some trips around a random cell."""
    n = costs.places.shape[0] - 1
    seed = np.random.randint(0, n)
    strings = np.random.randint(1, max(2, int(4 * MEAN_REMOVED / (1 + LONGEST_STRING))))
    done = 0
    for s in range(ports.beside.shape[1] + 1):
        cell = seed if s == 0 else ports.beside[seed, s - 1]
        if cell < 0 or trip_of[cell] < 0 or touched[trip_of[cell]]:
            continue
        trip = trip_of[cell]
        length = np.random.randint(1, min(sizes[trip], LONGEST_STRING) + 1)
        low = max(0, place_of[cell] - length + 1)
        high = min(place_of[cell], sizes[trip] - length)
        first = np.random.randint(low, high + 1)
        touched[trip] = True
        count = _take_out(routes, sizes, trip_of, place_of, trip, first, length, waiting, count)
        done += 1
        if done == strings:
            break
    return count


@machine_code
def _sort_waiting(ports, waiting, count, keys):
    """Those that wait in a random order, or the farthest from home first, or the nearest."""
    kind = np.random.randint(0, 7)
    for i in range(count):
        away = ports.out[:, waiting[i]].min()
        keys[i] = np.random.random() if kind < 4 else (-away if kind < 6 else away)
    order = np.argsort(keys[:count])
    ranked = waiting[:count][order]
    for i in range(count):
        waiting[i] = ranked[i]


@machine_code
def _anneal(costs, ports, routes, sizes, harbours, waiting, count, rounds, seed):
    """Improve trips in place; returns how many cells still wait for one."""
    np.random.seed(seed)
    trips, n = routes.shape
    trip_of, place_of = np.full(n, -1), np.full(n, -1)
    seconds = np.zeros(trips)
    for t in range(trips):
        for k in range(sizes[t]):
            trip_of[routes[t, k]], place_of[routes[t, k]] = t, k
        seconds[t] = trip_s(costs, ports, harbours[t], routes[t], sizes[t])
    absent_s = ABSENT_PITCHES * ports.pitch_s
    # An absent cell is worth all that is spared by leaving it out.
    total = seconds.sum() + absent_s * count
    best = total
    kept, kept_sizes, kept_waiting, kept_count = routes.copy(), sizes.copy(), waiting.copy(), count
    old, old_sizes, old_seconds = routes.copy(), sizes.copy(), seconds.copy()
    old_waiting, old_count = waiting.copy(), count
    keys, choice = np.zeros(n), np.zeros(2, dtype=np.int64)
    touched = np.zeros(trips, dtype=np.bool_)
    for i in range(rounds):
        heat = ports.pitch_s * HOT * (COLD / HOT) ** (i / rounds)
        touched[:] = False
        count = _ruin(costs, ports, routes, sizes, trip_of, place_of, waiting, count, touched)
        for t in range(trips):
            if touched[t]:
                seconds[t] = trip_s(costs, ports, harbours[t], routes[t], sizes[t])
        _sort_waiting(ports, waiting, count, keys)
        left = 0
        for w in range(count):
            cell = waiting[w]
            adds = _best_place(
                costs, ports, routes, sizes, seconds, harbours, trip_of, place_of, cell, choice
            )
            if np.isfinite(adds):
                _put_in(routes, sizes, trip_of, place_of, choice[0], choice[1], cell)
                seconds[choice[0]] += adds
                touched[choice[0]] = True
            else:
                waiting[left] = cell
                left += 1
        count = left
        now = seconds.sum() + absent_s * count
        accepted = now < total - heat * np.log(np.random.random())
        if accepted:
            for t in range(trips):
                if touched[t] and not comes_home(costs, ports, harbours[t], routes[t], sizes[t]):
                    accepted = False
                    break
        if accepted:
            total = now
        for t in range(trips):
            if not touched[t]:
                continue
            if accepted:
                old_sizes[t], old_seconds[t] = sizes[t], seconds[t]
                for k in range(sizes[t]):
                    old[t, k] = routes[t, k]
            else:
                for k in range(sizes[t]):
                    trip_of[routes[t, k]] = -1
                sizes[t], seconds[t] = old_sizes[t], old_seconds[t]
        if accepted:
            old_count = count
            old_waiting[:count] = waiting[:count]
        else:
            count = old_count
            waiting[:count] = old_waiting[:count]
            for t in range(trips):
                if touched[t]:
                    for k in range(sizes[t]):
                        cell = old[t, k]
                        routes[t, k] = cell
                        trip_of[cell], place_of[cell] = t, k
        if accepted and total < best - 1e-9:
            best = total
            kept_sizes[:] = sizes
            kept_count = count
            kept_waiting[:count] = waiting[:count]
            for t in range(trips):
                for k in range(sizes[t]):
                    kept[t, k] = routes[t, k]
    sizes[:] = kept_sizes
    routes[:] = kept
    waiting[:] = kept_waiting
    return kept_count
