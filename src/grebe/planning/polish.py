"""Make an order of the cells faster: 2-opt and Or-opt, then kicks that must pay for themselves.

The cost of an order is time: its legs at the ground speed that current and wind leave, and
its turns. Both moves are tried between a cell and its neighbours only (Bentley 1992); a
kick exchanges two short neighbouring stretches of the order, repairs what it broke nearby,
and is taken back unless the order got faster (iterated local search; Lourenco, Martin and
Stutzle 2003).
"""

# Kernels carry no annotations: numba infers their types when it compiles them.
# pyright: basic

from __future__ import annotations

import math
from typing import TYPE_CHECKING, NamedTuple

import numpy as np

from grebe.compiled import compiled
from grebe.planning.network import Network
from grebe.planning.travel import BEARINGS, Travel

if TYPE_CHECKING:
    from numpy.typing import NDArray

# A way between cells that are not linked is led around: longer than straight, with transits.
DETOUR, DETOUR_PITCHES = 1.5, 1.5
# What a gate costs besides its way: it must be hit.
GATE_PITCHES = 0.25
LONGEST_SEGMENT = 3
LONGEST_KICK = 30
# Stretches longer than this are not turned round: their cost would eat what they save.
LONGEST_REVERSAL = 50_000
LONGEST_WINDY_REVERSAL = 1_000
LEAST_GAIN = 1e-7
MOST_DRAWS = 12


class Costs(NamedTuple):
    """What the kernel reads: places (n + 1, 2) with the start as the last, the links and the
    length of each one's way over the straight distance, slowness by bearing, seconds a radian,
    the detour's and a gate's seconds, and whether there and back take different times.
    """

    places: NDArray[np.float64]
    starts: NDArray[np.int64]
    neighbours: NDArray[np.int64]
    is_open: NDArray[np.bool_]
    windings: NDArray[np.float64]
    slowness: NDArray[np.float64]
    turn: float
    detour_s: float
    gate_s: float
    windy: bool
    returns: bool


