"""A hand-driven survey, as in the paper's earlier work: its track and its measurements.

The paper's own data are not public; any track with the quantities of remark 11 will do.
"""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property
from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np

from grebe.core.errors import InputError
from grebe.core.quantities import BUILTIN
from grebe.core.samples import Flag
from grebe.core.survey import Survey
from grebe.io.readers.track import RawTrack, read_track
from grebe.mapping.quality.control import check_quality
from grebe.planning.region import Region
from grebe.workflow.tracks import samples_of_track, survey_of_track

if TYPE_CHECKING:
    from numpy.typing import NDArray

    Array = NDArray[np.float64]


@dataclass(frozen=True)
class HandDriven:
    """A track that was driven by hand, and the region that it spans: its convex hull."""

    raw: RawTrack
    survey: Survey

    @classmethod
    def read(cls, path: Path, header_from: Path | None = None) -> HandDriven:
        """Read a track from CSV. Raises `InputError` when it has no times."""
        raw = read_track(path, header_from=header_from)
        if raw.times is None:
            raise InputError(f"{path} has no times; the duration of the survey is needed.")
        return cls(raw, survey_of_track(raw, path.stem))

    @cached_property
    def positions(self) -> Array:
        """The places of the samples, (n, 2) [m]."""
        return self.survey.frame.to_local(self.raw.lonlat)

    @property
    def duration_s(self) -> float:
        """Duration of the survey [s]."""
        assert self.raw.times is not None
        return float(self.raw.times[-1] - self.raw.times[0])

    @property
    def length_m(self) -> float:
        """Length of the track [m]."""
        return float(np.hypot(*np.diff(self.positions, axis=0).T).sum())

    @cached_property
    def good(self) -> dict[str, Array]:
        """The values of each quantity that pass quality control, NaN elsewhere."""
        samples = samples_of_track(self.raw, self.survey)
        flags = check_quality(samples, self.survey.water, BUILTIN.subset(samples.values)).flags
        return {
            key: np.where(flags[key] == Flag.GOOD, column, np.nan)
            for key, column in samples.values.items()
        }

    @property
    def region(self) -> Region:
        """The region to plan a survey of."""
        return Region(name=self.survey.name, frame=self.survey.frame, water=self.survey.water)
