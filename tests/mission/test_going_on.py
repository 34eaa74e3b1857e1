"""A mission that has sailed its order is extended where it pays, until its time or aim is met."""

import json

import pytest
from click.testing import CliRunner

from grebe.cli.main import grebe
from grebe.io.store import SurveyFile

pytestmark = pytest.mark.slow


def run(path, *words):
    return CliRunner().invoke(grebe, ["run", str(path), *map(str, words), "--json"])


def test_it_goes_on_in_rounds_without_landing_and_ends_in_time(coarse_survey):
    done = run(coarse_survey, "--adaptive", "temperature_degc", "--more-minutes", 6)
    assert done.exit_code == 0, done.output
    with SurveyFile.open(coarse_survey) as file:
        revisions, events = file.revisions(), file.events()
        sailed_s = file.track().seconds[-1]
    assert [one.reason for one in revisions] == ["planned", *["adaptive"] * (len(revisions) - 1)]
    assert len(revisions) >= 3
    first = next(one.time for one in events if one.code == "plan_revised")
    began = next(one.time for one in events if one.code == "mission_started")
    assert 4 * 60 < sailed_s - (first - began).total_seconds() < 7.5 * 60
    assert sum(one.code == "mission_started" for one in events) == 1
    assert "are over" in next(one.message for one in events if one.code == "mission_complete")
    assert json.loads(done.stdout)["targets"] == len(revisions[-1].targets)


def test_it_ends_once_the_map_is_as_sure_as_was_asked(coarse_survey):
    words = ("--adaptive", "temperature_degc", "--more-minutes", 20, "--until-sd", 9.0)
    done = run(coarse_survey, *words)
    assert done.exit_code == 0, done.output
    with SurveyFile.open(coarse_survey) as file:
        assert len(file.revisions()) == 1
        (said,) = [one.message for one in file.events() if one.code == "mission_complete"]
    assert "temperature_degc is known to" in said


@pytest.mark.parametrize(
    ("words", "said"),
    [
        (("--adaptive", "ph"), "--adaptive needs --more-minutes"),
        (("--more-minutes", 5), "--more-minutes requires --adaptive"),
        (("--adaptive", "ph", "--more-minutes", -1), "--more-minutes -1 is impossible"),
        (("--adaptive", "ph", "--more-minutes", 5, "--goal", "threshold"), "needs a threshold"),
        (("--adaptive", "gold", "--more-minutes", 5), "no such quantity"),
    ],
)
def test_conflicting_options_are_reported_before_anything_moves(coarse_survey, words, said):
    done = run(coarse_survey, *words)
    assert said in str(done.exception) + done.output
    with SurveyFile.open(coarse_survey) as file:
        assert file.track_ends() is None


def test_a_preview_shows_the_next_command_with_its_options(coarse_survey):
    words = [
        "--preview",
        "--adaptive",
        "temperature_degc",
        "--more-minutes",
        "2",
        "--goal",
        "hot-spot",
    ]
    shown = CliRunner().invoke(grebe, ["run", str(coarse_survey), *words])
    assert "--adaptive temperature_degc --more-minutes 2.0 --goal hot-spot" in shown.output


def test_a_survey_that_is_whole_is_not_gone_on_with_in_silence(coarse_survey):
    assert run(coarse_survey).exit_code == 0
    again = run(coarse_survey, "--resume", "--adaptive", "temperature_degc", "--more-minutes", 2)
    assert "is reached already" in str(again.exception) + again.output
