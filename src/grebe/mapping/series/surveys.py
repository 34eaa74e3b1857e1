"""One quantity over a series of surveys of the same water."""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING

from grebe.mapping.quantity_map import QuantityMap
from grebe.mapping.series.trend import Trend

if TYPE_CHECKING:
    import numpy as np
    from numpy.typing import NDArray

    Array = NDArray[np.floating]


@dataclass(frozen=True, kw_only=True)
class QuantitySeries:
    """One quantity over a series: `first` map, and of each of its n surveys the mean and the
    standard deviation at the m nodes in the water, (n, m), and the `times_s` (n,) [unix s].
    `mean_p` is the probability of the mean's trend adjusted for the number of quantities.
    """

    first: QuantityMap
    times_s: Array
    means: Array
    sds: Array
    trend: Trend
    mean_p: float
