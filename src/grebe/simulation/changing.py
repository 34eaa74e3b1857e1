"""Weather that changes while the boat sails: tides and gusts."""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import dataclass
from functools import cached_property
from typing import TYPE_CHECKING

import numpy as np

from grebe.core.dynamics import Weather
from grebe.core.errors import UsageError

if TYPE_CHECKING:
    from numpy.typing import NDArray

# The weather at a time [s].
WeatherAt = Callable[[float], Weather]
GUST_STEP_S = 0.25
LONGEST_S = 7200.0


@dataclass(frozen=True, kw_only=True)
class Tide:
    """A current [m/s] that oscillates along one bearing [rad] with a period [s]."""

    current_mps: float
    period_s: float
    bearing_rad: float = 0.0

    def __post_init__(self) -> None:
        if not self.period_s > 0:
            raise UsageError(f"A tide cannot turn in {self.period_s:g} s; give more than 0.")

    def __call__(self, time_s: float) -> Weather:
        """The current at a time [s]; it is strongest at 0."""
        now = self.current_mps * math.cos(2 * math.pi * time_s / self.period_s)
        return Weather(
            current_north_mps=now * math.cos(self.bearing_rad),
            current_east_mps=now * math.sin(self.bearing_rad),
        )


@dataclass(frozen=True, kw_only=True)
class Gusts:
    """A mean wind force [N] with gusts, an Ornstein-Uhlenbeck process in each component.

    `sd_n` is the gusts' standard deviation, `memory_s` their time constant.
    """

    mean_north_n: float = 0.0
    mean_east_n: float = 0.0
    sd_n: float
    memory_s: float = 5.0
    seed: int = 0

    def __post_init__(self) -> None:
        if self.sd_n < 0 or not self.memory_s > 0:
            raise UsageError(
                "Gusts need a standard deviation of 0 or more and a duration above 0 s."
            )

    @cached_property
    def _path(self) -> NDArray[np.float64]:
        count = round(LONGEST_S / GUST_STEP_S)
        keep = math.exp(-GUST_STEP_S / self.memory_s)
        shocks = np.random.default_rng(self.seed).normal(size=(count, 2))
        path = np.empty((count, 2))
        path[0] = self.sd_n * shocks[0]
        for i in range(1, count):
            path[i] = keep * path[i - 1] + self.sd_n * math.sqrt(1 - keep**2) * shocks[i]
        return path

    def __call__(self, time_s: float) -> Weather:
        """The force at a time [s]; the gusts repeat after two hours."""
        north, east = self._path[int(time_s / GUST_STEP_S) % len(self._path)].tolist()
        return Weather(
            wind_force_north_n=self.mean_north_n + north, wind_force_east_n=self.mean_east_n + east
        )
