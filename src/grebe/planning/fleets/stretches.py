"""Cut an order into stretches of equal time, one for each boat."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from typing import TYPE_CHECKING, TypeVar

import numpy as np

from grebe.core.errors import PlanError

if TYPE_CHECKING:
    from numpy.typing import NDArray

    Order = NDArray[np.int64]
    Array = NDArray[np.float64]

P = TypeVar("P")

# Most rounds in which the ends of the stretches are moved, and the ratio of the longest time to the
# mean at which the search ends.
ROUNDS, ALIKE = 8, 1.005


def check_cells(cells: int, boats: int) -> None:
    """Raise `PlanError` if there are fewer cells than boats that are to share them."""
    if cells < boats:
        raise PlanError(
            f"The water has {cells} cells, too few for {boats} boats to share; give smaller cells "
            "or fewer boats.",
            settings=("cell_m", "boats"),
        )


def shared_evenly(
    order: Order,
    legs_s: Array,
    boats: int,
    parts_of: Callable[[Sequence[Order]], tuple[list[P], list[float]]],
) -> list[P]:
    """Return the parts with the smallest maximum time that was found.

    `legs_s` (n,) are the times of the legs to each cell of the order [s]. `parts_of` makes a part
    of each stretch, and returns the parts and their times [s].
    """
    weights = np.ones(boats)
    best: tuple[float, list[P]] | None = None
    for _ in range(ROUNDS):
        parts, taken_s = parts_of(_cut(order, legs_s, weights))
        times = np.array(taken_s)
        if best is None or times.max() < best[0]:
            best = float(times.max()), parts
        if times.max() < ALIKE * times.mean():
            break
        # A part that takes too long gets less of the order, but not by the full ratio, because its
        # path out changes too.
        weights *= (times.mean() / np.maximum(times, 0.1 * times.mean())) ** 0.7
    assert best is not None
    return best[1]


def _cut(order: Order, legs_s: Array, weights: Array) -> list[Order]:
    """Cut the order into stretches whose legs take times in the ratio of the weights."""
    passed = np.cumsum(legs_s)
    ends = np.searchsorted(passed, passed[-1] * np.cumsum(weights)[:-1] / weights.sum())
    # Each boat gets at least one cell.
    lowest = np.arange(1, len(weights))
    more = np.clip(np.maximum.accumulate(ends - lowest), 0, len(order) - len(weights))
    return np.split(order, lowest + more)
