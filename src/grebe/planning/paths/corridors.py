"""The path between consecutive targets: transits around land, and a corridor to stay in.

If the convex hull of two consecutive targets is water, the boat may go straight from one to the
other. If not, transit targets are inserted along the shortest path over linked cells, pulled
tight; at a link that is not open, a gate leads across the cells' shared edge. Each leg has a
corridor, to which the controller keeps: a convex polygon of water that contains both its targets,
as large as the shore allows.
"""

from __future__ import annotations

import itertools
from collections.abc import Sequence
from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np
import shapely

from grebe.core.errors import PlanError
from grebe.planning.cells.mesh import Cell
from grebe.planning.paths.graph import shortest_paths
from grebe.planning.paths.land_cut import without_land
from grebe.planning.paths.network import ROUNDING_M, Network, joint_hulls

if TYPE_CHECKING:
    from numpy.typing import NDArray

# How far a corridor may reach beyond the hull of its targets, in cells.
REACH_CELLS = 2.0
# A gate's first size: a share of the shared edge along it, and a share of the cell size across it.
GATE_ALONG, GATE_ACROSS = 0.8, 0.2
GATE_HALVINGS = 12
# At the edge of a wedge a shorter gate can fit where a long one cannot.
GATE_SHARES = (1.0, 0.5, 0.2)
# Depths to either side of the edge that are tried for a single gate across it [m].
GATE_DEPTHS_M = (1.0, 0.6, 0.3)
_CORNERS = ((-1, -1), (1, -1), (1, 1), (-1, 1))
CLOSED_FACTOR = 1.3
# How far a transit may grow beyond its cell or gate [m].
TRANSIT_REACH_M = 0.75


@dataclass(frozen=True, kw_only=True)
class Stop:
    """A footprint on the path; `cell` is the index of its cell, None for a transit."""

    footprint: shapely.Polygon
    cell: int | None


