"""A hand-driven track as a survey: its hull is the region, its rows the samples (section 6.1)."""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np

from grebe.core.errors import PlanError, TrackError
from grebe.core.quantities import BUILTIN, Quantities
from grebe.core.samples import Flag, Samples
from grebe.core.sets import hull_of
from grebe.core.survey import OF_TRACK, Survey
from grebe.io.readers.columns import DATE, PLACE_AND_TIME
from grebe.io.readers.profile import read_profile
from grebe.io.readers.quantities import user_quantities
from grebe.io.readers.track import RawTrack, TrackColumns, read_readings, read_track
from grebe.io.readers.zones import zone_of
from grebe.io.store import SurveyFile
from grebe.io.store.database import new_file
from grebe.mapping.quality.control import Quality
from grebe.planning.region import clean_region
from grebe.workflow.files import write_survey
from grebe.workflow.joining import ClockOffset, joined
from grebe.workflow.quality import check_samples

if TYPE_CHECKING:
    from numpy.typing import NDArray


@dataclass(frozen=True, kw_only=True)
class ImportedTrack:
    """The result of an import: the survey, its quantities, their columns, and their flags."""

    survey: Survey
    raw: RawTrack
    quantities: Quantities
    quality: Quality
    samples: int
    offset: ClockOffset | None = None

    @property
    def without_good(self) -> list[str]:
        """Quantities without a good value: all are missing, text, or flagged."""
        return [key for key in self.raw.values if not (self.quality.flags[key] == Flag.GOOD).any()]


def import_track(
    track: Path,
    to: Path,
    *,
    columns: TrackColumns | None = None,
    header_from: Path | None = None,
    quantities_file: Path | None = None,
    force: bool = False,
    sonde: Path | None = None,
    zone: str | None = None,
    profile: str | None = None,
    clock_offset_s: float | None = None,
) -> ImportedTrack:
    """Turn a track into a survey file with its samples, checked.

    `sonde` is a file of readings without positions. It is joined by its clock, which is
    `clock_offset_s` ahead of the track's (None for what the data show). `zone` is the time zone of
    times in either file that name none. `profile` describes the logger's file, the sonde's if there
    is one.

    The file declares the quantities that the track has, among those that Grebe knows and those of
    `quantities_file` (or of a `quantities.toml` beside the survey).
    """
    known = BUILTIN.extended(user_quantities(quantities_file, to))
    told = None
    clock = None if zone is None else zone_of(zone)
    form = None if profile is None else read_profile(profile)
    if sonde is None:
        raw = read_track(track, columns, header_from, known, zone=clock, profile=form)
    else:
        ours, theirs = _shared(columns or {})
        raw = read_track(track, ours, header_from, known, zone=clock)
        readings = read_readings(sonde, theirs, None, known, zone=clock, profile=form, placed=False)
        raw, told = joined(raw, readings, sonde, clock_offset_s)
    survey = survey_of_track(raw, track.stem)
    samples = samples_of_track(raw, survey, known)
    held = known.subset(raw.values)
    with new_file(to, force=force) as part:
        write_survey(part, survey, quantities=held, note=f"Imported from {track.name}.")
        with SurveyFile.open(part) as file:
            file.extend_samples(samples)
            file.set_meta("water", f"measured, {track.name}")
            file.set_meta("outline", OF_TRACK)
            quality = check_samples(file)
    return ImportedTrack(
        survey=survey, raw=raw, quantities=held, quality=quality, samples=len(samples), offset=told
    )


def _shared(columns: TrackColumns) -> tuple[TrackColumns, TrackColumns]:
    """Split given columns into those of place and time, and those of quantities.

    The former are the track's, the latter the sonde's.
    """
    placed = {key: name for key, name in columns.items() if key in {DATE, *PLACE_AND_TIME}}
    return placed, {key: name for key, name in columns.items() if key not in placed}


def survey_of_track(track: RawTrack, name: str) -> Survey:
    """Return the survey without targets whose region is the track's convex hull.

    Raises `TrackError` for a track that stands still or runs along one line.
    """
    try:
        hull = hull_of(track.lonlat)
    except PlanError:
        raise TrackError(
            f"{name}: the boat stood still or ran along one line; a map needs a track over an area."
        ) from None
    region = clean_region(hull, name)
    return Survey(name=region.name, frame=region.frame, water=region.water)


def samples_of_track(track: RawTrack, survey: Survey, quantities: Quantities = BUILTIN) -> Samples:
    """Return the rows as samples, flagged by their gross range; speeds follow from the positions.

    Raises `TrackError` if the track has no quantity at all, or no times.
    """
    if not track.values:
        raise TrackError(
            "The track has no column of a known quantity; name one, as KEY=NAME, with a key of "
            f"{quantities.keys_text}; or define a new quantity.",
            settings=("columns", "quantities"),
        )
    if track.times is None:
        told = [note for note in track.notes if note.startswith("column ")]
        raise TrackError(
            f"The track has no column of times{f' ({told[0]})' if told else ''}; name it, as "
            "time=NAME.",
            settings=("columns",),
        )
    positions = survey.frame.to_local(track.lonlat)
    return Samples.of(
        times=track.times,
        positions=positions,
        values=track.values,
        quantities=quantities,
        speed_mps=_speeds(positions, track.times),
    )


def _speeds(positions: NDArray[np.float64], times: NDArray[np.float64]) -> NDArray[np.float64]:
    """Return the speed over ground between the neighbours of each row [m/s].

    It is NaN where their times are equal.
    """
    before = np.maximum(np.arange(len(times)) - 1, 0)
    after = np.minimum(np.arange(len(times)) + 1, len(times) - 1)
    seconds = times[after] - times[before]
    distance_m = np.hypot(*(positions[after] - positions[before]).T)
    return np.where(seconds > 0, distance_m / np.where(seconds > 0, seconds, 1.0), np.nan)
