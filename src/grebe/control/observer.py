"""The observer: what current and wind force explain how the boat moves.

The boat's velocity over ground is measured; a steady current and a steady wind force are
not. Between two estimates the model predicts the change of velocity; what it misses is
attributed to the four numbers d = (c_n, c_e, f_n, f_e) by a Kalman filter whose state is d
and whose model is a random walk (Simon 2006, ch. 5). On one heading current and wind cannot
be told apart, and need not be: either explains the motion on that heading.

Of a boat whose autopilot holds the surge that it is told, only the sway tells anything: it makes
the surge that was predicted, in whatever weather, and would confirm any belief.
"""

# Kernels do not annotate their parameters: numba infers the types when it compiles them.
# pyright: reportMissingParameterType=false

from __future__ import annotations

import math
from collections.abc import Sequence
from typing import TYPE_CHECKING

import numpy as np

from grebe.core.copies import put
from grebe.core.dynamics import CALM, Weather
from grebe.core.kernels import machine_code
from grebe.core.motion import advance, parameter_vector
from grebe.core.vessel import Vessel

if TYPE_CHECKING:
    from numpy.typing import NDArray

    Array = NDArray[np.float64]

# Of the measured velocities over ground [m/s].
VELOCITY_SD = 0.03
# What lakes and weather may bring before anything is known: current [m/s], and wind force as
# a share of full thrust; and how far each may wander in a second.
CURRENT_SD, WIND_SHARE_SD = 0.4, 0.15
CURRENT_DRIFT, WIND_SHARE_DRIFT = 0.01, 0.005
LARGEST_CURRENT_MPS = 3.0


class Observer:
    """Estimates the weather from successive state estimates and the thrusts between them.

    `first` is the weather that it begins with, `weather` the present estimate; `by_sway`: only
    the sway is learned from.
    """

    def __init__(self, vessel: Vessel, first: Weather = CALM, *, by_sway: bool = False) -> None:
        self._vessel = vessel
        # The first of surge and sway that is learned from.
        self._first = 1 if by_sway else 0
        force = 2 * vessel.thrust_max_n
        sd = np.array([CURRENT_SD, CURRENT_SD, WIND_SHARE_SD * force, WIND_SHARE_SD * force])
        drift = np.array([CURRENT_DRIFT] * 2 + [WIND_SHARE_DRIFT * force] * 2)
        self._estimate = np.array(first.as_tuple())
        self._covariance = np.diag(sd**2)
        self._drift = np.diag(drift**2)
        self._probe = 0.05 * sd
        self._limit = np.append(np.full(2, LARGEST_CURRENT_MPS), np.full(2, vessel.thrust_max_n))
        self._boat = parameter_vector(vessel, np.zeros(4))[:-4]
        self.weather = first

    def _learn(self, estimate: Array) -> None:
        self._estimate = estimate
        north, east, force_north, force_east = estimate.tolist()
        self.weather = Weather(
            current_north_mps=north,
            current_east_mps=east,
            wind_force_north_n=force_north,
            wind_force_east_n=force_east,
        )

    def update(
        self,
        before: Sequence[float],
        thrusts: tuple[float, float],
        after: Sequence[float],
        duration_s: float,
    ) -> None:
        """Learn from a pair of states (6,) that lie `duration_s` apart under `thrusts`."""
        start, inputs = np.asarray(before, dtype=float), np.asarray(thrusts)
        substeps = max(2, math.ceil(duration_s * self._vessel.fastest_rate_hz))
        predicted, jacobian = _velocities(
            self._boat, self._estimate, self._probe, start, inputs, duration_s, substeps
        )
        self._covariance += duration_s * self._drift
        change = np.zeros(4)
        # One after the other, for their errors are independent.
        for i in range(self._first, 2):
            _correct(change, self._covariance, jacobian[i], after[3 + i] - predicted[i])
        # Not np.clip, which takes longer than all else here but the prediction.
        self._learn(np.minimum(np.maximum(self._estimate + change, -self._limit), self._limit))


@machine_code
def _correct(change, covariance, slopes, surprise):
    """One measurement of a Kalman filter: `change` (4,) of the estimate so far and the covariance,
    in place, by how much it differs from what was predicted with no change, and the prediction's
    derivatives `slopes` (4,).
    """
    spread = np.zeros(4)
    # Both ends of the pair are measured: their errors add up.
    variance = 2 * VELOCITY_SD**2
    for i in range(4):
        for j in range(4):
            spread[i] += covariance[i, j] * slopes[j]
    for i in range(4):
        variance += slopes[i] * spread[i]
        surprise -= slopes[i] * change[i]
    for i in range(4):
        change[i] += spread[i] * surprise / variance
        for j in range(4):
            covariance[i, j] -= spread[i] * spread[j] / variance


@machine_code
def _velocities(boat, weather, probe, state, thrusts, duration, substeps):
    """Surge and sway (2,) that the model predicts in some weather (4,), and their derivatives
    (2, 4) by it, over steps of `probe` (4,).
    """
    p = np.empty(len(boat) + 4)
    out = np.empty(6)
    velocities, jacobian = np.empty(2), np.empty((2, 4))
    put(p[: len(boat)], boat)
    for i in range(-1, 4):
        put(p[len(boat) :], weather)
        if i >= 0:
            p[len(boat) + i] += probe[i]
        advance(p, state, thrusts, duration, substeps, out)
        if i < 0:
            put(velocities, out[3:5])
        else:
            for j in range(2):
                jacobian[j, i] = (out[3 + j] - velocities[j]) / probe[i]
    return velocities, jacobian
