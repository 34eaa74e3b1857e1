"""First orders of the cells: sweeps in lanes, a tour around a spanning tree, and a greedy walk.

Each visits every cell once (remark 12). `grebe.planning.route.portfolio` polishes them and takes
the fastest.
"""

from __future__ import annotations

import itertools
from collections.abc import Callable
from typing import TYPE_CHECKING

import numpy as np

from grebe.core.kernels import machine_code
from grebe.planning.cells.mesh import Cell
from grebe.planning.paths.graph import spanning_forest
from grebe.planning.paths.network import Network

if TYPE_CHECKING:
    from numpy.typing import NDArray

    Order = NDArray[np.int64]


def sweeps(cells: list[Cell], network: Network, start: tuple[float, float]) -> list[Order]:
    """Return sweeps in lanes along rows and along columns, each cut into runs of linked cells. A
    sweep goes on from each run to the nearest end of another (boustrophedon with decomposition).
    """
    return [
        _chained(_runs(cells, network, by_column=by_column), network, start)
        for by_column in (False, True)
    ]


def _runs(cells: list[Cell], network: Network, *, by_column: bool) -> list[list[int]]:
    places = np.array([(cell.row, cell.column) for cell in cells])
    lane, along = places.T[::-1] if by_column else places.T
    members = np.lexsort([along, lane])
    members = members[[not cells[i].is_speck for i in members]]
    before, now = members[:-1], members[1:]
    follows = network.opens(before, now) & (lane[before] == lane[now])
    return [run.tolist() for run in np.split(members, np.flatnonzero(~follows) + 1)]


def _chained(runs: list[list[int]], network: Network, start: tuple[float, float]) -> Order:
    """Join runs end to end, nearest first."""
    ends = np.array([(run[0], run[-1]) for run in runs])
    places = network.centres[ends]
    free = np.ones(len(runs), dtype=bool)
    here = np.asarray(start)
    order: list[int] = []
    for _ in runs:
        away = np.hypot(*np.moveaxis(places - here, -1, 0))
        away[~free] = np.inf
        k, side = divmod(int(np.argmin(away)), 2)
        order += runs[k] if side == 0 else runs[k][::-1]
        free[k] = False
        here = places[k, 1 - side]
    return np.array(order, dtype=np.int64)


def greedy(cells: list[Cell], network: Network, start: tuple[float, float]) -> Order:
    """Return a walk over open links, each time to the nearest unvisited neighbour, with a slight
    preference for few onward links. From a dead end it goes on to the cell the fewest links away.
    """
    specks = np.array([cell.is_speck for cell in cells])
    away = np.hypot(*(network.centres - start).T)
    first = int(np.argmin(np.where(specks, np.inf, away)))
    order = np.empty(int(np.sum(~specks)), dtype=np.int64)
    _walk(
        network.centres, network.starts, network.neighbours, network.is_open, first, specks, order
    )
    return order


@machine_code
def _walk(
    centres: NDArray[np.float64],
    starts: NDArray[np.integer],
    neighbours: NDArray[np.integer],
    is_open: NDArray[np.bool_],
    first: int,
    specks: NDArray[np.bool_],
    order: NDArray[np.int64],
) -> None:
    n = centres.shape[0]
    seen = specks.copy()
    mark = np.full(n, -1)
    wave = np.empty(n, dtype=np.int64)
    here = first
    for step in range(order.shape[0]):
        order[step] = here
        seen[here] = True
        best, best_score = -1, np.inf
        for s in range(starts[here], starts[here + 1]):
            c = neighbours[s]
            if seen[c] or not is_open[s]:
                continue
            exits = 0
            for t in range(starts[c], starts[c + 1]):
                exits += is_open[t] and not seen[neighbours[t]]
            away = np.hypot(centres[c, 0] - centres[here, 0], centres[c, 1] - centres[here, 1])
            score = away * (1.0 + 0.02 * exits)
            if score < best_score:
                best, best_score = c, score
        if best < 0 and step + 1 < order.shape[0]:
            head, count = 0, 1
            wave[0] = here
            mark[here] = step
            while head < count and best < 0:
                b = wave[head]
                head += 1
                for t in range(starts[b], starts[b + 1]):
                    c = neighbours[t]
                    if mark[c] == step:
                        continue
                    mark[c] = step
                    if not seen[c]:
                        best = c
                        break
                    wave[count] = c
                    count += 1
        here = best


