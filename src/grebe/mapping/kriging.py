"""Kriging: the best linear unbiased estimate with an unknown mean or drift.

The nugget is read as noise of the samples: the estimate is of the signal, its variance is the
signal's, and where the nugget is zero the samples are met exactly. An observation's variance
is the nugget more (gstat without its `Err` term gives that one). Up to `EXACT_LIMIT` samples
each estimate uses all of them, and each mean up to `MEAN_LIMIT`; beyond that those around it
(`grebe.mapping.tiles`).
Chiles and Delfiner (2012), sections 3.4 and 3.6.
"""

from __future__ import annotations

from dataclasses import dataclass, replace
from typing import TYPE_CHECKING

import numpy as np
from scipy.linalg import cho_solve, cholesky, solve_triangular

from grebe.mapping.covariance import CovarianceModel, Fleeting
from grebe.mapping.tiles import tiles

if TYPE_CHECKING:
    from numpy.typing import NDArray

    Array = NDArray[np.floating]

# Up to so many samples a system is solved whole; beyond, means alone up to so many more, and all
# of it where the product of the samples' square and the targets is small.
EXACT_LIMIT, MEAN_LIMIT, LITTLE_WORK = 400, 3_000, 5e8
NEIGHBOURS = 150
TARGETS_AT_ONCE = 2000
# The trend is estimated once for the whole water, from at most so many samples.
MOST_FOR_TREND = 500
# Two samples nearer than this in place and time are one: without a nugget they would make the
# system singular.
SAME_PLACE_M, SAME_TIME_S = 0.01, 0.01
# Beyond the exact limit, samples within which the signal varies by less than this share of the
# sill, and than this share of the noise, are joined to one; but by the third share of the sill at
# least, and more of them where there would still be too many.
JOINED_SHARE, JOINED_NOISE, JOINED_LEAST, MOST_PLACES = 0.01, 1.0, 1e-4, 60_000
# Added to the diagonal, of the sill: what keeps a smooth covariance positive in doubles.
JITTER = 1e-9


@dataclass(frozen=True, kw_only=True)
class Estimate:
    """Mean and variance of the signal at each target, (m,) each; the mean (m, c) for c columns
    of values.
    """

    mean: Array
    variance: Array

    @property
    def sd(self) -> Array:
        """Standard deviation of the signal."""
        return np.sqrt(self.variance)


@dataclass(frozen=True, kw_only=True)
class Drift:
    """Functions that the mean is a combination of, besides a constant: their values at the
    samples (n, p) and at the targets (m, p).
    """

    at_samples: Array
    at_targets: Array


@dataclass(frozen=True, kw_only=True)
class Passing:
    """A fleeting part of the signal: the times of the samples (n,) and of the targets (m,) [s], and
    the `share` (m,) of what is known of it at a target's time that holds at its place.
    """

    fleeting: Fleeting
    at_samples: Array
    at_targets: Array
    share: Array


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

    `neighbours` limits each estimate to that many samples around it; by default all are used
    up to `EXACT_LIMIT` samples, for the mean up to `MEAN_LIMIT`, and `NEIGHBOURS` beyond.
    `extra_variance` (n,) of each value is besides the nugget. With `passing` the signal is of place
    and of time.
    """
    if len(values) == 0 or not (np.isfinite(positions).all() and np.isfinite(values).all()):
        raise ValueError("kriging needs at least one sample, and finite ones")
    if model.sill == 0 and drift is None and passing is None:
        spread = np.full(len(targets), model.nugget / len(values))
        return Estimate(mean=np.repeat(values.mean(axis=0)[None], len(targets), 0), variance=spread)
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
    positions, table, counts = _joined(positions, table, model, passing)
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
    mean, variance = _estimated(samples, trend, asked, model, neighbours)
    mean = mean[:, 0] if values.ndim == 1 else mean
    return Estimate(mean=mean, variance=np.maximum(variance, 0.0))


def _estimated(
    samples: _Samples,
    trend: _Trend,
    targets: _Targets,
    model: CovarianceModel,
    neighbours: int | None,
) -> tuple[Array, Array]:
    """Mean (m, c) and variance (m,) at the targets, by one system or by tiles."""
    n, m = len(samples.noise), len(targets.positions)
    by_all = neighbours is None and n <= MEAN_LIMIT
    if neighbours is None:
        neighbours = n if _whole_is_little(n, m) else NEIGHBOURS
    if neighbours >= n:
        return _solve(samples, trend, targets, model)
    mean, variance = np.empty((m, samples.values.shape[1])), np.empty(m)
    for members, near in tiles(samples.positions, targets.positions, neighbours):
        mean[members], variance[members] = _solve(
            samples.part(near), trend, targets.part(members), model
        )
    if by_all:
        mean = _mean(samples, trend, targets, model)
    return mean, variance


@dataclass(frozen=True, kw_only=True)
class _Samples:
    """Places without a direction (n, 2), values (n, c), their noise variance (n,), the drift's
    functions there (n, p), a constant first, and the samples' times (n,).
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
        """Cholesky's lower factor of the samples' covariance."""
        system = model.among(self.positions)
        if self.fleeting is not None:
            system += self.fleeting.covariance(self.times, self.times)
        system[np.diag_indices(len(self.noise))] += self.noise
        # By columns, as LAPACK has it, its transpose needs no copy.
        return cholesky(system.T, lower=False, overwrite_a=True, check_finite=False).T


