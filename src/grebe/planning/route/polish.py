"""Make an order of the cells faster, by 2-opt and Or-opt moves and then by kicks.

Both moves are tried only between a cell and its neighbours (Bentley 1992). A kick exchanges two
short adjacent stretches of the order and repairs the damage nearby. It is undone if the order
became slower (iterated local search; Lourenco, Martin and Stutzle 2003).
"""

# Kernels do not annotate their parameters: numba infers the types when it compiles them.
# pyright: reportMissingParameterType=false

from __future__ import annotations

from typing import TYPE_CHECKING, NamedTuple

import numpy as np

from grebe.core.kernels import inlined_machine_code, machine_code
from grebe.planning.route.costs import Costs, at, join, leg, order_cost, window_cost

if TYPE_CHECKING:
    from numpy.typing import NDArray

LONGEST_SEGMENT = 3
LONGEST_KICK = 30
# Longer stretches are not reversed: the reversal would cost more time than it saves.
LONGEST_REVERSAL = 50_000
LONGEST_WINDY_REVERSAL = 1_000
LEAST_GAIN = 1e-7
# A gain that is summed in another order may differ by this much [s].
ROUNDING_S = 1e-9
MOST_DRAWS = 60


def polished(
    costs: Costs, order: NDArray[np.int64], kicks: int, seed: int = 0
) -> tuple[NDArray[np.int64], float]:
    """Return a faster order of the cells and its cost [s]; `order` itself is not changed."""
    path = np.concatenate([[len(costs.places) - 1], order]).astype(np.int64)
    total = _improve(costs, path, kicks, seed)
    return path[1:].copy(), float(total)


@inlined_machine_code
def _reversal_gain(costs, path, i, j):
    """The seconds saved by reversing path[i..j]."""
    p, a, b, q = at(path, i - 1), path[i], path[j], at(path, j + 1)
    gain = join(costs, p, a) + join(costs, b, q) - join(costs, p, b) - join(costs, a, q)
    if costs.windy:
        for k in range(i, j):
            gain += leg(costs, path[k], path[k + 1]) - leg(costs, path[k + 1], path[k])
    return gain


@machine_code
def _reverse(path, pos, i, j):
    while i < j:
        path[i], path[j] = path[j], path[i]
        pos[path[i]], pos[path[j]] = i, j
        i += 1
        j -= 1


@machine_code
def _moved(path, i, length, k, flipped, out):
    """Write to `out` the stretch of the path that changes when the `length` cells from path[i] move
    to between places k and k + 1. Returns its first place and its size.
    """
    if k < i:
        first, size, m = k + 1, i + length - k - 1, 0
        for s in range(length):
            out[m] = path[i + length - 1 - s] if flipped else path[i + s]
            m += 1
        for s in range(k + 1, i):
            out[m] = path[s]
            m += 1
        return first, size
    first, size, m = i, k - i + 1, 0
    for s in range(i + length, k + 1):
        out[m] = path[s]
        m += 1
    for s in range(length):
        out[m] = path[i + length - 1 - s] if flipped else path[i + s]
        m += 1
    return first, size


@inlined_machine_code
def _move_gain(costs, path, i, length, k, flipped):
    """The seconds saved by moving path[i..i + length - 1] to between places k and k + 1."""
    j = i + length - 1
    p, q = at(path, i - 1), at(path, j + 1)
    c, d = at(path, k), at(path, k + 1)
    # A move past a single cell would change both of that cell's neighbours: a reversal does that.
    if d == p or c == q:
        return -1.0
    first, last = (path[j], path[i]) if flipped else (path[i], path[j])
    old = join(costs, p, path[i]) + join(costs, path[j], q) + join(costs, c, d)
    new = join(costs, p, q) + join(costs, c, first) + join(costs, last, d)
    if flipped and costs.windy:
        for s in range(i, j):
            old += leg(costs, path[s], path[s + 1])
            new += leg(costs, path[s + 1], path[s])
    return old - new


@inlined_machine_code
def _taken_out(costs, path, i, length):
    """The seconds saved by taking out path[i..i + length - 1]."""
    j = i + length - 1
    p, q = at(path, i - 1), at(path, j + 1)
    return join(costs, p, path[i]) + join(costs, path[j], q) - join(costs, p, q)


@inlined_machine_code
def _take_out_each(costs, path, k, saved):
    """Write the seconds saved by taking out each short segment with an end at place k to `saved`:
    at index 2 * length if the segment begins at k, and one further if it ends there.
    """
    for length in range(1, LONGEST_SEGMENT + 1):
        for side in range(2):
            i = k if side == 0 else k - length + 1
            if i >= 1 and i + length <= path.shape[0]:
                saved[2 * length + side] = _taken_out(costs, path, i, length)


