"""Thrusters with a lag: the mean thrust that they can give in each stage of a horizon."""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np

if TYPE_CHECKING:
    from numpy.typing import NDArray

    Array = NDArray[np.float64]


@dataclass(frozen=True, kw_only=True)
class SlowThrusters:
    """State and limits of two thrusters with a lag.

    Port and starboard give `now_n` and approach their orders with a time constant of `lag_s`;
    orders range from `least_n` to `most_n`.
    """

    now_n: tuple[float, float]
    least_n: float
    most_n: float
    lag_s: float

    def reach(self, durations: Array) -> Array:
        """Least and largest mean thrust (2, N, 2) [N], by bound, stage and thruster.

        These are the means in stages of `durations` (N,) [s] if the least, or the largest, thrust
        is ordered from now on. The influence of the initial thrust decays with time.
        """
        ends = np.concatenate([[0.0], np.cumsum(durations)])
        left = -np.diff(np.exp(-ends / self.lag_s)) * self.lag_s / np.maximum(durations, 1e-9)
        told = np.array([self.least_n, self.most_n])[:, None, None]
        return told + left[None, :, None] * (np.array(self.now_n) - told)
