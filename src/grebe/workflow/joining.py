"""Join a boat's track and a sonde's file by the clock: where the boat was at each reading."""

from __future__ import annotations

from dataclasses import dataclass, replace
from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np

from grebe.core.counts import counted
from grebe.core.errors import TrackError
from grebe.io.readers.track import RawTrack, Readings

if TYPE_CHECKING:
    from numpy.typing import NDArray

    Array = NDArray[np.float64]

# Between fixes farther apart than this [s] the boat's place is unknown.
LONGEST_GAP_S = 15.0
# Clock offsets that are tried if both files measured the same quantity [s].
WIDEST_OFFSET_S = 4 * 3600
# An offset is accepted if both records correlate this well at it, and worse by this lead at all
# offsets more than this far from it [s].
CLEAR_CORRELATION, CLEAR_LEAD, APART_S = 0.9, 0.05, 60
FEWEST_READINGS = 60


@dataclass(frozen=True, kw_only=True)
class ClockOffset:
    """How far the sonde's clock is ahead of the track's [s], and the quantity that showed it."""

    seconds: int
    key: str
    correlation: float


def joined(
    track: RawTrack, sonde: Readings, path: Path, offset_s: float | None = None
) -> tuple[RawTrack, ClockOffset | None]:
    """Return the sonde's readings at the places of the track, and the offset that the data show.

    `offset_s` is how far the sonde's clock is ahead. None takes what both files show if they
    measured the same quantity, and otherwise 0. `TrackError` says why the files cannot be joined.
    """
    if track.times is None or sonde.times is None:
        which = "the track" if track.times is None else str(path)
        raise TrackError(f"{which} has no times, so it cannot be joined by time.")
    if offset_s is not None and not np.isfinite(offset_s):
        raise TrackError(
            f"A clock cannot be {offset_s} s ahead; give a number.", settings=("clock_offset_s",)
        )
    told = clock_offset(track, sonde) if offset_s is None else None
    ahead = told.seconds if told else offset_s or 0.0
    times = sonde.times - ahead
    order = np.argsort(track.times, kind="stable")
    fixes, lonlat = track.times[order], track.lonlat[order]
    there = np.isfinite(times) & (times >= fixes[0]) & (times <= fixes[-1])
    after = np.clip(np.searchsorted(fixes, np.where(there, times, fixes[0])), 1, len(fixes) - 1)
    there &= fixes[after] - fixes[after - 1] <= LONGEST_GAP_S
    if not there.any():
        away = float(np.nanmedian(times) - np.median(fixes))
        raise TrackError(
            f"{path}: none of its readings falls within the track's time; its middle is "
            f"{away / 3600:+.2f} h from the track's. Give the zone of its clock, or the offset.",
            settings=("zone", "clock_offset_s"),
        )
    at = times[there]
    places = np.column_stack([np.interp(at, fixes, lonlat[:, k]) for k in (0, 1)])
    values = {key: column[there] for key, column in sonde.values.items()}
    more = {
        key: _nearest(at, fixes, column[order])
        for key, column in track.values.items()
        if key not in values
    }
    lost = int((~there).sum())
    left_out = counted(lost, "reading")
    notes = (f"{left_out} of {path.name} outside the track's time or in its gaps: left out",)
    return (
        replace(
            track,
            lonlat=places,
            times=at,
            values=values | more,
            columns=track.columns | sonde.columns,
            notes=(*track.notes, *(f"{path.name}: {one}" for one in sonde.notes))
            + (notes if lost else ()),
            unused=(*track.unused, *(f"{path.name}: {one}" for one in sonde.unused)),
        ),
        told,
    )


def clock_offset(track: RawTrack, sonde: Readings) -> ClockOffset | None:
    """Return the offset at which a quantity of both files agrees best; None if it is not clear."""
    if track.times is None or sonde.times is None:
        return None
    best: ClockOffset | None = None
    for key in set(track.values) & set(sonde.values):
        found = _offset_by(key, (track.times, track.values[key]), (sonde.times, sonde.values[key]))
        if found and (best is None or found.correlation > best.correlation):
            best = found
    return best


def _offset_by(
    key: str, ours: tuple[Array, Array], theirs: tuple[Array, Array]
) -> ClockOffset | None:
    one, other = _each_second(*ours), _each_second(*theirs)
    if one is None or other is None or min(len(one[1]), len(other[1])) < FEWEST_READINGS:
        return None
    apart = other[0] - one[0]
    scores = _correlations(one[1], other[1])
    # Entry k compares our second s with their second s + k - (n - 1).
    offsets = apart + np.arange(len(scores)) - (len(one[1]) - 1)
    scores = np.where(np.abs(offsets) <= WIDEST_OFFSET_S, scores, -1.0)
    place = int(np.argmax(scores))
    top = float(scores[place])
    rest = scores[np.abs(offsets - offsets[place]) > APART_S]
    if top < CLEAR_CORRELATION or top < float(rest.max(initial=-1.0)) + CLEAR_LEAD:
        return None
    return ClockOffset(seconds=int(offsets[place]), key=key, correlation=top)


def _each_second(times: Array, values: Array) -> tuple[int, Array] | None:
    """Return the first second and the values at whole seconds (n,), interpolated linearly."""
    there = np.isfinite(times) & np.isfinite(values)
    if there.sum() < 2:
        return None
    at, index = np.unique(times[there], return_index=True)
    grid = np.arange(np.ceil(at[0]), np.floor(at[-1]) + 1)
    return int(grid[0]), np.interp(grid, at, values[there][index])


def _correlations(one: Array, other: Array) -> Array:
    """Return the correlation (n + m - 1,) of two series at all shifts.

    It is -1 where they share less than half of the shorter.
    """
    from scipy.signal import correlate

    one, other = one - one.mean(), other - other.mean()
    ones = np.ones_like(one), np.ones_like(other)

    def at_all_shifts(a: Array, b: Array) -> Array:
        return np.asarray(correlate(b, a, method="fft"), dtype=np.float64)

    count = np.round(at_all_shifts(*ones))
    sums = at_all_shifts(one, ones[1]), at_all_shifts(ones[0], other)
    squares = at_all_shifts(one**2, ones[1]), at_all_shifts(ones[0], other**2)
    enough = count >= max(FEWEST_READINGS, min(len(one), len(other)) / 2)
    size = np.maximum(count, 1)
    covariance = at_all_shifts(one, other) - sums[0] * sums[1] / size
    spread = [part - total**2 / size for part, total in zip(squares, sums, strict=True)]
    scale = np.sqrt(np.maximum(spread[0], 1e-12) * np.maximum(spread[1], 1e-12))
    return np.asarray(np.where(enough, covariance / scale, -1.0), dtype=np.float64)


def _nearest(at: Array, times: Array, values: Array) -> Array:
    after = np.clip(np.searchsorted(times, at), 1, len(times) - 1)
    index = np.where(at - times[after - 1] < times[after] - at, after - 1, after)
    return np.asarray(values[index], dtype=np.float64)