@machine_code
def _apply_move(path, pos, i, length, k, flipped, spare):
    first, size = _moved(path, i, length, k, flipped, spare)
    for s in range(size):
        path[first + s] = spare[s]
        pos[spare[s]] = first + s
    return first, first + size - 1


@inlined_machine_code
def _try_reversals(costs, path, places, link_s, own, beside, best, move):
    """Try both reversals that make the cells at two places neighbours."""
    low, high = min(places[0], places[1]), max(places[0], places[1])
    reach = LONGEST_WINDY_REVERSAL if costs.windy else LONGEST_REVERSAL
    for shift in range(2):
        i, j = (low + 1, high) if shift == 0 else (low, high - 1)
        if i < 1 or j - i < 1 or j - i > reach:
            continue
        # The legs behind both cells are replaced, or those before them.
        if not costs.windy and own[1 - shift] + beside[1 - shift] - link_s <= best - ROUNDING_S:
            continue
        gain = _reversal_gain(costs, path, i, j)
        if gain > best:
            best = gain
            move[0], move[1], move[2], move[3], move[4] = 0, i, j, 0, 0
    return best


@inlined_machine_code
def _far_s(costs, path, far, place, after):
    """Seconds between the far end of a segment and the cell behind a place, or before it."""
    if after == 1:
        return join(costs, far, at(path, place + 1))
    return join(costs, path[place - 1], far)


@inlined_machine_code
def _try_moves(costs, path, places, link_s, own, beside, best, move):
    """Try all moves of a short segment with an end at the first of two places to the second."""
    last, pc = path.shape[0] - 1, places[1]
    reach = LONGEST_WINDY_REVERSAL if costs.windy else LONGEST_REVERSAL
    for length in range(1, LONGEST_SEGMENT + 1):
        for side in range(2):
            i = places[0] if side == 0 else places[0] - length + 1
            j = i + length - 1
            if i < 1 or j > last or i <= pc <= j or (length == 1 and side == 1):
                continue
            for after in range(2):
                k = pc if after == 1 else pc - 1
                if k < 0 or i - 1 <= k <= j or abs(k - i) > reach:
                    continue
                # The cell at the first place must end up next to the second: as the segment's first
                # cell behind it, or as its last cell before it.
                flipped = length > 1 and (side == 0) != (after == 1)
                worth = best - ROUNDING_S
                # A segment reversed in wind takes another time itself.
                if not (flipped and costs.windy):
                    most = own[2 * length + side] + beside[after] - link_s
                    if most <= worth:
                        continue
                    far = path[j] if side == 0 else path[i]
                    if most - _far_s(costs, path, far, pc, after) <= worth:
                        continue
                gain = _move_gain(costs, path, i, length, k, flipped)
                if gain > best:
                    best = gain
                    move[0], move[1], move[2], move[3], move[4] = 1, i, length, k, flipped
    return best


@inlined_machine_code
def _best_move(costs, path, pos, a, own, beside, move):
    """Write the move around a cell that saves most to `move`; returns the seconds it saves.

    For most moves the new link alone shows that they save less than the best one so far. The legs
    that it replaces are looked up in `own` (the cell's legs before and behind it, and the savings
    of its segments) and in `beside` (its neighbour's legs).
    """
    best, k = LEAST_GAIN, pos[a]
    own[0], own[1] = join(costs, at(path, k - 1), a), join(costs, a, at(path, k + 1))
    # A new link can replace at most the dearer leg: of two links that save time by replacing two
    # others, one is always cheaper than the one that it replaces.
    at_stake = max(own[0], own[1])
    for s in range(costs.nearest.shape[1]):
        link_s = costs.nearest_s[a, s]
        if link_s + LEAST_GAIN >= at_stake:
            break
        if s == 0:
            _take_out_each(costs, path, k, own)
        c = costs.nearest[a, s]
        if pos[c] < 0:
            continue
        places = (k, pos[c])
        if costs.windy:
            link_s = min(link_s, leg(costs, c, a))
        beside[0] = join(costs, at(path, places[1] - 1), c)
        beside[1] = join(costs, c, at(path, places[1] + 1))
        best = _try_reversals(costs, path, places, link_s, own, beside, best, move)
        best = _try_moves(costs, path, places, link_s, own, beside, best, move)
    return best


class _Queue(NamedTuple):
    """The queue of cells to be looked at: a ring of `cells`, whether each cell is `queued`, and
    `state`, the place of the first in the ring and the number of queued cells.
    """

    cells: NDArray[np.int64]
    queued: NDArray[np.bool_]
    state: NDArray[np.int64]


