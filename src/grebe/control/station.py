"""Holding a place with two thrusters: how a boat stops, and how it stays where it is.

Both are feedback laws without memory, functions of a state: what is foreseen with them is what is
done. `brake` takes the way off without turning. `keep` brakes where the boat is fast and not on
its way to the place, then points its bow along the velocity through the water that brings it
there, which in a current is against the current, and makes it.
"""

from __future__ import annotations

import math
from collections.abc import Sequence

from grebe.core.dynamics import Weather
from grebe.core.vessel import Vessel, steady_rate

# Speed wanted for each metre off the place [1/s], and the most of it [m/s].
APPROACH_PER_S, APPROACH_MPS = 0.25, 0.6
# A share of full thrust is left to steer with.
STEER_SHARE = 0.9
# So near is there [m]; a velocity through the water below this needs no heading [m/s].
THERE_M, IDLE_MPS = 0.75, 0.15
# Off by more than this the boat turns where it is [rad].
TURN_FIRST_RAD = math.radians(60)
# Surge above which the boat is braked before it turns [m/s].
FAST_MPS = 0.35
# What is kept for turning of the span between full ahead and full astern.
LEAST_TURN_SHARE = 0.15
# How soon surge and turn are to follow, the least of it [s].
SURGE_S, YAW_S = 0.6, 0.5
# Time after which a heading error is to be gone [s].
HEADING_S = 1.2


def brake(
    vessel: Vessel, state: Sequence[float], weather: Weather, weaker_share: float = 1.0
) -> tuple[float, float]:
    """Return the thrusts (F_1, F_2) [N] that bring the surge over ground to rest.

    Both thrusters give the same, so that the boat goes straight on: as much as the weaker one
    has, `weaker_share` of its full thrust astern (or ahead, where the boat goes astern).
    """
    heading, surge = state[2], state[3]
    ahead = _along(weather.current_north_mps, weather.current_east_mps, heading)
    push = _along(weather.wind_force_north_n, weather.wind_force_east_n, heading)
    # What holds the boat at rest over ground, and what takes the surge off within `SURGE_S`.
    wanted = vessel.surge_drag_n(-ahead) - push - vessel.m11_kg * surge / SURGE_S
    each = min(
        max(wanted / 2, weaker_share * vessel.thrust_min_n), weaker_share * vessel.thrust_max_n
    )
    return each, each


def keep(
    vessel: Vessel,
    state: Sequence[float],
    weather: Weather,
    place: tuple[float, float],
    weaker_share: float = 1.0,
) -> tuple[float, float]:
    """Return the thrusts (F_1, F_2) [N] that bring the boat to a place and hold it there.

    `state` (6,), `place` (north, east) [m]. Against a current the boat lies with its bow into
    it; the law has no integral, so it holds at a small distance from the place.
    """
    north, east, heading, surge, _, yaw_rate = state
    off_north, off_east = place[0] - north, place[1] - east
    away = math.hypot(off_north, off_east)
    pace = min(APPROACH_PER_S * max(away - THERE_M, 0.0), APPROACH_MPS) / max(away, 1e-9)
    # The velocity through the water that makes the wanted one over ground, with the wind's push
    # taken as the current that would need as much thrust.
    drift_north, drift_east = _with_wind(vessel, weather)
    through_north = pace * off_north - drift_north
    through_east = pace * off_east - drift_east
    speed = math.hypot(through_north, through_east)
    if speed < IDLE_MPS:
        return brake(vessel, state, weather, weaker_share)
    turn = math.remainder(math.atan2(through_east, through_north) - heading, 2 * math.pi)
    if abs(turn) > TURN_FIRST_RAD and abs(surge) > FAST_MPS:
        return brake(vessel, state, weather, weaker_share)
    ahead = _along(drift_north, drift_east, heading)
    # Through the water; while the bow is elsewhere the way over ground is kept off.
    wanted = speed * math.cos(turn) if abs(turn) < TURN_FIRST_RAD else -ahead
    lag = vessel.m11_kg / SURGE_S
    common = 0.5 * (vessel.surge_drag_n(wanted) + lag * (wanted + ahead - surge))
    return _allocated(vessel, common, _moment(vessel, turn, yaw_rate))


def reach_mps(vessel: Vessel, weather: Weather) -> float:
    """Return how much faster [m/s] the boat is than what carries it; negative where it is carried
    off whatever it does.
    """
    full = STEER_SHARE * 2 * vessel.thrust_max_n
    return steady_rate(-vessel.x_u, -vessel.x_uu, full) - drift_mps(vessel, weather)


def drift_mps(vessel: Vessel, weather: Weather) -> float:
    """Return the speed through the water [m/s] that holds the boat against current and wind."""
    return math.hypot(*_with_wind(vessel, weather))


def _with_wind(vessel: Vessel, weather: Weather) -> tuple[float, float]:
    """The current, and with it the speed through the water that wind alone would give."""
    force = math.hypot(weather.wind_force_north_n, weather.wind_force_east_n)
    north, east = weather.current_north_mps, weather.current_east_mps
    if force <= 0:
        return north, east
    speed = steady_rate(-vessel.x_u, -vessel.x_uu, force)
    share = speed / force
    return north + share * weather.wind_force_north_n, east + share * weather.wind_force_east_n


def _along(north: float, east: float, heading: float) -> float:
    return math.cos(heading) * north + math.sin(heading) * east


def _moment(vessel: Vessel, turn: float, yaw_rate: float) -> float:
    """Moment [N m] that turns the bow by `turn` [rad] and then holds it."""
    most = vessel.arm_m * (vessel.thrust_max_n - vessel.thrust_min_n)
    fastest = 0.7 * steady_rate(-vessel.n_r, -vessel.n_rr, most)
    wanted = min(max(turn / HEADING_S, -fastest), fastest)
    drag = -(vessel.n_r + vessel.n_rr * abs(wanted)) * wanted
    return drag + vessel.m33_kgm2 / YAW_S * (wanted - yaw_rate)


def _allocated(vessel: Vessel, common: float, moment: float) -> tuple[float, float]:
    """Thrusts within their limits. The push before the turn, but for a share of the thrust: a boat
    that turns with all it has is pushed ahead, for it has less astern.
    """
    low, high = vessel.thrust_min_n, vessel.thrust_max_n
    push = min(max(common, low), high)
    room = max(min(high - push, push - low), LEAST_TURN_SHARE * (high - low))
    half = min(max(moment / (2 * vessel.arm_m), -room), room)
    middle = min(max(push, low + abs(half)), high - abs(half))
    return middle + half, middle - half
