"""An outline that is opened in the app: its islands, and coordinates that it does not name."""

from __future__ import annotations

import json

import numpy as np
import pytest
import shapely
from app.waiting import until
from pyproj import Transformer

pytestmark = pytest.mark.slow
UTM = Transformer.from_crs("EPSG:4326", "EPSG:32631", always_xy=True)
LAKE, ISLAND = (
    shapely.box(6.55, 46.45, 6.552, 46.4512),
    shapely.box(6.5505, 46.4503, 6.551, 46.4506),
)


def in_metres(polygon):
    return shapely.transform(polygon, lambda p: np.column_stack(UTM.transform(p[:, 0], p[:, 1])))


def test_an_outline_in_metres_with_an_unnamed_island_is_planned(context, app, tmp_path):
    features = [
        {"type": "Feature", "properties": {}, "geometry": shapely.geometry.mapping(in_metres(one))}
        for one in (LAKE, ISLAND)
    ]
    path = tmp_path / "cadastre.geojson"
    path.write_text(json.dumps({"type": "FeatureCollection", "features": features}))
    page = context.new_page()
    page.goto(f"{app.base}#/plan")
    page.get_by_label("Outline from a file").set_input_files(path)
    until(lambda: page.locator(".notice.error").count() == 1, "the refusal of metres")
    refused = page.locator(".notice.error").inner_text()
    assert "The region 'cadastre'" in refused
    assert "name their CRS" in refused
    page.get_by_label("Coordinates, if the file names none").fill("EPSG:32631")
    page.get_by_label("Coordinates, if the file names none").press("Enter")
    until(lambda: page.locator(".shape.water").count() == 1, "the lake")
    until(lambda: page.locator(".notice.warning").count() == 1, "the doubt about the island")
    assert page.locator(".shape.island").count() == 0
    page.get_by_label("Polygons within the water").select_option("all")
    until(lambda: page.locator(".shape.island").count() == 1, "the island")
    assert page.locator(".notice").all_inner_texts() == [
        "polygon 2 lies within polygon 1 and is taken as an island\n×"
    ]
    until(lambda: page.locator(".facts dd").count() >= 8, "the preview of the plan")
    page.close()