class PathFinder:
    """Finds paths between the cells of a mesh."""

    def __init__(
        self, cells: list[Cell], network: Network, water: shapely.Polygon, cell_m: float
    ) -> None:
        self._cells, self._network, self._cell_m = cells, network, cell_m
        self._allowed = water.buffer(ROUNDING_M, join_style="mitre")
        shapely.prepare(self._allowed)
        self._water = water
        # A gate must be hit, so a somewhat longer path over open links is better.
        dearer = np.where(network.is_open, 1.0, CLOSED_FACTOR)
        self._links = network.links(network.lengths_m * dearer)

    def stops(self, order: NDArray[np.int64]) -> list[Stop]:
        """Return the cells in their order with the transits between them."""
        footprints = np.array([cell.footprint for cell in self._cells], dtype=object)[order]
        # Known for cells that an open link joins; the others are tested.
        straight = self._network.opens(order[:-1], order[1:])
        ask = np.flatnonzero(~straight)
        straight[ask] = self.straight(footprints[ask], footprints[ask + 1])
        stops = [Stop(footprint=footprints[0], cell=int(order[0]))]
        for k, is_straight in enumerate(straight.tolist()):
            if not is_straight:
                stops += self.around(int(order[k]), int(order[k + 1]))
            stops.append(Stop(footprint=footprints[k + 1], cell=int(order[k + 1])))
        return stops

    def straight(self, a: NDArray[np.object_], b: NDArray[np.object_]) -> NDArray[np.bool_]:
        """Whether the hull of each pair of footprints is water."""
        return np.asarray(shapely.covers(self._allowed, joint_hulls(a, b)))

    def around(self, a: int, b: int) -> list[Stop]:
        """Transits from cell a to cell b, whose joint hull is not water."""
        chain = self._chain(a, b)
        return [Stop(footprint=one, cell=None) for one in self._pulled(chain)[1:-1]]

    def _chain(self, a: int, b: int) -> list[shapely.Polygon]:
        """Footprints along the shortest path over links, gates among them."""
        before = shortest_paths(self._links, a, b)
        path = [b]
        while path[-1] != a:
            step = int(before[path[-1]])
            if step < 0:
                raise PlanError(f"Cells {a} and {b} are not joined by water; the plan is invalid.")
            path.append(step)
        path.reverse()
        chain = [self._cells[a].footprint]
        is_open = self._network.opens(np.array(path[:-1]), np.array(path[1:]))
        for (i, j), goes_straight in zip(itertools.pairwise(path), is_open.tolist(), strict=True):
            if not goes_straight:
                chain += self._gate(i, j)
            chain.append(self._cells[j].footprint)
        return chain

    def _pulled(self, chain: list[shapely.Polygon]) -> list[shapely.Polygon]:
        """Skip footprints: go from each one straight to the farthest that allows it."""
        kept = [chain[0]]
        here = 0
        while here < len(chain) - 1:
            ahead = np.array(chain[here + 1 :], dtype=object)
            same = np.full(len(ahead), chain[here], dtype=object)
            reached = np.flatnonzero(self.straight(same, ahead))
            here += 1 + (int(reached[-1]) if len(reached) else 0)
            kept.append(chain[here])
        return kept

    def _gate(self, i: int, j: int) -> list[shapely.Polygon]:
        """One rectangle across the cells' shared edge if it can be joined to both, else two flat
        ones, one on either side of it.

        The flat ones fit cells of any shape: the path from a cell to its own rectangle stays in
        that cell, and the path from one rectangle to the other leads straight across the edge.
        """
        a, b = self._cells[i].footprint, self._cells[j].footprint
        ends = shapely.get_coordinates(shapely.intersection(a, b, grid_size=ROUNDING_M))
        p, q = ends[0], ends[-1]
        middle, half = 0.5 * (p + q), 0.5 * GATE_ALONG * (q - p)
        across = np.array([-half[1], half[0]]) / float(np.hypot(*half))
        for depth in GATE_DEPTHS_M:
            gate = shapely.Polygon([middle + s * half + t * depth * across for s, t in _CORNERS])
            if self.straight(
                np.array([gate] * 2, dtype=object), np.array([a, b], dtype=object)
            ).all():
                return [gate]
        if across @ (np.array(a.centroid.coords[0]) - middle) < 0:
            across = -across
        return [
            self._flat(a, middle, half, across),
            self._flat(b, middle, half, -across),
        ]

    def _flat(
        self,
        cell: shapely.Polygon,
        middle: NDArray[np.float64],
        half: NDArray[np.float64],
        inwards: NDArray[np.float64],
    ) -> shapely.Polygon:
        """A rectangle along an edge, as deep into the cell as the cell allows."""
        room = cell.buffer(ROUNDING_M, join_style="mitre")
        base = middle + 2 * ROUNDING_M * inwards
        for share, halving in itertools.product(GATE_SHARES, range(GATE_HALVINGS)):
            side = share * half
            far = base + GATE_ACROSS * self._cell_m * 0.5**halving * inwards
            rectangle = shapely.Polygon([base - side, base + side, far + side, far - side])
            if shapely.covers(room, rectangle):
                return rectangle
        raise PlanError(
            f"Near {middle[0]:.1f} m north, {middle[1]:.1f} m east a cell is too narrow for a "
            "boat; choose smaller cells or a larger shore margin."
        )

    def corridors(self, footprints: list[shapely.Polygon]) -> list[shapely.Polygon]:
        """Return one convex polygon of water for each leg between consecutive footprints."""
        return corridors_between(footprints, self._water, REACH_CELLS * self._cell_m)


def corridors_between(
    footprints: Sequence[shapely.Polygon], water: shapely.Polygon, reach_m: float
) -> list[shapely.Polygon]:
    """Return one convex polygon of water for each leg between consecutive footprints, up to
    `reach_m` beyond their hull.
    """
    shapes = np.array(footprints, dtype=object)
    return corridors_of(shapes[:-1], shapes[1:], water, reach_m)


def corridors_of(
    begins: NDArray[np.object_], ends: NDArray[np.object_], water: shapely.Polygon, reach_m: float
) -> list[shapely.Polygon]:
    """Return one convex polygon of water for each leg between two footprints, pair by pair."""
    hulls = joint_hulls(begins, ends)
    x0, y0, x1, y1 = shapely.bounds(hulls).T
    boxes = shapely.box(x0 - reach_m, y0 - reach_m, x1 + reach_m, y1 + reach_m)
    return without_land(hulls, boxes, water).tolist()


def widened(stops: list[Stop], corridors: list[shapely.Polygon]) -> list[Stop]:
    """Let each transit grow within the intersection of the corridors before and behind it.

    A gate can be a hand's breadth deep, and a boat whose position is known ten times a second could
    pass it unnoticed. Both corridors are convex and contain the gate, and so does their
    intersection; the legs to it and from it stay within them.
    """
    grown = list(stops)
    for k, stop in enumerate(stops):
        if stop.cell is not None or k + 1 >= len(corridors):
            continue
        near = stop.footprint.buffer(TRANSIT_REACH_M, join_style="mitre")
        common = shapely.intersection_all([near, corridors[k], corridors[k + 1]])
        if isinstance(common, shapely.Polygon) and common.area > stop.footprint.area:
            grown[k] = Stop(footprint=common, cell=None)
    return grown
