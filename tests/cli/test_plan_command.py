"""The options of `grebe plan` on which other commands rely."""

import json
import shlex

import numpy as np
import pytest
import shapely
from click.testing import CliRunner
from conftest import region_of

from grebe.cli.main import grebe
from grebe.core.errors import UsageError
from grebe.io.store import SurveyFile
from grebe.mapping.covariance.models import CovarianceModel
from grebe.mapping.design import pitch_for_accuracy
from grebe.mapping.fields.kriging import krige


@pytest.fixture(scope="module")
def lake(tmp_path_factory):
    """A lake of 80 m x 60 m with an island, as a GeoJSON file."""
    frame = region_of([(0, 0), (60, 0), (60, 80), (0, 80)]).frame
    water = shapely.box(0, 0, 60, 80).difference(shapely.box(25, 30, 35, 45))
    path = tmp_path_factory.mktemp("lake") / "lake.geojson"
    path.write_text(shapely.to_geojson(frame.geometry_to_wgs84(water)))
    return path


def planned(lake, tmp_path, *options):
    path = tmp_path / "s.gpkg"
    done = CliRunner().invoke(
        grebe, ["plan", str(lake), "-o", str(path), "--json", *options], catch_exceptions=True
    )
    if done.exception and not isinstance(done.exception, SystemExit):
        raise done.exception
    return json.loads(done.stdout), path


def test_the_numbers_that_a_plan_reports(lake, tmp_path):
    numbers, _ = planned(lake, tmp_path)
    assert {
        "targets", "coverage", "length_m", "turns", "time_s", "energy_wh", "lower_bound_m", "gap",
        "outside_m2",
    } <= set(numbers)  # fmt: skip
    assert numbers["outside_m2"] == 0
    assert numbers["length_m"] >= numbers["lower_bound_m"]
    assert (tmp_path / "s.png").read_bytes().startswith(b"\x89PNG")


def test_the_next_command_can_be_copied_whatever_the_file_is_called(lake, tmp_path):
    path = tmp_path / "Großer See & mehr.gpkg"
    done = CliRunner().invoke(grebe, ["plan", str(lake), "--cell", "20", "-o", str(path)])
    tip = done.stdout.strip().splitlines()[-1].removeprefix("Next: ")
    assert shlex.split(tip) == ["grebe", "run", str(path)]


@pytest.mark.parametrize("shape", ["hexagon", "triangle"])
def test_shape_and_cell(lake, tmp_path, shape):
    numbers, path = planned(lake, tmp_path, "--shape", shape, "--cell", "8")
    assert numbers["cell_m"] == 8
    with SurveyFile.open(path) as file:
        assert file.survey.settings.shape == shape


def test_the_best_angle_has_a_shorter_path_than_north(tmp_path):
    """The region is a strip at 30 degrees to north."""
    frame = region_of([(0, 0), (60, 0), (60, 80), (0, 80)]).frame
    strip = shapely.affinity.rotate(shapely.box(0, 0, 100, 24), 30)
    path = tmp_path / "strip.geojson"
    path.write_text(shapely.to_geojson(frame.geometry_to_wgs84(strip)))
    options = ("--cell", "8", "--shore-margin", "0")
    north, _ = planned(path, tmp_path, *options, "--force")
    best, _ = planned(path, tmp_path, *options, "--force", "--angle", "auto")
    assert best["length_m"] < north["length_m"]
    assert best["angle_deg"] % 90 == pytest.approx(30, abs=1)


def test_minutes_and_watt_hours_choose_the_cells(lake, tmp_path):
    short, _ = planned(lake, tmp_path, "--minutes", "6")
    assert 4 * 60 < short["time_s"] <= 6.2 * 60
    frugal, _ = planned(lake, tmp_path, "--wh", str(0.5 * short["energy_wh"]), "--force")
    assert frugal["cell_m"] > short["cell_m"]


