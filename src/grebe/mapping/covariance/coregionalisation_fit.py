"""The most probable coregionalisation of several quantities, under priors.

The likelihood is restricted: each quantity's mean is integrated out. Ranges, standard deviations
and noise have the priors of `grebe.mapping.covariance.posterior`. The correlations within a
structure have the prior of Lewandowski, Kurowicka and Joe (2009) with a shape of 2, under which no
correlation is perfect. Quantities share structure only if that clearly raises the posterior.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np
from scipy.linalg import cho_factor, cho_solve
from scipy.optimize import minimize
from scipy.spatial import KDTree
from scipy.spatial.distance import cdist

from grebe.mapping.covariance.coregionalisation import Coregionalisation
from grebe.mapping.covariance.models import PRACTICAL_RANGE, slopes
from grebe.mapping.covariance.noise import median_noise_variance, tell_noise
from grebe.mapping.covariance.posterior import (
    IMPOSSIBLE,
    LARGE_SDS,
    LEAST_RANGE,
    LONGEST,
    NOISE_BOUNDS,
    NOISE_LOG_SD,
    SHORT_M,
    SHORT_SHARE,
    UNLIKELY,
    thinned,
)
from grebe.mapping.methods.base import Readings

if TYPE_CHECKING:
    from numpy.typing import NDArray

    Array = NDArray[np.floating]
    Indices = NDArray[np.int64]

KIND = "exponential"
# Two structures, so that quantities may share the long range and not the short one.
START_SHARES = (0.05, 0.3)
# Total number of readings used in the fit; the cost of a factorisation grows with its cube.
MOST_SAMPLES = 450
# Log posterior that sharing must add, for each pair of quantities, to be accepted.
CLEAR_GAIN = 3.0
# Bounds of the entries of a structure's factor, in standard deviations; diagonal entries are above
# 0.
MOST_SD, LEAST_SD = 10.0, 1e-3
STARTING_CORRELATION = 0.8
# Samples far apart do not determine the noise: its prior is this share of the variance, loosely.
UNTOLD_NOISE, UNTOLD_LOG_SD = 0.01, 1.0


@dataclass(frozen=True, kw_only=True)
class Fitted:
    """The most probable `model`, and the log posterior that sharing adds to that of quantities
    that share nothing. If the gain is not clear, the model shares nothing.
    """

    model: Coregionalisation
    gain: float

    @property
    def is_shared(self) -> bool:
        """Whether the quantities inform each other."""
        return any(bool(np.any(np.triu(sill, 1))) for sill in self.model.sills)


def fit_coregionalisation(several: Sequence[Readings]) -> Fitted:
    """Fit the readings of several quantities, each on its own scale.

    Raises `ValueError` if the values of one of them do not vary.
    """
    if any(np.ptp(one.values) == 0 for one in several):
        raise ValueError("the values of one of the quantities do not vary")
    problem = _Problem.of(several)
    apart = problem.highest(problem.start(0.0), shared=False)
    signs = problem.start(_likeness(several))
    together = max(
        (problem.highest(start, shared=True) for start in (apart[1], signs)),
        key=lambda one: one[0],
    )
    gain = together[0] - apart[0]
    pairs = len(several) * (len(several) - 1) / 2
    at = together[1] if gain > CLEAR_GAIN * pairs else apart[1]
    return Fitted(model=problem.model(at), gain=gain)


def _likeness(several: Sequence[Readings]) -> Array:
    """Correlations (q, q) of each quantity's readings with the nearest ones of the others."""
    q = len(several)
    found = np.eye(q)
    for i in range(q):
        for j in range(i):
            nearest = KDTree(several[j].positions).query(several[i].positions)[1]
            pair = np.corrcoef(several[i].values, several[j].values[nearest])[0, 1]
            limit = STARTING_CORRELATION / (q - 1)
            found[i, j] = found[j, i] = np.clip(np.nan_to_num(pair), -limit, limit)
    return found


