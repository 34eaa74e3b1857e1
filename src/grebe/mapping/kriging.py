"""Ordinary kriging: the best linear unbiased estimate with an unknown constant mean.

Exact for a few thousand samples, with the nearest samples of each target beyond. The
nugget is read as noise of the samples: the estimate is of the signal, its variance is the
signal's, and where the nugget is zero the samples are met exactly.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np
from scipy.linalg import lu_factor, lu_solve
from scipy.spatial import KDTree
from scipy.spatial.distance import cdist

from grebe.mapping.covariance import CovarianceModel

if TYPE_CHECKING:
    from numpy.typing import NDArray

    Array = NDArray[np.floating]

EXACT_LIMIT = 3000
NEIGHBOURS = 64
TARGETS_AT_ONCE = 2000
# Two samples nearer than this are one place: without a nugget they would make the system
# singular.
SAME_PLACE_M = 0.01


@dataclass(frozen=True, kw_only=True)
class Estimate:
    """Mean and variance of the signal at each target, (m,) each."""

    mean: Array
    variance: Array

    @property
    def sd(self) -> Array:
        """Standard deviation of the signal."""
        return np.sqrt(self.variance)


def krige(
    positions: Array,
    values: Array,
    targets: Array,
    model: CovarianceModel,
    neighbours: int | None = None,
) -> Estimate:
    """Estimate the signal at `targets` (m, 2) from `values` (n,) at `positions` (n, 2) [m].

    `neighbours` limits each estimate to that many nearest samples; by default all are used
    up to `EXACT_LIMIT` samples and `NEIGHBOURS` beyond.
    """
    if len(values) == 0 or not (np.isfinite(positions).all() and np.isfinite(values).all()):
        raise ValueError("kriging needs at least one sample, and finite ones")
    positions, values, counts = merge_places(positions, values)
    if neighbours is None and len(values) > EXACT_LIMIT:
        neighbours = NEIGHBOURS
    if model.sill == 0 and model.nugget == 0:
        return Estimate(mean=np.full(len(targets), values.mean()), variance=np.zeros(len(targets)))
    noise = model.nugget / counts
    if neighbours is None or neighbours >= len(values):
        return _exact(positions, values, noise, targets, model)
    return _local(positions, values, noise, targets, model, neighbours)


def merge_places(positions: Array, values: Array) -> tuple[Array, Array, Array]:
    """Average samples of one place; return positions, values and how many each stands for.

    Equal values at one place are one reading, recorded for several sets that overlap there.
    """
    _, once = np.unique(np.column_stack([positions, values]), axis=0, return_index=True)
    positions, values = positions[np.sort(once)], values[np.sort(once)]
    cells = np.round(positions / SAME_PLACE_M).astype(np.int64)
    _, first, inverse = np.unique(cells, axis=0, return_index=True, return_inverse=True)
    inverse = inverse.ravel()
    counts = np.bincount(inverse).astype(float)
    means = np.bincount(inverse, values) / counts
    return positions[first], means, counts


def _exact(
    positions: Array, values: Array, noise: Array, targets: Array, model: CovarianceModel
) -> Estimate:
    n = len(values)
    system = _system(model.covariance(cdist(positions, positions)), noise)
    factor = lu_factor(system, check_finite=False)
    dual = lu_solve(factor, np.append(values, 0.0), check_finite=False)
    mean, variance = np.empty(len(targets)), np.empty(len(targets))
    for start in range(0, len(targets), TARGETS_AT_ONCE):
        part = slice(start, start + TARGETS_AT_ONCE)
        right = np.ones((n + 1, len(targets[part])))
        right[:n] = model.covariance(cdist(positions, targets[part]))
        weights = lu_solve(factor, right, check_finite=False)
        mean[part] = right.T @ dual
        variance[part] = model.sill - np.sum(weights * right, axis=0)
    return Estimate(mean=mean, variance=np.maximum(variance, 0.0))


def _local(
    positions: Array,
    values: Array,
    noise: Array,
    targets: Array,
    model: CovarianceModel,
    neighbours: int,
) -> Estimate:
    tree = KDTree(positions)
    mean, variance = np.empty(len(targets)), np.empty(len(targets))
    for start in range(0, len(targets), TARGETS_AT_ONCE):
        part = slice(start, start + TARGETS_AT_ONCE)
        distance, index = tree.query(targets[part], k=neighbours)
        near = np.asarray(index)
        around = positions[near]
        between = np.linalg.norm(around[:, :, None, :] - around[:, None, :, :], axis=-1)
        system = _system(model.covariance(between), noise[near])
        right = np.ones((len(near), neighbours + 1))
        right[:, :-1] = model.covariance(distance)
        weights = np.linalg.solve(system, right[..., None])[..., 0]
        mean[part] = np.sum(weights[:, :-1] * values[near], axis=1)
        variance[part] = model.sill - np.sum(weights * right, axis=1)
    return Estimate(mean=mean, variance=np.maximum(variance, 0.0))


def _system(covariance: Array, noise: Array) -> Array:
    """The kriging matrix [[C + noise, 1], [1, 0]], for one system or a stack of them."""
    n = covariance.shape[-1]
    system = np.ones((*covariance.shape[:-2], n + 1, n + 1))
    system[..., :n, :n] = covariance
    diagonal = np.arange(n)
    system[..., diagonal, diagonal] += noise
    system[..., n, n] = 0.0
    return system
