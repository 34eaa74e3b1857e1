"""Write contour lines of all maps as a GeoPackage, one layer per quantity, in WGS 84."""

from __future__ import annotations

import math
from collections.abc import Sequence
from pathlib import Path

import contourpy
import numpy as np
import pyogrio.raw
import shapely
from matplotlib.ticker import MaxNLocator
from pyogrio.errors import DataLayerError, DataSourceError, FeatureError

from grebe.core.frames import LocalFrame
from grebe.io.atomic_write import written_whole
from grebe.mapping.quantity_map import QuantityMap

LEVELS = 10


def contour_levels(one: QuantityMap) -> list[float]:
    """Return round values that span the map in at most `LEVELS` steps; none if it is flat.

    They are farther apart than the 95 % error of the median place: closer lines would draw the
    map's errors as if they were water.
    """
    inside = one.mean[one.grid.inside]
    low, high = float(inside.min()), float(inside.max())
    error = one.error95
    steps = min(LEVELS, math.floor((high - low) / error)) if error > 0 else LEVELS
    if steps < 1:
        return []
    return [float(level) for level in MaxNLocator(steps).tick_values(low, high)]


def contour_lines(one: QuantityMap) -> list[tuple[float, shapely.LineString]]:
    """Return the level and the line (north, east) of each contour."""
    generator = contourpy.contour_generator(
        one.grid.east, one.grid.north, np.ma.masked_invalid(one.mean)
    )
    return [
        (level, shapely.LineString(np.asarray(points)[:, ::-1]))
        for level in contour_levels(one)
        for points in generator.lines(level)
        if len(points) > 1
    ]


def write_contours(path: Path, maps: Sequence[QuantityMap], frame: LocalFrame) -> None:
    """Write the contours of all maps; the file appears only when complete."""
    with written_whole(path, DataSourceError, DataLayerError, FeatureError) as part:
        for one in maps:
            found = contour_lines(one)
            lines = np.array([frame.geometry_to_wgs84(line) for _, line in found], dtype=object)
            pyogrio.raw.write(
                part,
                np.array([shapely.to_wkb(line) for line in lines], dtype=object),
                [np.array([level for level, _ in found], dtype=float)],
                ["level"],
                layer=one.quantity.key,
                geometry_type="LineString",
                crs="EPSG:4326",
                append=part.exists(),
                driver="GPKG",
            )
