"""The limnological map F: Omega -> R^5 (remark 11), one quantity at a time."""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np
import shapely

from grebe.errors import InputError
from grebe.mapping.kriging import krige
from grebe.mapping.validation import Validation, validate
from grebe.mapping.variogram import VariogramFit, fit_variogram
from grebe.quantities import QUANTITIES, Quantity
from grebe.survey import Flag

if TYPE_CHECKING:
    from numpy.typing import NDArray

    Array = NDArray[np.floating]

FEWEST_SAMPLES = 10
# Nodes inside the lake when no resolution is asked for: fine enough to print.
DEFAULT_NODES = 10_000
MOST_NODES = 4_000_000


@dataclass(frozen=True, kw_only=True)
class Grid:
    """A regular grid over the water: `north` (rows,), `east` (columns,) [m], ascending, and
    `inside` (rows, columns), true where a node lies in the water.
    """

    north: Array
    east: Array
    inside: NDArray[np.bool_]

    @property
    def nodes(self) -> Array:
        """The nodes in the water, (m, 2)."""
        north, east = np.meshgrid(self.north, self.east, indexing="ij")
        return np.column_stack([north[self.inside], east[self.inside]])

    def spread(self, values: Array) -> Array:
        """Put (m,) values at the nodes in the water; NaN elsewhere."""
        field = np.full(self.inside.shape, np.nan)
        field[self.inside] = values
        return field


@dataclass(frozen=True, kw_only=True)
class QuantityMap:
    """The map of one quantity: `mean` and `sd` of the signal, (rows, columns), NaN on land;
    how it was made and what it is worth.
    """

    quantity: Quantity
    grid: Grid
    mean: Array
    sd: Array
    fit: VariogramFit
    validation: Validation | None
    samples: int
    flagged: int


def make_grid(water: shapely.Polygon, resolution_m: float | None = None) -> Grid:
    """Lay a grid over the water; by default about `DEFAULT_NODES` nodes are in it."""
    if resolution_m is None:
        resolution_m = math.sqrt(water.area / DEFAULT_NODES)
    if not (math.isfinite(resolution_m) and resolution_m > 0):
        raise InputError(f"A map resolution of {resolution_m} m is none; give metres.")
    north0, east0, north1, east1 = water.bounds
    rows = int((north1 - north0) / resolution_m) + 1
    columns = int((east1 - east0) / resolution_m) + 1
    if rows * columns > MOST_NODES:
        raise InputError(
            f"A map at {resolution_m:g} m has {rows * columns:,} nodes, more than "
            f"{MOST_NODES:,}; choose a coarser resolution."
        )
    # Nodes are centres of grid cells, so the grid is centred on the bounds.
    north = (north0 + north1) / 2 + resolution_m * (np.arange(rows) - (rows - 1) / 2)
    east = (east0 + east1) / 2 + resolution_m * (np.arange(columns) - (columns - 1) / 2)
    inside = shapely.contains_xy(water, *np.meshgrid(north, east, indexing="ij"))
    if not inside.any():
        raise InputError(
            f"A map at {resolution_m:g} m has no node in the water; choose a finer resolution."
        )
    return Grid(north=north, east=east, inside=inside)


def map_quantity(
    quantity: Quantity, grid: Grid, positions: Array, values: Array, flags: NDArray[np.int64]
) -> QuantityMap:
    """Map one quantity from its samples; those flagged suspect or failed stay out of it.

    Raises `InputError` when fewer than `FEWEST_SAMPLES` good samples are left.
    """
    present = np.isfinite(values)
    good = present & np.isin(flags, Flag.USABLE)
    if good.sum() < FEWEST_SAMPLES:
        raise InputError(
            f"{quantity.label}: {int(good.sum())} good samples; a map needs {FEWEST_SAMPLES}."
        )
    at, data = positions[good], values[good]
    try:
        fit = fit_variogram(at, data)
    except ValueError as error:
        raise InputError(f"{quantity.label}: {error}.") from None
    estimate = krige(at, data, grid.nodes, fit.model)
    return QuantityMap(
        quantity=quantity,
        grid=grid,
        mean=grid.spread(estimate.mean),
        sd=grid.spread(estimate.sd),
        fit=fit,
        validation=validate(at, data, fit.model),
        samples=int(good.sum()),
        flagged=int((present & ~good).sum()),
    )


def map_all(
    grid: Grid,
    positions: Array,
    values: Mapping[str, Array],
    flags: Mapping[str, NDArray[np.int64]],
) -> tuple[list[QuantityMap], list[str]]:
    """Map every quantity that can be mapped; return the maps and why others are left out."""
    maps: list[QuantityMap] = []
    left_out: list[str] = []
    for quantity in QUANTITIES:
        if not np.isfinite(values[quantity.key]).any():
            left_out.append(f"{quantity.label}: not measured")
            continue
        try:
            maps.append(
                map_quantity(quantity, grid, positions, values[quantity.key], flags[quantity.key])
            )
        except InputError as error:
            left_out.append(str(error).rstrip("."))
    return maps, left_out
