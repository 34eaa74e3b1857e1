"""The boat's way through its readings: how far places lie beside it, and when it passed them."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np
import shapely

if TYPE_CHECKING:
    from numpy.typing import NDArray

    Array = NDArray[np.floating]

# A place this far from the way is no longer on it [m]: the error of a receiver, about.
REACH_M = 3.0


def off_the_way(way: Array, places: Array) -> Array:
    """Distance [m] of places (m, 2) from the line through the samples (n, 2) in their order."""
    return _nearest_leg(way, places)[1]


def passed(way: Array, times: Array, places: Array) -> tuple[Array, Array]:
    """When (m,) a boat that was at its places `way` (n, 2) at `times` (n,) came nearest to other
    places (m, 2), and how far (m,) [m] from each.
    """
    order = np.argsort(times, kind="stable")
    way, times = way[order], times[order]
    leg, away = _nearest_leg(way, places)
    along = way[leg + 1] - way[leg]
    length = np.maximum(np.sum(along**2, axis=1), 1e-12)
    share = np.clip(np.sum((places - way[leg]) * along, axis=1) / length, 0.0, 1.0)
    return times[leg] + share * (times[leg + 1] - times[leg]), away


def _nearest_leg(way: Array, places: Array) -> tuple[NDArray[np.int64], Array]:
    legs = np.asarray(shapely.linestrings(np.stack([way[:-1], way[1:]], axis=1)))
    (_, leg), away = shapely.STRtree(legs).query_nearest(
        shapely.points(places), return_distance=True, all_matches=False
    )
    return np.asarray(leg), np.asarray(away)
