"""The scale on which a quantity is mapped: its own or the logarithm.

What a plume carries - turbidity, chlorophyll - is positive and skewed: some readings are ten times
the rest and vary ten times as much. On the quantity's own scale one variance serves both, so clear
water appears as uncertain as the plume, down to negative turbidities. The logarithm is nearly
normal. It is mapped by the same methods and transformed back by the moments of
the lognormal distribution, so that the map shows the quantity's mean and not its median (Cressie
1993, section 3.2.2: lognormal kriging).
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from typing import TYPE_CHECKING, Protocol

import numpy as np
from scipy.special import ndtr

from grebe.mapping.way import blocks_of

if TYPE_CHECKING:
    from numpy.typing import NDArray

    Array = NDArray[np.floating]

# The logarithm is not considered where the standard deviation is a smaller share of the mean than
# this: the two scales then differ by little more than a factor.
LEAST_SPREAD = 0.3
# How much the logarithm must add to the log likelihood. The values, one for every `APART_M` metres,
# are taken as independent and normal.
CLEAR_GAIN, APART_M = 10.0, 10.0


class Scale(Protocol):
    """A scale, and how a normal distribution on it converts to the quantity's unit."""

    @property
    def name(self) -> str:
        """Its name in settings and files."""
        ...

    def forward(self, values: Array) -> Array:
        """Convert values from the quantity's unit to the scale."""
        ...

    def back(self, values: Array) -> Array:
        """Convert values from the scale to the quantity's unit."""
        ...

    def mean(self, mean: Array, sd: Array) -> Array:
        """Mean, in the quantity's unit, of a normal distribution on the scale."""
        ...

    def sd(self, mean: Array, sd: Array) -> Array:
        """Its standard deviation, in the quantity's unit."""
        ...

    def slope(self, at: float) -> float:
        """How many of the quantity's units one unit on the scale is, at a value in that unit."""
        ...


@dataclass(frozen=True)
class Linear:
    """The quantity's own scale."""

    name: str = "linear"

    def forward(self, values: Array) -> Array:
        """See `Scale`."""
        return values

    def back(self, values: Array) -> Array:
        """See `Scale`."""
        return values

    def mean(self, mean: Array, sd: Array) -> Array:  # noqa: ARG002
        """See `Scale`."""
        return mean

    def sd(self, mean: Array, sd: Array) -> Array:  # noqa: ARG002
        """See `Scale`."""
        return sd

    def slope(self, at: float) -> float:  # noqa: ARG002
        """See `Scale`."""
        return 1.0


@dataclass(frozen=True)
class Logarithmic:
    """The natural logarithm of a positive quantity."""

    name: str = "log"

    def forward(self, values: Array) -> Array:
        """See `Scale`."""
        return np.log(values)

    def back(self, values: Array) -> Array:
        """See `Scale`."""
        return np.exp(values)

    def mean(self, mean: Array, sd: Array) -> Array:
        """See `Scale`."""
        return np.exp(mean + sd**2 / 2)

    def sd(self, mean: Array, sd: Array) -> Array:
        """See `Scale`."""
        return np.exp(mean + sd**2 / 2) * np.sqrt(np.expm1(sd**2))

    def slope(self, at: float) -> float:
        """See `Scale`."""
        return at


LINEAR, LOGARITHMIC = Linear(), Logarithmic()
SCALES: Mapping[str, Scale] = {one.name: one for one in (LINEAR, LOGARITHMIC)}


def scale_of(positions: Array, values: Array) -> Scale:
    """Choose the scale on which readings (n,) at positions (n, 2) are closer to normal, by the
    likelihood of Box and Cox (1964) for the powers 1 and 0, applied to means over `APART_M`.
    """
    if len(values) == 0 or values.min() <= 0 or values.std() < LEAST_SPREAD * values.mean():
        return LINEAR
    blocks = blocks_of(positions, APART_M)
    means = np.bincount(blocks, np.log(values)) / np.bincount(blocks)
    plain = np.exp(means)
    variances = float(np.var(plain)), float(np.var(means))
    if min(variances) <= 0:
        return LINEAR
    gain = 0.5 * len(means) * float(np.log(variances[0] / variances[1])) - float(means.sum())
    return LOGARITHMIC if gain > CLEAR_GAIN else LINEAR


def exceedance(scale: Scale, mean: Array, sd: Array, threshold: float) -> Array:
    """Probability that a normal distribution on the scale, with this mean and standard deviation,
    exceeds a threshold in the quantity's unit; NaN on land.
    """
    with np.errstate(divide="ignore", invalid="ignore"):
        limit = scale.forward(np.asarray(threshold, dtype=float))
        # A threshold outside the scale is below all values.
        limit = -np.inf if np.isnan(limit) else limit
        z = (mean - limit) / sd
    certain = (mean > limit).astype(float)
    probability = np.where(sd > 0, ndtr(z), certain)
    return np.where(np.isfinite(mean), probability, np.nan)
