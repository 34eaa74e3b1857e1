"""Read the outline of a region: vector files of many kinds, or the convex hull of a track.

The result is in WGS 84 degrees (longitude, latitude) and otherwise as in the file;
`grebe.planning.region` judges and cleans it.
"""

from __future__ import annotations

import json
from collections.abc import Callable
from dataclasses import dataclass, replace
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
from grebe.io.readers.islands import Drawn, Islands, called_island, without_islands
from grebe.io.readers.text import read_text
from grebe.io.readers.untrusted import check_size, check_xml, unpacked

if TYPE_CHECKING:
    from grebe.io.readers.track import TrackColumns

# GeoJSON is WGS 84 by its standard (RFC 7946); older files may still name a CRS.
WGS84_NAMES = ("CRS84", "EPSG::4326", "EPSG:4326")
VECTOR_SUFFIXES = (".kml", ".kmz", ".gpx", ".shp", ".zip", ".gpkg")
# A GeoPackage with all of these layers is a survey.
OF_A_SURVEY = frozenset({"region", "targets", "cells", "corridors"})
# Numbers no greater than this, of either sign, are degrees, and not metres of a projection.
DEGREES = 360.0
# Deeper than any outline is nested, but far from where a parser would run out of stack.
DEEPEST_JSON = 60


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
    islands: Islands = "named",
    crs: str | None = None,
) -> Outline:
    """Read a region from a vector file, or, for a .csv, from the hull of a track (section 6.2).

    Vector files are GeoJSON, KML, KMZ, GPX, a Shapefile (zipped too) or a GeoPackage. `islands`
    says which polygons within another one are cut out of it; `crs` names the coordinates of a file
    that does not, such as EPSG:25832. Hostile files are refused unread.
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
        found, name = _read_geojson(path, crs)
        return _outline(path, found, name, feature, islands)
    if suffix in VECTOR_SUFFIXES:
        with unpacked(path) as inner:
            if inner.suffix.lower() in (".kml", ".gpx"):
                check_xml(inner)
            return _outline(path, _read_vector(path, inner, crs), path.stem, feature, islands)
    raise InputError(
        f"{path}: cannot read a region from a {path.suffix or 'nameless'} file; give GeoJSON, "
        "KML, KMZ, GPX, a Shapefile, a GeoPackage, or a track (.csv)."
    )


def in_degrees(geometry: BaseGeometry) -> bool:
    """Whether all of a geometry's coordinates can be longitudes and latitudes."""
    west, south, east, north = shapely.bounds(geometry).tolist()
    return -360 <= west <= east <= 360 and -90 <= south <= north <= 90


def in_own_or(read: Callable[..., Outline], crs: str | None) -> Outline:
    """Read an outline in the coordinates that its file names, or in degrees, or else in `crs`.

    `read` is `read_outline` with all but its `crs`. Several files of one plan may share a `crs`
    although some of them do not need it.
    """
    try:
        outline = read()
    except InputError as error:
        if crs is None or "crs" not in error.settings:
            raise
        return read(crs=crs)
    return outline if crs is None or in_degrees(outline.geometry) else read(crs=crs)


def _read_geojson(path: Path, crs: str | None) -> tuple[list[Drawn], str]:
    """Return what a GeoJSON holds, and its name."""
    text = read_text(path)
    _check_depth(path, text)
    try:
        document = json.loads(text)
    except (json.JSONDecodeError, RecursionError) as error:
        raise InputError(f"{path}: not valid JSON ({error}).") from None
    if not isinstance(document, dict):
        raise InputError(f"{path}: not GeoJSON: the file holds no object.")
    declared = _declared_crs(document)
    features = _features(document)
    found = [
        Drawn(
            geometry=_geometry(path, one),
            name=feature_name(one.get("properties")),
            is_island=called_island("", one.get("properties")),
        )
        for one in features
    ]
    if declared or crs:
        to_degrees = _to_degrees(path, declared, crs)
        found = [
            one if one.geometry is None else replace(one, geometry=to_degrees(one.geometry))
            for one in found
        ]
    return found, _name(document, features)


def _check_depth(path: Path, text: str) -> None:
    depth = 0
    for character in text:
        if character in "[{":
            depth += 1
            if depth > DEEPEST_JSON:
                raise InputError(f"{path}: nested more than {DEEPEST_JSON} deep, as no outline is.")
        elif character in "]}":
            depth -= 1


