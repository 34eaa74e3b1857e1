"""The data behind a report and its maps, read once from a survey file."""

from __future__ import annotations

import json
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field, replace
from functools import cached_property

import numpy as np
import shapely

from grebe.core.errors import InputError
from grebe.core.events import LogEntry
from grebe.core.quantities import Quantities
from grebe.core.quantity import Quantity
from grebe.core.samples import Samples
from grebe.core.sets import footprints_of
from grebe.core.survey import OF_TRACK, Survey, is_simulated
from grebe.io.store import Progress, SurveyFile, TrackTable
from grebe.mapping.grid import make_grid
from grebe.mapping.lag import Lag, corrected_values
from grebe.mapping.maps import Each, Mapper, MapSettings, in_turn, map_all
from grebe.mapping.movie import Movie, moments_of, movie_of, shows_change
from grebe.mapping.quantity_map import QuantityMap


@dataclass(frozen=True, kw_only=True)
class BelowZero:
    """What is below 0, as no water is: `count` of `of` good readings, the `least` of which is
    given, and a share of the map, 0 to 1, down to `mapped_least`.
    """

    count: int
    of: int
    least: float
    mapped_share: float
    mapped_least: float


@dataclass(frozen=True, kw_only=True)
class ReportData:
    """A survey with its measurements and maps. `left_out` says why other quantities have no map.
    `movies` is None if none were requested, and otherwise holds those that could be made. `lags`
    are the sensor lags that were corrected.
    """

    survey: Survey
    meta: dict[str, str]
    progress: Progress
    track: TrackTable
    quantities: Quantities
    samples: Samples
    events: Sequence[LogEntry]
    maps: Sequence[QuantityMap]
    left_out: Sequence[str]
    movies: Sequence[Movie] | None = None
    lags: Mapping[str, Lag] = field(default_factory=dict[str, Lag])

    @property
    def still(self) -> list[Quantity]:
        """The quantities that have a map and no movie."""
        filmed = {one.still.quantity.key for one in self.movies or ()}
        return [one.quantity for one in self.maps if one.quantity.key not in filmed]

    @cached_property
    def in_window(self) -> int:
        """Samples inside a target set and its speed window."""
        taken = np.flatnonzero(self.samples.target_seq > 0)
        if not len(taken):
            return 0
        place = {target.seq: i for i, target in enumerate(self.survey.targets)}
        # A target that a later order leaves out does not count.
        taken = taken[[seq in place for seq in self.samples.target_seq[taken].tolist()]]
        seq = np.array([place[one] for one in self.samples.target_seq[taken].tolist()], dtype=int)
        sets = self.survey.sets
        places = shapely.points(self.samples.positions[taken])
        away = shapely.distance(footprints_of(sets)[seq], places)
        speeds = self.samples.speed_mps[taken].tolist()
        allowed = [sets[i].allows(speed) for i, speed in zip(seq.tolist(), speeds, strict=True)]
        return int(np.sum((away < 1e-3) & allowed))

    @property
    def unsampled(self) -> int:
        """Cells of the plan without a sample."""
        counts = zip(self.survey.targets, self.progress.sample_counts, strict=True)
        return sum(target.kind == "cell" and count == 0 for target, count in counts)

    @property
    def is_of_track(self) -> bool:
        """Whether the outline was drawn around the track and so is not a shore."""
        return self.meta.get("outline") == OF_TRACK

    @property
    def is_simulated(self) -> bool:
        """Whether the survey was simulated, so that nothing was measured."""
        return is_simulated(self.meta.get("water", ""))

    def below_zero(self, one: QuantityMap) -> BelowZero | None:
        """What of a map and of its good readings is below 0; None if nothing is, or if the
        quantity's zero is no limit.
        """
        key, mapped = one.quantity.key, one.mean[one.grid.inside]
        good = self.samples.values[key][self.samples.usable(key)]
        least, mapped_least = float(good.min(initial=np.inf)), float(mapped.min(initial=np.inf))
        if not one.quantity.has_true_zero or min(least, mapped_least) >= 0:
            return None
        return BelowZero(
            count=int((good < 0).sum()),
            of=len(good),
            least=least,
            mapped_share=float((mapped < 0).mean()),
            mapped_least=mapped_least,
        )

    @property
    def quality(self) -> dict[str, dict[str, tuple[int, int]]] | None:
        """The numbers of suspect and failed values by quantity and test; None if not checked."""
        noted = self.meta.get("quality")
        return None if noted is None else json.loads(noted)["counts"]


def gather(
    survey_file: SurveyFile,
    resolution_m: float | None = None,
    settings: MapSettings | None = None,
    on_mapped: Callable[[int, int], None] | None = None,
    every_s: float | None = None,
    each: Each = in_turn,
) -> ReportData:
    """Read a survey file and map its samples. `on_mapped` is called with the number of quantities
    done and the total; `each` makes the map of each quantity.

    With `every_s`, also make movies of what changed, with a map every `every_s` seconds. The maps
    are then of one time: the middle of the survey, if no other is set.
    """
    samples = survey_file.samples()
    survey, meta, lags = survey_file.survey, survey_file.meta(), survey_file.lags()
    settings = settings or MapSettings()
    if settings.shore_depth_sd_m is not None and meta.get("outline") == OF_TRACK:
        raise InputError(
            f"The outline of {survey.name} is the hull of its track and not a shore, so no depth "
            "is known along it; leave the depth of the shore out.",
            settings=("shore_depth_sd_m",),
        )
    moments = None
    if every_s is not None and len(samples):
        moments = moments_of(samples.times, every_s)
        settings = replace(
            settings, moment="middle" if settings.moment is None else settings.moment
        )
    mapper = Mapper(survey.water, make_grid(survey.water, resolution_m), settings)
    corrected = samples.with_values(corrected_values(samples, lags))
    maps, left_out = map_all(mapper, corrected, survey_file.quantities, on_mapped, each)
    movies = None
    if moments is not None:
        movies = [movie_of(one, moments) for one in maps if shows_change(one)]
    return ReportData(
        survey=survey,
        meta=meta,
        progress=survey_file.progress(),
        track=survey_file.track(),
        quantities=survey_file.quantities,
        samples=samples,
        events=survey_file.events(),
        maps=maps,
        left_out=left_out,
        movies=movies,
        lags=lags,
    )
