"""Tables that a limnologist expects in a report: stations, area by class, and the columns."""

from __future__ import annotations

from dataclasses import dataclass
from datetime import UTC, datetime
from typing import TYPE_CHECKING

import numpy as np
from matplotlib.ticker import MaxNLocator
from scipy.special import ndtr

from grebe.core.quantities import Quantity
from grebe.mapping.quantity_map import QuantityMap
from grebe.report.data import ReportData

if TYPE_CHECKING:
    from numpy.typing import NDArray

# Approximate number of classes of a map's values; their bounds are round numbers.
CLASSES = 5


@dataclass(frozen=True, kw_only=True)
class AreaClass:
    """Values from `low` to `high`, in the quantity's unit, either of which may be infinite. The
    expected `share` of the area in the class includes the map's uncertainty.
    """

    low: float
    high: float
    share: float


@dataclass(frozen=True, kw_only=True)
class Station:
    """The samples of one target set: its number, their centre (longitude, latitude) [deg], their
    median time [unix s], how many there are, and for each quantity the mean of the usable values,
    NaN if there are none.
    """

    number: int
    lonlat: tuple[float, float]
    time_s: float
    samples: int
    means: dict[str, float]


def area_classes(one: QuantityMap) -> list[AreaClass]:
    """The shares of the area in classes with round bounds; they sum to 1."""
    inside = one.grid.inside
    low, high = np.percentile(one.mean[inside], [5, 95]).tolist()
    if not high > low:
        return [AreaClass(low=-np.inf, high=np.inf, share=1.0)]
    ticks = np.asarray(MaxNLocator(CLASSES, steps=[1, 2, 2.5, 5, 10]).tick_values(low, high))
    between = ticks[(ticks > low) & (ticks < high)]
    bounds = np.concatenate([[-np.inf], between, [np.inf]])
    # The water is normally distributed on the map's scale.
    mean, sd = (field[inside] for field in one.on_scale or (one.mean, one.sd))
    sd = np.maximum(sd, 1e-12 * max(np.ptp(mean), 1))
    limits = [-np.inf, *one.scale.forward(between).tolist(), np.inf]
    below = np.array([float(np.mean(ndtr((limit - mean) / sd))) for limit in limits])
    return [
        AreaClass(low=a, high=b, share=share)
        for a, b, share in zip(
            bounds[:-1].tolist(), bounds[1:].tolist(), np.diff(below).tolist(), strict=True
        )
    ]


def stations(data: ReportData) -> list[Station]:
    """The target sets that were sampled, in order; none for a track without a plan."""
    samples = data.samples
    lonlat = data.survey.frame.to_wgs84(samples.positions)
    found: list[Station] = []
    for number in np.unique(samples.target_seq[samples.target_seq > 0]).tolist():
        taken = samples.target_seq == number
        lon, lat = lonlat[taken].mean(axis=0).tolist()
        found.append(
            Station(
                number=number,
                lonlat=(lon, lat),
                time_s=float(np.median(samples.times[taken])),
                samples=int(taken.sum()),
                means={
                    key: _mean(values[taken & samples.usable(key)])
                    for key, values in samples.values.items()
                    if samples.measured(key)
                },
            )
        )
    return found


def measured_quantities(data: ReportData) -> list[Quantity]:
    """The quantities that were sampled, in the order of the survey's quantities."""
    return [one for key, one in data.quantities.items() if data.samples.measured(key)]


def moment_text(seconds: float) -> str:
    """A time [unix s] to the second, in UTC."""
    return f"{datetime.fromtimestamp(seconds, UTC):%Y-%m-%d %H:%M:%S}"


def _mean(values: NDArray[np.floating]) -> float:
    return float(values.mean()) if len(values) else float("nan")
