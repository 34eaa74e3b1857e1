"""Covariance models, in the vocabulary of GSTools and the parameters of gstat.

C(h) = sill * rho(h / range) for h > 0, and sill + nugget at h = 0. Each model is one line; the
reference is Chiles and Delfiner, Geostatistics (2012), section 2.5. An anisotropic model has the
range `range_m` along its major axis and `ratio * range_m` across it.
"""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np

from grebe.mapping.covariance.correlation import (
    add_faded,
    carried,
    correlations_of,
    covariances,
    faded,
    slopes_of,
)

if TYPE_CHECKING:
    from numpy.typing import NDArray

    Array = NDArray[np.floating]

KINDS = ("spherical", "exponential", "matern32", "matern52", "gaussian")

# Distance, in units of the range parameter, at which the correlation has fallen to 5 %.
PRACTICAL_RANGE = {
    "spherical": 0.811,
    "exponential": 2.996,
    "matern32": 2.739,
    "matern52": 2.653,
    "gaussian": 1.731,
}


def correlations(kind: str, x: Array) -> Array:
    """Correlation at distances of `x` ranges, any shape."""
    flat = np.ascontiguousarray(x, dtype=float).ravel()
    return correlations_of(KINDS.index(kind), flat).reshape(np.shape(x))


def slopes(kind: str, x: Array) -> tuple[Array, Array]:
    """The derivatives of the correlations at distances of `x` ranges, any shape, by the logarithm
    of the range; and the correlations themselves.
    """
    flat = np.ascontiguousarray(x, dtype=float).ravel()
    grown, found = slopes_of(KINDS.index(kind), flat)
    return grown.reshape(np.shape(x)), found.reshape(np.shape(x))


@dataclass(frozen=True, kw_only=True)
class CovarianceModel:
    """A stationary covariance: `kind` from `KINDS`, partial `sill`, `range_m`, `nugget`
    (variances in the square of the quantity's unit); `ratio` of the range across to the range
    along the major axis, which points `angle_deg` clockwise from north.
    """

    kind: str
    sill: float
    range_m: float
    nugget: float
    ratio: float = 1.0
    angle_deg: float = 0.0

    def __post_init__(self) -> None:
        if self.kind not in KINDS:
            raise ValueError(
                f"there is no covariance model {self.kind!r}; choose one of {list(KINDS)}"
            )
        if not (self.sill >= 0 and self.nugget >= 0 and self.range_m > 0 and 0 < self.ratio <= 1):
            raise ValueError(f"impossible covariance: {self}")

    def covariance(self, distance_m: Array) -> Array:
        """Covariance of the signal at a distance along the major axis, without the nugget."""
        return self.sill * correlations(self.kind, distance_m / self.range_m)

    def between(self, a: Array, b: Array) -> Array:
        """Covariance (n, m) of the signal at places (n, 2) and (m, 2), both in isotropic
        coordinates: `covariance` of all their distances at once.
        """
        code = KINDS.index(self.kind)
        a, b = np.ascontiguousarray(a), np.ascontiguousarray(b)
        return covariances(code, self.sill, self.range_m, a, b, False)

    def among(self, a: Array) -> Array:
        """As `between` for places (n, 2) and themselves, but on and below the diagonal only."""
        code, a = KINDS.index(self.kind), np.ascontiguousarray(a)
        return covariances(code, self.sill, self.range_m, a, a, True)

    def carried(self, places: Array, weights: Array, at: Array) -> Array:
        """Sums (m, c) of the signal's covariances with `at` (m, 2), weighted by (n, c) at `places`
        (n, 2), both in isotropic coordinates. Equal to a matrix product.
        """
        code = KINDS.index(self.kind)
        return self.sill * carried(
            code, np.ascontiguousarray(at), places, self.range_m, np.ascontiguousarray(weights)
        )

    def variogram(self, distance_m: Array) -> Array:
        """Semivariance gamma(h) for h > 0, nugget included."""
        return self.nugget + self.sill - self.covariance(distance_m)

    def isotropic(self, positions: Array) -> Array:
        """Positions (n, 2) north, east in coordinates in which the model is isotropic [m]."""
        if self.ratio == 1.0:
            return np.ascontiguousarray(positions, dtype=float)
        return stretched(positions, self.ratio, self.angle_deg)

    @property
    def practical_range_m(self) -> float:
        """Distance at which 95 % of the correlation is gone."""
        return PRACTICAL_RANGE[self.kind] * self.range_m

    @property
    def text(self) -> str:
        """The model in a few words."""
        words = f"{self.kind}, practical range {self.practical_range_m:.0f} m"
        if self.ratio < 1:
            words += f" along {self.angle_deg:.0f} deg and {self.ratio:.2f} of it across"
        return words


