"""How much of a nugget is the sensor's noise, and how much is water that varies within metres.

A variogram's nugget holds both (Cressie 1993, section 3.2.1). The noise is no property of the
water, but the variation within metres is, so a map's stated error must include it.
"""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

if TYPE_CHECKING:
    from numpy.typing import NDArray

    Array = NDArray[np.floating]

# Consecutive samples within this distance measure the same water [m].
NEAR_M = 3.0
FEWEST_TRIPLES = 30


def noise_variance(positions: Array, values: Array, nugget: float) -> float:
    """Variance of the sensor's noise, at most the nugget.

    Computed from second differences of closely spaced consecutive samples, which a gradient does
    not affect. If there are too few of them, the whole nugget is taken as noise.
    """
    close = _close(positions)
    if close.sum() < FEWEST_TRIPLES:
        return nugget
    second = (values[:-2] - 2 * values[1:-1] + values[2:])[close]
    return min(nugget, float(np.mean(second**2)) / 6)


def median_noise_variance(positions: Array, values: Array) -> float:
    """Variance of the sensor's noise from the median of the same second differences, which outliers
    do not affect; those of all samples if too few are closely spaced.
    """
    close = _close(positions)
    if close.sum() < FEWEST_TRIPLES:
        close = np.ones(len(values) - 2, dtype=bool)
    second = np.abs(values[:-2] - 2 * values[1:-1] + values[2:])[close]
    return max(float((1.4826 * np.median(second)) ** 2 / 6), rounding_variance(values))


def tell_noise(positions: Array) -> bool:
    """Whether enough samples are closely spaced to determine the noise by themselves."""
    return bool(_close(positions).sum() >= FEWEST_TRIPLES)


def _close(positions: Array) -> NDArray[np.bool_]:
    """Which three consecutive samples (n - 2,) measure the same water."""
    steps = np.hypot(*np.diff(positions, axis=0).T)
    return (steps[:-1] <= NEAR_M) & (steps[1:] <= NEAR_M)


def rounding_variance(values: Array) -> float:
    """Variance of the rounding error of values written with a limited number of digits.

    If most values repeat the one before, their differences show no noise at all, and a smooth
    covariance would take the rounding steps for slopes. The resolution is taken as the smallest
    step between two values.
    """
    steps = np.diff(np.unique(values))
    steps = steps[steps > 1e-9 * max(float(np.abs(values).max()), 1e-300)]
    return float(steps.min()) ** 2 / 12 if len(steps) else 0.0
