"""Kriging: the best linear unbiased estimate with an unknown mean or drift.

The nugget is taken as noise of the samples. So the estimate is of the signal, its variance is the
signal's, and with a nugget of zero the samples are reproduced exactly. The variance of an
observation is larger by the nugget (gstat without its `Err` term gives that one). Up to
`EXACT_LIMIT` samples, every estimate uses all of them, and every mean does up to `MEAN_LIMIT`.
Beyond that, an estimate uses the samples around it (`grebe.mapping.fields.tiles`).
Chiles and Delfiner (2012), sections 3.4 and 3.6.
"""

from __future__ import annotations

from dataclasses import dataclass, replace
from typing import TYPE_CHECKING

import numpy as np
from scipy.linalg import cho_solve, cholesky, solve_triangular

from grebe.mapping.covariance.models import CovarianceModel, Fleeting
from grebe.mapping.fields.joining import EXACT_LIMIT, distinct, joined
from grebe.mapping.fields.tiles import tiles

if TYPE_CHECKING:
    from numpy.typing import NDArray

    Array = NDArray[np.floating]

# Beyond `EXACT_LIMIT` samples, and up to these, all of them are used for means; for variances too
# where the samples' square times the targets is small.
MEAN_LIMIT, LITTLE_WORK = 3_000, 5e8
NEIGHBOURS = 150
TARGETS_AT_ONCE = 2000
# The trend is estimated once for the whole water, from at most these samples.
MOST_FOR_TREND = 500
# Added to the diagonal, as a share of the sill: keeps a smooth covariance positive definite.
JITTER = 1e-9


@dataclass(frozen=True, kw_only=True)
class Estimate:
    """Mean and variance of the signal at each target, (m,) each; for c columns of values the mean
    is (m, c).
    """

    mean: Array
    variance: Array

    @property
    def sd(self) -> Array:
        """Standard deviation of the signal."""
        return np.sqrt(self.variance)


@dataclass(frozen=True, kw_only=True)
class Drift:
    """Functions that the mean is a linear combination of, besides a constant: their values at the
    samples (n, p) and at the targets (m, p).
    """

    at_samples: Array
    at_targets: Array


@dataclass(frozen=True, kw_only=True)
class Passing:
    """A fleeting part of the signal: the times of the samples (n,) and of the targets (m,) [s], and
    the `share` (m,) of it, as estimated at a target's time, that applies at the target's place.
    """

    fleeting: Fleeting
    at_samples: Array
    at_targets: Array
    share: Array


@dataclass(frozen=True, kw_only=True)
class Moments:
    """A fleeting part of the signal that all places share: the times of the samples (n,), and the
    times `at` (k,) at which the signal is estimated [s].
    """

    fleeting: Fleeting
    at_samples: Array
    at: Array


def krige(
    positions: Array,
    values: Array,
    targets: Array,
    model: CovarianceModel,
    neighbours: int | None = None,
    drift: Drift | None = None,
    extra_variance: Array | None = None,
    passing: Passing | None = None,
) -> Estimate:
    """Estimate the signal at `targets` (m, 2) from `values` (n,) at `positions` (n, 2) [m];
    several columns of values (n, c) share one variance.

    `neighbours` limits each estimate to that many samples around it. By default all samples are
    used up to `EXACT_LIMIT`, and for the mean up to `MEAN_LIMIT`; beyond that, `NEIGHBOURS` are.
    `extra_variance` (n,) is the variance of each value in addition to the nugget. With `passing`,
    the signal depends on place and time.
    """
    return _krige(positions, values, targets, model, neighbours, drift, extra_variance, passing)[0]


def krige_moments(
    positions: Array,
    values: Array,
    targets: Array,
    model: CovarianceModel,
    moments: Moments,
    drift: Drift | None = None,
    extra_variance: Array | None = None,
) -> list[Estimate]:
    """As `krige`, with one estimate for each of several times. The part that depends on place is
    factorised and solved only once.
    """
    return _krige(positions, values, targets, model, None, drift, extra_variance, moments)


