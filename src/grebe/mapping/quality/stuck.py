"""Readings that a sonde or its logger repeated: all sensors stand still while the boat goes on.

One sensor may well show the same number for a while in even water. That several do at once, each
with digits that its noise would move, is no property of water.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from typing import TYPE_CHECKING

import numpy as np

if TYPE_CHECKING:
    from numpy.typing import NDArray

    Array = NDArray[np.floating]
    Mask = NDArray[np.bool_]

# Shorter repetitions are common, as of a logger that is quicker than its sonde [s]. Readings that
# are repeated at one place are harmless [m].
SHORTEST_S, LEAST_WAY_M = 30.0, 10.0
# A repetition must be longer than one that chance would bring about in one of this many records.
RECORDS = 1000.0
FEWEST_SENSORS = 2


def stuck(sensors: Sequence[Array], times: Array, positions: Array) -> Mask:
    """Return which readings (n,) repeat the one before, of all sensors and for too long.

    `sensors` (n,) each are those whose record is fine enough to move with their noise; NaN repeats
    NaN. `times` (n,) [s] must ascend; `positions` (n, 2) [m]. The first of equal readings counts as
    measured. With fewer than two sensors nothing is found.
    """
    found = np.zeros(len(times), dtype=bool)
    telling = [one for one in sensors if len(np.unique(one[np.isfinite(one)])) > 1]
    if len(telling) < FEWEST_SENSORS or not np.all(np.diff(times) >= 0):
        return found
    rows = np.column_stack(telling)
    before, after = rows[:-1], rows[1:]
    same = ((before == after) | (np.isnan(before) & np.isnan(after))).all(axis=1)
    same &= np.isfinite(after).sum(axis=1) >= FEWEST_SENSORS
    edges = np.flatnonzero(np.diff(np.concatenate([[0], same.astype(int), [0]])))
    runs = [
        (first, last)
        for first, last in zip(edges[::2], edges[1::2], strict=True)
        if times[last] - times[first] >= SHORTEST_S
        and _way(positions[first : last + 1]) >= LEAST_WAY_M
    ]
    longest = _longest_by_chance(same, runs)
    for first, last in runs:
        if last - first > longest:
            found[first + 1 : last + 1] = True
    return found


def _way(positions: Array) -> float:
    """Return how far the boat got from where it was at first [m]."""
    return float(np.max(np.hypot(*(positions - positions[0]).T)))


def _longest_by_chance(same: Mask, runs: Sequence[tuple[int, int]]) -> float:
    """Return the number of repetitions in a row that chance explains, by how common they are
    outside the long ones.
    """
    usual = np.ones(len(same), dtype=bool)
    for first, last in runs:
        usual[first:last] = False
    share = (np.sum(same[usual]) + 1.0) / (usual.sum() + 2.0)
    return math.log(RECORDS * len(same)) / -math.log(share)
