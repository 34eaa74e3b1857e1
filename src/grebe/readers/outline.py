"""Read the outline of a region: GeoJSON, or the convex hull of a track.

What comes out is in WGS 84 degrees (longitude, latitude) and as it stands in the file;
`grebe.planning.region` judges and cleans it.
"""

from __future__ import annotations

import json
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
import shapely
from shapely.errors import ShapelyError
from shapely.geometry import shape
from shapely.geometry.base import BaseGeometry

from grebe.errors import InputError, RegionError
from grebe.readers.text import read_text
from grebe.readers.track import TrackColumns, read_track
from grebe.sets import hull_of

# GeoJSON is WGS 84 by its standard (RFC 7946); older files may still name a CRS.
WGS84_NAMES = ("CRS84", "EPSG::4326", "EPSG:4326")


@dataclass(frozen=True, kw_only=True)
class Outline:
    """A geometry in degrees, its name, and what the reader had to say about it."""

    geometry: BaseGeometry
    name: str
    notes: tuple[str, ...] = ()


def read_outline(
    path: Path, columns: TrackColumns | None = None, header_from: Path | None = None
) -> Outline:
    """Read a region from GeoJSON or, for a .csv, from the hull of a track (section 6.2)."""
    if path.suffix.lower() == ".csv":
        track = read_track(path, columns, header_from)
        return Outline(geometry=hull_of(track.lonlat), name=path.stem, notes=track.notes)
    if path.suffix.lower() in (".geojson", ".json"):
        return _read_geojson(path)
    if not path.exists():
        raise InputError(f"{path}: there is no such file.")
    raise InputError(
        f"{path}: cannot read a region from a {path.suffix or 'nameless'} file; "
        "give GeoJSON (.geojson, .json) or a track (.csv)."
    )


def _read_geojson(path: Path) -> Outline:
    try:
        document = json.loads(read_text(path))
    except (json.JSONDecodeError, RecursionError) as error:
        raise InputError(f"{path}: not valid JSON ({error}).") from None
    if not isinstance(document, dict):
        raise InputError(f"{path}: not GeoJSON: the file holds no object.")
    _refuse_other_crs(path, document)
    features = _features(document)
    geometries = [_geometry(path, feature) for feature in features]
    polygons = [g for g in geometries if isinstance(g, shapely.Polygon | shapely.MultiPolygon)]
    if not polygons:
        raise RegionError(f"{path}: holds no polygon; a region is a Polygon or MultiPolygon.")
    left_out = len(features) - len(polygons)
    notes = (f"{left_out} features that are not polygons were left out",) if left_out else ()
    geometry = polygons[0] if len(polygons) == 1 else shapely.GeometryCollection(polygons)
    return Outline(geometry=geometry, name=_name(document, features) or path.stem, notes=notes)


def _features(document: dict[str, Any]) -> list[dict[str, Any]]:
    if document.get("type") == "FeatureCollection":
        features = document.get("features")
        listed = features if isinstance(features, list) else []
        return [feature for feature in listed if isinstance(feature, dict)]
    return [document]


def _geometry(path: Path, feature: dict[str, Any]) -> BaseGeometry | None:
    body = feature.get("geometry") if feature.get("type") == "Feature" else feature
    if not isinstance(body, dict):
        return None
    try:
        # NaN is let through without numpy's warning: the region's own check names it.
        with np.errstate(invalid="ignore"):
            return shape(body)
    except (LookupError, TypeError, ValueError, AttributeError, ShapelyError) as error:
        raise RegionError(f"{path}: a geometry cannot be read ({error}).") from None


def _name(document: dict[str, Any], features: list[dict[str, Any]]) -> str:
    for candidate in (document, *(f.get("properties") for f in features)):
        if isinstance(candidate, dict) and isinstance(candidate.get("name"), str):
            return str(candidate["name"])
    return ""


def _refuse_other_crs(path: Path, document: dict[str, Any]) -> None:
    crs = document.get("crs")
    properties = crs.get("properties") if isinstance(crs, dict) else None
    name = str(properties.get("name", "")) if isinstance(properties, dict) else ""
    if name and not name.endswith(WGS84_NAMES):
        raise InputError(
            f"{path}: its coordinates are in {name}; reproject it to WGS 84 longitude and "
            "latitude (EPSG:4326), which is what GeoJSON means."
        )
