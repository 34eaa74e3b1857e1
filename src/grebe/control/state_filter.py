"""A Kalman filter of the boat's state and the weather, for noisy estimates.

A controller that plans from every raw estimate responds to its noise. Half of a boat's thrust may
go into this, because the least sway through the water turns a fast hull. An extended Kalman filter
(Simon 2006, ch. 13) combines the model's prediction from one estimate to the next with the
estimate. Changes of position and heading also give information on the velocities.

Current and wind are states of the same filter, as random walks. The observer takes each pair of
estimates for a measurement of its own; successive pairs share an estimate, whose noise enters both
with opposite signs. A joint filter knows that, and knows the weather better.

The noise is learned from the estimates. Let g be the difference between an estimate and the
prediction from the one before. White noise of variance R enters two successive g with opposite
signs and makes their covariance -F R, where F is the derivative of the prediction with respect to
the state that it begins with. Errors of the model last, and make it positive. The variance of g
beyond R + F R F' is attributed to the model. Estimates that are exact, or already filtered by an
autopilot, show no noise and are used unfiltered. So is an unexpected estimate, from which the
filter starts again.
"""

# Kernels do not annotate their parameters: numba infers the types when it compiles them.
# pyright: reportMissingParameterType=false, reportUnknownParameterType=false

from __future__ import annotations

import math
from typing import TYPE_CHECKING

import numpy as np

from grebe.control.observer import Observer, weather_of
from grebe.core.copies import put, put_rows
from grebe.core.dynamics import Weather
from grebe.core.events import State
from grebe.core.kernels import machine_code, part_of_kernels
from grebe.core.motion import advance

if TYPE_CHECKING:
    from numpy.typing import NDArray

    Array = NDArray[np.float64]

# Time constant of learning the noise, and the least time before the result is used [s].
MEMORY_S, LEAST_S = 15.0, 4.0
# Standard deviations below which noise is ignored: position [m], heading [rad], velocities [m/s]
# and yaw rate [rad/s]; and the least noise assumed of a state if any other is noisy.
NOTHING = np.array([0.01, 0.01, 0.005, 0.005, 0.005, 0.005])
LEAST = np.array([1e-3, 1e-3, 5e-4, 1e-3, 1e-3, 1e-3])
# The model's variance from one estimate to the next is at least this share of the noise's.
# Otherwise estimates would count for nothing, and velocities that are measured a little too large
# would carry the position away.
LEAST_SHARE = 0.02
# Random error of a variance over half a minute, as a share of the noise in a surprise. It is not
# attributed to the model, whose lasting errors count as weather.
CHANCE = 0.25
# Standard deviations beyond which a surprise is an outlier: it is clipped when the noise is
# learned, and the filter starts again.
WILD = 5.0
# Least share of the noise assumed to remain in the next prediction; none does in a hull that stops
# at once.
LEAST_LEFT = 0.3
PROBE = 1e-5
# Rows of `surprises`: the last, the mean square, and the mean product of successive ones.
LAST, SQUARE, PRODUCT = 0, 1, 2
# Elements of the belief: the boat's state, then d = (c_n, c_e, f_n, f_e).
STATE, BELIEF = 6, 10


class StateFilter:
    """Filters the state of one boat, together with the weather.

    `variances` (6,): the present estimate of the noise's variances; zero if estimates are used
    unfiltered. `weather`: the estimated weather; None if nothing is filtered.
    """

    def __init__(self) -> None:
        self.variances = np.zeros(6)
        self.weather: Weather | None = None
        self._surprises = np.zeros((3, 6))
        self._belief, self._covariance = np.zeros(BELIEF), np.zeros((BELIEF, BELIEF))
        self._seconds = 0.0
        self._follows = False

    def forget(self) -> None:
        """Start again from the next estimate, after a gap; the learned noise is kept."""
        self._follows, self.weather = False, None

    def see(
        self,
        parameters: Array,
        before: State,
        thrusts: tuple[float, float],
        after: State,
        seconds: float,
        substeps: int,
        observer: Observer,
    ) -> None:
        """Take into account a pair of estimates, `seconds` apart under `thrusts`.

        `parameters` (15,) are those of the boat and the estimated weather. The filter starts from
        what `observer` knows of the weather.
        """
        pair = np.array(thrusts), np.array(after), seconds, substeps
        share = max(1.0 - math.exp(-seconds / MEMORY_S), seconds / (self._seconds + seconds))
        self._seconds += seconds
        known = self._seconds >= LEAST_S
        noisy = _learn(parameters, np.array(before), *pair, share, known, self._surprises)
        if not (known and noisy):
            self.variances[:] = 0.0
            self.forget()
            return
        if not self._follows:
            self._start(before, observer)
        walk = observer.walk
        self._follows = _weigh(
            parameters, self._belief, self._covariance, *pair, self._surprises, self.variances,
            walk.drift, walk.probe, walk.limit,
        )  # fmt: skip
        self.weather = weather_of(self._belief[STATE:]) if self._follows else None

    def _start(self, estimate: State, observer: Observer) -> None:
        self._belief[:STATE], self._belief[STATE:] = estimate, observer.weather.as_tuple()
        self._covariance[:] = 0.0
        self._covariance[:STATE, :STATE] = np.diag(np.maximum(-self._surprises[PRODUCT], LEAST**2))
        self._covariance[STATE:, STATE:] = observer.covariance

    def filtered(self, state: State) -> State:
        """Return the filtered state at the last estimate, or `state` if nothing is filtered."""
        if not self._follows:
            return state
        north, east, heading, surge, sway, yaw_rate = self._belief[:STATE].tolist()
        return north, east, heading, surge, sway, yaw_rate


