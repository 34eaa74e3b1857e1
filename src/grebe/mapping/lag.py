"""Sensor lag: what a sonde says now is what the water was a moment ago and some metres back.

A pure delay (tubing, averaging) and a first-order response of time constant tau: the true
value is what the sensor says `delay` later plus tau times its slope then. Both are estimated
where one line is run twice: they bring the passes together (Fofonoff and Millard 1983, section
on response times, for the first-order correction).
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np
from scipy.spatial import KDTree

if TYPE_CHECKING:
    from numpy.typing import NDArray

    Array = NDArray[np.floating]

# Half of the window in which the slope is estimated [s]: less would amplify the noise.
LEAST_HALF_WINDOW_S = 3.0
# Places of two passes within this distance are the same [m].
SAME_PLACE_M = 4.0
FEWEST_PAIRS = 30
DELAYS_S = np.arange(0.0, 31.0, 1.0)
TAUS_S = np.arange(0.0, 31.0, 1.0)
# A correction must lower the difference of the passes by this much to be advised.
CLEAR_GAIN = 0.05


@dataclass(frozen=True, kw_only=True)
class Lag:
    """Delay and time constant of one sensor [s]."""

    delay_s: float = 0.0
    tau_s: float = 0.0

    def __post_init__(self) -> None:
        if not (0 <= self.delay_s < np.inf and 0 <= self.tau_s < np.inf):
            raise ValueError(f"a lag is 0 or more seconds: {self}")


@dataclass(frozen=True, kw_only=True)
class Pass:
    """One run along a line: `times` (n,) [s], `positions` (n, 2) [m], `values` (n,)."""

    times: Array
    positions: Array
    values: Array

    def corrected(self, lag: Lag) -> Pass:
        """The pass without the lag; NaN where the record ends too early to know."""
        return Pass(
            times=self.times,
            positions=self.positions,
            values=unlagged(self.times, self.values, lag),
        )


@dataclass(frozen=True, kw_only=True)
class LagEstimate:
    """The lag that brings two passes closest, and the rms of their differences (less its mean)
    before and after; `advised` where the gain is clear.
    """

    lag: Lag
    pairs: int
    before: float
    after: float

    @property
    def gain(self) -> float:
        """Share of the rms difference that the correction takes away."""
        return 1 - self.after / self.before if self.before > 0 else 0.0

    @property
    def advised(self) -> bool:
        """Whether the correction is worth making."""
        return self.gain > CLEAR_GAIN


def unlagged(times: Array, values: Array, lag: Lag) -> Array:
    """Values (n,) as a sensor without lag would have given them at `times` (n,) [s], which
    ascend; NaN where the record ends before it could tell.
    """
    known = np.isfinite(values)
    if (lag.delay_s == 0 and lag.tau_s == 0) or known.sum() < 2:
        return values
    late = times + lag.delay_s
    shifted = np.interp(late, times[known], values[known], right=np.nan)
    if lag.tau_s > 0:
        shifted = shifted + lag.tau_s * np.interp(
            late, times[known], _slope(times[known], values[known], lag.tau_s)
        )
    return np.where(known, shifted, np.nan)


def _slope(times: Array, values: Array, tau_s: float) -> Array:
    """Slope of a straight line through the samples within half a window to either side."""
    half = max(LEAST_HALF_WINDOW_S, tau_s / 2)
    low = np.searchsorted(times, times - half)
    high = np.searchsorted(times, times + half, side="right")
    t, v = times - times[0], values - values[0]

    def sums(column: Array) -> Array:
        total = np.concatenate([[0.0], np.cumsum(column)])
        return total[high] - total[low]

    count = (high - low).astype(float)
    spread = sums(t * t) - sums(t) ** 2 / count
    joint = sums(t * v) - sums(t) * sums(v) / count
    return np.where(spread > 1e-9, joint / np.maximum(spread, 1e-9), 0.0)


def estimate_lag(one: Pass, other: Pass) -> LagEstimate:
    """Search delay and time constant for the smallest difference between two passes.

    Raises `ValueError` where they share too few places.
    """
    distance, index = KDTree(other.positions).query(one.positions)
    near = np.flatnonzero(distance <= SAME_PLACE_M)
    if len(near) < FEWEST_PAIRS:
        raise ValueError(
            f"the passes share {len(near)} places within {SAME_PLACE_M:g} m; a lag needs "
            f"{FEWEST_PAIRS}"
        )
    index = np.asarray(index)[near]

    def difference(lag: Lag) -> float:
        gap = one.corrected(lag).values[near] - other.corrected(lag).values[index]
        gap = gap[np.isfinite(gap)]
        return float(np.std(gap)) if len(gap) >= FEWEST_PAIRS else np.inf

    lags = [Lag(delay_s=float(d), tau_s=float(t)) for d in DELAYS_S for t in TAUS_S]
    best = min(lags, key=difference)
    return LagEstimate(lag=best, pairs=len(near), before=difference(Lag()), after=difference(best))
