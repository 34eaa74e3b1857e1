"""The cost of a path: seconds per metre in each direction, and seconds per turn.

The boat keeps its speed window over ground. On a leg it goes at the top of the window unless
current and wind slow it down. Its speed then follows from the surge that its thrusters can hold
against drag and wind, and from the current's components along and across the leg.
"""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np

from grebe.core.dynamics import Weather, drive_power_w
from grebe.core.errors import PlanError
from grebe.core.inner_loop import yaw_rate_max_radps
from grebe.core.vessel import Vessel, steady_rate

if TYPE_CHECKING:
    from numpy.typing import NDArray

    Array = NDArray[np.float64]

# Share of full thrust that a leg may use; the rest is for steering.
THRUST_SHARE = 0.9
# A turn costs this share of its time on the spot at half the largest yaw rate, because a boat
# turns while it goes on. Fitted on taut paths sailed by `lookahead` (docs/theory.md).
TURN_SHARE = 0.5
# A sailed path takes longer than its taut legs and turns by this factor. With it, flown times were
# 0.94 to 1.13 of the prediction (docs/theory.md).
WANDER = 1.05
# A turn is made with one thruster ahead and one astern, at their limits, and ended the same way.
# Its extra energy is this factor, times the excess of that power over the power of going straight,
# times the duration of a turn at the largest yaw rate. Fitted on sailed surveys of five vessels in
# cells of 10 to 40 m (docs/benchmarks.md).
TURN_ENERGY = 2.0
BEARINGS = 72


@dataclass(frozen=True, kw_only=True)
class Travel:
    """What travelling costs a boat.

    `slowness` (72,) [s/m] by the bearing of the leg over ground, in steps of 5 degrees from north;
    `turn_s_per_rad`; `power_w` of going straight; `turn_j_per_rad`, the extra energy of turning.
    """

    slowness: Array
    turn_s_per_rad: float
    power_w: float
    turn_j_per_rad: float

    def leg_s(self, leg: Array) -> Array:
        """Time [s] of straight legs `leg` (..., 2), north and east [m]."""
        bearing = np.arctan2(leg[..., 1], leg[..., 0]) % (2 * math.pi)
        return np.hypot(leg[..., 0], leg[..., 1]) * self.slowness_at(bearing)

    def slowness_at(self, bearing: Array) -> Array:
        """Interpolate the table at bearings in [0, 2 pi)."""
        place = bearing * (BEARINGS / (2 * math.pi))
        whole = np.floor(place).astype(int)
        share = place - whole
        low, high = self.slowness[whole % BEARINGS], self.slowness[(whole + 1) % BEARINGS]
        return (1 - share) * low + share * high

    def path_s(self, points: Array) -> float:
        """Time [s] of a path through `points` (n, 2): its legs and the turns between them."""
        legs = _legs(points)
        return WANDER * (float(np.sum(self.leg_s(legs))) + self.turn_s_per_rad * _turned(legs))

    def path_wh(self, points: Array) -> float:
        """Energy [Wh] of a path through `points` (n, 2)."""
        turning_j = self.turn_j_per_rad * _turned(_legs(points))
        return (self.power_w * self.path_s(points) + turning_j) / 3600

    def mean_power_w(self, points: Array) -> float:
        """Mean power [W] of a path through `points` (n, 2), turns included."""
        seconds = self.path_s(points)
        return 3600 * self.path_wh(points) / seconds if seconds > 0 else self.power_w


def travel_of(vessel: Vessel, speed: tuple[float, float], weather: Weather) -> Travel:
    """Return what travelling costs a vessel. Raises `PlanError` when the weather is too strong."""
    bearings = np.arange(BEARINGS) * (2 * math.pi / BEARINGS)
    speeds = np.array([ground_speed(vessel, speed[1], weather, b) for b in bearings])
    if speeds.min() < min(speed[0], 0.9 * vessel.speed_max_mps):
        worst = math.degrees(bearings[int(np.argmin(speeds))])
        raise PlanError(
            f"In this current and wind vessel {vessel.name!r} makes {max(speeds.min(), 0):.2f} m/s "
            f"over ground towards {worst:.0f} degrees, less than the window's {speed[0]:g} m/s; "
            "wait for better weather or lower the window."
        )
    pace = float(np.mean(speeds))
    rate = 0.5 * yaw_rate_max_radps(vessel)
    thrust = 0.5 * vessel.surge_drag_n(pace)
    power = drive_power_w(vessel, (thrust, thrust), pace)
    turning = drive_power_w(vessel, (vessel.thrust_max_n, vessel.thrust_min_n), pace)
    return Travel(
        slowness=1.0 / speeds,
        turn_s_per_rad=TURN_SHARE / rate,
        power_w=power,
        turn_j_per_rad=TURN_ENERGY * max(turning - power, 0.0) / yaw_rate_max_radps(vessel),
    )


def _legs(points: Array) -> Array:
    """The legs (m, 2) of a path, without those of no length."""
    legs = np.diff(points, axis=0)
    return legs[np.hypot(*legs.T) > 1e-9]


def _turned(legs: Array) -> float:
    """The sum of the angles between legs (m, 2) [rad]."""
    if len(legs) == 0:
        return 0.0
    bearing = np.arctan2(legs[:, 1], legs[:, 0])
    return float(np.sum(np.abs((np.diff(bearing) + math.pi) % (2 * math.pi) - math.pi)))


def ground_speed(vessel: Vessel, wanted: float, weather: Weather, bearing: float) -> float:
    """Speed over ground along a bearing [m/s]: the wanted one, or what the weather allows."""
    north, east = math.cos(bearing), math.sin(bearing)
    along = weather.current_north_mps * north + weather.current_east_mps * east
    across = weather.current_east_mps * north - weather.current_north_mps * east
    push = weather.wind_force_north_n * north + weather.wind_force_east_n * east
    force = THRUST_SHARE * 2 * vessel.thrust_max_n + push
    if force <= 0:
        return 0.0
    through = steady_rate(-vessel.x_u, -vessel.x_uu, force)
    if abs(across) >= through:
        return 0.0
    return min(wanted, math.sqrt(through**2 - across**2) + along)
