"""Excursions: stretches of readings that are not the water's, such as a dropout to zero, an echo
from below the bed, or a loose plug.

A spike is recognised by its neighbours. A stretch has neighbours of its own kind. It is recognised
only by the jumps on either side and by the return of the readings to where they were.
"""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

if TYPE_CHECKING:
    from numpy.typing import NDArray

    Array = NDArray[np.floating]
    Mask = NDArray[np.bool_]

# If readings return later than this, they were no excursion but different water [s].
LONGEST_S = 600.0


def excursions(values: Array, times: Array, jumps: Mask, step: float) -> Mask:
    """Which readings (n,) are on an excursion: between `jumps` (n,), and more than `step` away from
    the stretches before and after, which agree. At an end of the record, the longer of two
    stretches is believed.
    """
    found = np.zeros(len(values), dtype=bool)
    runs = _runs(jumps)
    believed = _first_believed(values, times, runs, step)
    for k in range(believed):
        found[slice(*runs[k])] = True
    k = believed
    while k + 1 < len(runs):
        here = runs[k]
        back = _back(values, times, runs, k, step)
        for away in runs[k + 1 : back]:
            found[slice(*away)] = True
        # Readings between the stretches of an excursion belong to it.
        if back > k + 1:
            found[here[1] : runs[back][0] if back < len(runs) else len(values)] = True
        k = back
    return found


def _runs(jumps: Mask) -> list[tuple[int, int]]:
    """The stretches without a jump, as (first, end)."""
    edges = np.flatnonzero(np.diff(np.concatenate([[0], (~jumps).astype(int), [0]])))
    return list(zip(edges[::2].tolist(), edges[1::2].tolist(), strict=True))


def _first_believed(values: Array, times: Array, runs: list[tuple[int, int]], step: float) -> int:
    """The index of the stretch with which the record begins: the first, or the second if the first
    is brief, has fewer readings than the second, and is more than `step` away from it.
    """
    if len(runs) < 2:
        return 0
    (first, end), (then, until) = runs[:2]
    elsewhere = abs(values[end - 1] - values[then]) > step
    is_short = times[end - 1] - times[first] <= LONGEST_S and end - first < until - then
    return int(elsewhere and is_short)


def _back(values: Array, times: Array, runs: list[tuple[int, int]], k: int, step: float) -> int:
    """The stretch with which the record continues after stretch k, skipping excursions; the next
    one if none returns in time.
    """
    end = runs[k][1]
    level, left = values[end - 1], times[end - 1]
    for j in range(k + 1, len(runs)):
        if times[runs[j][0]] - left > LONGEST_S:
            break
        if abs(values[runs[j][0]] - level) <= step:
            return j
    else:
        # The record ends on an excursion.
        if times[-1] - left <= LONGEST_S and len(values) - end < end:
            return len(runs)
    return k + 1