def costs_of(
    network: Network, travel: Travel, start: tuple[float, float], *, returns: bool
) -> Costs:
    """Gather what the kernel reads."""
    slowness = travel.slowness
    opposite = np.roll(slowness, BEARINGS // 2)
    first = np.repeat(np.arange(len(network)), np.diff(network.starts))
    straight = np.hypot(*(network.centres[network.neighbours] - network.centres[first]).T)
    pitch_s = network.pitch_m * float(slowness.mean())
    return Costs(
        places=np.vstack([network.centres, start]),
        starts=network.starts,
        neighbours=network.neighbours,
        is_open=network.is_open,
        windings=network.ways_m / np.maximum(straight, 1e-9),
        slowness=slowness,
        turn=travel.turn_s_per_rad,
        detour_s=DETOUR_PITCHES * pitch_s,
        gate_s=GATE_PITCHES * pitch_s,
        windy=bool(np.abs(slowness - opposite).max() > 1e-9),
        returns=returns,
    )


def polished(
    costs: Costs, order: NDArray[np.int64], kicks: int, seed: int = 0
) -> tuple[NDArray[np.int64], float]:
    """Return a faster order of the cells and its cost [s]; the order given stays as it is."""
    path = np.concatenate([[len(costs.places) - 1], order]).astype(np.int64)
    total = _improve(costs, path, kicks, seed)
    return path[1:].copy(), float(total)


@compiled
def order_cost(costs, path):
    """Cost [s] of a path that begins at the start (index n)."""
    total = 0.0
    last = path.shape[0] - 1
    for k in range(last):
        total += _leg(costs, path[k], path[k + 1])
        if k > 0:
            total += _turn(costs, path[k - 1], path[k], path[k + 1])
    if costs.returns:
        total += _leg(costs, path[last], path[0])
    return total


@compiled
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


@compiled
def _leg(costs, a, b):
    dx = costs.places[b, 0] - costs.places[a, 0]
    dy = costs.places[b, 1] - costs.places[a, 1]
    seconds = math.sqrt(dx * dx + dy * dy) * _slow(costs, dx, dy)
    n = costs.places.shape[0] - 1
    if n in (a, b):
        return seconds
    for k in range(costs.starts[a], costs.starts[a + 1]):
        if costs.neighbours[k] == b:
            if costs.is_open[k]:
                return seconds
            return costs.windings[k] * seconds + costs.gate_s
    return DETOUR * seconds + costs.detour_s


@compiled
def _turn(costs, a, b, c):
    ax = costs.places[b, 0] - costs.places[a, 0]
    ay = costs.places[b, 1] - costs.places[a, 1]
    bx = costs.places[c, 0] - costs.places[b, 0]
    by = costs.places[c, 1] - costs.places[b, 1]
    return costs.turn * abs(math.atan2(ax * by - ay * bx, ax * bx + ay * by))


@compiled
def _at(path, k):
    """The cell at a place of the path, or -1 beyond its end."""
    return path[k] if 0 <= k < path.shape[0] else -1


@compiled
def _join(costs, a, b):
    """Leg between two cells; the way home where the second lies beyond the path's end."""
    if a < 0:
        return 0.0
    if b < 0:
        return _leg(costs, a, costs.places.shape[0] - 1) if costs.returns else 0.0
    return _leg(costs, a, b)


@compiled
def _bend(costs, a, b, c):
    return _turn(costs, a, b, c) if a >= 0 and b >= 0 and c >= 0 else 0.0


@compiled
def _reversal_gain(costs, path, i, j, best):
    """What turning round path[i..j] saves; where that is less than `best` it need not be exact."""
    pp, p, a, a2 = _at(path, i - 2), _at(path, i - 1), path[i], path[i + 1]
    b2, b, q, qq = path[j - 1], path[j], _at(path, j + 1), _at(path, j + 2)
    old = _join(costs, p, a) + _join(costs, b, q)
    new = _join(costs, p, b) + _join(costs, a, q)
    # Four turns cannot save more than four half-turns.
    if not costs.windy and old - new + 4 * math.pi * costs.turn <= best:
        return -1.0
    old += _bend(costs, pp, p, a) + _bend(costs, p, a, a2)
    old += _bend(costs, b2, b, q) + _bend(costs, b, q, qq)
    new += _bend(costs, pp, p, b) + _bend(costs, p, b, b2)
    new += _bend(costs, a2, a, q) + _bend(costs, a, q, qq)
    gain = old - new
    if costs.windy:
        for k in range(i, j):
            gain += _leg(costs, path[k], path[k + 1]) - _leg(costs, path[k + 1], path[k])
    return gain


@compiled
def _reverse(path, pos, i, j):
    while i < j:
        path[i], path[j] = path[j], path[i]
        pos[path[i]], pos[path[j]] = i, j
        i += 1
        j -= 1


@compiled
def _moved(path, i, length, k, flipped, out):
    """Write to `out` the stretch of the path that changes when path[i..] of `length` moves
    to between places k and k + 1; returns its first place and its size.
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


@compiled
def _move_gain(costs, path, i, length, k, flipped, best):
    """What moving path[i..i + length - 1] to between k and k + 1 saves; where that is less than
    `best` it need not be exact.
    """
    j = i + length - 1
    ends = (path[j], path[i]) if flipped else (path[i], path[j])
    pp, p, q, qq = _at(path, i - 2), _at(path, i - 1), _at(path, j + 1), _at(path, j + 2)
    cc, c, d, dd = _at(path, k - 1), _at(path, k), _at(path, k + 1), _at(path, k + 2)
    # Into the gap beside the next cell would change both its neighbours: a reversal does that.
    if d == p or c == q:
        return -1.0
    first_in, last_in = path[i], path[j]
    inner_a = _at(path, i + 1) if length > 1 else q
    inner_b = _at(path, j - 1) if length > 1 else p
    e, f = ends
    old = _join(costs, p, first_in) + _join(costs, last_in, q) + _join(costs, c, d)
    new = _join(costs, p, q) + _join(costs, c, e) + _join(costs, f, d)
    if not costs.windy and old - new + 6 * math.pi * costs.turn <= best:
        return -1.0
    old += _bend(costs, _at(path, i - 2), p, first_in) + _bend(costs, p, first_in, inner_a)
    old += _bend(costs, last_in, q, _at(path, j + 2))
    if length > 1:
        old += _bend(costs, inner_b, last_in, q)
    old += _bend(costs, _at(path, k - 1), c, d) + _bend(costs, c, d, _at(path, k + 2))
    new += _bend(costs, pp, p, q) + _bend(costs, p, q, qq)
    new += _bend(costs, cc, c, e) + _bend(costs, f, d, dd)
    if length == 1:
        new += _bend(costs, c, e, d)
    else:
        e2 = inner_b if flipped else inner_a
        f2 = inner_a if flipped else inner_b
        new += _bend(costs, c, e, e2) + _bend(costs, f2, f, d)
        if flipped and costs.windy:
            for s in range(i, j):
                old += _leg(costs, path[s], path[s + 1])
                new += _leg(costs, path[s + 1], path[s])
    return old - new


@compiled
def _at_stake(costs, path, k):
    """The most that a new link of the cell at place k could replace: its dearer leg with the
    turns beside it. Of two links that replace two others one is always cheaper than its own.
    """
    pp, p, a = _at(path, k - 2), _at(path, k - 1), path[k]
    q, qq = _at(path, k + 1), _at(path, k + 2)
    bend = _bend(costs, p, a, q)
    before = _join(costs, p, a) + _bend(costs, pp, p, a)
    after = _join(costs, a, q) + _bend(costs, a, q, qq)
    return bend + max(before, after)


@compiled
def _apply_move(path, pos, i, length, k, flipped, spare):
    first, size = _moved(path, i, length, k, flipped, spare)
    for s in range(size):
        path[first + s] = spare[s]
        pos[spare[s]] = first + s
    return first, first + size - 1


@compiled
def _try_reversals(costs, path, pos, a, c, reach, best, move):
    """Both ways to make a and c neighbours by turning a stretch round."""
    low, high = min(pos[a], pos[c]), max(pos[a], pos[c])
    for shift in range(2):
        i, j = (low + 1, high) if shift == 0 else (low, high - 1)
        if i < 1 or j - i < 1 or j - i > reach:
            continue
        gain = _reversal_gain(costs, path, i, j, best)
        if gain > best:
            best = gain
            move[0], move[1], move[2], move[3], move[4] = 0, i, j, 0, 0
    return best


@compiled
def _try_moves(costs, path, pos, a, c, reach, best, move):
    """All ways to bring a short segment that ends at a beside c."""
    last = path.shape[0] - 1
    pc = pos[c]
    for length in range(1, LONGEST_SEGMENT + 1):
        for side in range(2):
            i = pos[a] if side == 0 else pos[a] - length + 1
            j = i + length - 1
            if i < 1 or j > last or i <= pc <= j or (length == 1 and side == 1):
                continue
            for after in range(2):
                k = pc if after == 1 else pc - 1
                if k < 0 or i - 1 <= k <= j or abs(k - i) > reach:
                    continue
                # a must come to lie beside c: first behind it, or last before it.
                flipped = (side == 0) != (after == 1)
                if length == 1 and flipped:
                    flipped = False
                gain = _move_gain(costs, path, i, length, k, flipped, best)
                if gain > best:
                    best = gain
                    move[0], move[1], move[2], move[3], move[4] = 1, i, length, k, flipped
    return best


@compiled
def _settle(costs, path, pos, queue, queued, head, count, spare, touched):
    """Apply improving moves around the queued cells until there is none; returns the gain.

    `touched` keeps the first and the last place of the path that was changed.
    """
    total = 0.0
    size = queue.shape[0]
    move = np.zeros(5, dtype=np.int64)
    reach = LONGEST_WINDY_REVERSAL if costs.windy else LONGEST_REVERSAL
    while count > 0:
        a = queue[head]
        head = (head + 1) % size
        count -= 1
        queued[a] = False
        while True:
            best = LEAST_GAIN
            at_stake = _at_stake(costs, path, pos[a])
            for s in range(costs.starts[a], costs.starts[a + 1]):
                c = costs.neighbours[s]
                if pos[c] < 0 or _leg(costs, a, c) + LEAST_GAIN >= at_stake:
                    continue
                best = _try_reversals(costs, path, pos, a, c, reach, best, move)
                best = _try_moves(costs, path, pos, a, c, reach, best, move)
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
                for s in range(max(1, end - 2), min(path.shape[0], end + 3)):
                    b = path[s]
                    if not queued[b]:
                        queued[b] = True
                        queue[(head + count) % size] = b
                        count += 1
    return total


@compiled
def _dear_place(costs, path, draws):
    """The place with the dearest leg and turn of so many drawn at random: kicks pay there."""
    best, dearest = 0, -1.0
    for _ in range(min(draws, MOST_DRAWS)):
        k = np.random.randint(0, path.shape[0] - 1)
        cost = _leg(costs, path[k], path[k + 1]) + _bend(
            costs, _at(path, k - 1), path[k], path[k + 1]
        )
        if cost > dearest:
            best, dearest = k, cost
    return best


@compiled
def _kick(path, pos, spare, i, first, second):
    """Exchange path[i..i + first - 1] and the `second` cells behind it."""
    for s in range(second):
        spare[s] = path[i + first + s]
    for s in range(first):
        spare[second + s] = path[i + s]
    for s in range(first + second):
        path[i + s] = spare[s]
        pos[spare[s]] = i + s


@compiled
def _improve(costs, path, kicks, seed):
    """Improve a path in place; returns its cost."""
    np.random.seed(seed)
    n, places = path.shape[0] - 1, costs.places.shape[0]
    # Cells that are not on the path, but beside it, have no place.
    pos = np.full(places, -1)
    for k in range(n + 1):
        pos[path[k]] = k
    spare = np.empty(n + 1, dtype=np.int64)
    queue, queued = np.empty(n + 1, dtype=np.int64), np.zeros(places, dtype=np.bool_)
    touched = np.array([n, 0])
    for k in range(1, n + 1):
        queue[k - 1] = path[k]
        queued[path[k]] = True
    _settle(costs, path, pos, queue, queued, 0, n, spare, touched)
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
        old = _window_cost(costs, path, i - 2, end + 1)
        touched[0], touched[1] = i, end - 1
        _kick(path, pos, spare, i, first, second)
        change = old - _window_cost(costs, path, i - 2, end + 1)
        count = 0
        for place in (i, i + second, end):
            for s in range(max(1, place - 2), min(n + 1, place + 2)):
                b = path[s]
                if not queued[b]:
                    queued[b] = True
                    queue[count] = b
                    count += 1
        change += _settle(costs, path, pos, queue, queued, 0, count, spare, touched)
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


@compiled
def _window_cost(costs, path, low, high):
    """Cost of the legs between two places and of the turns strictly within."""
    low, last = max(low, 0), path.shape[0] - 1
    total = 0.0
    for k in range(low, min(high, last)):
        total += _leg(costs, path[k], path[k + 1])
        if k > low:
            total += _turn(costs, path[k - 1], path[k], path[k + 1])
    if high > last and costs.returns:
        total += _leg(costs, path[last], path[0])
    return total
