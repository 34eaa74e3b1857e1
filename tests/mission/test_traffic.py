"""Boats keep apart: claims that never touch, turns that never overlap, and complete fleets."""

from __future__ import annotations

import math
import threading
from dataclasses import replace

import numpy as np
import pytest
import shapely
from conftest import FRAME, NOON
from hypothesis import given
from hypothesis import strategies as st

from grebe.control.separation import AnnouncedPath
from grebe.core.dynamics import Weather
from grebe.core.errors import LinkError, UsageError
from grebe.core.events import EndReason, SafetyChanged
from grebe.core.plan_settings import FleetSettings, PlanSettings
from grebe.core.revision import survey_of
from grebe.core.vessel import PRESETS
from grebe.io.store import SurveyFile
from grebe.links.base import Reading
from grebe.links.simulated import EstimateErrors
from grebe.mission.departure import prepare
from grebe.mission.round_robin import RoundRobin
from grebe.mission.safety.lookout import STUCK_S, Lookout
from grebe.mission.safety.traffic import Traffic
from grebe.mission.safety.waiting import Waiting
from grebe.planning.fleets.shares import plan_fleet
from grebe.planning.region import Region
from grebe.simulation.faults import NO_FAULTS, Faults
from grebe.workflow.files import write_survey
from grebe.workflow.fleets import FleetRun
from grebe.workflow.instruments import boat_and_instrument, of_fleet, of_one_boat
from grebe.workflow.run import steered_by
from grebe.workflow.simulated import SimulatedWorld

ways = st.lists(st.tuples(st.floats(0, 60), st.floats(0, 60)), min_size=1, max_size=5).map(np.array)


@given(claims=st.lists(st.tuples(st.integers(1, 4), ways), max_size=20))
def test_whatever_is_claimed_no_two_claims_come_nearer_than_stated(claims):
    traffic = Traffic(apart_m=8.0)
    held = {}
    for boat, path in claims:
        if traffic.claim(boat, path):
            held[boat] = shapely.LineString(path) if len(path) > 1 else shapely.Point(path[0])
        for a, one in held.items():
            for b, other in held.items():
                # Paths are rounded by centimetres, for which the distance has enough room.
                assert a == b or one.distance(other) >= 8.0


def test_of_boats_that_wait_the_first_has_the_right_of_way():
    traffic, path = Traffic(apart_m=5.0), np.array([(0, 0), (10, 0)])
    traffic.wish(1, path)
    # Others plan with a boat under way, which needs no more room than its plan.
    assert traffic.wished(2).is_empty
    assert not traffic.wished(2, by_all=True).is_empty
    traffic.waits(1, Waiting(claimed_by=frozenset({2})))
    assert not traffic.wished(2).is_empty
    assert traffic.in_the_way(2, path).wished_by == {1}
    assert traffic.wished(1).is_empty
    traffic.wish(2, path)
    traffic.waits(2, Waiting(claimed_by=frozenset({1})))
    assert traffic.wished(1).is_empty
    assert traffic.in_the_way(1, path).wished_by == frozenset()
    traffic.leave(1)
    assert traffic.wished(2).is_empty


def test_a_boat_that_has_announced_nothing_lies_where_its_claim_ends():
    traffic = Traffic(apart_m=5.0)
    traffic.claim(1, np.array([(0.0, 0.0), (0.0, 4.0)]))
    traffic.claim(2, np.array([(20.0, 0.0)]))
    traffic.announce(2, AnnouncedPath(times_s=np.array([0.0, 5.0]), places=np.eye(2) * 20.0))
    assert traffic.announced(2)[0].at(np.array([7.0])).tolist() == [[0.0, 4.0]]
    assert traffic.announced(1)[0].at(np.array([2.5])).tolist() == [[10.0, 10.0]]
    # A boat that has ended stays there, without a wish; a boat ashore is in nobody's way.
    traffic.leave(2)
    assert traffic.announced(1)[0].at(np.array([2.5])).tolist() == [[20.0, 0.0]]
    traffic.leave(1, ashore=True)
    assert traffic.announced(2) == []


def test_who_does_not_come_nearer_for_others_waits_for_them_as_one_that_was_stopped():
    traffic = Traffic(apart_m=5.0)
    boat, place, towards = Lookout(traffic=traffic, boat=1), (0.0, 0.0), (10.0, 0.0)
    traffic.claim(1, np.array([place]))
    # Within the distance that plans keep, and outside that of claims.
    traffic.claim(2, np.array([(10.0, 7.5)]))
    boat.wish(place, towards)
    for time_s in np.arange(0.0, STUCK_S + 1.0):
        assert traffic.wished(2).is_empty
        boat.goes(place, float(time_s))
    boat.goes(place, STUCK_S + 1.0)
    assert not traffic.wished(2).is_empty
    boat.goes((1.0, 0.0), STUCK_S + 2.0)
    assert traffic.wished(2).is_empty
    # If nobody is in the way, the boat does not wait for others.
    traffic.claim(2, np.array([(10.0, 30.0)]))
    boat.goes((1.0, 0.0), 3 * STUCK_S)
    assert traffic.wished(2).is_empty


