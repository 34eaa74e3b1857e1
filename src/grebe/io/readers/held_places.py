"""Find places that a receiver repeated while the boat went on.

Without satellites a receiver or logger may repeat its last position. The boat seems to lie still,
and then to be elsewhere at once: the readings between would pile up where none of them was taken.
"""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

if TYPE_CHECKING:
    from numpy.typing import NDArray

# A position that is repeated for less than this is none that the receiver lost [s].
SHORTEST_S = 10.0
# A boat that has lain still goes on with a step no longer than this many usual ones and this much
# more [m]; a receiver that finds its satellites again jumps to where the boat is.
USUAL_STEPS, MARGIN_M = 3.0, 5.0


def held_places(
    places: NDArray[np.float64], times: NDArray[np.float64], fastest_mps: float
) -> NDArray[np.bool_]:
    """Return which rows (n,) repeat the place before while the boat was on its way elsewhere.

    `places` (n, 2) [m] and `times` (n,) [s] are in the order in which they were taken; what follows
    from a time that is NaN is left alone. A jump farther than `fastest_mps` allows since the place
    was new is another fault. The first row of a place is its own, and is never marked.
    """
    held = np.zeros(len(places), dtype=bool)
    new = np.flatnonzero(np.concatenate([[True], np.any(np.diff(places, axis=0) != 0, axis=1)]))
    if len(new) < 3:
        return held
    steps = np.hypot(*np.diff(places[new], axis=0).T)
    paces = np.diff(times[new])
    timed = paces > 0
    if not timed.any():
        return held
    usual = float(np.median(paces[timed])) * float(np.median(steps[timed] / paces[timed]))
    waited = times[new[1:] - 1] - times[new[:-1]]
    lost = waited >= max(SHORTEST_S, USUAL_STEPS * float(np.median(paces[timed])))
    lost &= (steps > USUAL_STEPS * usual + MARGIN_M) & (steps <= fastest_mps * paces)
    for first, end in zip(new[:-1][lost], new[1:][lost], strict=True):
        held[first + 1 : end] = True
    return held
