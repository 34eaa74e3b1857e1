"""Sensor lag: a sonde reports the water of some seconds ago, some metres back.

The lag is a pure delay (tubing, averaging) followed by a first-order response of time constant tau:
the true value is the reading `delay` later, plus tau times the readings' slope then. Both are
estimated where one line is run twice, as those that bring the passes closest together (Fofonoff
and Millard 1983, section on response times, for the first-order correction).
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np
from scipy.spatial import KDTree

from grebe.core.samples import Flag, Samples

if TYPE_CHECKING:
    from numpy.typing import NDArray

    Array = NDArray[np.floating]

# Half of the window in which the slope is estimated [s]; a shorter one would amplify the noise.
LEAST_HALF_WINDOW_S = 3.0
# Places of two passes within this distance count as the same [m].
SAME_PLACE_M = 4.0
FEWEST_PAIRS = 30
# Two runs of one line share at least this part of the shorter run; with less, they only touch.
SMALLEST_SHARE = 0.2
# A gap longer than this many usual steps is not interpolated.
GAP_STEPS = 5.0
DELAYS_S = np.arange(0.0, 31.0, 1.0)
TAUS_S = np.arange(0.0, 31.0, 1.0)
# A correction must reduce the difference of the passes by this much more than chance does.
CLEAR_GAIN = 0.15


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
        """The pass without the lag; NaN where the record ends too early."""
        return Pass(
            times=self.times,
            positions=self.positions,
            values=unlagged(self.times, self.values, lag),
        )


@dataclass(frozen=True, kw_only=True)
class LagEstimate:
    """The lag that brings two passes closest, and the rms of their differences (less the mean):
    before, after, and at the best shift the `wrong_way`. `advised` if the gain is clear.
    """

    lag: Lag
    pairs: int
    before: float
    after: float
    wrong_way: float

    @property
    def gain(self) -> float:
        """Share of the rms difference that the correction removes."""
        return 1 - self.after / self.before if self.before > 0 else 0.0

    @property
    def advised(self) -> bool:
        """Whether the correction is worth making."""
        chance = 1 - self.wrong_way / self.before if self.before > 0 else 0.0
        inside = self.lag.delay_s < DELAYS_S[-1] and self.lag.tau_s < TAUS_S[-1]
        return inside and self.gain > max(chance, 0.0) + CLEAR_GAIN


def unlagged(times: Array, values: Array, lag: Lag) -> Array:
    """Values (n,) as a sensor without lag would have given them at `times` (n,) [s], which must
    ascend; NaN where the record ends too early or has a gap.
    """
    known = np.isfinite(values)
    if (lag.delay_s == 0 and lag.tau_s == 0) or known.sum() < 2:
        return values
    late = times + lag.delay_s
    shifted = _between(late, times[known], values[known])
    if lag.tau_s > 0:
        slope = _line(times[known], values[known], lag.tau_s / 2)[1]
        shifted = shifted + lag.tau_s * _between(late, times[known], slope)
    return np.where(known, shifted, np.nan)


def corrected_values(samples: Samples, lags: Mapping[str, Lag]) -> dict[str, Array]:
    """The values (n,) of each quantity without the sensors' lag.

    A value flagged suspect or failed is not used to correct the others, and becomes NaN.
    """
    corrected: dict[str, Array] = dict(samples.values)
    for key, lag in lags.items():
        good = np.flatnonzero(np.isin(samples.flags[key], Flag.USABLE))
        good = good[np.argsort(samples.times[good], kind="stable")]
        times, once, back = np.unique(samples.times[good], return_index=True, return_inverse=True)
        column = np.full(len(samples), np.nan)
        column[good] = unlagged(times, samples.values[key][good[once]], lag)[back]
        corrected[key] = column
    return corrected


def _between(at: Array, times: Array, values: Array) -> Array:
    """Linear interpolation; NaN before and after the record and within its gaps."""
    steps = np.diff(times)
    longest = GAP_STEPS * float(np.median(steps))
    after = np.clip(np.searchsorted(times, at), 1, len(times) - 1)
    inside = (at >= times[0]) & (at <= times[-1])
    known = inside & (
        (steps[after - 1] <= longest) | (at == times[after - 1]) | (at == times[after])
    )
    return np.where(known, np.interp(at, times, values), np.nan)


def _line(times: Array, values: Array, half_s: float) -> tuple[Array, Array]:
    """Value and slope, at each sample, of the straight line through the samples within `half_s`."""
    half = max(LEAST_HALF_WINDOW_S, half_s)
    low = np.searchsorted(times, times - half)
    high = np.searchsorted(times, times + half, side="right")
    t, v = times - times[0], values - values[0]

    def sums(column: Array) -> Array:
        total = np.concatenate([[0.0], np.cumsum(column)])
        return total[high] - total[low]

    count = (high - low).astype(float)
    spread = sums(t * t) - sums(t) ** 2 / count
    joint = sums(t * v) - sums(t) * sums(v) / count
    slope = np.where(spread > 1e-9, joint / np.maximum(spread, 1e-9), 0.0)
    return values[0] + sums(v) / count + slope * (t - sums(t) / count), slope


def estimate_lag(one: Pass, other: Pass) -> LagEstimate:
    """Search the delay and time constant that make the difference between two passes smallest.

    All candidates are compared at the same pairs of places and on equally smoothed values;
    otherwise a shift by part of a sampling step would look better just because it smooths. A lag is
    advised only if it gains clearly more than the best shift the wrong way, which no sensor has.
    Raises `ValueError` if the passes share too few places.
    """
    one, other = _smoothed(one), _smoothed(other)
    distance, index = KDTree(other.positions).query(one.positions)
    index = np.asarray(index)
    near = (distance <= SAME_PLACE_M) & _within_reach(one.times) & _within_reach(other.times)[index]
    if near.sum() < FEWEST_PAIRS:
        raise ValueError(
            f"the passes share only {int(near.sum())} places within {SAME_PLACE_M:g} m, not "
            f"counting the ends of the records; a lag needs {FEWEST_PAIRS}"
        )
    share = near.sum() / min(len(one.times), len(other.times))
    if share < SMALLEST_SHARE:
        raise ValueError(
            f"they are not two runs of the same line: only {share:.0%} of the shorter lies "
            f"within {SAME_PLACE_M:g} m of the other; give two runs of one line"
        )

    def difference(lag: Lag, sign: float = 1.0) -> float:
        gaps = [
            _between(run.times + sign * lag.delay_s, run.times, run.values)
            + lag.tau_s * _between(run.times + sign * lag.delay_s, run.times, slope)
            for run, slope in slopes[lag.tau_s]
        ]
        gap = gaps[0][near] - gaps[1][index[near]]
        return float(np.nanstd(gap))

    slopes = {
        float(tau): [(run, _line(run.times, run.values, tau / 2)[1]) for run in (one, other)]
        for tau in TAUS_S
    }
    lags = [Lag(delay_s=float(d), tau_s=float(t)) for d in DELAYS_S for t in TAUS_S]
    best = min(lags, key=difference)
    wrong_way = min(difference(Lag(delay_s=float(d)), -1.0) for d in DELAYS_S)
    return LagEstimate(
        lag=best,
        pairs=int(near.sum()),
        before=difference(Lag()),
        after=difference(best),
        wrong_way=wrong_way,
    )


def _smoothed(run: Pass) -> Pass:
    return Pass(
        times=run.times,
        positions=run.positions,
        values=_line(run.times, run.values, LEAST_HALF_WINDOW_S)[0],
    )


def _within_reach(times: Array) -> NDArray[np.bool_]:
    """Which samples can be shifted either way by every delay that is tried."""
    reach = float(DELAYS_S[-1])
    return (times >= times[0] + reach) & (times <= times[-1] - reach)
