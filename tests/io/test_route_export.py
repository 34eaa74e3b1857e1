"""A plan in other programs' formats, read back by other people's readers."""

import json
import struct

import numpy as np
import pyogrio
import pytest
import shapely
from click.testing import CliRunner
from conftest import region_of, square_survey
from mavsdk import ComponentType, Configuration, Mavsdk
from mavsdk.plugins.mission_raw.mission_raw import MissionRaw

from grebe.cli.main import grebe
from grebe.core.errors import InputError, UsageError
from grebe.core.plan_settings import PlanSettings
from grebe.core.vessel import PRESETS
from grebe.io.export.route import export_text, write_export
from grebe.io.store import SurveyFile
from grebe.planning.planner import plan_survey


@pytest.fixture(scope="module")
def survey():
    region = region_of([(0, 0), (60, 0), (60, 60), (0, 60)])
    zone = shapely.box(25, 25, 35, 35)
    return plan_survey(region, PRESETS["spyboat"], PlanSettings(cell_m=10), no_go=[zone])


def centres(survey):
    return survey.frame.to_wgs84(np.array([t.set.centre for t in survey.targets]))


@pytest.mark.parametrize(("name", "layer"), [("r.gpx", "routes"), ("r.kml", None)])
def test_gdal_reads_the_route(survey, tmp_path, name, layer):
    write_export(survey, tmp_path / name)
    layer = layer or pyogrio.list_layers(tmp_path / name)[0][0]
    _, _, blobs, _ = pyogrio.raw.read(tmp_path / name, layer=layer)
    line = next(g for g in shapely.from_wkb(blobs) if g.geom_type == "LineString")
    assert shapely.get_coordinates(line) == pytest.approx(centres(survey), abs=1e-7)


def test_gdal_reads_the_targets_of_the_geojson(survey, tmp_path):
    write_export(survey, tmp_path / "r.geojson")
    meta, _, blobs, columns = pyogrio.raw.read(tmp_path / "r.geojson")
    fields = dict(zip(meta["fields"], columns, strict=True))
    assert len(blobs) == len(survey.targets) + 1
    assert list(fields["seq"][:-1]) == [t.seq for t in survey.targets]


def test_the_plan_file_holds_mission_fence_and_rally_point(survey):
    plan = json.loads(export_text(survey, ".plan"))
    assert plan["fileType"] == "Plan"
    waypoints = [i for i in plan["mission"]["items"] if i["command"] == 16]
    places = np.array([item["params"][4:6] for item in waypoints])[:, ::-1]
    assert places == pytest.approx(centres(survey))
    assert [i["doJumpId"] for i in plan["mission"]["items"]] == list(range(1, len(places) + 2))
    inclusion = [fence["inclusion"] for fence in plan["geoFence"]["polygons"]]
    assert inclusion == [True, False]
    assert len(plan["rallyPoints"]["points"]) == 1


def test_the_waypoints_file_has_twelve_columns_and_home_first(survey):
    head, *lines = export_text(survey, ".waypoints").splitlines()
    assert head == "QGC WPL 110"
    rows = [line.split("\t") for line in lines]
    assert {len(row) for row in rows} == {12}
    assert [int(row[0]) for row in rows] == list(range(len(rows)))
    places = np.array([[float(row[9]), float(row[8])] for row in rows[2:]])
    assert places == pytest.approx(centres(survey), abs=1e-7)


def heartbeat():
    """Return a MAVLink 2 heartbeat of a surface boat's autopilot: the importers need a vehicle."""
    payload = struct.pack("<IBBBBB", 0, 11, 3, 81, 4, 3)
    head = struct.pack("<BBBBBBBHB", 0xFD, len(payload), 0, 0, 0, 1, 1, 0, 0)
    checksum = 0xFFFF
    for byte in head[1:] + payload + bytes([50]):
        low = (byte ^ checksum) & 0xFF
        low = (low ^ (low << 4)) & 0xFF
        checksum = ((checksum >> 8) ^ (low << 8) ^ (low << 3) ^ (low >> 4)) & 0xFFFF
    return head + payload + struct.pack("<H", checksum)


@pytest.fixture(scope="module")
def importers():
    """Yield MAVSDK's mission importers, on a link that leads nowhere."""
    with Mavsdk(Configuration.create_with_component_type(ComponentType.GROUND_STATION)) as mavsdk:
        mavsdk.add_any_connection("raw://")
        mavsdk.pass_received_raw_bytes(heartbeat())
        yield MissionRaw(mavsdk.first_autopilot(5.0))


def waypoints_of(items):
    return np.array([(item.y, item.x) for item in items if item.command == 16]) / 1e7


def test_mavsdk_imports_the_plan_with_fence_and_rally_point(survey, importers):
    data = importers.import_qgroundcontrol_mission_from_string(export_text(survey, ".plan"))
    home, *places = waypoints_of(data.mission_items)
    start = survey.frame.to_wgs84((survey.start.north_m, survey.start.east_m))
    assert home == pytest.approx(start, abs=2e-7)
    assert np.array(places) == pytest.approx(centres(survey), abs=2e-7)
    inclusion, exclusion = 5001, 5002
    assert [item.command for item in data.geofence_items] == [inclusion] * 4 + [exclusion] * 4
    assert len(data.rally_items) == 1


def test_mavsdk_imports_the_waypoints(survey, importers):
    text = export_text(survey, ".waypoints")
    data = importers.import_mission_planner_mission_from_string(text)
    # The importer puts home before the file's own items, and the first of these is home as well.
    assert waypoints_of(data.mission_items)[2:] == pytest.approx(centres(survey), abs=2e-7)


def test_other_formats_are_refused(survey):
    with pytest.raises(UsageError, match=r"\.plan"):
        export_text(survey, ".doc")


def test_the_command_writes_and_does_not_overwrite(tmp_path):
    survey_path, out = tmp_path / "s.gpkg", tmp_path / "s.plan"
    SurveyFile.create(survey_path, square_survey(), meta={}, force=True).close()
    run = CliRunner()
    done = run.invoke(grebe, ["export", str(survey_path), "-o", str(out), "--json"])
    assert json.loads(done.stdout)["waypoints"] == 4
    again = run.invoke(grebe, ["export", str(survey_path), "-o", str(out)])
    assert isinstance(again.exception, InputError)
