"""The observer: what current and wind force explain how the boat moves.

The boat's velocity over ground is measured; a steady current and a steady wind force are
not. Between two estimates the model predicts the change of velocity; what it misses is
attributed to the four numbers d = (c_n, c_e, f_n, f_e) by a Kalman filter whose state is d
and whose model is a random walk (Simon 2006, ch. 5). On one heading current and wind cannot
be told apart, and need not be: either explains the motion on that heading.
"""

from __future__ import annotations

from collections.abc import Sequence
from typing import TYPE_CHECKING

import numpy as np

from grebe.control.solvers.fast.model import advance, parameter_vector
from grebe.core.dynamics import CALM, Weather
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

    `first` is the weather that it begins with.
    """

    def __init__(self, vessel: Vessel, first: Weather = CALM) -> None:
        self._vessel = vessel
        force = 2 * vessel.thrust_max_n
        sd = np.array([CURRENT_SD, CURRENT_SD, WIND_SHARE_SD * force, WIND_SHARE_SD * force])
        drift = np.array([CURRENT_DRIFT] * 2 + [WIND_SHARE_DRIFT * force] * 2)
        self._estimate = np.array(first.as_tuple())
        self._covariance = np.diag(sd**2)
        self._drift = np.diag(drift**2)
        self._probe = 0.05 * sd

    @property
    def weather(self) -> Weather:
        """The present estimate."""
        north, east, force_north, force_east = self._estimate.tolist()
        return Weather(
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
        predicted = self._velocities(start, inputs, duration_s, self._estimate)
        jacobian = np.empty((2, 4))
        for i, probe in enumerate(self._probe):
            moved = self._estimate.copy()
            moved[i] += probe
            change = self._velocities(start, inputs, duration_s, moved) - predicted
            jacobian[:, i] = change / probe
        self._covariance = self._covariance + duration_s * self._drift
        # Both ends of the pair are measured: their errors add up.
        noise = 2 * VELOCITY_SD**2 * np.eye(2)
        gain = self._covariance @ jacobian.T
        gain = gain @ np.linalg.inv(jacobian @ gain + noise)
        surprise = np.asarray(after, dtype=float)[3:5] - predicted
        self._estimate = self._estimate + gain @ surprise
        limit = np.append(np.full(2, LARGEST_CURRENT_MPS), np.full(2, self._vessel.thrust_max_n))
        self._estimate = np.clip(self._estimate, -limit, limit)
        keep = np.eye(4) - gain @ jacobian
        self._covariance = keep @ self._covariance @ keep.T + gain @ noise @ gain.T

    def _velocities(self, state: Array, thrusts: Array, duration_s: float, weather: Array) -> Array:
        """Surge and sway that the model predicts."""
        out = np.empty(6)
        substeps = max(2, int(np.ceil(duration_s * self._vessel.fastest_rate_hz)))
        advance(parameter_vector(self._vessel, weather), state, thrusts, duration_s, substeps, out)
        return out[3:5]
