"""A mesh whose cells are connected: a boat can go from each of them to each other."""

from __future__ import annotations

from collections.abc import Sequence

import shapely

from grebe.core.plan_settings import Shape
from grebe.planning.cells.mesh import Cell, mesh_water
from grebe.planning.paths.network import Network, connect, reachable

# If more than this share of the water is cut off from the rest, the mesh keeps slivers.
LITTLE_WATER = 0.001


def connected_mesh(
    water: shapely.Polygon,
    cell_m: float,
    *,
    shape: Shape,
    angle_deg: float,
    near: tuple[float, float],
) -> tuple[list[Cell], Network]:
    """Return the largest connected part of a mesh, and its links; of equal parts the one nearest to
    `near`.

    At a bend of narrow water a sliver may reach from bank to bank, and leaving it out would divide
    the water. In that case the mesh keeps its slivers; otherwise it does without. Raises
    `PlanError` like `mesh_water`.
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
