"""Map what changed between two surveys of the same water."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path

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
    """What changed of one quantity: the earlier map, and the later one less the earlier."""

    before: QuantityMap
    difference: Difference


@dataclass(frozen=True, kw_only=True)
class Changes:
    """Changes by quantity on one grid, in the frame of the earlier survey; and what is left out."""

    survey: Survey
    by_quantity: Mapping[str, Change]
    left_out: tuple[str, ...]


def compare_surveys(earlier: Path, later: Path, resolution_m: float | None = None) -> Changes:
    """Map the later survey less the earlier where both cover the water."""
    with SurveyFile.open(earlier) as one, SurveyFile.open(later) as other:
        water = common_water([one.survey, other.survey])
        mapper = Mapper(water, make_grid(water, resolution_m))
        before, missing_before = maps_in(one, one.survey, mapper)
        after, missing_after = maps_in(other, one.survey, mapper)
        survey = one.survey
    common = [key for key in before if key in after]
    if not common:
        raise InputError(f"{earlier} and {later} have no mapped quantity in common.")
    return Changes(
        survey=survey,
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
        write_bands(written[key], change.before, changes.survey.frame, bands, unit)
        figure = map_figures.difference_figure(change.before, change.difference)
        canvas.save(figure, out / f"{key}_difference.png")
    return written


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
        raise InputError(f"The {which} do not cover any water in common.")
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
