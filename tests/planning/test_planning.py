"""Regions, meshes and routes."""

import json
from pathlib import Path

import numpy as np
import pytest
import shapely
from conftest import DATA, convex_polygons, needs_outlines, region_of
from hypothesis import assume, given
from hypothesis import strategies as st

from grebe.core.errors import InputError, PlanError, RegionError, UsageError
from grebe.core.plan_settings import PlanSettings
from grebe.core.sets import ring_vertices
from grebe.core.vessel import PRESETS
from grebe.io.readers.outline import read_outline
from grebe.planning.cells.mesh import MAX_SIDES, mesh_water, target_footprint
from grebe.planning.paths.network import connect
from grebe.planning.planner import plan_survey
from grebe.planning.region import clean_region, navigable_water
from grebe.planning.route.orders import sweeps

HERON = (3.171153, 50.636268)


def geojson(path: Path, coordinates, kind="Polygon", **more) -> Path:
    path.write_text(json.dumps({"type": kind, "coordinates": coordinates, **more}))
    return path


def box(lon=HERON[0], lat=HERON[1], size=0.001):
    ring = [(lon, lat), (lon + size, lat), (lon + size, lat + size), (lon, lat + size), (lon, lat)]
    return [list(map(list, ring))]


def read_region(path):
    outline = read_outline(path)
    return clean_region(outline.geometry, outline.name)


@given(convex_polygons(), st.floats(4, 30), st.floats(-180, 180))
def test_cells_are_disjoint_and_cover_the_region(water, cell, angle):
    assume(water.area >= cell**2)
    cells = [c.footprint for c in mesh_water(water, cell, angle_deg=angle)]
    union = shapely.union_all(cells, grid_size=1e-7)
    assert shapely.symmetric_difference(union, water, grid_size=1e-7).area < 1e-5 * water.area
    assert sum(c.area for c in cells) == pytest.approx(water.area, rel=1e-6)


@given(convex_polygons(), st.floats(4, 30), st.floats(-180, 180))
def test_targets_are_convex_have_few_sides_and_lie_in_their_cells(water, cell, angle):
    assume(water.area >= cell**2)
    for c in mesh_water(water, cell, angle_deg=angle):
        vertices = target_footprint(ring_vertices(c.footprint))
        assert 3 <= len(vertices) <= MAX_SIDES
        target = shapely.Polygon(vertices)
        assert c.footprint.buffer(1e-6).contains(target)
        assert target.area > 0.9 * c.footprint.area


def test_a_rectangle_is_swept_without_a_jump_from_the_nearest_corner():
    water = shapely.box(0, 0, 40, 60)
    cells = mesh_water(water, 10)
    for order in sweeps(cells, connect(cells, water, 10), (41, 61)):
        centres = np.array([cells[i].footprint.centroid.coords[0] for i in order])
        assert centres[0] == pytest.approx([35, 55])
        assert np.hypot(*np.diff(centres, axis=0).T) == pytest.approx(np.full(23, 10.0))


def test_rows_run_along_the_angle():
    water = shapely.affinity.rotate(shapely.box(0, 0, 100, 20), 30, origin=(0, 0))
    cells = mesh_water(water, 10, angle_deg=30)
    assert len(cells) == 20
    assert all(c.footprint.area == pytest.approx(100) for c in cells)


def test_a_survey_reports_its_coverage_and_numbers_its_targets():
    region = region_of([(0, 0), (50, 0), (60, 30), (20, 55)])
    survey = plan_survey(region, PRESETS["spyboat"], PlanSettings(cell_m=10, angle_deg=20))
    assert survey.coverage > 0.99
    assert [t.seq for t in survey.targets] == list(range(1, len(survey.targets) + 1))


def test_a_polygon_and_its_hull_of_several_features_are_read(tmp_path):
    document = {
        "type": "FeatureCollection",
        "name": "two halves",
        "features": [
            {"type": "Feature", "properties": {}, "geometry": {"type": "Polygon", "coordinates": c}}
            for c in (box(), box(lon=HERON[0] + 0.001))
        ]
        + [
            {
                "type": "Feature",
                "properties": {},
                "geometry": {"type": "Point", "coordinates": HERON},
            }
        ],
    }
    path = tmp_path / "lake.geojson"
    path.write_text(json.dumps(document))
    outline = read_outline(path)
    assert "1 feature without a polygon: left out" in outline.notes[0]
    region = clean_region(outline.geometry, outline.name)
    assert region.name == "two halves"
    assert region.area_m2 == pytest.approx(2 * 70.8 * 111.2, rel=0.01)


