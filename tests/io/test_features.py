"""Select one lake of a file of several, by its name or number."""

from __future__ import annotations

import numpy as np
import pyogrio.raw
import pytest
import shapely

from grebe.core.errors import InputError, RegionError
from grebe.io.readers.outline import read_outline
from grebe.planning.region import clean_region

LAKES = {"Annecy": 0.0, "Bourget": 0.1, "Léman": 0.2, "léman": 0.3}
SUFFIXES = {".shp": "ESRI Shapefile", ".gpkg": "GPKG", ".geojson": "GeoJSON", ".kml": "KML"}


@pytest.fixture(params=SUFFIXES)
def path(tmp_path, request):
    path = tmp_path / f"lakes{request.param}"
    boxes = [shapely.box(6 + x, 45, 6.01 + x, 45.01) for x in LAKES.values()]
    pyogrio.raw.write(
        path,
        np.array(shapely.to_wkb(boxes), dtype=object),
        [np.array(list(LAKES), dtype=object)],
        ["NAME"],
        geometry_type="Polygon",
        crs="EPSG:4326",
        driver=SUFFIXES[request.param],
    )
    return path


@pytest.mark.parametrize(("wanted", "west"), [("bourget", 6.1), ("2", 6.1), ("4", 6.3)])
def test_a_lake_is_chosen_by_name_or_number(path, wanted, west):
    outline = read_outline(path, feature=wanted)
    assert outline.geometry.bounds[0] == pytest.approx(west, abs=1e-6)
    assert clean_region(outline.geometry, outline.name).area_m2 > 1e5


@pytest.mark.parametrize("wanted", ["LÉMAN", "Como", "5", "0"])
def test_what_is_ambiguous_or_unknown_lists_the_lakes(path, wanted):
    with pytest.raises(InputError, match=r"2 Bourget \(.* ha, at 45\.0050 N 6\.1050 E\)") as failed:
        read_outline(path, feature=wanted)
    assert failed.value.settings == ("feature",)
    assert ("2 features are called" in str(failed.value)) == (wanted == "LÉMAN")


def test_several_lakes_without_a_choice_are_listed(path):
    outline = read_outline(path)
    with pytest.raises(RegionError, match="choose one by its name or number: 1 Annecy") as failed:
        clean_region(outline.geometry, outline.name, outline.features)
    assert failed.value.settings == ("feature",)
