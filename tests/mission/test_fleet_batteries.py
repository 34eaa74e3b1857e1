"""The energy that a boat of a fleet has spent counts for every part; a closed part is no loss."""

from __future__ import annotations

import math
import shutil
from pathlib import Path

import pytest
import shapely
from conftest import FRAME, NOON

from grebe.core.events import EndReason, Reached
from grebe.core.plan_settings import FleetSettings, PlanSettings, SortieSettings
from grebe.core.vessel import PRESETS
from grebe.io.store import SurveyFile
from grebe.mission.consumption import AT_HARBOUR_M
from grebe.mission.safety.settings import SafetySettings
from grebe.mission.settings import MissionSettings
from grebe.planning.fleets.shares import plan_fleet
from grebe.planning.region import Region
from grebe.planning.sorties import plan_sorties
from grebe.simulation.faults import NO_FAULTS, Faults
from grebe.workflow.files import write_survey
from grebe.workflow.fleets import FleetRun
from grebe.workflow.moorings import moored_places
from grebe.workflow.run import steered_by
from grebe.workflow.simulated import SimulatedWorld

MINUTES, RESERVE = 20.0, 0.2


def fleet_file(path, sorties=None, side=50.0):
    region = Region(name="pond", frame=FRAME, water=shapely.box(0, 0, side, side))
    wanted = PlanSettings(cell_m=10.0, fleet=FleetSettings(boats=2, apart_m=6.0), sorties=sorties)
    planned = (plan_fleet if sorties is None else plan_sorties)(region, PRESETS["spyboat"], wanted)
    write_survey(path, planned.survey, revision=planned.revision)
    return path


def sailed(
    path, faults=None, settings=None, close=None, stop_at=None, resume=False, real=False, changed=()
):
    """Sail a fleet; return its report, and the settings with which each mission set out, in turn.
    `real` boats are simulated, but the fleet does not know it.
    """
    began = []

    def boat_at(boat, departure):
        return SimulatedWorld(boat=boat, faults=(faults or {}).get(boat, NO_FAULTS))(departure)

    def ready(boat, mission):
        began.append((boat, mission._settings.safety))
        missions.append(mission)

    def hear(boat, event):
        if close is not None and boat == 2 and isinstance(event, Reached) and event.count == 1:
            for mission in missions:
                mission.close(close, "closed")
        if stop_at is not None and isinstance(event, Reached) and event.count == stop_at:
            for mission in missions:
                mission.stop("enough")

    missions = []
    with SurveyFile.open(path) as file:
        report = FleetRun(
            file,
            boat_at,
            steered_by(),
            settings or MissionSettings(),
            shares_time=not real,
            watches=lambda boat: [lambda event: hear(boat, event)],
            on_ready=ready,
            changed=changed,
        ).run(NOON, resume=resume)
        return report, began, [one.reason for one in file.revisions()]


@pytest.mark.slow
def test_who_takes_over_what_another_has_left_sets_out_with_what_its_battery_has_left(tmp_path):
    blind = {2: Faults(blind=((10.0, 1e9),))}
    report, began, reasons = sailed(fleet_file(tmp_path / "f.gpkg"), blind)
    assert reasons[-1] == "boat_lost"
    assert [boat for boat, _ in began] == [1, 2, 1]
    assert [safety.used_wh for _, safety in began[:2]] == [0.0, 0.0]
    first = report.missions[0][2]
    assert began[2][1].used_wh == pytest.approx(first.energy_wh, rel=0.05)
    # A given battery is the one for the first departure, not a new one each time.
    named = MissionSettings(safety=SafetySettings(battery_wh=80.0, used_wh=0.0))
    _, began, _ = sailed(fleet_file(tmp_path / "g.gpkg"), blind, named)
    assert began[2][1].used_wh == pytest.approx(first.energy_wh, rel=0.05)


@pytest.mark.slow
def test_a_fleet_that_goes_on_has_less_time_by_what_each_boat_has_been_out(tmp_path):
    path = fleet_file(tmp_path / "f.gpkg", SortieSettings(minutes=MINUTES, reserve=RESERVE))
    most_s = 60 * MINUTES * (1 - RESERVE)
    report, began, _ = sailed(path, stop_at=6)
    assert report.stopped
    assert {safety.max_s for _, safety in began} == {most_s}
    spent = {boat: one.duration_s for boat, _, one in report.missions}
    _, again, _ = sailed(path, resume=True)
    for boat, safety in again[: len(spent)]:
        assert safety.max_s == pytest.approx(most_s - spent[boat], abs=2.0)
    # With a new battery the time counts from zero.
    other = fleet_file(tmp_path / "g.gpkg", SortieSettings(minutes=MINUTES, reserve=RESERVE))
    sailed(other, stop_at=6)
    fresh = MissionSettings(safety=SafetySettings(battery_wh=80.0, used_wh=0.0))
    _, again, _ = sailed(other, settings=fresh, resume=True)
    assert again[0][1].max_s == most_s


