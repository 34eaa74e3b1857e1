"""A field that knows the shore: correlation follows the path around land, not across it.

A covariance of distances through the water is not positive definite. Instead, the field solves a
stochastic differential equation on the water, (kappa^2 - Laplace) x = white noise, with no flux
through the shore. Far from land its covariance is Matern's with smoothness 1 (Lindgren, Rue and
Lindstrom 2011; Bakka et al. 2019). On the map's own nodes the equation becomes a sparse matrix with
a five-point stencil; kappa and the noise are fitted by restricted likelihood.
"""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np
import shapely
from scipy.optimize import minimize
from scipy.sparse import coo_array, csc_matrix, csr_array, diags_array
from scipy.sparse.linalg import SuperLU, splu
from scipy.spatial import KDTree
from scipy.special import k1

from grebe.core.kernels import machine_code
from grebe.mapping.grid import Grid, make_grid

if TYPE_CHECKING:
    from numpy.typing import NDArray

    Array = NDArray[np.floating]

# Nodes of the coarser grid on which the parameters are fitted.
FIT_NODES = 3_000
MOST_FOR_FIT = 20_000
# At 4 / kappa, a Matern correlation of smoothness 1 has lost 95 %.
PRACTICAL = 4.0
# How many of the nodes nearest to a place are searched for one that is visible from it.
SIGHTED = 12
# Bounds of the search: practical ranges in grid steps and in extents of the water; noise over sill.
LEAST_RANGE_STEPS, MOST_RANGE_EXTENTS = 3.0, 4.0
LEAST_NOISE, MOST_NOISE = 1e-4, 1e2


@dataclass(frozen=True, kw_only=True)
class ShoreModel:
    """`range_m`: distance at which 95 % of the correlation is gone in open water; `sill`: variance
    there; `nugget`: variance of a sample's noise.
    """

    range_m: float
    sill: float
    nugget: float

    kind = "spde"
    ratio = 1.0

    def variogram(self, distance_m: Array) -> Array:
        """Semivariance gamma(h) in open water for h > 0, nugget included."""
        x = np.maximum(PRACTICAL / self.range_m * distance_m, 1e-12)
        return self.nugget + self.sill * (1 - x * k1(x))

    @property
    def kappa(self) -> float:
        """The equation's kappa [1/m]."""
        return PRACTICAL / self.range_m

    @property
    def scale(self) -> float:
        """The variance of the white noise that gives the field its sill."""
        return max(self.sill, 1e-300) * 4 * math.pi * self.kappa**2

    @property
    def practical_range_m(self) -> float:
        """Distance at which 95 % of the correlation is gone, in open water."""
        return self.range_m

    @property
    def text(self) -> str:
        """The model in a few words."""
        return f"spde with no flux through the shore, practical range {self.range_m:.0f} m"


