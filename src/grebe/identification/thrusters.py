"""From commands to the thrust on the hull: latency, thrust curve, lag.

A throttle is converted to a steady thrust s by the curve of `Vessel.thrust_of`, `latency_s` later.
The thrust f follows s with the time constant T = `lag_s`: f' = (s - f) / T. A step of the
integration uses the *mean* of f over the step, s_mean - T (f_end - f_begin) / h. If s jumps within
a step, its mean changes continuously with the time of the jump, so everything is continuous in the
latency.
"""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np
from scipy.signal import lfilter

if TYPE_CHECKING:
    from numpy.typing import NDArray

    Array = NDArray[np.float64]

# Lags below this are treated as zero, because their exponential would only add rounding errors.
SHORTEST_LAG_S = 1e-4


@dataclass(frozen=True, kw_only=True)
class Thrusters:
    """Parameters from command to thrust.

    `full_ahead_n` and `full_astern_n` (both positive) are the thrusts at full command, `exponent`
    is that of the curve. `trim` is the logarithm of the ratio of the port thruster's thrust to the
    starboard's at the same command.
    """

    full_ahead_n: float
    full_astern_n: float
    exponent: float
    lag_s: float
    latency_s: float
    trim: float = 0.0

    def steady(self, throttles: Array) -> Array:
        """Steady thrusts (m, 2) [N] for throttles (m, 2)."""
        full = np.where(throttles >= 0, self.full_ahead_n, self.full_astern_n)
        thrust = np.sign(throttles) * full * np.abs(throttles) ** self.exponent
        return thrust * np.exp(np.array([0.5, -0.5]) * self.trim)

    def mean_thrusts(self, command_times: Array, throttles: Array, grid: Array) -> Array:
        """Mean thrusts (k, 2) [N] over the steps of a uniform `grid` (k + 1,) [s].

        The first command also holds before its time.
        """
        step = float(grid[1] - grid[0])
        thrusts = self.steady(throttles)
        edges = np.concatenate([[grid[0] - 1e4], command_times[1:], [grid[-1] + 1e4]])
        impulse = np.vstack([np.zeros(2), np.cumsum(thrusts * np.diff(edges)[:, None], axis=0)])
        shifted = grid - self.latency_s
        means = np.column_stack(
            [np.diff(np.interp(shifted, edges, impulse[:, i])) / step for i in (0, 1)]
        )
        if self.lag_s < SHORTEST_LAG_S:
            return means
        keep = math.exp(-step / self.lag_s)
        start = means[:1]
        ends = lfilter([1 - keep], [1, -keep], means, axis=0, zi=keep * start)[0]
        changes = np.diff(np.vstack([start, np.real(ends)]), axis=0)
        return means - self.lag_s / step * changes