def spanning_tree_tour(
    cells: list[Cell], network: Network, start: tuple[float, float]
) -> Order | None:
    """Return a tour around spanning trees of the 2 x 2 blocks of whole squares (Gabriely and Rimon
    2001), or None if there is no block. Cells outside the blocks are swept in runs; tours and runs
    are joined end to end.
    """
    places = {(cell.row, cell.column): i for i, cell in enumerate(cells) if cell.whole}
    tours = [_around_tree(group, places) for group in _block_groups(places)]
    if not tours:
        return None
    circled = {i for tour in tours for i in tour}
    rest = [
        run
        for lane in _runs(cells, network, by_column=False)
        for outside, run in _split(lane, circled)
        if outside
    ]
    return _chained([*map(_opened(network, start), tours), *rest], network, start)


def _split(lane: list[int], circled: set[int]) -> list[tuple[bool, list[int]]]:
    return [
        (outside, list(run)) for outside, run in itertools.groupby(lane, lambda i: i not in circled)
    ]


def _opened(network: Network, start: tuple[float, float]) -> Callable[[list[int]], list[int]]:
    """Open a closed tour at the cell nearest to the start."""

    def opened(tour: list[int]) -> list[int]:
        k = int(np.argmin(np.hypot(*(network.centres[tour] - start).T)))
        return tour[k:] + tour[:k]

    return opened


Block = tuple[int, int]


def _block_groups(places: dict[Block, int]) -> list[set[Block]]:
    """Blocks of four whole squares whose corners have even rows and columns, in groups connected by
    shared sides.
    """
    corners = {(row - row % 2, column - column % 2) for row, column in places}
    left = {
        (r, c)
        for r, c in corners
        if all((r + i, c + j) in places for i, j in itertools.product((0, 1), repeat=2))
    }
    groups: list[set[Block]] = []
    while left:
        group, edge = set[Block](), [left.pop()]
        while edge:
            r, c = edge.pop()
            group.add((r, c))
            near = {(r + 2, c), (r - 2, c), (r, c + 2), (r, c - 2)} & left
            left -= near
            edge += near
        groups.append(group)
    return groups


def _around_tree(blocks: set[Block], places: dict[Block, int]) -> list[int]:
    """The closed tour around a spanning tree of a group of blocks."""
    listed = sorted(blocks)
    index = {block: i for i, block in enumerate(listed)}
    # Edges along the rows are cheaper, which gives the tour long straight runs.
    edges = [
        (index[b], index[n], weight)
        for b in listed
        for n, weight in (((b[0], b[1] + 2), 1.0), ((b[0] + 2, b[1]), 2.0))
        if n in index
    ]
    linked: set[tuple[Block, Block]] = set()
    if edges:
        # Sorted by their ends, because the first of several edges of equal cost is taken.
        a, b, weight = np.array(sorted(edges)).T
        kept = spanning_forest(a, b, weight, len(listed))
        pairs = zip(a[kept].astype(int).tolist(), b[kept].astype(int).tolist(), strict=True)
        linked = {(listed[i], listed[j]) for i, j in pairs}
        linked |= {(j, i) for i, j in linked}
    following = {place: _next_square(place, linked) for place in _squares_of(listed)}
    begin = next(iter(following))
    tour, place = [places[begin]], following[begin]
    while place != begin:
        tour.append(places[place])
        place = following[place]
    return tour


def _squares_of(blocks: list[Block]) -> list[Block]:
    return [(r + i, c + j) for r, c in blocks for i, j in itertools.product((0, 1), repeat=2)]


def _next_square(place: Block, linked: set[tuple[Block, Block]]) -> Block:
    """The next square when the tree is circled with it on the right-hand side."""
    row, column = place
    block = (row - row % 2, column - column % 2)
    # Each quarter of a block has an exit across one side, and otherwise a step within the block.
    out, within = {
        (0, 0): ((row, column - 1), (row + 1, column)),
        (1, 0): ((row + 1, column), (row, column + 1)),
        (1, 1): ((row, column + 1), (row - 1, column)),
        (0, 1): ((row - 1, column), (row, column - 1)),
    }[(row % 2, column % 2)]
    beyond = (out[0] - out[0] % 2, out[1] - out[1] % 2)
    return out if (block, beyond) in linked else within
