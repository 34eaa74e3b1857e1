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
    """One quantity over a series of n surveys: the `first` map; the `times_s` (n,) [unix s] of the
    surveys; and the `means` and `sds` (n, m) at the m nodes in the water. `mean_p` is the
    probability of the mean's trend, adjusted for the number of quantities.
    """

    first: QuantityMap
    times_s: Array
    means: Array
    sds: Array
    trend: Trend
    mean_p: float
