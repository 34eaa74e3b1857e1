"""The observer: estimates current and wind force from the boat's motion.

The boat's velocity over ground is measured; a steady current and a steady wind force are
not. The model predicts the change of velocity between two estimates. A Kalman filter attributes
the error of the prediction to d = (c_n, c_e, f_n, f_e); its state is d and its model a random walk
(Simon 2006, ch. 5). On one heading current and wind cannot be distinguished, and need not be:
either explains the motion on that heading.

If an autopilot holds the ordered surge, only the sway is informative: the autopilot makes the
predicted surge in any weather, which would confirm any estimate.
"""

# Kernels do not annotate their parameters: numba infers the types when it compiles them.
# pyright: reportMissingParameterType=false

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np

from grebe.core.copies import copy_vector
from grebe.core.dynamics import CALM, Weather
from grebe.core.kernels import machine_code
from grebe.core.motion import advance, parameter_vector
from grebe.core.vessel import Vessel

if TYPE_CHECKING:
    from numpy.typing import NDArray

    Array = NDArray[np.float64]

# Standard deviation of the measured velocities over ground [m/s].
VELOCITY_SD = 0.03
# Prior standard deviations: current [m/s], and wind force as a share of full thrust; and the random
# walk of each in a second.
CURRENT_SD, WIND_SHARE_SD = 0.4, 0.15
CURRENT_DRIFT, WIND_SHARE_DRIFT = 0.01, 0.005
LARGEST_CURRENT_MPS = 3.0


@dataclass(frozen=True, kw_only=True)
class RandomWalk:
    """The assumed variability of d = (c_n, c_e, f_n, f_e) [m/s, m/s, N, N]; all arrays are (4,).

    `sd`: standard deviations before anything is known; `drift`: variances that a second adds;
    `probe`: steps of numerical derivatives; `limit`: largest magnitudes.
    """

    sd: NDArray[np.float64]
    drift: NDArray[np.float64]
    probe: NDArray[np.float64]
    limit: NDArray[np.float64]

    @classmethod
    def around(cls, vessel: Vessel) -> RandomWalk:
        """The weather that a vessel may meet; its thrust is the scale of the wind force."""
        force = 2 * vessel.thrust_max_n
        sd = np.array([CURRENT_SD, CURRENT_SD, WIND_SHARE_SD * force, WIND_SHARE_SD * force])
        drift = np.array([CURRENT_DRIFT] * 2 + [WIND_SHARE_DRIFT * force] * 2)
        limit = np.append(np.full(2, LARGEST_CURRENT_MPS), np.full(2, vessel.thrust_max_n))
        return cls(sd=sd, drift=drift**2, probe=0.05 * sd, limit=limit)


class Observer:
    """Estimates the weather from successive state estimates and the thrusts between them.

    `first` is the initial weather, `weather` the present estimate; `by_sway`: only the sway is
    used. `walk` is the assumed variability, `covariance` (4, 4) that of the estimate's error.
    """

    def __init__(self, vessel: Vessel, first: Weather = CALM, *, by_sway: bool = False) -> None:
        self._vessel = vessel
        # Index of the first velocity used: 0 for surge and sway, 1 for sway alone.
        self._first = 1 if by_sway else 0
        self.walk = RandomWalk.around(vessel)
        self._estimate = np.array(first.as_tuple())
        self.covariance = np.diag(self.walk.sd**2)
        self._drift = np.diag(self.walk.drift)
        self._boat = parameter_vector(vessel, np.zeros(4))[:-4]
        self.weather = first

    def update(
        self,
        before: Sequence[float],
        thrusts: tuple[float, float],
        after: Sequence[float],
        duration_s: float,
    ) -> None:
        """Update the estimate from a pair of states (6,), `duration_s` apart under `thrusts`."""
        start, inputs = np.asarray(before, dtype=float), np.asarray(thrusts)
        substeps = max(2, math.ceil(duration_s * self._vessel.fastest_rate_hz))
        predicted, jacobian = _velocities(
            self._boat, self._estimate, self.walk.probe, start, inputs, duration_s, substeps
        )
        self.covariance += duration_s * self._drift
        change = np.zeros(4)
        # One measurement after the other, because their errors are independent.
        for i in range(self._first, 2):
            _correct(change, self.covariance, jacobian[i], after[3 + i] - predicted[i])
        limit = self.walk.limit
        # Not np.clip, which takes longer than everything else here except the prediction.
        self._estimate = np.minimum(np.maximum(self._estimate + change, -limit), limit)
        self.weather = weather_of(self._estimate)


def weather_of(vector: NDArray[np.float64]) -> Weather:
    """Return the weather of d (4,) = (c_n, c_e, f_n, f_e) [m/s, m/s, N, N]."""
    north, east, force_north, force_east = vector.tolist()
    return Weather(
        current_north_mps=north,
        current_east_mps=east,
        wind_force_north_n=force_north,
        wind_force_east_n=force_east,
    )


@machine_code
def _correct(change, covariance, gradient, innovation):
    """Apply one measurement of a Kalman filter to `change` (4,) and `covariance`, in place.

    `change` is the change of the estimate so far. `innovation` is the difference between the
    measurement and its prediction without any change, `gradient` (4,) the prediction's derivatives.
    """
    cross = np.zeros(4)
    # Both ends of the pair are measured, so their errors add up.
    variance = 2 * VELOCITY_SD**2
    for i in range(4):
        for j in range(4):
            cross[i] += covariance[i, j] * gradient[j]
    for i in range(4):
        variance += gradient[i] * cross[i]
        innovation -= gradient[i] * change[i]
    for i in range(4):
        change[i] += cross[i] * innovation / variance
        for j in range(4):
            covariance[i, j] -= cross[i] * cross[j] / variance


@machine_code
def _velocities(boat, weather, probe, state, thrusts, duration, substeps):
    """Predict surge and sway (2,) in some weather (4,), and their derivatives (2, 4) by it.

    The derivatives are finite differences over `probe` (4,).
    """
    p = np.empty(len(boat) + 4)
    out = np.empty(6)
    velocities, jacobian = np.empty(2), np.empty((2, 4))
    copy_vector(p[: len(boat)], boat)
    for i in range(-1, 4):
        copy_vector(p[len(boat) :], weather)
        if i >= 0:
            p[len(boat) + i] += probe[i]
        advance(p, state, thrusts, duration, substeps, out)
        if i < 0:
            copy_vector(velocities, out[3:5])
        else:
            for j in range(2):
                jacobian[j, i] = (out[3 + j] - velocities[j]) / probe[i]
    return velocities, jacobian
