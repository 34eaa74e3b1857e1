"""Bathymetry from a map of depths: a lake's area, its volume, and how both fall with depth.

Hutchinson (1957), A Treatise on Limnology I, chapter 2; Wetzel (2001), section 3.III. Each node
stands for an equal share of the water's area.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np

if TYPE_CHECKING:
    from numpy.typing import NDArray

    Array = NDArray[np.floating]

# The key of the quantity whose map is a bathymetry.
WATER_DEPTH = "water_depth_m"
LEVELS = 41


@dataclass(frozen=True, kw_only=True)
class Hypsography:
    """At each of `depth_m` (k,), ascending from 0: the area [m2] of the water at least that deep
    and the volume [m3] below it, with standard deviations (k,) that are zero without draws.
    """

    depth_m: Array
    area_m2: Array
    volume_m3: Array
    area_sd_m2: Array
    volume_sd_m3: Array


@dataclass(frozen=True, kw_only=True)
class Bathymetry:
    """Figures of a lake from its depths [m, m2, m3], with standard deviations from draws of the
    map.

    `max_depth_m` is the maximum of the estimated map, which is smoother than the lake bed.
    """

    area_m2: float
    volume_m3: float
    volume_sd_m3: float
    mean_depth_m: float
    max_depth_m: float
    max_depth_sd_m: float
    curve: Hypsography


def area_below(depths: Array, levels: Array, area_m2: float) -> Array:
    """Area of the water deeper than each level (k,), for depths (..., m) at m nodes that share
    `area_m2` evenly: (..., k).
    """
    return area_m2 * np.stack([np.mean(depths > level, axis=-1) for level in levels], axis=-1)


def volume_below(depths: Array, levels: Array, area_m2: float) -> Array:
    """Volume below each level (k,), for depths (..., m): (..., k). The integral of `area_below`
    from the level down.
    """
    return area_m2 * np.stack(
        [np.mean(np.maximum(depths - level, 0.0), axis=-1) for level in levels], axis=-1
    )


def bathymetry(
    depths: Array, area_m2: float, draws: Array | None = None, levels: Array | None = None
) -> Bathymetry:
    """Compute the figures of a lake of `area_m2` from depths (m,) at nodes spread evenly over it.

    `draws` (count, m) are equally likely depths, whose spread about their mean is the uncertainty.
    A depth below zero counts as zero. `levels` (k,) are the depths of the curve; by default they
    run evenly from 0 to the greatest depth.

    Raises `ValueError` if a depth is not finite or the water has no area.
    """
    if not (len(depths) and np.isfinite(depths).all() and area_m2 > 0):
        raise ValueError("a bathymetry needs finite depths and a water with an area")
    deepest = max(float(depths.max()), 0.0)
    if levels is None:
        levels = np.linspace(0.0, deepest, LEVELS)
    zeros = np.zeros(len(levels))
    volume_sd, max_sd, area_sds, volume_sds = 0.0, 0.0, zeros, zeros
    if draws is not None and len(draws) > 1:
        area_sds = np.std(area_below(draws, levels, area_m2), axis=0, ddof=1)
        volume_sds = np.std(volume_below(draws, levels, area_m2), axis=0, ddof=1)
        volume_sd = float(np.std(volume_below(draws, np.zeros(1), area_m2), ddof=1))
        max_sd = float(np.std(draws.max(axis=1), ddof=1))
    volume = float(volume_below(depths, np.zeros(1), area_m2)[0])
    return Bathymetry(
        area_m2=area_m2,
        volume_m3=volume,
        volume_sd_m3=volume_sd,
        mean_depth_m=volume / area_m2,
        max_depth_m=deepest,
        max_depth_sd_m=max_sd,
        curve=Hypsography(
            depth_m=levels,
            area_m2=area_below(depths, levels, area_m2),
            volume_m3=volume_below(depths, levels, area_m2),
            area_sd_m2=area_sds,
            volume_sd_m3=volume_sds,
        ),
    )
