"""The empirical variogram, and the model fitted to it.

Matheron's estimator in distance classes up to a third of the extent (gstat's default), and
weighted least squares with weights N_h / h^2 (gstat's fit.method 7).
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np
from scipy.optimize import least_squares
from scipy.spatial.distance import pdist

from grebe.mapping.covariance import CORRELATIONS, CovarianceModel

if TYPE_CHECKING:
    from numpy.typing import NDArray

    Array = NDArray[np.floating]

BINS = 15
FEWEST_PAIRS = 10
# Pairs grow with the square of the samples; this many samples give four million.
MOST_SAMPLES = 3000
CUTOFF_SHARE = 1 / 3


@dataclass(frozen=True, kw_only=True)
class EmpiricalVariogram:
    """Mean distance [m], semivariance and number of pairs of each class, (bins,) each."""

    distance_m: Array
    semivariance: Array
    pairs: NDArray[np.int64]


@dataclass(frozen=True, kw_only=True)
class VariogramFit:
    """A model with the empirical variogram it was fitted to and the misfit of each kind."""

    model: CovarianceModel
    empirical: EmpiricalVariogram
    misfits: dict[str, float]

    @property
    def reason(self) -> str:
        """Why this model was chosen, in a sentence."""
        rivals = ", ".join(f"{kind} {misfit:.3g}" for kind, misfit in self.misfits.items())
        return f"{self.model.kind} has the smallest weighted misfit ({rivals})"


def empirical_variogram(
    positions: Array, values: Array, bins: int = BINS, cutoff_m: float | None = None
) -> EmpiricalVariogram:
    """Estimate the variogram of `values` (n,) at `positions` (n, 2) [m].

    More than `MOST_SAMPLES` samples are thinned evenly along their order. `cutoff_m`
    defaults to a third of the diagonal of the samples' bounds. Classes without pairs are
    left out.
    """
    if len(values) > MOST_SAMPLES:
        chosen = np.linspace(0, len(values) - 1, MOST_SAMPLES).astype(int)
        positions, values = positions[chosen], values[chosen]
    if cutoff_m is None:
        cutoff_m = CUTOFF_SHARE * float(np.hypot(*np.ptp(positions, axis=0)))
    distance = pdist(positions)
    squared = pdist(values[:, None], "sqeuclidean")
    near = (distance > 0) & (distance <= cutoff_m)
    width = cutoff_m / bins
    # gstat's classes are open below and closed above: (k w, (k + 1) w].
    index = np.ceil(distance[near] / width).astype(int) - 1
    index = np.clip(index, 0, bins - 1)
    pairs = np.bincount(index, minlength=bins)
    filled = pairs > 0
    mean_distance = np.bincount(index, distance[near], bins)[filled] / pairs[filled]
    semivariance = 0.5 * np.bincount(index, squared[near], bins)[filled] / pairs[filled]
    return EmpiricalVariogram(
        distance_m=mean_distance, semivariance=semivariance, pairs=pairs[filled].astype(np.int64)
    )


def fit_model(empirical: EmpiricalVariogram, kind: str) -> tuple[CovarianceModel, float]:
    """Fit one kind of model; return it and its weighted sum of squares, scaled to unit sill."""
    h, gamma = empirical.distance_m, empirical.semivariance
    level = float(gamma.max())
    if level == 0:
        return CovarianceModel(kind=kind, sill=0.0, range_m=float(h.max()), nugget=0.0), 0.0
    weights = np.sqrt(empirical.pairs) / h

    def residuals(parameters: Array) -> Array:
        nugget, sill, reach = parameters
        modelled = nugget + sill * (1 - CORRELATIONS[kind](h / (reach * h[-1])))
        return weights * (modelled - gamma / level)

    starts = [(0.05, 0.9, reach) for reach in (0.15, 0.5, 1.0)]
    bounds = ([0.0, 0.0, 0.01], [2.0, 10.0, 5.0])
    fits = [least_squares(residuals, start, bounds=bounds) for start in starts]
    best = min(fits, key=lambda fit: fit.cost)
    nugget, sill, reach = best.x
    model = CovarianceModel(
        kind=kind,
        sill=float(sill * level),
        range_m=float(reach * h[-1]),
        nugget=float(nugget * level),
    )
    return model, float(2 * best.cost)


def fit_variogram(positions: Array, values: Array) -> VariogramFit:
    """Estimate the variogram and choose the kind of model that fits it best."""
    empirical = empirical_variogram(positions, values)
    usable = empirical.pairs >= FEWEST_PAIRS
    if usable.sum() < 3:
        raise ValueError("too few pairs of samples for a variogram")
    trusted = EmpiricalVariogram(
        distance_m=empirical.distance_m[usable],
        semivariance=empirical.semivariance[usable],
        pairs=empirical.pairs[usable],
    )
    fits = {kind: fit_model(trusted, kind) for kind in CORRELATIONS}
    best = min(fits, key=lambda kind: fits[kind][1])
    return VariogramFit(
        model=fits[best][0],
        empirical=empirical,
        misfits={kind: misfit for kind, (_, misfit) in fits.items()},
    )
