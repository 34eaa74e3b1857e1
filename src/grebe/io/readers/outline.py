"""Read the outline of a region: vector files of many kinds, or the convex hull of a track.

The result is in WGS 84 degrees (longitude, latitude) and otherwise as in the file;
`grebe.planning.region` judges and cleans it.
"""

from __future__ import annotations

import json
from collections.abc import Iterator
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np
import shapely
from shapely.errors import ShapelyError
from shapely.geometry import shape
from shapely.geometry.base import BaseGeometry

from grebe.core.counts import counted
from grebe.core.errors import InputError, RegionError
from grebe.core.sets import hull_of
from grebe.io.readers.features import chosen, feature_name, feature_text
from grebe.io.readers.text import read_text
from grebe.io.readers.untrusted import check_size, check_xml, unpacked

if TYPE_CHECKING:
    from grebe.io.readers.track import TrackColumns

# GeoJSON is WGS 84 by its standard (RFC 7946); older files may still name a CRS.
WGS84_NAMES = ("CRS84", "EPSG::4326", "EPSG:4326")
VECTOR_SUFFIXES = (".kml", ".kmz", ".gpx", ".shp", ".zip", ".gpkg")
# Deeper than any outline is nested, but far from where a parser would run out of stack.
DEEPEST_JSON = 60
# The most polygons of a file that are compared with each other, to find one within another.
MOST_COMPARED = 200


@dataclass(frozen=True, kw_only=True)
class Outline:
    """A geometry in degrees, its name, the reader's notes, and the features of the file."""

    geometry: BaseGeometry
    name: str
    notes: tuple[str, ...] = ()
    features: tuple[str, ...] = ()


def read_outline(
    path: Path,
    columns: TrackColumns | None = None,
    header_from: Path | None = None,
    *,
    feature: str | None = None,
) -> Outline:
    """Read a region from a vector file, or, for a .csv, from the hull of a track (section 6.2).

    Vector files are GeoJSON, KML, KMZ, GPX, a Shapefile (zipped too) or a GeoPackage. Hostile files
    are refused unread.
    """
    suffix = path.suffix.lower()
    if suffix == ".csv":
        from grebe.io.readers.track import read_track

        track = read_track(path, columns, header_from)
        return Outline(geometry=hull_of(track.lonlat), name=path.stem, notes=track.notes)
    if not path.exists():
        raise InputError(f"{path}: there is no such file.")
    check_size(path)
    if suffix in (".geojson", ".json"):
        return _read_geojson(path, feature)
    if suffix in VECTOR_SUFFIXES:
        with unpacked(path) as inner:
            if inner.suffix.lower() in (".kml", ".gpx"):
                check_xml(inner)
            return _read_vector(path, inner, feature)
    raise InputError(
        f"{path}: cannot read a region from a {path.suffix or 'nameless'} file; give GeoJSON, "
        "KML, KMZ, GPX, a Shapefile, a GeoPackage, or a track (.csv)."
    )


def _read_geojson(path: Path, wanted: str | None) -> Outline:
    text = read_text(path)
    _check_depth(path, text)
    try:
        document = json.loads(text)
    except (json.JSONDecodeError, RecursionError) as error:
        raise InputError(f"{path}: not valid JSON ({error}).") from None
    if not isinstance(document, dict):
        raise InputError(f"{path}: not GeoJSON: the file holds no object.")
    _refuse_other_crs(path, document)
    features = _features(document)
    found = [(_geometry(path, one), feature_name(one.get("properties"))) for one in features]
    return _outline(path, found, _name(document, features), wanted)


def _check_depth(path: Path, text: str) -> None:
    depth = 0
    for character in text:
        if character in "[{":
            depth += 1
            if depth > DEEPEST_JSON:
                raise InputError(f"{path}: nested more than {DEEPEST_JSON} deep, as no outline is.")
        elif character in "]}":
            depth -= 1


def _outline(path: Path, found: list[tuple[Any, str]], name: str, wanted: str | None) -> Outline:
    """Keep the polygons and closed lines, or only the one wanted; note what was left out."""
    areas = [(area, own) for g, own in found if (area := _polygonal(g)) is not None]
    listed = tuple(feature_text(i, *one) for i, one in enumerate(areas, start=1))
    if wanted is not None and areas:
        area, own = areas[chosen(path, [own for _, own in areas], wanted, listed)]
        return Outline(geometry=area, name=own or f"{name or path.stem} {wanted}")
    geometries, polygons = found, [area for area, _ in areas]
    if not polygons:
        raise RegionError(
            f"{path}: holds no polygon; a region is a Polygon or MultiPolygon{_open_line(found)}."
        )
    left_out = len(geometries) - len(polygons)
    said = f"{counted(left_out, 'feature without', 'features without')} a polygon: left out"
    notes = (said,) if left_out else ()
    notes += tuple(_within_others(areas))
    geometry = polygons[0] if len(polygons) == 1 else shapely.GeometryCollection(polygons)
    if len(areas) > 1 and name in {own for _, own in areas}:
        # A lake has the name of its largest polygon, not of an island that comes before it.
        name = max(areas, key=lambda one: one[0].area)[1]
    return Outline(geometry=geometry, name=name or path.stem, notes=notes, features=listed)


