"""Map what changed between two surveys of the same water."""

from __future__ import annotations

import hashlib
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from datetime import UTC, datetime
from pathlib import Path

import numpy as np
import shapely

from grebe.core.errors import InputError
from grebe.core.survey import Survey, is_simulated
from grebe.io.export.geotiff import write_bands
from grebe.io.store import SurveyFile
from grebe.mapping.grid import make_grid
from grebe.mapping.lag import corrected_values
from grebe.mapping.maps import Mapper, map_all
from grebe.mapping.quantity_map import QuantityMap
from grebe.mapping.series.difference import Difference, difference
from grebe.report import canvas, map_figures
from grebe.workflow.files import make_folder

# There is nothing to map with less common water than this.
LEAST_WATER_M2 = 25.0


@dataclass(frozen=True, kw_only=True)
class Change:
    """The change of one quantity: the first map, and the second one minus the first."""

    before: QuantityMap
    difference: Difference


@dataclass(frozen=True, kw_only=True)
class Changes:
    """Changes by quantity on one grid, in the frame of the first survey, and what is left out.

    `days` are the days of the two surveys.
    """

    survey: Survey
    days: tuple[str, str]
    by_quantity: Mapping[str, Change]
    left_out: tuple[str, ...]


def compare_surveys(earlier: Path, later: Path, resolution_m: float | None = None) -> Changes:
    """Map the later survey minus the earlier where both cover the water.

    Raises `InputError` if they are one survey, or share no water or no quantity.
    """
    first, second = sailed([earlier, later])
    survey = first.survey
    water = common_water([survey, second.survey])
    mapper = Mapper(water, make_grid(water, resolution_m))
    before, missing_before = maps_in(earlier, survey, mapper)
    after, missing_after = maps_in(later, survey, mapper)
    missing_before += [f"{before[key].quantity.label}: only here" for key in before.keys() - after]
    missing_after += [f"{after[key].quantity.label}: only here" for key in after.keys() - before]
    common = [key for key in before if key in after]
    if not common:
        why = "; ".join((*missing_before, *missing_after))
        raise InputError(f"{earlier} and {later} have no mapped quantity in common ({why}).")
    return Changes(
        survey=survey,
        days=_days(first, second),
        by_quantity={
            key: Change(before=before[key], difference=difference(before[key], after[key]))
            for key in common
        },
        left_out=(
            *(f"{earlier}: {text}" for text in missing_before),
            *(f"{later}: {text}" for text in missing_after),
        ),
    )


def write_changes(changes: Changes, out: Path) -> dict[str, Path]:
    """Write a GeoTIFF and a picture of each change; return the GeoTIFFs by quantity."""
    make_folder(out)
    written: dict[str, Path] = {}
    for key, change in changes.by_quantity.items():
        bands = {"difference": change.difference.mean, "sd": change.difference.sd}
        written[key] = out / f"{key}_difference.tif"
        unit = change.before.quantity.unit
        tags = {"from": changes.days[0], "to": changes.days[1]}
        write_bands(written[key], change.before, changes.survey.frame, bands, unit, tags)
        figure = map_figures.difference_figure(
            changes.survey, change.before, change.difference, changes.days
        )
        canvas.save(figure, out / f"{key}_difference.png")
    return written


@dataclass(frozen=True, kw_only=True)
class Sailed:
    """A survey file that holds samples, and when the first and the last were taken [unix s]."""

    path: Path
    survey: Survey
    span_s: tuple[float, float]

    @property
    def middle_s(self) -> float:
        """The middle of its time [unix s]."""
        return sum(self.span_s) / 2

    @property
    def began(self) -> datetime:
        """When it began, in UTC."""
        return datetime.fromtimestamp(self.span_s[0], UTC)


def _days(first: Sailed, second: Sailed) -> tuple[str, str]:
    """Return the days on which two surveys began, with the time if the days are the same."""
    alike = first.began.date() == second.began.date()
    form = "%Y-%m-%d %H:%M" if alike else "%Y-%m-%d"
    return f"{first.began:{form}}", f"{second.began:{form}}"


def sailed(paths: Sequence[Path]) -> list[Sailed]:
    """Open surveys to compare.

    Raises `InputError` if one holds no samples, if the same readings are given twice, as they would
    confirm themselves, or if some are simulated and others measured.
    """
    seen: dict[bytes, Path] = {}
    waters: dict[bool, Path] = {}
    found: list[Sailed] = []
    for path in paths:
        with SurveyFile.open(path) as file:
            survey, samples = file.survey, file.samples()
            waters[is_simulated(file.meta().get("water", ""))] = path
        if len(samples) == 0:
            raise InputError(f"{path} holds no samples; sail it or import a track first.")
        columns = (samples.times, *(samples.values[key] for key in sorted(samples.values)))
        readings = b"".join(np.ascontiguousarray(one).tobytes() for one in columns)
        key = hashlib.sha256(readings).digest()
        if key in seen:
            raise InputError(f"{seen[key]} and {path} hold the same readings.")
        seen[key] = path
        span_s = float(samples.times.min()), float(samples.times.max())
        found.append(Sailed(path=path, survey=survey, span_s=span_s))
    if len(waters) > 1:
        raise InputError(
            f"The readings of {waters[True]} are simulated and those of {waters[False]} are not; "
            "their difference is not a change of the water."
        )
    return found


def common_water(surveys: Sequence[Survey]) -> shapely.Polygon:
    """Return the largest part of the water that all surveys cover, in the first one's frame.

    Raises `InputError` if there is none.
    """
    first = surveys[0]
    shared: shapely.Geometry = first.water
    for other in surveys[1:]:
        moved = first.frame.geometry_to_local(other.frame.geometry_to_wgs84(other.water))
        shared = shapely.intersection(shared, moved, grid_size=1e-6)
    parts = [part for part in shapely.get_parts(shared) if isinstance(part, shapely.Polygon)]
    largest = max(parts, key=lambda part: part.area, default=None)
    if largest is None or largest.area < LEAST_WATER_M2:
        which = "two surveys" if len(surveys) == 2 else f"{len(surveys)} surveys"
        area_m2 = 0.0 if largest is None else largest.area
        raise InputError(
            f"The {which} cover {area_m2:.0f} m2 of water in common; a map needs "
            f"{LEAST_WATER_M2:.0f} m2."
        )
    return largest


def maps_in(path: Path, base: Survey, mapper: Mapper) -> tuple[dict[str, QuantityMap], list[str]]:
    """Return the maps of a survey on the common grid, and what could not be mapped.

    They are in the frame of another survey, `base`. All its samples count, including those outside
    the common water.
    """
    with SurveyFile.open(path) as file:
        samples, lags, quantities = file.samples(), file.lags(), file.quantities
        frame = file.survey.frame
    moved = samples.moved(base.frame.to_local(frame.to_wgs84(samples.positions)))
    corrected = moved.with_values(corrected_values(samples, lags))
    maps, left_out = map_all(mapper, corrected, quantities)
    return {one.quantity.key: one for one in maps}, left_out
