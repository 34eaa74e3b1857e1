"""Sorties of unlike boats on a real lake, from the command line: planned, shown and sailed."""

from __future__ import annotations

import json

import pytest
from click.testing import CliRunner
from conftest import DATA, needs_outlines

from grebe.cli import run_command
from grebe.cli.main import grebe
from grebe.core.errors import UsageError
from grebe.io.store import SurveyFile

LAKE = DATA / "regions" / "alamillo.geojson"
BATTERIES_WH = {1: 24.0, 2: 150.0}
ASKED = (
    "--cell", 15, "--speed", "0.5:1.5", "--boats", 2, "--vessel", "blueboat", "--vessel", "otter",
)  # fmt: skip
pytestmark = needs_outlines


def invoke(*arguments):
    return CliRunner().invoke(grebe, [str(one) for one in arguments])


def batteries():
    return [word for wh in BATTERIES_WH.values() for word in ("--battery", wh)]


@pytest.fixture(scope="module")
def planned(tmp_path_factory):
    path = tmp_path_factory.mktemp("unlike") / "s.gpkg"
    done = invoke("plan", LAKE, "-o", path, *ASKED, *batteries(), "--json")
    assert done.exit_code == 0, done.output
    return path, json.loads(done.stdout)


@pytest.mark.slow
def test_the_plan_proves_every_sortie_and_says_whose_it_is(planned):
    path, numbers = planned
    assert numbers["home_in_time"].startswith("proved for every sortie")
    shown = json.loads(invoke("show", path, "--json").stdout)["sorties"]
    with SurveyFile.open(path) as file:
        sorties = file.revision.sorties
        assert file.survey.settings.sorties.batteries_wh == tuple(BATTERIES_WH.values())
    names = {1: "boat 1 (blueboat)", 2: "boat 2 (otter)"}
    for one, made, told in zip(sorties, numbers["sorties"], shown, strict=True):
        assert names[one.boat] in made
        assert names[one.boat] in told
    assert {one.boat for one in sorties} == {1, 2}
    assert path.with_suffix(".png").stat().st_size > 10_000


@pytest.mark.slow
@pytest.mark.parametrize(("boat", "vessel"), [(1, "blueboat"), (2, "otter")])
def test_a_sortie_is_sailed_by_its_own_boat(planned, boat, vessel, monkeypatch):
    path, _ = planned
    with SurveyFile.open(path) as file:
        number = next(one.number for one in file.revision.sorties if one.boat == boat)
    before = json.loads(invoke("run", path, "--sortie", number, "--preview", "--json").stdout)
    assert (before["sortie"], before["boat"]) == (number, boat)
    sailed = []
    run_survey = run_command.run_survey

    def watched(survey_file, boat_at, helm, now, settings, **how):
        def seen(departure):
            sailed.append((departure.vessel.name, settings.safety.battery_wh))
            return boat_at(departure)

        return run_survey(survey_file, seen, helm, now, settings, **how)

    monkeypatch.setattr(run_command, "run_survey", watched)
    done = invoke("run", path, "--sortie", number, "--json")
    assert done.exit_code == 0, done.output
    assert sailed == [(vessel, BATTERIES_WH[boat])]
    assert f"boat {boat} ({vessel})" in done.stderr
    report = json.loads(done.stdout)
    assert report["ended"] == "mission_complete"
    assert report["energy_wh"] < 0.8 * BATTERIES_WH[boat]
    with SurveyFile.open(path) as file:
        sortie = file.revision.sortie(number)
        assert file.progress().reached_in(sortie) == len(sortie)
        assert boat in {int(one.boat[0]) for one in file.track().each_boat()}


def test_a_battery_for_each_of_other_boats_is_refused(tmp_path):
    refused = invoke("plan", LAKE, "-o", tmp_path / "s.gpkg", *ASKED, *batteries(), "--battery", 9)
    assert isinstance(refused.exception, UsageError)
    assert "Give one battery for all 2 boats, or 2, not 3" in str(refused.exception)
    alone = invoke("plan", LAKE, "-o", tmp_path / "s.gpkg", *batteries())
    assert "One boat takes one battery" in str(alone.exception)
