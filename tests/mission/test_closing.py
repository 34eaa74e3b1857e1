"""An area is closed while the boat sails: it stays out, and visits what it still can."""

from datetime import UTC, datetime

import numpy as np
import pytest
import shapely

from grebe.core.events import EndReason, Estimate, Reached
from grebe.core.frames import LocalFrame
from grebe.core.plan_settings import PlanSettings
from grebe.core.vessel import PRESETS
from grebe.io.store import SurveyFile
from grebe.mission.settings import MissionSettings
from grebe.planning.planner import plan
from grebe.planning.region import Region
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
    """Closes zones once so many targets are reached, and knows where the boat was from then on."""

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
        """Whether the boat, once it has left a zone, keeps out of it."""
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


def test_an_area_that_is_in_nobodys_way_changes_no_order(tmp_path, survey):
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


def test_an_area_is_closed_without_leave_to_plan_anew_for_other_causes(tmp_path, survey):
    zone = survey.targets[8].set.polygon
    closer, report, revisions, *_ = sail(tmp_path / "s.gpkg", survey, [zone], 4)
    assert closer.outside(zone)
    assert report.ended is EndReason.COMPLETE
    assert [one.reason for one in revisions] == ["planned", "closed"]
