"""Lower bounds of the length of any route: how far from the best possible a plan can be."""

from __future__ import annotations

import math

import numpy as np
from scipy.sparse import coo_array
from scipy.sparse.csgraph import minimum_spanning_tree
from scipy.spatial import Delaunay, QhullError

from grebe.planning.mesh import Cell


def lower_bound_m(cells: list[Cell], shape: str, cell_m: float) -> float:
    """Return a length [m] below which no path through all cells' centres can be.

    The larger of two: the Euclidean minimum spanning tree of the centres, which every path
    through them contains; and for whole squares the parity bound: squares alternate in colour
    like a chessboard's, a path that changes colour at each step visits as many of one as of the
    other but for one, so an excess of delta forces delta - 1 diagonal steps. Leaving the other
    cells out makes no path longer.
    """
    if len(cells) < 2:
        return 0.0
    points = np.array([(c.x, c.y) for c in (cell.footprint.centroid for cell in cells)])
    return max(_spanning_tree_m(points), _parity_m(cells, cell_m) if shape == "square" else 0.0)


def _parity_m(cells: list[Cell], cell_m: float) -> float:
    colours = [(cell.row + cell.column) % 2 for cell in cells if cell.whole]
    if len(colours) < 2:
        return 0.0
    excess = abs(2 * sum(colours) - len(colours))
    return cell_m * (len(colours) - 1 + (math.sqrt(2) - 1) * max(excess - 1, 0))


def _spanning_tree_m(points: np.ndarray) -> float:
    """Length of the minimum spanning tree; its edges are among Delaunay's."""
    n = len(points)
    try:
        triangles = Delaunay(points).simplices
    except (QhullError, ValueError):
        # All on a line: the tree is the line.
        return float(np.hypot(*np.ptp(points, axis=0)))
    first, second = np.vstack([triangles[:, [0, 1]], triangles[:, [1, 2]], triangles[:, [2, 0]]]).T
    low, high = np.minimum(first, second), np.maximum(first, second)
    edges = np.unique(np.column_stack([low, high]), axis=0)
    length = np.hypot(*(points[edges[:, 0]] - points[edges[:, 1]]).T)
    # Equal centres would make an edge of length zero, which a sparse matrix takes for none.
    graph = coo_array((np.maximum(length, 1e-12), (edges[:, 0], edges[:, 1])), shape=(n, n))
    return float(minimum_spanning_tree(graph.tocsr()).sum())
