"""Kriging by tiles: neighbouring targets share one window of samples and one factorisation.

On a track sampled every metre, a window of a few dozen samples for each target would end a few
metres away. The targets of a tile together can afford hundreds: the nearest to the tile, with a
share from each octant around it, so that one long line does not fill the window.
"""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np
from scipy.spatial import KDTree

from grebe.mapping.memo import remembered

if TYPE_CHECKING:
    from numpy.typing import NDArray

    Array = NDArray[np.floating]
    Indices = NDArray[np.int64]

OCTANTS = 8
# Upper limits for a tile: its targets, and the samples among them as a share of the window's.
MOST_TARGETS, TILE_SHARE = 600, 1 / 6
# The octants' samples are chosen from this many times the window's samples, nearest the tile.
CANDIDATES = 4


# Most quantities of a survey have the same samples.
@remembered(4)
def tiles(samples: Array, targets: Array, window: int) -> list[tuple[Indices, Indices]]:
    """Return pairs of indices: the targets of a tile, and the samples of its window."""
    tree = KDTree(samples)
    return [
        (members, _window(samples, tree, targets[members], window))
        for members in _split(targets, tree, window)
    ]


def _split(targets: Array, tree: KDTree, window: int) -> list[Indices]:
    """Halve the targets across their longer side until few enough samples are among them."""
    waiting, done = [np.arange(len(targets))], []
    while waiting:
        members = waiting.pop()
        low, high = targets[members].min(axis=0), targets[members].max(axis=0)
        radius = 0.5 * float(np.max(high - low))
        among = tree.query_ball_point(
            0.5 * (low + high), radius, p=np.inf, return_length=True
        ) if radius > 0 else 0  # fmt: skip
        if len(members) <= MOST_TARGETS and among <= TILE_SHARE * window:
            done.append(members)
            continue
        axis = int(np.argmax(high - low))
        rank = members[np.argsort(targets[members, axis], kind="stable")]
        waiting += [rank[: len(rank) // 2], rank[len(rank) // 2 :]]
    return done


def _window(samples: Array, tree: KDTree, targets: Array, window: int) -> Indices:
    """The nearest samples of each octant around a tile; octants with few leave room for others."""
    low, high = targets.min(axis=0), targets.max(axis=0)
    centre = 0.5 * (low + high)
    _, near = tree.query(centre, k=min(CANDIDATES * window, len(samples)))
    near = np.atleast_1d(np.asarray(near))
    if len(near) <= window:
        return near
    outside = np.maximum(np.maximum(low - samples[near], samples[near] - high), 0)
    away = np.hypot(*outside.T)
    way = samples[near] - centre
    octant = ((np.arctan2(way[:, 1], way[:, 0]) / np.pi + 1) * (OCTANTS / 2)).astype(int) % OCTANTS
    # Taking samples by their rank within the octant takes from all octants alike.
    order = np.lexsort((away, octant))
    first = np.searchsorted(octant[order], np.arange(OCTANTS))
    rank = np.empty(len(near), dtype=np.int64)
    rank[order] = np.arange(len(near)) - first[octant[order]]
    return near[np.lexsort((away, np.where(away > 0, rank, 0)))[:window]]
