"""Time stamps as loggers write them, which may be coarser than the interval of the readings."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

if TYPE_CHECKING:
    from numpy.typing import NDArray

    Array = NDArray[np.floating]

# A gap longer than this many usual steps is a pause.
PAUSE_STEPS = 5.0


def spread_times(times: Array) -> Array:
    """Spread equal time stamps so that times ascend strictly: a logger that writes whole seconds,
    or minutes, took its readings within them.
    """
    if len(times) < 2 or np.any(np.diff(times) < 0):
        return times
    stamps, first, size = np.unique(times, return_index=True, return_counts=True)
    if len(stamps) == len(times):
        return times
    usual = float(np.median(np.diff(stamps))) if len(stamps) > 1 else 1.0
    # Readings before a pause are spread over no more than `PAUSE_STEPS` usual steps.
    until = np.minimum(np.append(np.diff(stamps), usual), PAUSE_STEPS * usual)
    place = np.arange(len(times)) - np.repeat(first, size)
    return times + place * np.repeat(until / size, size)


def usual_step_s(times: Array) -> float:
    """The mean interval between readings at times (n,) [s], not counting pauses."""
    steps = np.diff(spread_times(np.sort(times)))
    if not len(steps):
        return 0.0
    return float(np.mean(steps[steps <= PAUSE_STEPS * max(float(np.median(steps)), 1.0)]))
