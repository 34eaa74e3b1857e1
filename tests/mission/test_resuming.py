"""A mission resumes from where its boat is: around land, with the battery that it has."""

from dataclasses import replace
from datetime import UTC, datetime, timedelta

import numpy as np
import pytest
import shapely

from grebe.core.events import EndReason
from grebe.core.frames import LocalFrame
from grebe.core.plan_settings import PlanSettings, SortieSettings
from grebe.core.revision import first_revision, survey_of
from grebe.core.survey import SIMULATED_WATER
from grebe.core.vessel import PRESETS
from grebe.io.store import SurveyFile
from grebe.mission.departure import part_of, prepare
from grebe.mission.safety.settings import SafetySettings
from grebe.mission.settings import MissionSettings
from grebe.planning.check import check_plan
from grebe.planning.planner import plan
from grebe.planning.region import Region, water_of
from grebe.planning.revisions.connect import connected, is_connected
from grebe.planning.revisions.revise import Halfway, open_water
from grebe.planning.sorties import plan_sorties
from grebe.workflow.files import write_survey
from grebe.workflow.run import run_survey, steered_by
from grebe.workflow.simulated import SimulatedWorld

NOW = datetime(2026, 5, 1, 8, 30, tzinfo=UTC)
BOAT = PRESETS["spyboat"]
FRAME = LocalFrame(origin_lon_deg=3.0, origin_lat_deg=50.0)
# Two arms of water with a bar of land between them, joined at one end.
ARMS = shapely.box(0, 0, 60, 100).difference(shapely.box(25, 0, 35, 80))
HARBOUR = (5.0, 5.0)


@pytest.fixture(scope="module")
def survey():
    region = Region(name="arms", frame=FRAME, water=ARMS)
    lon, lat = FRAME.to_wgs84(HARBOUR).tolist()
    settings = PlanSettings(cell_m=12.5, speed_min_mps=0.5, speed_max_mps=1.5)
    return plan(region, BOAT, settings, start_lonlat=(lon, lat)).survey


@pytest.fixture(scope="module")
def planned():
    region = Region(name="arms", frame=FRAME, water=ARMS)
    lon, lat = FRAME.to_wgs84((30.0, 95.0)).tolist()
    bounds = SortieSettings(minutes=5.0, reserve=0.1, harbours=((lon, lat),))
    settings = PlanSettings(cell_m=8.0, speed_min_mps=0.5, speed_max_mps=1.5, sorties=bounds)
    return plan_sorties(region, BOAT, settings)


def across(survey):
    """How many targets are reached when the next one is across the bar from the harbour."""
    return next(
        i for i, t in enumerate(survey.targets) if t.kind == "cell" and t.set.centre[0] > 40
    )


def test_the_path_to_the_next_target_leads_around_land(survey):
    old, reached = first_revision(survey), across(survey)
    water = water_of(survey)
    assert not is_connected(survey, lambda: ARMS, reached, HARBOUR)
    assert is_connected(survey, lambda: ARMS, 0, HARBOUR)
    new = connected(old, survey, open_water(survey, water), Halfway(reached=reached, place=HARBOUR))
    assert new.targets[:reached] == old.targets[:reached]
    cells = [[t.seq for t in one.targets if t.kind == "cell"] for one in (old, new)]
    assert cells[0] == cells[1]
    start = replace(survey.start, north_m=HARBOUR[0], east_m=HARBOUR[1])
    ahead = replace(
        survey, targets=new.targets[reached:], corridors=new.corridors[reached:], start=start
    )
    assert check_plan(ahead, water).outside_m2 == 0.0


@pytest.mark.slow
def test_a_mission_that_came_home_goes_on_around_land(tmp_path, survey):
    path = tmp_path / "s.gpkg"
    with SurveyFile.create(path, survey, meta={}, force=False) as file:
        first = run_survey(
            file, SimulatedWorld(), steered_by(), NOW,
            MissionSettings(safety=SafetySettings(max_s=190.0)),
        )  # fmt: skip
        assert first.ended is EndReason.CAME_HOME
        assert across(survey) <= first.reached < len(survey.targets)
        later = NOW + timedelta(hours=1)
        report = run_survey(file, SimulatedWorld(), steered_by(), later, resume=True)
        assert report.ended is EndReason.COMPLETE
        assert file.revision.reason == "resumed"
        assert shapely.contains_xy(ARMS.buffer(0.05), file.track().states[:, :2]).all()


