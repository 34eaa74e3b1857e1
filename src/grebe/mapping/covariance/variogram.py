"""The empirical variogram, and models fitted to it by weighted least squares.

Distance classes up to a third of the extent (gstat's default) and weights N_h / h^2 (gstat's
fit.method 7). Estimators: Matheron's, and two that outliers do not affect: Cressie and Hawkins
(1980) and Dowd (1984).
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace
from typing import TYPE_CHECKING, Literal

import numpy as np
from scipy.optimize import least_squares, minimize_scalar
from scipy.spatial.distance import pdist

from grebe.mapping.covariance.models import KINDS, CovarianceModel, correlations, stretched
from grebe.mapping.memo import remembered

if TYPE_CHECKING:
    from numpy.typing import NDArray

    Array = NDArray[np.floating]

# The automatic choice excludes the Gaussian model: no lake has so smooth a field, and without a
# nugget its standard deviations are far too small (Stein 1999, section 1.7).
AUTOMATIC = KINDS[:-1]
Estimator = Literal["matheron", "cressie", "dowd"]
ESTIMATORS: tuple[Estimator, ...] = ("matheron", "cressie", "dowd")
BINS = 15
FEWEST_PAIRS = 10
FEWEST_CLASSES = 3
# The number of pairs grows with the square of the samples; this many samples give two million.
MOST_SAMPLES = 2000
CUTOFF_SHARE = 1 / 3
# Directions of a directional variogram [deg clockwise from north], and half the width of a sector.
DIRECTIONS_DEG, SECTOR_DEG = (0.0, 45.0, 90.0, 135.0), 22.5
# A direction is used if it removes this share of the misfit and shortens the range across it by
# this ratio: more than sampling alone brings about.
LEAST_GAIN, CLEAR_RATIO = 0.3, 0.8
# Bounds of the ranges that are tried, as shares of the longest distance, and their number before
# the refinement; the largest sill, as a share of the largest semivariance.
REACHES, REACHES_TRIED, MOST_SILL = (0.01, 5.0), 60, 10.0


@dataclass(frozen=True, kw_only=True)
class EmpiricalVariogram:
    """Mean distance [m], semivariance and number of pairs of each class, (bins,) each."""

    distance_m: Array
    semivariance: Array
    pairs: NDArray[np.int64]

    def trusted(self) -> EmpiricalVariogram:
        """The classes with at least `FEWEST_PAIRS` pairs."""
        keep = self.pairs >= FEWEST_PAIRS
        return EmpiricalVariogram(
            distance_m=self.distance_m[keep],
            semivariance=self.semivariance[keep],
            pairs=self.pairs[keep],
        )


@dataclass(frozen=True, kw_only=True)
class VariogramFit:
    """A model with the empirical variogram it was fitted to.

    `candidates`: the best model of each kind that was tried, best kind first; `standard_errors` of
    nugget, sill and range_m, NaN where the data do not determine them; `reason` says in a sentence
    why this model was chosen.
    """

    model: CovarianceModel
    empirical: EmpiricalVariogram
    candidates: tuple[CovarianceModel, ...]
    standard_errors: dict[str, float]
    reason: str


@dataclass(frozen=True, kw_only=True, eq=False)
class _Classes:
    """Pairs by classes of distance: the indices `chosen` (k,) of these among all pairs, None for
    all; the class `index` (k,) of each, out of `bins`; and for the classes that are not empty, the
    number of pairs and their mean distance [m].
    """

    chosen: NDArray[np.int32] | None
    index: NDArray[np.int16]
    bins: int
    number: NDArray[np.int64]
    distance_m: Array


@dataclass(frozen=True, kw_only=True, eq=False)
class _Geometry:
    """The part of the pairs that does not depend on the values: the two samples of each, `first`
    and `second` (p,); the classes of all pairs, and of those along each of some directions.
    """

    first: NDArray[np.int32]
    second: NDArray[np.int32]
    of_all: _Classes
    along: tuple[_Classes, ...]

    def differences(self, values: Array) -> Array:
        """Absolute differences (p,) of the pairs' values."""
        return np.abs(values[self.second] - values[self.first])


