"""Paths between places all over the water: their lengths, and the places that they pass."""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property
from typing import TYPE_CHECKING

import numpy as np
import shapely
from scipy.sparse import coo_array
from scipy.sparse.csgraph import dijkstra
from scipy.spatial import KDTree

if TYPE_CHECKING:
    from numpy.typing import NDArray

    Array = NDArray[np.floating]

# Places of a grid within this many pitches of each other are linked: neighbours beside and across.
LINKED = 1.5
# Paths over such links are at most 1.082 times as long as straight ones; a longer path leads around
# land.
AROUND_LAND = 1.09


@dataclass(frozen=True, kw_only=True)
class PlacePaths:
    """`lengths_m` (m, m) of the paths between `places` (m, 2), which are `pitch_m` apart; `before`
    (m, m) is the place before the second on the path over links from the first.
    """

    places: Array
    pitch_m: float
    lengths_m: Array
    before: NDArray[np.int64]

    def along(self, first: int, last: int) -> list[int]:
        """The places that the path between two places passes, both ends included."""
        corners = [last]
        straight = float(np.hypot(*(self.places[last] - self.places[first])))
        if self.lengths_m[first, last] > straight + 1e-9:
            while corners[-1] != first and self.before[first, corners[-1]] >= 0:
                corners.append(int(self.before[first, corners[-1]]))
            return corners
        count = max(1, int(np.ceil(2 * straight / self.pitch_m)))
        shares = np.linspace(0.0, 1.0, count + 1)[:, None]
        points = self.places[first] + shares * (self.places[last] - self.places[first])
        met: list[int] = np.asarray(self._tree.query(points)[1]).tolist()
        return list(dict.fromkeys(met))

    def passed(self, path: Array) -> list[int]:
        """The places that a path (n, 2) of straight legs passes."""
        points = shapely.get_coordinates(
            shapely.segmentize(shapely.linestrings(path), 0.5 * self.pitch_m)
        )
        met: list[int] = np.asarray(self._tree.query(points)[1]).tolist()
        return list(dict.fromkeys(met))

    @cached_property
    def _tree(self) -> KDTree:
        return KDTree(self.places)


def place_paths(places: Array, pitch_m: float, water: shapely.Polygon) -> PlacePaths:
    """Measure the paths through the water between places of a grid; infinite if there is none."""
    pairs = KDTree(places).query_pairs(LINKED * pitch_m, output_type="ndarray")
    shapely.prepare(water)
    inside = shapely.covers(water, shapely.linestrings(places[pairs]))
    first, second = pairs[inside].T
    link_m = np.hypot(*(places[second] - places[first]).T)
    shape = (len(places), len(places))
    links = coo_array((link_m, (first, second)), shape=shape).tocsr()
    lengths, before = dijkstra(links, directed=False, return_predecessors=True)
    straight = np.hypot(*(places[:, None, :] - places[None, :, :]).transpose(2, 0, 1))
    lengths = np.where(lengths <= AROUND_LAND * straight, straight, lengths)
    return PlacePaths(places=places, pitch_m=pitch_m, lengths_m=lengths, before=before)
