"""Join the tracks of several outings on one lake, as of a morning and an afternoon."""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from itertools import pairwise
from typing import TYPE_CHECKING

import numpy as np

from grebe.core.errors import TrackError
from grebe.core.frames import LocalFrame
from grebe.io.readers.track import RawTrack

if TYPE_CHECKING:
    from numpy.typing import NDArray

# Tracks that lie farther apart than this are of different waters [m].
FARTHEST_M = 5000.0


def outings_joined(tracks: Sequence[tuple[str, RawTrack]]) -> RawTrack:
    """Return the rows of several named tracks as one, in the order of their times.

    A quantity that one of them lacks is missing (NaN) in its rows. The names are written before the
    notes. Raises `TrackError` if the tracks have no times, overlap in time, or lie far apart.
    """
    if len(tracks) == 1:
        return tracks[0][1]
    for name, track in tracks:
        if track.times is None:
            raise TrackError(f"{name} has no times, so it cannot be joined to other tracks.")
    in_order = sorted(tracks, key=lambda one: float(_times(one[1])[0]))
    for before, after in pairwise(in_order):
        _check_pair(before, after)
    quantities = list(dict.fromkeys(key for _, track in in_order for key in track.values))
    named = {key: _each(track.columns.get(key) for _, track in in_order) for key in quantities}
    return RawTrack(
        lonlat=np.concatenate([track.lonlat for _, track in in_order]),
        times=np.concatenate([_times(track) for _, track in in_order]),
        values={
            key: np.concatenate(
                [track.values.get(key, np.full(len(track.lonlat), np.nan)) for _, track in in_order]
            )
            for key in quantities
        },
        columns={key: " / ".join(columns) for key, columns in named.items()},
        notes=tuple(f"{name}: {note}" for name, track in in_order for note in track.notes),
        unused=_each(column for _, track in in_order for column in track.unused),
    )


def _each(names: Iterable[str | None]) -> tuple[str, ...]:
    """Each name once, in their order."""
    return tuple(dict.fromkeys(name for name in names if name))


def _times(track: RawTrack) -> NDArray[np.float64]:
    assert track.times is not None
    return track.times


def _check_pair(before: tuple[str, RawTrack], after: tuple[str, RawTrack]) -> None:
    """Refuse two tracks, one begun before the other, that are not two outings of one boat."""
    (first, earlier), (second, later) = before, after
    if _times(later)[0] <= _times(earlier)[-1]:
        raise TrackError(
            f"{second} begins before {first} ends, so they are not two outings of one boat; "
            "import each to a survey of its own."
        )
    lon, lat = earlier.lonlat.mean(axis=0).tolist()
    frame = LocalFrame(origin_lon_deg=lon, origin_lat_deg=lat)
    ours, theirs = frame.to_local(earlier.lonlat), frame.to_local(later.lonlat)
    apart = np.maximum(theirs.min(axis=0) - ours.max(axis=0), ours.min(axis=0) - theirs.max(axis=0))
    gap_m = float(np.hypot(*np.maximum(apart, 0.0)))
    if gap_m > FARTHEST_M:
        raise TrackError(
            f"{first} and {second} lie {gap_m / 1000:.0f} km apart, which is not one lake; import "
            "each to a survey of its own."
        )
