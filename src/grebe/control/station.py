"""Stopping, and holding a position with two thrusters.

Both are feedback laws without memory, functions of a state, so that predictions made with them
match what the boat does. `brake` stops the boat without turning. `keep` first brakes a boat that is
fast and not on its way to the place, unless even full thrust astern could not hold it. It then
points the bow along the velocity through the water that leads to the place, which in a current is
against the current, and drives at that velocity.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass
from functools import cached_property

from grebe.core.dynamics import Weather
from grebe.core.events import Thrusts
from grebe.core.inner_loop import yaw_rate_max_radps
from grebe.core.vessel import Vessel, steady_rate

# Wanted speed for each metre off the place [1/s], and its maximum [m/s].
APPROACH_PER_S, APPROACH_MPS = 0.25, 0.6
# Share of full thrust counted for speed; the rest is left to steer with.
STEER_SHARE = 0.9
# Within this distance the boat is at the place [m]; a velocity through the water below this needs
# no heading [m/s].
THERE_M, IDLE_MPS = 0.75, 0.15
# A boat goes astern only if its speed astern exceeds the drift by this much [m/s].
SPARE_MPS = 0.2
# If the heading is off by more than this, the boat turns on the spot [rad].
TURN_FIRST_RAD = math.radians(60)
# A bearing within this angle of dead astern on the port side is turned to over starboard [rad].
ASTERN_SIDE_RAD = math.pi / 6
# Surge above which the boat brakes before it turns, and below which it turns with full power [m/s].
# Between them the law blends both: with a jump, a boat that is pushed ahead by its turning would
# stay at the jump.
FAST_MPS, SLOW_MPS = 0.35, 0.1
# Share of the span between full ahead and full astern that is reserved for turning.
LEAST_TURN_SHARE = 0.15
# Shortest time constants of the feedback of surge and of yaw rate [s].
SURGE_S, YAW_S = 0.6, 0.5
# Time in which a heading error should be corrected [s].
HEADING_S = 1.2


@dataclass(frozen=True, kw_only=True)
class StationKeeper:
    """Both laws for one boat.

    `weaker_share` is the share of full thrust that the weaker thruster is assumed to give.
    `by_motion`: an autopilot holds the speed and the yaw rate that the thrusts lead to. The thrusts
    are then those that maintain the wanted motion, without feedback, which would turn the
    estimates' noise into orders.
    """

    vessel: Vessel
    weaker_share: float = 1.0
    by_motion: bool = False

    @cached_property
    def turn_s(self) -> float:
        """Time [s] of half a turn."""
        return math.pi / self._fastest_radps

    @cached_property
    def _astern_mps(self) -> float:
        """Speed astern through the water [m/s].

        It is 0 without `by_motion`: a boat that is steered by its thrusters turns instead.
        """
        if not self.by_motion:
            return 0.0
        force = -2 * self.weaker_share * self.vessel.thrust_min_n
        return steady_rate(-self.vessel.x_u, -self.vessel.x_uu, force)

    @cached_property
    def _fastest_radps(self) -> float:
        return 0.7 * yaw_rate_max_radps(self.vessel)

    def brake(self, state: Sequence[float], weather: Weather) -> Thrusts:
        """Return the thrusts (F_1, F_2) [N] that bring the surge over ground to rest.

        Both thrusters give the same thrust, so that the boat goes straight on. It is limited to
        what the weaker one has, `weaker_share` of full thrust astern, or ahead if the boat goes
        astern.
        """
        vessel, heading, surge = self.vessel, state[2], state[3]
        ahead = _along(weather.current_north_mps, weather.current_east_mps, heading)
        push = _along(weather.wind_force_north_n, weather.wind_force_east_n, heading)
        # Thrust that holds the boat at rest over ground, plus that which stops it in `SURGE_S`.
        wanted = vessel.surge_drag_n(-ahead) - push - vessel.m11_kg * surge / SURGE_S
        least, most = vessel.thrust_min_n, vessel.thrust_max_n
        each = min(max(wanted / 2, self.weaker_share * least), self.weaker_share * most)
        return each, each

    def keep(self, state: Sequence[float], weather: Weather, place: tuple[float, float]) -> Thrusts:
        """Return the thrusts (F_1, F_2) [N] that bring the boat to a place and hold it there.

        `state` (6,), `place` (north, east) [m]. In a current the boat points its bow against it.
        The law has no integral term, so the boat is held at a small distance from the place.
        """
        heading, surge, yaw_rate = state[2], state[3], state[5]
        # The wind is treated as the current that would need as much thrust.
        drift = _with_wind(self.vessel, weather)
        through_north, through_east = _wanted_through(state, drift, place)
        speed = math.hypot(through_north, through_east)
        if speed < IDLE_MPS:
            return self.brake(state, weather)
        turn = _turn_to(math.atan2(through_east, through_north), heading)
        if abs(turn) > math.pi / 2 and self._astern_mps > math.hypot(*drift) + SPARE_MPS:
            # Go stern first, without the room and the time of half a turn.
            turn = math.remainder(turn - math.pi, 2 * math.pi)
            speed = -min(speed, self._astern_mps)
        if abs(turn) > TURN_FIRST_RAD:
            return self._braked_turn(state, weather, turn)
        wanted, ahead = speed * math.cos(turn), _along(*drift, heading)
        push = self._push(wanted, wanted + ahead - surge)
        moment = self._moment(turn, yaw_rate) - self._coupling(state, weather)
        return _allocated(self.vessel, push, moment)

    def _braked_turn(self, state: Sequence[float], weather: Weather, turn: float) -> Thrusts:
        """Thrusts for a large turn: the boat brakes, and turns faster the slower it is."""
        carried = self._carried(state[2], weather)
        each, _ = self.brake(state, weather)
        share = max((FAST_MPS - abs(state[3])) / (FAST_MPS - SLOW_MPS), carried)
        moment = self._moment(turn, state[5], min(max(share, 0.0), 1.0))
        return _allocated(
            self.vessel, (1 - carried) * each, moment - self._coupling(state, weather)
        )

    def _carried(self, heading: float, weather: Weather) -> float:
        """Futility of braking against current and wind before a turn, from 0 to 1.

        0 if half of the available thrust holds the boat over ground, 1 if all of it does not.
        """
        vessel = self.vessel
        needed = vessel.surge_drag_n(-_along(*_with_wind(vessel, weather), heading))
        has = self.weaker_share * (vessel.thrust_min_n if needed < 0 else vessel.thrust_max_n)
        if has == 0:
            return 1.0 if needed else 0.0
        return min(max(needed / has - 1, 0.0), 1.0)

    def _coupling(self, state: Sequence[float], weather: Weather) -> float:
        """Moment [N m] of surge and sway through the water, Eq. (9); it turns a hull broadside."""
        _, _, heading, surge, sway, _ = state
        north, east = weather.current_north_mps, weather.current_east_mps
        aside = math.cos(heading) * east - math.sin(heading) * north
        return self.vessel.yaw_coupling_kg * (surge - _along(north, east, heading)) * (sway - aside)

    def _push(self, wanted_mps: float, missing_mps: float) -> float:
        """Thrust of each thruster [N] for a speed through the water, `missing_mps` from it."""
        lag = 0.0 if self.by_motion else self.vessel.m11_kg / SURGE_S
        return 0.5 * (self.vessel.surge_drag_n(wanted_mps) + lag * missing_mps)

    def _moment(self, turn: float, yaw_rate: float, share: float = 1.0) -> float:
        """Moment [N m] that turns the bow by `turn` [rad] and then holds it.

        `share` limits the yaw rate to a share of the boat's largest.
        """
        vessel, fastest = self.vessel, self._fastest_radps
        wanted = share * min(max(turn / HEADING_S, -fastest), fastest)
        drag = -(vessel.n_r + vessel.n_rr * abs(wanted)) * wanted
        gain = 0.0 if self.by_motion else vessel.m33_kgm2 / YAW_S
        return drag + gain * (wanted - yaw_rate)


def reach_mps(vessel: Vessel, weather: Weather) -> float:
    """Return the boat's speed in excess of the drift [m/s]; if negative, it is carried off."""
    full = STEER_SHARE * 2 * vessel.thrust_max_n
    return steady_rate(-vessel.x_u, -vessel.x_uu, full) - drift_mps(vessel, weather)


