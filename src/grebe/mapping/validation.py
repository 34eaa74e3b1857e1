"""Cross-validation by blocks: what the maps are worth where no sample lies near.

Along a track neighbours betray the answer, so whole stretches of the track are left out at
a time, not single samples.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np
from scipy.spatial import KDTree

from grebe.mapping.covariance import CovarianceModel
from grebe.mapping.kriging import NEIGHBOURS, krige

if TYPE_CHECKING:
    from numpy.typing import NDArray

    Array = NDArray[np.floating]

FOLDS = 10


@dataclass(frozen=True, kw_only=True)
class Validation:
    """Errors of left-out samples, in the unit of the quantity.

    `msdr` is the mean squared standardised error (ideal 1); `coverage95` the share of
    samples within their 95 % interval; `nearest_rmse` what the nearest sample would give.
    """

    samples: int
    rmse: float
    bias: float
    msdr: float
    coverage95: float
    nearest_rmse: float


def validate(positions: Array, values: Array, model: CovarianceModel) -> Validation | None:
    """Leave out each tenth of the track in turn; None for fewer than 20 samples."""
    n = len(values)
    if n < 2 * FOLDS:
        return None
    fold = np.arange(n) * FOLDS // n
    error, variance, nearest = np.empty(n), np.empty(n), np.empty(n)
    for k in range(FOLDS):
        out = fold == k
        estimate = krige(positions[~out], values[~out], positions[out], model, NEIGHBOURS)
        error[out] = estimate.mean - values[out]
        variance[out] = estimate.variance + model.nugget
        nearest[out] = _nearest(positions[~out], values[~out], positions[out]) - values[out]
    safe = np.maximum(variance, np.finfo(float).tiny)
    standardised = np.where(variance > 0, error / np.sqrt(safe), 0.0)
    return Validation(
        samples=n,
        rmse=float(np.sqrt(np.mean(error**2))),
        bias=float(np.mean(error)),
        msdr=float(np.mean(standardised**2)),
        coverage95=float(np.mean(np.abs(standardised) <= 1.96)),
        nearest_rmse=float(np.sqrt(np.mean(nearest**2))),
    )


def _nearest(positions: Array, values: Array, targets: Array) -> Array:
    _, index = KDTree(positions).query(targets)
    return values[index]
