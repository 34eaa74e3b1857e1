"""Preview what a mission would do, for whoever stands at the shore with a file."""

from __future__ import annotations

import math
from dataclasses import asdict, dataclass
from datetime import datetime
from typing import Any

import shapely

from grebe.core.dynamics import CALM
from grebe.core.revision import Sortie
from grebe.core.sets import footprints_of
from grebe.core.taut import taut_path
from grebe.io.store import SurveyFile
from grebe.mission.departure import Departure, prepare
from grebe.mission.safety.reserve import route_home_s
from grebe.mission.safety.route_home import home_of, speed_home_mps, survey_routes_home
from grebe.mission.safety.settings import SafetySettings
from grebe.planning.paths.routes_home import path_length_m
from grebe.planning.paths.travel import travel_of
from grebe.planning.revisions.connect import OFF_CORRIDOR_M, is_connected


@dataclass(frozen=True, kw_only=True)
class Preview:
    """The preview of a mission.

    `reached` of `targets` are done and `next_target` is ahead (None: nothing is left); they are
    those of one `sortie` if the plan is in sorties. `boat` is the number of a fleet's boat.

    The boat is expected at `lat_deg`, `lon_deg`, `distance_m` in a straight line from that target.
    The rest takes `remaining_s` by the shortest (taut) path in the weather that was planned for.
    `forgets` says whether a recorded mission would be discarded; `doubts` is what to look at first.
    """

    reached: int
    targets: int
    next_target: int | None
    lat_deg: float
    lon_deg: float
    heading_deg: float
    distance_m: float
    remaining_s: float
    forgets: bool
    doubts: tuple[str, ...]
    sortie: int | None = None
    boat: int | None = None

    def numbers(self) -> dict[str, Any]:
        """Return the preview as plain values, by name."""
        return asdict(self)


def preview_of(departure: Departure) -> Preview:
    """Return the preview of a mission from `departure`; nothing is opened or changed."""
    survey, (north, east, heading, *_) = departure.survey, departure.state
    lon, lat = survey.frame.to_wgs84((north, east)).tolist()
    ahead = survey.targets[departure.reached :]
    return Preview(
        reached=departure.reached,
        targets=len(survey.targets),
        next_target=ahead[0].seq if ahead else None,
        lat_deg=round(lat, 7),
        lon_deg=round(lon, 7),
        heading_deg=round(math.degrees(heading) % 360.0, 1),
        distance_m=round(ahead[0].set.footprint_distance(north, east), 1) if ahead else 0.0,
        remaining_s=round(_remaining_s(departure), 1),
        forgets=departure.clears,
        doubts=(*(doubt.message for doubt in departure.doubts), *_detour(departure)),
        sortie=None if departure.sortie is None else departure.sortie.number,
        boat=departure.sortie.boat if departure.sortie and survey.fleet else None,
    )


def fleet_preview(survey_file: SurveyFile, now: datetime) -> dict[str, Any]:
    """Return the preview of the next sortie of each boat of a fleet, by name.

    `remaining_s` is that of the boat that takes longest. Raises what `prepare` raises.
    """
    progress = survey_file.progress()
    ahead: dict[int, Sortie] = {}
    for one in survey_file.revision.sorties:
        if progress.reached_in(one) < len(one):
            ahead.setdefault(one.boat, one)
    each: dict[int, Preview] = {}
    spent: dict[int, str] = {}
    for boat, sortie in sorted(ahead.items()):
        resume = survey_file.track_ends(boat) is not None
        departure = prepare(survey_file, now, resume=resume, sortie=sortie.number)
        each[boat], used_wh = preview_of(departure), departure.spent.energy_wh
        spent[boat] = f", {used_wh:.0f} Wh spent since its harbour" if used_wh >= 1 else ""
    return {
        "reached": progress.reached,
        "targets": len(progress.reached_at),
        "remaining_s": max((one.remaining_s for one in each.values()), default=0.0),
        "boats": [
            f"{boat}: sortie {one.sortie}, {one.reached} of {one.targets} targets, from latitude "
            f"{one.lat_deg:.5f}, longitude {one.lon_deg:.5f}, {one.remaining_s / 60:.1f} min"
            + spent[boat]
            for boat, one in each.items()
        ],
        "doubts": tuple(dict.fromkeys(doubt for one in each.values() for doubt in one.doubts)),
    }


def _detour(departure: Departure) -> tuple[str, ...]:
    survey, place = departure.survey, departure.state[:2]
    left = shapely.difference(survey.water, shapely.union_all(list(survey.no_go)))
    if is_connected(
        survey, lambda: left.buffer(OFF_CORRIDOR_M), departure.reached, (place[0], place[1])
    ):
        return ()
    return (
        "the route to the next target leads around land; the predicted time does not include "
        "this detour",
    )


def route_home_of(departure: Departure, safety: SafetySettings) -> dict[str, Any]:
    """Return the preview of bringing a boat home from where it is, by name.

    Raises what `survey_routes_home` raises, and `PlanError` if no path leads there.
    """
    survey = departure.survey
    north, east = departure.state[:2]
    path = survey_routes_home(survey, safety).path_from((north, east))
    speed_mps = speed_home_mps(survey, departure.vessel)
    lon, lat = survey.frame.to_wgs84((north, east)).tolist()
    home_lon, home_lat = survey.frame.to_wgs84(home_of(survey, safety)).tolist()
    settings = survey.settings
    weather = CALM if settings is None else settings.weather
    return {
        "lat_deg": round(lat, 7),
        "lon_deg": round(lon, 7),
        "home_lat_deg": round(home_lat, 7),
        "home_lon_deg": round(home_lon, 7),
        "distance_m": round(path_length_m(path), 1),
        "remaining_s": round(route_home_s(departure.vessel, path, weather, speed_mps)[0], 1),
        "doubts": tuple(doubt.message for doubt in departure.doubts),
    }


def _remaining_s(departure: Departure) -> float:
    ahead = [target.set for target in departure.survey.targets[departure.reached :]]
    if not ahead:
        return 0.0
    speed = (min(s.speed_min_mps for s in ahead), max(s.speed_max_mps for s in ahead))
    settings = departure.survey.settings
    weather = CALM if settings is None else settings.weather
    path = taut_path(departure.state[:2], footprints_of(ahead))
    return travel_of(departure.vessel, speed, weather).path_s(path)
