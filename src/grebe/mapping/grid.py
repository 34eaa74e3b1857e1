"""The regular grid over the water on which maps are made."""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np
import shapely

from grebe.core.errors import InputError

if TYPE_CHECKING:
    from numpy.typing import NDArray

    Array = NDArray[np.floating]

# Nodes inside the lake if no resolution is given: fine enough to print.
DEFAULT_NODES = 10_000
MOST_NODES = 4_000_000


@dataclass(frozen=True, kw_only=True)
class Grid:
    """A regular grid over the water: `north` (rows,) and `east` (columns,) [m], ascending;
    `inside` (rows, columns), true where a node is in the water; `step_m`, the spacing of nodes.
    """

    north: Array
    east: Array
    inside: NDArray[np.bool_]
    step_m: float

    @property
    def nodes(self) -> Array:
        """The nodes in the water, (m, 2)."""
        north, east = np.meshgrid(self.north, self.east, indexing="ij")
        return np.column_stack([north[self.inside], east[self.inside]])

    def spread(self, values: Array) -> Array:
        """Put values (m,) at the nodes in the water, and NaN elsewhere."""
        field = np.full(self.inside.shape, np.nan)
        field[self.inside] = values
        return field


def make_grid(water: shapely.Polygon, resolution_m: float | None = None) -> Grid:
    """Lay a grid over the water; by default, about `DEFAULT_NODES` of its nodes are in it."""
    if resolution_m is None:
        resolution_m = math.sqrt(water.area / DEFAULT_NODES)
    if not (math.isfinite(resolution_m) and resolution_m > 0):
        raise InputError(
            f"A map resolution of {resolution_m} m is impossible; give a positive number of metres."
        )
    north0, east0, north1, east1 = water.bounds
    rows = int((north1 - north0) / resolution_m) + 1
    columns = int((east1 - east0) / resolution_m) + 1
    if min(rows, columns) < 2:
        raise InputError(
            f"A map at {resolution_m:g} m has only {rows} x {columns} nodes; choose a finer "
            "resolution."
        )
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
    return Grid(north=north, east=east, inside=inside, step_m=resolution_m)
