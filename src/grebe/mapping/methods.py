"""The ways to estimate a signal between samples, behind one face, and the choice among them."""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING, Literal, Protocol

import numpy as np
import shapely

from grebe.mapping.covariance import CovarianceModel
from grebe.mapping.drift import DriftFunction
from grebe.mapping.grid import Grid
from grebe.mapping.kriging import Drift, Estimate, krige
from grebe.mapping.simulation import circulant_fields
from grebe.mapping.spde import Mesh, ShoreField, ShoreModel

if TYPE_CHECKING:
    from numpy.typing import NDArray

    Array = NDArray[np.floating]

Method = Literal["kriging", "spde"]
METHODS: tuple[Method, ...] = ("kriging", "spde")
# Land matters where more of the sight lines within the range cross it than this.
BLOCKED_SHARE = 0.02
SIGHT_LINES = 2_000
# Fields are drawn so many times as fine as the map, where that is not too much.
REFINE, MOST_DRAWN_NODES = 3, 2_000_000
# The smallest draws are made of so many at once, to keep memory in bounds.
DRAWS_AT_ONCE = 20


class Interpolator(Protocol):
    """Estimates the signal anywhere in the water from samples."""

    @property
    def model(self) -> CovarianceModel | ShoreModel:
        """The covariance; its `nugget` is what an observation varies besides the signal."""
        ...

    def estimate(self, positions: Array, values: Array, targets: Array) -> Estimate:
        """Mean and variance of the signal at `targets` (m, 2)."""
        ...

    def draws(self, positions: Array, values: Array, grid: Grid, count: int, seed: int) -> Array:
        """Equally likely fields at the grid's nodes given the samples, (count, nodes)."""
        ...


@dataclass(frozen=True, kw_only=True)
class Kriging:
    """Kriging with a covariance of the straight distance, and a drift."""

    model: CovarianceModel
    drift: DriftFunction | None = None

    def estimate(self, positions: Array, values: Array, targets: Array) -> Estimate:
        """See `Interpolator`."""
        drift = None
        if self.drift is not None:
            drift = Drift(at_samples=self.drift(positions), at_targets=self.drift(targets))
        return krige(positions, values, targets, self.model, drift=drift)

    def draws(self, positions: Array, values: Array, grid: Grid, count: int, seed: int) -> Array:
        """Free fields whose error at the samples is taken away by kriging."""
        fields = np.empty((count, int(grid.inside.sum())))
        rng = np.random.default_rng(seed)
        refine = REFINE if grid.inside.size * REFINE**2 < MOST_DRAWN_NODES else 1
        for start in range(0, count, DRAWS_AT_ONCE):
            part = slice(start, min(start + DRAWS_AT_ONCE, count))
            free, seen = circulant_fields(
                self.model, grid, positions, part.stop - start, rng, refine
            )
            noise = rng.normal(0.0, np.sqrt(self.model.nugget), seen.shape)
            lack = values[:, None] - (seen + noise).T
            fields[part] = free + self.estimate(positions, lack, grid.nodes).mean.T
        return fields


@dataclass(frozen=True, kw_only=True)
class ShoreInterpolator:
    """A field that knows the shore, on a mesh of the water."""

    model: ShoreModel
    mesh: Mesh

    def estimate(self, positions: Array, values: Array, targets: Array) -> Estimate:
        """See `Interpolator`; between nodes by bilinear weights."""
        field = ShoreField(self.mesh, positions, values, self.model)
        weights = self.mesh.interpolation(targets)
        return Estimate(
            mean=weights @ field.mean(), variance=np.maximum(weights @ field.variance(), 0.0)
        )

    def draws(self, positions: Array, values: Array, grid: Grid, count: int, seed: int) -> Array:
        """See `Interpolator`."""
        field = ShoreField(self.mesh, positions, values, self.model)
        return (self.mesh.interpolation(grid.nodes) @ field.draws(count, seed).T).T


def blocked_share(
    water: shapely.Polygon, positions: Array, nodes: Array, reach_m: float, seed: int = 0
) -> float:
    """Share of the straight lines from samples to nodes within reach that cross land."""
    rng = np.random.default_rng(seed)
    a = positions[rng.integers(len(positions), size=20 * SIGHT_LINES)]
    b = nodes[rng.integers(len(nodes), size=20 * SIGHT_LINES)]
    near = np.flatnonzero(np.hypot(*(a - b).T) <= reach_m)[:SIGHT_LINES]
    if not len(near):
        return 0.0
    shapely.prepare(water)
    # Samples may lie a GPS error beyond the shore: their lines say nothing.
    near = near[shapely.intersects_xy(water, a[near])]
    lines = shapely.linestrings(np.stack([a[near], b[near]], axis=1))
    return float(1 - np.mean(shapely.covers(water, lines))) if len(near) else 0.0


def chosen_method(share: float) -> tuple[Method, str]:
    """The method for a share of blocked sight lines, and the reason in a sentence."""
    if share > BLOCKED_SHARE:
        return "spde", f"land crosses {share:.0%} of the sight lines within the range"
    if share > 0:
        return "kriging", f"land crosses only {share:.1%} of the sight lines within the range"
    return "kriging", "no land lies between the samples and the map"