def _krige(
    positions: Array,
    values: Array,
    targets: Array,
    model: CovarianceModel,
    neighbours: int | None,
    drift: Drift | None,
    extra_variance: Array | None,
    passing: Passing | Moments | None,
) -> list[Estimate]:
    """Return one estimate for each time, or a single one."""
    if len(values) == 0 or not (np.isfinite(positions).all() and np.isfinite(values).all()):
        raise ValueError("kriging needs at least one sample, and finite ones")
    if model.sill == 0 and drift is None and passing is None:
        spread = np.full(len(targets), model.nugget / len(values))
        level = np.repeat(values.mean(axis=0)[None], len(targets), 0)
        return [Estimate(mean=level, variance=spread)]
    functions = np.ones((len(values), 1))
    there = np.ones((len(targets), 1))
    if drift is not None:
        functions = np.column_stack([functions, drift.at_samples])
        there = np.column_stack([there, drift.at_targets])
    count = 1 if values.ndim == 1 else values.shape[1]
    extra = np.zeros(len(values)) if extra_variance is None else extra_variance
    times = np.zeros(len(values)) if passing is None else passing.at_samples
    table = np.column_stack([values, functions, extra, times])
    once = distinct(positions, table)
    positions, table = positions[once], table[once]
    positions, table, counts = joined(
        positions, table, model, None if passing is None else passing.fleeting
    )
    columns, extra, times = table[:, :-2], table[:, -2], table[:, -1]
    functions, there = _scaled(columns[:, count:], there)
    samples = _Samples(
        positions=model.isotropic(positions),
        values=columns[:, :count],
        noise=(model.nugget + extra) / counts + JITTER * model.sill,
        functions=functions,
        times=times,
        fleeting=None if passing is None else passing.fleeting,
    )
    asked = _Targets(positions=model.isotropic(targets), functions=there, passing=passing)
    trend = _trend(samples, model)
    means, variances = _estimated(samples, trend, asked, model, neighbours)
    means = means[..., 0] if values.ndim == 1 else means
    return [
        Estimate(mean=mean, variance=np.maximum(variance, 0.0))
        for mean, variance in zip(means, variances, strict=True)
    ]


def _estimated(
    samples: _Samples,
    trend: _Trend,
    targets: _Targets,
    model: CovarianceModel,
    neighbours: int | None,
) -> tuple[Array, Array]:
    """Means (k, m, c) and variances (k, m) at the targets, by one system or by tiles."""
    n, m = len(samples.noise), len(targets.positions)
    by_all = neighbours is None and n <= MEAN_LIMIT
    if neighbours is None:
        neighbours = n if _whole_is_little(n, m) else NEIGHBOURS
    if neighbours >= n:
        return _solve(samples, trend, targets, model)
    mean = np.empty((targets.moments, m, samples.values.shape[1]))
    variance = np.empty(mean.shape[:2])
    for members, near in tiles(samples.positions, targets.positions, neighbours):
        mean[:, members], variance[:, members] = _solve(
            samples.part(near), trend, targets.part(members), model
        )
    if by_all:
        mean = _mean(samples, trend, targets, model)
    return mean, variance


@dataclass(frozen=True, kw_only=True)
class _Samples:
    """Places in isotropic coordinates (n, 2), values (n, c), their noise variance (n,), the drift's
    functions there (n, p), with a constant first, and the samples' times (n,).
    """

    positions: Array
    values: Array
    noise: Array
    functions: Array
    times: Array
    fleeting: Fleeting | None

    def part(self, chosen: NDArray[np.int64]) -> _Samples:
        return _Samples(
            positions=self.positions[chosen],
            values=self.values[chosen],
            noise=self.noise[chosen],
            functions=self.functions[chosen],
            times=self.times[chosen],
            fleeting=self.fleeting,
        )

    def factor(self, model: CovarianceModel) -> Array:
        """Lower Cholesky factor of the samples' covariance."""
        system = model.among(self.positions)
        if self.fleeting is not None:
            self.fleeting.add_among(self.times, system)
        system[np.diag_indices(len(self.noise))] += self.noise
        # LAPACK stores by columns, so the transpose needs no copy.
        return cholesky(system.T, lower=False, overwrite_a=True, check_finite=False).T


@dataclass(frozen=True, kw_only=True)
class _Targets:
    """Places in isotropic coordinates (m, 2), the drift's functions there (m, p), and the fleeting
    part to be estimated.
    """

    positions: Array
    functions: Array
    passing: Passing | Moments | None

    @property
    def moments(self) -> int:
        """The number of times at which the signal is estimated."""
        return len(self.passing.at) if isinstance(self.passing, Moments) else 1

    def part(self, chosen: NDArray[np.int64] | slice) -> _Targets:
        passing = self.passing
        if isinstance(passing, Passing):
            passing = replace(
                passing, at_targets=passing.at_targets[chosen], share=passing.share[chosen]
            )
        return _Targets(
            positions=self.positions[chosen], functions=self.functions[chosen], passing=passing
        )

    def covariance(self, samples: _Samples, model: CovarianceModel) -> Array:
        """Covariance (n, m) of the samples' signal with that of the targets, without the part that
        all targets share.
        """
        found = model.between(samples.positions, self.positions)
        if isinstance(self.passing, Passing):
            passing = self.passing
            found += passing.share * passing.fleeting.covariance(samples.times, passing.at_targets)
        return found

    def shared(self, samples: _Samples) -> Array:
        """Covariance (n, k) of the samples' signal with what all targets share at each time."""
        if not isinstance(self.passing, Moments):
            return np.zeros((len(samples.noise), 1))
        return self.passing.fleeting.covariance(samples.times, self.passing.at)


