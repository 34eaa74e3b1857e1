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
from grebe.core.survey import Survey
from grebe.io.export.geotiff import write_bands
from grebe.io.store import SurveyFile
from grebe.mapping.difference import Difference, difference
from grebe.mapping.grid import make_grid
from grebe.mapping.lag import corrected_values
from grebe.mapping.maps import Mapper, map_all
from grebe.mapping.quantity_map import QuantityMap
from grebe.report import canvas, map_figures
from grebe.workflow.files import make_folder

# With less common water than this there is nothing to map.
LEAST_WATER_M2 = 25.0


@dataclass(frozen=True, kw_only=True)
class Change:
    """What changed of one quantity: the first map, and the second one less the first."""

    before: QuantityMap
    difference: Difference


@dataclass(frozen=True, kw_only=True)
class Changes:
    """Changes by quantity on one grid, in the frame of the first survey, from its day to the
    second's; and what is left out.
    """

    survey: Survey
    days: tuple[str, str]
    by_quantity: Mapping[str, Change]
    left_out: tuple[str, ...]


def compare_surveys(earlier: Path, later: Path, resolution_m: float | None = None) -> Changes:
    """Map the later survey less the earlier where both cover the water.

    Raises `InputError` where they are one survey, or share no water or no quantity.
    """
    refuse_the_same([earlier, later])
    with SurveyFile.open(earlier) as one, SurveyFile.open(later) as other:
        days = _day(one), _day(other)
        water = common_water([one.survey, other.survey])
        mapper = Mapper(water, make_grid(water, resolution_m))
        before, missing_before = maps_in(one, one.survey, mapper)
        after, missing_after = maps_in(other, one.survey, mapper)
        survey = one.survey
    missing_before += [f"{before[key].quantity.label}: only here" for key in before.keys() - after]
    missing_after += [f"{after[key].quantity.label}: only here" for key in after.keys() - before]
    common = [key for key in before if key in after]
    if not common:
        why = "; ".join((*missing_before, *missing_after))
        raise InputError(f"{earlier} and {later} have no mapped quantity in common ({why}).")
    return Changes(
        survey=survey,
        days=days,
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
        figure = map_figures.difference_figure(change.before, change.difference, changes.days)
        canvas.save(figure, out / f"{key}_difference.png")
    return written


def refuse_the_same(paths: Sequence[Path]) -> None:
    """Raise `InputError` where the same readings are given twice: they would be sure of
    themselves.
    """
    seen: dict[bytes, Path] = {}
    for path in paths:
        with SurveyFile.open(path) as file:
            samples = file.samples()
        if len(samples) == 0:
            raise InputError(f"{path} holds no samples; sail it or import a track first.")
        columns = (samples.times, *(samples.values[key] for key in sorted(samples.values)))
        key = hashlib.sha256(
            b"".join(np.ascontiguousarray(one).tobytes() for one in columns)
        ).digest()
        if key in seen:
            raise InputError(f"{seen[key]} and {path} hold the same readings.")
        seen[key] = path


def _day(file: SurveyFile) -> str:
    times = file.samples().times
    return f"{datetime.fromtimestamp(float(times.min()), UTC):%Y-%m-%d}" if len(times) else "?"


def common_water(surveys: Sequence[Survey]) -> shapely.Polygon:
    """The largest part of the water that all surveys cover, in the first one's frame.

    Raises `InputError` where there is none.
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


def maps_in(
    file: SurveyFile, base: Survey, mapper: Mapper
) -> tuple[dict[str, QuantityMap], list[str]]:
    """The maps of a survey on the common grid, in the frame of another; all its samples count, also
    those outside the common water. And what could not be mapped.
    """
    samples = file.samples()
    moved = samples.moved(base.frame.to_local(file.survey.frame.to_wgs84(samples.positions)))
    corrected = moved.with_values(corrected_values(samples, file.lags()))
    maps, left_out = map_all(mapper, corrected, file.quantities)
    return {one.quantity.key: one for one in maps}, left_out
