"""From commands to the thrust that the hull feels: latency, thrust curve, lag.

A throttle c becomes the thrust that `Vessel.thrust_of` says, `latency_s` later, and the thrust
follows it with the time constant T = `lag_s`: f' = (s - f) / T. What a step of the integration
sees is the *mean* of f over it, s_mean - T (f_end - f_begin) / h, and the mean of a signal that
jumps within a step moves with the jump: so everything is continuous in the latency.
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

# Lags below this are treated as zero: their exponential would only add rounding errors.
SHORTEST_LAG_S = 1e-4


@dataclass(frozen=True, kw_only=True)
class Thrusters:
    """How commands become thrust.

    `full_ahead_n` and `full_astern_n` (both positive) are thrusts at full command, `exponent`
    that of the curve; `trim` is the logarithm of the port thruster's thrust over the starboard's
    at the same command.
    """

    full_ahead_n: float
    full_astern_n: float
    exponent: float
    lag_s: float
    latency_s: float
    trim: float = 0.0

    def steady(self, throttles: Array) -> Array:
        """Thrusts (m, 2) [N] that throttles (m, 2) lead to in the end."""
        full = np.where(throttles >= 0, self.full_ahead_n, self.full_astern_n)
        thrust = np.sign(throttles) * full * np.abs(throttles) ** self.exponent
        return thrust * np.exp(np.array([0.5, -0.5]) * self.trim)

    def mean_thrusts(self, command_times: Array, throttles: Array, grid: Array) -> Array:
        """Mean thrusts (k, 2) [N] over the steps of a uniform `grid` (k + 1,) [s].

        Before the first command the first one holds.
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
