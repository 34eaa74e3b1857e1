"""Check the sorties of a survey, independently of the planner that made them: with shapely, the
survey, and the paths home that a mission's guard computes.
"""

from __future__ import annotations

import math
from dataclasses import dataclass

import shapely

from grebe.core.dynamics import Weather, drive_power_w
from grebe.core.errors import PlanError
from grebe.core.revision import PlanRevision, survey_of
from grebe.core.survey import Survey
from grebe.core.taut import path_through
from grebe.planning.check import check_plan
from grebe.planning.paths.routes_home import RoutesHome, path_length_m, routes_home
from grebe.planning.paths.travel import WANDER, ground_speed, travel_of

# The reserves that a mission's guard keeps for the path home. They are stated again and not taken
# from the planner, so that an error there does not excuse itself.
HOME_SHARE, HOME_SLACK_S = 0.25, 30.0


@dataclass(frozen=True, kw_only=True)
class SortieCheck:
    """The result of the check of one sortie.

    `outside_m2` of its paths are outside the water. It ends `from_harbour_m` from where it began.
    `least_left_s` is the smallest margin over all places of the sortie: the time that is left
    there, by the limit of minutes or the battery without the reserve, less the time of the path
    home in the worst of the stated weather.
    """

    number: int
    outside_m2: float
    from_harbour_m: float
    least_left_s: float

    @property
    def holds(self) -> bool:
        """Whether the boat stays in the water, ends at its harbour, and gets home in time from
        wherever it turns back.
        """
        return self.outside_m2 == 0.0 and self.from_harbour_m < 15.0 and self.least_left_s >= 0.0


def check_sorties(
    survey: Survey, revision: PlanRevision, water: shapely.Polygon
) -> list[SortieCheck]:
    """Check each sortie of a revision against the water that the boat may use.

    The worst of the weather is a current and a wind as strong as stated, straight against the
    boat on every leg of the path home.
    """
    routes: dict[tuple[float, float], RoutesHome] = {}
    found: list[SortieCheck] = []
    for sortie in revision.sorties:
        part = survey_of(survey, revision, sortie)
        home = (sortie.start.north_m, sortie.start.east_m)
        if home not in routes:
            routes[home] = routes_home(water, home)
        last = part.targets[-1].set
        found.append(
            SortieCheck(
                number=sortie.number,
                outside_m2=check_plan(part, water).outside_m2,
                from_harbour_m=last.footprint_distance(*home),
                least_left_s=_least_left_s(part, routes[home]),
            )
        )
    return found


def _least_left_s(part: Survey, routes: RoutesHome) -> float:
    settings, vessel = part.settings, part.vessel
    if settings is None or settings.sorties is None or vessel is None:
        raise PlanError("The survey does not state the limits of its sorties.")
    weather, fastest = settings.weather, settings.speed_max_mps
    travel = travel_of(vessel, (settings.speed_min_mps, fastest), weather)
    current = math.hypot(weather.current_north_mps, weather.current_east_mps)
    wind = math.hypot(weather.wind_force_north_n, weather.wind_force_east_n)
    against = Weather(current_north_mps=-current, wind_force_north_n=-wind)
    pace = ground_speed(vessel, fastest, against, 0.0)
    through = min(fastest + current, vessel.speed_max_mps)
    thrust = 0.5 * vessel.surge_drag_n(through)
    power_home_w = drive_power_w(vessel, (thrust, thrust), through)
    path = path_through(part)
    bounds, left = settings.sorties, math.inf
    for k in range(1, len(path)):
        spent_s = travel.path_s(path[: k + 1])
        home_m = path_length_m(routes.path_from((float(path[k, 0]), float(path[k, 1]))))
        home_s = (1 + HOME_SHARE) * WANDER * home_m / pace
        if bounds.minutes is not None:
            limit_s = 60 * bounds.minutes * (1 - bounds.reserve)
            left = min(left, limit_s - spent_s - home_s - HOME_SLACK_S)
        if bounds.battery_wh is not None:
            limit_ws = 3600 * bounds.battery_wh * (1 - bounds.reserve)
            spare_ws = limit_ws - 3600 * travel.path_wh(path[: k + 1]) - power_home_w * home_s
            left = min(left, spare_ws / travel.power_w)
    return left
