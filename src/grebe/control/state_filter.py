"""The state as estimates and the model tell it together, where estimates are noisy.

A plan that begins at every estimate as it is answers its noise: half of a boat's thrust may go
into it, for the least sway through the water turns a fast hull. An extended Kalman filter (Simon
2006, ch. 13) weighs what the model predicts from one estimate to the next against the estimate;
how far the boat has come and turned tells its velocities too.

How noisy estimates are is learned from them. Let g be what an estimate differs by from what was
predicted from the one before. White noise of variance R is in two successive g with opposite signs,
and makes their covariance -F R, F how the prediction changes with what it begins with; errors of
the model last, and make it positive. What is left of the variance of g, beyond R + F R F', is the
model's. Estimates that are exact, or that an autopilot has filtered already, show no noise, and are
taken as they come. So is one that nobody could expect: the filter begins anew behind it.
"""

# Kernels do not annotate their parameters: numba infers the types when it compiles them.
# pyright: reportMissingParameterType=false, reportUnknownParameterType=false

from __future__ import annotations

import math
from typing import TYPE_CHECKING

import numpy as np

from grebe.core.copies import put
from grebe.core.events import State
from grebe.core.kernels import machine_code, part_of_kernels
from grebe.core.motion import advance

if TYPE_CHECKING:
    from numpy.typing import NDArray

    Array = NDArray[np.float64]

# Over what time the noise is learned, and from how much of it on it is believed [s].
MEMORY_S, LEAST_S = 15.0, 4.0
# Standard deviations up to which noise is none: position [m], heading [rad], velocities [m/s] and
# yaw rate [rad/s]; and what is taken for the noise, at least, of what shows none beside others.
NOTHING = np.array([0.01, 0.01, 0.005, 0.005, 0.005, 0.005])
LEAST = np.array([1e-3, 1e-3, 5e-4, 1e-3, 1e-3, 1e-3])
# The model's own variance from one estimate to the next is at least this share of the noise's: no
# model is so good that estimates tell nothing, and velocities that are told a little too large
# would carry the place away.
LEAST_SHARE = 0.05
# What the means of half a minute miss by chance, as a share of the noise in a surprise. Of place
# and heading that is not put down to the model: it is never wrong about how velocities add up.
CHANCE = 0.2
# Standard deviations beyond which a surprise is wild: the noise is not learned from how wild it is,
# and the filter does not go on from it.
WILD = 5.0
# Of how much noise is left in the next prediction, at least: of a hull that stops at once none is.
LEAST_LEFT = 0.3
PROBE = 1e-5
# What is kept of surprises: the last, their mean square, and the mean product of successive ones.
LAST, SQUARE, PRODUCT = 0, 1, 2


class StateFilter:
    """Follows the state of one boat. `variances` (6,): of the noise that estimates were last taken
    to have; nothing where they are taken as they come.
    """

    def __init__(self) -> None:
        self.variances = np.zeros(6)
        self._surprises = np.zeros((3, 6))
        self._state, self._covariance = np.zeros(6), np.zeros((6, 6))
        self._seconds = 0.0
        self._follows = False

    def forget(self) -> None:
        """After a gap the next estimate is taken as it comes; how noisy they are stays known."""
        self._follows = False

    def see(
        self,
        parameters: Array,
        before: State,
        thrusts: tuple[float, float],
        after: State,
        seconds: float,
        substeps: int,
    ) -> None:
        """Take a pair of estimates into account that lie `seconds` apart under `thrusts`, of a boat
        and weather of these `parameters` (15,).
        """
        told = np.array(thrusts), np.array(after), seconds, substeps
        share = max(1.0 - math.exp(-seconds / MEMORY_S), seconds / (self._seconds + seconds))
        self._seconds += seconds
        known = self._seconds >= LEAST_S
        noisy = _learn(parameters, np.array(before), *told, share, known, self._surprises)
        if not (known and noisy):
            self.variances[:], self._follows = 0.0, False
            return
        if not self._follows:
            self._state[:] = before
            self._covariance[:] = np.diag(np.maximum(-self._surprises[PRODUCT], LEAST**2))
        self._follows = _weigh(
            parameters, self._state, self._covariance, *told, self._surprises, self.variances
        )

    def filtered(self, state: State) -> State:
        """Return what is believed of the last estimate."""
        if not self._follows:
            return state
        north, east, heading, surge, sway, yaw_rate = self._state.tolist()
        return north, east, heading, surge, sway, yaw_rate


