"""An area is closed while the boat sails: it stays out, and visits the cells that it still can."""

import threading
import time
from dataclasses import replace
from datetime import UTC, datetime

import numpy as np
import pytest
import shapely

from grebe.core.dynamics import CALM
from grebe.core.events import EndReason, Estimate, Reached
from grebe.core.frames import LocalFrame
from grebe.core.plan_settings import PlanSettings
from grebe.core.revision import first_revision
from grebe.core.vessel import PRESETS
from grebe.io.store import SurveyFile
from grebe.links.base import Observation
from grebe.mission.replanning import Replanner, SharedPlan
from grebe.mission.safety.enclosure import Enclosure
from grebe.mission.safety.guard import Guard
from grebe.mission.safety.route_home import RouteHome
from grebe.mission.safety.settings import SafetySettings
from grebe.mission.settings import MissionSettings
from grebe.planning.planner import plan
from grebe.planning.region import Region, water_of
from grebe.planning.revisions.revise import Halfway, open_water, replanned
from grebe.workflow.run import run_survey, steered_by
from grebe.workflow.simulated import SimulatedWorld

NOW = datetime(2026, 5, 1, 8, 30, tzinfo=UTC)
BOAT = PRESETS["spyboat"]
WATER = shapely.box(0, 0, 60, 60)


@pytest.fixture(scope="module")
def survey():
    frame = LocalFrame(origin_lon_deg=3.0, origin_lat_deg=50.0)
    region = Region(name="pond", frame=frame, water=WATER)
    settings = PlanSettings(cell_m=15.0, speed_min_mps=0.5, speed_max_mps=1.5)
    return plan(region, BOAT, settings).survey


class Closer:
    """Closes zones once `after` targets are reached, and records where the boat is from then on."""

    def __init__(self, zones, after):
        self.zones, self.after, self.mission, self.places = zones, after, None, []

    def begin(self, mission):
        self.mission = mission

    def hear(self, event):
        if isinstance(event, Reached) and event.count == self.after:
            self.mission.close(self.zones, "swimmers")
            self.places = []
        if isinstance(event, Estimate):
            self.places.append(event.state[:2])

    __call__ = hear

    def outside(self, zone):
        """Whether the boat stays out of a zone once it has left it."""
        inside = shapely.contains_xy(zone, np.array(self.places))
        out = np.flatnonzero(~inside)
        return len(out) > 0 and not inside[out[0] :].any()


def sail(path, survey, zones, after, **options):
    closer = Closer(zones, after)
    with SurveyFile.create(path, survey, meta={}, force=False) as file:
        report = run_survey(
            file, SimulatedWorld(), steered_by(), NOW, MissionSettings(),
            listeners=[closer], on_ready=closer.begin, **options,
        )  # fmt: skip
        return closer, report, file.revisions(), file.events(), file.progress()


def test_the_boat_keeps_out_of_an_area_that_is_closed_and_visits_the_rest(tmp_path, survey):
    ahead = shapely.union_all([t.set.polygon for t in survey.targets[8:10]])
    zone = ahead.buffer(-3.0)
    closer, report, revisions, events, progress = sail(
        tmp_path / "s.gpkg", survey, [zone], 4, replans=True
    )
    assert closer.outside(zone)
    assert report.ended is EndReason.COMPLETE
    assert [one.reason for one in revisions] == ["planned", "closed"]
    assert "closed; 2 targets are left out" in revisions[1].note
    assert all(progress.reached_at)
    assert [e.message for e in events if e.code == "area_closed"] == ["swimmers"]


def test_a_boat_in_the_area_that_is_closed_leaves_it_and_stays_out(tmp_path, survey):
    zone = survey.targets[3].set.polygon.buffer(4.0)
    closer, report, revisions, *_ = sail(tmp_path / "s.gpkg", survey, [zone], 4, replans=True)
    assert closer.outside(zone)
    assert report.ended is EndReason.COMPLETE
    assert revisions[-1].reason == "closed"