def test_a_wish_goes_through_the_next_sets_up_to_its_length():
    traffic = Traffic(apart_m=5.0)
    boat = Lookout(traffic=traffic, boat=1)
    boat.wish((0.0, 0.0), (2.0, 0.0), (4.0, 0.0), (4.0, 50.0))
    (wish,) = traffic._wishes.values()
    assert wish.length == pytest.approx(12.0)
    assert wish.distance(shapely.Point(4.0, 8.0)) < 1e-9
    boat.wish((0.0, 0.0), (2.0, 0.0))
    (wish,) = traffic._wishes.values()
    assert wish.length == pytest.approx(2.0)
    boat.wish((0.0, 0.0))
    assert not traffic._wishes


def test_in_a_round_robin_one_acts_at_a_time_and_in_order():
    robin, said, busy = RoundRobin([1, 2, 3]), [], []

    def act(boat, turns):
        for _ in range(turns):
            robin.wait(boat)
            busy.append(boat)
            assert len(busy) == 1
            said.append(boat)
            busy.clear()
            robin.end(boat)
        robin.leave(boat)

    threads = [threading.Thread(target=act, args=pair) for pair in ((1, 3), (2, 1), (3, 2))]
    for thread in threads:
        thread.start()
    for thread in threads:
        thread.join(10)
    assert said == [1, 2, 3, 1, 3, 1]


def fleet_file(path, boats=3, apart_m=6.0, side=60.0, starts=(), vessels=()):
    region = Region(name="x", frame=FRAME, water=shapely.box(0, 0, side, side))
    lonlat = tuple((lon, lat) for lon, lat in FRAME.to_wgs84(starts).tolist()) if starts else ()
    fleet = FleetSettings(boats=boats, apart_m=apart_m, starts=lonlat, vessels=vessels)
    wishes = PlanSettings(cell_m=10.0, fleet=fleet)
    planned = plan_fleet(region, PRESETS["spyboat"], wishes)
    write_survey(path, planned.survey, revision=planned.revision)
    return path


def sailed(path, world, faults=None):
    """Sail a fleet; return its report, its changes, and the least distance between true boats."""
    plants, least, changes = {}, [math.inf], []

    def boat_at(boat, departure):
        of_boat = replace(world, boat=boat, faults=(faults or {}).get(boat, NO_FAULTS))
        link = of_boat(departure)
        plants[boat] = link._plant
        return link

    def hear(event):
        if isinstance(event, SafetyChanged):
            changes.append(event)
        places = [np.array(plant.state[:2]) for plant in plants.values()]
        for i, one in enumerate(places):
            for other in places[:i]:
                least[0] = min(least[0], float(np.hypot(*(one - other))))

    with SurveyFile.open(path) as file:
        report = FleetRun(file, boat_at, steered_by(), watches=lambda _: [hear]).run(NOON)
    return report, changes, least[0]


MIDDLE = ((26.0, 26.0), (26.0, 36.0), (36.0, 26.0))


@pytest.mark.slow
def test_boats_that_set_out_side_by_side_do_it_all_and_keep_apart(tmp_path):
    path = fleet_file(tmp_path / "f.gpkg", starts=MIDDLE)
    world = SimulatedWorld(
        weather=Weather(current_north_mps=0.2, current_east_mps=-0.1),
        errors=EstimateErrors(position_m=0.2, velocity_mps=0.03),
    )
    report, changes, least = sailed(path, world)
    assert report.complete
    assert least >= 6.0
    assert all(one.ended is EndReason.COMPLETE for *_, one in report.missions)
    with SurveyFile.open(path) as file:
        track, samples = file.track(), file.samples()
        assert [int(one.boat[0]) for one in track.each_boat()] == [1, 2, 3]
        for one in track.each_boat():
            assert np.all(np.diff(one.seconds) >= 0)
        assert sorted(len(one) for one in samples.each_boat()) > [0, 0, 0]
        assert any(event.message.startswith("boat 2: ") for event in file.events())
    assert all(one.code != "fence_near" for one in changes)


@pytest.mark.slow
def test_a_fleet_does_the_same_twice(tmp_path):
    tracks = []
    for name in ("a", "b"):
        path = fleet_file(tmp_path / f"{name}.gpkg", boats=2, side=40.0)
        sailed(path, SimulatedWorld(seed=4))
        with SurveyFile.open(path) as file:
            track = file.track()
        tracks.append([one.states for one in track.each_boat()])
    for one, other in zip(*tracks, strict=True):
        assert np.array_equal(one, other)