@machine_code
def _learn(parameters, before, thrusts, after, seconds, substeps, share, known, surprises):
    """Take what an estimate surprises by into the means `surprises` (3, 6), of which it is a
    `share`, and no more than is not wild, where they are `known`; whether they tell of noise.
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
    parameters, state, covariance, thrusts, after, seconds, substeps, surprises, variances
):  # fmt: skip
    """One step of the filter: `state` (6,), `covariance` (6, 6) and the `variances` (6,) of the
    estimates' noise, in place; whether the estimate was one that could be expected.
    """
    predicted, slopes = np.empty(6), np.empty((6, 6))
    _predict(parameters, state, thrusts, seconds, substeps, predicted, slopes)
    for i in range(6):
        left = max(slopes[i, i], LEAST_LEFT)
        variances[i] = max(-surprises[PRODUCT, i] / left, LEAST[i] ** 2)
    passed = _carried(slopes, covariance)
    for i in range(6):
        of_noise = variances[i]
        for j in range(6):
            of_noise += slopes[i, j] * slopes[i, j] * variances[j]
        chance = CHANCE * of_noise if i < 3 else 0.0
        model = surprises[SQUARE, i] - of_noise - chance
        passed[i, i] += max(model, LEAST_SHARE * variances[i])
    for i in range(6):
        # What is not a number is no more to be expected.
        if not (after[i] - predicted[i]) ** 2 <= WILD**2 * (passed[i, i] + variances[i]):
            return False
    _correct(predicted, passed, after, variances)
    put(state, predicted)
    for i in range(6):
        put(covariance[i], passed[i])
    return True


@part_of_kernels
def _carried(slopes, covariance):
    """F P F' of `slopes` F and a `covariance` P, (6, 6)."""
    half, out = np.zeros((6, 6)), np.zeros((6, 6))
    for i in range(6):
        for j in range(6):
            for k in range(6):
                half[i, j] += slopes[i, k] * covariance[k, j]
    for i in range(6):
        for j in range(6):
            for k in range(6):
                out[i, j] += half[i, k] * slopes[j, k]
    return out


@part_of_kernels
def _correct(state, covariance, after, variances):
    """Weigh a predicted `state` (6,) of `covariance` (6, 6) against an estimate, in place."""
    spread = np.empty(6)
    # One after the other, for their errors are independent.
    for k in range(6):
        surprise, variance = after[k] - state[k], covariance[k, k] + variances[k]
        for i in range(6):
            spread[i] = covariance[i, k]
        for i in range(6):
            state[i] += spread[i] / variance * surprise
            for j in range(6):
                covariance[i, j] -= spread[i] * spread[j] / variance


@part_of_kernels
def _predict(parameters, state, thrusts, seconds, substeps, predicted, slopes):
    """The state after some time, and its derivatives (6, 6) by the one before. The boat moves alike
    wherever it is.
    """
    advance(parameters, state, thrusts, seconds, substeps, predicted)
    moved, end = state.copy(), np.empty(6)
    for j in range(6):
        if j < 2:
            for i in range(6):
                slopes[i, j] = 1.0 if i == j else 0.0
            continue
        moved[j] += PROBE
        advance(parameters, moved, thrusts, seconds, substeps, end)
        moved[j] = state[j]
        for i in range(6):
            slopes[i, j] = (end[i] - predicted[i]) / PROBE
