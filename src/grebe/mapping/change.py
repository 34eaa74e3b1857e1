"""How the water changed during a survey, and how late the sensor was.

A map shows one time, but its samples span an hour. What changes slowly and everywhere alike - the
warming of a day, the drift of a sensor - is modelled as a smooth process of time. It can be
separated from the covariance of place by restricted likelihood, because lines that are side by side
or cross were sailed at different times (Diggle and Ribeiro 2007, ch. 3, for the likelihood). A
third process holds the differences of two passes within minutes. It is distinguished from the slow
change and left in the readings: no time of the survey is free of it. A sensor's lag is estimated
in the same way: opposing lines agree at the places where the boat was some seconds before.

A sensor that responds slowly also smooths. If the likelihood favours that over a delay, the water
behind its readings is restored (`grebe.mapping.slow_sensor`). This takes seconds, so it is examined
only for a map of one moment, from which a lag is removed.

A change or a lag is used only if the likelihood clearly favours it. How large a change could have
gone undetected is reported.
"""

from __future__ import annotations

from dataclasses import dataclass, replace
from functools import lru_cache
from typing import TYPE_CHECKING, Literal, cast

import numpy as np
from scipy.linalg import cho_factor, cho_solve
from scipy.optimize import bisect
from scipy.spatial import KDTree

from grebe.mapping.covariance.noise import median_noise_variance
from grebe.mapping.covariance.posterior import Posterior, thinned
from grebe.mapping.covariance.variogram import fit_variogram
from grebe.mapping.methods.base import Readings
from grebe.mapping.response_time import find_response
from grebe.mapping.shared_in_time import fleeting, slow
from grebe.mapping.slow_sensor import Response, restored
from grebe.mapping.way import earlier

if TYPE_CHECKING:
    from numpy.typing import NDArray

    Array = NDArray[np.floating]

KIND = "exponential"
# Under the exponential covariance, smoother water can look like a change. So where this covariance
# explains the readings better, a change must be clear under it too.
SMOOTH = "gaussian"
# Log likelihood that a change, or a lag, must add to be used.
CLEAR_GAIN = 4.0
# The loss of log likelihood beyond which a change is ruled out: half the 95 % quantile of a chi
# square with one degree of freedom.
UNSEEN_LOSS = 1.92
# Shares of the values' variance at which a search for a change starts, and the search's bounds.
SHARES, SHARE_BOUNDS = (1e-3, 1e-2, 1e-1, 1.0), (1e-6, 30.0)
# Delays to try [s].
LAGS_S = (0.0, 2.0, 4.0, 6.0, 8.0, 10.0, 12.0, 15.0, 18.0, 22.0, 26.0, 30.0)
KNOTS = 24
FEWEST = 60
# A slow change needs few readings, if they come from the whole time.
MOST_SAMPLES = 240


@dataclass(frozen=True, kw_only=True)
class Change:
    """The change of all the water, relative to the map's time.

    `moment_s`: the map's time [unix s]. `mean` (p,) and `covariance` (p, p) are those of the change
    at `times` (p,) [unix s], on the readings' scale; the change is 0 at `moment_s`. `lag_s`: the
    sensor's delay. `gain` and `lag_gain`: what change and delay add to the log likelihood.
    `response`: the sensor's slow response, if it has one; the delay is then 0. `unseen_sd`:
    the standard deviation, over the whole survey, of the largest change that the samples do not
    rule out; infinite if they rule out none.
    """

    moment_s: float
    times: Array
    mean: Array
    covariance: Array
    gain: float = 0.0
    lag_s: float = 0.0
    lag_gain: float = 0.0
    response: Response | None = None
    unseen_sd: float = np.inf

    @property
    def is_significant(self) -> bool:
        """Whether the samples clearly favour a change of all the water."""
        return bool(np.any(self.covariance > 0))

    @property
    def range_of(self) -> float:
        """The range of the change during the survey, on the readings' scale."""
        return float(np.ptp(self.mean))

    def at(self, times: Array) -> tuple[Array, Array]:
        """Mean and standard deviation, (m,) each, of the change at times (m,) [unix s]."""
        sd = np.sqrt(np.maximum(np.diag(self.covariance), 0.0))
        return np.interp(times, self.times, self.mean), np.interp(times, self.times, sd)

    def seen_from(self, moment_s: float) -> Change:
        """The same change relative to another time [unix s], at which it is then 0."""
        there = np.array([np.interp(moment_s, self.times, one) for one in np.eye(len(self.times))])
        less = np.eye(len(self.times)) - there
        return replace(
            self,
            moment_s=moment_s,
            mean=self.mean - there @ self.mean,
            covariance=less @ self.covariance @ less.T,
        )

    @property
    def is_late(self) -> bool:
        """Whether the samples clearly favour a sensor that is late or slow."""
        return self.response is not None or self.lag_s > 0

    def placed(self, readings: Readings) -> Readings:
        """The readings at the places where the sensor took them; of a slow sensor, the water that a
        fast one would have read.
        """
        if readings.times is None:
            return readings
        if self.response is not None:
            return restored(readings, self.response)
        if not self.lag_s:
            return readings
        return replace(readings, positions=earlier(readings.times, readings.positions, self.lag_s))

    def reduced(self, readings: Readings) -> Readings:
        """The readings as they would have been at the map's time."""
        if readings.times is None or not self.is_significant:
            return readings
        return replace(readings, values=readings.values - self.at(readings.times)[0])

    def sd_near(self, readings: Readings, places: Array) -> Array:
        """Standard deviation (m,) that the change adds at places (m, 2): that at the time of the
        nearest reading, because all readings near a place share its error.
        """
        if readings.times is None or not self.is_significant:
            return np.zeros(len(places))
        nearest = KDTree(readings.positions).query(places)[1]
        return self.at(readings.times)[1][nearest]

    def draws_near(self, readings: Readings, places: Array, count: int, seed: int) -> Array:
        """Equally likely errors of the change at places, (count, m)."""
        if readings.times is None or not self.is_significant:
            return np.zeros((count, len(places)))
        nearest = KDTree(readings.positions).query(places)[1]
        when = readings.times[nearest]
        rng = np.random.default_rng([seed, 2])
        size = self.covariance + 1e-12 * np.eye(len(self.times)) * np.max(np.diag(self.covariance))
        errors = rng.multivariate_normal(np.zeros(len(self.times)), size, count, method="cholesky")
        return np.array([np.interp(when, self.times, one) for one in errors])


