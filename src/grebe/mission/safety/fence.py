"""The fence: a boat may go on as long as it could still stop inside.

At every estimate the boat's motion is predicted: first under its present or planned thrusts, for
the reaction time, and then under the law of `grebe.control.station`. That law brakes with the
reverse thrust of the weaker thruster and, in a current or wind, turns the boat and holds it. If the
prediction leaves the water, the law takes over at once. It would have kept the boat inside from the
previous estimate, and therefore still does. The braking distance is never assumed, but computed
from Eq. (9) for this hull, speed, turn, current and wind. (Safety by a backup policy: Gurriet et
al. 2020, IEEE Access 8.)
"""

from __future__ import annotations

import math
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from functools import cached_property

import numpy as np
import shapely
from shapely.geometry.base import BaseGeometry

from grebe.control.station import APPROACH_MPS, StationKeeper, drift_mps
from grebe.core.dynamics import Weather
from grebe.core.events import State
from grebe.core.motion import advance, parameter_vector
from grebe.core.vessel import Vessel
from grebe.mission.safety.states import Place

STEP_S = 0.1
# The prediction ends after `LONGEST_S` [s]: a boat still under way then is on its way in. For a
# boat that takes longer to stop it lasts up to `MOST_S` [s]; if that is not enough, the boat may
# not go on.
LONGEST_S, MOST_S = 16.0, 120.0
# A boat slower than this has stopped [m/s].
STOPPED_MPS = 0.1
# The boat need not turn against a drift below this [m/s].
NO_DRIFT_MPS = 0.05
# A boat is on its way to its refuge if the cosine of the angle between its course and the refuge is
# above `STRAIGHT`, and it stops at most `BEYOND_M` [m] beyond the refuge, where there is water.
STRAIGHT, BEYOND_M = 0.5, 1.0
# The rounding of the outline, and of a position in it [m].
ROUNDING_M = 0.02
# Distances inside the fence of possible refuges [m]. The boat uses the first of them to which it
# has a straight path in the water.
REFUGES_M = (2.0, 1.0, 0.5, 0.2, 0.0)
# A boat whose autopilot chooses the thrusts strays from the predicted path by up to this share of
# its length, and by at most `MOST_DOUBT_M` [m], as hulls that differed from their model by a fifth
# did. It also takes longer to react, by `FOLLOWED_S` [s]: the autopilot ramps the speed that it
# holds, by 1 m/s^2 (ArduRover's default), and follows the ramp with a lag.
FOLLOWED_DOUBT, MOST_DOUBT_M, FOLLOWED_S = 0.3, 0.8, 1.0
# The part of a drift above `MILD_DRIFT_SHARE` of the boat's top speed is uncertain by `DRIFT_DOUBT`
# of itself, and takes the boat off the predicted path by at most `MOST_UNSURE_M` [m].
MILD_DRIFT_SHARE, DRIFT_DOUBT, MOST_UNSURE_M = 0.2, 0.15, 1.5
# The time, besides that of a turn, allowed for countering a drift, in the distance at which the
# fence is far enough to need no prediction [s].
ANSWER_S = 4.0


# If braking at once does not keep the boat inside, its plan is followed for one of these times
# first [s].
PLANS_S = (1.0, 2.5, 5.0)

# Thrusts [N] as a function of the time from now [s].
Schedule = Callable[[float], tuple[float, float]]


@dataclass(frozen=True, kw_only=True)
class Escape:
    """How a boat stops inside its fence: with `thrusts` [N], one pair per step of `STEP_S`, and
    then with `StationKeeper.keep` to a `refuge`, which is None if the fence is far. `path` (n, 2)
    is the predicted path [m].
    """

    thrusts: tuple[tuple[float, float], ...]
    refuge: Place | None
    path: np.ndarray


