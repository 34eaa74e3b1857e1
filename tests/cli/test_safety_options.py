"""The safety options of a mission."""

import json
from datetime import UTC, datetime, timedelta

import click
import pytest
from click.testing import CliRunner
from conftest import NOON, run_simulated, square_survey

from grebe.cli.run_command import command
from grebe.cli.safety_options import boats_changed, next_instant, safety_of
from grebe.core.errors import UsageError
from grebe.io.store import SurveyFile
from grebe.mission.settings import MissionSettings


def test_a_time_of_day_is_the_next_such_instant_in_utc():
    assert next_instant("19:30", NOON) == datetime(2026, 5, 1, 19, 30, tzinfo=UTC)
    assert next_instant("11:59", NOON) == datetime(2026, 5, 2, 11, 59, tzinfo=UTC)
    assert next_instant("12:00", NOON) - NOON == timedelta(days=1)


@pytest.mark.parametrize("clock", ["25:00", "noon", "7"])
def test_what_is_no_time_of_day_is_refused(clock):
    with pytest.raises(click.BadParameter, match="not a time of day"):
        next_instant(clock, NOON)


def test_options_become_settings():
    run = {"max_minutes": 30.0, "home": [3.0, 50.0], "no_fence": True, "battery_reserve": 0.3}
    settings = safety_of(run, NOON)
    assert (settings.max_s, settings.home, settings.fence) == (1800.0, (3.0, 50.0), False)
    assert settings.battery_reserve == 0.3
    assert settings.comes_home == ""


@pytest.mark.parametrize(
    ("words", "boats"),
    [
        (["--battery-changed"], {1, 2, 3}),
        (["--battery-changed", "2"], {2}),
        (["--battery-changed", "1", "--battery-changed", "3", "--yes"], {1, 3}),
        (["--battery-changed", "--yes"], {1, 2, 3}),
        (["--yes"], set()),
    ],
)
def test_a_battery_that_was_changed_is_that_of_every_boat_or_of_those_that_are_named(words, boats):
    with command.make_context("run", [__file__, *words]) as context:
        assert boats_changed(context.params["battery_changed"], 3) == boats


@pytest.mark.parametrize("number", ["0", "4", "otter"])
def test_the_battery_of_no_boat_is_refused(number):
    with pytest.raises(UsageError, match="the number of a boat; there are 3"):
        boats_changed([number], 3)


def test_a_boat_is_brought_home_and_that_is_a_success(tmp_path):
    path = tmp_path / "s.gpkg"
    with SurveyFile.create(path, square_survey(side_m=30.0), meta={}, force=True) as file:
        run_simulated(file, settings=MissionSettings(limit_s=15.0))
    ran = CliRunner().invoke(command, [str(path), "--return", "--json"])
    assert ran.exit_code == 0, ran.output
    assert json.loads(ran.stdout)["ended"] == "came_home"
    with SurveyFile.open(path) as file:
        # A later run that resumes it is a survey again.
        assert "returns" not in json.loads(file.meta()["run"])
