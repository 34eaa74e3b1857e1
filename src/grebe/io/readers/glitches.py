"""Find the rows of a track whose position is missing, impossible, repeated or a jump away."""

from __future__ import annotations

from collections.abc import Sequence
from typing import TYPE_CHECKING

import numpy as np

from grebe.core.counts import counted
from grebe.io.readers.held_places import held_places

if TYPE_CHECKING:
    from numpy.typing import NDArray

# Faster than any survey boat: a step that needs more than this speed is a glitch of the GPS.
JUMP_SPEED_MPS = 10.0
# Without times, a step this many times the median step is a jump.
JUMP_FACTOR = 50.0
# A row with swapped latitude and longitude is this close to the others once they are put right.
NEAR_DEG = 0.5


def find_glitches(
    lonlat: NDArray[np.float64], times: NDArray[np.float64] | None, order: NDArray[np.intp]
) -> tuple[NDArray[np.bool_], list[str]]:
    """Mark the rows to keep and count what is wrong with the others.

    `order` (n,) are their places in the file.
    """
    finite = np.isfinite(lonlat).all(axis=1)
    zero = finite & (np.abs(lonlat) < 1e-9).all(axis=1)
    off_earth = finite & ((np.abs(lonlat[:, 0]) > 180) | (np.abs(lonlat[:, 1]) > 90))
    keep = finite & ~zero & ~off_earth
    held = _held(lonlat, times, keep)
    keep &= ~held
    jumps = _find_jumps(lonlat, times, keep)
    keep[jumps] = False
    untimed = np.zeros(len(keep), dtype=bool) if times is None else keep & ~np.isfinite(times)
    keep &= ~untimed
    where = _jump_text(jumps, lonlat, order, keep)
    first = f" (from row {order[np.argmax(held)] + 1} of the values on)"
    counts = {
        "without a position": int((~finite).sum()),
        "at 0, 0": int(zero.sum()),
        "off the Earth": int(off_earth.sum()),
        f"at a place that was repeated while the boat went on{first}": int(held.sum()),
        f"a jump away from the neighbours{where}": len(jumps),
        "without a time": int(untimed.sum()),
    }
    return keep, [
        f"{counted(count, 'row')} {what}: left out" for what, count in counts.items() if count
    ]


def _held(
    lonlat: NDArray[np.float64], times: NDArray[np.float64] | None, keep: NDArray[np.bool_]
) -> NDArray[np.bool_]:
    """Return which of the kept rows (n,) hold the place before while the boat was elsewhere."""
    held = np.zeros(len(keep), dtype=bool)
    if times is not None and keep.any():
        held[keep] = held_places(_metres(lonlat[keep]), times[keep], JUMP_SPEED_MPS)
    return held


def _metres(lonlat: NDArray[np.float64]) -> NDArray[np.float64]:
    """Return places in metres, true to scale near the middle of the track."""
    return lonlat * np.array([np.cos(np.radians(np.median(lonlat[:, 1]))), 1.0]) * 111_320.0


def _jump_text(
    jumps: Sequence[int],
    lonlat: NDArray[np.float64],
    order: NDArray[np.intp],
    keep: NDArray[np.bool_],
) -> str:
    """Return where the first jump is and what to do, by the number of its row of values."""
    if not jumps:
        return ""
    lon, lat = lonlat[jumps[0]].tolist()
    middle = np.median(lonlat[keep], axis=0)
    away, put_right = lonlat[jumps] - middle, lonlat[jumps][:, ::-1] - middle
    swapped = (np.abs(put_right).max(axis=1) < NEAR_DEG) & (np.abs(away).max(axis=1) > NEAR_DEG)
    if swapped.all():
        return (
            f" (from row {order[jumps[0]] + 1} of the values on, at {lat:g} N {lon:g} E: latitude "
            "and longitude look swapped there)"
        )
    return (
        f" (first row {order[jumps[0]] + 1} of the values, at {lat:g} N {lon:g} E; if the boat was "
        "there, give a file for each stretch)"
    )


def _find_jumps(
    lonlat: NDArray[np.float64], times: NDArray[np.float64] | None, keep: NDArray[np.bool_]
) -> list[int]:
    """Return the indices of kept rows that no boat could have reached from the last good row.

    A row is compared with the last good one. The first is compared with the median position, so
    that a glitch at the start does not condemn all rows after it.
    """
    index = np.flatnonzero(keep)
    if len(index) < 3:
        return []
    places = _metres(lonlat[index])
    steps = np.hypot(*np.diff(places, axis=0).T)
    reach = JUMP_FACTOR * max(float(np.median(steps)), 0.2)
    middle = np.median(places, axis=0)
    spread = np.hypot(*(places - middle).T)
    good = int(np.flatnonzero(spread <= 10 * np.median(spread) + reach)[0])
    jumps = [int(i) for i in index[:good]]
    # If a step from the row before is possible, that row is the last good one. Only the others are
    # checked one by one.
    waited = np.full(len(steps), np.nan) if times is None else np.diff(times[index])
    doubtful = np.flatnonzero(steps > _allowed(waited, reach)) + 1
    k = good + 1
    while True:
        ahead = doubtful[np.searchsorted(doubtful, k) :]
        if not len(ahead):
            return jumps
        k = int(ahead[0])
        good = k - 1
        while k < len(index):
            gap = np.hypot(*(places[k] - places[good]))
            since = np.nan if times is None else times[index[k]] - times[index[good]]
            if gap <= _allowed(since, reach):
                break
            jumps.append(int(index[k]))
            k += 1
        k += 1


def _allowed(waited: NDArray[np.float64] | float, reach: float) -> NDArray[np.float64]:
    """Return how far a boat can have come in a time [s], NaN for unknown."""
    far = JUMP_SPEED_MPS * np.fmax(waited, 1.0) + 5.0
    return np.where(np.isfinite(waited), far, reach)