@dataclass(frozen=True, kw_only=True)
class _Targets:
    """Places without a direction (m, 2), the drift's functions there (m, p), and what of the
    fleeting part is asked for.
    """

    positions: Array
    functions: Array
    passing: Passing | None

    def part(self, chosen: NDArray[np.int64] | slice) -> _Targets:
        passing = self.passing
        if passing is not None:
            passing = replace(
                passing, at_targets=passing.at_targets[chosen], share=passing.share[chosen]
            )
        return _Targets(
            positions=self.positions[chosen], functions=self.functions[chosen], passing=passing
        )

    def covariance(self, samples: _Samples, model: CovarianceModel) -> Array:
        """Covariance (n, m) of the samples' signal with that of the targets."""
        found = model.between(samples.positions, self.positions)
        if self.passing is not None:
            passing = self.passing
            found += passing.share * passing.fleeting.covariance(samples.times, passing.at_targets)
        return found


@dataclass(frozen=True, kw_only=True)
class _Trend:
    """The drift's coefficients (p, c) by generalised least squares, and the factor of their
    inverse covariance (p, p).
    """

    coefficients: Array
    information: Array


def _trend(samples: _Samples, model: CovarianceModel) -> _Trend:
    """One trend for the whole water: from all samples, or so many of them spread evenly."""
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


def _joined(
    positions: Array, columns: Array, model: CovarianceModel, passing: Passing | None
) -> tuple[Array, Array, Array]:
    """Samples merged to few enough places, as `merge_places` gives them; the last of the `columns`
    is the time, and what is of other times is not merged where that tells.
    """
    merged = merge_places(positions, columns, SAME_PLACE_M, _turns(columns, passing, 0.0))
    if len(merged[0]) <= EXACT_LIMIT or model.sill == 0:
        return merged
    sizes = np.geomspace(SAME_PLACE_M, model.range_m, 200)
    lost = 1 - model.covariance(sizes) / model.sill
    share = min(JOINED_SHARE, max(JOINED_NOISE * model.nugget / model.sill, JOINED_LEAST))
    size = float(sizes[max(int(np.searchsorted(lost, share)) - 1, 0)]) * model.ratio
    turns = _turns(columns, passing, share * model.sill)
    merged = merge_places(positions, columns, size, turns)
    while len(merged[0]) > MOST_PLACES:
        size *= np.sqrt(2)
        merged = merge_places(positions, columns, size, turns)
    return merged


def _turns(columns: Array, passing: Passing | None, lost: float) -> NDArray[np.int64] | None:
    """Samples of one turn (n,) differ in time by so little that the fleeting part varies by no
    more than a variance of `lost`.
    """
    if passing is None or passing.fleeting.variance <= lost:
        return None
    fleeting, times = passing.fleeting, columns[:, -1]
    length_s = -fleeting.memory_s * np.log1p(-lost / fleeting.variance)
    return np.floor((times - times.min()) / max(float(length_s), SAME_TIME_S)).astype(np.int64)


