"""Islands drawn on top of a lake, and coordinates that a file does not name."""

from __future__ import annotations

import json
import warnings
from pathlib import Path

import numpy as np
import pyogrio
import pytest
import shapely
from conftest import square_survey
from pyproj import Transformer

from grebe.core.errors import InputError, RegionError
from grebe.io.readers.outline import read_outline
from grebe.planning.region import clean_region
from grebe.workflow.files import write_survey
from grebe.workflow.plans import read_region, read_zones

LAKE = shapely.box(8.0, 46.5, 8.004, 46.504)
ISLAND = shapely.box(8.0005, 46.5005, 8.001, 46.501)
SECOND = shapely.box(8.002, 46.502, 8.0025, 46.5025)
POND = shapely.box(8.0021, 46.5021, 8.0022, 46.5022)
UTM = Transformer.from_crs("EPSG:4326", "EPSG:32632", always_xy=True)


def placemark(name: str, polygon: shapely.Polygon) -> str:
    corners = " ".join(f"{lon},{lat},0" for lon, lat in polygon.exterior.coords)
    return (
        f"<Placemark><name>{name}</name><Polygon><outerBoundaryIs><LinearRing><coordinates>"
        f"{corners}</coordinates></LinearRing></outerBoundaryIs></Polygon></Placemark>"
    )


def kml(path: Path, *, folder: str, names: tuple[str, str] = ("Untitled", "Untitled")) -> Path:
    inner = placemark(names[0], ISLAND) + placemark(names[1], SECOND)
    path.write_text(
        '<?xml version="1.0" encoding="UTF-8"?><kml xmlns="http://www.opengis.net/kml/2.2">'
        f"<Document><Folder><name>My lake</name>{placemark('Shore', LAKE)}"
        f"<Folder><name>{folder}</name>{inner}</Folder></Folder></Document></kml>"
    )
    return path


def geojson(path: Path, polygons: dict[str, shapely.Geometry], crs: str | None = None) -> Path:
    document: dict[str, object] = {
        "type": "FeatureCollection",
        "features": [
            {
                "type": "Feature",
                "properties": {"name": name},
                "geometry": shapely.geometry.mapping(one),
            }
            for name, one in polygons.items()
        ],
    }
    if crs:
        document["crs"] = {"type": "name", "properties": {"name": crs}}
    path.write_text(json.dumps(document))
    return path


def in_metres(polygon: shapely.Polygon) -> shapely.Geometry:
    return shapely.transform(polygon, lambda p: np.column_stack(UTM.transform(p[:, 0], p[:, 1])))


@pytest.mark.parametrize("folder", ["Islands", "islets of the lake", "Inseln", "Îles"])
def test_a_folder_of_islands_is_land(tmp_path: Path, folder: str) -> None:
    outline = read_outline(kml(tmp_path / "lake.kml", folder=folder))
    water = clean_region(outline.geometry, outline.name).water
    assert len(water.interiors) == 2
    assert shapely.equals(outline.geometry, LAKE - ISLAND - SECOND)
    assert sum("is taken as an island" in note for note in outline.notes) == 2


def test_a_lake_that_is_chosen_by_name_keeps_its_islands(tmp_path: Path) -> None:
    outline = read_outline(kml(tmp_path / "lake.kml", folder="Islands"), feature="Shore")
    assert shapely.equals(outline.geometry, LAKE - ISLAND - SECOND)


def test_only_what_is_called_an_island_is_land_unless_all_are(tmp_path: Path) -> None:
    path = kml(tmp_path / "lake.kml", folder="More", names=("Gull Island", "Depth 5 m"))
    outline = read_outline(path)
    assert shapely.equals(shapely.union_all(outline.geometry), LAKE - ISLAND)
    assert [note for note in outline.notes if note.startswith("Depth 5 m lies within Shore and is")]
    every = read_outline(path, islands="all")
    assert shapely.equals(every.geometry, LAKE - ISLAND - SECOND)
    none = read_outline(path, islands="none")
    assert shapely.equals(shapely.union_all(none.geometry), LAKE)


def test_a_pond_on_an_island_is_no_island(tmp_path: Path) -> None:
    drawn = {"Lake": LAKE, "island": SECOND, "Pond": POND}
    outline = read_outline(geojson(tmp_path / "l.geojson", drawn), islands="all")
    assert shapely.equals(shapely.union_all(outline.geometry), (LAKE - SECOND) | POND)
    with pytest.raises(RegionError, match="2 separate waters"):
        clean_region(outline.geometry, outline.name, outline.features)


def test_an_island_that_stands_alone_is_not_lost(tmp_path: Path) -> None:
    outline = read_outline(geojson(tmp_path / "l.geojson", {"Long Island Pond": LAKE}))
    assert shapely.equals(outline.geometry, LAKE)


