"""The likeliest covariance under priors that hold it to what a track can tell.

By likelihood alone the range of a track in narrow water runs away to many times the water's width,
for a trend and a long range look alike there, and a smooth covariance then overshoots in gaps; and
structure of a few metres is called noise. So range and standard deviation have the
penalised-complexity prior of Fuglstad et al. (2019, theorem 2.6, two dimensions): short ranges
and large standard deviations are what a map pays for. The noise has a prior about what successive
samples of one place say of it: their second differences, by the median, which outliers do not move.
"""

from __future__ import annotations

from dataclasses import dataclass, replace
from functools import partial
from typing import TYPE_CHECKING

import numpy as np
from scipy.linalg import cho_factor, solve_triangular
from scipy.optimize import minimize
from scipy.spatial.distance import cdist

from grebe.mapping.covariance import PRACTICAL_RANGE, CovarianceModel, correlations
from grebe.mapping.likelihood import CLEAR_GAIN
from grebe.mapping.noise import median_noise_variance
from grebe.mapping.variogram import Estimator, VariogramFit, fit_variogram

if TYPE_CHECKING:
    from numpy.typing import NDArray

    Array = NDArray[np.floating]

# A factorisation grows with the cube of the samples; beyond so many they are thinned.
MOST_SAMPLES = 350
# Of the prior: a range below this share of the extent, at most so many metres, has this
# probability; so has a standard deviation above this many of the values' own.
SHORT_SHARE, SHORT_M, UNLIKELY, LARGE_SDS = 0.05, 5.0, 0.05, 2.0
# How well second differences tell the noise: a standard deviation of its logarithm.
NOISE_LOG_SD = 0.5
# Where the search may go, as shares of the extent and of the values' variance. Within the samples'
# extent a longer range with a larger sill is the same field: `LONGEST` is the practical range.
LEAST_RANGE, LONGEST = 1e-3, 0.8
SILL_BOUNDS, NOISE_BOUNDS = (1e-4, 1e2), (1e-8, 2.0)
STEP = 5e-2


def fit_posterior(
    positions: Array, values: Array, estimator: Estimator = "matheron", *, kind: str = "exponential"
) -> VariogramFit:
    """Fit a covariance of one kind by its posterior mode, with a direction where that is clear.

    Raises `ValueError` where there are too few pairs or nothing varies.
    """
    if np.ptp(values) == 0:
        raise ValueError("the values do not vary")
    start = fit_variogram(positions, values, estimator)
    chosen = thinned(len(values))
    noise = median_noise_variance(positions, values)
    at, data = positions[chosen], values[chosen]
    problem = Posterior.of(at, data, kind, noise)
    gained, model, errors = problem.best(start.model)
    reason = f"{kind} by the posterior mode under priors of range, standard deviation and noise"
    if start.model.ratio < 1:
        shape = {"ratio": start.model.ratio, "angle_deg": start.model.angle_deg}
        directed = replace(start.model, kind=kind, **shape)
        turned = Posterior.of(directed.isotropic(at), data, kind, noise).best(directed)
        if turned[0] > gained + CLEAR_GAIN:
            reason += f"; its direction adds {turned[0] - gained:.1f}"
            model, errors = replace(turned[1], **shape), turned[2]
    return VariogramFit(
        model=model,
        empirical=start.empirical,
        candidates=(model,),
        standard_errors=errors,
        reason=reason,
    )


fit_rough = partial(fit_posterior, kind="exponential")
fit_smooth = partial(fit_posterior, kind="matern32")


