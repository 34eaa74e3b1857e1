"""Plans for the page: previews, and the surveys themselves.

These functions run in a process of their own, so that a large plan does not delay a mission's page.
"""

from __future__ import annotations

import json
import math
from pathlib import Path
from typing import Any, cast, get_args

import shapely
from shapely.geometry.base import BaseGeometry

from grebe.core.errors import GrebeError, InputError, UsageError
from grebe.core.frames import LocalFrame
from grebe.core.plan_settings import PlanSettings
from grebe.core.survey import Survey
from grebe.core.taut import path_through
from grebe.core.vessel import vessel_named
from grebe.io.readers.islands import Islands
from grebe.io.store import SurveyFile
from grebe.planning.planned import Planned
from grebe.planning.planner import plan
from grebe.planning.region import Region, clean_region
from grebe.server.mission_request import weather
from grebe.server.requests import setting_number
from grebe.server.views import geojson, rings
from grebe.workflow.demo import NOTE, demo_survey
from grebe.workflow.files import write_survey

# More cells than this would take minutes, too long for a preview.
MOST_CELLS = 20_000
MOST_POINTS = 200_000
NAMES = {
    "cell_m", "pattern", "speed_min_mps", "speed_max_mps", "vessel", "start", "shore_margin_m",
    "no_go", "current", "wind", "minutes",
}  # fmt: skip
# A smaller gap is taken as rounding [m2].
SPECK_M2 = 0.5


def preview(request: Any) -> dict[str, Any]:
    """The plan of a survey, without storing it; if there is none, `problems` says why."""
    try:
        _, planned = _plan(request, "preview")
    except GrebeError as error:
        setting = error.settings[0] if error.settings else ""
        return {**_NOTHING, "problems": [{"setting": setting, "message": str(error)}]}
    return _shown(planned)


_NOTHING: dict[str, Any] = {
    "targets": {"type": "FeatureCollection", "features": []},
    "route": {"type": "LineString", "coordinates": []},
    "length_m": 0.0,
    "time_s": 0.0,
    "energy_wh": None,
    "samples": 0,
    "area_m2": 0.0,
    "expected_sd": None,
    "uncovered": None,
    "uncovered_m2": 0.0,
    "outside_m": 0.0,
    "problems": [],
    "notes": [],
}


def keep(request: Any, path: str) -> None:
    """Plan a survey and write it to a new file, together with its name and settings."""
    name = str(request.get("name", "")).strip()[:80] or "Survey"
    _, planned = _plan(request, name)
    write_survey(Path(path), planned.survey)
    with SurveyFile.open(Path(path)) as file:
        file.set_meta("app_name", name)
        file.set_meta("app_settings", json.dumps(request["settings"]))


def keep_demo(path: str) -> None:
    """Write the plan of one hectare that `grebe demo` uses."""
    write_survey(Path(path), demo_survey(), note=NOTE)


def _plan(request: Any, name: str) -> tuple[Region, Planned]:
    if not isinstance(request, dict):
        raise InputError("A plan needs a region and settings.")
    given = cast("dict[str, Any]", request)
    settings = given.get("settings")
    if not isinstance(settings, dict):
        raise InputError("A plan needs a region and settings.")
    chosen = cast("dict[str, Any]", settings)
    unknown = sorted(set(chosen) - NAMES)
    if unknown:
        raise UsageError(f"A plan has no setting {unknown[0]!r}.", settings=(unknown[0],))
    region = clean_region(_geometry(given.get("region"), "region"), name)
    vessel = vessel_named(str(chosen.get("vessel", "spyboat")))
    plan_settings = _settings(chosen, region)
    zones = _zones(chosen.get("no_go"), region.frame)
    start = chosen.get("start")
    place = None if start is None else _pair(start)
    return region, plan(region, vessel, plan_settings, place, zones)


def _geometry(given: Any, what: str) -> BaseGeometry:
    text = json.dumps(given)
    try:
        geometry = shapely.from_geojson(text)
    except (shapely.errors.GEOSException, ValueError):
        raise InputError(f"The {what} is not a GeoJSON polygon.", settings=(what,)) from None
    if not isinstance(geometry, shapely.Polygon | shapely.MultiPolygon):
        raise InputError(f"The {what} is not a polygon.", settings=(what,))
    if shapely.get_num_coordinates(geometry) > MOST_POINTS:
        raise InputError(f"The {what} has more than {MOST_POINTS:,} points.", settings=(what,))
    return geometry


