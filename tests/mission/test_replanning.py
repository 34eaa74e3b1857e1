"""The remaining targets are replanned while the boat sails, and the file says why."""

from dataclasses import replace
from datetime import UTC, datetime, timedelta

import pytest
import shapely

from grebe.core.dynamics import CALM, Weather
from grebe.core.errors import PlanError
from grebe.core.events import EndReason
from grebe.core.frames import LocalFrame
from grebe.core.plan_settings import FleetSettings, PlanSettings, SortieSettings
from grebe.core.revision import Sortie, first_revision
from grebe.core.sets import TargetSet
from grebe.core.vessel import PRESETS
from grebe.io.store import SurveyFile
from grebe.mission.replanning import Replanner, SharedPlan
from grebe.planning.planner import plan
from grebe.planning.region import Region
from grebe.planning.sorties import plan_sorties
from grebe.workflow.files import write_survey
from grebe.workflow.run import run_survey, steered_by
from grebe.workflow.simulated import SimulatedWorld

NOW = datetime(2026, 5, 1, 8, 30, tzinfo=UTC)
BOAT = PRESETS["spyboat"]


@pytest.fixture(scope="module")
def survey():
    frame = LocalFrame(origin_lon_deg=3.0, origin_lat_deg=50.0)
    region = Region(name="pond", frame=frame, water=shapely.box(0, 0, 50, 60))
    settings = PlanSettings(cell_m=10.0, speed_min_mps=0.5, speed_max_mps=1.5)
    return plan(region, BOAT, settings).survey


def run(path, survey, world, **options):
    with SurveyFile.create(path, survey, meta={}, force=False) as file:
        report = run_survey(file, world, steered_by(), NOW, **options)
        return report, file.revisions(), file.progress(), file.events()


def with_an_impossible_window(survey, place):
    """The survey with a target that requires more speed than the boat has."""
    target = survey.targets[place]
    fast = TargetSet(vertices=target.set.vertices, speed_min_mps=4.0, speed_max_mps=5.0)
    targets = list(survey.targets)
    targets[place] = replace(target, set=fast)
    return replace(survey, targets=tuple(targets))


@pytest.mark.slow
def test_a_target_out_of_reach_is_left_out_and_the_rest_is_visited(tmp_path, survey, monkeypatch):
    monkeypatch.setattr("grebe.mission.loop.target_time_limit_s", lambda *_: 20.0)
    small = replace(survey, targets=survey.targets[:9], corridors=survey.corridors[:9])
    hard = with_an_impossible_window(small, 3)
    report, revisions, progress, events = run(
        tmp_path / "s.gpkg", hard, SimulatedWorld(), replans=True
    )
    assert report.ended is EndReason.COMPLETE
    assert [one.reason for one in revisions] == ["planned", "unreachable"]
    assert "target 4" in revisions[1].note
    assert 4 not in {target.seq for target in revisions[1].targets}
    cells = {t.seq for t in revisions[0].targets if t.kind == "cell"}
    assert {t.seq for t in revisions[1].targets if t.kind == "cell"} == cells - {4}
    assert all(progress.reached_at)
    assert report.targets == len(revisions[1].targets)
    assert [e.message for e in events if e.code == "plan_revised"] == [revisions[1].note]


@pytest.mark.slow
def test_another_current_than_planned_gives_another_order_once(tmp_path, survey, monkeypatch):
    monkeypatch.setattr("grebe.mission.replanning.FOR_S", 15.0)
    world = SimulatedWorld(weather=Weather(current_north_mps=0.3))
    small = replace(survey, targets=survey.targets[:9], corridors=survey.corridors[:9])
    report, revisions, progress, _ = run(tmp_path / "s.gpkg", small, world, replans=True)
    assert report.ended is EndReason.COMPLETE
    assert [one.reason for one in revisions] == ["planned", "weather"]
    assert {t.seq for t in revisions[1].targets} >= {t.seq for t in revisions[0].targets}
    assert all(progress.reached_at)


def test_nothing_is_replanned_when_nothing_has_changed(tmp_path, survey):
    small = replace(survey, targets=survey.targets[:3], corridors=survey.corridors[:3])
    plain, *_ = run(tmp_path / "a.gpkg", small, SimulatedWorld())
    watched, revisions, *_ = run(tmp_path / "b.gpkg", small, SimulatedWorld(), replans=True)
    assert len(revisions) == 1
    assert watched.duration_s == plain.duration_s
    assert watched.path_m == plain.path_m


