"""Thrusters that answer with a lag: what they can give, on the mean, in each stage of a horizon."""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np

if TYPE_CHECKING:
    from numpy.typing import NDArray

    Array = NDArray[np.float64]


@dataclass(frozen=True, kw_only=True)
class SlowThrusters:
    """Port and starboard give `now_n` and approach what they are told with a time constant of
    `lag_s`; both can be told from `least_n` to `most_n`.
    """

    now_n: tuple[float, float]
    least_n: float
    most_n: float
    lag_s: float

    def reach(self, durations: Array) -> Array:
        """Least and largest mean thrust (2, N, 2) [N], by side, stage and thruster, in stages of
        `durations` (N,) [s] where all that is told from now on is the least, or the most.

        The later a stage, the less is left of where the thrusters begin.
        """
        ends = np.concatenate([[0.0], np.cumsum(durations)])
        left = -np.diff(np.exp(-ends / self.lag_s)) * self.lag_s / np.maximum(durations, 1e-9)
        told = np.array([self.least_n, self.most_n])[:, None, None]
        return told + left[None, :, None] * (np.array(self.now_n) - told)