@dataclass(frozen=True, kw_only=True)
class Fleeting:
    """What all the water shares for minutes, and by which two passes over one place differ: an
    exponential process of time alone, with `variance` and `memory_s` [s].
    """

    variance: float
    memory_s: float

    def __post_init__(self) -> None:
        if not (self.variance >= 0 and self.memory_s > 0):
            raise ValueError(f"impossible covariance in time: {self}")

    def covariance(self, a: Array, b: Array) -> Array:
        """Covariance (n, m) between times (n,) and (m,) [s]."""
        a, b = np.ascontiguousarray(a, dtype=float), np.ascontiguousarray(b, dtype=float)
        return faded(self.variance, self.memory_s, a, b)

    def add_among(self, times: Array, covariance: Array) -> None:
        """Add the covariance of times (n,) with themselves to a matrix (n, n), on and below the
        diagonal only.
        """
        add_faded(
            self.variance, self.memory_s, np.ascontiguousarray(times, dtype=float), covariance
        )

    def carried(self, times: Array, weights: Array, at: Array) -> Array:
        """Sums (m, c) of covariances with `at` (m,), weighted by (n, c) at `times` (n,). Equal to a
        matrix product, but computed by one forward and one backward sweep.
        """
        order = np.argsort(times, kind="stable")
        when, before, after = times[order], weights[order].copy(), weights[order].copy()
        kept = np.exp(-np.diff(when) / self.memory_s)
        for i, share in enumerate(kept.tolist()):
            before[i + 1] += share * before[i]
        for i, share in reversed(list(enumerate(kept.tolist()))):
            after[i] += share * after[i + 1]
        place = np.searchsorted(when, at, side="right")
        last, following = np.maximum(place - 1, 0), np.minimum(place, len(when) - 1)
        ago = np.where(place > 0, np.exp(-np.abs(at - when[last]) / self.memory_s), 0.0)
        until = np.where(
            place < len(when), np.exp(-np.abs(when[following] - at) / self.memory_s), 0
        )
        sums = ago[:, None] * before[last] + until[:, None] * after[following]
        return self.variance * sums

    def draws(self, times: Array, count: int, rng: np.random.Generator) -> Array:
        """Equally likely realisations at times (n,), in any order, (count, n)."""
        order = np.argsort(times, kind="stable")
        kept = np.exp(-np.diff(times[order]) / self.memory_s)
        fresh = np.sqrt(self.variance) * rng.normal(size=(count, len(times)))
        drawn = np.empty_like(fresh)
        drawn[:, 0] = fresh[:, 0]
        for i, share in enumerate(kept.tolist(), start=1):
            drawn[:, i] = share * drawn[:, i - 1] + np.sqrt(1 - share**2) * fresh[:, i]
        out = np.empty_like(drawn)
        out[:, order] = drawn
        return out


def stretched(positions: Array, ratio: float, angle_deg: float) -> Array:
    """Coordinates along the direction `angle_deg` and, widened by 1 / `ratio`, across it."""
    cosine, sine = math.cos(math.radians(angle_deg)), math.sin(math.radians(angle_deg))
    along = positions @ np.array([cosine, sine])
    across = positions @ np.array([-sine, cosine]) / ratio
    return np.column_stack([along, across])
