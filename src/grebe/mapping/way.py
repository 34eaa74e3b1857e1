"""The boat's path through its readings: how far places are from it, and when it passed them."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np
import shapely

from grebe.mapping.memo import remembered

if TYPE_CHECKING:
    from numpy.typing import NDArray

    Array = NDArray[np.floating]

# A place farther than this from the path is not on it [m]: about the error of a receiver.
REACH_M = 3.0
# Between readings farther apart than this, the boat's path is unknown [m]. It is a little more than
# the longest stretch that is left out to validate a map.
LONGEST_LEG_M = 40.0
# Nor is it known across longer times between readings [s].
LONGEST_GAP_S = 20.0
# No more places than this are the samples of a fold; a map has more nodes.
FEW_PLACES = 1_000


def half_cell_m(step_m: float) -> float:
    """How far from a node of a map, whose nodes are `step_m` apart, its cell reaches, up to
    `REACH_M`. A node stands for its cell, so a node is on the path if the path crosses its cell.
    """
    return min(step_m / np.sqrt(2.0), REACH_M)


def blocks_of(positions: Array, side_m: float) -> NDArray[np.int64]:
    """The number, from 0, of the square block of water that contains each position (n, 2)."""
    corners = np.floor(positions / side_m).astype(np.int64)
    _, blocks = np.unique(corners, axis=0, return_inverse=True)
    return np.asarray(blocks, dtype=np.int64).ravel()


def off_the_way(way: Array, places: Array) -> Array:
    """Distance [m] of places (m, 2) from the line through the samples (n, 2) in their order, which
    is broken where consecutive samples are too far apart.
    """
    return _nearest_leg(way, _leg_ends(way), places)[1]


def passed(way: Array, times: Array, places: Array) -> tuple[Array, Array]:
    """When (m,) a boat that was at places `way` (n, 2) at `times` (n,) came nearest to other
    places (m, 2), and how far it was (m,) [m] from each.
    """
    order = np.argsort(times, kind="stable")
    way, times = way[order], times[order]
    ends, until = _leg_ends(way), np.append(times[1:], times[-1])
    leg, away = _nearest_leg(way, ends, places)
    along = ends[leg] - way[leg]
    length = np.maximum(np.sum(along**2, axis=1), 1e-12)
    share = np.clip(np.sum((places - way[leg]) * along, axis=1) / length, 0.0, 1.0)
    return times[leg] + share * (until[leg] - times[leg]), away


def earlier(times: Array, positions: Array, seconds: float) -> Array:
    """Where the boat was `seconds` before each of its readings, (n, 2). If that is unknown, across
    a gap or before the first reading, the reading keeps its place.
    """
    order = np.argsort(times, kind="stable")
    when, way = times[order], positions[order]
    asked = when - seconds
    after = np.clip(np.searchsorted(when, asked), 1, len(when) - 1)
    known = (asked >= when[0]) & (when[after] - when[after - 1] <= LONGEST_GAP_S)
    moved = np.column_stack([np.interp(asked, when, column) for column in way.T])
    out = np.empty_like(positions, dtype=float)
    out[order] = np.where(known[:, None], moved, way)
    return out


def _leg_ends(way: Array) -> Array:
    """Where the leg from each of the places (n, 2) ends: at the next one, or where it began if the
    next one is too far away or there is none.
    """
    ends = np.vstack([way[1:], way[-1:]])
    apart = np.hypot(*(ends - way).T) > LONGEST_LEG_M
    ends[apart] = way[apart]
    return ends


def _nearest_leg(way: Array, ends: Array, places: Array) -> tuple[NDArray[np.int64], Array]:
    """Which leg (m,) is nearest to each place, and how far away it is [m].

    All quantities of a survey, and both halves of a map, query the same nodes beside the same path.
    In between, each quantity queries the few samples of every fold. These have a cache of their
    own, so that they do not push out the nodes.
    """
    asked = _nearest_to_few if len(places) <= FEW_PLACES else _nearest_to_many
    return asked(way, ends, places)


def _legs_queried(way: Array, ends: Array, places: Array) -> tuple[NDArray[np.int64], Array]:
    legs = np.asarray(shapely.linestrings(np.stack([way, ends], axis=1)))
    (_, leg), away = shapely.STRtree(legs).query_nearest(
        shapely.points(places), return_distance=True, all_matches=False
    )
    return np.asarray(leg), np.asarray(away)


_nearest_to_few = remembered(32)(_legs_queried)
_nearest_to_many = remembered(4)(_legs_queried)
