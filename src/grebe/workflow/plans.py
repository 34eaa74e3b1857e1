"""Plan a survey of a region read from a file, and write the plan with a picture."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import replace
from functools import partial
from pathlib import Path
from typing import TYPE_CHECKING

import shapely
from shapely.geometry.base import BaseGeometry

from grebe.core.errors import InputError
from grebe.core.plan_settings import PlanSettings
from grebe.core.plausible import doubts_about
from grebe.core.quantities import LIMNOLOGICAL
from grebe.core.revision import PlanRevision
from grebe.core.survey import Survey
from grebe.core.vessel import Vessel
from grebe.io.readers.islands import Islands
from grebe.io.readers.land import sea_warning
from grebe.io.readers.outline import in_degrees, in_own_or, read_outline
from grebe.io.readers.quantities import user_quantities
from grebe.planning.planned import Planned, PlannedSorties
from grebe.planning.planner import plan
from grebe.planning.region import Region, clean_region, water_of
from grebe.workflow.files import write_survey

if TYPE_CHECKING:
    from grebe.io.readers.track import TrackColumns
    from grebe.planning.sortie_check import SortieCheck
    from grebe.workflow.accuracy import Expected

# A note is given when the cells cover less than this share of the water.
MOSTLY_COVERED = 0.95
# A start or harbour farther than this from the water causes a warning [m].
ASHORE_M = 1.0


def read_region(
    path: Path,
    *,
    feature: str | None = None,
    columns: TrackColumns | None = None,
    header_from: Path | None = None,
    islands: Islands = "named",
    crs: str | None = None,
    is_crs_of_others: bool = False,
) -> tuple[Region, tuple[str, ...]]:
    """Return the water of a file of outlines, or within a track's convex hull, and notes about it.

    `feature` selects one of several lakes in a file, by name or by number. `islands` says which
    polygons within another one are islands, and `crs` the coordinates of a file that does not. If
    it `is_crs_of_others` too, such as no-go files, this file may be in degrees, or name its own.
    """
    read = partial(read_outline, path, columns, header_from, feature=feature, islands=islands)
    outline = in_own_or(read, crs) if is_crs_of_others else read(crs=crs)
    region = clean_region(outline.geometry, outline.name, outline.features)
    at_sea = sea_warning(region.frame.origin_lon_deg, region.frame.origin_lat_deg)
    return region, (*outline.notes, *([at_sea] if at_sea else []))


def plan_region(
    region: Region,
    vessel: Vessel,
    settings: PlanSettings,
    *,
    start_lonlat: tuple[float, float] | None = None,
    no_go: Sequence[Path] = (),
    crs: str | None = None,
    on_done: Callable[[int, int], None] | None = None,
) -> Planned:
    """Plan a survey of a region, outside the zones that the `no_go` files hold.

    `crs` names the coordinates of those `no_go` files that do not name their own.
    `on_done` is called with the progress of the search for sorties, which takes minutes on a large
    lake.
    """
    zones, notes = read_zones(no_go, region, crs=crs)
    planned = _planned(region, vessel, settings, start_lonlat, zones, on_done)
    return replace(planned, notes=(*notes, *planned.notes, *_uncovered(planned)))


def _uncovered(planned: Planned) -> list[str]:
    """Return a note if the cells leave out much of the water that the boat may use."""
    coverage = planned.check.coverage
    if coverage >= MOSTLY_COVERED:
        return []
    return [
        f"the cells cover {coverage:.0%} of the water that the boat may use; the rest is not "
        "measured, and smaller cells would reach more of it"
    ]


def _planned(
    region: Region,
    vessel: Vessel,
    settings: PlanSettings,
    start_lonlat: tuple[float, float] | None,
    zones: Sequence[shapely.Polygon],
    on_done: Callable[[int, int], None] | None,
) -> Planned:
    if settings.sorties is not None:
        from grebe.planning.sorties import plan_sorties

        return plan_sorties(region, vessel, settings, start_lonlat, zones, on_done)
    if settings.fleet is not None:
        from grebe.planning.fleets.shares import plan_fleet

        return plan_fleet(region, vessel, settings, zones)
    return plan(region, vessel, settings, start_lonlat, zones)


def write_plan(
    planned: Planned, to: Path, *, quantities_file: Path | None = None, force: bool = False
) -> Path:
    """Write a plan to a survey file, and its picture beside it; return the picture's path.

    The file declares the five quantities of the paper and those of `quantities_file` (or of a
    `quantities.toml` beside it).
    """
    picture = to.with_suffix(".png")
    if picture.is_dir():
        raise InputError(f"{picture}, where the picture of the plan would go, is a folder.")
    if picture.exists() and not force:
        raise InputError(
            f"{picture}, where the picture of the plan would go, exists already; give another "
            "name, or replace it by force.",
            settings=("force",),
        )
    quantities = LIMNOLOGICAL.extended(user_quantities(quantities_file, to))
    revision = planned.revision if isinstance(planned, PlannedSorties) else None
    write_survey(to, planned.survey, quantities=quantities, force=force, revision=revision)
    _draw(planned.survey, revision, picture)
    return picture


def _draw(survey: Survey, revision: PlanRevision | None, picture: Path) -> None:
    """Draw a plan.

    Matplotlib is imported only here: it is slow, and a refusal need not wait for it.
    """
    from grebe.report.undescribed import import_figures

    import_figures()
    from grebe.report import canvas
    from grebe.report.mission_figures import plan_figure

    if revision is None:
        figure = plan_figure(survey)
    else:
        from grebe.report.sortie_figures import sorties_figure

        figure = sorties_figure(survey, revision)
    canvas.save(figure, picture)


def plan_warnings(survey: Survey) -> list[str]:
    """Return what a field team should know before it goes out."""
    warnings: list[str] = []
    start, vessel = survey.start, survey.vessel
    if start is not None:
        away = survey.water.distance(shapely.Point(start.north_m, start.east_m))
        if away > ASHORE_M:
            warnings.append(f"the start is {away:.0f} m outside the region; is it on water?")
    sorties = None if survey.settings is None else survey.settings.sorties
    harbours = () if sorties is None else sorties.harbours
    for lon, lat in harbours:
        away = survey.water.distance(shapely.Point(survey.frame.to_local((lon, lat)).tolist()))
        if away > ASHORE_M:
            warnings.append(
                f"the harbour {lon:g},{lat:g} is {away:.0f} m outside the water: the nearest "
                "place on the water is used instead"
            )
    fastest = max(target.set.speed_max_mps for target in survey.targets)
    if vessel is not None and fastest > vessel.speed_max_mps:
        warnings.append(
            f"the window goes up to {fastest:g} m/s, but {vessel.name} reaches only "
            f"{vessel.speed_max_mps:.2f} m/s at full thrust"
        )
    boats = range(1, survey.fleet.boats + 1) if survey.fleet else (1,)
    vessels = dict.fromkeys(survey.vessel_of(boat) for boat in boats)
    warnings += [text for one in vessels if one is not None for text in doubts_about(one)]
    return warnings


def read_zones(
    paths: Sequence[Path], region: Region, *, crs: str | None = None, mends: bool = False
) -> tuple[list[shapely.Polygon], tuple[str, ...]]:
    """Return the no-go zones of some files, in the region's frame, and notes.

    The notes are those of the readers, and name files that do not touch the region's water. `crs`
    names the coordinates of files that do not name their own and are not in degrees. With `mends`,
    invalid polygons are repaired; otherwise they raise `InputError`.
    """
    zones: list[shapely.Polygon] = []
    notes: list[str] = []
    for path in paths:
        # A zone within another, of whatever name, is closed like the one around it.
        outline = in_own_or(partial(read_outline, path, islands="none"), crs)
        _refuse_metres(path, outline.geometry)
        notes += [f"{path}: {text}" for text in outline.notes]
        local = region.frame.geometry_to_local(outline.geometry)
        if mends:
            local = shapely.make_valid(local)
        elif not local.is_valid:
            raise InputError(f"{path}: holds a polygon that crosses itself; repair it first.")
        if not shapely.intersects(local, region.water):
            away = shapely.distance(local, region.water)
            notes.append(
                f"{path}: closes nothing: it is {away:.0f} m from the water; are latitude and "
                "longitude swapped?"
            )
        # A collection holds one geometry per outline, and each may have several parts.
        parts = shapely.get_parts(shapely.get_parts(local))
        zones += [part for part in parts if isinstance(part, shapely.Polygon)]
    return zones, tuple(notes)


def _refuse_metres(path: Path, geometry: BaseGeometry) -> None:
    if not in_degrees(geometry):
        west, south, east, north = shapely.bounds(geometry).tolist()
        raise InputError(
            f"{path}: reaches from ({west:g}, {south:g}) to ({east:g}, {north:g}), which are no "
            "longitudes and latitudes; name their CRS, or reproject them to WGS 84 (EPSG:4326).",
            settings=("crs",),
        )


def checked_sorties(planned: PlannedSorties) -> list[SortieCheck]:
    """Check each sortie with code that shares nothing with the planner.

    The result is empty for a fleet that sails in one go: no boat has to be home in time.
    """
    settings = planned.survey.settings
    if settings is None or settings.sorties is None:
        return []
    from grebe.planning.sortie_check import check_sorties

    return check_sorties(planned.survey, planned.revision, water_of(planned.survey))


def write_expected(chosen: Expected, survey_file: Path) -> Path:
    """Draw the expected accuracy of a plan's map; return the picture's path.

    The picture is beside the survey file.
    """
    from grebe.report import canvas
    from grebe.report.expected_figures import expected_figure

    picture = survey_file.with_name(f"{survey_file.stem}-expected.png")
    survey = chosen.planned.survey
    figure = expected_figure(survey, chosen.grid, chosen.sd, chosen.path)
    canvas.save(figure, picture)
    return picture