@machine_code
def _learn(parameters, before, thrusts, after, seconds, substeps, share, known, surprises):
    """Add the surprise of an estimate to the means `surprises` (3, 6) with weight `share`.

    Outliers are clipped once the means are `known`. Returns whether they show noise.
    """
    predicted, noisy = np.empty(6), False
    advance(parameters, before, thrusts, seconds, substeps, predicted)
    for i in range(6):
        now = after[i] - predicted[i]
        if not np.isfinite(now):
            now = 0.0
        if known:
            most = max(WILD * np.sqrt(surprises[SQUARE, i]), LEAST[i])
            now = min(max(now, -most), most)
        surprises[SQUARE, i] += share * (now * now - surprises[SQUARE, i])
        surprises[PRODUCT, i] += share * (now * surprises[LAST, i] - surprises[PRODUCT, i])
        surprises[LAST, i] = now
        noisy = noisy or -surprises[PRODUCT, i] > NOTHING[i] ** 2
    return noisy


@machine_code
def _weigh(
    parameters, belief, covariance, thrusts, after, seconds, substeps, surprises, variances,
    drift, probe, limit,
):  # fmt: skip
    """One step of the filter; returns False, and corrects nothing, if it has to start again: after
    an outlier, or if rounding has spoiled its covariance.

    Updates `belief` (10,), `covariance` (10, 10) and the noise's `variances` (6,) in place. The
    weather's random walk has the variances `drift` (4,) in a second; `limit` (4,) bounds it.
    """
    predicted, slopes = np.empty(BELIEF), np.zeros((BELIEF, BELIEF))
    _predict(parameters, belief, thrusts, seconds, substeps, probe, predicted, slopes)
    for i in range(STATE):
        left = max(slopes[i, i], LEAST_LEFT)
        variances[i] = max(-surprises[PRODUCT, i] / left, LEAST[i] ** 2)
    passed = _carried(slopes, covariance)
    for i in range(STATE):
        of_noise = variances[i]
        for j in range(STATE):
            of_noise += slopes[i, j] * slopes[i, j] * variances[j]
        model = surprises[SQUARE, i] - (1.0 + CHANCE) * of_noise
        passed[i, i] += max(model, LEAST_SHARE * variances[i])
    for i in range(STATE, BELIEF):
        passed[i, i] += seconds * drift[i - STATE]
    for i in range(STATE):
        # Written so that a NaN is an outlier too.
        if not (after[i] - predicted[i]) ** 2 <= WILD**2 * (passed[i, i] + variances[i]):
            return False
    _correct(predicted, passed, after, variances)
    for i in range(BELIEF):
        if not passed[i, i] > 0.0:
            return False
    for i in range(STATE, BELIEF):
        most = limit[i - STATE]
        predicted[i] = min(max(predicted[i], -most), most)
    put(belief, predicted)
    put_rows(covariance, passed)
    return True


@part_of_kernels
def _carried(slopes, covariance):
    """F P F' of `slopes` F and a `covariance` P, (10, 10)."""
    half, out = np.zeros((BELIEF, BELIEF)), np.zeros((BELIEF, BELIEF))
    for i in range(BELIEF):
        for j in range(BELIEF):
            for k in range(BELIEF):
                half[i, j] += slopes[i, k] * covariance[k, j]
    # One half is a copy of the other. Otherwise their difference, of rounding alone, grows with a
    # hull that is unstable in yaw until variances are negative.
    for i in range(BELIEF):
        for j in range(i + 1):
            for k in range(BELIEF):
                out[i, j] += half[i, k] * slopes[j, k]
            out[j, i] = out[i, j]
    return out


@part_of_kernels
def _correct(belief, covariance, after, variances):
    """Correct a predicted `belief` (10,) with `covariance` (10, 10) by an estimate, in place."""
    spread = np.empty(BELIEF)
    # One measurement after the other, because their errors are independent.
    for k in range(STATE):
        surprise, variance = after[k] - belief[k], covariance[k, k] + variances[k]
        for i in range(BELIEF):
            spread[i] = covariance[i, k]
        for i in range(BELIEF):
            belief[i] += spread[i] / variance * surprise
            for j in range(BELIEF):
                covariance[i, j] -= spread[i] * spread[j] / variance


@part_of_kernels
def _predict(parameters, belief, thrusts, seconds, substeps, probe, predicted, slopes):
    """Predict the belief after some time, and its derivatives (10, 10) by the one before.

    The motion does not depend on the position, and the weather is predicted to stay.
    """
    p, moved, end = parameters.copy(), belief.copy(), np.empty(STATE)
    weather = p[-4:]
    put(weather, belief[STATE:])
    put(predicted, belief)
    advance(p, belief, thrusts, seconds, substeps, predicted)
    for j in range(BELIEF):
        slopes[j, j] = 1.0
    for j in range(2, BELIEF):
        step = PROBE if j < STATE else probe[j - STATE]
        if j < STATE:
            moved[j] += step
        else:
            weather[j - STATE] += step
        advance(p, moved, thrusts, seconds, substeps, end)
        moved[j] = belief[j]
        if j >= STATE:
            weather[j - STATE] = belief[j]
        for i in range(STATE):
            slopes[i, j] = (end[i] - predicted[i]) / step
