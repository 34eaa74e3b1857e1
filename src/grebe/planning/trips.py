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

from grebe.core.kernels import machine_code
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


class Fleet(NamedTuple):
    """Trips as they stand: `routes` (trips, n) of cells with their `sizes`; `spent` (trips, n) the
    seconds at each cell, and `late` (trips, n + 1) the most that any cell from there on has spent
    and must have left for the way home; behind the last cell it is what the trip takes.
    """

    routes: NDArray[np.int64]
    sizes: NDArray[np.int64]
    spent: NDArray[np.float64]
    late: NDArray[np.float64]


def _fleet(trips: int, cells: int) -> Fleet:
    return Fleet(
        routes=np.full((trips, cells), -1),
        sizes=np.zeros(trips, dtype=np.int64),
        spent=np.zeros((trips, cells)),
        late=np.zeros((trips, cells + 1)),
    )


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
    now, kept = _fleet(len(trips), n), _fleet(len(trips), n)
    for t, trip in enumerate(trips):
        now.routes[t, : len(trip)] = trip
        now.sizes[t] = len(trip)
    members = np.concatenate([*trips, np.zeros(0, dtype=np.int64)])
    absent = np.setdiff1d(np.flatnonzero(ports.beside[:, 0] >= 0), members).astype(np.int64)
    waiting = np.full(n, -1)
    waiting[: len(absent)] = absent
    old = _fleet(len(trips), n)
    count = _anneal(costs, ports, now, old, kept, harbours, waiting, len(absent), rounds, seed)
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


@machine_code
def _clock(costs, ports, fleet, harbour, t):
    """Work out what a trip has spent at each cell, and how late it may be there."""
    size = fleet.sizes[t]
    if size == 0:
        fleet.late[t, 0] = 0.0
        return
    spent = ports.out[harbour, fleet.routes[t, 0]]
    for k in range(size):
        if k > 0:
            spent += leg(costs, fleet.routes[t, k - 1], fleet.routes[t, k])
        fleet.spent[t, k] = spent
    late = spent + ports.back[harbour, fleet.routes[t, size - 1]]
    fleet.late[t, size] = late
    for k in range(size - 1, -1, -1):
        late = max(late, fleet.spent[t, k] + ports.home[harbour, fleet.routes[t, k]])
        fleet.late[t, k] = late


@machine_code
def _copy(source, target, t):
    """Copy a trip from one fleet to another."""
    size = source.sizes[t]
    target.sizes[t] = size
    for k in range(size):
        target.routes[t, k] = source.routes[t, k]
        target.spent[t, k] = source.spent[t, k]
        target.late[t, k] = source.late[t, k]
    target.late[t, size] = source.late[t, size]


@machine_code
def _take_out(fleet, trip_of, place_of, t, first, length, waiting, count):
    """Take a string out of a trip and let it wait."""
    for k in range(first, first + length):
        waiting[count] = fleet.routes[t, k]
        trip_of[fleet.routes[t, k]] = -1
        count += 1
    for k in range(first + length, fleet.sizes[t]):
        cell = fleet.routes[t, k]
        fleet.routes[t, k - length] = cell
        place_of[cell] = k - length
    fleet.sizes[t] -= length
    return count


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
        fleet.late[t, j] = fleet.late[t, j - 1] + adds
    fleet.routes[t, k] = cell
    fleet.spent[t, k] = at_s
    trip_of[cell], place_of[cell] = t, k
    fleet.sizes[t] = size + 1
    for j in range(k, -1, -1):
        own = fleet.spent[t, j] + ports.home[harbour, fleet.routes[t, j]]
        fleet.late[t, j] = max(own, fleet.late[t, j + 1])


@machine_code
def _best_place(costs, ports, fleet, harbours, trip_of, place_of, cell, choice, at_s):
    """Write the cheapest place for a cell, trip and place, to `choice`, and when it is reached
    there to `at_s`; returns what it adds.
    """
    best = np.inf
    trips, near = fleet.sizes.shape[0], ports.beside.shape[1]
    for s in range(2 * near + 2 * trips):
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
        before = fleet.routes[t, k - 1] if k > 0 else -1
        after = fleet.routes[t, k] if k < size else -1
        here = fleet.spent[t, k - 1] + leg(costs, before, cell) if k > 0 else ports.out[h, cell]
        if after >= 0:
            adds = here + leg(costs, cell, after) - fleet.spent[t, k]
        else:
            adds = here + ports.back[h, cell] - (fleet.late[t, size] if size > 0 else 0.0)
        fits = here + ports.home[h, cell] <= ports.limit_s
        if adds < best and fits and fleet.late[t, k] + adds <= ports.limit_s:
            best = adds
            choice[0], choice[1] = t, k
            at_s[0] = here
    return best


@machine_code
def _ruin(costs, ports, fleet, trip_of, place_of, waiting, count, touched):
    """Take strings out of some trips around a random cell."""
    n = costs.places.shape[0] - 1
    seed = np.random.randint(0, n)
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
        count = _take_out(fleet, trip_of, place_of, t, first, length, waiting, count)
        strings -= 1
        if strings == 0:
            break
    return count


@machine_code
def _sort_waiting(ports, waiting, count, keys):
    """Those that wait in a random order, or the farthest from home first, or the nearest."""
    kind = np.random.randint(0, 7)
    for i in range(count):
        away = ports.out[:, waiting[i]].min()
        keys[i] = np.random.random() if kind < 4 else (-away if kind < 6 else away)
    waiting[:count] = waiting[:count][np.argsort(keys[:count])]


@machine_code
def _recreate(costs, ports, fleet, harbours, trip_of, place_of, waiting, count, touched):
    """Put those that wait back, each where it costs least; returns how many find no place."""
    choice, at_s = np.zeros(2, dtype=np.int64), np.zeros(1)
    left = 0
    for w in range(count):
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
        total += fleet.late[t, fleet.sizes[t]]
    return total


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
def _anneal(costs, ports, fleet, old, kept, harbours, waiting, count, rounds, seed):
    """Improve trips; the best are `kept`. Returns how many cells still wait for one."""
    np.random.seed(seed)
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
        heat = ports.pitch_s * HOT * (COLD / HOT) ** (i / rounds)
        touched[:] = False
        before = count
        count = _ruin(costs, ports, fleet, trip_of, place_of, waiting, count, touched)
        for t in range(trips):
            if touched[t]:
                _clock(costs, ports, fleet, harbours[t], t)
        _sort_waiting(ports, waiting, count, keys)
        count = _recreate(costs, ports, fleet, harbours, trip_of, place_of, waiting, count, touched)
        now = _cost(ports, fleet, count)
        if now >= total - heat * np.log(np.random.random()):
            _take_back(fleet, old, trip_of, place_of, touched)
            count = before
            waiting[:count] = old_waiting[:count]
            continue
        total = now
        old_waiting[:count] = waiting[:count]
        for t in range(trips):
            if touched[t]:
                _copy(fleet, old, t)
                changed[t] = True
        if total < best - 1e-9:
            best, kept_count = total, count
            kept_waiting[:count] = waiting[:count]
            for t in range(trips):
                if changed[t]:
                    _copy(fleet, kept, t)
                    changed[t] = False
    waiting[:] = kept_waiting
    return kept_count
