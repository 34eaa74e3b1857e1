"""Outlines from other people's files, and files that are made to do harm."""

import resource
import time
import zipfile

import numpy as np
import pyogrio
import pytest
import shapely

from grebe.core.errors import InputError, RegionError
from grebe.io.readers import untrusted
from grebe.io.readers.outline import read_outline

LAKE = shapely.Polygon(
    [(3.17, 50.63), (3.18, 50.63), (3.18, 50.64), (3.17, 50.64)],
    [[(3.174, 50.634), (3.176, 50.634), (3.176, 50.636), (3.174, 50.636)]],
)


def write(path, geometry=LAKE, crs="EPSG:4326", **more):
    kind = geometry.geom_type
    if path.suffix == ".kml":
        more["driver"] = "KML"
    pyogrio.raw.write(
        path, shapely.to_wkb(np.array([geometry], dtype=object)), [], [], geometry_type=kind,
        crs=crs, **more,
    )  # fmt: skip
    return path


@pytest.mark.parametrize("name", ["l.kml", "l.gpkg", "l.shp"])
def test_what_gdal_writes_is_read_back(tmp_path, name):
    outline = read_outline(write(tmp_path / name))
    assert outline.geometry.equals_exact(LAKE, 1e-6) or outline.geometry.equals(LAKE)


def test_another_crs_is_reprojected(tmp_path):
    from pyproj import Transformer

    to_utm = Transformer.from_crs("EPSG:4326", "EPSG:32631", always_xy=True)
    utm = shapely.transform(LAKE, lambda xy: np.column_stack(to_utm.transform(xy[:, 0], xy[:, 1])))
    outline = read_outline(write(tmp_path / "utm.gpkg", utm, "EPSG:32631"))
    assert shapely.hausdorff_distance(outline.geometry, LAKE) < 1e-8


def test_a_shapefile_without_its_prj_is_refused(tmp_path):
    path = write(tmp_path / "l.shp")
    path.with_suffix(".prj").unlink()
    with pytest.raises(InputError, match=r"\.prj"):
        read_outline(path)


def test_kmz_and_zipped_shapefiles_are_unpacked(tmp_path):
    kml = write(tmp_path / "doc.kml")
    with zipfile.ZipFile(tmp_path / "l.kmz", "w") as archive:
        archive.write(kml, "doc.kml")
    shp = write(tmp_path / "s.shp")
    with zipfile.ZipFile(tmp_path / "s.zip", "w") as archive:
        for part in tmp_path.glob("s.*"):
            if part.suffix in (".shp", ".shx", ".dbf", ".prj"):
                archive.write(part, f"folder/{part.name}")
    for name in ("l.kmz", "s.zip"):
        assert read_outline(tmp_path / name).geometry.area == pytest.approx(LAKE.area)
    assert shp.exists()


GPX = """<?xml version="1.0"?><gpx version="1.1" creator="x" xmlns="http://www.topografix.com/GPX/1/1">
<trk><trkseg>{}</trkseg></trk></gpx>"""


def test_a_closed_gpx_track_is_an_outline_and_an_open_one_is_not(tmp_path):
    points = [f'<trkpt lon="{x}" lat="{y}"/>' for x, y in LAKE.exterior.coords]
    path = tmp_path / "l.gpx"
    path.write_text(GPX.format("".join(points)))
    outline = read_outline(path)
    assert outline.geometry.equals(shapely.Polygon(LAKE.exterior))
    path.write_text(GPX.format("".join(points[:-1])))
    with pytest.raises(RegionError, match="no polygon"):
        read_outline(path)


def laughs(path):
    entities = '<!ENTITY a "ha">' + "".join(
        f'<!ENTITY {chr(98 + i)} "{f"&{chr(97 + i)};" * 10}">' for i in range(9)
    )
    path.write_text(f'<?xml version="1.0"?><!DOCTYPE kml [{entities}]><kml>&j;</kml>')


def outside_entity(path):
    path.write_text('<!DOCTYPE kml [<!ENTITY x SYSTEM "file:///etc/hostname">]><kml>&x;</kml>')


def deep_xml(path):
    path.write_text("<a>" * 100_000 + "</a>" * 100_000)


def cut_xml(path):
    path.write_text("<kml><Document><Placemark>")


def deep_json(path):
    path.write_text('{"a":' + "[" * 100_000 + "]" * 100_000 + "}")


def zip_bomb(path):
    with zipfile.ZipFile(path, "w", zipfile.ZIP_DEFLATED) as archive:
        archive.writestr("doc.kml", b"\0" * 150_000_000)


def many_members(path):
    with zipfile.ZipFile(path, "w") as archive:
        for i in range(1_500):
            archive.writestr(f"{i}.txt", "")


def not_a_zip(path):
    path.write_bytes(b"PK\x03\x04 not really")


def no_outline(path):
    with zipfile.ZipFile(path, "w") as archive:
        archive.writestr("readme.txt", "no lake here")


def huge(path):
    with path.open("wb") as file:
        file.truncate(100_000_000)


def nothing(path):
    path.write_bytes(b"")


def noise(path):
    path.write_bytes(np.random.default_rng(0).bytes(5000))


HOSTILE = [
    ("a.kml", laughs, "document type"),
    ("b.kml", outside_entity, "document type"),
    ("c.gpx", deep_xml, "nested"),
    ("d.kml", cut_xml, "well-formed"),
    ("e.geojson", deep_json, "nested"),
    ("f.kmz", zip_bomb, "unpacks to more"),
    ("g.zip", many_members, "1500 files"),
    ("h.zip", not_a_zip, "zip archive"),
    ("i.kmz", no_outline, "holds no outline"),
    ("j.gpkg", huge, "100 MB"),
    ("k.geojson", huge, "100 MB"),
    ("l.kml", nothing, "empty"),
    ("m.gpkg", noise, "cannot be read as GPKG"),
    ("n.shp", noise, "cannot be read as SHP"),
    ("o.dwg", noise, "give GeoJSON"),
]


@pytest.mark.parametrize(("name", "make", "says"), HOSTILE)
def test_hostile_files_are_refused_at_once(tmp_path, name, make, says):
    path = tmp_path / name
    make(path)
    before = resource.getrusage(resource.RUSAGE_SELF).ru_maxrss
    began = time.process_time()
    with pytest.raises(InputError, match=says) as caught:
        read_outline(path)
    assert "\n" not in str(caught.value)
    assert time.process_time() - began < 1.5
    assert resource.getrusage(resource.RUSAGE_SELF).ru_maxrss - before < 200_000


def test_an_archive_cannot_write_beside_its_folder(tmp_path):
    with zipfile.ZipFile(tmp_path / "x.zip", "w") as archive:
        archive.writestr("../../escaped.kml", "<kml/>")
    with untrusted.unpacked(tmp_path / "x.zip") as inner:
        assert inner.name == "escaped.kml"
        assert inner.parent.name.startswith("grebe-")
    assert not list(tmp_path.parent.glob("**/escaped.kml"))
