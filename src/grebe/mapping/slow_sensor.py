"""The water behind the readings of a slow sensor.

A first-order sensor with the time constant tau follows the water f by tau y' = f - y, so a reading
is the water weighted along the path that the boat has sailed:

    y(t) = integral over s > 0 of exp(-s / tau) / tau f(x(t - s)) ds + noise.

Integrated over any time, the equation says that the mean of the water is that of the readings plus
tau times their slope (Fofonoff and Millard 1983, section on response times). This assumes nothing
about the water in between. Its price is noise: the slope's, multiplied by tau.
"""

from __future__ import annotations

from dataclasses import dataclass, replace
from typing import TYPE_CHECKING

import numpy as np

from grebe.mapping.covariance.noise import median_noise_variance
from grebe.mapping.methods.base import Readings
from grebe.mapping.stamps import PAUSE_STEPS, usual_step_s

if TYPE_CHECKING:
    from numpy.typing import NDArray

    Array = NDArray[np.floating]

# The share of the readings' variance that the noise of a restored value may have.
NOISE_SHARE = 0.05
# A restored value is a mean with weights that fall to zero at the far ends of the two groups. The
# mean distance between two places drawn with these weights, as a share of that between the groups.
SPREAD_SHARE = 7.0 / 15.0


@dataclass(frozen=True, kw_only=True)
class Response:
    """A sensor's first-order response: its time constant and the standard error of that [s], and
    what it adds to the log likelihood of no lag or of the best delay.
    """

    constant_s: float
    sd_s: float
    gain: float


@dataclass(frozen=True, kw_only=True, eq=False)
class Groups:
    """The means of groups of successive readings of a slow sensor: `times` (g,) [s], `positions`
    (g, 2) [m], `values` (g,); how many readings are in each, `counts` (g,); and after which of
    them the record goes on without a pause, `joined` (g - 1,).
    """

    times: Array
    positions: Array
    values: Array
    counts: Array
    joined: NDArray[np.bool_]

    @classmethod
    def of(cls, readings: Readings, size: int) -> Groups:
        """Groups of `size` readings, or fewer before a pause; they are in order of their times."""
        times = readings.times
        assert times is not None
        pauses = np.diff(times, prepend=times[0]) > PAUSE_STEPS * usual_step_s(times)
        since = np.arange(len(times))
        since = since - np.maximum.accumulate(np.where(pauses, since, 0))
        group = np.cumsum(since % size == 0) - 1
        counts = np.bincount(group).astype(float)

        def mean(column: Array) -> Array:
            return np.bincount(group, column) / counts

        return cls(
            times=times[0] + mean(times - times[0]),
            positions=np.column_stack([mean(column) for column in readings.positions.T]),
            values=mean(readings.values),
            counts=counts,
            # The first group after a pause does not follow the one before it.
            joined=~pauses[np.searchsorted(group, np.arange(1, len(counts)))],
        )

    def water(self, constant_s: float) -> Readings:
        """The mean of the water between each two joined groups, where and when the boat was midway
        between them.
        """
        values = _between(self.values) + constant_s * np.diff(self.values) / np.diff(self.times)
        steps = np.hypot(*np.diff(self.positions, axis=0).T)[self.joined]
        return Readings(
            positions=_between(self.positions)[self.joined],
            values=values[self.joined],
            times=_between(self.times)[self.joined],
            spread_m=SPREAD_SHARE * float(np.median(steps)),
        )

    def slopes(self) -> Array:
        """How fast the readings change between joined groups, (m,) [1/s]."""
        return (np.diff(self.values) / np.diff(self.times))[self.joined]

    def noise(self, constant_s: float, variance: float) -> Array:
        """Covariance (m, m) of the errors of `water`, for readings with noise of this variance."""
        weights = constant_s / np.diff(self.times)
        last = np.flatnonzero(self.joined)
        rows = np.arange(len(last))
        takes = np.zeros((len(last), len(self.values)))
        takes[rows, last] = 0.5 - weights[last]
        takes[rows, last + 1] = 0.5 + weights[last]
        return variance * (takes / self.counts) @ takes.T


def in_order(readings: Readings) -> Readings:
    """The readings in the order of their times, one for each time."""
    assert readings.times is not None
    _, order = np.unique(readings.times, return_index=True)
    return replace(
        readings,
        times=readings.times[order],
        positions=readings.positions[order],
        values=readings.values[order],
        extra_sd=None if readings.extra_sd is None else readings.extra_sd[order],
    )


def restored(readings: Readings, response: Response) -> Readings:
    """The water as a fast sensor would have read it, from a slow one's readings with times.

    The groups between which it is restored are as short as the noise allows. The errors of
    neighbouring values are taken as independent, although two share a group. `extra_sd` is that by
    the error of the time constant.
    """
    readings = in_order(readings)
    groups = Groups.of(readings, _group_size(readings, response.constant_s))
    extra_sd = response.sd_s * np.abs(groups.slopes())
    return replace(groups.water(response.constant_s), extra_sd=extra_sd)


def _group_size(readings: Readings, constant_s: float) -> int:
    """How many readings make a group: so many that the noise of a restored value, which for groups
    of k has the variance 2 sigma^2 tau^2 / (k (k step)^2), is a small share of the readings'
    variance. A group of more than a time constant would restore nothing.
    """
    assert readings.times is not None
    constant = constant_s / usual_step_s(readings.times)
    noise = median_noise_variance(readings.positions, readings.values)
    allowed = NOISE_SHARE * float(np.var(readings.values))
    size = np.cbrt(2.0 * noise * constant**2 / allowed)
    return max(int(np.ceil(min(size, constant))), 1)


def _between(column: Array) -> Array:
    return 0.5 * (column[1:] + column[:-1])
