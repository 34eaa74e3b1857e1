"""Covariance models, in the vocabulary of GSTools and the parameters of gstat.

C(h) = sill * rho(h / range) for h > 0, and sill + nugget at h = 0. One line a model; the
reference is Chiles and Delfiner, Geostatistics (2012), section 2.5.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np

if TYPE_CHECKING:
    from numpy.typing import NDArray

    Array = NDArray[np.floating]


def _spherical(x: Array) -> Array:
    return np.where(x < 1, 1 - 1.5 * x + 0.5 * x**3, 0.0)


def _exponential(x: Array) -> Array:
    return np.exp(-x)


def _matern32(x: Array) -> Array:
    return (1 + np.sqrt(3) * x) * np.exp(-np.sqrt(3) * x)


CORRELATIONS: dict[str, Callable[[Array], Array]] = {
    "spherical": _spherical,
    "exponential": _exponential,
    "matern32": _matern32,
}

# Distance, in units of the range parameter, at which the correlation has fallen to 5 %.
PRACTICAL_RANGE = {"spherical": 0.811, "exponential": 2.996, "matern32": 2.739}


@dataclass(frozen=True, kw_only=True)
class CovarianceModel:
    """A stationary, isotropic covariance: `kind` of `CORRELATIONS`, partial `sill`, `range_m`,
    `nugget` (variances in the square of the quantity's unit).
    """

    kind: str
    sill: float
    range_m: float
    nugget: float

    def __post_init__(self) -> None:
        if self.kind not in CORRELATIONS:
            raise ValueError(f"no covariance model {self.kind!r}; one of {list(CORRELATIONS)}")
        if not (self.sill >= 0 and self.nugget >= 0 and self.range_m > 0):
            raise ValueError(f"impossible covariance: {self}")

    def covariance(self, distance_m: Array) -> Array:
        """Covariance of the signal at a distance; the nugget is not in it."""
        return self.sill * CORRELATIONS[self.kind](distance_m / self.range_m)

    def variogram(self, distance_m: Array) -> Array:
        """Semivariance gamma(h) for h > 0, nugget included."""
        return self.nugget + self.sill - self.covariance(distance_m)

    @property
    def practical_range_m(self) -> float:
        """Distance at which 95 % of the correlation is gone."""
        return PRACTICAL_RANGE[self.kind] * self.range_m