def test_an_order_that_cannot_be_made_ends_the_wait_for_it(survey, monkeypatch):
    """The loop hears of every error in the background; it must not wait for ever."""
    monkeypatch.setattr(
        "grebe.mission.replanning.replanned",
        lambda *_, **__: [].pop(),  # an error of no plan's
    )
    plans = Replanner(
        survey=survey,
        plan=SharedPlan(revision=first_revision(survey)),
        vessel=BOAT,
        helm_of=lambda _: None,
        waits=True,
    )
    plans.give_up(4, 3, (0.0, 0.0), CALM)
    with pytest.raises(PlanError, match="IndexError"):
        plans.ready(3, (0.0, 0.0), CALM)
    assert not plans.is_busy


@pytest.mark.parametrize(("boat", "battery_wh"), [(1, 40.0), (2, 90.0)])
def test_a_sortie_is_judged_by_the_battery_of_its_own_boat(survey, boat, battery_wh, monkeypatch):
    judged = []

    class Watch:
        def __init__(self, *, bounds, **_):
            judged.append((bounds.battery_wh, bounds.minutes))

        def delay(self, *_):
            return None

    monkeypatch.setattr("grebe.mission.replanning.Pace", Watch)
    settings = replace(
        survey.settings,
        sorties=SortieSettings(batteries_wh=(40.0, 90.0), minutes=30.0),
        fleet=FleetSettings(boats=2),
    )
    start, half = survey.start, len(survey.targets) // 2
    sorties = [
        Sortie(number=1, first=1, last=half, start=start, time_s=1.0, energy_wh=1.0, boat=1),
        Sortie(
            number=2, first=half + 1, last=len(survey.targets), start=start, time_s=1.0,
            energy_wh=1.0, boat=2,
        ),
    ]  # fmt: skip
    whole = replace(survey, settings=settings)
    plans = Replanner(
        survey=whole, plan=SharedPlan(revision=first_revision(whole, sorties)), vessel=BOAT,
        helm_of=lambda _: None, sortie=boat,
    )  # fmt: skip
    plans.watch(10.0, 1, (0.0, 0.0), CALM, 1.0)
    assert judged == [(battery_wh, 30.0)]


@pytest.mark.slow
def test_a_sortie_that_is_too_slow_puts_off_its_last_targets(tmp_path, survey, monkeypatch):
    """A bound is tightened after planning, as if the boat were slower than predicted."""
    monkeypatch.setattr("grebe.mission.pace.LEAST_S", 20.0)
    monkeypatch.setattr("grebe.mission.pace.SLOW", 0.5)
    frame = LocalFrame(origin_lon_deg=3.0, origin_lat_deg=50.0)
    region = Region(name="pond", frame=frame, water=shapely.box(0, 0, 60, 80))
    lon, lat = frame.to_wgs84((2.0, 2.0)).tolist()
    wide = SortieSettings(minutes=6.0, reserve=0.1, harbours=((lon, lat),))
    settings = PlanSettings(cell_m=10.0, speed_min_mps=0.5, speed_max_mps=1.5, sorties=wide)
    planned = plan_sorties(region, BOAT, settings)
    sortie = planned.revision.sorties[0]
    tight = replace(wide, minutes=0.8 * sortie.time_s / 60 / 0.9)
    narrowed = replace(planned.survey, settings=replace(settings, sorties=tight))
    path = tmp_path / "s.gpkg"
    write_survey(path, narrowed, revision=planned.revision)
    with SurveyFile.open(path) as file:
        report = run_survey(file, SimulatedWorld(), steered_by(), NOW, replans=True)
        assert report.ended is EndReason.COMPLETE
        assert file.revision.reason == "progress"
        assert report.duration_s < 0.9 * 60 * tight.minutes
        later = file.revision.sorties[-1]
        assert later.number == len(planned.revision.sorties) + 1
        assert file.progress().reached_in(later) == 0
        for one in file.revision.sorties[1:]:
            run_survey(file, SimulatedWorld(), steered_by(), NOW + timedelta(hours=one.number))
        assert all(file.progress().reached_at)
