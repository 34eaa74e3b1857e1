"""How much of a nugget is the sensor's noise, and how much is water that varies within metres.

A variogram's nugget holds both (Cressie 1993, section 3.2.1). Only the first is not the
water's: what the map says of its own error must hold the second.
"""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

if TYPE_CHECKING:
    from numpy.typing import NDArray

    Array = NDArray[np.floating]

# Samples that follow each other within this distance see the same water [m].
NEAR_M = 3.0
FEWEST_TRIPLES = 30


def noise_variance(positions: Array, values: Array, nugget: float) -> float:
    """Variance of the sensor's noise, at most the nugget.

    From second differences of samples that follow each other closely, which a gradient does not
    touch. Where there are too few, all of the nugget is taken for noise.
    """
    close = _close(positions)
    if close.sum() < FEWEST_TRIPLES:
        return nugget
    second = (values[:-2] - 2 * values[1:-1] + values[2:])[close]
    return min(nugget, float(np.mean(second**2)) / 6)


def median_noise_variance(positions: Array, values: Array) -> float:
    """Variance of the sensor's noise by the median of the same second differences, which outliers
    do not move; those of all samples where too few follow each other closely.
    """
    close = _close(positions)
    if close.sum() < FEWEST_TRIPLES:
        close = np.ones(len(values) - 2, dtype=bool)
    second = np.abs(values[:-2] - 2 * values[1:-1] + values[2:])[close]
    return max(float((1.4826 * np.median(second)) ** 2 / 6), rounding_variance(values))


def tell_noise(positions: Array) -> bool:
    """Whether enough samples follow each other closely to tell the noise by themselves."""
    return bool(_close(positions).sum() >= FEWEST_TRIPLES)


def _close(positions: Array) -> NDArray[np.bool_]:
    """Which three samples (n - 2,) in a row see the same water."""
    steps = np.hypot(*np.diff(positions, axis=0).T)
    return (steps[:-1] <= NEAR_M) & (steps[1:] <= NEAR_M)


def rounding_variance(values: Array) -> float:
    """Variance of the error of values that are written to so many digits.

    Where most of them repeat the one before, differences show no noise at all, and a smooth
    covariance would make slopes of the steps. The digit is the smallest step between two values.
    """
    steps = np.diff(np.unique(values))
    steps = steps[steps > 1e-9 * max(float(np.abs(values).max()), 1e-300)]
    return float(steps.min()) ** 2 / 12 if len(steps) else 0.0