@pytest.mark.slow
def test_unlike_boats_sail_together_each_as_what_it_is(tmp_path):
    """The rest of the small boat's part is replanned for the large one."""
    vessels = (PRESETS["otter"], PRESETS["spyboat"])
    path = fleet_file(tmp_path / "f.gpkg", boats=2, side=60.0, vessels=vessels)
    with SurveyFile.open(path) as file:
        assert file.survey.settings.fleet.vessels == vessels
        for sortie in file.revision.sorties:
            assert prepare(file, NOON, sortie=sortie.number).vessel == vessels[sortie.boat - 1]
    report, _, least = sailed(path, SimulatedWorld())
    assert report.complete
    assert least >= 6.0
    again = fleet_file(tmp_path / "g.gpkg", boats=2, side=60.0, vessels=vessels)
    report, _, _ = sailed(again, SimulatedWorld(), {2: Faults(blind=((20.0, 1e9),))})
    assert report.reached >= report.targets - 3
    with SurveyFile.open(again) as file:
        assert file.revision.reason == "boat_lost"
        heir = file.revision.sorties[1]
        assert heir.boat == 1
        assert survey_of(file.survey, file.revision, heir).vessel == vessels[0]


@pytest.mark.slow
def test_what_a_lost_boat_has_left_is_taken_by_another(tmp_path):
    path = fleet_file(tmp_path / "f.gpkg", boats=2, side=50.0)
    report, _, _ = sailed(path, SimulatedWorld(), {2: Faults(blind=((10.0, 1e9),))})
    assert report.missions[1][2].ended is EndReason.BLIND
    with SurveyFile.open(path) as file:
        assert file.revision.reason == "boat_lost"
        assert {one.boat for one in file.revision.sorties} == {1}
    # No boat goes to where the lost boat is.
    assert report.reached >= report.targets - 3


def test_where_one_boat_does_not_answer_the_others_are_left_in_good_order(tmp_path):
    path, opened = fleet_file(tmp_path / "f.gpkg", boats=2, side=40.0), []

    def boat_at(boat, departure):
        if boat == 2:
            raise LinkError("Boat 2 does not answer.")
        opened.append(SimulatedWorld()(departure))
        return opened[0]

    with SurveyFile.open(path) as file, pytest.raises(LinkError, match="Boat 2"):
        FleetRun(file, boat_at, steered_by()).run(NOON)
    assert not opened[0].status().armed


@pytest.mark.slow
def test_a_large_boat_that_needs_room_to_turn_is_given_it(tmp_path):
    """Two boats launched side by side, the large one first, once waited for each other for ever."""
    vessels = (PRESETS["otter"], PRESETS["spyboat"])
    path = fleet_file(tmp_path / "f.gpkg", boats=2, side=60.0, vessels=vessels)
    world = SimulatedWorld(
        weather=Weather(current_north_mps=0.2),
        errors=EstimateErrors(position_m=0.2, velocity_mps=0.03),
    )
    report, _, least = sailed(path, world)
    assert report.complete
    assert least >= 6.0


class Sonde:
    """A pH probe with its own connection that always has a reading."""

    keys, silent = ("ph",), ()

    def readings(self):
        return [Reading(age_s=0.0, values={"ph": 6.5})]

    def notes(self):
        return []

    def close(self):
        pass


def test_a_boat_of_a_fleet_has_a_sonde_of_its_own(tmp_path):
    path = fleet_file(tmp_path / "f.gpkg", boats=2, side=40.0)
    world = SimulatedWorld()
    with SurveyFile.open(path) as file:
        report = FleetRun(
            file,
            lambda boat, departure: replace(world, boat=boat)(departure),
            steered_by(),
            instruments={2: Sonde()},
        ).run(NOON)
        assert report.complete
        samples = file.samples()
    of_second = np.isclose(samples.values["ph"], 6.5)
    assert set(samples.boat[of_second]) == {2}
    assert of_second.sum() > 20
    # The boat's own sonde no longer gives it, but that of the other boat does.
    assert not np.isfinite(samples.values["ph"][(samples.boat == 2) & ~of_second]).any()
    assert np.isfinite(samples.values["ph"][samples.boat == 1]).any()


def test_an_instrument_of_a_fleet_needs_its_boat():
    one, two = Sonde(), Sonde()
    assert boat_and_instrument("2=tcp:h:1@ysi-exo") == (2, "tcp:h:1@ysi-exo")
    assert boat_and_instrument("serial:/dev/x@ysi-exo") == (None, "serial:/dev/x@ysi-exo")
    assert of_one_boat({None: one}) is one
    assert of_one_boat({}) is None
    assert of_fleet({1: one, 2: two}, 2) == {1: one, 2: two}
    with pytest.raises(UsageError, match="leave its number out"):
        of_one_boat({2: one})
    for wrong in ({None: one}, {3: one}, {0: one}):
        with pytest.raises(UsageError, match="say which of them"):
            of_fleet(wrong, 2)
