"""Kriging in place and time: a smooth field, and the differences between passes over one place.

A sensor's readings agree better along one pass than between two. A rough covariance takes the
difference for a steep slope between the passes, and a smooth one overshoots there. This method
models it as a process of time:

    y(x, t) = m + S(x) + E(t) + noise.

S is a Matérn 3/2 field of place, and E an exponential process of time that all the water shares.
The map shows each place as it was when the boat came nearest: with E at that time, as far as a
place beside the path shares it.
"""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np

from grebe.mapping.covariance.drift import DriftFunction
from grebe.mapping.covariance.models import Fleeting
from grebe.mapping.covariance.noise import median_noise_variance
from grebe.mapping.covariance.posterior import Posterior, thinned
from grebe.mapping.covariance.variogram import Estimator, VariogramFit, fit_variogram
from grebe.mapping.methods.base import Domain, Readings
from grebe.mapping.methods.kriging import KrigingField, described, first_fit, without_drift

KIND = "matern32"
# The search's start: the range as a share of the extent, and the fleeting part's variance as a
# share of the values'.
RANGE_SHARE, FLEETING_SHARE = 0.1, 0.05


@dataclass(frozen=True, kw_only=True)
class Passes:
    """Kriging with a covariance of place and one of time. `drift` gives what the mean depends on
    besides a constant. The variogram by `estimator` is only shown; nothing is fitted to it.
    """

    estimator: Estimator = "matheron"
    drift: DriftFunction | None = None

    key = "passes"
    label = "Kriging in space and time"

    def fit(self, readings: Readings, domain: Domain) -> KrigingField:
        """See `Method`. Raises `ValueError` for readings without times."""
        if readings.times is None:
            raise ValueError("kriging in space and time needs readings with times")
        fit = first_fit(readings, self.estimator, self.drift)
        fleeting: Fleeting | None = None
        if fit.model.sill > 0 and np.ptp(readings.values) > 0 and np.ptp(readings.times) > 0:
            values = without_drift(readings, self.drift)
            fit, fleeting = fit_passes(readings.positions, values, readings.times, self.estimator)
        model = described(fit)
        if fleeting is not None:
            model = replace(model, text=f"{model.text}, and {_told(fleeting)}", passing=fleeting)
        return KrigingField(
            covariance=fit.model,
            model=model,
            readings=readings,
            domain=domain,
            drift=self.drift,
            fleeting=fleeting,
        )


def fit_passes(
    positions: np.ndarray, values: np.ndarray, times: np.ndarray, estimator: Estimator
) -> tuple[VariogramFit, Fleeting]:
    """Fit the covariances of place and of time by their posterior mode, under the priors of
    `grebe.mapping.covariance.posterior`.
    """
    shown = fit_variogram(positions, values, estimator)
    chosen = thinned(len(values))
    noise = median_noise_variance(positions, values)
    problem = Posterior.of(positions[chosen], values[chosen], KIND, noise, times=times[chosen])
    start = np.log([RANGE_SHARE, 1.0, problem.noise, FLEETING_SHARE, 1.0])
    _, at = problem.highest(start)
    model = problem.model(at)
    fit = replace(
        shown,
        model=model,
        candidates=(model,),
        standard_errors=problem.standard_errors(model, at),
        reason=f"{KIND} in space and a process in time, by the posterior mode under priors",
    )
    return fit, problem.fleeting(at)


def _told(fleeting: Fleeting) -> str:
    sd, memory = np.sqrt(fleeting.variance), fleeting.memory_s
    return f"passes that differ by {sd:.2g} with a memory of {memory:.0f} s"