@pytest.mark.slow
def test_a_boat_whose_part_is_closed_comes_home_and_is_not_lost(tmp_path):
    path = fleet_file(tmp_path / "f.gpkg")
    with SurveyFile.open(path) as file:
        _, other = file.revision.sorties
        cells = file.revision.targets[other.first - 1 : other.last]
    # Close all cells of the second boat but the first, as soon as it has reached that.
    closed = [one.set.polygon.buffer(-0.5) for one in cells[1:]]
    report, _, reasons = sailed(path, {1: Faults(blind=((25.0, 1e9),))}, close=closed)
    ended = [(boat, one.ended) for boat, _, one in report.missions]
    assert ended[:2] == [(1, EndReason.BLIND), (2, EndReason.CAME_HOME)]
    # The second boat can take over the rest of the other's part.
    assert reasons[-1] == "boat_lost"
    assert ended[2][0] == 2


@pytest.mark.slow
def test_unlike_boats_set_out_each_with_its_own_battery_and_minutes(tmp_path):
    path = tmp_path / "f.gpkg"
    region = Region(name="pond", frame=FRAME, water=shapely.box(0, 0, 50, 50))
    fleet = FleetSettings(
        boats=2, apart_m=6.0, vessels=(PRESETS["spyboat"], PRESETS["blueboat"]),
        starts=tuple((lon, lat) for lon, lat in FRAME.to_wgs84([(5, 5), (45, 45)]).tolist()),
    )  # fmt: skip
    sorties = SortieSettings(batteries_wh=(40.0, 90.0), minutes_each=(20.0, 30.0))
    wanted = PlanSettings(cell_m=10.0, fleet=fleet, sorties=sorties)
    planned = plan_sorties(region, PRESETS["spyboat"], wanted)
    write_survey(path, planned.survey, revision=planned.revision)
    _, began, _ = sailed(path, stop_at=1)
    assert {boat: (safety.battery_wh, safety.max_s) for boat, safety in began} == {
        1: (40.0, pytest.approx(0.8 * 1200.0)),
        2: (90.0, pytest.approx(0.8 * 1800.0)),
    }


@pytest.fixture(scope="module")
def planned_in_rounds(tmp_path_factory):
    """A fleet of two with two sorties each, from harbours in the corners of a pond."""
    corners = FRAME.to_wgs84([(5, 5), (95, 95), (5, 95), (95, 5)]).tolist()
    harbours = tuple((lon, lat) for lon, lat in corners)
    path = tmp_path_factory.mktemp("rounds") / "f.gpkg"
    fleet_file(path, SortieSettings(minutes=3.3, harbours=harbours), side=100.0)
    with SurveyFile.open(path) as file:
        assert sorted(one.boat for one in file.revision.sorties) == [1, 1, 2, 2]
    return path


@pytest.fixture
def in_rounds(planned_in_rounds, tmp_path):
    """A copy of that plan, to be sailed."""
    return Path(shutil.copy(planned_in_rounds, tmp_path / "f.gpkg"))


@pytest.mark.slow
def test_a_real_boat_that_is_home_sets_out_again_only_in_a_run_that_somebody_begins(in_rounds):
    """It still has the battery with which it came home, until somebody has changed it."""
    report, began, _ = sailed(in_rounds, real=True)
    assert sorted(boat for boat, _ in began) == [1, 2]
    assert report.ashore == (1, 2)
    assert report.goes_on
    assert not report.complete
    report, began, _ = sailed(in_rounds, real=True, resume=True)
    assert sorted(boat for boat, _ in began) == [1, 2]
    assert report.complete
    assert report.ashore == ()
    assert not report.goes_on


@pytest.mark.slow
def test_who_comes_home_because_the_time_of_the_run_is_over_stays_there(in_rounds):
    """At the harbour a sortie's time begins again, but the run's time does not."""
    until = MissionSettings(safety=SafetySettings(max_s=70.0))
    report, began, _ = sailed(in_rounds, settings=until)
    assert [one.ended for *_, one in report.missions] == [EndReason.CAME_HOME] * 2
    assert sorted(boat for boat, _ in began) == [1, 2]
    assert 0 < report.reached < report.targets
    # With real boats, energy used before counts in a resumed run unless the operator says
    # otherwise.
    used_wh = {boat: one.energy_wh for boat, _, one in report.missions}
    _, began, _ = sailed(in_rounds, resume=True, real=True, stop_at=1, changed=(2,))
    first = dict(reversed(began))
    assert first[1].used_wh == pytest.approx(used_wh[1], rel=0.05)
    assert first[2].used_wh == 0.0
    assert first[1].max_s < first[2].max_s == 60 * 3.3 * 0.8


@pytest.mark.slow
def test_who_lies_near_a_harbour_without_having_come_home_keeps_others_away(in_rounds):
    """A boat that goes blind within its length of a harbour has not been taken ashore."""
    sailed(in_rounds, {2: Faults(blind=((2.0, 1e9),))}, stop_at=3)
    with SurveyFile.open(in_rounds) as file:
        ends = file.track_ends(2)
        assert ends is not None
        place = ends[1].state[:2]
        starts = [(one.start.north_m, one.start.east_m) for one in file.revision.sorties]
        assert min(math.dist(place, one) for one in starts) < AT_HARBOUR_M
        assert moored_places(file, sailing=(1,)) == {}
        assert moored_places(file, sailing=(1,), adrift=(2,)) == {2: pytest.approx(place)}
