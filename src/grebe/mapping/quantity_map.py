"""The map of one quantity, and its values at any place."""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np

from grebe.core.quantities import Quantity
from grebe.mapping.change import Change
from grebe.mapping.grid import Grid
from grebe.mapping.methods.base import Field, Method, Model, Readings
from grebe.mapping.proof.calibration import Calibration
from grebe.mapping.proof.validation import Z95, Validation
from grebe.mapping.scale import LINEAR, Scale, exceedance
from grebe.mapping.threads import one_blas_thread

if TYPE_CHECKING:
    from numpy.typing import NDArray

    Array = NDArray[np.floating]


def water_sd(field: Field, calibration: Calibration, micro_sd: float, places: Array) -> Array:
    """Standard deviation (n,) of the water at places (n, 2), on the field's scale: the field's own,
    calibrated by left-out readings, combined with what varies within metres.
    """
    return sd_with(field.sd(places), calibration, micro_sd, places)


def sd_with(field_sd: Array, calibration: Calibration, micro_sd: float, places: Array) -> Array:
    """As `water_sd`, for a field whose standard deviation (n,) at the places is known."""
    return np.hypot(calibration.factor(places) * field_sd, micro_sd)


def possible(mean: Array, quantity: Quantity, values: Array) -> Array:
    """Clip a mean to the quantity's possible range, widened by what was actually read: between
    readings of a depth of 2 m, a smooth field may come out above the surface.
    """
    low, high = quantity.span
    if quantity.has_true_zero:
        low = max(low, 0.0)
    return np.clip(mean, min(low, float(values.min())), max(high, float(values.max())))


@dataclass(frozen=True, kw_only=True)
class PlaceValues:
    """The water at n places: `mean`, `sd` and the ends of its 95 % interval, (n,) each."""

    mean: Array
    sd: Array
    low: Array
    high: Array


@dataclass(frozen=True, kw_only=True)
class QuantityMap:
    """The map of one quantity: `mean` and `sd` of the water, (rows, columns), NaN on land;
    how it was made and how good it is.

    `field` gives estimates at any place, before calibration; `model` is the model behind it, and
    `reason` says why its method was used.

    `micro_sd`, the variation within metres, is part of `sd`; a sensor's `noise_sd` is not.
    `calibration` holds factors of the standard deviations, found from left-out stretches and
    lines. `change` is the change of all the water during the survey, and the sensor's lag. If
    `is_of_moment`, both are removed and the map is of the time `change.moment_s`; if not, each
    place is as it was when the boat was near. `readings` are those that made the map, brought to
    its time; of a slow sensor, the water restored from them.

    `mean`, `sd` and the properties are in the quantity's unit. `field`, `model`, `readings`,
    `change` and `micro_sd` are on the map's `scale`, on which the water is normally distributed
    with the mean and standard deviation `on_scale`; None where these are `mean` and `sd`. For a
    skewed quantity, `mean` is computed with `known_sd`, while `sd`, intervals and draws include the
    full uncertainty.
    """

    quantity: Quantity
    grid: Grid
    mean: Array
    sd: Array
    calibration: Calibration
    micro_sd: float
    change: Change
    is_of_moment: bool
    readings: Readings
    field: Field
    method: Method
    reason: str
    model: Model
    validation: Validation | None
    flagged: int
    scale: Scale = LINEAR
    on_scale: tuple[Array, Array] | None = None

    @property
    def positions(self) -> Array:
        """Positions of the samples that made the map, (n, 2) [m]."""
        return self.readings.positions

    @property
    def values(self) -> Array:
        """Their values (n,), brought to the map's time if it has one."""
        return self.scale.back(self.readings.values)

    @property
    def samples(self) -> int:
        """Number of samples that made the map."""
        return len(self.values)

    @property
    def noise_sd(self) -> float:
        """Standard deviation of an observation about the water, at the map's median value."""
        nugget = self.calibration.on_way**2 * self.model.nugget
        return self.in_unit(float(np.sqrt(max(nugget - self.micro_sd**2, 0.0))))

    @property
    def changed_by(self) -> float:
        """How much all of the water changed during the survey, at the map's median value."""
        return self.in_unit(self.change.range_of)

    @property
    def interval95(self) -> dict[str, Array]:
        """The ends of the 95 % intervals, (rows, columns), if they are not symmetric about the
        mean; empty if `mean` and `sd` give them.
        """
        if self.on_scale is None:
            return {}
        mean, sd = self.on_scale
        ends = {"low95": mean - Z95 * sd, "high95": mean + Z95 * sd}
        return {name: self.scale.back(end) for name, end in ends.items()}

    @property
    def error95(self) -> float:
        """Half the width of the 95 % interval at the median place."""
        inside, ends = self.grid.inside, self.interval95
        if not ends:
            return Z95 * float(np.median(self.sd[inside]))
        return float(np.median((ends["high95"] - ends["low95"])[inside])) / 2

    def in_unit(self, step: float) -> float:
        """Convert a small step on the map's scale to the quantity's unit, at the map's median."""
        return step * self.scale.slope(float(np.nanmedian(self.mean)))

    def at(self, places: Array) -> PlaceValues:
        """Return the estimates at places (n, 2) [m]."""
        mean = self.field.mean(places)
        sd = water_sd(self.field, self.calibration, self.micro_sd, places)
        low, high = (self.scale.back(mean + z * sd) for z in (-Z95, Z95))
        known = known_sd(sd, self.readings)
        return PlaceValues(
            mean=possible(self.scale.mean(mean, known), self.quantity, self.values),
            sd=self.scale.sd(mean, sd),
            low=possible(low, self.quantity, self.values),
            high=possible(high, self.quantity, self.values),
        )

    def exceedance(self, threshold: float) -> Array:
        """Probability that the water exceeds a threshold, (rows, columns); NaN on land."""
        mean, sd = self.on_scale or (self.mean, self.sd)
        return exceedance(self.scale, mean, sd, threshold)

    def draws(self, count: int, seed: int = 0) -> Array:
        """Equally likely fields given the samples, (count, rows, columns); NaN on land."""
        drawn = self.draws_at_nodes(count, 1, seed)
        return np.array([self.grid.spread(one) for one in drawn])

    def draws_at_nodes(self, count: int, every: int = 1, seed: int = 0) -> Array:
        """Equally likely values given the samples, (count, m), at every `every`-th of the grid's
        nodes in the water.
        """
        nodes, inside = self.grid.nodes[::every], self.grid.inside
        mean, _ = self.on_scale or (self.mean, self.sd)
        mean = mean[inside][::every]
        with one_blas_thread():
            drawn = self.field.draws(nodes, count, seed)
        fine = np.random.default_rng([seed, 1]).normal(0.0, self.micro_sd, drawn.shape)
        drawn = mean + self.calibration.factor(nodes) * (drawn - mean) + fine
        if self.is_of_moment:
            drawn = drawn + self.change.draws_near(self.readings, nodes, count, seed)
        return self.scale.back(drawn)


def known_sd(sd: Array, readings: Readings) -> Array:
    """The part of a standard deviation that counts for the mean of a skewed quantity: at most the
    readings' own. An interval may be wider, because the covariance is uncertain; the water's spread
    is not.
    """
    return np.minimum(sd, float(np.std(readings.values)))
