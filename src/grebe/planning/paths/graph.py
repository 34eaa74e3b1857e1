"""Graphs of links between numbered places: shortest paths, connected parts and spanning trees.

SciPy has all of these, but its import takes longer than they take in a plan of a thousand cells.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING, Any

import numpy as np

from grebe.core.kernels import machine_code

if TYPE_CHECKING:
    from numpy.typing import NDArray

    Indices = NDArray[np.int64]
    Floats = NDArray[np.float64]


@dataclass(frozen=True, kw_only=True)
class Links:
    """Links in compressed rows.

    Those of place i lead to `neighbours[starts[i]:starts[i + 1]]`, in ascending order; `values`
    has one value per link, in the same order.
    """

    starts: Indices
    neighbours: Indices
    values: NDArray[Any]

    def __len__(self) -> int:
        return len(self.starts) - 1

    @property
    def first(self) -> Indices:
        """The place from which each link leads."""
        return np.repeat(np.arange(len(self)), np.diff(self.starts))

    def of(self, i: Indices, j: Indices) -> NDArray[Any]:
        """The values of the links from i to j, pair by pair; zero where there is none."""
        found = np.zeros(np.shape(i), dtype=self.values.dtype)
        if not len(self.values):
            return found
        codes = self.first * len(self) + self.neighbours
        wanted = np.asarray(i, dtype=np.int64) * len(self) + j
        place = np.minimum(np.searchsorted(codes, wanted), len(codes) - 1)
        there = codes[place] == wanted
        found[there] = self.values[place[there]]
        return found

    def among(self, kept: Indices) -> Links:
        """The links among some places, which are renumbered in the given order."""
        number = np.full(len(self), -1)
        number[kept] = np.arange(len(kept))
        first, second = number[self.first], number[self.neighbours]
        stay = (first >= 0) & (second >= 0)
        return links_of(first[stay], second[stay], self.values[stay], len(kept))

    def dense(self) -> Floats:
        """All values as a matrix, zero where there is no link."""
        matrix = np.zeros((len(self), len(self)))
        matrix[self.first, self.neighbours] = self.values
        return matrix


def links_of(first: Indices, second: Indices, values: NDArray[Any], count: int) -> Links:
    """Return links between `count` places in compressed rows; of several values for the same link
    the largest counts.
    """
    order = np.lexsort([-values, second, first])
    first, second, values = first[order], second[order], values[order]
    again = (np.diff(first, prepend=-1) == 0) & (np.diff(second, prepend=-1) == 0)
    first, second, values = first[~again], second[~again], values[~again]
    starts = np.searchsorted(first, np.arange(count + 1))
    return Links(starts=starts, neighbours=second.astype(np.int64), values=values)


def shortest_paths(links: Links, begin: int, end: int) -> Indices:
    """Return the place before each on the shortest paths from `begin`, or -1 if there is none. The
    search ends when the path to `end` is known.
    """
    count = len(links)
    away, before = np.full(count, np.inf), np.full(count, -1)
    _spread(*_rows(links), begin, end, np.inf, away, before)
    return before


def distances(links: Links, begins: Indices, farthest: float) -> Floats:
    """Return the distances from each of `begins` to every place, infinite beyond `farthest`."""
    return _distances(*_rows(links), begins.astype(np.int64), farthest)


def _rows(links: Links) -> tuple[Indices, Indices, Floats]:
    return (
        links.starts.astype(np.int64),
        links.neighbours.astype(np.int64),
        links.values.astype(np.float64),
    )


@machine_code
def _distances(
    starts: Indices, neighbours: Indices, values: Floats, begins: Indices, farthest: float
) -> Floats:
    count = len(starts) - 1
    found = np.full((len(begins), count), np.inf)
    before = np.full(count, -1)
    for k in range(len(begins)):
        _spread(starts, neighbours, values, begins[k], -1, farthest, found[k], before)
        for i in range(count):
            if found[k, i] > farthest:
                found[k, i] = np.inf
    return found


@machine_code
def _spread(
    starts: Indices,
    neighbours: Indices,
    values: Floats,
    begin: int,
    end: int,
    farthest: float,
    away: Floats,
    before: Indices,
) -> None:
    """Write the distance of each place from `begin` to `away`, infinite at first, and the place
    before it to `before` (Dijkstra), up to the place `end` or the distance `farthest`.
    """
    heap, keys = np.empty(len(values) + 1, dtype=np.int64), np.empty(len(values) + 1)
    size = 1
    heap[0], keys[0], away[begin] = begin, 0.0, 0.0
    while size > 0:
        here, so_far = heap[0], keys[0]
        size -= 1
        _sink(heap, keys, size)
        if here == end or so_far > farthest:
            break
        if so_far > away[here]:
            continue
        for s in range(starts[here], starts[here + 1]):
            there, far = neighbours[s], so_far + values[s]
            if far < away[there]:
                away[there], before[there] = far, here
                _rise(heap, keys, size, there, far)
                size += 1


@machine_code
def _rise(heap: Indices, keys: Floats, size: int, place: int, key: float) -> None:
    """Insert a place into a heap of `size` places."""
    k = size
    while k > 0 and keys[(k - 1) // 2] > key:
        heap[k], keys[k] = heap[(k - 1) // 2], keys[(k - 1) // 2]
        k = (k - 1) // 2
    heap[k], keys[k] = place, key


@machine_code
def _sink(heap: Indices, keys: Floats, size: int) -> None:
    """Replace the first place of a heap by its last, which is at `size`."""
    place, key, k = heap[size], keys[size], 0
    while 2 * k + 1 < size:
        child = 2 * k + 1
        if child + 1 < size and keys[child + 1] < keys[child]:
            child += 1
        if keys[child] >= key:
            break
        heap[k], keys[k] = heap[child], keys[child]
        k = child
    heap[k], keys[k] = place, key


def parts_of(links: Links) -> tuple[int, Indices]:
    """Return the number of connected parts, and the part of each place. Links must lead in both
    directions.
    """
    part = _parts(links.starts.astype(np.int64), links.neighbours.astype(np.int64))
    return int(part.max(initial=-1)) + 1, part


@machine_code
def _parts(starts: Indices, neighbours: Indices) -> Indices:
    count = len(starts) - 1
    part, wave = np.full(count, -1), np.empty(count, dtype=np.int64)
    parts = 0
    for i in range(count):
        if part[i] >= 0:
            continue
        wave[0], part[i], head, tail = i, parts, 0, 1
        while head < tail:
            here = wave[head]
            head += 1
            for s in range(starts[here], starts[here + 1]):
                there = neighbours[s]
                if part[there] < 0:
                    part[there] = parts
                    wave[tail] = there
                    tail += 1
        parts += 1
    return part


def spanning_forest(
    first: Indices, second: Indices, values: Floats, count: int
) -> NDArray[np.bool_]:
    """Return which edges between `count` places form the minimum spanning forest; of edges of equal
    value the first are taken.
    """
    by_value = np.argsort(values, kind="stable")
    return _forest(first.astype(np.int64), second.astype(np.int64), by_value, count)


@machine_code
def _forest(first: Indices, second: Indices, by_value: Indices, count: int) -> NDArray[np.bool_]:
    """Kruskal's algorithm; `above` holds a place above each in its tree."""
    above = np.arange(count)
    kept = np.zeros(len(first), dtype=np.bool_)
    for k in by_value:
        a, b = first[k], second[k]
        while above[a] != a:
            above[a] = above[above[a]]
            a = above[a]
        while above[b] != b:
            above[b] = above[above[b]]
            b = above[b]
        if a != b:
            above[a] = b
            kept[k] = True
    return kept
