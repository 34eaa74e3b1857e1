"""A mesh whose cells hang together: a boat can go from each of them to each other."""

from __future__ import annotations

from collections.abc import Sequence

import shapely

from grebe.core.plan_settings import Shape
from grebe.planning.cells.mesh import Cell, mesh_water
from grebe.planning.ways.network import Network, connect, reachable

# No more than this share of the water may hang apart from the rest before the mesh keeps slivers.
LITTLE_WATER = 0.001


def meshed(
    water: shapely.Polygon,
    cell_m: float,
    *,
    shape: Shape,
    angle_deg: float,
    near: tuple[float, float],
) -> tuple[list[Cell], Network]:
    """Return the cells that a boat can go between, those that hang together with the water `near` a
    place, and their links.

    At a bend of narrow water a sliver may reach from bank to bank, and the water is parted where it
    is left out. Then the mesh keeps its slivers; elsewhere it needs none. Raises as `mesh_water`.
    """
    for keeps_slivers in (False, True):
        cells = mesh_water(
            water, cell_m, shape=shape, angle_deg=angle_deg, keeps_slivers=keeps_slivers
        )
        network = connect(cells, water, cell_m)
        kept = reachable(network, cells, near)
        if _area_m2(kept) >= (1 - LITTLE_WATER) * _area_m2(cells):
            break
    return kept, network if len(kept) == len(cells) else connect(kept, water, cell_m)


def _area_m2(cells: Sequence[Cell]) -> float:
    return sum(cell.footprint.area for cell in cells)
