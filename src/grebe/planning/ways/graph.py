"""Links between numbered places, the shortest ways over them, and their parts and trees.

SciPy has all of it; its import takes longer than a plan of a thousand cells needs for them.
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
    """Links in compressed rows: those of place i lead to `neighbours[starts[i]:starts[i + 1]]`, in
    ascending order, with their `values` beside them.
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
        """The links among some places, which are numbered anew in the order given."""
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
    """Put links between `count` places in rows; of several from one place to another the largest
    counts.
    """
    order = np.lexsort([-values, second, first])
    first, second, values = first[order], second[order], values[order]
    again = (np.diff(first, prepend=-1) == 0) & (np.diff(second, prepend=-1) == 0)
    first, second, values = first[~again], second[~again], values[~again]
    starts = np.searchsorted(first, np.arange(count + 1))
    return Links(starts=starts, neighbours=second.astype(np.int64), values=values)


def shortest_ways(links: Links, begin: int, end: int) -> Indices:
    """Return the place before each on the shortest ways from one place, until that to another is
    known; -1 where there is none.
    """
    count = len(links)
    away, before = np.full(count, np.inf), np.full(count, -1)
    _spread(*_rows(links), begin, end, np.inf, away, before)
    return before


def distances(links: Links, begins: Indices, farthest: float) -> Floats:
    """Return how far it is from each of some places to every place, infinite beyond `farthest`."""
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
    """Write how far each place is from one, infinite until then, and the place before it
    (Dijkstra), up to a place `end` or a distance.
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
    """Put a place into a heap of so many."""
    k = size
    while k > 0 and keys[(k - 1) // 2] > key:
        heap[k], keys[k] = heap[(k - 1) // 2], keys[(k - 1) // 2]
        k = (k - 1) // 2
    heap[k], keys[k] = place, key


@machine_code
def _sink(heap: Indices, keys: Floats, size: int) -> None:
    """Put the last of a heap, which is at `size`, in the place of its first."""
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
    """Return how many parts hang together, and the number of each place's part; links lead both
    ways.
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
    """Return which of some edges between `count` places are those of the shortest trees that join
    what hangs together; of those that cost the same the first ones.
    """
    by_value = np.argsort(values, kind="stable")
    return _forest(first.astype(np.int64), second.astype(np.int64), by_value, count)


@machine_code
def _forest(first: Indices, second: Indices, by_value: Indices, count: int) -> NDArray[np.bool_]:
    """Kruskal's; each place knows one above it in its tree."""
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
