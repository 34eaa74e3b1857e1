"""grebe adapt for several boats, and for boats in sorties: from the plan to the second map."""

from __future__ import annotations

import json

import pytest
import shapely
from click.testing import CliRunner
from conftest import FRAME

from grebe.cli.main import grebe as commands
from grebe.core.errors import UsageError
from grebe.io.store import SurveyFile


def grebe(*words):
    done = CliRunner().invoke(commands, [*map(str, words), "--json"])
    assert done.exception is None, done.exception
    return json.loads(done.stdout)


@pytest.fixture
def pond(tmp_path):
    path = tmp_path / "pond.geojson"
    water = FRAME.geometry_to_wgs84(shapely.box(0, 0, 50, 70))
    path.write_text(shapely.to_geojson(water))
    return path


MORE = ("--quantity", "temperature_degc")


@pytest.mark.slow
def test_what_a_fleet_sailed_goes_on_with_a_fleet(pond, tmp_path):
    path = tmp_path / "lake.gpkg"
    # Wide enough for three boats to keep out of each other's way.
    pond.write_text(shapely.to_geojson(FRAME.geometry_to_wgs84(shapely.box(0, 0, 180, 200))))
    grebe("plan", pond, "--cell", 28, "--boats", 3, "--apart", 6, "-o", path)
    first = grebe("run", path)
    assert first["reached"] == first["targets"]
    before = grebe("adapt", path, *MORE, "--minutes", 1.5, "--preview")
    with SurveyFile.open(path) as file:
        assert file.revision.number == 1
        lie = {boat: file.track_ends(boat)[1].state[:2] for boat in (1, 2, 3)}
    told = grebe("adapt", path, *MORE, "--minutes", 1.5)
    assert told == before
    assert told["revision"] == 2
    assert 0 < told["sd_expected [°C]"] < told["sd_now [°C]"]
    with SurveyFile.open(path) as file:
        revision, reached = file.revision, file.progress().reached
        assert revision.reason == "adaptive"
        new = revision.sorties[3:]
        assert [one.number for one in new] == [4, 5, 6]
        assert {one.boat for one in new} == {1, 2, 3}
        # Each sets out from where it is, and keeps to the time.
        for one in new:
            assert (one.start.north_m, one.start.east_m) == pytest.approx(lie[one.boat])
            assert one.time_s <= 90.0
        cells = [t for t in revision.targets[reached:] if t.kind == "cell"]
        assert len(cells) == told["places"]
    second = grebe("run", path, "--resume")
    assert second["reached"] == second["targets"] > first["targets"]
    assert second["duration_s"] < 1.6 * 90
    assert len(grebe("map", path, "--out", tmp_path / "maps")["maps"]) == 5
    assert grebe("adapt", path, *MORE, "--minutes", 1.5, "--goal", "hot-spot")["revision"] == 3


@pytest.mark.slow
def test_one_boats_survey_is_followed_by_sorties_of_two(pond, tmp_path):
    path = tmp_path / "lake.gpkg"
    grebe("plan", pond, "--cell", 14, "-o", path)
    grebe("run", path)
    with SurveyFile.open(path) as file:
        lon, lat = file.survey.frame.to_wgs84((5.0, 5.0)).tolist()
    told = grebe(
        "adapt", path, *MORE, "--minutes", 4, "--boats", 2, "--apart", 6,
        "--sortie-minutes", 4, f"--harbour={lon},{lat}",
    )  # fmt: skip
    assert told["home_in_time"].startswith("proved for every sortie")
    with SurveyFile.open(path) as file:
        own = file.revision.sorties
        assert (own[0].number, own[0].boat) == (1, 1)
        spent = {1: 0.0, 2: 0.0}
        for one in own[1:]:
            spent[one.boat] += one.time_s
            assert (one.start.north_m, one.start.east_m) == pytest.approx((5.0, 5.0), abs=0.5)
            assert one.time_s < 0.8 * 240
        assert 0 < max(spent.values()) <= 240.0
        assert file.survey.settings.sorties.minutes == 4
    sailed = grebe("run", path, "--resume")
    assert sailed["reached"] == sailed["targets"]
    # The settings hold until an option changes them; a battery is for all boats or for each.
    batteries = ("--battery", "9") * 3
    refused = CliRunner().invoke(
        commands, ["adapt", str(path), *MORE, "--minutes", "3", *batteries]
    )
    assert isinstance(refused.exception, UsageError)
    assert "Give one battery for all 2 boats, or 2" in str(refused.exception)
