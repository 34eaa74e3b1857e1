"""What a report and the maps are made of, read once from a survey file."""

from __future__ import annotations

import json
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from functools import cached_property

from grebe.core.events import LogEntry
from grebe.core.survey import Survey
from grebe.io.store import Progress, SampleTable, SurveyFile, TrackTable
from grebe.mapping.grid import make_grid
from grebe.mapping.maps import Mapper, MapSettings, QuantityMap, map_all
from grebe.workflow.checked import corrected_values, stored_lags


@dataclass(frozen=True, kw_only=True)
class ReportData:
    """A survey with what was measured and the maps of it; `left_out` says why others are none."""

    survey: Survey
    meta: dict[str, str]
    progress: Progress
    track: TrackTable
    samples: SampleTable
    events: Sequence[LogEntry]
    maps: Sequence[QuantityMap]
    left_out: Sequence[str]

    @cached_property
    def in_window(self) -> int:
        """Samples inside a target set and its speed window."""
        inside = 0
        for position, seq, speed in zip(
            self.samples.positions, self.samples.target_seq, self.samples.speed_mps, strict=True
        ):
            if seq > 0:
                target = self.survey.targets[seq - 1].set
                covered = target.footprint_distance(*position) < 1e-3
                inside += covered and target.allows(speed)
        return inside

    @property
    def unsampled(self) -> int:
        """Cells of the plan without a sample."""
        counts = zip(self.survey.targets, self.progress.sample_counts, strict=True)
        return sum(target.kind == "cell" and count == 0 for target, count in counts)

    @property
    def quality(self) -> dict[str, dict[str, tuple[int, int]]] | None:
        """For each quantity and test the values found suspect and failed; None if not checked."""
        noted = self.meta.get("quality")
        return None if noted is None else json.loads(noted)["counts"]


def gather(
    survey_file: SurveyFile,
    resolution_m: float | None = None,
    settings: MapSettings | None = None,
    on_mapped: Callable[[int, int], None] | None = None,
) -> ReportData:
    """Read a survey file and map its samples; `on_mapped` is told how many quantities are done."""
    samples = survey_file.samples()
    survey = survey_file.survey
    mapper = Mapper(survey.water, make_grid(survey.water, resolution_m), settings or MapSettings())
    values = corrected_values(samples, stored_lags(survey_file))
    maps, left_out = map_all(mapper, samples.positions, values, samples.flags, on_mapped)
    return ReportData(
        survey=survey,
        meta=survey_file.meta(),
        progress=survey_file.progress(),
        track=survey_file.track(),
        samples=samples,
        events=survey_file.events(),
        maps=maps,
        left_out=left_out,
    )