def test_many_islands_are_summed_up_in_one_note(tmp_path: Path) -> None:
    """Also beyond 200 polygons, from where on none had been looked for."""
    small = {
        f"Islet {k}": shapely.box(
            8.0001 + 1e-4 * (k % 20), 46.5001 + 1e-4 * (k // 20),
            8.00015 + 1e-4 * (k % 20), 46.50015 + 1e-4 * (k // 20),
        )
        for k in range(260)
    }  # fmt: skip
    outline = read_outline(geojson(tmp_path / "l.geojson", {"Lake": LAKE, **small}))
    assert len(outline.geometry.interiors) == 260
    assert outline.notes == (
        "Islet 0 lies within Lake and is taken as an island; so are 259 others",
    )


def test_a_survey_file_is_no_outline(tmp_path: Path) -> None:
    """Its cells would be the water, and its no-go zones too."""
    write_survey(tmp_path / "s.gpkg", square_survey())
    with pytest.raises(InputError, match="is a survey file"):
        read_outline(tmp_path / "s.gpkg")


def test_zones_within_a_zone_open_nothing(tmp_path: Path) -> None:
    region = clean_region(LAKE, "lake")
    path = geojson(tmp_path / "z.geojson", {"Reserve": SECOND, "island": POND})
    zones, notes = read_zones([path], region)
    assert shapely.union_all(zones).area == pytest.approx(
        region.frame.geometry_to_local(SECOND).area
    )
    assert notes == ()


def test_zones_in_metres_are_refused_for_what_they_are(tmp_path: Path) -> None:
    path = geojson(tmp_path / "z.geojson", {"zone": in_metres(SECOND)})
    with pytest.raises(InputError, match="no longitudes and latitudes"):
        read_zones([path], clean_region(LAKE, "lake"))


def shapefile_without_prj(path: Path, polygon: shapely.Geometry) -> Path:
    wkb = np.array([shapely.to_wkb(polygon)], dtype=object)
    with warnings.catch_warnings():
        warnings.simplefilter("ignore")
        pyogrio.raw.write(path, wkb, [], [], geometry_type="Polygon", driver="ESRI Shapefile")
    path.with_suffix(".prj").unlink(missing_ok=True)
    return path


@pytest.mark.parametrize("kind", ["geojson", "shapefile"])
def test_a_named_crs_is_that_of_all_files_of_a_plan_that_do_not_name_their_own(
    tmp_path: Path, kind: str
) -> None:
    """The lake may be in degrees and the zones in metres, or the reverse."""
    if kind == "geojson":
        metres = geojson(tmp_path / "m.geojson", {"zone": in_metres(SECOND)})
    else:
        metres = shapefile_without_prj(tmp_path / "m.shp", in_metres(SECOND))
    degrees = geojson(tmp_path / "d.geojson", {"zone": SECOND})
    lake = geojson(tmp_path / "lake.geojson", {"lake": LAKE})
    region, _ = read_region(lake, crs="EPSG:32632", is_crs_of_others=True)
    expected = region.frame.geometry_to_local(SECOND)
    for path in (metres, degrees):
        zones, notes = read_zones([path], region, crs="EPSG:32632")
        assert shapely.hausdorff_distance(shapely.union_all(zones), expected) < 1e-3
        assert notes == ()
    with pytest.raises(InputError) as refused:
        read_zones([metres], region)
    assert refused.value.settings == ("crs",)


@pytest.mark.parametrize("name", ["urn:ogc:def:crs:EPSG::32632", "EPSG:32632"])
def test_a_geojson_in_metres_that_says_so_is_read(tmp_path: Path, name: str) -> None:
    outline = read_outline(geojson(tmp_path / "l.geojson", {"Lake": in_metres(LAKE)}, name))
    assert shapely.hausdorff_distance(outline.geometry, LAKE) < 1e-8


def test_coordinates_that_a_file_does_not_name_can_be_named(tmp_path: Path) -> None:
    path = geojson(tmp_path / "l.geojson", {"Lake": in_metres(LAKE)})
    with pytest.raises(RegionError, match="name their CRS"):
        clean_region(read_outline(path).geometry, "lake")
    outline = read_outline(path, crs="EPSG:32632")
    assert shapely.hausdorff_distance(outline.geometry, LAKE) < 1e-8
    with pytest.raises(InputError, match="There is no CRS 'EPSG:1'"):
        read_outline(path, crs="EPSG:1")


def test_a_file_that_names_its_coordinates_is_not_contradicted(tmp_path: Path) -> None:
    path = geojson(tmp_path / "l.geojson", {"Lake": in_metres(LAKE)}, "EPSG:32632")
    assert read_outline(path, crs="EPSG:32632").name == "Lake"
    with pytest.raises(InputError, match="as it says itself"):
        read_outline(path, crs="EPSG:25833")
