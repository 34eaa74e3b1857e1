"""Maps of one quantity at several times of a survey: a movie of the water.

In the models of `grebe.mapping.change` and `grebe.mapping.methods.passes`, the water is a field of
place plus what all places share at a time. So a movie is made from one map: the field of place is
solved once, and each time adds a level and an uncertainty of its own.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np

from grebe.core.errors import InputError
from grebe.mapping.methods.base import field_at_moments
from grebe.mapping.quantity_map import QuantityMap, known_sd, possible, sd_with
from grebe.mapping.threads import one_blas_thread

if TYPE_CHECKING:
    from numpy.typing import NDArray

    Array = NDArray[np.floating]

FEWEST_MOMENTS, MOST_MOMENTS = 2, 200


@dataclass(frozen=True, kw_only=True)
class Movie:
    """The maps of one quantity at k times, `times_s` (k,) [unix s]: `means` and `sds` of the
    water, (k, rows, columns), NaN on land. `still` is the map that they are made from.
    """

    still: QuantityMap
    times_s: Array
    means: Array
    sds: Array


def moments_of(times: Array, every_s: float) -> Array:
    """The times (k,) [unix s] of a movie, starting with the first of the samples' `times` (n,).

    Raises `InputError` if there would be too few or too many.
    """
    if not (np.isfinite(every_s) and every_s > 0):
        raise InputError(
            f"The interval between a movie's maps must be above 0 minutes, not {every_s / 60:g}.",
            settings=("every_s",),
        )
    first, last = float(times.min()), float(times.max())
    count = int((last - first) / every_s + 1e-9) + 1
    if not FEWEST_MOMENTS <= count <= MOST_MOMENTS:
        raise InputError(
            f"One map every {every_s / 60:g} minutes makes {count} of a survey of "
            f"{(last - first) / 60:.0f} minutes; a movie takes {FEWEST_MOMENTS} to "
            f"{MOST_MOMENTS}.",
            settings=("every_s",),
        )
    return first + every_s * np.arange(count)


def shows_change(one: QuantityMap) -> bool:
    """Whether the samples show how a quantity changed; without that, a movie does not move."""
    return one.is_of_moment and one.change.is_significant


def movie_of(still: QuantityMap, moments_s: Array) -> Movie:
    """Make the maps at given times (k,) [unix s] from the field of a map of one time."""
    grid, readings, scale = still.grid, still.readings, still.scale
    nodes = grid.nodes
    with one_blas_thread():
        found = field_at_moments(still.field, nodes, moments_s)
    means: list[Array] = []
    sds: list[Array] = []
    for moment_s, (of_place, field_sd) in zip(moments_s.tolist(), found, strict=True):
        since = still.change.at(np.array([moment_s]))[0]
        mean, read = of_place + since, scale.back(readings.values + since)
        sd = sd_with(field_sd, still.calibration, still.micro_sd, nodes)
        sd = np.hypot(sd, still.change.seen_from(moment_s).sd_near(readings, nodes))
        level = scale.mean(mean, known_sd(sd, readings))
        means.append(grid.spread(possible(level, still.quantity, read)))
        sds.append(grid.spread(scale.sd(mean, sd)))
    return Movie(still=still, times_s=moments_s, means=np.array(means), sds=np.array(sds))