# All quantities of a survey have their samples at the same places.
@remembered(2)
def _geometry(
    positions: Array, bins: int, cutoff_m: float, directions_deg: tuple[float, ...]
) -> _Geometry:
    """The pairs that are no farther apart than the cutoff."""
    distance = pdist(positions)
    near = (distance > 0) & (distance <= cutoff_m)
    distance = distance[near]
    first, second = (one[near].astype(np.int32) for one in np.triu_indices(len(positions), 1))
    # gstat's classes are open below and closed above: (k w, (k + 1) w].
    index = np.clip(np.ceil(distance * bins / cutoff_m).astype(np.int16) - 1, 0, bins - 1)
    along: list[_Classes] = []
    if directions_deg:
        way = positions[second] - positions[first]
        bearing = np.degrees(np.arctan2(way[:, 1], way[:, 0])) % 180
        for direction in directions_deg:
            off = np.abs((bearing - direction + 90) % 180 - 90)
            chosen = np.flatnonzero(off <= SECTOR_DEG).astype(np.int32)
            along.append(_of_classes(distance[chosen], index[chosen], bins, chosen))
    return _Geometry(
        first=first,
        second=second,
        of_all=_of_classes(distance, index, bins, None),
        along=tuple(along),
    )


def _of_classes(
    distance: Array, index: NDArray[np.int16], bins: int, chosen: NDArray[np.int32] | None
) -> _Classes:
    count = np.bincount(index, minlength=bins)
    filled = count > 0
    return _Classes(
        chosen=chosen,
        index=index,
        bins=bins,
        number=count[filled].astype(np.int64),
        distance_m=np.bincount(index, distance, bins)[filled] / count[filled],
    )


def _thinned(positions: Array, values: Array) -> tuple[Array, Array]:
    """At most `MOST_SAMPLES` samples, evenly spread along their order."""
    if len(values) <= MOST_SAMPLES:
        return positions, values
    chosen = np.linspace(0, len(values) - 1, MOST_SAMPLES).astype(int)
    return positions[chosen], values[chosen]


def default_cutoff_m(positions: Array) -> float:
    """A third of the diagonal of the samples' bounds."""
    return CUTOFF_SHARE * float(np.hypot(*np.ptp(positions, axis=0)))


def empirical_variogram(
    positions: Array,
    values: Array,
    bins: int = BINS,
    cutoff_m: float | None = None,
    estimator: Estimator = "matheron",
    direction_deg: float | None = None,
) -> EmpiricalVariogram:
    """Estimate the variogram of `values` (n,) at `positions` (n, 2) [m].

    More than `MOST_SAMPLES` samples are thinned evenly along their order. With a direction, only
    pairs within `SECTOR_DEG` of it count. Classes without pairs are left out.
    """
    cutoff_m = cutoff_m or default_cutoff_m(positions)
    positions, values = _thinned(positions, values)
    directions = () if direction_deg is None else (direction_deg,)
    pairs = _geometry(positions, bins, cutoff_m, directions)
    classes = pairs.of_all if direction_deg is None else pairs.along[0]
    return _estimated(classes, pairs.differences(values), estimator)


def _estimated(classes: _Classes, difference: Array, estimator: Estimator) -> EmpiricalVariogram:
    """The variogram of the pairs of some classes, from the differences (p,) of all pairs."""
    if classes.chosen is not None:
        difference = difference[classes.chosen]
    index, bins, number = classes.index, classes.bins, classes.number
    filled = np.bincount(index, minlength=bins) > 0
    if estimator == "matheron":
        semivariance = 0.5 * np.bincount(index, difference**2, bins)[filled] / number
    elif estimator == "cressie":
        root = np.bincount(index, np.sqrt(difference), bins)[filled] / number
        semivariance = 0.5 * root**4 / (0.457 + 0.494 / number)
    else:
        medians = [np.median(difference[index == k]) for k in np.flatnonzero(filled)]
        semivariance = 0.5 * 2.198 * np.square(medians)
    return EmpiricalVariogram(
        distance_m=classes.distance_m, semivariance=semivariance, pairs=number
    )