class Mesh:
    """The water's nodes, the links between them that do not cross land, and their stencil."""

    def __init__(self, grid: Grid, water: shapely.Polygon) -> None:
        self.grid, self.step_m, self._water = grid, grid.step_m, water
        self.nodes = grid.nodes
        self.index = np.full(grid.inside.shape, -1)
        self.index[grid.inside] = np.arange(len(self.nodes))
        self._tree = KDTree(self.nodes)
        self.laplace = self._laplacian(water)

    def _laplacian(self, water: shapely.Polygon) -> csc_matrix:
        pairs = [
            np.column_stack([a[(a >= 0) & (b >= 0)], b[(a >= 0) & (b >= 0)]])
            for a, b in (
                (self.index[:-1].ravel(), self.index[1:].ravel()),
                (self.index[:, :-1].ravel(), self.index[:, 1:].ravel()),
            )
        ]
        first, second = np.concatenate(pairs).T
        shapely.prepare(water)
        links = shapely.linestrings(np.stack([self.nodes[first], self.nodes[second]], axis=1))
        clear = shapely.covers(water, links)
        first, second = first[clear], second[clear]
        n = len(self.nodes)
        adjacency = coo_array((np.ones(len(first)), (first, second)), shape=(n, n))
        adjacency = adjacency + adjacency.T
        return csc_matrix(diags_array(adjacency.sum(axis=1)) - adjacency)

    def interpolation(self, positions: Array) -> csr_array:
        """Bilinear weights (n, nodes) over the nodes that are not hidden by land. If all are
        hidden, the nearest visible node; for a place on land, the nearest node of all.
        """
        grid = self.grid
        place = (positions - [grid.north[0], grid.east[0]]) / self.step_m
        corner = np.floor(place).astype(int)
        share = place - corner
        rows, columns, weights = [], [], []
        for i, j in ((0, 0), (0, 1), (1, 0), (1, 1)):
            at = corner + np.array([i, j])
            valid = np.all((at >= 0) & (at < np.array(grid.inside.shape)), axis=1)
            node = np.where(valid, self.index[tuple(np.where(valid[:, None], at, 0).T)], -1)
            weight = np.abs(1 - i - share[:, 0]) * np.abs(1 - j - share[:, 1])
            use = (node >= 0) & (weight > 1e-9)
            use[use] = self._sees(positions[use], node[use])
            rows.append(np.flatnonzero(use))
            columns.append(node[use])
            weights.append(weight[use])
        total = np.bincount(np.concatenate(rows), np.concatenate(weights), len(positions))
        lost = np.flatnonzero(total == 0)
        rows.append(lost)
        columns.append(self._nearest_seen(positions[lost]))
        weights.append(np.ones(len(lost)))
        total[lost] = 1.0
        row = np.concatenate(rows)
        data = np.concatenate(weights) / total[row]
        shape = (len(positions), len(self.nodes))
        return csr_array((data, (row, np.concatenate(columns))), shape=shape)

    def _sees(self, positions: Array, nodes: NDArray[np.int64]) -> NDArray[np.bool_]:
        """Whether the line between each place and a node beside it is free of land."""
        seen = np.ones(len(positions), dtype=bool)
        close = shapely.dwithin(
            self._water.boundary, shapely.points(positions), 1.5 * self.step_m
        ) & shapely.intersects_xy(self._water, positions)
        lines = shapely.linestrings(np.stack([positions[close], self.nodes[nodes[close]]], axis=1))
        seen[close] = shapely.covers(self._water, lines)
        return seen

    def _nearest_seen(self, positions: Array) -> NDArray[np.int64]:
        """The nearest node visible from each place, or the nearest of all if none is."""
        if not len(positions):
            return np.empty(0, dtype=np.int64)
        _, near = self._tree.query(positions, k=min(SIGHTED, len(self.nodes)))
        near = np.asarray(near, dtype=np.int64).reshape(len(positions), -1)
        best = near[:, 0].copy()
        for column in near.T[::-1]:
            seen = self._sees(positions, column)
            best[seen] = column[seen]
        return best


class _System:
    """Samples on a mesh for a given kappa and noise over s^2; the scale s^2 is profiled out."""

    def __init__(
        self,
        mesh: Mesh,
        weights: csr_array,
        values: Array,
        basis: Array,
        kappa: float,
        noise: float,
    ) -> None:
        area = mesh.step_m**2
        operator = _operator(mesh, kappa)
        self.noise, self._weights = noise, weights
        precision = _precision(mesh, operator)
        self.posterior = _factor(csc_matrix(precision + (weights.T @ weights) / noise))
        self._log_prior = 2 * _log_det(_factor(operator)) - len(mesh.nodes) * math.log(area)
        self.basis = basis
        self.information = basis.T @ np.column_stack([self.solve(one) for one in basis.T])
        white = self.solve(values)
        self.trend = np.linalg.solve(self.information, basis.T @ white)
        self.residual = values - basis @ self.trend
        self.free = len(values) - basis.shape[1]
        self.scale = float(self.residual @ self.solve(self.residual)) / self.free

    def solve(self, vector: Array) -> Array:
        """Multiply by the inverse of the samples' covariance (over s^2)."""
        inner = self.posterior.solve(self._weights.T @ vector / self.noise)
        return (vector - self._weights @ inner) / self.noise

    def likelihood(self) -> float:
        """Restricted log-likelihood, up to a constant."""
        n = len(self.residual)
        log_det = _log_det(self.posterior) - self._log_prior + n * math.log(self.noise)
        _, log_information = np.linalg.slogdet(self.information)
        return -0.5 * (self.free * math.log(max(self.scale, 1e-300)) + log_det + log_information)


