"""A survey in sorties is sailed day by day, from the command line to the end."""

import json

import pytest
import shapely
from click.testing import CliRunner

from grebe.cli.main import grebe
from grebe.core.errors import SurveyFileError, UsageError
from grebe.core.frames import LocalFrame
from grebe.io.store import SurveyFile
from grebe.workflow.sorties import sortie_states

FRAME = LocalFrame(origin_lon_deg=3.0, origin_lat_deg=50.0)


def invoke(*arguments):
    return CliRunner().invoke(grebe, [str(one) for one in arguments])


@pytest.fixture(scope="module")
def planned(tmp_path_factory):
    folder = tmp_path_factory.mktemp("sorties")
    water = shapely.box(0, 0, 60, 80).difference(shapely.box(25, 30, 35, 45))
    outline = folder / "lake.geojson"
    outline.write_text(shapely.to_geojson(FRAME.geometry_to_wgs84(water)))
    path = folder / "s.gpkg"
    lon, lat = FRAME.to_wgs84((2.0, 2.0)).tolist()
    done = invoke(
        "plan", outline, "-o", path, "--cell", 10, "--sortie-minutes", 3.2, "--reserve", 0.1,
        f"--harbour={lon},{lat}", "--json",
    )  # fmt: skip
    assert done.exit_code == 0, done.output
    return path, json.loads(done.stdout)


@pytest.mark.slow
def test_sorties_are_run_one_after_the_other_and_together_are_the_survey(planned):
    path, numbers = planned
    count = len(numbers["sorties"])
    assert count >= 2
    second = json.loads(invoke("run", path, "--sortie", 2, "--json").stdout)
    assert second["ended"] == "mission_complete"
    with SurveyFile.open(path) as file:
        assert [one.is_flown for one in sortie_states(file)][:2] == [False, True]
    for _ in range(count - 1):
        assert invoke("run", path, "--json").exit_code == 0
    shown = json.loads(invoke("show", path, "--json").stdout)
    assert shown["reached"] == shown["targets"] == numbers["targets"]
    with SurveyFile.open(path) as file:
        samples = file.samples()
        assert (samples.times[1:] > samples.times[:-1]).all()
        for sortie, state in zip(file.revision.sorties, sortie_states(file), strict=True):
            assert state.is_flown, sortie
    refused = invoke("run", path, "--sortie", 1)
    assert isinstance(refused.exception, SurveyFileError)
    with pytest.raises(UsageError, match="no sortie 99"):
        raise invoke("run", path, "--sortie", 99).exception


def test_a_plan_says_what_its_sorties_take_and_shows_how_far_they_are(planned):
    path, numbers = planned
    assert all("min" in one for one in numbers["sorties"])
    assert path.with_suffix(".png").stat().st_size > 10_000
    shown = json.loads(invoke("show", path, "--json").stdout)
    assert len(shown["sorties"]) == len(numbers["sorties"])
    assert shown["revision"] == 1


def test_harbours_without_a_bound_are_refused(tmp_path):
    outline = tmp_path / "lake.geojson"
    outline.write_text(shapely.to_geojson(FRAME.geometry_to_wgs84(shapely.box(0, 0, 40, 40))))
    done = invoke("plan", outline, "-o", tmp_path / "s.gpkg", "--harbour=3,50")
    assert isinstance(done.exception, UsageError)
