"""A hand-driven track as a survey: its hull the region, its rows the samples (section 6.1)."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from grebe.core.errors import TrackError
from grebe.core.quantities import BUILTIN, Quantities
from grebe.core.samples import Samples
from grebe.core.sets import hull_of
from grebe.core.survey import Survey
from grebe.io.readers.track import RawTrack
from grebe.planning.region import clean_region

if TYPE_CHECKING:
    from numpy.typing import NDArray


def survey_of_track(track: RawTrack, name: str) -> Survey:
    """Return the survey without targets whose region is the track's convex hull."""
    region = clean_region(hull_of(track.lonlat), name)
    return Survey(name=region.name, frame=region.frame, water=region.water)


def samples_of_track(
    track: RawTrack, survey: Survey, quantities: Quantities = BUILTIN
) -> Samples:
    """Return the rows as samples, flagged by their gross range; speeds follow from the positions.

    Raises `TrackError` when the track has no quantity at all, or no times.
    """
    if not track.values:
        raise TrackError(
            "The track has no column of a quantity that is known; name one, as column KEY=NAME, "
            f"with a key of {quantities.keys_text}; or define a new quantity."
        )
    if track.times is None:
        raise TrackError("The track has no column of times; name it, as column time=NAME.")
    positions = survey.frame.to_local(track.lonlat)
    return Samples.of(
        times=track.times,
        positions=positions,
        values=track.values,
        quantities=quantities,
        speed_mps=_speeds(positions, track.times),
    )


def _speeds(positions: NDArray[np.float64], times: NDArray[np.float64]) -> NDArray[np.float64]:
    """Speed over ground between the neighbours of each row [m/s]; NaN where time stands."""
    before = np.maximum(np.arange(len(times)) - 1, 0)
    after = np.minimum(np.arange(len(times)) + 1, len(times) - 1)
    seconds = times[after] - times[before]
    way = np.hypot(*(positions[after] - positions[before]).T)
    return np.where(seconds > 0, way / np.where(seconds > 0, seconds, 1.0), np.nan)