@pytest.mark.parametrize("minutes", ["3", "5", "8", "12"])
def test_any_budget_is_kept_and_used(lake, tmp_path, minutes):
    numbers, _ = planned(lake, tmp_path, "--minutes", minutes)
    assert 0.7 < numbers["time_s"] / (60 * float(minutes)) <= 1.02


@pytest.mark.parametrize("cell", ["0", "-3", "nan", "inf"])
def test_a_cell_that_is_none(lake, tmp_path, cell):
    with pytest.raises(UsageError, match="cell"):
        planned(lake, tmp_path, "--cell", cell)


def test_only_one_size_may_be_given(lake, tmp_path):
    with pytest.raises(UsageError, match="Give exactly one of"):
        planned(lake, tmp_path, "--minutes", "6", "--cell", "5")


def test_no_go_zone_and_margin(lake, tmp_path):
    frame = region_of([(0, 0), (60, 0), (60, 80), (0, 80)]).frame
    zone = shapely.box(0, 0, 20, 30)
    path = tmp_path / "reeds.geojson"
    path.write_text(shapely.to_geojson(frame.geometry_to_wgs84(zone)))
    options = ("--no-go", str(path), "--shore-margin", "3")
    _, survey_path = planned(lake, tmp_path, *options)
    with SurveyFile.open(survey_path) as file:
        survey = file.survey
    reeds = shapely.union_all(survey.no_go)
    shore = survey.water.exterior
    for target in survey.targets:
        assert target.set.polygon.distance(reeds) > 2.9
        assert target.set.polygon.distance(shore) > 2.9


def test_start_and_return(lake, tmp_path):
    frame = region_of([(0, 0), (60, 0), (60, 80), (0, 80)]).frame
    lon, lat = frame.to_wgs84((50.0, 70.0))
    options = ("--start", f"{lon:.7f},{lat:.7f}", "--return", "--cell", "8")
    numbers, path = planned(lake, tmp_path, *options)
    with SurveyFile.open(path) as file:
        survey = file.survey
    start = shapely.Point(survey.start.north_m, survey.start.east_m)
    assert survey.frame.to_wgs84((start.x, start.y)) == pytest.approx((lon, lat), abs=1e-6)
    assert survey.targets[-1].set.polygon.distance(start) < 10
    assert numbers["outside_m2"] == 0


def test_current_and_wind_lengthen_the_survey(lake, tmp_path):
    still, _ = planned(lake, tmp_path)
    flowing, path = planned(lake, tmp_path, "--current", "0.5,0", "--wind", "0,10", "--force")
    assert flowing["time_s"] > still["time_s"]
    with SurveyFile.open(path) as file:
        assert file.survey.settings.weather.current_north_mps == 0.5


def test_an_angle_that_is_none(lake, tmp_path):
    with pytest.raises(UsageError, match="neither a number"):
        planned(lake, tmp_path, "--angle", "north")


def test_the_wanted_accuracy_chooses_the_cells(lake, tmp_path):
    rough, _ = planned(lake, tmp_path, "--range", "60")
    fine, _ = planned(lake, tmp_path, "--range", "60", "--accuracy", "0.35", "--force")
    assert fine["cell_m"] < rough["cell_m"] < 30
    with pytest.raises(UsageError, match="one of them"):
        planned(lake, tmp_path, "--range", "60", "--cell", "5")


@pytest.mark.parametrize("share", [0.3, 0.5, 0.7])
def test_a_map_of_samples_at_that_pitch_has_the_accuracy(share):
    """Kriging in the middle of a larger grid of that pitch gives that standard deviation."""
    pitch = pitch_for_accuracy(100.0, share)
    ticks = pitch * (np.arange(-7, 7) + 0.5)
    places = np.stack(np.meshgrid(ticks, ticks), axis=-1).reshape(-1, 2)
    model = CovarianceModel(kind="exponential", sill=4.0, range_m=100 / 2.996, nugget=0.0)
    sd = krige(places, np.zeros(len(places)), np.zeros((1, 2)), model).sd[0]
    assert sd / 2.0 == pytest.approx(share, abs=0.01)