@dataclass(frozen=True, kw_only=True)
class Fence:
    """The water in which the boat stays: local polygons (x north, y east) without no-go zones."""

    water: BaseGeometry

    @cached_property
    def _allowed(self) -> BaseGeometry:
        allowed = self.water.buffer(ROUNDING_M)
        shapely.prepare(allowed)
        return allowed

    @cached_property
    def _line(self) -> shapely.Geometry:
        line = shapely.boundary(self._allowed)
        shapely.prepare(line)
        return line

    @cached_property
    def _inner(self) -> list[shapely.Geometry]:
        inner = [self.water.buffer(-margin) for margin in REFUGES_M]
        return [one for one in inner if not one.is_empty]

    def contains(self, place: Place) -> bool:
        """Whether a place is inside."""
        return bool(shapely.intersects_xy(self._allowed, *place))

    def contains_path(self, places: np.ndarray, deviation_m: np.ndarray | None = None) -> bool:
        """Whether a path (n, 2) stays inside, even if the boat strays from it by `deviation_m` (n,)
        in any direction.
        """
        if not shapely.covers(self._allowed, shapely.linestrings(places)):
            return False
        if deviation_m is None or not deviation_m.any():
            return True
        away = shapely.distance(self._line, shapely.points(places))
        return bool((away >= deviation_m).all())

    def is_far(self, place: Place, distance_m: float) -> bool:
        """Whether a place is inside the fence and farther from it than `distance_m`."""
        point = shapely.Point(place)
        return self.contains(place) and not shapely.dwithin(self._line, point, distance_m)

    def without(self, taken: BaseGeometry, place: Place, reach_m: float) -> Fence:
        """Return the fence within `reach_m` of a place, without the water `taken`; the complete
        fence if nothing would be left.
        """
        left = shapely.clip_by_rect(
            self.water,
            place[0] - reach_m,
            place[1] - reach_m,
            place[0] + reach_m,
            place[1] + reach_m,
        ).difference(taken)
        return Fence(water=left) if left.area > 0 else self

    def refuge(self, place: Place) -> Place:
        """Return the nearest place well inside to which a straight path stays in the water; without
        one, the place nearest to the fence.
        """
        point = shapely.Point(place)
        nearest = place
        for inner in self._inner:
            ends = shapely.get_coordinates(shapely.shortest_line(point, inner))
            north, east = ends[1].tolist()
            nearest = (north, east)
            if nearest == place or self.contains_path(ends):
                return nearest
        return nearest


def fence_of(water: shapely.Polygon, no_go: Sequence[shapely.Polygon], place: Place) -> Fence:
    """Return the fence of a survey: of its water without no-go zones, the part nearest a place."""
    left = water.difference(shapely.union_all(list(no_go))) if no_go else water
    parts = [p for p in shapely.get_parts(left) if isinstance(p, shapely.Polygon) and p.area > 0]
    point = shapely.Point(place)
    return Fence(water=min(parts, key=lambda part: part.distance(point), default=water))


def escape(
    fence: Fence,
    keeper: StationKeeper,
    state: State,
    ahead: Schedule,
    weather: Weather,
    *,
    reaction_s: float,
    doubt: float = 0.0,
    foresees: bool = False,
) -> Escape | None:
    """Return how the boat could stop inside if it went on now; None if it could not.

    `ahead` are its planned thrusts. It may brake after the reaction time or, in the middle of a
    turn along the shore, after it has followed its plan a little longer. It may stray from the
    predicted path by a share `doubt` of the path's length (`_deviation_m`). With `foresees` the
    path is predicted even if the fence is far.
    """
    place = (state[0], state[1])
    reaction = math.ceil((reaction_s + keeper.vessel.thruster_lag_s) / STEP_S - 1e-9)
    enough_m = _surely_enough_m(keeper, state, weather, reaction * STEP_S)
    if not foresees and fence.is_far(place, enough_m):
        return Escape(thrusts=(), refuge=None, path=np.array([place]))
    refuge = fence.refuge(place)
    for steps in (reaction, *(reaction + round(s / STEP_S) for s in PLANS_S)):
        thrusts = tuple(ahead(STEP_S * min(k, steps)) for k in range(steps))
        path = predicted_stop(fence, keeper, state, thrusts, weather, refuge)
        if _ends_moving(path, len(thrusts), keeper, weather, refuge):
            continue
        if fence.contains_path(path[:, :2], _deviation_m(path, keeper.vessel, weather, doubt)):
            return Escape(thrusts=thrusts, refuge=refuge, path=path[:, :2])
    return None


