"""Faults of a simulated boat: thrusters, weeds, shoals, currents, batteries, blindness.

`Faults` lists them with their times, `FaultyPlant` is the boat that has them. The boat's reports
and measurements are made by the link.
"""

from __future__ import annotations

import math
from dataclasses import dataclass, replace
from typing import Literal

import shapely

from grebe.core.dynamics import CALM, Weather
from grebe.core.errors import UsageError
from grebe.core.vessel import Vessel
from grebe.simulation.plant import PLANT_STEP_S, Plant

NEVER = math.inf
# Factor on the drag of a boat that goes ahead in weeds; astern it slips out.
WEEDS_DRAG = 40.0


@dataclass(frozen=True, kw_only=True)
class Faults:
    """Faults and when they begin, in seconds of the boat's time.

    `dead` is the side whose thruster gives nothing from `dead_at_s` on. In `weeds` (a local
    polygon) the boat is held until `weeds_until_s`. Over `shoal` the water is `shoal_depth_m`
    deep, elsewhere `depth_m` (None: no sonar). The current rises by `rising` (north, east) [m/s per
    s] from `rises_at_s` to `rises_until_s`. A battery that lasts `battery_s` from full begins at
    `battery_share` (None: it is not reported). In the time spans `blind`, estimates are NaN.
    """

    dead: Literal["port", "starboard"] | None = None
    dead_at_s: float = 0.0
    weeds: shapely.Polygon | None = None
    weeds_until_s: float = NEVER
    shoal: shapely.Polygon | None = None
    shoal_depth_m: float = 0.1
    depth_m: float | None = None
    rising: tuple[float, float] = (0.0, 0.0)
    rises_at_s: float = 0.0
    rises_until_s: float = NEVER
    battery_share: float | None = None
    battery_s: float = 3600.0
    blind: tuple[tuple[float, float], ...] = ()

    def __post_init__(self) -> None:
        if self.battery_share is not None and not 0 <= self.battery_share <= 1:
            raise UsageError(f"A battery's share must be 0 to 1, not {self.battery_share:g}.")
        if not self.battery_s > 0:
            raise UsageError(f"A battery cannot last {self.battery_s:g} s; give more than 0.")

    def is_blind(self, time_s: float) -> bool:
        """Whether the boat does not know its position at a time."""
        return any(begin <= time_s < end for begin, end in self.blind)

    def share_left(self, time_s: float) -> float | None:
        """Remaining share of the battery, 0 to 1; None if it is not reported."""
        if self.battery_share is None:
            return None
        return max(0.0, self.battery_share - time_s / self.battery_s)

    def depth_at(self, north_m: float, east_m: float) -> float | None:
        """Depth of the water at a position [m]; None without a sonar."""
        if self.shoal is not None and shapely.intersects_xy(self.shoal, north_m, east_m):
            return self.shoal_depth_m
        return self.depth_m


NO_FAULTS = Faults()


class FaultyPlant(Plant):
    """A boat on the water with faults."""

    def __init__(
        self,
        vessel: Vessel,
        state: tuple[float, float, float, float, float, float],
        weather: Weather = CALM,
        faults: Faults = NO_FAULTS,
    ) -> None:
        super().__init__(vessel, state, weather)
        self._faults, self._whole, self._first = faults, vessel, weather
        self._held = replace(
            vessel,
            **{name: WEEDS_DRAG * getattr(vessel, name) for name in ("x_u", "x_uu", "n_r", "n_rr")},
        )

    def advance(self, duration_s: float) -> None:
        """Advance as `Plant` does, with the faults checked before each step."""
        steps = max(1, math.ceil(duration_s / PLANT_STEP_S - 1e-9))
        for _ in range(steps):
            self.vessel = self._held if self._in_weeds else self._whole
            self.weather = self._weather_now()
            super().advance(duration_s / steps)

    def _lagged(self, step_s: float) -> tuple[float, float]:
        port, starboard = super()._lagged(step_s)
        if self._faults.dead is None or self.time_s < self._faults.dead_at_s:
            return port, starboard
        return (0.0, starboard) if self._faults.dead == "port" else (port, 0.0)

    @property
    def _in_weeds(self) -> bool:
        weeds = self._faults.weeds
        if weeds is None or self.time_s >= self._faults.weeds_until_s or self.state[3] < 0:
            return False
        return bool(shapely.intersects_xy(weeds, self.state[0], self.state[1]))

    def _weather_now(self) -> Weather:
        until = min(self.time_s, self._faults.rises_until_s)
        seconds = max(0.0, until - self._faults.rises_at_s)
        north, east = self._faults.rising
        return replace(
            self._first,
            current_north_mps=self._first.current_north_mps + north * seconds,
            current_east_mps=self._first.current_east_mps + east * seconds,
        )