def _zones(given: Any, frame: LocalFrame) -> list[shapely.Polygon]:
    if given is None:
        return []
    local = frame.geometry_to_local(_geometry(given, "no_go"))
    if not local.is_valid:
        raise InputError("A no-go area crosses itself.", settings=("no_go",))
    return [part for part in shapely.get_parts(local) if isinstance(part, shapely.Polygon)]


def _pair(given: Any) -> tuple[float, float]:
    try:
        lon, lat = (float(value) for value in given)
    except (TypeError, ValueError, OverflowError):
        raise InputError(
            "The start must be [longitude, latitude] in degrees.", settings=("start",)
        ) from None
    if not (math.isfinite(lon) and math.isfinite(lat) and abs(lat) <= 90 and abs(lon) <= 360):
        raise InputError("The start must be [longitude, latitude] in degrees.", settings=("start",))
    return lon, lat


def _settings(given: dict[str, Any], region: Region) -> PlanSettings:
    minutes = given.get("minutes")
    cell_m = None if minutes is not None else setting_number(given, "cell_m", 10.0)
    if cell_m is not None and cell_m > 0 and region.area_m2 > MOST_CELLS * cell_m**2:
        least = math.sqrt(region.area_m2 / MOST_CELLS)
        raise UsageError(
            f"Cells of {cell_m:g} m would number more than {MOST_CELLS:,} in this water; choose "
            f"{math.ceil(least)} m or more.",
            settings=("cell_m",),
        )
    return PlanSettings(
        cell_m=cell_m,
        pattern=cast("Any", str(given.get("pattern", "free"))),
        speed_min_mps=setting_number(given, "speed_min_mps", 0.5),
        speed_max_mps=setting_number(given, "speed_max_mps", 1.5),
        shore_margin_m=setting_number(given, "shore_margin_m", 0.0),
        weather=weather(given),
        minutes=None if minutes is None else setting_number(given, "minutes"),
    )


def _shown(planned: Planned) -> dict[str, Any]:
    survey, outcome = planned.survey, planned.outcome
    missing = _uncovered(survey)
    line = shapely.LineString(path_through(survey))
    outside = line.difference(survey.water.buffer(0.05)).length
    return {
        "targets": {
            "type": "FeatureCollection",
            "features": [
                {
                    "type": "Feature",
                    "geometry": {"type": "Polygon", "coordinates": [ring]},
                    "properties": {"seq": target.seq},
                }
                for target, ring in zip(survey.targets, rings(survey), strict=True)
            ],
        },
        "route": geojson(survey, line),
        "length_m": round(float(line.length), 1),
        "time_s": round(outcome.time_s, 1),
        "energy_wh": round(outcome.energy_wh, 2),
        # A mission reads the sonde every second within the speed window.
        "samples": round(outcome.time_s),
        "area_m2": round(survey.water.area, 1),
        "expected_sd": None,
        "uncovered": None if missing.is_empty else geojson(survey, missing),
        "uncovered_m2": round(float(missing.area), 1),
        "outside_m": round(float(outside), 1),
        "problems": [],
        "notes": list(planned.notes),
    }


def _uncovered(survey: Survey) -> shapely.MultiPolygon:
    rest = survey.water.difference(shapely.union_all(survey.cells))
    parts = [part for part in shapely.get_parts(rest) if part.area > SPECK_M2]
    return shapely.MultiPolygon([part for part in parts if isinstance(part, shapely.Polygon)])


def outline(path: str, islands: str, crs: str | None) -> dict[str, Any]:
    """The water in a file of outlines, as GeoJSON, and what a user should know of it.

    `islands` and `crs` are those of `grebe.workflow.plans.read_region`.
    """
    from grebe.workflow.plans import read_region

    if islands not in get_args(Islands):
        raise UsageError(f"islands is {islands[:40]!r}; choose one of {get_args(Islands)}.")
    region, notes = read_region(Path(path), islands=cast("Islands", islands), crs=crs)
    water = shapely.to_geojson(region.frame.geometry_to_wgs84(region.water))
    return {"region": json.loads(water), "name": region.name, "notes": list(notes)}


def receive(path: str, to: str) -> None:
    """Store an uploaded file as a survey: a survey file as it is, a track by importing it."""
    source = Path(path)
    if source.suffix.lower() == ".gpkg":
        with SurveyFile.open(source):
            pass
        source.replace(to)
        return
    from grebe.workflow.tracks import import_track

    import_track(source, Path(to))
