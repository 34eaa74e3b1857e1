"""Where the water varies more than elsewhere: at a front, at the edge of a plume.

A map's covariance is the same everywhere, and so is its variance between readings of a given
spacing. The readings show where that variance is too small: pairs a few metres apart differ more
there than pairs at the same distance elsewhere.
"""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np
from scipy.spatial import KDTree

if TYPE_CHECKING:
    from numpy.typing import NDArray

    Array = NDArray[np.floating]

BINS = 4
# The prior at a place weighs as much as this many pairs there; the variation is at most this factor
# from the mean.
PRIOR_PAIRS, MOST = 3.0, 8.0
# More readings than this are thinned before they are paired.
MOST_READINGS = 3_000


def local_variation(
    places: Array, positions: Array, values: Array, reach_m: float, width_m: float
) -> Array:
    """How much the water varies at places (m, 2), as a factor (m,) of the variance, whose mean over
    the readings is about 1.

    Readings at `positions` (n, 2) are compared within `reach_m`, and the results are averaged
    with a Gaussian kernel of `width_m`.
    """
    step = max(1, len(positions) // MOST_READINGS)
    at, read = positions[::step], values[::step]
    pairs = KDTree(at).query_pairs(reach_m, output_type="ndarray")
    if len(pairs) == 0:
        return np.ones(len(places))
    first, second = pairs.T
    apart = np.hypot(*(at[first] - at[second]).T)
    squares = (read[first] - read[second]) ** 2
    bins = np.minimum((BINS * apart / reach_m).astype(int), BINS - 1)
    usual = np.bincount(bins, squares, BINS) / np.maximum(np.bincount(bins, minlength=BINS), 1)
    ratio = squares / np.maximum(usual[bins], 1e-300)
    middle = 0.5 * (at[first] + at[second])
    # Pairs that share a reading say much the same, so together they count as one.
    each = 1.0 / np.bincount(first, minlength=len(at))[first]
    told, weight = np.full(len(places), PRIOR_PAIRS), np.full(len(places), PRIOR_PAIRS)
    near = KDTree(places).query_ball_point(middle, 3 * width_m)
    for k, ids in enumerate(near):
        away = np.sum((places[ids] - middle[k]) ** 2, axis=1)
        share = each[k] * np.exp(-0.5 * away / width_m**2)
        told[ids] += share * ratio[k]
        weight[ids] += share
    return np.clip(told / weight, 1 / MOST, MOST)
