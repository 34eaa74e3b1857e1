"""Lower bounds of the length of any route, which show how far a plan can be from the optimum."""

from __future__ import annotations

import math
from typing import TYPE_CHECKING

import numpy as np
import shapely

from grebe.core.kernels import machine_code
from grebe.planning.cells.mesh import Cell
from grebe.planning.paths.graph import Links, spanning_forest

if TYPE_CHECKING:
    from numpy.typing import NDArray

# The ascent looks at all pairs of cells, which takes seconds if there are more cells than this.
MOST_FOR_ASCENT = 2_500
# Most rounds of the ascent, and most pairs that all rounds together may look at.
ROUNDS, PAIRS = 400, 100_000_000
# Distances, in cells, over which the centres of most lakes' cells are connected.
REACHES = (1.25, 2.0)


def lower_bound_m(
    cells: list[Cell], shape: str, cell_m: float, around: Links | None = None
) -> float:
    """Return a lower bound [m] of the length of any path through all cells' centres.

    It is the largest of three bounds. Every path through the centres is a spanning tree, so the
    Euclidean minimum spanning tree is a bound. Up to `MOST_FOR_ASCENT` cells, that tree under the
    best prices on the cells is a better one (Held and Karp 1971). For whole squares there is the
    parity bound: squares alternate in colour like a chessboard's, and a path that changes colour at
    each step visits equally many of both colours, or one more of one. An excess of delta therefore
    forces delta - 1 diagonal steps. Leaving out the other cells makes no path longer.

    `around` holds paths around land that are longer than straight ones
    (`grebe.planning.paths.detours`); only the ascent uses them.
    """
    if len(cells) < 2:
        return 0.0
    footprints = np.array([cell.footprint for cell in cells], dtype=object)
    points = shapely.get_coordinates(shapely.centroid(footprints))
    if len(points) <= MOST_FOR_ASCENT:
        rounds = min(ROUNDS, PAIRS // len(points) ** 2)
        lengths = np.hypot(*np.moveaxis(points[:, None] - points[None], -1, 0))
        if around is not None:
            lengths = np.maximum(lengths, around.dense())
        tree = float(_priced_tree(lengths, cell_m, rounds))
    else:
        tree = _spanning_tree_m(points, cell_m)
    return max(tree, _parity_m(cells, cell_m) if shape == "square" else 0.0)


def _parity_m(cells: list[Cell], cell_m: float) -> float:
    colours = [(cell.row + cell.column) % 2 for cell in cells if cell.whole]
    if len(colours) < 2:
        return 0.0
    excess = abs(2 * sum(colours) - len(colours))
    return cell_m * (len(colours) - 1 + (math.sqrt(2) - 1) * max(excess - 1, 0))


def _spanning_tree_m(points: np.ndarray, cell_m: float) -> float:
    """Length of the minimum spanning tree [m]. If the pairs up to some distance connect all points,
    they contain all of its edges; Delaunay's triangles always do.
    """
    from scipy.spatial import KDTree

    lookup = KDTree(points)
    for reach in REACHES:
        low, high = lookup.query_pairs(reach * cell_m, output_type="ndarray").T
        edges = _tree_of(points, low, high)
        if len(edges) == len(points) - 1:
            return float(edges.sum())
    return _delaunay_tree_m(points)


def _tree_of(
    points: np.ndarray, low: NDArray[np.int64], high: NDArray[np.int64]
) -> NDArray[np.float64]:
    """The lengths of the edges of the minimum spanning tree, or forest, of some pairs of points."""
    lengths = np.hypot(*(points[low] - points[high]).T)
    return lengths[spanning_forest(low, high, lengths, len(points))]


def _delaunay_tree_m(points: np.ndarray) -> float:
    from scipy.spatial import Delaunay, QhullError

    try:
        triangles = Delaunay(points).simplices
    except (QhullError, ValueError):
        # All on a line: the tree is the line.
        return float(np.hypot(*np.ptp(points, axis=0)))
    first, second = np.vstack([triangles[:, [0, 1]], triangles[:, [1, 2]], triangles[:, [2, 0]]]).T
    low, high = np.minimum(first, second), np.maximum(first, second)
    codes = np.unique(low.astype(np.int64) * len(points) + high)
    return float(_tree_of(points, *np.divmod(codes, len(points))).sum())


@machine_code
def _tree(
    lengths: NDArray[np.float64], price: NDArray[np.float64], degree: NDArray[np.float64]
) -> float:
    """Length of the minimum spanning tree under prices (Prim); writes the cells' degrees."""
    n = lengths.shape[0]
    nearest = np.full(n, np.inf)
    parent = np.full(n, -1)
    degree[:] = 0
    length, at = 0.0, 0
    nearest[0] = -np.inf
    for _ in range(n - 1):
        best, following = np.inf, -1
        for j in range(n):
            if nearest[j] == -np.inf:
                continue
            priced = lengths[at, j] + price[at] + price[j]
            if priced < nearest[j]:
                nearest[j] = priced
                parent[j] = at
            if nearest[j] < best:
                best, following = nearest[j], j
        degree[parent[following]] += 1
        degree[following] += 1
        length += best
        nearest[following] = -np.inf
        at = following
    return length


@machine_code
def _priced_tree(lengths: NDArray[np.float64], pitch: float, rounds: int) -> float:
    """Raise the tree's length by prices on the cells: the Held-Karp bound of an open path.

    With an extra stop at no distance from any cell, a path becomes a tour, and a tree with that
    stop's two links a 1-tree. A price p on a cell makes each of its links dearer by p and every
    tour by 2 p, so the cost of the tree less twice the sum of all prices is a bound for any prices.
    The prices of cells with many links are raised, those of leaves lowered (Volgenant and Jonker
    1982).
    """
    n = lengths.shape[0]
    price, degree, before = np.zeros(n), np.zeros(n), np.zeros(n)
    best, step = 0.0, 0.1 * pitch
    for k in range(rounds):
        length = _tree(lengths, price, degree)
        first, second = _two_least(price)
        degree[first] += 1
        degree[second] += 1
        # Summed by hand: machine code that contains NumPy's sum loads SciPy's linear algebra too.
        prices = 0.0
        for i in range(n):
            prices += price[i]
        bound = length + price[first] + price[second] - 2 * prices
        best = max(best, bound)
        size = step * (1 - k / rounds) ** 2
        for i in range(n):
            price[i] += size * (0.7 * (degree[i] - 2) + 0.3 * (before[i] - 2) * min(k, 1))
            before[i] = degree[i]
    return best


@machine_code
def _two_least(values: NDArray[np.float64]) -> tuple[int, int]:
    """Indices of the two smallest values."""
    first, second = (0, 1) if values[0] <= values[1] else (1, 0)
    for i in range(2, values.shape[0]):
        if values[i] < values[first]:
            first, second = i, first
        elif values[i] < values[second]:
            second = i
    return first, second