def coarse_mesh(water: shapely.Polygon) -> Mesh:
    """A mesh of the water, coarse enough for fitting."""
    return Mesh(make_grid(water, math.sqrt(water.area / FIT_NODES)), water)


def fit_spde(mesh: Mesh, positions: Array, values: Array) -> ShoreModel:
    """Fit range, sill and noise by restricted likelihood on a coarse mesh.

    Raises `ValueError` if the values do not vary.
    """
    if np.ptp(values) == 0:
        raise ValueError("the values do not vary")
    if len(values) > MOST_FOR_FIT:
        chosen = np.linspace(0, len(values) - 1, MOST_FOR_FIT).astype(int)
        positions, values = positions[chosen], values[chosen]
    weights = mesh.interpolation(positions)
    basis = np.ones((len(values), 1))
    extent = float(np.hypot(*np.ptp(mesh.nodes, axis=0)))
    bounds = [
        np.log((LEAST_RANGE_STEPS * mesh.step_m, MOST_RANGE_EXTENTS * extent)),
        np.log((LEAST_NOISE, MOST_NOISE)),
    ]

    def system(at: Array) -> _System:
        kappa = PRACTICAL / math.exp(at[0])
        # Noise over sill, in units of s^2: for s^2 = 1 the sill is 1 / (4 pi kappa^2).
        noise = math.exp(at[1]) / (4 * math.pi * kappa**2)
        return _System(mesh, weights, values - values.mean(), basis, kappa, noise)

    found = minimize(
        lambda at: -system(at).likelihood(),
        np.log((0.3 * extent, 0.1)),
        method="Nelder-Mead",
        bounds=bounds,
        options={"xatol": 0.02, "fatol": 0.01, "maxfev": 80},
    )
    reach, ratio = np.exp(found.x)
    sill = system(found.x).scale / (4 * math.pi * (PRACTICAL / reach) ** 2)
    return ShoreModel(range_m=float(reach), sill=float(sill), nugget=float(ratio * sill))


class ShoreField:
    """The signal at a mesh's nodes, given the samples: mean, variance and draws."""

    def __init__(self, mesh: Mesh, positions: Array, values: Array, model: ShoreModel) -> None:
        self._mesh = mesh
        self._weights = mesh.interpolation(positions)
        self._kappa, self._scale = model.kappa, model.scale
        noise = max(model.nugget / self._scale, LEAST_NOISE / (4 * math.pi * self._kappa**2))
        self._shift = float(values.mean())
        basis = np.ones((len(values), 1))
        self._system = _System(mesh, self._weights, values - self._shift, basis, self._kappa, noise)

    def mean(self) -> Array:
        """The best estimate at each node."""
        system = self._system
        return self._shift + float(system.trend[0]) + self._carried(system.residual)

    def variance(self) -> Array:
        """The signal's variance at each node, including that of the estimated mean."""
        own = inverse_diagonal(self._system.posterior)
        missing = 1 - self._carried(self._system.basis[:, 0])
        return self._scale * (own + missing**2 / float(self._system.information[0, 0]))

    def draws(self, count: int, seed: int) -> Array:
        """Equally likely fields given the samples, (count, nodes)."""
        rng = np.random.default_rng(seed)
        mesh, system = self._mesh, self._system
        operator = _factor(_operator(mesh, self._kappa))
        spread = math.sqrt(self._scale)
        fields = np.empty((count, len(mesh.nodes)))
        for k in range(count):
            free = operator.solve(rng.normal(size=len(mesh.nodes)) * mesh.step_m)
            noise = rng.normal(size=len(system.residual)) * math.sqrt(system.noise)
            offset = rng.normal() / math.sqrt(float(system.information[0, 0]))
            seen = self._weights @ free + noise + offset * system.basis[:, 0]
            fields[k] = spread * (free + offset + self._carried(-seen))
        return self.mean() + fields

    def _carried(self, residual: Array) -> Array:
        """The estimate at each node from residuals at the samples."""
        system = self._system
        return system.posterior.solve(self._weights.T @ residual / system.noise)