def fit_model(
    empirical: EmpiricalVariogram, kind: str, *, weighting: Literal["n/h2", "n", "1"] = "n/h2"
) -> tuple[CovarianceModel, float, Array]:
    """Fit one kind of model; return it, its weighted sum of squares scaled to unit sill, and
    the standard errors of nugget, sill and range (3,).
    """
    h, gamma = empirical.distance_m, empirical.semivariance
    level = float(gamma.max())
    if level == 0:
        flat = CovarianceModel(kind=kind, sill=0.0, range_m=float(h.max()), nugget=0.0)
        return flat, 0.0, np.zeros(3)
    roots = {
        "n/h2": np.sqrt(empirical.pairs) / h,
        "n": np.sqrt(empirical.pairs),
        "1": np.ones(len(h)),
    }[weighting]

    scaled = gamma / level

    def best_at(reach: float) -> tuple[float, float, float]:
        """Nugget and sill that fit best at a reach, as shares of the level, and the misfit."""
        rise = 1 - correlations(kind, h / (reach * h[-1]))
        nugget, sill = _bounded(roots, roots * rise, roots * scaled)
        return nugget, sill, float(np.sum((roots * (nugget + sill * rise - scaled)) ** 2))

    reach = _least(lambda log_reach: best_at(float(np.exp(log_reach)))[2])
    nugget, sill, misfit = best_at(reach)
    model = CovarianceModel(
        kind=kind,
        sill=float(sill * level),
        range_m=float(reach * h[-1]),
        nugget=float(nugget * level),
    )
    jacobian = _slopes(kind, h / h[-1], sill, reach) * roots[:, None]
    return model, misfit, _standard_errors(jacobian, misfit) * [level, level, h[-1]]


def _least(misfit: Callable[[float], float]) -> float:
    """The reach of the smallest misfit: the best of a fine logarithmic grid, refined."""
    grid = np.log(np.geomspace(REACHES[0], REACHES[1], REACHES_TRIED))
    found = [misfit(one) for one in grid.tolist()]
    best = int(np.argmin(found))
    ends = grid[max(best - 1, 0)], grid[min(best + 1, len(grid) - 1)]
    refined = minimize_scalar(misfit, bounds=ends, method="bounded", options={"xatol": 1e-10})
    return float(np.exp(refined.x if refined.fun <= found[best] else grid[best]))


def _bounded(one: Array, rise: Array, data: Array) -> tuple[float, float]:
    """Least squares of data by a nugget times `one` and a sill times `rise`, neither negative."""
    oo, rr, cross = float(one @ one), float(rise @ rise), float(one @ rise)
    od, rd = float(one @ data), float(rise @ data)
    determinant = oo * rr - cross**2
    if determinant > 1e-12 * oo * rr:
        nugget, sill = (rr * od - cross * rd) / determinant, (oo * rd - cross * od) / determinant
        if nugget >= 0 and 0 <= sill <= MOST_SILL:
            return nugget, sill
    # On a bound: no nugget, the largest sill, or a nugget alone.
    edges = [
        (0.0, min(max(rd / rr, 0.0), MOST_SILL) if rr > 0 else 0.0),
        (max((od - MOST_SILL * cross) / oo, 0.0), MOST_SILL),
        (max(od / oo, 0.0), 0.0),
    ]
    return min(edges, key=lambda at: float(np.sum((at[0] * one + at[1] * rise - data) ** 2)))


def _slopes(kind: str, h: Array, sill: float, reach: float) -> Array:
    """Derivatives of the model by nugget, sill and reach, (n, 3)."""
    step = 1e-5 * reach
    further, nearer = (correlations(kind, h / (reach + one)) for one in (step, -step))
    by_reach = -sill * (further - nearer) / (2 * step)
    return np.column_stack([np.ones(len(h)), 1 - correlations(kind, h / reach), by_reach])