def thinned(count: int, most: int = MOST_SAMPLES) -> NDArray[np.int64]:
    """Pairs of neighbours along the track, evenly spread: near pairs tell the noise."""
    if count <= most:
        return np.arange(count)
    first = np.linspace(0, count - 2, most // 2).astype(np.int64)
    return np.unique(np.concatenate([first, first + 1]))


@dataclass(frozen=True, kw_only=True, eq=False)
class Posterior:
    """Log posterior of (log range / extent, log sill / variance, log noise / variance), the mean
    integrated out; `values` (n,) of mean 0 and variance 1, `noise` their noise's variance.

    `common`, (n, n) each, are correlations that all places share, of what changed in time; the
    variance of each over that of the values is one more number, a logarithm too.
    """

    distance: Array
    values: Array
    extent_m: float
    variance: float
    kind: str
    noise: float
    common: tuple[Array, ...] = ()

    @classmethod
    def of(
        cls,
        positions: Array,
        values: Array,
        kind: str,
        noise: float,
        common: tuple[Array, ...] = (),
    ) -> Posterior:
        """The problem of values (n,) at positions (n, 2) whose noise has a variance of `noise`."""
        distance = cdist(positions, positions)
        variance = float(np.var(values))
        return cls(
            distance=distance,
            values=(values - values.mean()) / np.sqrt(variance),
            extent_m=float(distance.max()),
            variance=variance,
            kind=kind,
            noise=min(max(noise / variance, NOISE_BOUNDS[0]), NOISE_BOUNDS[1]),
            common=common,
        )

    def best(self, start: CovarianceModel) -> tuple[float, CovarianceModel, dict[str, float]]:
        """The highest log posterior, its model, and the standard errors by its curvature."""
        ranges = (LEAST_RANGE, LONGEST / PRACTICAL_RANGE[self.kind])
        bounds = np.log([ranges, SILL_BOUNDS, NOISE_BOUNDS])
        sill = max(start.sill / self.variance, 0.3)
        guess = np.log([min(start.range_m / self.extent_m, 0.5), sill, self.noise])
        guess = np.clip(guess, *(bounds.T + np.array([[0.1], [-0.1]])))
        found = minimize(
            lambda at: -self.log_density(at),
            guess,
            method="Nelder-Mead",
            bounds=[tuple(pair) for pair in bounds.tolist()],
            options={
                "xatol": 1e-2, "fatol": 1e-2, "maxfev": 150,
                "initial_simplex": np.vstack([guess, guess + 0.5 * np.eye(3)]),
            },
        )  # fmt: skip
        share, sill, noise = np.exp(found.x).tolist()
        model = CovarianceModel(
            kind=self.kind,
            sill=sill * self.variance,
            range_m=share * self.extent_m,
            nugget=noise * self.variance,
        )
        return -float(found.fun), model, self._standard_errors(model, found.x)

    def log_density(self, at: Array) -> float:
        """Log posterior, but for a constant."""
        share, sill, noise = np.exp(at[:3]).tolist()
        of_change = np.log(UNLIKELY) * np.sum(np.exp(0.5 * at[3:]))
        prior = self._log_prior(share, float(np.sqrt(sill)), noise) + of_change
        return self.log_likelihood(at) + float(prior)

    def covariance(self, at: Array) -> Array:
        """Covariance of the values, (n, n)."""
        share, sill, noise = np.exp(at[:3]).tolist()
        matrix = sill * correlations(self.kind, self.distance / (share * self.extent_m))
        matrix[np.diag_indices(len(self.values))] += noise + 1e-9 * sill
        for log_share, common in zip(at[3:].tolist(), self.common, strict=False):
            matrix += np.exp(log_share) * common
        return matrix

    def log_likelihood(self, at: Array) -> float:
        """Restricted log likelihood, but for a constant."""
        matrix = self.covariance(at)
        try:
            factor, lower = cho_factor(matrix, lower=True, overwrite_a=True, check_finite=False)
        except np.linalg.LinAlgError:
            return -1e300
        both = np.column_stack([np.ones(len(self.values)), self.values])
        ones, values = solve_triangular(factor, both, lower=lower, check_finite=False).T
        information = float(ones @ ones)
        rest = values - float(ones @ values) / information * ones
        log_det = 2 * float(np.sum(np.log(np.diag(factor))))
        return -0.5 * (float(rest @ rest) + log_det + np.log(information))

    def _log_prior(self, share: float, sd: float, noise: float) -> float:
        """Of log range and log standard deviation (penalised complexity), and of log noise."""
        short = min(SHORT_SHARE, SHORT_M / self.extent_m)
        range_rate, sd_rate = -np.log(UNLIKELY) * short, -np.log(UNLIKELY) / LARGE_SDS
        of_range = -np.log(share) - range_rate / share
        of_sd = np.log(sd) - sd_rate * sd
        of_noise = -0.5 * (0.5 * np.log(noise / self.noise) / NOISE_LOG_SD) ** 2
        return float(of_range + of_sd + of_noise)

    def _standard_errors(self, model: CovarianceModel, at: Array) -> dict[str, float]:
        steps = STEP * np.eye(3)
        hessian = np.empty((3, 3))
        for i in range(3):
            for j in range(i, 3):
                corners = [
                    self.log_density(at + a * steps[i] + b * steps[j])
                    for a, b in ((1, 1), (1, -1), (-1, 1), (-1, -1))
                ]
                bend = -(corners[0] - corners[1] - corners[2] + corners[3]) / (4 * STEP**2)
                hessian[i, j] = hessian[j, i] = bend
        with np.errstate(invalid="ignore"):
            spread = np.sqrt(np.diag(np.linalg.pinv(hessian)))
        return {
            "nugget": float(model.nugget * spread[2]),
            "sill": float(model.sill * spread[1]),
            "range_m": float(model.range_m * spread[0]),
        }
