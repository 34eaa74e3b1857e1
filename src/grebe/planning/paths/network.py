"""Which cells a boat can go between: neighbours whose joint convex hull is water.

A boat can always pass between two convex cells that share an edge. If their joint hull leaves the
water, because the shore bends there, the path leads through a gate at the shared edge, which
`grebe.planning.paths.corridors` builds; such a link is not *open*. Where the shore cuts cells
small, cells that do not touch are linked too if their joint hull is water.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING, Any

import numpy as np
import shapely

from grebe.planning.cells.mesh import Cell
from grebe.planning.paths.detours import PASSAGE_M, paths_around
from grebe.planning.paths.graph import Links, parts_of

if TYPE_CHECKING:
    from numpy.typing import NDArray
    from scipy.sparse import csr_array

    Indices = NDArray[np.int64]

# Rounding may put a hull this far outside the water that it touches [m].
ROUNDING_M = 1e-6
# Cells that the shore cuts are linked to all cells in plain sight within this many cell sizes.
SIGHT_CELLS = 1.0
# Where a path may cross a shared edge, as shares of its length.
CROSSINGS = np.array([0.1, 0.3, 0.5, 0.7, 0.9])


@dataclass(frozen=True, kw_only=True)
class Network:
    """Links between cells in compressed rows.

    The links of cell i lead to `neighbours[starts[i]:starts[i + 1]]`; `is_open` and `lengths_m`,
    the length of the path between the two centres, are in the same order. `centres` (n, 2) are the
    cells' centroids [m], `pitch_m` their typical distance. `around` holds the lengths of the
    shortest paths from cells near the shore to those around them.
    """

    centres: NDArray[np.float64]
    starts: Indices
    neighbours: Indices
    is_open: NDArray[np.bool_]
    lengths_m: NDArray[np.float64]
    around: Links
    pitch_m: float

    def __len__(self) -> int:
        return len(self.centres)

    def matrix(self) -> csr_array:
        """The links as a sparse matrix of path lengths."""
        from scipy.sparse import csr_array

        shape = (len(self), len(self))
        return csr_array((self.lengths_m.copy(), self.neighbours, self.starts), shape=shape)

    def opens(self, i: Indices, j: Indices) -> NDArray[np.bool_]:
        """Whether cells i and j are joined by an open link, pair by pair."""
        return self.links(self.is_open).of(i, j)

    def links(self, values: NDArray[Any]) -> Links:
        """The links with `values`, one per link."""
        return Links(starts=self.starts, neighbours=self.neighbours, values=values)


def connect(cells: list[Cell], water: shapely.Polygon, cell_m: float) -> Network:
    """Link the cells of a mesh of `water`."""
    shapes = np.array([cell.footprint for cell in cells], dtype=object)
    centroids = shapely.centroid(shapes)
    centres = np.column_stack([shapely.get_x(centroids), shapely.get_y(centroids)])
    first, second = _touching(shapes)
    is_open = _open(shapes, first, second, water, cell_m)
    lengths_m = np.hypot(*(centres[first] - centres[second]).T)
    lengths_m[~is_open] = _through_edges(shapes, centres, first[~is_open], second[~is_open])
    cut = np.array([not cell.whole for cell in cells])
    apart = _in_sight(shapes, ~cut, water, cell_m)
    first, second = np.append(first, apart[0]), np.append(second, apart[1])
    is_open = np.append(is_open, np.ones(len(apart[0]), dtype=bool))
    lengths_m = np.append(lengths_m, np.hypot(*(centres[apart[0]] - centres[apart[1]]).T))
    keep = np.isfinite(lengths_m)
    links = np.column_stack([first[keep], second[keep]])
    links = np.concatenate([links, links[:, ::-1]])
    rank = np.lexsort(links.T[::-1])
    return Network(
        centres=centres,
        starts=np.searchsorted(links[rank, 0], np.arange(len(cells) + 1)),
        neighbours=links[rank, 1],
        is_open=np.tile(is_open[keep], 2)[rank],
        lengths_m=np.tile(lengths_m[keep], 2)[rank],
        around=paths_around(centres, cut, water, cell_m),
        pitch_m=cell_m,
    )


def _touching(shapes: NDArray[np.object_]) -> tuple[Indices, Indices]:
    first, second = shapely.STRtree(shapes).query(shapes, predicate="dwithin", distance=ROUNDING_M)
    once = first < second
    return first[once], second[once]


def _in_sight(
    shapes: NDArray[np.object_], whole: NDArray[np.bool_], water: shapely.Polygon, cell_m: float
) -> tuple[Indices, Indices]:
    """Pairs that do not touch, have a cut cell among them, and whose joint hull is water."""
    cut = np.flatnonzero(~whole)
    places, second = shapely.STRtree(shapes).query(
        shapes[cut], predicate="dwithin", distance=SIGHT_CELLS * cell_m
    )
    first = cut[places]
    once = (first < second) | whole[second]
    first, second = first[once], second[once]
    apart = shapely.distance(shapes[first], shapes[second]) > ROUNDING_M
    first, second = first[apart], second[apart]
    clear = _open(shapes, first, second, water, cell_m)
    return first[clear], second[clear]


def reachable(network: Network, cells: list[Cell], near: tuple[float, float]) -> list[Cell]:
    """Return the cells of the connected part with the most water; of equal parts the one nearest to
    `near`.
    """
    count, part = parts_of(network.links(network.lengths_m))
    if count == 1:
        return cells
    areas = np.bincount(part, weights=[cell.footprint.area for cell in cells])
    away = np.hypot(*(network.centres - near).T)
    nearest = [away[part == p].min() for p in range(count)]
    best = min(range(count), key=lambda p: (-round(float(areas[p]), 3), nearest[p]))
    return [cell for cell, p in zip(cells, part, strict=True) if p == best]


def _open(
    shapes: NDArray[np.object_],
    first: Indices,
    second: Indices,
    water: shapely.Polygon,
    cell_m: float,
) -> NDArray[np.bool_]:
    """Whether each pair's joint hull is water; far from the shore this need not be computed."""
    deep_water = water.buffer(-4 * cell_m)
    shapely.prepare(deep_water)
    deep = shapely.intersects(deep_water, shapes)
    is_open = deep[first] & deep[second]
    ask = ~is_open
    hulls = joint_hulls(shapes[first[ask]], shapes[second[ask]])
    allowed = water.buffer(ROUNDING_M, join_style="mitre")
    shapely.prepare(allowed)
    is_open[ask] = shapely.covers(allowed, hulls)
    return is_open


