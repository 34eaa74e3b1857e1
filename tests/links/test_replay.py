"""A recorded survey repeats its track, at the requested speed."""

import json

import numpy as np
import pytest
from click.testing import CliRunner
from conftest import run_simulated, square_survey

from grebe.cli.main import grebe
from grebe.core.errors import GrebeError, LinkError, UsageError
from grebe.core.events import EndReason
from grebe.io.store import SurveyFile
from grebe.links.base import IDLE
from grebe.links.replay import Recording, ReplayLink, drawn_between
from grebe.workflow.boats import boat_named
from grebe.workflow.files import write_survey


def recording(seconds, readings=()):
    seconds = np.array(seconds, dtype=float)
    return Recording(
        name="r", seconds=seconds, states=np.tile(seconds[:, None], 6), readings=readings
    )


def test_a_replay_ignores_orders_and_asks_for_the_end_after_its_last_estimate():
    link = ReplayLink(recording([0, 0.5, 1]))
    for second in (0.0, 0.5):
        link.command(IDLE)
        seen = link.observe()
        assert (seen.time_s, seen.state) == (second, (second,) * 6)
        assert not link.status().stop_request
    link.observe()
    assert "recording ends" in link.status().stop_request
    with pytest.raises(LinkError):
        link.observe()


@pytest.mark.parametrize(("speed", "lasts_s"), [(1.0, 2.0), (10.0, 0.2), (np.inf, 0.0)])
def test_it_takes_the_recorded_time_over_its_speed(speed, lasts_s):
    wall = [100.0]

    def sleep(seconds):
        wall[0] += seconds

    link = ReplayLink(recording([5, 6, 7]), speed, clock=lambda: wall[0], sleep=sleep)
    for _ in range(3):
        link.observe()
    assert wall[0] - 100.0 == pytest.approx(lasts_s)


def test_a_reading_is_handed_out_once_when_its_time_has_come():
    link = ReplayLink(recording(range(6), [(1.0, {"ph": 7.0}), (4.2, {"ph": 8.0})]))
    assert link.measure() == {}
    read = []
    for _ in range(6):
        link.observe()
        read.append(link.measure().get("ph"))
    assert read == [None, 7.0, None, None, None, 8.0]


def test_what_cannot_be_replayed_is_refused():
    for seconds in ([], [0, 0], [1, 0]):
        with pytest.raises(LinkError):
            recording(seconds)
    with pytest.raises(UsageError):
        ReplayLink(recording([0]), 0.0)


def test_what_is_drawn_between_is_a_circle_where_the_boat_sailed_one():
    seconds = np.arange(0, 20, 0.5)
    angle = 0.4 * seconds
    states = np.column_stack(
        [5 * np.sin(angle), -5 * np.cos(angle), angle, *np.zeros((3, len(angle)))]
    )
    states[:, 2] = np.angle(np.exp(1j * angle))
    states[:, 3], states[:, 5] = 2.0, 0.4
    drawn = drawn_between(Recording(name="circle", seconds=seconds, states=states))
    assert np.diff(drawn.seconds) == pytest.approx(0.1)
    assert np.hypot(*drawn.states[:, :2].T) == pytest.approx(5.0, abs=1e-4)
    assert drawn.states[:, 2] == pytest.approx(0.4 * drawn.seconds, abs=1e-9)
    assert drawn.states[::5] == pytest.approx(
        np.column_stack([states[:, :2], angle, states[:, 3:]])
    )


def test_a_gap_in_which_nobody_watched_stays_one():
    drawn = drawn_between(recording([0, 0.2, 100, 100.1]))
    assert drawn.seconds == pytest.approx([0, 0.1, 0.2, 100, 100.1])


@pytest.fixture(scope="module")
def recorded(tmp_path_factory):
    path = tmp_path_factory.mktemp("replay") / "recorded.gpkg"
    write_survey(path, square_survey())
    with SurveyFile.open(path) as file:
        run_simulated(file)
    return path


def run(*words):
    return CliRunner().invoke(grebe, [str(word) for word in words])


def test_a_replayed_mission_is_the_recorded_one(recorded, tmp_path):
    again = tmp_path / "again.gpkg"
    write_survey(again, square_survey())
    done = run("run", again, "--link", f"replay:{recorded}?speed=max", "--json")
    assert done.exit_code == 0, done.output
    assert json.loads(done.stdout)["ended"] == EndReason.COMPLETE.value
    with SurveyFile.open(recorded) as old, SurveyFile.open(again) as new:
        assert new.meta()["water"] == "replay of recorded.gpkg"
        assert new.progress().reached == old.progress().reached
        apart = new.track().states[:, None, :2] - old.track().states[None, :, :2]
        assert np.hypot(*np.moveaxis(apart, -1, 0)).min(axis=1).max() < 0.5
        first, second = old.samples(), new.samples()
        assert len(second) >= 0.5 * len(first)
        assert set(second.values["ph"]) <= set(first.values["ph"])


def test_a_recording_that_ends_early_stops_the_mission(recorded, tmp_path):
    longer = tmp_path / "longer.gpkg"
    write_survey(longer, square_survey(side_m=60.0))
    done = run("run", longer, "--link", f"replay:{recorded}?speed=max", "--json")
    assert json.loads(done.stdout)["ended"] == EndReason.STOPPED.value
    assert "recording ends" in str(done.exception)


def test_a_url_that_is_none_is_refused(recorded, tmp_path):
    for url in (
        "replay:",
        "replay:none.gpkg",
        f"replay:{recorded}?speed=0",
        f"replay:{recorded}?speed=fast",
        f"replay:{recorded}?pace=2",
    ):
        with pytest.raises(GrebeError):
            boat_named(url)
    fresh = tmp_path / "fresh.gpkg"
    write_survey(fresh, square_survey())
    done = run("run", fresh, "--link", f"replay:{fresh}")
    assert isinstance(done.exception, LinkError)
