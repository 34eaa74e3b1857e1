"""The true water of a simulation: a field of each quantity, correlated in space.

Free fields have the spread and range measured on lakes; conditioned fields go through the
samples of a real track and have its variogram. Both are drawn once on a grid. The truth
between nodes is defined as their bilinear interpolation, so that maps can be compared with it.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from functools import cached_property
from typing import TYPE_CHECKING, Any

import numpy as np
from scipy.interpolate import RegularGridInterpolator
from scipy.spatial.distance import cdist

from grebe.core.quantities import LIMNOLOGICAL, Quantities

if TYPE_CHECKING:
    from numpy.typing import NDArray

    Array = NDArray[np.float64]

NODES_PER_SIDE = 101
MOST_CONDITIONS = 400
FEWEST_CONDITIONS = 10


@dataclass(frozen=True, kw_only=True)
class Water:
    """The true fields on a grid, and the noise that a sonde adds to each.

    `north`, `east` are the nodes [m]; `fields` (len(north), len(east)) for each quantity;
    `noise_sd` the uncorrelated part: sensor noise and variation smaller than the spacing of nodes.
    """

    north: Array
    east: Array
    fields: Mapping[str, Array]
    noise_sd: Mapping[str, float]

    def value(self, key: str, positions: NDArray[np.floating]) -> Array:
        """Return the true value at (n, 2) positions; beyond the grid, that of its edge."""
        low = [self.north[0], self.east[0]]
        high = [self.north[-1], self.east[-1]]
        return np.asarray(self._interpolators[key](np.clip(positions, low, high)))

    @cached_property
    def _interpolators(self) -> dict[str, RegularGridInterpolator]:
        grid = (self.north, self.east)
        return {key: RegularGridInterpolator(grid, field) for key, field in self.fields.items()}


def free_water(
    bounds: tuple[float, float, float, float], seed: int, quantities: Quantities = LIMNOLOGICAL
) -> Water:
    """Draw independent fields over `bounds` (north0, east0, north1, east1) [m].

    There is one for each quantity with statistics of a lake.
    """
    north, east = _grid(bounds)
    extent = max(north[-1] - north[0], east[-1] - east[0])
    rng = np.random.default_rng(seed)
    import gstools as gs

    fields: dict[str, Array] = {}
    noise: dict[str, float] = {}
    for key, quantity in quantities.items():
        lake = quantity.lake
        if lake is None:
            continue
        variance = lake.structured_share * lake.sd**2
        # 95 % of the correlation of GSTools' Matern-3/2 of length l is gone at 3.87 l.
        model = gs.Matern(dim=2, var=variance, len_scale=lake.range_share * extent / 3.87, nu=1.5)
        field = gs.SRF(model, mean=lake.mean, seed=int(rng.integers(2**31)))
        fields[key] = np.asarray(field.structured([north, east]))
        noise[key] = float(np.sqrt((1 - lake.structured_share) * lake.sd**2))
    return Water(north=north, east=east, fields=fields, noise_sd=noise)


def conditioned_water(
    bounds: tuple[float, float, float, float],
    positions: Array,
    values: Mapping[str, Array],
    seed: int,
) -> Water:
    """Draw fields that go through the samples of a real track, one for each of its quantities.

    `positions` (n, 2) [m], `values` (n,) with NaN for gaps. The samples are thinned evenly
    in space. Their variogram gives the covariance, its nugget the noise.
    """
    north, east = _grid(bounds)
    rng = np.random.default_rng(seed)
    fields: dict[str, Array] = {}
    noise: dict[str, float] = {}
    for key, column in values.items():
        known = np.isfinite(column)
        if known.sum() < FEWEST_CONDITIONS:
            continue
        at = positions[known]
        chosen = _thinned(at, MOST_CONDITIONS)
        model = _fitted_model(at[chosen], column[known][chosen])
        fields[key], noise[key] = _conditional_field(
            model, at[chosen], column[known][chosen], (north, east), int(rng.integers(2**31))
        )
    return Water(north=north, east=east, fields=fields, noise_sd=noise)


def _grid(bounds: tuple[float, float, float, float]) -> tuple[Array, Array]:
    north0, east0, north1, east1 = bounds
    return (
        np.linspace(north0, north1, NODES_PER_SIDE),
        np.linspace(east0, east1, NODES_PER_SIDE),
    )


def _thinned(positions: Array, most: int) -> NDArray[np.int64]:
    """Choose at most `most` points, each the farthest from those chosen before."""
    if len(positions) <= most:
        return np.arange(len(positions))
    chosen = [0]
    gap = np.hypot(*(positions - positions[0]).T)
    while len(chosen) < most and gap.max() > 0:
        chosen.append(int(np.argmax(gap)))
        gap = np.minimum(gap, np.hypot(*(positions - positions[chosen[-1]]).T))
    return np.array(chosen)


def _fitted_model(positions: Array, values: Array) -> Any:
    import gstools as gs

    extent = float(np.hypot(*np.ptp(positions, axis=0)))
    bins = np.linspace(0, extent / 3, 16)
    centres, gamma = gs.vario_estimate(positions.T, values, bins)
    model = gs.Exponential(dim=2)
    model.set_arg_bounds(len_scale=[extent / 1000, extent])
    model.fit_variogram(centres, gamma, nugget=True)
    return model


def _conditional_field(
    model: Any,
    positions: Array,
    values: Array,
    grid: tuple[Array, Array],
    seed: int,
) -> tuple[Array, float]:
    """A field through the values; the nugget becomes noise instead of part of the field."""
    import gstools as gs

    sill = float(model.var + model.nugget)
    noise_variance = float(np.clip(model.nugget, 1e-6 * sill, 0.5 * sill))
    smooth: Any = gs.Exponential(
        dim=2, var=max(sill - noise_variance, 1e-12), len_scale=model.len_scale
    )
    mean = float(np.mean(values))
    free = gs.SRF(smooth, mean=0.0, seed=seed)
    north, east = np.meshgrid(*grid, indexing="ij")
    on_grid = np.asarray(free.structured(grid))
    at_samples = np.asarray(free(positions.T, seed=seed))
    noise = np.random.default_rng(seed).normal(0.0, np.sqrt(noise_variance), len(values))
    between = smooth.covariance(cdist(positions, positions))
    weights = np.linalg.solve(
        between + noise_variance * np.eye(len(values)), values - mean - at_samples - noise
    )
    nodes = np.column_stack([north.ravel(), east.ravel()])
    correction = smooth.covariance(cdist(nodes, positions)) @ weights
    return mean + on_grid + correction.reshape(north.shape), float(np.sqrt(noise_variance))