def no_change(readings: Readings, moment_s: float | None = None) -> Change:
    """Return a change of zero: nothing is known to have changed."""
    times = np.zeros(1) if readings.times is None else readings.times
    middle = float((times.min() + times.max()) / 2) if moment_s is None else moment_s
    return Change(
        moment_s=middle, times=np.array([middle]), mean=np.zeros(1), covariance=np.zeros((1, 1))
    )


@lru_cache(maxsize=16)
def fit_change(readings: Readings, moment: float | Literal["middle"] | None = None) -> Change:
    """Estimate the change of all the water and the sensor's lag.

    `moment`: the map's time [unix s], or the middle of the readings' time, which is also that of a
    map of no moment (None). For such a map the lag is a delay; otherwise the sensor may be slow.
    If the readings have no times, or are too few, no change is returned.
    """
    moment_s = None if moment == "middle" else moment
    still = no_change(readings, moment_s)
    if readings.times is None or len(readings) < FEWEST or np.ptp(readings.values) == 0:
        return still
    span_s = float(np.ptp(readings.times))
    if not span_s > 0:
        return still
    try:
        problem = _Problem.of(readings)
    except ValueError:
        return still
    lag_s, lag_gain = problem.lag()
    response = None if moment is None else find_response(readings, problem.plain)
    used = readings
    if response is not None:
        lag_s, used = 0.0, restored(readings, response)
        problem = _Problem.of(used)
    if lag_s:
        problem = problem.shifted(lag_s)
    at, gain = problem.with_change()
    change = replace(
        still,
        gain=gain,
        lag_s=lag_s,
        lag_gain=lag_gain,
        response=response,
        unseen_sd=problem.unseen(at),
    )
    if gain < CLEAR_GAIN or _is_smooth(used, problem, lag_s):
        return change
    first, last = float(readings.times.min()), float(readings.times.max())
    knots = np.unique([*np.linspace(first, last, KNOTS), np.clip(still.moment_s, first, last)])
    mean, covariance = problem.predicted(at, knots, still.moment_s)
    return replace(change, times=knots, mean=mean, covariance=covariance)


def _is_smooth(readings: Readings, rough: _Problem, lag_s: float) -> bool:
    """Whether a smooth covariance explains the readings better and leaves no clear change."""
    try:
        smooth = _Problem.of(readings, SMOOTH)
    except ValueError:
        return False
    if lag_s:
        smooth = smooth.shifted(lag_s)
    better = smooth.plain_likelihood > rough.plain_likelihood
    return better and smooth.with_change()[1] < CLEAR_GAIN


