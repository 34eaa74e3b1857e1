"""Bubbles in a conductivity cell, distinguished from water by the other sensors.

A bubble displaces water in the field between the electrodes. It lowers the conductivity at once,
keeps it low for seconds to minutes, and leaves at once. Water of lower conductivity is different
water: it comes with another temperature, oxygen or pH, over the metres that mixing takes, or it
stays.
"""

from __future__ import annotations

from collections.abc import Sequence
from typing import TYPE_CHECKING

import numpy as np

if TYPE_CHECKING:
    from numpy.typing import NDArray

    Array = NDArray[np.floating]
    Mask = NDArray[np.bool_]

# A fall or rise is the difference of means over this many seconds before and after an instant.
EDGE_S = 4.0
# It is a bubble's if it exceeds this share of the value and this many times the usual change.
LEAST_SHARE, CLEAR_TIMES = 0.025, 8.0
# Another sensor changes with it if its change exceeds this many times its own usual change.
COMPANION_TIMES = 6.0
# A bubble is gone after this time [s]; a value that stays lower is water.
LONGEST_S = 900.0
# The value is back when less than this part of the fall is left.
BACK_SHARE = 0.4
FEWEST_SAMPLES = 60


def bubbles(conductivity: Array, others: Sequence[Array], times: Array) -> Mask:
    """Which readings (n,) of a conductivity were taken with a bubble in the cell.

    `others` (n,) each: sensors of the same sonde that a bubble in that cell does not affect; if
    there are none, no bubble is found. `times` (n,) [s] must ascend.
    """
    found = np.zeros(len(times), dtype=bool)
    there = np.isfinite(conductivity) & (conductivity > 0)
    if there.sum() < FEWEST_SAMPLES or not np.all(np.diff(times) >= 0):
        return found
    index = np.flatnonzero(there)
    t, level = times[there], np.log(conductivity[there])
    beside = [one[there] for one in others if np.isfinite(one[there]).mean() > 0.5]
    if not beside:
        return found
    for backward in (False, True):
        clock = t[-1] - t[::-1] if backward else t
        values = level[::-1] if backward else level
        rest = [one[::-1] if backward else one for one in beside]
        low = _after_falls(clock, values, rest)
        found[index[::-1][low] if backward else index[low]] = True
    return found


def _after_falls(t: Array, level: Array, others: Sequence[Array]) -> Mask:
    """Readings between a sudden fall that no other sensor shares and the return to the level."""
    change = _change(t, level)
    least = max(LEAST_SHARE, CLEAR_TIMES * _usual(change))
    shared = np.zeros(len(t), dtype=bool)
    for one in others:
        its = _change(t, one)
        usual = _usual(its)
        if usual > 0:
            shared |= np.abs(its) > COMPANION_TIMES * usual
    low = np.zeros(len(t), dtype=bool)
    place, falls = 0, np.flatnonzero(-change > least)
    for first in falls:
        if first < place:
            continue
        # The steepest reading of the edge is the fall itself.
        end = int(np.searchsorted(t, t[first] + 2 * EDGE_S))
        steepest = first + int(np.argmin(change[first : max(end, first + 1)]))
        around = slice(*np.searchsorted(t, (t[steepest] - EDGE_S, t[steepest] + EDGE_S)))
        back = _back(t, level, int(steepest))
        place = steepest + 1
        if back is None or shared[around].any():
            continue
        steps = np.diff(level[max(first - 1, 0) : steepest + 2])
        low[max(first - 1, 0) + 1 + int(np.argmin(steps)) : back] = True
        place = back
    return low


def _change(t: Array, values: Array) -> Array:
    """Mean over `EDGE_S` from each reading on, minus the mean before it (n,); 0 at gaps."""
    there = np.isfinite(values)
    total = np.concatenate([[0.0], np.cumsum(np.where(there, values - values[there].mean(), 0.0))])
    count = np.concatenate([[0], np.cumsum(there)])
    here = np.arange(len(t))
    before = np.searchsorted(t, t - EDGE_S)
    after = np.searchsorted(t, t + EDGE_S, side="right")
    sizes = count[here] - count[before], count[after] - count[here]
    means = [
        (total[end] - total[start]) / np.maximum(size, 1)
        for start, end, size in ((before, here, sizes[0]), (here, after, sizes[1]))
    ]
    return np.where((sizes[0] >= 2) & (sizes[1] >= 2), means[1] - means[0], 0.0)


def _usual(change: Array) -> float:
    """The standard deviation of changes, from their median, so that edges do not count."""
    return 1.4826 * float(np.median(np.abs(change)))


def _back(t: Array, level: Array, fall: int) -> int | None:
    """The first reading back at the level before the fall; None if it does not return."""
    start, end = np.searchsorted(t, (t[fall] - 5 * EDGE_S, t[fall] + LONGEST_S))
    if fall - start < 3:
        return None
    before = float(np.median(level[start:fall]))
    soon = level[fall + 1 : fall + 1 + max(int(np.searchsorted(t, t[fall] + EDGE_S)) - fall, 2)]
    depth = before - float(np.median(soon)) if len(soon) else 0.0
    if depth < LEAST_SHARE:
        return None
    returned = np.flatnonzero(level[fall + 1 : end] > before - BACK_SHARE * depth)
    # Two readings in a row: one may be noise.
    for one in returned:
        at = fall + 1 + int(one)
        if at + 1 >= len(level) or level[at + 1] > before - BACK_SHARE * depth:
            return at
    return None