def _deviation_m(path: np.ndarray, vessel: Vessel, weather: Weather, doubt: float) -> np.ndarray:
    """Return how far (n,) a boat may stray [m] from its predicted path: by a share `doubt` of the
    distance covered, and in a strong drift by a share of that.
    """
    deviation_m = np.zeros(len(path))
    if doubt > 0:
        gone = np.concatenate([[0.0], np.cumsum(np.hypot(*np.diff(path[:, :2], axis=0).T))])
        deviation_m += np.minimum(doubt * gone, MOST_DOUBT_M)
    seconds = STEP_S * np.arange(len(path))
    return deviation_m + np.minimum(_unsure_mps(vessel, weather) * seconds, MOST_UNSURE_M)


def _unsure_mps(vessel: Vessel, weather: Weather) -> float:
    """Return the uncertainty of a strong drift [m/s]. Its estimate is late if the drift rises, and
    the model of the hull describes its effect only along the hull.
    """
    strong = drift_mps(vessel, weather) - MILD_DRIFT_SHARE * vessel.speed_max_mps
    return DRIFT_DOUBT * max(strong, 0.0)


def predicted_stop(
    fence: Fence,
    keeper: StationKeeper,
    state: State,
    thrusts: Sequence[tuple[float, float]],
    weather: Weather,
    refuge: Place,
) -> np.ndarray:
    """Return the predicted states (n, 6), `STEP_S` apart, of a boat that has one pair of `thrusts`
    per step and then follows `StationKeeper.keep` to a refuge, until it has stopped or is on its
    way there.
    """
    vessel, wind = keeper.vessel, np.asarray(weather.as_tuple())
    parameters = parameter_vector(vessel, wind)
    substeps = max(2, math.ceil(STEP_S * vessel.fastest_rate_hz))
    drift = drift_mps(vessel, weather)
    room_m = drift * keeper.turn_s
    states = [np.asarray(state, dtype=float)]
    fastest = max(math.hypot(state[3], state[4]), vessel.speed_max_mps)
    longest_s = min(max(LONGEST_S, 2 * stopping_s(keeper, fastest)), MOST_S)
    for k in range(len(thrusts) + round(longest_s / STEP_S)):
        here = states[-1]
        if k < len(thrusts):
            inputs = thrusts[k]
        elif _has_stopped(here, room_m, drift, fence) or _arrives(here, refuge, keeper, fence):
            break
        else:
            inputs = keeper.keep(here.tolist(), weather, refuge)
        ahead = np.empty(6)
        advance(parameters, here, np.asarray(inputs, dtype=float), STEP_S, substeps, ahead)
        states.append(ahead)
    return np.array([*states, states[-1]] if len(states) == 1 else states)


def stopping_s(keeper: StationKeeper, speed: float) -> float:
    """Return the time that a boat takes to stop with its weaker thruster's reverse thrust on both
    sides, or by drag if that is stronger [s].
    """
    boat = keeper.vessel
    force = -2 * keeper.weaker_share * boat.thrust_min_n
    slowing = max(force, boat.surge_drag_n(0.5 * speed))
    return boat.m11_kg * speed / slowing


def _ends_moving(
    path: np.ndarray, given: int, keeper: StationKeeper, weather: Weather, refuge: Place
) -> bool:
    """Whether a boat that takes long to stop still moves away from its refuge at the end of the
    prediction.
    """
    if len(path) <= given + round(LONGEST_S / STEP_S) + 1:
        return False
    north, east, heading, surge, sway, _ = path[-1].tolist()
    if math.hypot(surge, sway) <= 2 * STOPPED_MPS + drift_mps(keeper.vessel, weather):
        return False
    over_north = surge * math.cos(heading) - sway * math.sin(heading)
    over_east = surge * math.sin(heading) + sway * math.cos(heading)
    return over_north * (refuge[0] - north) + over_east * (refuge[1] - east) <= 0


def dead_reckoned(
    vessel: Vessel, state: State, thrusts: tuple[float, float], weather: Weather, seconds: float
) -> State:
    """Return the state by Eq. (9) after `seconds` of constant thrusts."""
    ahead = np.empty(6)
    substeps = max(2, math.ceil(seconds * vessel.fastest_rate_hz))
    parameters = parameter_vector(vessel, np.asarray(weather.as_tuple()))
    start, inputs = np.asarray(state, dtype=float), np.asarray(thrusts, dtype=float)
    advance(parameters, start, inputs, seconds, substeps, ahead)
    north, east, heading, surge, sway, yaw_rate = ahead.tolist()
    return north, east, heading, surge, sway, yaw_rate


