"""How far apart samples may be for a map of a given accuracy, before anything is measured."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from grebe.core.polyline import passed_m, places_at
from grebe.mapping.covariance.models import PRACTICAL_RANGE, CovarianceModel
from grebe.mapping.fields.kriging import krige

if TYPE_CHECKING:
    from numpy.typing import NDArray

    Array = NDArray[np.floating]

# Samples considered to either side of a place: farther ones are screened off.
SIDE = 4
NARROW, WIDE = 1e-3, 3.0
HALVINGS = 40


def pitch_for_accuracy(practical_range_m: float, sd_share: float) -> float:
    """Return the pitch [m] of a square grid of samples at which the map's standard deviation
    midway between four of them is `sd_share` of the quantity's own.

    The covariance is exponential, of that practical range (at which 95 % of the correlation is
    gone) and without noise. It is rougher than most water, so the pitch is on the safe side.
    """
    if not (0 < sd_share < 1 and practical_range_m > 0):
        raise ValueError("the accuracy must be a share between 0 and 1, and the range positive")
    model = CovarianceModel(
        kind="exponential",
        sill=1.0,
        range_m=practical_range_m / PRACTICAL_RANGE["exponential"],
        nugget=0.0,
    )
    low, high = NARROW * practical_range_m, WIDE * practical_range_m
    for _ in range(HALVINGS):
        pitch = float(np.sqrt(low * high))
        low, high = (pitch, high) if _middle_sd(model, pitch) < sd_share else (low, pitch)
    return low


def _middle_sd(model: CovarianceModel, pitch: float) -> float:
    ticks = pitch * (np.arange(-SIDE, SIDE) + 0.5)
    places = np.stack(np.meshgrid(ticks, ticks), axis=-1).reshape(-1, 2)
    middle = np.zeros((1, 2))
    return float(krige(places, np.zeros(len(places)), middle, model).sd[0])


def expected_variance(way: Array, nodes: Array, model: CovarianceModel, pace_m: float) -> Array:
    """Variance (m,) of the map's signal at nodes (m, 2) once samples are taken along a path (n, 2),
    one every `pace_m` [m]. It depends on where the samples are, not on their values.
    """
    length_m = float(passed_m(way)[-1])
    count = max(2, int(length_m / pace_m) + 1)
    places = places_at(way, np.linspace(0.0, length_m, count))
    return krige(places, np.zeros(count), nodes, model).variance
