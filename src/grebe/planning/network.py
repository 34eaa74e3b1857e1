"""Which cells a boat can go between: neighbours whose joint convex hull is water.

Two convex cells that share an edge can always be passed between. Where their joint hull
leaves the water - the shore bends there - the way leads through a gate at the shared edge,
which `grebe.planning.corridors` builds; such a link is not *open*.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np
import shapely
from scipy.sparse import coo_array, csr_array
from scipy.sparse.csgraph import connected_components

from grebe.planning.mesh import Cell

if TYPE_CHECKING:
    from numpy.typing import NDArray

    Indices = NDArray[np.int64]

# What rounding may put a hull outside the water that it touches [m].
ROUNDING_M = 1e-6
# What two neighbours must share for a boat to pass between them [m].
PASSAGE_M = 0.4


@dataclass(frozen=True, kw_only=True)
class Network:
    """Links between cells in compressed rows: those of cell i are
    `neighbours[starts[i]:starts[i + 1]]`, with `is_open` beside them.

    `centres` (n, 2) are the cells' centroids [m], `pitch_m` their typical distance.
    """

    centres: NDArray[np.float64]
    starts: Indices
    neighbours: Indices
    is_open: NDArray[np.bool_]
    pitch_m: float

    def __len__(self) -> int:
        return len(self.centres)

    def lengths(self) -> NDArray[np.float64]:
        """Distance of the centres of each link [m]."""
        first = np.repeat(np.arange(len(self)), np.diff(self.starts))
        return np.hypot(*(self.centres[self.neighbours] - self.centres[first]).T)

    def matrix(self) -> csr_array:
        """The links as a sparse matrix of their lengths."""
        shape = (len(self), len(self))
        return csr_array((self.lengths(), self.neighbours, self.starts), shape=shape)

    def opens(self, i: int, j: int) -> bool:
        """Whether cells i and j are joined by an open link."""
        row = slice(self.starts[i], self.starts[i + 1])
        return bool(np.any(self.is_open[row] & (self.neighbours[row] == j)))


def connect(cells: list[Cell], water: shapely.Polygon, cell_m: float) -> Network:
    """Link the cells of a mesh of `water`."""
    shapes = np.array([cell.footprint for cell in cells], dtype=object)
    first, second = shapely.STRtree(shapes).query(shapes, predicate="dwithin", distance=ROUNDING_M)
    once = first < second
    first, second = first[once], second[once]
    is_open = _open(shapes, first, second, water, cell_m)
    keep = is_open.copy()
    keep[~is_open] = _passable(shapes, first[~is_open], second[~is_open])
    first, second, is_open = first[keep], second[keep], is_open[keep]
    n = len(cells)
    both = coo_array(
        (
            np.tile(is_open, 2) + 1,
            (np.concatenate([first, second]), np.concatenate([second, first])),
        ),
        shape=(n, n),
    ).tocsr()
    centroids = shapely.centroid(shapes)
    return Network(
        centres=np.column_stack([shapely.get_x(centroids), shapely.get_y(centroids)]),
        starts=both.indptr.astype(np.int64),
        neighbours=both.indices.astype(np.int64),
        is_open=both.data > 1,
        pitch_m=cell_m,
    )


def reachable(network: Network, cells: list[Cell], near: tuple[float, float]) -> list[Cell]:
    """Return the cells that hang together with the largest share of the water.

    Of parts of equal size the one nearest to `near` counts.
    """
    count, part = connected_components(network.matrix(), directed=False)
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
    """Whether each pair's joint hull is water; far from the shore it need not be computed."""
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


def _passable(shapes: NDArray[np.object_], first: Indices, second: Indices) -> NDArray[np.bool_]:
    edges = shapely.intersection(shapes[first], shapes[second], grid_size=ROUNDING_M)
    return np.asarray(shapely.length(edges) >= PASSAGE_M)


def joint_hulls(a: NDArray[np.object_], b: NDArray[np.object_]) -> NDArray[np.object_]:
    """Return the convex hull of each pair of footprints."""
    pairs = shapely.geometrycollections(np.stack([a, b], axis=-1))
    return np.asarray(shapely.convex_hull(pairs), dtype=object)
