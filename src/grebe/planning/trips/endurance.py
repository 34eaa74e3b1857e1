"""How long a sortie may be if the boat has to come home in the worst of the stated weather."""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np

from grebe.core.dynamics import Weather, drive_power_w
from grebe.core.errors import PlanError, UsageError
from grebe.core.plan_settings import PlanSettings
from grebe.core.vessel import Vessel
from grebe.planning.paths.travel import WANDER, ground_speed

if TYPE_CHECKING:
    from numpy.typing import NDArray

# Added to the time of a path home, a share and a constant, as the mission's guard does.
HOME_SHARE, HOME_SLACK_S = 0.25, 30.0
# A sailed sortie may exceed its predicted time by this factor before the guard calls the boat home.
MARGIN = 1.08
LEAST_MPS = 0.05


@dataclass(frozen=True, kw_only=True)
class Endurance:
    """How long a sortie may be.

    `limit_s`: its longest time; `weight_home`: the weight of a second of the path home against one
    of the survey, since the path home may be against the weather, at a higher power; `slowest`: the
    slowness in the worst weather [s/m].
    """

    limit_s: float
    weight_home: float
    slowest: float

    def home_s(self, path_m: NDArray[np.float64]) -> NDArray[np.float64]:
        """Time that must be left of a sortie for a path home of length `path_m` [s]."""
        worst = WANDER * self.slowest * path_m
        return (1 + HOME_SHARE) * self.weight_home * worst + HOME_SLACK_S


def endurance_of(vessel: Vessel, settings: PlanSettings, power_w: float) -> Endurance:
    """Return the endurance of a boat that surveys at a mean power. Raises `PlanError` when it would
    not get home in the stated weather.

    The worst of the weather is a current and a wind as strong as stated, straight against the
    boat, in whatever direction it goes.
    """
    sorties = settings.sorties
    if sorties is None:
        raise UsageError("The plan has no settings of sorties.")
    weather = settings.weather
    current = math.hypot(weather.current_north_mps, weather.current_east_mps)
    wind = math.hypot(weather.wind_force_north_n, weather.wind_force_east_n)
    against = Weather(current_north_mps=-current, wind_force_north_n=-wind)
    worst = ground_speed(vessel, settings.speed_max_mps, against, 0.0)
    if worst < LEAST_MPS:
        raise PlanError(
            f"Vessel {vessel.name!r} cannot get home against a current of {current:g} m/s and a "
            f"wind of {wind:g} N; wait for better weather."
        )
    through = min(settings.speed_max_mps + current, vessel.speed_max_mps)
    each = 0.5 * vessel.surge_drag_n(through)
    power = drive_power_w(vessel, (each, each), through)
    limits = [(60 * sorties.minutes, 1.0)] if sorties.minutes is not None else []
    if sorties.battery_wh is not None:
        lasts_s = 3600 * sorties.battery_wh / power_w
        # A path home is straight, and may take less power than a survey with its many turns.
        limits.append((lasts_s, power / power_w))
    limit_s = (1 - sorties.reserve) * min(one for one, _ in limits) / MARGIN
    weight_home = max(factor for _, factor in limits)
    return Endurance(limit_s=limit_s, weight_home=weight_home, slowest=1 / worst)
