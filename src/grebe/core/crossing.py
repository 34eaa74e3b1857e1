"""Clip a straight segment to a convex ring, compiled (Cyrus and Beck 1978)."""

from __future__ import annotations

import math
from typing import TYPE_CHECKING

import numpy as np

from grebe.core.kernels import inlined_machine_code

if TYPE_CHECKING:
    from numpy.typing import NDArray


@inlined_machine_code
def crossing(
    ax: float,
    ay: float,
    bx: float,
    by: float,
    ring: NDArray[np.float64],
    first: int,
    last: int,
    drawn_in_m: float,
) -> tuple[float, float]:
    """Fractions of the segment from a to b at which it enters and leaves a convex ring.

    The ring's sides are moved inwards by `drawn_in_m`; enter > leave if the segment misses it. The
    ring is ring[first : last + 1], corners (n, 2) [m], closed and anticlockwise. It is passed by
    its indices because slicing takes longer than the whole function.
    """
    enter, leave = 0.0, 1.0
    for k in range(first, last):
        nx, ny = ring[k + 1, 1] - ring[k, 1], ring[k, 0] - ring[k + 1, 0]
        room = nx * (ring[k, 0] - ax) + ny * (ring[k, 1] - ay)
        if drawn_in_m > 0.0:
            room -= drawn_in_m * math.hypot(nx, ny)
        outwards = nx * (bx - ax) + ny * (by - ay)
        if outwards > 0:
            leave = min(leave, room / outwards)
        elif outwards < 0:
            enter = max(enter, room / outwards)
        elif room < 0:
            return 1.0, 0.0
    return enter, leave
