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
from grebe.core.copies import copy_matrix, copy_vector
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
NEGLIGIBLE_SD = np.array([0.01, 0.01, 0.005, 0.005, 0.005, 0.005])
LEAST_SD = np.array([1e-3, 1e-3, 5e-4, 1e-3, 1e-3, 1e-3])
# The model's variance from one estimate to the next is at least this share of the noise's.
# Otherwise estimates would count for nothing, and velocities that are measured a little too large
# would carry the position away.
LEAST_SHARE = 0.02
# Random error of a variance over half a minute, as a share of the noise in an innovation. It is not
# attributed to the model, whose lasting errors count as weather.
VARIANCE_ERROR = 0.25
# Standard deviations beyond which an innovation is an outlier: it is clipped when the noise is
# learned, and the filter starts again.
OUTLIER_SD = 5.0
# Least share of the noise assumed to remain in the next prediction; none does in a hull that stops
# at once.
LEAST_LEFT = 0.3
PROBE = 1e-5
# Rows of `innovations`: the last, the mean square, and the mean product of successive ones.
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
        self._innovations = np.zeros((3, 6))
        self._belief, self._covariance = np.zeros(BELIEF), np.zeros((BELIEF, BELIEF))
        self._seconds = 0.0
        self._is_running = False

    def reset(self) -> None:
        """Start again from the next estimate, after a gap; the learned noise is kept."""
        self._is_running, self.weather = False, None

    def update(
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
        noisy = _update_innovations(
            parameters, np.array(before), *pair, share, known, self._innovations
        )
        if not (known and noisy):
            self.variances[:] = 0.0
            self.reset()
            return
        if not self._is_running:
            self._start(before, observer)
        walk = observer.walk
        self._is_running = _filter_step(
            parameters, self._belief, self._covariance, *pair, self._innovations, self.variances,
            walk.drift, walk.probe, walk.limit,
        )  # fmt: skip
        self.weather = weather_of(self._belief[STATE:]) if self._is_running else None

    def _start(self, estimate: State, observer: Observer) -> None:
        self._belief[:STATE], self._belief[STATE:] = estimate, observer.weather.as_tuple()
        self._covariance[:] = 0.0
        self._covariance[:STATE, :STATE] = np.diag(
            np.maximum(-self._innovations[PRODUCT], LEAST_SD**2)
        )
        self._covariance[STATE:, STATE:] = observer.covariance

    def filtered(self, state: State) -> State:
        """Return the filtered state at the last estimate, or `state` if nothing is filtered."""
        if not self._is_running:
            return state
        north, east, heading, surge, sway, yaw_rate = self._belief[:STATE].tolist()
        return north, east, heading, surge, sway, yaw_rate


@machine_code
def _update_innovations(
    parameters, before, thrusts, after, seconds, substeps, share, known, innovations
):
    """Add the innovation of an estimate to the means `innovations` (3, 6) with weight `share`.

    Outliers are clipped once the means are `known`. Returns whether they show noise.
    """
    predicted, noisy = np.empty(6), False
    advance(parameters, before, thrusts, seconds, substeps, predicted)
    for i in range(6):
        now = after[i] - predicted[i]
        if not np.isfinite(now):
            now = 0.0
        if known:
            most = max(OUTLIER_SD * np.sqrt(innovations[SQUARE, i]), LEAST_SD[i])
            now = min(max(now, -most), most)
        innovations[SQUARE, i] += share * (now * now - innovations[SQUARE, i])
        innovations[PRODUCT, i] += share * (now * innovations[LAST, i] - innovations[PRODUCT, i])
        innovations[LAST, i] = now
        noisy = noisy or -innovations[PRODUCT, i] > NEGLIGIBLE_SD[i] ** 2
    return noisy


@machine_code
def _filter_step(
    parameters, belief, covariance, thrusts, after, seconds, substeps, innovations, variances,
    drift, probe, limit,
):  # fmt: skip
    """One step of the filter; returns False, and corrects nothing, if it has to start again: after
    an outlier, or if rounding has spoiled its covariance.

    Updates `belief` (10,), `covariance` (10, 10) and the noise's `variances` (6,) in place. The
    weather's random walk has the variances `drift` (4,) in a second; `limit` (4,) bounds it.
    """
    predicted, jacobian = np.empty(BELIEF), np.zeros((BELIEF, BELIEF))
    _predict(parameters, belief, thrusts, seconds, substeps, probe, predicted, jacobian)
    for i in range(STATE):
        left = max(jacobian[i, i], LEAST_LEFT)
        variances[i] = max(-innovations[PRODUCT, i] / left, LEAST_SD[i] ** 2)
    prior = _propagated(jacobian, covariance)
    for i in range(STATE):
        of_noise = variances[i]
        for j in range(STATE):
            of_noise += jacobian[i, j] * jacobian[i, j] * variances[j]
        model = innovations[SQUARE, i] - (1.0 + VARIANCE_ERROR) * of_noise
        prior[i, i] += max(model, LEAST_SHARE * variances[i])
    for i in range(STATE, BELIEF):
        prior[i, i] += seconds * drift[i - STATE]
    for i in range(STATE):
        # Written so that a NaN is an outlier too.
        if not (after[i] - predicted[i]) ** 2 <= OUTLIER_SD**2 * (prior[i, i] + variances[i]):
            return False
    _correct(predicted, prior, after, variances)
    for i in range(BELIEF):
        if not prior[i, i] > 0.0:
            return False
    for i in range(STATE, BELIEF):
        most = limit[i - STATE]
        predicted[i] = min(max(predicted[i], -most), most)
    copy_vector(belief, predicted)
    copy_matrix(covariance, prior)
    return True


@part_of_kernels
def _propagated(jacobian, covariance):
    """F P F' of `jacobian` F and a `covariance` P, (10, 10)."""
    half, out = np.zeros((BELIEF, BELIEF)), np.zeros((BELIEF, BELIEF))
    for i in range(BELIEF):
        for j in range(BELIEF):
            for k in range(BELIEF):
                half[i, j] += jacobian[i, k] * covariance[k, j]
    # One half is a copy of the other. Otherwise their difference, of rounding alone, grows with a
    # hull that is unstable in yaw until variances are negative.
    for i in range(BELIEF):
        for j in range(i + 1):
            for k in range(BELIEF):
                out[i, j] += half[i, k] * jacobian[j, k]
            out[j, i] = out[i, j]
    return out


@part_of_kernels
def _correct(belief, covariance, after, variances):
    """Correct a predicted `belief` (10,) with `covariance` (10, 10) by an estimate, in place."""
    cross = np.empty(BELIEF)
    # One measurement after the other, because their errors are independent.
    for k in range(STATE):
        innovation, variance = after[k] - belief[k], covariance[k, k] + variances[k]
        for i in range(BELIEF):
            cross[i] = covariance[i, k]
        for i in range(BELIEF):
            belief[i] += cross[i] / variance * innovation
            for j in range(BELIEF):
                covariance[i, j] -= cross[i] * cross[j] / variance


@part_of_kernels
def _predict(parameters, belief, thrusts, seconds, substeps, probe, predicted, jacobian):
    """Predict the belief after some time, and its derivatives (10, 10) by the one before.

    The motion does not depend on the position, and the weather is predicted to stay.
    """
    p, moved, end = parameters.copy(), belief.copy(), np.empty(STATE)
    weather = p[-4:]
    copy_vector(weather, belief[STATE:])
    copy_vector(predicted, belief)
    advance(p, belief, thrusts, seconds, substeps, predicted)
    for j in range(BELIEF):
        jacobian[j, j] = 1.0
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
            jacobian[i, j] = (end[i] - predicted[i]) / step