def _through_edges(
    shapes: NDArray[np.object_], centres: NDArray[np.float64], first: Indices, second: Indices
) -> NDArray[np.float64]:
    """Length of the path from centre to centre through each pair's shared edge [m]; infinite if
    the edge is too short for a boat.
    """
    edges = shapely.intersection(shapes[first], shapes[second], grid_size=ROUNDING_M)
    lengths_m = np.full(len(first), np.inf)
    passable = np.flatnonzero(shapely.length(edges) >= PASSAGE_M)
    corners, edge = shapely.get_coordinates(edges[passable], return_index=True)
    begin = corners[np.searchsorted(edge, np.arange(len(passable)))]
    end = corners[np.searchsorted(edge, np.arange(len(passable)), side="right") - 1]
    places = begin + CROSSINGS[:, None, None] * (end - begin)
    legs = np.array([centres[side[passable]] - places for side in (first, second)])
    lengths_m[passable] = np.hypot(legs[..., 0], legs[..., 1]).sum(axis=0).min(axis=0)
    return lengths_m


def joint_hulls(a: NDArray[np.object_], b: NDArray[np.object_]) -> NDArray[np.object_]:
    """Return the convex hull of each pair of footprints."""
    pairs = shapely.geometrycollections(np.stack([a, b], axis=-1))
    return np.asarray(shapely.convex_hull(pairs), dtype=object)
