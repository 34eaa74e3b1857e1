"""The route home of one mission: its length from where the boat is, and the helm that steers it."""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import dataclass
from typing import TYPE_CHECKING, cast

import shapely

from grebe.control.controller import Controller
from grebe.control.rules.base import reached_count
from grebe.core.dynamics import Weather
from grebe.core.errors import PlanError
from grebe.core.survey import Survey
from grebe.core.vessel import Vessel
from grebe.links.base import Observation
from grebe.mission.helm import AdaptableHelm, Helm
from grebe.mission.safety.fence import fence_of
from grebe.mission.safety.reserve import route_home_s
from grebe.mission.safety.settings import SafetySettings
from grebe.mission.safety.states import Place
from grebe.mission.time_limits import target_time_limit_s
from grebe.planning.paths.routes_home import RoutesHome, routes_home, transit_survey

if TYPE_CHECKING:
    import numpy as np
    from numpy.typing import NDArray

Pilot = Callable[[Survey], Helm]
# How often the route home is measured; its length changes no faster than the boat moves [s].
HOME_PERIOD_S = 5.0
# A route home that crosses less of an area than this touches it only by rounding [m].
ACROSS_M = 0.5


def default_pilot(vessel: Vessel) -> Pilot:
    """Return a pilot that makes Grebe's controller for a route home."""

    def pilot(survey: Survey) -> Helm:
        return Controller(vessel, survey.sets, corridors=survey.corridors)

    return pilot


def home_of(survey: Survey, settings: SafetySettings) -> Place:
    """Return where home is (north, east) [m]: the place in the settings, or the survey's start.

    Raises `InputError` for a home far from the water, and `PlanError` for a survey without a start.
    """
    if settings.home is not None:
        return survey.frame.place_near(survey.water, settings.home, "home")
    if survey.start is None:
        raise PlanError("The survey has no start, and no home was given.", settings=("home",))
    return survey.start.north_m, survey.start.east_m


def survey_routes_home(survey: Survey, settings: SafetySettings) -> RoutesHome:
    """Return the routes to a survey's home. Raises the errors of `home_of`, and `PlanError` if
    there can be no route.
    """
    home = home_of(survey, settings)
    fence = fence_of(survey.water, survey.no_go, home)
    return routes_home(cast("shapely.Polygon", fence.water), home)


def check_home(survey: Survey, settings: SafetySettings) -> None:
    """Raise `PlanError` for a given home that the boat could not reach, before the boat sets out
    rather than once it has to come home.
    """
    if settings.home is None or survey.start is None:
        return
    try:
        survey_routes_home(survey, settings).path_from((survey.start.north_m, survey.start.east_m))
    except PlanError as error:
        lon, lat = settings.home
        raise PlanError(
            f"The boat could not get home to {lon:g},{lat:g}: {error}", settings=("home",)
        ) from None


def speed_home_mps(survey: Survey, vessel: Vessel) -> float:
    """Return the speed at which the boat goes home, within the survey's speed windows [m/s]."""
    fastest = max((one.speed_max_mps for one in survey.sets), default=1.0)
    return min(fastest, 0.8 * vessel.speed_max_mps)


@dataclass(kw_only=True)
class UnderWay:
    """The route home that is being sailed."""

    helm: Helm
    survey: Survey
    deadline_s: float


class RouteHome:
    """Measures the route home of a survey's boat, and sets out on it. `no_route` says why there is
    no route; it is empty if there is one, or if none has been computed yet.
    """

    def __init__(self, survey: Survey, settings: SafetySettings) -> None:
        self._survey, self._settings = survey, settings
        self._routes: RoutesHome | None = None
        self._cost: tuple[float, float] | None = None
        self._asked_s = -math.inf
        self.no_route = ""
        self.is_closed = self.is_measured = False
        self.under_way: UnderWay | None = None

    def measure(self) -> None:
        """Compute the routes home, which takes a second or two on a large lake."""
        self._found()
        self.is_measured = True

    def cost(
        self, observation: Observation, weather: Weather, vessel: Vessel
    ) -> tuple[float, float]:
        """Return the time [s] and energy [Wh] home; both infinite without a route."""
        if observation.time_s - self._asked_s >= HOME_PERIOD_S or self._cost is None:
            self._asked_s = observation.time_s
            self._cost = self._measured(observation, weather, vessel)
        return self._cost

    def length_m(self, place: Place) -> float:
        """Return the length of the route home from a place [m]; infinite without one."""
        routes = self._found()
        try:
            return (
                math.inf
                if routes is None
                else float(shapely.LineString(self._path(routes, place)).length)
            )
        except PlanError:
            return math.inf

    def set_out(self, observation: Observation, vessel: Vessel, pilot: Pilot) -> bool:
        """Make a route home from here, and the helm that steers it; return whether there is one."""
        routes = self._found()
        try:
            if routes is not None:
                self._path(routes, (observation.state[0], observation.state[1]))
            survey = routes and transit_survey(
                self._survey, routes, observation.state, speed_home_mps(self._survey, vessel)
            )
        except PlanError as error:
            survey, self.no_route = None, str(error)
        if survey is None:
            self.under_way = None
            return False
        helm = pilot(survey)
        helm.reached = 0
        if helm.vessel != vessel and isinstance(helm, AdaptableHelm):
            helm.take_for(vessel)
        deadline_s = _deadline_s(survey, 0, observation)
        self.under_way = UnderWay(helm=helm, survey=survey, deadline_s=deadline_s)
        return True

    def follow(self, observation: Observation) -> None:
        """Count the transits that the boat has reached."""
        route = self.under_way
        if route is None:
            return
        before = route.helm.reached
        route.helm.reached = reached_count(route.survey.sets, before, observation.state)
        if route.helm.reached > before:
            route.deadline_s = _deadline_s(route.survey, route.helm.reached, observation)

    def _measured(
        self, observation: Observation, weather: Weather, vessel: Vessel
    ) -> tuple[float, float]:
        routes = self._found()
        if routes is None:
            return math.inf, math.inf
        try:
            path = self._path(routes, (observation.state[0], observation.state[1]))
        except PlanError as error:
            self.no_route = str(error)
            return math.inf, math.inf
        return route_home_s(vessel, path, weather, speed_home_mps(self._survey, vessel))

    def _path(self, routes: RoutesHome, place: Place) -> NDArray[np.float64]:
        """Return the route home from a place (n, 2) [m]; `PlanError` if it crosses a no-go area in
        which the boat is not.
        """
        path = routes.path_from(place)
        line, here = shapely.LineString(path), shapely.Point(place)
        across = [
            zone
            for zone in self._survey.no_go
            if not zone.intersects(here) and line.intersection(zone).length > ACROSS_M
        ]
        self.is_closed = bool(across)
        if across:
            raise PlanError("a closed area blocks the route home")
        return path

    def _found(self) -> RoutesHome | None:
        """Return the routes home, computed on the first call; None if there is none."""
        if self._routes is None and not self.no_route:
            try:
                self._routes = survey_routes_home(self._survey, self._settings)
            except PlanError as error:
                self.no_route = str(error)
        return self._routes


def _deadline_s(survey: Survey, reached: int, observation: Observation) -> float:
    if reached >= len(survey.targets):
        return math.inf
    return observation.time_s + target_time_limit_s(survey.targets[reached].set, observation.state)