def prior_precision(mesh: Mesh, model: ShoreModel) -> csc_matrix:
    """The inverse covariance (nodes, nodes) of the signal before any sample is taken."""
    return _precision(mesh, _operator(mesh, model.kappa)) / model.scale


def _precision(mesh: Mesh, operator: csc_matrix) -> csc_matrix:
    """The inverse covariance (nodes, nodes) for white noise of variance 1."""
    return csc_matrix(operator @ operator) / mesh.step_m**2


def _operator(mesh: Mesh, kappa: float) -> csc_matrix:
    area = mesh.step_m**2
    return csc_matrix(mesh.laplace + diags_array(np.full(len(mesh.nodes), kappa**2 * area)))


def _factor(matrix: csc_matrix) -> SuperLU:
    """Factorise a symmetric positive definite matrix with its pivots on the diagonal."""
    return splu(
        matrix,
        permc_spec="MMD_AT_PLUS_A",
        diag_pivot_thresh=0.0,
        options={"SymmetricMode": True},
    )


def _log_det(factor: SuperLU) -> float:
    return float(np.sum(np.log(np.abs(factor.U.diagonal()))))


def inverse_diagonal(factor: SuperLU) -> Array:
    """The diagonal of the inverse of a factorised symmetric matrix (Takahashi et al. 1973)."""
    lower = csc_matrix(factor.L)
    lower.sort_indices()
    diagonal = _takahashi(
        lower.indptr.astype(np.int64), lower.indices.astype(np.int64),
        np.asarray(lower.data, float), factor.U.diagonal(),
    )  # fmt: skip
    return diagonal[factor.perm_c]


@machine_code
def _takahashi(
    starts: NDArray[np.int64],
    rows: NDArray[np.int64],
    lower: NDArray[np.float64],
    pivots: NDArray[np.float64],
) -> NDArray[np.float64]:
    """Entries of the inverse at the factor's non-zero entries, column by column from the last to
    the first: Z = D^-1 L^-1 + (I - L') Z.
    """
    n = pivots.shape[0]
    inverse = np.zeros(lower.shape[0])
    place = np.full(n, -1)
    diagonal = np.empty(n)
    for j in range(n - 1, -1, -1):
        low, high = starts[j], starts[j + 1]
        # The first entry of a column is the diagonal, where L is 1.
        for s in range(low + 1, high):
            place[rows[s]] = s
            inverse[s] = 0.0
        for s in range(low + 1, high):
            k = rows[s]
            inverse[s] -= lower[s] * diagonal[k]
            for t in range(starts[k] + 1, starts[k + 1]):
                other = place[rows[t]]
                if other >= 0:
                    inverse[other] -= lower[s] * inverse[t]
                    inverse[s] -= lower[other] * inverse[t]
        total = 1.0 / pivots[j]
        for s in range(low + 1, high):
            total -= lower[s] * inverse[s]
            place[rows[s]] = -1
        diagonal[j] = total
    return diagonal