BOWTIE = [[[3.0, 50.0], [3.001, 50.001], [3.001, 50.0], [3.0, 50.001], [3.0, 50.0]]]


@pytest.mark.parametrize(
    ("coordinates", "says"),
    [
        (BOWTIE, "not a simple polygon"),
        ([], "empty"),
        (box(lon=50.0, lat=-120.0), "swapped"),
        (box(lon=700000.0, lat=5610000.0, size=100), "projected"),
        ([[[3.0, 50.0], [3.1, float("nan")], [3.1, 50.1], [3.0, 50.0]]], "NaN"),
        (box(size=1e-9), "less than a square metre"),
        (box(size=20.0), "km across"),
    ],
)
def test_bad_outlines_are_refused_in_one_sentence(tmp_path, coordinates, says):
    path = geojson(tmp_path / "bad.geojson", coordinates)
    with pytest.raises(RegionError, match=says) as caught:
        read_region(path)
    assert "\n" not in str(caught.value)


@pytest.mark.parametrize(
    ("text", "says"),
    [
        ("", "empty"),
        ("{", "not valid JSON"),
        ("[1]", "no object"),
        ('{"type":"Point","coordinates":[1,2]}', "no polygon"),
    ],
)
def test_files_that_are_no_geojson_are_refused(tmp_path, text, says):
    path = tmp_path / "bad.json"
    path.write_text(text)
    with pytest.raises(InputError, match=says):
        read_outline(path)


@pytest.mark.parametrize(
    ("code", "said"), [("2154", "RGF93.*look like degrees"), ("1", "unknown CRS .*EPSG::1")]
)
def test_a_declared_crs_that_cannot_be_is_refused(tmp_path, code, said):
    crs = {"type": "name", "properties": {"name": f"urn:ogc:def:crs:EPSG::{code}"}}
    path = geojson(tmp_path / "l93.geojson", box(), crs=crs)
    with pytest.raises(InputError, match=said):
        read_outline(path)


def test_separate_waters_are_refused(tmp_path):
    path = geojson(tmp_path / "two.geojson", [box(), box(lon=4.0)], kind="MultiPolygon")
    with pytest.raises(RegionError, match="2 separate waters"):
        read_region(path)


def test_rounded_coordinates_do_not_make_a_square_concave():
    points = [(0, 0), (50, 0.004), (100, 0), (100, 50.003), (100, 100), (49, 99.997), (0, 100)]
    water, notes = navigable_water(region_of(points), (), 0.0)
    assert len(water.exterior.coords) <= 8
    assert not notes


@pytest.mark.parametrize(
    "text", ['{"type":"Topology"}', '{"type":"FeatureCollection","features":7}']
)
def test_other_documents_are_refused(tmp_path, text):
    path = tmp_path / "odd.geojson"
    path.write_text(text)
    with pytest.raises(InputError):
        read_outline(path)


def test_plans_that_cannot_be_are_refused():
    region = region_of([(0, 0), (50, 0), (50, 50), (0, 50)])
    boat = PRESETS["spyboat"]
    with pytest.raises(PlanError, match="less than one cell"):
        plan_survey(region, boat, PlanSettings(cell_m=60))
    with pytest.raises(PlanError, match="more than"):
        plan_survey(region, boat, PlanSettings(cell_m=0.05))
    with pytest.raises(PlanError, match="too fast for vessel"):
        plan_survey(region, boat, PlanSettings(speed_min_mps=3, speed_max_mps=4))
    with pytest.raises(InputError, match="km from the water"):
        plan_survey(region, boat, PlanSettings(), (HERON[1], HERON[0]))
    with pytest.raises(UsageError, match="lower end"):
        PlanSettings(speed_min_mps=2, speed_max_mps=1)


@needs_outlines
@pytest.mark.parametrize(
    ("name", "hectares"), [("crystal", 37.5), ("allequash", 164), ("alamillo", 1.69)]
)
def test_real_lakes_have_their_known_areas(name, hectares):
    region = read_region(DATA / "regions" / f"{name}.geojson")
    assert region.area_m2 / 1e4 == pytest.approx(hectares, rel=0.01)


@pytest.mark.parametrize("pattern", ["free", "rows"])
def test_water_of_a_single_cell_is_planned(pattern):
    settings = PlanSettings(cell_m=11.0, shore_margin_m=0.0, pattern=pattern)
    region = region_of([(0, 0), (11, 0), (11, 11), (0, 11)])
    survey = plan_survey(region, PRESETS["spyboat"], settings)
    assert [one.kind for one in survey.targets] == ["cell"]
