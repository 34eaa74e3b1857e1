"""Shortest paths around land, between cells near the shore that no link joins.

An order that jumps from one cell to another pays for the path between them. Beside a spit the
straight distance says little about its length, so the length is measured: on a visibility graph
of the cells' centres and the corners of the slightly simplified shore (Lozano-Perez and Wesley
1979).
"""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np
import shapely

from grebe.planning.paths.graph import Links, distances, links_of
from grebe.planning.paths.reflex_vertices import reflex_vertices

if TYPE_CHECKING:
    from numpy.typing import NDArray
    from shapely.geometry.base import BaseGeometry

    Places = NDArray[np.float64]

# The narrowest gap that a boat can pass [m].
PASSAGE_M = 0.4
# The water may be drawn wider than it is by this share of a cell.
COARSENESS = 0.01
# Paths are sought between cells whose centres are less than `REACH_CELLS` cells apart, over lines
# of sight up to the same length; they may be `FARTHEST_CELLS` cells long.
REACH_CELLS, FARTHEST_CELLS = 3.0, 12.0
# With more centres the search takes longer than it saves.
MOST_CENTRES = 4_000


def paths_around(
    centres: Places, near_shore: NDArray[np.bool_], water: shapely.Polygon, cell_m: float
) -> Links:
    """Return lengths [m] of the shortest paths between pairs of cells of which one is near the
    shore, in both directions; none for more than `MOST_CENTRES` cells.
    """
    n = len(centres)
    if n > MOST_CENTRES or not near_shore.any():
        none = np.zeros(0, dtype=np.int64)
        return links_of(none, none, np.zeros(0), n)
    room = _room(water, COARSENESS * cell_m)
    nodes = np.vstack([centres, reflex_vertices(room)])
    begin = np.flatnonzero(near_shore)
    sight = _sight(nodes, room, REACH_CELLS * cell_m)
    lengths = distances(sight, begin, FARTHEST_CELLS * cell_m)[:, :n]
    away = np.hypot(*np.moveaxis(centres[begin, None] - centres[None], -1, 0))
    wanted = np.isfinite(lengths) & (away < REACH_CELLS * cell_m) & (away > 0)
    row, column = np.nonzero(wanted)
    return _both_directions(begin[row], column, lengths[wanted], n)


def _both_directions(
    first: NDArray[np.int64], second: NDArray[np.int64], lengths: Places, count: int
) -> Links:
    """Links in both directions."""
    return links_of(np.append(first, second), np.append(second, first), np.tile(lengths, 2), count)


def _room(water: shapely.Polygon, coarse_m: float) -> BaseGeometry:
    """The water without passages too narrow for a boat, slightly widened and simplified."""
    half = 0.5 * PASSAGE_M
    passable = water.buffer(-half, join_style="mitre").buffer(half + coarse_m, join_style="mitre")
    return passable.simplify(0.9 * coarse_m)


def _sight(nodes: Places, room: BaseGeometry, reach_m: float) -> Links:
    """Lengths of the lines of sight between nodes, up to a reach."""
    points = np.asarray(shapely.points(nodes), dtype=object)
    first, second = shapely.STRtree(points).query(points, predicate="dwithin", distance=reach_m)
    once = first < second
    first, second = first[once], second[once]
    allowed = room.buffer(1e-6)
    shapely.prepare(allowed)
    seen = shapely.covers(allowed, shapely.linestrings(np.stack([nodes[first], nodes[second]], 1)))
    first, second = first[seen], second[seen]
    away = np.maximum(np.hypot(*(nodes[first] - nodes[second]).T), 1e-9)
    return _both_directions(first, second, away, len(nodes))