def _standard_errors(jacobian: Array, squares: float) -> Array:
    """Standard errors of least squares' parameters, as if the classes were independent; NaN where
    the classes do not determine them.
    """
    free = jacobian.shape[0] - jacobian.shape[1]
    try:
        covariance = np.linalg.inv(jacobian.T @ jacobian) * squares / max(free, 1)
    except np.linalg.LinAlgError:
        return np.full(jacobian.shape[1], np.nan)
    variance = np.diag(covariance)
    return np.where(variance >= 0, np.sqrt(np.abs(variance)), np.nan)


@remembered(4)
def fit_variogram(
    positions: Array, values: Array, estimator: Estimator = "matheron"
) -> VariogramFit:
    """Estimate the variogram, choose the kind of model that fits it best, and check whether it has
    a direction. Raises `ValueError` if there are too few pairs.
    """
    cutoff_m = default_cutoff_m(positions)
    positions, values = _thinned(positions, values)
    pairs = _geometry(positions, BINS, cutoff_m, DIRECTIONS_DEG)
    difference = pairs.differences(values)
    empirical = _estimated(pairs.of_all, difference, estimator)
    trusted = empirical.trusted()
    if len(trusted.pairs) < FEWEST_CLASSES:
        raise ValueError("too few pairs of samples for a variogram")
    fits = sorted((fit_model(trusted, kind) for kind in AUTOMATIC), key=lambda fit: fit[1])
    model, _, errors = fits[0]
    rivals = ", ".join(f"{one.kind} {misfit:.3g}" for one, misfit, _ in fits)
    reason = f"{model.kind} has the smallest weighted misfit to the variogram ({rivals})"
    directed = _directed(
        [_estimated(one, difference, estimator).trusted() for one in pairs.along], model
    )
    if directed is not None:
        model, gain = directed
        errors = np.array([errors[0], errors[1], np.nan])
        reason += f"; its direction removes {gain:.0%} of the directional misfit"
    return VariogramFit(
        model=model,
        empirical=empirical,
        candidates=tuple(one for one, _, _ in fits),
        standard_errors=dict(zip(("nugget", "sill", "range_m"), errors.tolist(), strict=True)),
        reason=reason,
    )


def _directed(
    sectors: Sequence[EmpiricalVariogram], model: CovarianceModel
) -> tuple[CovarianceModel, float] | None:
    """The model with a direction, and the share by which that lowers the misfit of the variograms
    along each of `DIRECTIONS_DEG`; None if the gain is not clear.
    """
    if min(len(sector.pairs) for sector in sectors) < FEWEST_CLASSES or model.sill == 0:
        return None
    level = model.nugget + model.sill
    distance = np.concatenate([sector.distance_m for sector in sectors])
    found = np.concatenate([sector.semivariance for sector in sectors])
    roots = np.sqrt(np.concatenate([sector.pairs for sector in sectors])) / distance
    counts = [len(sector.pairs) for sector in sectors]
    bearing = np.radians(np.repeat(np.asarray(DIRECTIONS_DEG, dtype=float), counts))
    ways = np.column_stack([np.cos(bearing), np.sin(bearing)])

    def residuals(parameters: Array) -> Array:
        reach, ratio, angle = parameters
        factor = np.hypot(*stretched(ways, ratio, angle).T) / reach
        return roots * (model.variogram(distance * factor) - found) / level

    plain = float(np.sum(residuals(np.array([1.0, 1.0, 0.0])) ** 2))
    bounds = ([0.3, 0.2, -400.0], [3.0, 1.0, 400.0])
    fits = [
        least_squares(residuals, (1.2, 0.6, angle), bounds=bounds, x_scale=(1, 1, 90))
        for angle in DIRECTIONS_DEG
    ]
    best = min(fits, key=lambda fit: fit.cost)
    gain = 1 - 2 * float(best.cost) / plain if plain > 0 else 0.0
    reach, ratio, angle = best.x.tolist()
    if gain < LEAST_GAIN or ratio > CLEAR_RATIO:
        return None
    return replace(model, range_m=reach * model.range_m, ratio=ratio, angle_deg=angle % 180), gain
