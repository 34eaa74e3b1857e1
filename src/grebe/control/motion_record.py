"""The boat's recent states and the thrusts that were sent."""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np

from grebe.control.correction import LEAST_LAG_S
from grebe.control.rollout import lagged

if TYPE_CHECKING:
    from numpy.typing import NDArray

    Array = NDArray[np.float64]

# How far back earlier thrusts count under a lag, in lags, and in how many steps.
BEFORE_LAGS, BEFORE_STEPS = 4.0, 16


@dataclass(frozen=True, kw_only=True)
class MotionRecord:
    """Recent data: times (n,) [s], states (n, 6) and the thrusts that were sent.

    `impulses` (m, 2) [N s] is the integral of the thrusts over time, known at `order_times` (m,).
    `noise_sd` (6,): standard deviations of the white noise of the states.
    """

    times: Array
    states: Array
    order_times: Array
    impulses: Array
    noise_sd: Array

    def thrusts(self, dead_s: float, lag_s: float) -> Array:
        """Mean thrusts that acted between successive states, (n - 1, 2) [N]."""
        if lag_s < LEAST_LAG_S / 10:
            return self._mean_sent(self.times - dead_s)
        # The thrust at the first state follows from the orders before it.
        before = np.linspace(-BEFORE_LAGS * lag_s, 0.0, BEFORE_STEPS, endpoint=False)
        times = np.concatenate([self.times[0] + before, self.times])
        sent = self._mean_sent(times - dead_s)
        return lagged(sent, np.diff(times) / lag_s)[BEFORE_STEPS:]

    def _mean_sent(self, times: Array) -> Array:
        """Mean thrusts that were sent between successive times, (n - 1, 2) [N]."""
        impulse = np.column_stack(
            [np.interp(times, self.order_times, column) for column in self.impulses.T]
        )
        return np.diff(impulse, axis=0) / np.diff(times)[:, None]