@dataclass(frozen=True, kw_only=True)
class _Problem:
    """Some of the readings, and the best covariance without a slow change. Its parameters `plain`
    (4,) are those of place, of noise, and of the differences of passes.
    """

    readings: Readings
    chosen: NDArray[np.int64]
    posterior: Posterior
    plain: Array
    kind: str = KIND

    @classmethod
    def of(cls, readings: Readings, kind: str = KIND) -> _Problem:
        chosen = thinned(len(readings), MOST_SAMPLES)
        posterior = _posterior(readings, readings.positions, chosen, kind)
        start = fit_variogram(readings.positions, readings.values, "matheron").model
        model = posterior.model(posterior.highest_near(start)[1])
        of_place = np.log(
            [
                model.range_m / posterior.extent_m,
                model.sill / posterior.variance,
                max(model.nugget / posterior.variance, 1e-12),
            ]
        )
        begin = _with_share(posterior, of_place)
        return cls(
            readings=readings,
            chosen=chosen,
            posterior=posterior,
            plain=_refined(posterior, begin),
            kind=kind,
        )

    @property
    def plain_likelihood(self) -> float:
        """The log likelihood without a slow change."""
        return self.posterior.log_likelihood(self.plain)

    def lag(self) -> tuple[float, float]:
        """The sensor's lag [s] if the likelihood clearly favours one, else 0; and its gain."""
        found = [self._at_lag(lag_s)[1] for lag_s in LAGS_S]
        best = int(np.argmax(found))
        gain = found[best] - found[0]
        return (LAGS_S[best], gain) if gain > CLEAR_GAIN else (0.0, gain)

    def shifted(self, lag_s: float) -> _Problem:
        """The same problem with the readings at the places where the sensor took them."""
        posterior, _ = self._at_lag(lag_s)
        moved = _refined(posterior, self.plain)
        return replace(self, posterior=posterior, plain=moved)

    def _at_lag(self, lag_s: float) -> tuple[Posterior, float]:
        times = self.readings.times
        assert times is not None
        moved = earlier(times, self.readings.positions, lag_s)
        posterior = _posterior(self.readings, moved, self.chosen, self.kind)
        # The range is a share of the extent, which differs slightly.
        at = self.plain.copy()
        at[0] += np.log(self.posterior.extent_m / posterior.extent_m)
        return posterior, posterior.log_likelihood(at)

    def with_change(self) -> tuple[Array, float]:
        """The best parameters with a change, (5,), and what it adds to the log likelihood."""
        found = _refined(self.posterior, _with_share(self.posterior, self.plain))
        gain = self.posterior.log_likelihood(found) - self.plain_likelihood
        return found, float(gain)

    def unseen(self, at: Array) -> float:
        """The largest standard deviation of a change that the readings do not rule out."""
        best = max(self.posterior.log_likelihood(at), self.posterior.log_likelihood(self.plain))

        def lost(log_share: float) -> float:
            with_it = np.append(at[:4], log_share)
            return best - self.posterior.log_likelihood(with_it) - UNSEEN_LOSS

        top = float(np.log(SHARE_BOUNDS[1]))
        low = float(np.clip(at[4], np.log(SHARE_BOUNDS[0]), top - 1.0))
        if lost(top) < 0:
            return np.inf
        edge = low if lost(low) > 0 else bisect(lost, low, top, xtol=0.05)
        return float(np.sqrt(np.exp(cast(float, edge)) * self.posterior.variance))

    def predicted(self, at: Array, knots: Array, moment_s: float) -> tuple[Array, Array]:
        """Mean (p,) and covariance (p, p) of the change at the knots, 0 at the given time."""
        times = self.readings.times
        assert times is not None
        seen = times[self.chosen]
        span_s = float(np.ptp(times))
        size = float(np.exp(at[4]))
        between = size * slow(knots, seen, span_s)
        between = between - size * slow(np.array([moment_s]), seen, span_s)
        matrix = self.posterior.covariance(at)
        factor = cho_factor(matrix, lower=True)
        ones = np.ones(len(seen))
        weighted = cho_solve(factor, np.column_stack([ones, self.posterior.values, between.T]))
        by_one, by_value, by_change = weighted[:, 0], weighted[:, 1], weighted[:, 2:]
        information = float(ones @ by_one)
        mean = float(ones @ by_value) / information
        estimate = between @ (by_value - mean * by_one)
        missing = between @ by_one
        covariance = size * _since(knots, moment_s, span_s) - between @ by_change
        covariance = covariance + np.outer(missing, missing) / information
        variance = self.posterior.variance
        return np.sqrt(variance) * estimate, variance * 0.5 * (covariance + covariance.T)


def _posterior(
    readings: Readings, positions: Array, chosen: NDArray[np.int64], kind: str
) -> Posterior:
    times = readings.times
    assert times is not None
    noise = median_noise_variance(positions, readings.values)
    seen = times[chosen]
    span_s = float(np.ptp(times))
    common = (fleeting(seen, span_s), slow(seen, seen, span_s))
    return Posterior.of(positions[chosen], readings.values[chosen], kind, noise, common)


def _since(times: Array, moment_s: float, span_s: float) -> Array:
    """Covariance (n, n) of the change since a given time, for a variance of 1."""
    at = np.array([moment_s])
    to_moment = slow(times, at, span_s)
    return slow(times, times, span_s) - to_moment - to_moment.T + slow(at, at, span_s)


def _with_share(posterior: Posterior, at: Array) -> Array:
    """Add one process in time, at the best of a few shares of the variance."""
    return max((np.append(at, np.log(share)) for share in SHARES), key=posterior.log_density)


def _refined(posterior: Posterior, start: Array) -> Array:
    """The posterior's mode, from a start near it."""
    return posterior.highest(start)[1]
