"""Restricted maximum likelihood: the covariance that makes the samples' contrasts most likely.

A variogram averages pairs within its classes and extrapolates its nugget; the likelihood uses every
pair. Patterson and Thompson (1971); the sill is profiled out (Diggle and Ribeiro 2007, section
5.4.2). Standard errors come from the curvature at the maximum.
"""

from __future__ import annotations

from dataclasses import replace
from typing import TYPE_CHECKING

import numpy as np
from scipy.linalg import cho_factor, solve_triangular
from scipy.optimize import minimize
from scipy.spatial.distance import cdist

from grebe.mapping.covariance.models import CovarianceModel, correlations
from grebe.mapping.covariance.variogram import Estimator, VariogramFit, fit_variogram

if TYPE_CHECKING:
    from numpy.typing import NDArray

    Array = NDArray[np.floating]

# The cost of a factorisation grows with the cube of the samples; more than these are thinned.
MOST_SAMPLES = 500
# How many of the kinds that fit the variogram best are tried.
MOST_KINDS = 2
# Bounds of the search: ranges as shares of the samples' extent, nuggets as shares of the sill.
LEAST_RANGE, MOST_RANGE = 1e-3, 3.0
LEAST_RATIO, MOST_RATIO = 1e-6, 1e3
STEP = 1e-2
# What a direction must add to the log-likelihood to be used.
CLEAR_GAIN = 5.0


def fit_reml(positions: Array, values: Array, estimator: Estimator = "matheron") -> VariogramFit:
    """Fit the kinds of model that fit the variogram (by `estimator`) best, with and without its
    direction, by restricted likelihood; return the likeliest.

    The range is limited to `MOST_RANGE` extents: beyond that, the samples cannot distinguish a
    trend from a range. Raises `ValueError` if there are too few pairs or the values do not vary.
    """
    if np.ptp(values) == 0:
        raise ValueError("the values do not vary")
    start = fit_variogram(positions, values, estimator)
    chosen = thinned(len(values))
    at, data = positions[chosen], values[chosen]
    plain = _Restricted(at, data)
    found = [plain.best(model) for model in start.candidates[:MOST_KINDS]]
    likelihood, model, errors = max(found, key=lambda one: one[0])
    rivals = ", ".join(f"{one.kind} {gained:.1f}" for gained, one, _ in found)
    reason = f"{model.kind} has the highest restricted log-likelihood ({rivals})"
    if start.model.ratio < 1:
        shape = {"ratio": start.model.ratio, "angle_deg": start.model.angle_deg}
        directed = replace(start.model, kind=model.kind, **shape)
        gained, turned, its = _Restricted(directed.isotropic(at), data).best(directed)
        if gained > likelihood + CLEAR_GAIN:
            model, errors = replace(turned, **shape), its
            reason += f"; its direction adds {gained - likelihood:.1f} to the log likelihood"
    return VariogramFit(
        model=model,
        empirical=start.empirical,
        candidates=tuple(one for _, one, _ in found),
        standard_errors=errors,
        reason=reason,
    )


def thinned(count: int) -> NDArray[np.int64]:
    """Indices of at most `MOST_SAMPLES` samples: pairs of neighbours along the track, evenly
    spread, because near pairs determine the noise and far ones the range.
    """
    if count <= MOST_SAMPLES:
        return np.arange(count)
    first = np.linspace(0, count - 2, MOST_SAMPLES // 2).astype(np.int64)
    return np.unique(np.concatenate([first, first + 1]))


class _Restricted:
    """The likelihood of log(range / extent) and log(nugget / sill), with the sill profiled out."""

    def __init__(self, positions: Array, values: Array) -> None:
        self._distance = cdist(positions, positions)
        self._extent = float(self._distance.max())
        self._values = values - values.mean()

    def best(self, start: CovarianceModel) -> tuple[float, CovarianceModel, dict[str, float]]:
        """The highest likelihood of one kind of model, that model, and its standard errors."""
        bounds = [np.log((LEAST_RANGE, MOST_RANGE)), np.log((LEAST_RATIO, MOST_RATIO))]
        guess = (start.range_m / self._extent, max(start.nugget, 0.02 * start.sill) / start.sill
                 if start.sill > 0 else 1.0)  # fmt: skip
        found = minimize(
            lambda at: -self._profiled(start.kind, at)[0],
            np.clip(np.log(guess), *np.transpose(bounds)),
            method="Nelder-Mead",
            bounds=bounds,
            options={"xatol": 5e-3, "fatol": 1e-3, "maxfev": 120},
        )
        likelihood, sill = self._profiled(start.kind, found.x)
        share, ratio = np.exp(found.x)
        model = CovarianceModel(
            kind=start.kind,
            sill=sill,
            range_m=float(share * self._extent),
            nugget=float(ratio * sill),
        )
        return likelihood, model, self._standard_errors(model, found.x)

    def _standard_errors(self, model: CovarianceModel, at: Array) -> dict[str, float]:
        """Standard errors from the curvature of the profiled likelihood; the sill's, given the
        others, from its chi-square distribution.
        """
        hessian = np.empty((2, 2))
        steps = STEP * np.eye(2)
        for i in range(2):
            for j in range(2):
                corners = [
                    self._profiled(model.kind, at + a * steps[i] + b * steps[j])[0]
                    for a, b in ((1, 1), (1, -1), (-1, 1), (-1, -1))
                ]
                hessian[i, j] = -(corners[0] - corners[1] - corners[2] + corners[3]) / (4 * STEP**2)
        with np.errstate(invalid="ignore"):
            spread = np.sqrt(np.diag(np.linalg.pinv(hessian)))
        return {
            "nugget": float(model.nugget * spread[1]),
            "sill": model.sill * float(np.sqrt(2 / (len(self._values) - 1))),
            "range_m": float(model.range_m * spread[0]),
        }

    def _profiled(self, kind: str, at: Array) -> tuple[float, float]:
        """Restricted log-likelihood, up to a constant, at the best sill; and that sill."""
        share, ratio = np.exp(at)
        n = len(self._values)
        matrix = correlations(kind, self._distance / (share * self._extent))
        matrix[np.diag_indices(n)] += ratio + 1e-9
        try:
            factor, lower = cho_factor(matrix, lower=True, overwrite_a=True, check_finite=False)
        except np.linalg.LinAlgError:
            return -1e300, 1.0
        whitened = solve_triangular(
            factor, np.column_stack([np.ones(n), self._values]), lower=lower, check_finite=False
        )
        ones, values = whitened.T
        information = float(ones @ ones)
        mean = float(ones @ values) / information
        sill = float(np.sum((values - mean * ones) ** 2)) / (n - 1)
        log_det = 2 * float(np.sum(np.log(np.diag(factor))))
        likelihood = -0.5 * ((n - 1) * np.log(sill) + log_det + np.log(information))
        return float(likelihood), sill