@dataclass(frozen=True, kw_only=True, eq=False)
class _Problem:
    """Values (n,), standardised to mean 0 and variance 1 within their quantities `whose` (n,); the
    quantities' `sds` (q,); the prior's `noise` variances (q,), and the `noise_log_sds` (q,) of
    their logarithms.

    The parameters are the logarithms of each structure's range over the extent; the entries of its
    factor, on and below the diagonal; and the logarithms of the noise variances.
    """

    distance: Array
    values: Array
    whose: Indices
    sds: Array
    noise: Array
    noise_log_sds: Array
    extent_m: float

    @classmethod
    def of(cls, several: Sequence[Readings]) -> _Problem:
        most = MOST_SAMPLES // len(several)
        chosen = [thinned(len(one), most) for one in several]
        at = np.concatenate([one.positions[k] for one, k in zip(several, chosen, strict=True)])
        sds = np.array([one.values.std() for one in several])
        told = np.array([tell_noise(one.positions) for one in several])
        noise = np.array([median_noise_variance(one.positions, one.values) for one in several])
        noise = np.where(told, noise / sds**2, UNTOLD_NOISE)
        values = [
            (one.values[k] - one.values[k].mean()) / sd
            for one, k, sd in zip(several, chosen, sds, strict=True)
        ]
        distance = cdist(at, at)
        return cls(
            distance=distance,
            values=np.concatenate(values),
            whose=np.repeat(np.arange(len(several)), [len(k) for k in chosen]),
            sds=sds,
            noise=np.clip(noise, *NOISE_BOUNDS),
            noise_log_sds=np.where(told, NOISE_LOG_SD, UNTOLD_LOG_SD),
            extent_m=float(distance.max()),
        )

    @property
    def lower(self) -> tuple[Indices, Indices]:
        """Row and column indices of a factor's entries."""
        return np.tril_indices(len(self.sds))

    def start(self, likeness: Array | float) -> Array:
        """A start for the search: structures of equal variance, with the given correlations."""
        count = len(self.sds)
        alike = np.eye(count) + likeness * (1 - np.eye(count))
        entries = np.linalg.cholesky(alike / len(START_SHARES))[self.lower]
        return np.concatenate(
            [np.log(START_SHARES), np.tile(entries, len(START_SHARES)), np.log(self.noise)]
        )

    def highest(self, start: Array, *, shared: bool) -> tuple[float, Array]:
        """The highest log posterior found from a start, and where it is."""
        ranges = np.log([LEAST_RANGE, LONGEST / PRACTICAL_RANGE[KIND]])
        rows, columns = self.lower
        most = MOST_SD if shared else 0.0
        entries = [(LEAST_SD, MOST_SD) if r == c else (-most, most)
                   for r, c in zip(rows.tolist(), columns.tolist(), strict=True)]  # fmt: skip
        structures = len(START_SHARES)
        noises = [tuple(np.log(NOISE_BOUNDS))] * len(self.sds)
        bounds = [tuple(ranges)] * structures + entries * structures + noises

        def lost(at: Array) -> tuple[float, Array]:
            density, slope = self.density_and_slope(at)
            return -density, -slope

        low, high = np.array(bounds).T
        found = minimize(
            lost, np.clip(start, low, high), jac=True, method="L-BFGS-B", bounds=bounds,
            options={"maxiter": 100, "ftol": 1e-7, "gtol": 1e-3},
        )  # fmt: skip
        return -float(found.fun), np.asarray(found.x)

    def model(self, at: Array) -> Coregionalisation:
        """The covariances given by the parameters, on the readings' scales."""
        shares, factors, noise = self._parts(at)
        scale = np.outer(self.sds, self.sds)
        return Coregionalisation(
            kind=KIND,
            sills=tuple(scale * (factor @ factor.T) for factor in factors),
            ranges_m=tuple((shares * self.extent_m).tolist()),
            nuggets=self.sds**2 * noise,
        )

    def _parts(self, at: Array) -> tuple[Array, Sequence[Array], Array]:
        """Ranges as shares of the extent, factors, and noise variances."""
        structures, count = len(START_SHARES), len(self.sds)
        entries = at[structures:-count].reshape(structures, -1)
        factors = [np.zeros((count, count)) for _ in entries]
        for factor, one in zip(factors, entries, strict=True):
            factor[self.lower] = one
        return np.exp(at[:structures]), factors, np.exp(at[-count:])

    def density_and_slope(self, at: Array) -> tuple[float, Array]:
        """Log posterior, up to a constant, and its derivatives by `at`."""
        shares, factors, noise = self._parts(at)
        matrix = np.diag(noise[self.whose])
        parts: list[tuple[Array, Array, Array]] = []
        for share, factor in zip(shares.tolist(), factors, strict=True):
            grown, near = slopes(KIND, self.distance / (share * self.extent_m))
            sill = (factor @ factor.T)[np.ix_(self.whose, self.whose)]
            parts.append((sill, grown, near))
            matrix += sill * near
        found = self._likelihood(matrix)
        if found is None:
            return IMPOSSIBLE, np.zeros(len(at))
        density, weights = found
        # The derivative by a parameter is the sum of `weights` times the covariance's derivative.
        of_ranges = [float(np.vdot(weights, sill * grown)) for sill, grown, _ in parts]
        of_entries = [
            2 * (self._summed(weights * near) @ factor)[self.lower]
            for (_, _, near), factor in zip(parts, factors, strict=True)
        ]
        of_noise = noise * np.bincount(self.whose, np.diag(weights), len(noise))
        prior, prior_slope = self._prior(at)
        slope = np.concatenate([of_ranges, *of_entries, of_noise])
        return density + prior, slope + prior_slope

    def _likelihood(self, matrix: Array) -> tuple[float, Array] | None:
        """Restricted log likelihood, up to a constant, and its derivatives by the elements (n, n)
        of the covariance; None if that is not positive definite.
        """
        try:
            factor = cho_factor(matrix, lower=True, check_finite=False)
        except np.linalg.LinAlgError:
            return None
        inverse = cho_solve(factor, np.eye(len(matrix)), check_finite=False)
        means = np.eye(len(self.sds))[self.whose]
        weighted = inverse @ means
        information = means.T @ weighted
        inverse -= weighted @ np.linalg.solve(information, weighted.T)
        rest = inverse @ self.values
        log_det = 2 * float(np.sum(np.log(np.diag(factor[0])))) + np.linalg.slogdet(information)[1]
        density = -0.5 * (float(self.values @ rest) + log_det)
        return float(density), 0.5 * (np.outer(rest, rest) - inverse)

    def _summed(self, matrix: Array) -> Array:
        """The sums (q, q) of a matrix's elements by the quantities of their rows and columns."""
        member = np.eye(len(self.sds))[self.whose]
        return member.T @ matrix @ member

    def _prior(self, at: Array) -> tuple[float, Array]:
        """Log prior and its derivatives by `at`."""
        shares, factors, noise = self._parts(at)
        rate = -np.log(UNLIKELY)
        short = rate * min(SHORT_SHARE, SHORT_M / self.extent_m) / shares
        density = -float(np.sum(np.log(shares) + short))
        of_entries: list[Array] = []
        for factor in factors:
            variance = np.sum(factor**2, axis=1)
            sd, diagonal = np.sqrt(variance), np.diag(factor)
            # From the determinant of the correlations, and from the standard deviations.
            density += float(
                np.sum(2 * np.log(diagonal) - np.log(variance) - rate / LARGE_SDS * sd)
            )
            slope = -(2 / variance + rate / LARGE_SDS / sd)[:, None] * factor
            of_entries.append((slope + np.diag(2 / diagonal))[self.lower])
        off = 0.5 * (np.log(noise) - np.log(self.noise)) / self.noise_log_sds
        density -= 0.5 * float(np.sum(off**2))
        return density, np.concatenate([short - 1.0, *of_entries, -0.5 * off / self.noise_log_sds])
