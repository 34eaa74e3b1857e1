"""A sonde that settles in the water: all sensors are judged together, and with the boat's motion.

A sensor brought into the water from elsewhere approaches its value exponentially, steepest at the
first reading. Gradients under a moving boat look the same, and like a settling sonde they affect
several sensors at once. So neither the shape nor the number of sensors distinguishes the two. Two
other things do. A first reading far beyond all that the sensor shows later is not the lake's. And
while the boat holds its position, the water under it does not change faster than along its path.
Where one sensor settles for certain, weaker evidence is enough for another. No duration is set: the
slowest approach considered is a share of the record.
"""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np

if TYPE_CHECKING:
    from numpy.typing import NDArray

    Array = NDArray[np.floating]

FEWEST_SAMPLES = 20
# Time constants to try [s]: the fastest, and how many per factor of ten.
FASTEST_TAU_S, TAUS_A_DECADE = 10.0, 12
# An approach is fitted over this many of its time constants. To show which values belong to the
# water, the record must go on for three times as long.
SPAN_TAUS, LATER_STRETCHES = 4.0, 3.0
# It must explain this share of that stretch, and leave less than half of what a straight line does.
EXPLAINED, OVER_LINE = 0.9, 0.5
# How far the first reading must be beyond all later ones, as a share of their range: on its own,
# and if another sensor settles too.
ALONE, TOGETHER = 1.0, 0.0
# If the boat holds its position, an approach must be larger than half of the later stretches show.
STILL_TIMES = 1.0
# Quantities derived from one sensor: two of them are one witness.
SENSORS = {
    "oxygen_saturation_percent": "dissolved_oxygen_mgl",
    "specific_conductance_uscm": "conductivity_uscm",
    "chlorophyll_ugl": "chlorophyll_rfu",
    "phycocyanin_ugl": "phycocyanin_rfu",
}
# More samples than these add nothing about one approach.
MOST_SAMPLES = 4000
# A boat that stays within this distance [m], about the wander of GPS, for this time [s] holds its
# position: by then a surveying boat is tens of metres away.
STILL_M, STILL_S = 8.0, 60.0
# A sensor has settled when this share of the approach is left.
SETTLED_SHARE = 0.05


@dataclass(frozen=True, kw_only=True)
class Approach:
    """An exponential approach at the start of a record: time constant `tau_s` [s].

    `beyond` is how far the first reading is beyond all that follow the approach, as a share of
    their range; `times_usual` is its size over what the sensor usually shows in as long a time.
    Both are NaN if the record is too short.
    """

    tau_s: float
    beyond: float
    times_usual: float

    @property
    def settled_s(self) -> float:
        """When the sensor has settled, after the first reading [s]."""
        return self.tau_s * math.log(1 / SETTLED_SHARE)


def settling_times(
    columns: Mapping[str, Array], times: Array, positions: Array
) -> dict[str, float]:
    """How long each sensor took to settle [s after the first sample]; only those that did.

    `columns` (n,) by sensor, NaN for gaps; `times` (n,) [s], in order; `positions` (n, 2) [m].
    """
    if len(times) < FEWEST_SAMPLES or not np.all(np.diff(times) >= 0):
        return {}
    since = times - times[0]
    still_s = _still_for(since, positions)
    found = {
        key: approach
        for key, column in columns.items()
        if (there := np.isfinite(column)).sum() >= FEWEST_SAMPLES
        and (approach := _approach(since[there], _calm(column[there]))) is not None
    }
    clear = {
        key: one
        for key, one in found.items()
        if one.beyond >= ALONE
        # In the first two time constants, 86 % of an approach takes place.
        or (still_s >= max(2 * one.tau_s, STILL_S) and not one.times_usual < STILL_TIMES)
    }
    sure = {SENSORS.get(key, key) for key in clear}
    clear |= {
        key: one
        for key, one in found.items()
        if one.beyond > TOGETHER and sure - {SENSORS.get(key, key)}
    }
    return {key: one.settled_s for key, one in clear.items()}


def _still_for(since: Array, positions: Array) -> float:
    """How long the boat held its position, from the first sample on [s]."""
    away = np.hypot(*(positions - positions[0]).T) > STILL_M
    return float(since[np.argmax(away)]) if away.any() else float(since[-1])


def _calm(values: Array) -> Array:
    """Values without single outliers: medians of three."""
    if len(values) < 3:
        return values
    inner = np.median(np.column_stack([values[:-2], values[1:-1], values[2:]]), axis=1)
    return np.concatenate([values[:1], inner, values[-1:]])


def _approach(since: Array, values: Array) -> Approach | None:
    """The approach that explains its stretch best; None if none does."""
    slowest = max(since[-1] / 6, FASTEST_TAU_S)
    decades = math.log10(slowest / FASTEST_TAU_S)
    best: tuple[float, float, float] | None = None
    for tau in np.geomspace(FASTEST_TAU_S, slowest, max(int(TAUS_A_DECADE * decades), 1)):
        stretch = since <= SPAN_TAUS * tau
        if stretch.sum() < FEWEST_SAMPLES:
            continue
        thin = slice(None, None, 1 + int(stretch.sum()) // MOST_SAMPLES)
        t, v = since[stretch][thin], values[stretch][thin]
        whole = float(np.sum((v - v.mean()) ** 2))
        if whole <= 0:
            continue
        amplitude, left = _fit(np.exp(-t / tau), v)
        line = _fit(t, v)[1]
        if left > (1 - EXPLAINED) * whole or left > OVER_LINE * line:
            continue
        if best is None or left / whole < best[0]:
            best = (left / whole, float(tau), amplitude)
    if best is None:
        return None
    _, tau, amplitude = best
    beyond, usual = _later(since, values, SPAN_TAUS * tau)
    size = abs(amplitude) * (1 - math.exp(-SPAN_TAUS))
    return Approach(tau_s=tau, beyond=beyond, times_usual=size / usual if usual else math.nan)


def _fit(shape: Array, values: Array) -> tuple[float, float]:
    """The factor of a shape, next to a constant, by least squares; and the remaining squares."""
    centred, off = shape - shape.mean(), values - values.mean()
    factor = float(centred @ off / max(float(centred @ centred), 1e-300))
    return factor, float(np.sum((off - factor * centred) ** 2))


def _later(since: Array, values: Array, length_s: float) -> tuple[float, float]:
    """How far the first reading is beyond all those after `length_s` [s], as a share of their
    range; and the median range within stretches as long. NaN if the record is too short.
    """
    if since[-1] < (1 + LATER_STRETCHES) * length_s:
        return math.nan, math.nan
    rest = values[since > length_s]
    low, high = float(rest.min()), float(rest.max())
    beyond = max(low - float(values[0]), float(values[0]) - high) / max(high - low, 1e-12)
    starts = np.arange(length_s, since[-1] - length_s / 2, length_s / 4)
    edges = np.searchsorted(since, starts), np.searchsorted(since, starts + length_s)
    spans = [
        float(np.ptp(np.percentile(values[a:b], (2, 98))))
        for a, b in zip(*edges, strict=True)
        if b - a >= FEWEST_SAMPLES // 2
    ]
    return beyond, float(np.median(spans)) if spans else math.nan