def _open_line(found: list[tuple[Any, str]]) -> str:
    """Return the end of an error message for a line that might have been meant as an outline."""
    lines = any(isinstance(one, shapely.LineString | shapely.MultiLineString) for one, _ in found)
    return ", or a line that ends where it begins; the lines in this file do not" if lines else ""


def _within_others(areas: list[tuple[BaseGeometry, str]]) -> Iterator[str]:
    """Yield notes on polygons within another.

    An island that is drawn as a separate polygon makes no hole in the lake.
    """
    parts = [(part, own) for area, own in areas for part in shapely.get_parts(area).tolist()]
    if len(parts) > MOST_COMPARED or not all(part.is_valid for part, _ in parts):
        return
    for i, (one, own) in enumerate(parts):
        for j, (other, name) in enumerate(parts):
            if i != j and shapely.within(one, other) and not shapely.equals(one, other):
                # Parts of one feature have one name.
                inner = f"polygon {i + 1}" if own in {"", name} else own
                outer = f"polygon {j + 1}" if name in {"", own} else name
                yield (
                    f"{inner} lies within {outer} and is taken as water: if it is an island, cut "
                    "it out of the outline, or give it as a no-go zone in a separate file"
                )
                break


def _polygonal(geometry: Any) -> BaseGeometry | None:
    if isinstance(geometry, shapely.Polygon | shapely.MultiPolygon):
        return geometry
    if isinstance(geometry, shapely.GeometryCollection):
        # For example KML's MultiGeometry, in which a label's point accompanies a lake.
        areas = [area for one in geometry.geoms if (area := _polygonal(one)) is not None]
        parts = [part for area in areas for part in shapely.get_parts(area)]
        return None if not parts else parts[0] if len(parts) == 1 else shapely.MultiPolygon(parts)
    lines = getattr(geometry, "geoms", [geometry])
    rings = [
        shapely.Polygon(line.coords)
        for line in lines
        if isinstance(line, shapely.LineString) and line.is_closed and len(line.coords) > 3
    ]
    if not rings or len(rings) != len(lines):
        return None
    return rings[0] if len(rings) == 1 else shapely.MultiPolygon(rings)


def _read_vector(path: Path, inner: Path, wanted: str | None) -> Outline:
    """Read every layer that holds areas, in whatever CRS it declares (GDAL, by pyogrio)."""
    import pyogrio
    from pyogrio.errors import DataLayerError, DataSourceError

    try:
        layers = [str(name) for name in pyogrio.list_layers(inner)[:, 0]]
        found = [one for layer in layers for one in _layer(path, inner, layer)]
    except (DataSourceError, DataLayerError, ValueError, ShapelyError) as error:
        text = " ".join(str(error).split())[:160]
        raise InputError(f"{path}: cannot be read as {path.suffix[1:].upper()} ({text}).") from None
    return _outline(path, found, path.stem, wanted)


def _layer(path: Path, inner: Path, layer: str) -> list[tuple[BaseGeometry, str]]:
    from pyogrio.raw import read
    from pyproj import Transformer
    from pyproj.exceptions import CRSError

    meta, _, blobs, values = read(inner, layer=layer, force_2d=True)
    if blobs is None or len(blobs) == 0:
        return []
    keys = [str(key) for key in meta["fields"]]
    names = [feature_name(dict(zip(keys, row, strict=True))) for row in zip(*values, strict=True)]
    names = names or [""] * len(blobs)
    geometries = shapely.from_wkb(blobs, on_invalid="ignore")
    crs = meta.get("crs")
    if not crs:
        raise InputError(
            f"{path}: does not say which coordinates it uses; add its .prj file or set its CRS."
        )
    try:
        transformer = Transformer.from_crs(crs, "EPSG:4326", always_xy=True)
    except CRSError:
        raise InputError(f"{path}: declares an unknown CRS ({crs[:80]}).") from None

    def to_degrees(points: Any) -> Any:
        return np.column_stack(transformer.transform(points[:, 0], points[:, 1]))

    return [
        (shapely.transform(geometry, to_degrees), name)
        for geometry, name in zip(geometries, names, strict=True)
        if geometry is not None
    ]


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
        # NaN passes without numpy's warning: the region's own check reports it.
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
