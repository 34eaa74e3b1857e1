"""Merge samples that are close together, to keep a system small and not singular."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from grebe.mapping.covariance.models import CovarianceModel, Fleeting

if TYPE_CHECKING:
    from numpy.typing import NDArray

    Array = NDArray[np.floating]

# Up to this many samples, one system is solved and only samples of the same place are merged.
EXACT_LIMIT = 400
# Two samples closer than this in place and time are the same: without a nugget, they would make the
# system singular.
SAME_PLACE_M, SAME_TIME_S = 0.01, 0.01
# Beyond the exact limit, samples within which the signal varies by less than `JOINED_SHARE` of the
# sill and less than `JOINED_NOISE` of the noise are merged; the threshold is at least
# `JOINED_LEAST` of the sill. More are merged while there are still more than `MOST_PLACES`.
JOINED_SHARE, JOINED_NOISE, JOINED_LEAST, MOST_PLACES = 0.01, 1.0, 1e-4, 60_000


def joined(
    positions: Array, columns: Array, model: CovarianceModel, fleeting: Fleeting | None
) -> tuple[Array, Array, Array]:
    """Merge samples to few enough places, as `merge_places` returns them. The last of the
    `columns` is the time; where it matters, samples of different times are not merged.
    """
    merged = merge_places(positions, columns, SAME_PLACE_M, _turns(columns, fleeting, 0.0))
    if len(merged[0]) <= EXACT_LIMIT or model.sill == 0:
        return merged
    sizes = np.geomspace(SAME_PLACE_M, model.range_m, 200)
    lost = 1 - model.covariance(sizes) / model.sill
    share = min(JOINED_SHARE, max(JOINED_NOISE * model.nugget / model.sill, JOINED_LEAST))
    size = float(sizes[max(int(np.searchsorted(lost, share)) - 1, 0)]) * model.ratio
    turns = _turns(columns, fleeting, share * model.sill)
    merged = merge_places(positions, columns, size, turns)
    while len(merged[0]) > MOST_PLACES:
        size *= np.sqrt(2)
        merged = merge_places(positions, columns, size, turns)
    return merged


def _turns(columns: Array, fleeting: Fleeting | None, lost: float) -> NDArray[np.int64] | None:
    """Number the samples (n,) by turns: within a turn, times differ so little that the fleeting
    part varies by a variance of no more than `lost`. None if time does not matter.
    """
    if fleeting is None or fleeting.variance <= lost:
        return None
    times = columns[:, -1]
    length_s = -fleeting.memory_s * np.log1p(-lost / fleeting.variance)
    return np.floor((times - times.min()) / max(float(length_s), SAME_TIME_S)).astype(np.int64)


def distinct(positions: Array, columns: Array) -> NDArray[np.int64]:
    """The rows to keep if some repeat the same reading at the same place: the first of each, in
    order. A reading is repeated when it was recorded for several overlapping sets.
    """
    table = np.column_stack([positions, columns])
    _, once = np.unique(table, axis=0, return_index=True)
    return np.sort(once)


def merge_places(
    positions: Array,
    columns: Array,
    size_m: float = SAME_PLACE_M,
    turns: NDArray[np.int64] | None = None,
) -> tuple[Array, Array, Array]:
    """Average the samples of each place, or of each place and turn if `turns` (n,) is given; return
    the mean positions, the mean `columns` (n,) or (n, p), and the number of samples in each.
    """
    table = np.column_stack([positions, columns])
    cells = np.round((table[:, :2] - table[:, :2].min(axis=0)) / size_m).astype(np.int64)
    key = cells[:, 0] * (cells[:, 1].max() + 1) + cells[:, 1]
    if turns is not None:
        _, key = np.unique(np.column_stack([key, turns]), axis=0, return_inverse=True)
        key = np.asarray(key).ravel()
    _, first, inverse = np.unique(key, return_index=True, return_inverse=True)
    counts = np.bincount(inverse).astype(float)
    if len(first) == len(table):
        means, counts = table[first], np.ones(len(first))
    else:
        sums = [np.bincount(inverse, column) for column in table.T]
        means = np.column_stack(sums) / counts[:, None]
    merged = means[:, 2:]
    return means[:, :2], merged[:, 0] if columns.ndim == 1 else merged, counts
