"""Lakes as people draw them: collections, separate islands, open lines, another grid."""

from __future__ import annotations

import json
from pathlib import Path

import pytest
import shapely

from grebe.core.errors import RegionError
from grebe.io.readers.outline import read_outline
from grebe.planning.region import clean_region

LAKE, ISLAND = shapely.box(8.0, 46.5, 8.002, 46.502), shapely.box(8.0005, 46.5005, 8.001, 46.501)
RAMP = shapely.Point(8.0, 46.5)


def drawn(path: Path, *geometries: object) -> Path:
    """Write some geometries to a GeoJSON file."""
    features = [
        {"type": "Feature", "properties": {"name": "Lake"}, "geometry": shapely.geometry.mapping(g)}
        for g in geometries
    ]
    path.write_text(json.dumps({"type": "FeatureCollection", "features": features}))
    return path


@pytest.fixture
def path(tmp_path: Path) -> Path:
    return tmp_path / "lake.geojson"


def test_of_a_collection_the_polygons_count(path: Path) -> None:
    outline = read_outline(drawn(path, shapely.GeometryCollection([LAKE, RAMP])))
    assert shapely.equals(outline.geometry, LAKE)


def test_a_kml_of_a_polygon_and_its_label_is_a_lake(tmp_path: Path) -> None:
    places = " ".join(f"{lon},{lat},0" for lon, lat in LAKE.exterior.coords)
    path = tmp_path / "lake.kml"
    path.write_text(
        '<?xml version="1.0" encoding="UTF-8"?><kml xmlns="http://www.opengis.net/kml/2.2">'
        "<Placemark><name>Lake</name><MultiGeometry><Point><coordinates>8,46.5</coordinates>"
        "</Point><Polygon><outerBoundaryIs><LinearRing><coordinates>"
        f"{places}</coordinates></LinearRing></outerBoundaryIs></Polygon></MultiGeometry>"
        "</Placemark></kml>"
    )
    assert shapely.equals(read_outline(path).geometry, LAKE)


@pytest.mark.parametrize("kind", [shapely.GeometryCollection, shapely.MultiPolygon])
def test_an_island_within_the_same_feature_is_reported(path: Path, kind: type) -> None:
    outline = read_outline(drawn(path, kind([LAKE, ISLAND])))
    assert [n for n in outline.notes if n.startswith("polygon 2 lies within polygon 1")]
    assert not read_outline(drawn(path, LAKE)).notes


def test_a_line_that_stays_open_is_refused_with_its_reason(path: Path) -> None:
    corners = list(LAKE.exterior.coords)
    with pytest.raises(RegionError, match="a line that ends where it begins"):
        read_outline(drawn(path, shapely.LineString(corners[:-1])))
    assert shapely.equals(read_outline(drawn(path, shapely.LineString(corners))).geometry, LAKE)


def test_metres_are_not_taken_for_the_180th_meridian() -> None:
    with pytest.raises(RegionError, match="the coordinates look projected"):
        clean_region(shapely.box(890_541, 5_860_000, 890_759, 5_860_200), "mercator")
    with pytest.raises(RegionError, match="both sides of the 180th meridian"):
        clean_region(shapely.box(-179.999, -16.5, 179.999, -16.4), "dateline")