def braking_distance_m(
    vessel: Vessel,
    surge_mps: float,
    weather: Weather,
    *,
    reaction_s: float = 0.3,
    weaker_share: float = 0.9,
) -> float:
    """Return the distance [m] that a boat heading north at a surge covers until it stops over
    ground, if it keeps its thrusts for the reaction time and then brakes.
    """
    each = 0.5 * vessel.surge_drag_n(surge_mps)
    keeper = StationKeeper(vessel=vessel, weaker_share=weaker_share)
    parameters = parameter_vector(vessel, np.asarray(weather.as_tuple()))
    state = np.array([0.0, 0.0, 0.0, surge_mps, 0.0, 0.0])
    steps = math.ceil((reaction_s + vessel.thruster_lag_s) / STEP_S - 1e-9)
    substeps = max(2, math.ceil(STEP_S * vessel.fastest_rate_hz))
    farthest, k = 0.0, 0
    while state[3] > 0.01 and k < 600:
        held = (each, each) if k < steps else keeper.brake(state.tolist(), weather)
        ahead = np.empty(6)
        advance(parameters, state, np.asarray(held), STEP_S, substeps, ahead)
        state, k = ahead, k + 1
        farthest = max(farthest, float(state[0]))
    return farthest


def _has_stopped(state: np.ndarray, room_m: float, drift_mps: float, fence: Fence) -> bool:
    """Whether the boat has stopped, with `room_m` [m] to drift in until it has turned against the
    drift.
    """
    north, east, _, surge, sway, _ = state.tolist()
    if abs(surge) > STOPPED_MPS or math.hypot(surge, sway) > STOPPED_MPS + drift_mps:
        return False
    return drift_mps < NO_DRIFT_MPS or fence.is_far((north, east), room_m)


def _arrives(state: np.ndarray, refuge: Place, keeper: StationKeeper, fence: Fence) -> bool:
    """Whether the boat moves towards its refuge and stops at most `BEYOND_M` beyond it.

    Without that much water around the refuge it never does: in a channel the other shore is there.
    """
    north, east, heading, surge, sway, _ = state.tolist()
    speed = math.hypot(surge, sway)
    to_north, to_east = refuge[0] - north, refuge[1] - east
    over_north = surge * math.cos(heading) - sway * math.sin(heading)
    over_east = surge * math.sin(heading) + sway * math.cos(heading)
    away = math.hypot(to_north, to_east)
    nearing = over_north * to_north + over_east * to_east
    stops_m = 0.5 * speed * stopping_s(keeper, speed)
    goes = nearing > STRAIGHT * speed * away and STOPPED_MPS < 2 * speed < 2 * APPROACH_MPS
    return goes and stops_m < away + BEYOND_M and fence.is_far(refuge, BEYOND_M)


def _surely_enough_m(
    keeper: StationKeeper, state: State, weather: Weather, reaction_s: float
) -> float:
    """Return a distance [m] that no braking exceeds: with the fence farther away, no prediction is
    needed.
    """
    vessel = keeper.vessel
    speed = math.hypot(state[3], state[4])
    held = reaction_s + STEP_S
    gained = held * 2 * vessel.thrust_max_n / vessel.m11_kg
    fastest = min(speed + gained, speed + vessel.speed_max_mps)
    drag = vessel.surge_drag_n(0.5 * fastest) if fastest > 0 else 0.0
    force = -2 * keeper.weaker_share * vessel.thrust_min_n + drag
    drift = math.hypot(weather.current_north_mps, weather.current_east_mps)
    wind = math.hypot(weather.wind_force_north_n, weather.wind_force_east_n)
    slowing = max(force - wind, 0.05 * vessel.thrust_max_n) / vessel.m11_kg
    away = (drift + wind * 0.05) * (ANSWER_S + keeper.turn_s)
    unsure = MOST_UNSURE_M if _unsure_mps(vessel, weather) > 0 else 0.0
    return fastest * held + fastest**2 / slowing + away + unsure + 0.5
