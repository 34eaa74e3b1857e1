"""A hand-driven track as a survey: its hull is the region, its rows the samples (section 6.1)."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from datetime import tzinfo
from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np

from grebe.core.errors import PlanError, TrackError, UsageError
from grebe.core.quantities import BUILTIN, Quantities
from grebe.core.samples import Flag, Samples
from grebe.core.sets import hull_of
from grebe.core.survey import OF_TRACK, Survey
from grebe.io.readers.columns import DATE, PLACE_AND_TIME
from grebe.io.readers.profile import Profile, read_profile
from grebe.io.readers.quantities import user_quantities
from grebe.io.readers.track import RawTrack, TrackColumns, read_readings, read_track
from grebe.io.readers.zones import zone_of
from grebe.io.store import SurveyFile
from grebe.io.store.database import new_file
from grebe.mapping.quality.control import Quality
from grebe.planning.region import clean_region
from grebe.workflow.files import write_survey
from grebe.workflow.joining import ClockOffset, joined
from grebe.workflow.outings import outings_joined
from grebe.workflow.quality import check_samples

if TYPE_CHECKING:
    from numpy.typing import NDArray


@dataclass(frozen=True, kw_only=True)
class ImportedTrack:
    """The result of an import: the survey, its quantities, their columns, and their flags.

    `offsets` are those of the sondes' clocks, one for each track, as far as the data show them.
    """

    survey: Survey
    raw: RawTrack
    quantities: Quantities
    quality: Quality
    samples: int
    offsets: tuple[ClockOffset | None, ...] = ()

    @property
    def without_good(self) -> list[str]:
        """Quantities without a good value: all are missing, text, or flagged."""
        return [key for key in self.raw.values if not (self.quality.flags[key] == Flag.GOOD).any()]


def import_track(
    tracks: Path | Sequence[Path],
    to: Path,
    *,
    columns: TrackColumns | None = None,
    header_from: Path | None = None,
    quantities_file: Path | None = None,
    force: bool = False,
    sondes: Sequence[Path] = (),
    zone: str | None = None,
    profile: str | None = None,
    clock_offset_s: float | None = None,
) -> ImportedTrack:
    """Turn the tracks of one outing or several into a survey file with their samples, checked.

    `sondes` are files of readings without positions: one for each track, or one for all. Each is
    joined by its clock, which is `clock_offset_s` ahead of the track's (None for what the data
    show). `zone` is the time zone of times in any file that name none. `profile` describes the
    logger's file, the sonde's if there is one.

    The file declares the quantities that the track has, among those that Grebe knows and those of
    `quantities_file` (or of a `quantities.toml` beside the survey).
    """
    tracks = [tracks] if isinstance(tracks, Path) else list(tracks)
    known = BUILTIN.extended(user_quantities(quantities_file, to))
    reader = _Reader(
        columns=columns or {},
        header_from=header_from,
        quantities=known,
        zone=None if zone is None else zone_of(zone),
        profile=None if profile is None else read_profile(profile),
        clock_offset_s=clock_offset_s,
    )
    read = [reader.read(*one) for one in _with_sondes(tracks, sondes)]
    raw = outings_joined([(str(path), one) for path, (one, _) in zip(tracks, read, strict=True)])
    survey = survey_of_track(raw, tracks[0].stem)
    samples = samples_of_track(raw, survey, known)
    held, names = known.subset(raw.values), ", ".join(path.name for path in tracks)
    with new_file(to, force=force) as part:
        write_survey(part, survey, quantities=held, note=f"Imported from {names}.")
        with SurveyFile.open(part) as file:
            file.extend_samples(samples)
            file.set_meta("water", f"measured, {names}")
            file.set_meta("outline", OF_TRACK)
            quality = check_samples(file)
    return ImportedTrack(
        survey=survey, raw=raw, quantities=held, quality=quality, samples=len(samples),
        offsets=tuple(told for _, told in read) if sondes else (),
    )  # fmt: skip


def _with_sondes(tracks: Sequence[Path], sondes: Sequence[Path]) -> list[tuple[Path, Path | None]]:
    """Each track with its sonde's file; one such file may serve all tracks."""
    if len(sondes) > 1 and len(sondes) != len(tracks):
        raise UsageError(
            f"{len(tracks)} tracks and {len(sondes)} files of sondes; give one sonde's file for "
            "each track, in their order, or one for all.",
            settings=("sondes",),
        )
    theirs = [None] if not sondes else list(sondes)
    return list(zip(tracks, theirs * len(tracks) if len(theirs) == 1 else theirs, strict=True))


@dataclass(frozen=True, kw_only=True)
class _Reader:
    """Reads tracks and sondes' files as an import says; see `import_track`."""

    columns: TrackColumns
    header_from: Path | None
    quantities: Quantities
    zone: tzinfo | None
    profile: Profile | None
    clock_offset_s: float | None

    def read(self, track: Path, sonde: Path | None) -> tuple[RawTrack, ClockOffset | None]:
        """A track with its sonde's readings, and the offset of the sonde's clock that they show."""
        if sonde is None:
            read = read_track(
                track, self.columns, self.header_from, self.quantities,
                zone=self.zone, profile=self.profile,
            )  # fmt: skip
            return read, None
        ours, theirs = _shared(self.columns)
        raw = read_track(track, ours, self.header_from, self.quantities, zone=self.zone)
        readings = read_readings(
            sonde, theirs, None, self.quantities,
            zone=self.zone, profile=self.profile, placed=False,
        )  # fmt: skip
        return joined(raw, readings, sonde, self.clock_offset_s)


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
