"""Validate and clean a region: from an outline in degrees to water in a local frame."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np
import shapely
from shapely.geometry.base import BaseGeometry

from grebe.core.counts import counted
from grebe.core.errors import PlanError, RegionError
from grebe.core.frames import LocalFrame, frame_at
from grebe.core.sets import hull_of
from grebe.core.survey import Survey

# Water whose shore is everywhere within this distance of its convex hull counts as convex [m]:
# coordinates in degrees are rounded to 1e-7, about a centimetre.
CONVEXITY_M = 0.05
LARGEST_EXTENT_M = 200_000.0
HIGHEST_LATITUDE = 85.0


@dataclass(frozen=True, kw_only=True)
class Region:
    """Water to survey: a valid local polygon (x north, y east) and its frame."""

    name: str
    frame: LocalFrame
    water: shapely.Polygon

    @property
    def area_m2(self) -> float:
        """Area of the water."""
        return float(self.water.area)


def clean_region(geometry: BaseGeometry, name: str, features: Sequence[str] = ()) -> Region:
    """Turn a WGS 84 outline into a region. Raises `RegionError` with the reason when it is invalid.

    `features` names the choices for the error message when the outline has several waters.
    """
    coordinates = shapely.get_coordinates(geometry)
    if geometry.is_empty or len(coordinates) == 0:
        raise RegionError(f"The region {name!r} is empty: its polygon has no vertices.")
    _check_degrees(coordinates, name)
    _check_validity(geometry, name)
    merged = shapely.union_all(_parts(geometry))
    if isinstance(merged, shapely.MultiPolygon):
        raise RegionError(
            f"The region {name!r} consists of {len(merged.geoms)} separate waters; "
            "a boat cannot cross the land between them: "
            + (
                f"choose one by its name or number: {'; '.join(features)}."
                if len(features) > 1
                else "give one at a time."
            ),
            settings=("feature",) if len(features) > 1 else (),
        )
    frame = frame_at(merged)
    water = frame.geometry_to_local(merged)
    if not isinstance(water, shapely.Polygon) or not water.is_valid or water.area < 1.0:
        raise RegionError(f"The region {name!r} has an area of less than a square metre.")
    north0, east0, north1, east1 = water.bounds
    if max(north1 - north0, east1 - east0) > LARGEST_EXTENT_M:
        raise RegionError(
            f"The region {name!r} is {max(north1 - north0, east1 - east0) / 1000:.0f} km across; "
            "check its coordinates (Grebe surveys lakes of at most 200 km)."
        )
    return Region(name=name, frame=frame, water=shapely.normalize(water))


def _parts(geometry: BaseGeometry) -> list[BaseGeometry]:
    return list(getattr(geometry, "geoms", [geometry]))


def _check_degrees(coordinates: np.ndarray, name: str) -> None:
    if not np.all(np.isfinite(coordinates)):
        raise RegionError(f"The region {name!r} has a vertex that is not a number (NaN).")
    if np.ptp(coordinates[:, 0]) > 180 and np.abs(coordinates[:, 0]).max() <= 360:
        raise RegionError(
            f"The region {name!r} reaches from longitude {coordinates[:, 0].min():g} to "
            f"{coordinates[:, 0].max():g}: water on both sides of the 180th meridian cannot be "
            "planned as one; give each side by itself."
        )
    lon, lat = np.abs(coordinates[:, 0]).max(), np.abs(coordinates[:, 1]).max()
    if lon <= 180 and lat <= HIGHEST_LATITUDE:
        return
    worst = coordinates[np.argmax(np.abs(coordinates).max(axis=1))]
    given = f"({worst[0]:g}, {worst[1]:g})"
    if lon <= 180 and lat <= 90:
        raise RegionError(
            f"The region {name!r} has a latitude of {lat:g}; Grebe plans no water beyond "
            f"{HIGHEST_LATITUDE:g} degrees."
        )
    if lon <= 90 and lat <= 180:
        raise RegionError(
            f"The region {name!r} has a vertex {given}, a latitude of {lat:g}: latitude and "
            "longitude look swapped; GeoJSON wants longitude first."
        )
    raise RegionError(
        f"The region {name!r} has a vertex {given}, which is not a longitude and latitude: the "
        "coordinates look projected; name their CRS, or reproject them to WGS 84 (EPSG:4326).",
        settings=("crs",),
    )


def _check_validity(geometry: BaseGeometry, name: str) -> None:
    for part in _parts(geometry):
        if not part.is_valid:
            reason = shapely.is_valid_reason(part)
            raise RegionError(
                f"The region {name!r} is not a simple polygon ({reason}); repair its outline, "
                "for example with QGIS's 'Fix geometries'."
            )


def coarsened(region: Region, tolerance_m: float) -> tuple[Region, tuple[str, ...]]:
    """Return the region with a coast of fewer vertices within its water, and a note about it.

    Douglas and Peucker's simplification, to a third of the tolerance, moves the coast by no more
    than that to either side. The one exception is the point where a ring is closed, which GEOS
    judges by the segments that are left. The simplified polygon is therefore eroded by a third of
    the tolerance, or by two thirds if the closing point still leaves the water.
    """
    water = region.water
    third = tolerance_m / 3
    simplified = shapely.simplify(water, third)
    inside = (_largest(simplified.buffer(-share * third, join_style="mitre")) for share in (1, 2))
    largest = next((part for part in inside if part and shapely.covers(water, part)), None)
    if largest is None:
        return region, ()
    before, after = shapely.get_num_coordinates(water), shapely.get_num_coordinates(largest)
    given_up = 1 - largest.area / water.area
    note = (
        f"the outline was simplified from {before:,} to {after:,} vertices, towards the water "
        f"and by at most {tolerance_m:g} m; this gives up {given_up:.2%} of the area"
    )
    return replace(region, water=shapely.normalize(largest)), (note,)


def _largest(geometry: BaseGeometry) -> shapely.Polygon | None:
    parts = [part for part in _parts(geometry) if isinstance(part, shapely.Polygon)]
    return max((part for part in parts if part.area > 0), key=lambda part: part.area, default=None)


def navigable_water(
    region: Region,
    no_go: Sequence[shapely.Polygon],
    shore_margin_m: float,
    start: tuple[float, float] | None = None,
) -> tuple[shapely.Polygon, tuple[str, ...]]:
    """Return the water that the boat may use, and notes on what was left out.

    No-go zones and a margin along the shore are removed. If separate parts remain, the one with
    the start is used, or the largest. Raises `PlanError` when nothing is left.
    """
    water = _straightened(region.water)
    if no_go:
        water = water.difference(shapely.union_all(list(no_go)))
    if shore_margin_m > 0:
        water = water.buffer(-shore_margin_m, quad_segs=4)
    parts = [part for part in _parts(water) if isinstance(part, shapely.Polygon) and part.area > 0]
    if not parts:
        raise PlanError(
            f"Nothing of the region {region.name!r} is left: no-go zones and the shore margin of "
            f"{shore_margin_m:g} m take all of its {region.area_m2:.0f} m2."
        )
    parts.sort(key=lambda part: -part.area)
    if start is not None:
        place = shapely.Point(start)
        parts.sort(key=lambda part: not part.buffer(shore_margin_m).covers(place))
    left = sum(part.area for part in parts[1:])
    notes = (
        (
            f"{counted(len(parts) - 1, 'part')} of the water, {left:.0f} m2 in all, left out: it "
            "cannot be reached from the rest",
        )
        if left >= 1.0
        else ()
    )
    return shapely.normalize(parts[0]), notes


def water_of(survey: Survey) -> shapely.Polygon:
    """Return the water that a survey's boat may use: without no-go zones and shore margin."""
    region = Region(name=survey.name, frame=survey.frame, water=survey.water)
    margin_m = survey.settings.shore_margin_m if survey.settings else 0.0
    start = survey.start and (survey.start.north_m, survey.start.east_m)
    return navigable_water(region, survey.no_go, margin_m, start)[0]


def _straightened(water: shapely.Polygon) -> shapely.Polygon:
    """Return the convex hull if the water is convex except for the rounding of its vertices."""
    if water.interiors:
        return water
    hull = hull_of(water.exterior.coords)
    bay = shapely.hausdorff_distance(hull.exterior, water.exterior, densify=0.02)
    return hull if bay <= CONVEXITY_M else water