def distinct(positions: Array, columns: Array) -> NDArray[np.int64]:
    """The rows to keep where some repeat the same reading at the same place, the first of each in
    its order: one reading, recorded for several sets that overlap there.
    """
    table = np.column_stack([positions, columns])
    _, once = np.unique(table, axis=0, return_index=True)
    return np.sort(once)


def merge_places(
    positions: Array,
    columns: Array,
    size_m: float = SAME_PLACE_M,
    turns: NDArray[np.int64] | None = None,
) -> tuple[Array, Array, Array]:
    """Average samples of one place, and of one of the `turns` (n,) where these are given; return
    their mean positions and `columns` (n,) or (n, p), and how many each stands for.
    """
    table = np.column_stack([positions, columns])
    cells = np.round((table[:, :2] - table[:, :2].min(axis=0)) / size_m).astype(np.int64)
    key = cells[:, 0] * (cells[:, 1].max() + 1) + cells[:, 1]
    if turns is not None:
        _, key = np.unique(np.column_stack([key, turns]), axis=0, return_inverse=True)
        key = np.asarray(key).ravel()
    _, first, inverse = np.unique(key, return_index=True, return_inverse=True)
    counts = np.bincount(inverse).astype(float)
    if len(first) == len(table):
        means, counts = table[first], np.ones(len(first))
    else:
        sums = [np.bincount(inverse, column) for column in table.T]
        means = np.column_stack(sums) / counts[:, None]
    merged = means[:, 2:]
    return means[:, :2], merged[:, 0] if columns.ndim == 1 else merged, counts


def _scaled(functions: Array, there: Array) -> tuple[Array, Array]:
    """Drift functions of mean 0 and size 1 at the samples, the constant apart."""
    shift, size = functions.mean(axis=0), functions.std(axis=0)
    shift[0], size[0] = 0.0, 1.0
    size[size == 0] = 1.0
    return (functions - shift) / size, (there - shift) / size


def _solve(
    samples: _Samples, trend: _Trend, targets: _Targets, model: CovarianceModel
) -> tuple[Array, Array]:
    """Mean (m, c) and variance (m,) at the targets."""
    factor = samples.factor(model)
    residual = samples.values - samples.functions @ trend.coefficients
    both = np.column_stack([residual, samples.functions])
    white = solve_triangular(factor, both, lower=True, check_finite=False)
    data, basis = np.split(white, [residual.shape[1]], axis=1)
    count = len(targets.positions)
    mean, variance = np.empty((count, data.shape[1])), np.empty(count)
    whole = model.sill + (0.0 if samples.fleeting is None else samples.fleeting.variance)
    for start in range(0, count, TARGETS_AT_ONCE):
        part = slice(start, start + TARGETS_AT_ONCE)
        asked = targets.part(part)
        near = solve_triangular(
            factor, asked.covariance(samples, model), lower=True, check_finite=False,
            overwrite_b=True,
        )  # fmt: skip
        missing = asked.functions.T - basis.T @ near
        missing = solve_triangular(trend.information, missing, lower=True)
        mean[part] = near.T @ data + asked.functions @ trend.coefficients
        variance[part] = whole - np.sum(near**2, axis=0) + np.sum(missing**2, axis=0)
    return mean, variance


def _mean(samples: _Samples, trend: _Trend, targets: _Targets, model: CovarianceModel) -> Array:
    """Mean (m, c) at the targets from all samples, which takes one factorisation."""
    residual = samples.values - samples.functions @ trend.coefficients
    weights = cho_solve((samples.factor(model).T, False), residual, check_finite=False)
    mean = targets.functions @ trend.coefficients
    mean += model.carried(samples.positions, weights, targets.positions)
    passing = targets.passing
    if passing is not None:
        course = passing.fleeting.carried(samples.times, weights, passing.at_targets)
        mean += passing.share[:, None] * course
    return mean


def _whole_is_little(samples: int, targets: int) -> bool:
    """Whether so many samples and targets are soon solved as one system."""
    return samples <= EXACT_LIMIT or (samples <= MEAN_LIMIT and samples**2 * targets <= LITTLE_WORK)