@machine_code
def _await(queue, path, low, high):
    """Queue the cells at the places from `low` up to, but not including, `high`."""
    for s in range(max(1, low), min(path.shape[0], high)):
        b = path[s]
        if not queue.queued[b]:
            queue.queued[b] = True
            queue.cells[(queue.state[0] + queue.state[1]) % queue.cells.shape[0]] = b
            queue.state[1] += 1


@machine_code
def _next(queue):
    """Take the first cell from the queue."""
    head = queue.state[0]
    a = queue.cells[head]
    queue.state[0] = (head + 1) % queue.cells.shape[0]
    queue.state[1] -= 1
    queue.queued[a] = False
    return a


@machine_code
def _settle(costs, path, pos, queue, spare, touched):
    """Apply improving moves around the queued cells until there is none; returns the gain [s].

    `touched` is extended to the first and the last place of the path that was changed.
    """
    total = 0.0
    move = np.zeros(5, dtype=np.int64)
    own, beside = np.zeros(2 * LONGEST_SEGMENT + 2), np.zeros(2)
    while queue.state[1] > 0:
        a = _next(queue)
        while True:
            best = _best_move(costs, path, pos, a, own, beside, move)
            if best <= LEAST_GAIN:
                break
            if move[0] == 0:
                first, last = move[1], move[2]
                _reverse(path, pos, first, last)
            else:
                first, last = _apply_move(path, pos, move[1], move[2], move[3], move[4] == 1, spare)
            touched[0], touched[1] = min(touched[0], first), max(touched[1], last)
            total += best
            for end in (first, last):
                _await(queue, path, end - 2, end + 3)
    return total


@machine_code
def _dear_place(costs, path, draws):
    """The place with the dearest leg among some drawn at random, where a kick is likely to pay."""
    best, dearest = 0, -1.0
    for _ in range(min(draws, MOST_DRAWS)):
        k = np.random.randint(0, path.shape[0] - 1)
        cost = leg(costs, path[k], path[k + 1])
        if cost > dearest:
            best, dearest = k, cost
    return best


@machine_code
def _kick(path, pos, spare, i, first, second):
    """Exchange path[i..i + first - 1] and the `second` cells behind it."""
    for s in range(second):
        spare[s] = path[i + first + s]
    for s in range(first):
        spare[second + s] = path[i + s]
    for s in range(first + second):
        path[i + s] = spare[s]
        pos[spare[s]] = i + s


@machine_code
def _improve(costs, path, kicks, seed):
    """Improve a path in place; returns its cost [s]."""
    np.random.seed(seed)
    n, places = path.shape[0] - 1, costs.places.shape[0]
    # Cells that are not on the path have no place.
    pos = np.full(places, -1)
    for k in range(n + 1):
        pos[path[k]] = k
    spare = np.empty(n + 1, dtype=np.int64)
    # All of the queue's state is in arrays: a count that begins as a literal 0 would have a type of
    # its own, for which everything below would be compiled a second time.
    queue = _Queue(
        np.empty(n + 1, dtype=np.int64),
        np.zeros(places, dtype=np.bool_),
        np.zeros(2, dtype=np.int64),
    )
    touched = np.array([n, 0])
    _await(queue, path, 1, n + 1)
    _settle(costs, path, pos, queue, spare, touched)
    total = order_cost(costs, path)
    saved = path.copy()
    for _ in range(kicks if n > 8 else 0):
        first = np.random.randint(1, min(LONGEST_KICK, n // 3) + 1)
        second = np.random.randint(1, min(LONGEST_KICK, n // 3) + 1)
        i = _dear_place(costs, path, 1 + n // 40) + 1
        cut = np.random.randint(3)
        i -= 0 if cut == 0 else (first if cut == 1 else first + second)
        i = min(max(i, 1), n - first - second + 1)
        end = i + first + second
        old = window_cost(costs, path, i - 2, end + 1)
        touched[0], touched[1] = i, end - 1
        _kick(path, pos, spare, i, first, second)
        change = old - window_cost(costs, path, i - 2, end + 1)
        for place in (i, i + second, end):
            _await(queue, path, place - 2, place + 2)
        change += _settle(costs, path, pos, queue, spare, touched)
        low, high = touched[0], touched[1]
        if change >= 0.0:
            total -= change
            for s in range(low, high + 1):
                saved[s] = path[s]
        else:
            for s in range(low, high + 1):
                path[s] = saved[s]
                pos[saved[s]] = s
    return total