def test_an_area_off_every_path_changes_no_order(tmp_path, survey):
    region = Region(name="strait", frame=survey.frame, water=shapely.box(0, 0, 15, 150))
    settings = PlanSettings(cell_m=15.0, speed_min_mps=0.5, speed_max_mps=1.5)
    strait = plan(region, BOAT, settings).survey
    zone = strait.targets[0].set.polygon.buffer(-3.0)
    assert not zone.intersects(shapely.union_all(list(strait.corridors[7:])))
    _, report, revisions, *_ = sail(tmp_path / "s.gpkg", strait, [zone], 7, replans=True)
    assert report.ended is EndReason.COMPLETE
    assert len(revisions) == 1


def test_when_nothing_is_left_to_visit_the_boat_comes_home(tmp_path, survey):
    """All but the first row's cells are closed."""
    start = (survey.start.north_m, survey.start.east_m)
    done = shapely.union_all([t.set.polygon for t in survey.targets[:5]])
    zone = WATER.difference(done.buffer(0.5)).buffer(-0.2)
    zones = [p for p in shapely.get_parts(zone) if not p.contains(shapely.Point(start))]
    closer, report, *_ = sail(tmp_path / "s.gpkg", survey, zones, 5, replans=True)
    assert report.ended is EndReason.CAME_HOME
    assert np.hypot(*(np.array(closer.places[-1]) - start)) < 10.0


def test_an_area_is_closed_even_without_replanning(tmp_path, survey):
    zone = survey.targets[8].set.polygon
    closer, report, revisions, *_ = sail(tmp_path / "s.gpkg", survey, [zone], 4)
    assert closer.outside(zone)
    assert report.ended is EndReason.COMPLETE
    assert [one.reason for one in revisions] == ["planned", "closed"]


WAVY = shapely.Point(40, 40).buffer(40).union(shapely.Point(95, 40).buffer(25))


@pytest.fixture(scope="module")
def wavy(survey):
    """A lake with a round coast, which cuts cells into polygons with many short sides."""
    region = Region(name="wavy", frame=survey.frame, water=shapely.Polygon(WAVY.exterior))
    settings = PlanSettings(cell_m=12.0, speed_min_mps=0.5, speed_max_mps=1.5)
    return plan(region, BOAT, settings).survey


@pytest.mark.parametrize("seed", range(6))
def test_the_rest_of_a_lake_with_a_round_coast_can_be_replanned(wavy, seed):
    rng = np.random.default_rng(seed)
    reached = int(rng.integers(3, len(wavy.targets) - 5))
    place = wavy.targets[reached - 1].set.centre
    zone = shapely.Point(*rng.uniform(15, 70, 2)).buffer(rng.uniform(3, 9))
    open_ = open_water(wavy, water_of(wavy)).closing([zone], place)
    new = replanned(
        first_revision(wavy), wavy, open_, Halfway(reached=reached, place=place), vessel=BOAT,
        weather=CALM, reason="closed", note="",
    )  # fmt: skip
    assert len(new.targets) > reached
    assert not any(t.set.polygon.intersection(zone).area > 1e-6 for t in new.targets[reached:])


def test_a_second_area_is_fenced_off_from_a_boat_that_is_still_in_the_first(survey):
    enclosure = Enclosure()
    enclosure.draw(survey, (30.0, 30.0))
    assert enclosure.contains((30.0, 30.0))
    first, second = shapely.box(25, 25, 35, 35), shapely.box(40, 25, 50, 35)
    enclosure.close([first], (30.0, 30.0))
    enclosure.close([second], (30.0, 30.0))
    assert enclosure.contains((30.0, 30.0))
    assert not enclosure.fence.contains((45.0, 30.0))
    assert enclosure.contains((37.0, 30.0))
    assert not enclosure.fence.contains((30.0, 30.0))
    # A boat that leaves a zone is fenced in on the side on which it left.
    across = Enclosure()
    across.draw(survey, (29.0, 30.0))
    assert across.contains((29.0, 30.0))
    across.close([shapely.box(25, -1, 35, 61)], (29.0, 30.0))
    assert across.contains((40.0, 30.0))
    assert across.fence.contains((50.0, 30.0))
    assert not across.fence.contains((10.0, 30.0))


