"""WGS 84 and the local north-east frame: the only place where axes are swapped.

Outside, a position is (longitude, latitude) in degrees, as GeoJSON writes it. Inside, it
is (north, east) in metres on a transverse Mercator plane that touches the ellipsoid at
the frame's origin with scale 1; 10 km from the origin its scale is off by about 1e-6.
Local shapely geometries therefore carry north in `x` and east in `y`, as the paper's
Eq. (9) does, and a picture plots east against north.
"""

from __future__ import annotations

import math
from dataclasses import dataclass
from functools import cached_property
from typing import TYPE_CHECKING, TypeVar

import numpy as np
import shapely

from grebe.core.errors import InputError

if TYPE_CHECKING:
    from numpy.typing import ArrayLike, NDArray
    from pyproj import Transformer
    from shapely.geometry.base import BaseGeometry

    Geometries = TypeVar("Geometries", BaseGeometry, NDArray[np.object_])

WGS84 = "EPSG:4326"
# A place farther than this from the water is taken for a mistake.
FARTHEST_PLACE_M = 5000.0


@dataclass(frozen=True, kw_only=True)
class LocalFrame:
    """Tangent plane at an origin in WGS 84.

    `origin_lon_deg` in [-180, 180], `origin_lat_deg` in [-89, 89]; `InputError` otherwise.
    """

    origin_lon_deg: float
    origin_lat_deg: float

    def __post_init__(self) -> None:
        lon, lat = self.origin_lon_deg, self.origin_lat_deg
        if not (math.isfinite(lon) and math.isfinite(lat)):
            raise InputError(f"The frame's origin ({lon}, {lat}) is not a pair of finite degrees.")
        if abs(lon) > 180 or abs(lat) > 89:
            raise InputError(
                f"The frame's origin ({lon}, {lat}) is not a longitude and latitude in degrees; "
                "longitudes lie within 180 and latitudes within 89."
            )

    @property
    def definition(self) -> str:
        """PROJ string of the plane (easting first, as in PROJ)."""
        return (
            f"+proj=tmerc +lat_0={self.origin_lat_deg!r} +lon_0={self.origin_lon_deg!r} "
            "+k=1 +x_0=0 +y_0=0 +datum=WGS84 +units=m +no_defs"
        )

    @cached_property
    def _transformer(self) -> Transformer:
        from pyproj import Transformer

        return Transformer.from_crs(WGS84, self.definition, always_xy=True)

    def to_local(self, lonlat: ArrayLike) -> NDArray[np.float64]:
        """Convert (..., 2) degrees (lon, lat) to (..., 2) metres (north, east)."""
        points = np.asarray(lonlat, dtype=float)
        east, north = self._transformer.transform(points[..., 0], points[..., 1])
        return np.stack([north, east], axis=-1)

    def to_wgs84(self, north_east: ArrayLike) -> NDArray[np.float64]:
        """Convert (..., 2) metres (north, east) to (..., 2) degrees (lon, lat)."""
        points = np.asarray(north_east, dtype=float)
        lon, lat = self._transformer.transform(points[..., 1], points[..., 0], direction="INVERSE")
        return np.stack([lon, lat], axis=-1)

    def place_near(
        self, water: BaseGeometry, lonlat: tuple[float, float], what: str
    ) -> tuple[float, float]:
        """Convert a place in degrees (lon, lat) to (north, east) [m].

        Raises `InputError` if it is too far from the water; `what` names the place in the message.
        """
        north, east = self.to_local(lonlat).tolist()
        away = water.distance(shapely.Point(north, east))
        if not away <= FARTHEST_PLACE_M:
            raise InputError(
                f"The {what} {lonlat[0]:g},{lonlat[1]:g} lies {away / 1000:.1f} km from the water; "
                "give LON,LAT in degrees, longitude first."
            )
        return north, east

    def geometry_to_local(self, geometry: Geometries) -> Geometries:
        """Convert one geometry or an array from degrees (lon, lat) to metres (north, east)."""
        return shapely.transform(geometry, self.to_local)

    def geometry_to_wgs84(self, geometry: Geometries) -> Geometries:
        """Convert one geometry or an array from metres (north, east) to degrees (lon, lat)."""
        return shapely.transform(geometry, self.to_wgs84)


def frame_at(geometry: BaseGeometry) -> LocalFrame:
    """Return the frame with its origin at the centre of a WGS 84 geometry's bounds."""
    west, south, east, north = geometry.bounds
    return LocalFrame(
        origin_lon_deg=round((west + east) / 2, 7), origin_lat_deg=round((south + north) / 2, 7)
    )
