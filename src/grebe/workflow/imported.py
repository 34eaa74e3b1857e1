"""A hand-driven track as a survey: its hull the region, its rows the samples (section 6.1)."""

from __future__ import annotations

from datetime import UTC, datetime
from typing import TYPE_CHECKING

import numpy as np

from grebe.core.errors import TrackError
from grebe.core.quantities import QUANTITIES
from grebe.core.samples import Sample, gross_range_flag
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


def samples_of_track(track: RawTrack, survey: Survey) -> list[Sample]:
    """Return each row as a sample; its speed follows from the positions around it.

    Raises `TrackError` when the track has no quantity at all, or no times.
    """
    if not track.values:
        raise TrackError(
            "The track has none of the five quantities; name their columns, for example with "
            "--temperature-column."
        )
    if track.times is None:
        raise TrackError("The track has no column of times; name it with --time-column.")
    positions = survey.frame.to_local(track.lonlat)
    speeds = _speeds(positions, track.times)
    samples: list[Sample] = []
    for i, (north, east) in enumerate(positions.tolist()):
        values = {key: _present(column[i]) for key, column in track.values.items()}
        samples.append(
            Sample(
                time=datetime.fromtimestamp(float(track.times[i]), UTC),
                north_m=north,
                east_m=east,
                target_seq=None,
                speed_mps=_present(speeds[i]),
                values=values,
                flags={q.key: gross_range_flag(values.get(q.key), q.span) for q in QUANTITIES},
            )
        )
    return samples


def _speeds(positions: NDArray[np.float64], times: NDArray[np.float64]) -> NDArray[np.float64]:
    """Speed over ground between the neighbours of each row [m/s]; NaN where time stands."""
    before = np.maximum(np.arange(len(times)) - 1, 0)
    after = np.minimum(np.arange(len(times)) + 1, len(times) - 1)
    seconds = times[after] - times[before]
    way = np.hypot(*(positions[after] - positions[before]).T)
    return np.where(seconds > 0, way / np.where(seconds > 0, seconds, 1.0), np.nan)


def _present(value: float) -> float | None:
    return float(value) if np.isfinite(value) else None