def cut_off(file, targets, *, sortie, now):
    """Sail a sortie and stop it after some `targets`, as if the computer had died there."""

    class Counter:
        mission = None

        def __call__(self, event):
            if getattr(event, "count", 0) == targets:
                self.mission.stop("cut off")

    counter = Counter()
    return run_survey(
        file, SimulatedWorld(), steered_by(), now, sortie=sortie, listeners=[counter],
        on_ready=lambda mission: setattr(counter, "mission", mission),
    )  # fmt: skip


@pytest.mark.slow
def test_the_sortie_that_was_broken_off_is_gone_on_with(tmp_path, planned):
    path = tmp_path / "s.gpkg"
    write_survey(path, planned.survey, revision=planned.revision)
    assert len(planned.revision.sorties) >= 2
    with SurveyFile.open(path) as file:
        cut_off(file, 6, sortie=2, now=NOW)
        there = file.track_ends()[1].state
        departure = prepare(file, NOW + timedelta(hours=1), resume=True)
        assert departure.sortie.number == 2
        assert departure.reached == 6
        assert departure.state == there
        # Another sortie is sailed meanwhile, so the boat is no longer where it was left.
        cut_off(file, 3, sortie=1, now=NOW + timedelta(hours=2))
        assert prepare(file, NOW, resume=True).sortie.number == 1
        back = prepare(file, NOW, resume=True, sortie=2)
        assert back.state[:2] == pytest.approx(survey_start(file, 2))
        assert back.reached == 6
        assert back.spent.energy_wh == 0.0
        report = run_survey(
            file, SimulatedWorld(), steered_by(), NOW + timedelta(hours=3), resume=True, sortie=2
        )
        assert report.ended is EndReason.COMPLETE
        assert part_of(file, 2).reached == len(file.revision.sortie(2))


def survey_start(file, number):
    start = survey_of(file.survey, file.revision, file.revision.sortie(number)).start
    return start.north_m, start.east_m


@pytest.mark.slow
def test_what_the_battery_has_given_since_the_harbour_counts_after_a_break(tmp_path, planned):
    path = tmp_path / "s.gpkg"
    write_survey(path, planned.survey, revision=planned.revision)
    with SurveyFile.open(path) as file:
        report = cut_off(file, 12, sortie=2, now=NOW)
        departure = prepare(file, NOW + timedelta(minutes=5), resume=True)
        assert departure.spent.energy_wh == pytest.approx(report.energy_wh, rel=0.03)
        assert departure.spent.seconds == pytest.approx(report.duration_s, rel=0.05)
        # A nearly empty battery sends the boat home at once.
        tight = MissionSettings(safety=SafetySettings(battery_wh=1.05 * report.energy_wh))
        again = run_survey(
            file, SimulatedWorld(), steered_by(), NOW + timedelta(minutes=5), tight, resume=True
        )
        assert again.ended is EndReason.CAME_HOME
        assert again.reached <= 14
        # A simulated boat gets a new battery at its harbour; a real one may not.
        kept = prepare(file, NOW + timedelta(minutes=20), resume=True, renews=False)
        assert kept.spent.energy_wh == pytest.approx(report.energy_wh + again.energy_wh, rel=0.03)
        file.set_meta("water", "mavlink:udp:127.0.0.1:14550")
        assert prepare(file, NOW + timedelta(minutes=20), resume=True).spent == kept.spent
        file.set_meta("water", SIMULATED_WATER)
        home = prepare(file, NOW + timedelta(minutes=20), resume=True)
        assert home.spent.energy_wh == 0.0
        assert np.hypot(*(np.array(home.state[:2]) - survey_start(file, 2))) < 15.0


def test_a_resumed_order_with_a_clear_path_is_unchanged(tmp_path, survey):
    with SurveyFile.create(tmp_path / "s.gpkg", survey, meta={}, force=False) as file:
        cut_off(file, 3, sortie=None, now=NOW)
        run_survey(
            file, SimulatedWorld(), steered_by(), NOW + timedelta(hours=1),
            MissionSettings(limit_s=20.0), resume=True,
        )  # fmt: skip
        assert len(file.revisions()) == 1