def test_a_boat_whose_route_home_a_closed_area_blocks_holds_its_position(tmp_path, survey):
    """It was once led across the area, or left at its edge without thrust."""
    start, place = survey.start, survey.targets[5].set.centre
    away = np.array(place) - (start.north_m, start.east_m)
    axis = int(np.argmax(np.abs(away)))
    middle = 0.5 * (place[axis] + (start.north_m, start.east_m)[axis])
    bar = (
        shapely.box(middle - 2, -1, middle + 2, 61)
        if axis == 0
        else shapely.box(-1, middle - 2, 61, middle + 2)
    )
    home = RouteHome(replace(survey, no_go=(bar,)), SafetySettings())
    state = (place[0], place[1], 0.0, 0.0, 0.0, 0.0)
    assert home.cost(Observation(time_s=0.0, state=state), CALM, BOAT) == (np.inf, np.inf)
    assert home.is_closed
    assert "blocks the route home" in home.no_route
    assert not home.set_out(Observation(time_s=0.0, state=state), BOAT, lambda _: None)


def test_an_area_closed_during_replanning_is_avoided_afterwards(survey, monkeypatch):
    """The other order once failed, and the area was forgotten."""
    plans = Replanner(
        survey=survey, plan=SharedPlan(revision=first_revision(survey)), vessel=BOAT,
        helm_of=lambda _: None, waits=True,
    )  # fmt: skip
    place = survey.targets[3].set.centre
    monkeypatch.setattr("grebe.mission.replanning.connected", lambda *_: [].pop())
    plans._ask("resumed", "", 4, place, CALM)
    plans.close([survey.targets[8].set.polygon], 4, place, CALM)
    assert plans.ready(4, place, CALM) is None
    assert plans.is_busy
    new = plans.ready(4, place, CALM)
    assert new.revision.reason == "closed"
    assert survey.targets[8].seq not in {t.seq for t in new.survey.targets}
    assert not plans.is_busy


def test_an_order_for_another_weather_that_cannot_be_made_leaves_the_old_one(survey, monkeypatch):
    plans = Replanner(
        survey=survey, plan=SharedPlan(revision=first_revision(survey)), vessel=BOAT,
        helm_of=lambda _: None, waits=True,
    )  # fmt: skip
    monkeypatch.setattr("grebe.mission.replanning.replanned", lambda *_, **__: [].pop())
    plans._ask("weather", "", 4, (10.0, 10.0), CALM)
    assert plans.ready(4, (10.0, 10.0), CALM) is None
    assert "IndexError" in plans.why_kept
    assert not plans.is_busy


def test_routes_home_around_a_closed_area_are_computed_in_the_background(survey, monkeypatch):
    """On a large lake that takes seconds, in which the boat must still be steered."""
    measured, go = [], threading.Event()
    whole = RouteHome.measure

    def slowly(self):
        go.wait(10)
        whole(self)
        measured.append(self)

    monkeypatch.setattr(RouteHome, "measure", slowly)
    told = lambda *_, **__: None  # noqa: E731
    guard = Guard(survey, BOAT, SafetySettings(), told, NOW, waits=False)
    observation = Observation(time_s=0.0, state=(30.0, 30.0, 0.0, 0.0, 0.0, 0.0))
    guard.assess(observation, CALM, (0.0, 0.0), 0)
    before, zone = guard._home, shapely.box(40, 40, 50, 50)
    guard.close([zone], observation)
    assert guard._home is before
    assert not guard._enclosure.fence.contains((45.0, 45.0))
    go.set()
    while not measured:
        time.sleep(0.01)
    guard.assess(replace(observation, time_s=0.1), CALM, (0.0, 0.0), 0)
    assert guard._home is measured[0]
