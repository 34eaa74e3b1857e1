"""Joint covariances of several quantities: the linear model of coregionalisation.

Every quantity is a sum of the same structures. For each structure, a positive definite matrix holds
the quantities' variances and covariances:

    C_ij(h) = sum over k of B_k[i, j] rho(h / r_k).

Wackernagel, Multivariate Geostatistics (2003), chapter 26; Chiles and Delfiner (2012), section 5.6.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING, cast

import numpy as np
from scipy.linalg import cho_solve, cholesky, solve_triangular
from scipy.optimize import bisect
from scipy.spatial.distance import cdist

from grebe.mapping.covariance.models import KINDS, correlations

if TYPE_CHECKING:
    from numpy.typing import NDArray

    Array = NDArray[np.floating]
    Indices = NDArray[np.int64]

# Added to the diagonal, as a share of the variance.
JITTER = 1e-9
TARGETS_AT_ONCE = 2000


@dataclass(frozen=True, kw_only=True, eq=False)
class Coregionalisation:
    """`sills`, one matrix (q, q) for each structure; their `ranges_m`; the `nuggets` (q,) of the q
    quantities; `kind` from `KINDS`.
    """

    kind: str
    sills: tuple[Array, ...]
    ranges_m: tuple[float, ...]
    nuggets: Array

    def __post_init__(self) -> None:
        if self.kind not in KINDS:
            raise ValueError(
                f"there is no covariance model {self.kind!r}; choose one of {list(KINDS)}"
            )
        if len(self.sills) != len(self.ranges_m) or min(self.ranges_m) <= 0:
            raise ValueError("each structure has a matrix and a range above 0")
        for sill in self.sills:
            least = float(np.linalg.eigvalsh(sill).min())
            if least < -1e-9 * float(np.trace(sill)) or not np.allclose(sill, sill.T):
                raise ValueError(f"a structure's matrix is not a covariance: {sill.tolist()}")

    @property
    def whole(self) -> Array:
        """Covariance (q, q) of the quantities at one place, without the noise."""
        return np.sum(self.sills, axis=0)

    def correlation(self, i: int, j: int) -> float:
        """Correlation of two quantities at one place; 0 if one does not vary."""
        whole = self.whole
        both = float(np.sqrt(whole[i, i] * whole[j, j]))
        return float(whole[i, j]) / both if both > 0 else 0.0

    def covariance(self, i: int, distance_m: Array) -> Array:
        """Covariance of a quantity with itself at a distance, without its nugget."""
        parts = zip(self.sills, self.ranges_m, strict=True)
        return np.sum(
            [sill[i, i] * correlations(self.kind, distance_m / reach) for sill, reach in parts],
            axis=0,
        )

    def between(self, a: Array, of_a: Indices, b: Array, of_b: Indices) -> Array:
        """Covariance (n, m) between the signals of quantities `of_a` (n,) at places (n, 2) and
        those of `of_b` (m,) at (m, 2).
        """
        distance = cdist(a, b)
        found = np.zeros_like(distance)
        for sill, reach in zip(self.sills, self.ranges_m, strict=True):
            found += sill[np.ix_(of_a, of_b)] * correlations(self.kind, distance / reach)
        return found

    def practical_range_m(self, i: int) -> float:
        """Distance at which 95 % of a quantity's correlation is gone."""
        sill, far = float(self.whole[i, i]), 10.0 * max(self.ranges_m)

        def left(distance: float) -> float:
            return float(self.covariance(i, np.array([distance]))[0]) - 0.05 * sill

        return cast(float, bisect(left, 0.0, far)) if sill > 0 else 0.0


@dataclass(frozen=True, kw_only=True, eq=False)
class Observed:
    """Values (n,) of several quantities, each by its number `of` (n,), at positions (n, 2) [m],
    and the `noise` variance (n,) of each. Several columns of values (n, c) share one variance.
    """

    positions: Array
    values: Array
    of: Indices
    noise: Array


class Cokriging:
    """The best linear unbiased estimate of one quantity from values of several, each with its own
    unknown mean (ordinary cokriging).
    """

    def __init__(self, observed: Observed, model: Coregionalisation) -> None:
        self._observed, self._model = observed, model
        at, of = observed.positions, observed.of
        system = model.between(at, of, at, of)
        variance = np.diag(model.whole)[of]
        system[np.diag_indices(len(of))] += observed.noise + JITTER * np.maximum(variance, 1e-300)
        self._factor = cholesky(system, lower=True, overwrite_a=True, check_finite=False)
        present, column = np.unique(of, return_inverse=True)
        self._present = present
        means = np.eye(len(present))[np.asarray(column).ravel()]
        both = solve_triangular(
            self._factor, np.column_stack([observed.values, means]), lower=True, check_finite=False
        )
        width = both.shape[1] - len(present)
        data, self._basis = np.split(both, [width], axis=1)
        self._information = cholesky(self._basis.T @ self._basis, lower=True)
        self._means = cho_solve((self._information, True), self._basis.T @ data)
        self._data = data - self._basis @ self._means

    def estimate(self, targets: Array, wanted: int) -> tuple[Array, Array]:
        """Mean (m,) or (m, c) and variance (m,) of the signal of one quantity at targets (m, 2).

        Raises `ValueError` if no value of it was observed, because its mean is then unknown.
        """
        if wanted not in self._present:
            raise ValueError("cokriging needs a value of the quantity that is asked for")
        unit = (self._present == wanted).astype(float)
        mean = np.empty((len(targets), self._data.shape[1]))
        variance = np.empty(len(targets))
        whole = float(self._model.whole[wanted, wanted])
        for start in range(0, len(targets), TARGETS_AT_ONCE):
            part = slice(start, start + TARGETS_AT_ONCE)
            near = self._near(targets[part], wanted)
            lacking = unit[:, None] - self._basis.T @ near
            missing = solve_triangular(self._information, lacking, lower=True)
            mean[part] = near.T @ self._data + unit @ self._means
            variance[part] = whole - np.sum(near**2, axis=0) + np.sum(missing**2, axis=0)
        mean = mean[:, 0] if self._observed.values.ndim == 1 else mean
        return mean, np.maximum(variance, 0.0)

    def _near(self, targets: Array, wanted: int) -> Array:
        """The covariances (n, m) of the observations with the targets, whitened."""
        observed, of = self._observed, np.full(len(targets), wanted)
        between = self._model.between(observed.positions, observed.of, targets, of)
        return solve_triangular(
            self._factor, between, lower=True, check_finite=False, overwrite_b=True
        )
