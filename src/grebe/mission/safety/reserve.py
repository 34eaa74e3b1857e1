"""Whether the time, the daylight and the battery that are left still suffice to reach home."""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np

from grebe.core.dynamics import Weather, drive_power_w
from grebe.core.vessel import Vessel
from grebe.mission.safety.settings import SafetySettings
from grebe.mission.safety.states import Cause, Facts, Finding
from grebe.planning.paths.travel import TURN_SHARE, WANDER, ground_speed

if TYPE_CHECKING:
    from numpy.typing import NDArray

# A battery's share must have fallen by this much before its consumption is measured.
LEAST_DROP = 0.01
# A leg on which the boat is slower than this makes a route home impassable [m/s].
LEAST_MPS = 0.05
HALF = 0.5


@dataclass(frozen=True, kw_only=True)
class Battery:
    """The first and the latest reported share of a battery's charge, with their times."""

    first: float | None = None
    first_s: float = 0.0
    now: float | None = None
    now_s: float = 0.0

    @property
    def share_per_s(self) -> float | None:
        """The measured consumption [1/s]; None until enough charge has been used to measure it."""
        if self.first is None or self.now is None or self.first - self.now < LEAST_DROP:
            return None
        seconds = self.now_s - self.first_s
        return (self.first - self.now) / seconds if seconds > 0 else None


def updated_battery(before: Battery, facts: Facts) -> Battery:
    """Return the battery, updated with a reported share; a share that rises is a new battery's."""
    share = facts.battery_share
    if share is None or not math.isfinite(share):
        return before
    if before.first is None or (before.now is not None and share > before.now + LEAST_DROP):
        return Battery(first=share, first_s=facts.time_s, now=share, now_s=facts.time_s)
    return Battery(first=before.first, first_s=before.first_s, now=share, now_s=facts.time_s)


def must_go_home(battery: Battery, facts: Facts, settings: SafetySettings) -> Finding | None:
    """Return why the boat must set out for home now; None if it need not."""
    if facts.home_s is None:
        return None
    # If current and wind block the route home for now, the boat carries on with the survey.
    home_s = facts.home_s if math.isfinite(facts.home_s) else 0.0
    longest = home_s * (1 + settings.home_share) + settings.home_slack_s
    way = f"home is {facts.home_s:.0f} s away"
    for left, cause, what in (
        (settings.max_s - facts.elapsed_s, Cause.TIME, "the time given"),
        (facts.light_s, Cause.DAYLIGHT, "the daylight"),
    ):
        if math.isfinite(left) and longest >= left:
            return Finding(cause=cause, message=f"{what} ends in {max(left, 0):.0f} s and {way}")
    return _battery_finding(battery, facts, settings, longest, way)


def _battery_finding(
    battery: Battery, facts: Facts, settings: SafetySettings, longest_s: float, way: str
) -> Finding | None:
    reserve = settings.battery_reserve
    if battery.now is not None:
        rate = battery.share_per_s or 0.0
        # Without a measured consumption the reserve alone counts.
        needed = 0.0 if rate == 0 else rate * longest_s
        if battery.now - needed > reserve:
            return None
        left = f"{battery.now:.0%} of the battery is left"
        return Finding(cause=Cause.BATTERY, message=f"{left}, {reserve:.0%} must remain, and {way}")
    if settings.battery_wh is None:
        return None
    left_wh = settings.battery_wh - facts.used_wh
    home_wh = facts.home_wh if math.isfinite(facts.home_wh) else 0.0
    needed_wh = home_wh * (1 + settings.home_share) + reserve * settings.battery_wh
    if left_wh > needed_wh:
        return None
    return Finding(
        cause=Cause.BATTERY,
        message=f"{max(left_wh, 0):.0f} Wh of the battery are left, {reserve:.0%} must remain, "
        f"and {way}",
    )


def route_home_s(
    vessel: Vessel, path: NDArray[np.float64], weather: Weather, speed_mps: float
) -> tuple[float, float]:
    """Return the time [s] and the energy [Wh] of a path (n, 2) at a speed over ground [m/s],
    reduced as the weather requires; infinite if the weather leaves no speed.
    """
    steps = np.diff(path, axis=0)
    steps = steps[np.hypot(*steps.T) > 1e-9]
    if len(steps) == 0:
        return 0.0, 0.0
    bearings = np.arctan2(steps[:, 1], steps[:, 0])
    speeds = [ground_speed(vessel, speed_mps, weather, b) for b in bearings.tolist()]
    if min(speeds) < LEAST_MPS:
        return math.inf, math.inf
    turns = np.abs((np.diff(bearings) + math.pi) % (2 * math.pi) - math.pi)
    moment = vessel.arm_m * (vessel.thrust_max_n - vessel.thrust_min_n)
    # The boat may have to turn about first: half a turn, with half its moment against linear drag.
    rate = HALF * moment / max(-(vessel.n_r + vessel.n_rr), 1e-9)
    turning = TURN_SHARE / rate * (float(np.sum(turns)) + math.pi)
    legs = float(np.sum(np.hypot(*steps.T) / np.array(speeds)))
    seconds = WANDER * legs + turning
    through = speed_mps + math.hypot(weather.current_north_mps, weather.current_east_mps)
    through = min(through, vessel.speed_max_mps)
    each = 0.5 * vessel.surge_drag_n(through)
    return seconds, drive_power_w(vessel, (each, each), through) * seconds / 3600
