"""Stretches of readings that are somewhere else altogether: a dropout to zero, an echo from below
the bed, a loose plug.

A spike's neighbours tell that it is one. A stretch has neighbours of its own kind, and only the
jumps on either side of it, and that the readings come back to where they were, tell what it is.
"""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

if TYPE_CHECKING:
    from numpy.typing import NDArray

    Array = NDArray[np.floating]
    Mask = NDArray[np.bool_]

# Readings that come back later than this have not been away: the water is another one [s].
LONGEST_S = 600.0


def excursions(values: Array, times: Array, jumps: Mask, step: float) -> Mask:
    """Which readings (n,) are on an excursion: between `jumps` (n,), more than `step` away from the
    stretches before and after, which agree. At an end of the record the longer stretch is believed.
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
        # What lies between an excursion's stretches is on the way there.
        if back > k + 1:
            found[here[1] : runs[back][0] if back < len(runs) else len(values)] = True
        k = back
    return found


def _runs(jumps: Mask) -> list[tuple[int, int]]:
    """The stretches without a jump, (first, end)."""
    edges = np.flatnonzero(np.diff(np.concatenate([[0], (~jumps).astype(int), [0]])))
    return list(zip(edges[::2].tolist(), edges[1::2].tolist(), strict=True))


def _first_believed(values: Array, times: Array, runs: list[tuple[int, int]], step: float) -> int:
    """The number of the stretch with which a record begins: the first, or the second where the
    first is short, shorter than it, and elsewhere.
    """
    if len(runs) < 2:
        return 0
    (first, end), (then, until) = runs[:2]
    elsewhere = abs(values[end - 1] - values[then]) > step
    is_short = times[end - 1] - times[first] <= LONGEST_S and end - first < until - then
    return int(elsewhere and is_short)


def _back(values: Array, times: Array, runs: list[tuple[int, int]], k: int, step: float) -> int:
    """The stretch with which the record goes on after stretch k, in place of those that are
    elsewhere; the next one where none comes back in time.
    """
    end = runs[k][1]
    level, left = values[end - 1], times[end - 1]
    for j in range(k + 1, len(runs)):
        if times[runs[j][0]] - left > LONGEST_S:
            break
        if abs(values[runs[j][0]] - level) <= step:
            return j
    else:
        # The record ends elsewhere.
        if times[-1] - left <= LONGEST_S and len(values) - end < end:
            return len(runs)
    return k + 1
