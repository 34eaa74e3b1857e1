"""Covariance models, in the vocabulary of GSTools and the parameters of gstat.

C(h) = sill * rho(h / range) for h > 0, and sill + nugget at h = 0. One line a model; the
reference is Chiles and Delfiner, Geostatistics (2012), section 2.5. An anisotropic model
reaches `range_m` along its major axis and `ratio * range_m` across it.
"""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np

from grebe.core.kernels import machine_code

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


@machine_code
def correlation(code: int, x: float) -> float:
    """Correlation at a distance of `x` ranges under model `KINDS[code]`."""
    if code == 0:
        return 1 - 1.5 * x + 0.5 * x * x * x if x < 1 else 0.0
    if code == 1:
        return math.exp(-x)
    if code == 2:
        t = math.sqrt(3.0) * x
        return (1 + t) * math.exp(-t)
    if code == 3:
        t = math.sqrt(5.0) * x
        return (1 + t + t * t / 3) * math.exp(-t)
    return math.exp(-x * x)


@machine_code
def _correlations(code: int, x: Array) -> Array:
    out = np.empty(x.size)
    flat = x.ravel()
    for i in range(flat.size):
        out[i] = correlation(code, flat[i])
    return out.reshape(x.shape)


@machine_code
def _covariances(code: int, sill: float, reach: float, a: Array, b: Array, below: bool) -> Array:
    """Of each place of `a` with each of `b`; `below`: with those up to its own number alone."""
    out = np.zeros((a.shape[0], b.shape[0]))
    for i in range(a.shape[0]):
        for j in range(i + 1 if below else b.shape[0]):
            north, east = a[i, 0] - b[j, 0], a[i, 1] - b[j, 1]
            x = math.sqrt(north * north + east * east) / reach
            out[i, j] = sill * correlation(code, x)
    return out


@machine_code
def _faded(variance: float, memory: float, a: Array, b: Array) -> Array:
    out = np.empty((a.shape[0], b.shape[0]))
    for i in range(a.shape[0]):
        for j in range(b.shape[0]):
            out[i, j] = variance * math.exp(-abs(a[i] - b[j]) / memory)
    return out


@machine_code
def _carried(code: int, at: Array, places: Array, reach: float, weights: Array) -> Array:
    out = np.zeros((at.shape[0], weights.shape[1]))
    for i in range(at.shape[0]):
        for j in range(places.shape[0]):
            north, east = at[i, 0] - places[j, 0], at[i, 1] - places[j, 1]
            share = correlation(code, math.sqrt(north * north + east * east) / reach)
            for k in range(weights.shape[1]):
                out[i, k] += share * weights[j, k]
    return out


def correlations(kind: str, x: Array) -> Array:
    """Correlation at distances of `x` ranges, any shape."""
    return _correlations(KINDS.index(kind), np.ascontiguousarray(x, dtype=float))


def slopes(kind: str, x: Array) -> Array:
    """By how much the correlation at distances of `x` ranges grows with the range's logarithm."""
    if kind == "spherical":
        return np.where(x < 1, 1.5 * (x - x**3), 0.0)
    if kind == "exponential":
        return x * np.exp(-x)
    if kind == "gaussian":
        return 2 * x**2 * np.exp(-(x**2))
    t = x * np.sqrt(3.0 if kind == "matern32" else 5.0)
    return t**2 * np.exp(-t) * (1.0 if kind == "matern32" else (1 + t) / 3)


@dataclass(frozen=True, kw_only=True)
class CovarianceModel:
    """A stationary covariance: `kind` of `KINDS`, partial `sill`, `range_m`, `nugget`
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
            raise ValueError(f"no covariance model {self.kind!r}; one of {list(KINDS)}")
        if not (self.sill >= 0 and self.nugget >= 0 and self.range_m > 0 and 0 < self.ratio <= 1):
            raise ValueError(f"impossible covariance: {self}")

    def covariance(self, distance_m: Array) -> Array:
        """Covariance of the signal at a distance along the major axis; without the nugget."""
        return self.sill * correlations(self.kind, distance_m / self.range_m)

    def between(self, a: Array, b: Array) -> Array:
        """Covariance (n, m) of the signal at places (n, 2) and (m, 2), both in coordinates without
        a direction: `covariance` of their distances, in one go.
        """
        code = KINDS.index(self.kind)
        a, b = np.ascontiguousarray(a), np.ascontiguousarray(b)
        return _covariances(code, self.sill, self.range_m, a, b, False)

    def among(self, a: Array) -> Array:
        """As `between` of places (n, 2) and themselves, but below the diagonal and on it alone."""
        code, a = KINDS.index(self.kind), np.ascontiguousarray(a)
        return _covariances(code, self.sill, self.range_m, a, a, True)

    def carried(self, places: Array, weights: Array, at: Array) -> Array:
        """Sums (m, c) of the signal's covariances with `at` (m, 2) weighted by (n, c) at `places`
        (n, 2), both in coordinates without a direction: what a matrix product would give.
        """
        code = KINDS.index(self.kind)
        return self.sill * _carried(
            code, np.ascontiguousarray(at), places, self.range_m, np.ascontiguousarray(weights)
        )

    def variogram(self, distance_m: Array) -> Array:
        """Semivariance gamma(h) for h > 0, nugget included."""
        return self.nugget + self.sill - self.covariance(distance_m)

    def isotropic(self, positions: Array) -> Array:
        """Positions (n, 2) north, east in coordinates where the model has no direction [m]."""
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
    """What all the water shares for minutes, and what two passes over one place differ by: an
    exponential process of the time alone, `variance` and `memory_s` [s].
    """

    variance: float
    memory_s: float

    def __post_init__(self) -> None:
        if not (self.variance >= 0 and self.memory_s > 0):
            raise ValueError(f"impossible covariance in time: {self}")

    def covariance(self, a: Array, b: Array) -> Array:
        """Covariance (n, m) between times (n,) and (m,) [s]."""
        a, b = np.ascontiguousarray(a, dtype=float), np.ascontiguousarray(b, dtype=float)
        return _faded(self.variance, self.memory_s, a, b)

    def carried(self, times: Array, weights: Array, at: Array) -> Array:
        """Sums (m, c) of covariances with `at` (m,) weighted by (n, c) at `times` (n,): what a
        matrix product would give, by one sweep forth and one back.
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
        """Equally likely courses at times (n,), in any order, (count, n)."""
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