def drift_mps(vessel: Vessel, weather: Weather) -> float:
    """Return the speed through the water [m/s] that holds the boat against current and wind."""
    return math.hypot(*_with_wind(vessel, weather))


def _wanted_through(
    state: Sequence[float], drift: tuple[float, float], place: tuple[float, float]
) -> tuple[float, float]:
    """The velocity through the water (north, east) that makes the wanted one over ground."""
    off_north, off_east = place[0] - state[0], place[1] - state[1]
    away = math.hypot(off_north, off_east)
    pace = min(APPROACH_PER_S * max(away - THERE_M, 0.0), APPROACH_MPS) / max(away, 1e-9)
    return pace * off_north - drift[0], pace * off_east - drift[1]


def _with_wind(vessel: Vessel, weather: Weather) -> tuple[float, float]:
    """Current plus the velocity through the water that the wind alone would cause."""
    force = math.hypot(weather.wind_force_north_n, weather.wind_force_east_n)
    north, east = weather.current_north_mps, weather.current_east_mps
    if force <= 0:
        return north, east
    speed = steady_rate(-vessel.x_u, -vessel.x_uu, force)
    share = speed / force
    return north + share * weather.wind_force_north_n, east + share * weather.wind_force_east_n


def _turn_to(bearing: float, heading: float) -> float:
    """Turn [rad] to a bearing, from -5 pi / 6 to 7 pi / 6.

    A boat turns to starboard if the place is behind it, whatever side noise would suggest.
    """
    return math.remainder(bearing - heading - ASTERN_SIDE_RAD, 2 * math.pi) + ASTERN_SIDE_RAD


def _along(north: float, east: float, heading: float) -> float:
    return math.cos(heading) * north + math.sin(heading) * east


def _allocated(vessel: Vessel, common: float, moment: float) -> tuple[float, float]:
    """Thrusts within their limits for a common thrust and a moment.

    The turn has priority over a push ahead: a hull that is driven against a current with its bow
    off it would be turned broadside. A push that is small, or astern, has priority over the turn,
    except for `LEAST_TURN_SHARE`: a boat that turns with full power is pushed ahead, because it
    has less thrust astern.
    """
    low, high = vessel.thrust_min_n, vessel.thrust_max_n
    span, push = high - low, min(max(common, low), high)
    room = max(min(0.5 * span, push - low), LEAST_TURN_SHARE * span)
    half = min(max(moment / (2 * vessel.arm_m), -room), room)
    middle = min(max(push, low + abs(half)), high - abs(half))
    return middle + half, middle - half