def _outline(
    path: Path, found: list[Drawn], name: str, wanted: str | None, islands: Islands
) -> Outline:
    """Keep the polygons and closed lines, or only the one wanted; note what was left out."""
    areas = [
        replace(one, geometry=area)
        for one in found
        if (area := _polygonal(one.geometry)) is not None
    ]
    if not areas:
        raise RegionError(
            f"{path}: holds no polygon; a region is a Polygon or MultiPolygon{_open_line(found)}."
        )
    left_out = len(found) - len(areas)
    said = f"{counted(left_out, 'feature without', 'features without')} a polygon: left out"
    notes = [said] if left_out else []
    areas, on_islands = without_islands(areas, islands)
    polygons = [one.geometry for one in areas if one.geometry is not None]
    listed = tuple(
        feature_text(i, area, one.name)
        for i, (area, one) in enumerate(zip(polygons, areas, strict=True), start=1)
    )
    if wanted is not None:
        k = chosen(path, [one.name for one in areas], wanted, listed)
        own = areas[k].name or f"{name or path.stem} {wanted}"
        return Outline(geometry=polygons[k], name=own, notes=tuple(on_islands))
    geometry = polygons[0] if len(polygons) == 1 else shapely.GeometryCollection(polygons)
    if len(areas) > 1 and name in {one.name for one in areas}:
        # A lake has the name of its largest polygon, not of an island that comes before it.
        name = areas[int(np.argmax(shapely.area(polygons)))].name
    return Outline(
        geometry=geometry,
        name=name or path.stem,
        notes=(*notes, *on_islands),
        features=listed,
    )


def _open_line(found: list[Drawn]) -> str:
    """Return the end of an error message for a line that might have been meant as an outline."""
    kinds = shapely.LineString | shapely.MultiLineString
    lines = any(isinstance(one.geometry, kinds) for one in found)
    return ", or a line that ends where it begins; the lines in this file do not" if lines else ""


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


def _read_vector(path: Path, inner: Path, crs: str | None) -> list[Drawn]:
    """Read every layer that holds areas, in whatever CRS it declares (GDAL, by pyogrio)."""
    import pyogrio
    from pyogrio.errors import DataLayerError, DataSourceError

    try:
        layers = [str(name) for name in pyogrio.list_layers(inner)[:, 0]]
        if set(layers) >= OF_A_SURVEY:
            raise InputError(
                f"{path}: is a survey file, whose layers are cells, tracks and zones beside its "
                "water; give the outline from which it was planned."
            )
        return [one for layer in layers for one in _layer(path, inner, layer, crs)]
    except (DataSourceError, DataLayerError, ValueError, ShapelyError) as error:
        text = " ".join(str(error).split())[:160]
        raise InputError(f"{path}: cannot be read as {path.suffix[1:].upper()} ({text}).") from None


def _layer(path: Path, inner: Path, layer: str, crs: str | None) -> list[Drawn]:
    from pyogrio.raw import read

    meta, _, blobs, values = read(inner, layer=layer, force_2d=True)
    if blobs is None or len(blobs) == 0:
        return []
    keys = [str(key) for key in meta["fields"]]
    rows = [dict(zip(keys, row, strict=True)) for row in zip(*values, strict=True)]
    rows = rows or [{}] * len(blobs)
    geometries = shapely.from_wkb(blobs, on_invalid="ignore")
    declared = meta.get("crs")
    if not declared and not crs:
        raise InputError(
            f"{path}: does not say which coordinates it uses; add its .prj file or name its CRS.",
            settings=("crs",),
        )
    to_degrees = _to_degrees(path, declared, crs)
    return [
        Drawn(
            geometry=to_degrees(geometry),
            name=feature_name(row),
            is_island=called_island(layer, row),
        )
        for geometry, row in zip(geometries, rows, strict=True)
        if geometry is not None
    ]


def _to_degrees(
    path: Path, declared: str | None, given: str | None
) -> Callable[[BaseGeometry], BaseGeometry]:
    """Return a function from the CRS that a file declares, or else the one given, to WGS 84."""
    from pyproj import CRS, Transformer
    from pyproj.exceptions import CRSError

    try:
        crs = CRS.from_user_input(declared or given)
    except CRSError:
        if declared:
            raise InputError(f"{path}: declares an unknown CRS ({declared[:80]}).") from None
        raise InputError(f"There is no CRS {given!r}.", settings=("crs",)) from None
    if declared and given and not crs.equals(CRS.from_user_input(given), ignore_axis_order=True):
        raise InputError(
            f"{path}: its coordinates are in {crs.name}, as it says itself, and not in {given}.",
            settings=("crs",),
        )
    transformer = Transformer.from_crs(crs, "EPSG:4326", always_xy=True)

    def moved(points: Any) -> Any:
        if crs.is_projected and len(points) and np.abs(points).max() <= DEGREES:
            raise InputError(
                f"{path}: its coordinates are said to be in {crs.name}, but look like degrees."
            )
        return np.column_stack(transformer.transform(points[:, 0], points[:, 1]))

    return lambda geometry: shapely.transform(geometry, moved)


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


def _declared_crs(document: dict[str, Any]) -> str | None:
    """Return the CRS that a GeoJSON names, as programs older than its standard do; None for
    WGS 84.
    """
    crs = document.get("crs")
    properties = crs.get("properties") if isinstance(crs, dict) else None
    name = str(properties.get("name", "")) if isinstance(properties, dict) else ""
    return name if name and not name.endswith(WGS84_NAMES) else None