@dataclass(frozen=True, kw_only=True)
class _Trend:
    """The drift's coefficients (p, c) by generalised least squares, and the factor of their
    inverse covariance (p, p).
    """

    coefficients: Array
    information: Array


def _trend(samples: _Samples, model: CovarianceModel) -> _Trend:
    """Fit one trend for the whole water, from all samples or from `MOST_FOR_TREND` of them."""
    if len(samples.noise) > MOST_FOR_TREND:
        chosen = np.linspace(0, len(samples.noise) - 1, MOST_FOR_TREND).astype(np.int64)
        samples = samples.part(chosen)
    both = np.column_stack([samples.values, samples.functions])
    white = solve_triangular(samples.factor(model), both, lower=True, check_finite=False)
    data, basis = np.split(white, [samples.values.shape[1]], axis=1)
    # Relative to the information of one sample, so that units do not matter.
    jitter = JITTER / max(model.sill + model.nugget, 1e-300)
    information = cholesky(basis.T @ basis + jitter * np.eye(basis.shape[1]), lower=True)
    return _Trend(
        coefficients=cho_solve((information, True), basis.T @ data), information=information
    )


def _scaled(functions: Array, there: Array) -> tuple[Array, Array]:
    """Scale the drift functions, except the constant, to mean 0 and size 1 at the samples."""
    shift, size = functions.mean(axis=0), functions.std(axis=0)
    shift[0], size[0] = 0.0, 1.0
    size[size == 0] = 1.0
    return (functions - shift) / size, (there - shift) / size


def _solve(
    samples: _Samples, trend: _Trend, targets: _Targets, model: CovarianceModel
) -> tuple[Array, Array]:
    """Means (k, m, c) and variances (k, m) at the targets.

    The part that the targets share at a time adds one column to their covariances with the
    samples. So each time takes a product only, and no solution of the system.
    """
    factor = samples.factor(model)
    residual = samples.values - samples.functions @ trend.coefficients
    columns = np.column_stack([residual, samples.functions, targets.shared(samples)])
    white = solve_triangular(factor, columns, lower=True, check_finite=False)
    count, width = len(targets.positions), residual.shape[1]
    data, basis, shared = np.split(white, [width, width + samples.functions.shape[1]], axis=1)
    mean, variance = np.empty((targets.moments, count, width)), np.empty((targets.moments, count))
    whole = model.sill + (0.0 if samples.fleeting is None else samples.fleeting.variance)
    for start in range(0, count, TARGETS_AT_ONCE):
        part = slice(start, start + TARGETS_AT_ONCE)
        asked = targets.part(part)
        near = solve_triangular(
            factor, asked.covariance(samples, model), lower=True, check_finite=False,
            overwrite_b=True,
        )  # fmt: skip
        lacking = asked.functions.T - basis.T @ near
        of_place = near.T @ data + asked.functions @ trend.coefficients
        left = whole - np.sum(near**2, axis=0)
        for i, then in enumerate(shared.T):
            missing = lacking - (basis.T @ then)[:, None]
            missing = solve_triangular(trend.information, missing, lower=True)
            mean[i, part] = of_place + then @ data
            variance[i, part] = left - 2 * (then @ near) - then @ then
            variance[i, part] += np.sum(missing**2, axis=0)
    return mean, variance


def _mean(samples: _Samples, trend: _Trend, targets: _Targets, model: CovarianceModel) -> Array:
    """Means (k, m, c) at the targets from all samples, by one factorisation."""
    residual = samples.values - samples.functions @ trend.coefficients
    weights = cho_solve((samples.factor(model).T, False), residual, check_finite=False)
    mean = targets.functions @ trend.coefficients
    mean += model.carried(samples.positions, weights, targets.positions)
    passing = targets.passing
    if isinstance(passing, Passing):
        course = passing.fleeting.carried(samples.times, weights, passing.at_targets)
        mean += passing.share[:, None] * course
    return mean + (targets.shared(samples).T @ weights)[:, None]


def _whole_is_little(samples: int, targets: int) -> bool:
    """Whether this many samples and targets can be solved quickly as one system."""
    return samples <= EXACT_LIMIT or (samples <= MEAN_LIMIT and samples**2 * targets <= LITTLE_WORK)
