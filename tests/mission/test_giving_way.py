"""Boats that wait for each other go on, or home: rings of waiting, precedence, narrow water."""

from __future__ import annotations

import math
from dataclasses import replace

import numpy as np
import pytest
import shapely
from conftest import FRAME, NOON
from hypothesis import given
from hypothesis import strategies as st

from grebe.core.dynamics import CALM
from grebe.core.events import EndReason, Reached, SafetyChanged, Warned
from grebe.core.plan_settings import FleetSettings, PlanSettings, SortieSettings
from grebe.core.vessel import PRESETS
from grebe.io.store import SurveyFile
from grebe.links.base import Observation, Order
from grebe.links.simulated import SimulatedLink
from grebe.mission.safety.guard import Guard
from grebe.mission.safety.lookout import LONG_STUCK_S, LONGEST_WAIT_S, STUCK_S, Lookout
from grebe.mission.safety.memory import Request
from grebe.mission.safety.settings import SafetySettings
from grebe.mission.safety.states import Cause, SafetyState
from grebe.mission.safety.traffic import Traffic
from grebe.mission.safety.waiting import Stuck, Waiting, ring, who_gives_way
from grebe.planning.planner import plan
from grebe.planning.region import Region
from grebe.planning.sorties import plan_sorties
from grebe.simulation.plant import Plant
from grebe.workflow.files import write_survey
from grebe.workflow.fleets import FleetRun
from grebe.workflow.run import steered_by
from grebe.workflow.simulated import SimulatedWorld

APART_M = 8.0
numbers = st.integers(1, 5)
graphs = st.dictionaries(numbers, st.frozensets(numbers), max_size=5)


def line(*places):
    return np.array(places, dtype=float)


@given(graph=graphs, boat=numbers)
def test_a_ring_is_who_waits_for_each_other_and_nobody_else(graph, boat):
    waits = {one: Waiting(claimed_by=whom) for one, whom in graph.items()}
    after = np.zeros((6, 6), dtype=bool)
    for one, whom in graph.items():
        after[one, list(whom)] = True
    for _ in range(6):
        after |= after @ after
    mutual = {one for one in range(1, 6) if after[boat, one] and after[one, boat]}
    assert ring(waits, boat) == mutual


def test_the_boat_nearest_to_its_harbour_gives_way_if_it_can():
    waits = {
        1: Waiting(claimed_by=frozenset({2}), home_m=90.0),
        2: Waiting(claimed_by=frozenset({1}), home_m=40.0),
        3: Waiting(claimed_by=frozenset({1})),
    }
    assert who_gives_way(waits, frozenset({1, 2, 3})) == 2
    assert who_gives_way(waits, frozenset({1, 3})) == 1
    assert who_gives_way(waits, frozenset({3})) is None


def face_to_face(home_m=(100.0, 50.0)):
    """Two boats, 11 m apart, that have to pass each other and have waited for long."""
    traffic = Traffic(apart_m=APART_M, order=(1, 2))
    one = Lookout(traffic=traffic, boat=1, harbour=(-100.0, 0.0))
    two = Lookout(traffic=traffic, boat=2, harbour=(-100.0, 0.0))
    places = {1: (0.0, 0.0), 2: (11.0, 0.0)}
    for boat, place in places.items():
        assert traffic.claim(boat, line(place))

    def wait(until_s):
        for lookout, place, towards, home in (
            (one, places[1], (30.0, 0.0), home_m[0]),
            (two, places[2], (-30.0, 0.0), home_m[1]),
        ):
            lookout.wish(place, towards)
            for time_s in np.arange(0.0, until_s, 1.0):
                stuck = lookout.waits(place, towards, float(time_s), float(time_s), home)
            yield stuck

    return one, two, wait


def test_of_two_that_face_each_other_the_nearer_to_home_goes_there():
    one, two, wait = face_to_face()
    assert tuple(wait(STUCK_S)) == (Stuck.WAITS, Stuck.WAITS)
    one, two, wait = face_to_face()
    assert tuple(wait(STUCK_S + 3)) == (Stuck.WAITS, Stuck.GOES_HOME)
    two.sent_home(Cause.TRAFFIC)
    assert two.sails_again
    two.is_called = True
    assert not two.sails_again
    assert not one.sails_again


def test_while_one_gives_way_the_other_waits_unless_that_takes_long():
    _, two, wait = face_to_face(home_m=(100.0, math.inf))
    two.sent_home(Cause.TRAFFIC)
    tuple(wait(STUCK_S + 3))
    assert next(iter(wait(STUCK_S + 3))) is Stuck.WAITS
    _, two, wait = face_to_face(home_m=(100.0, math.inf))
    two.sent_home(Cause.TRAFFIC)
    tuple(wait(STUCK_S + 3))
    assert next(iter(wait(LONG_STUCK_S + 3))) is Stuck.GOES_HOME


def test_who_is_held_by_a_wish_alone_goes_before_its_turn_until_nobody_waits_for_it():
    traffic = Traffic(apart_m=APART_M, order=(1, 2))
    first = Lookout(traffic=traffic, boat=1)
    ahead = Lookout(traffic=traffic, boat=2)
    traffic.claim(1, line((0.0, 0.0)))
    traffic.claim(2, line((11.0, 0.0)))
    first.wish((0.0, 0.0), (60.0, 0.0))
    ahead.wish((11.0, 0.0), (60.0, 0.0))
    for time_s in np.arange(0.0, STUCK_S + 2, 1.0):
        behind = first.waits((0.0, 0.0), (60.0, 0.0), float(time_s), 0.0, math.inf)
        stuck = ahead.waits((11.0, 0.0), (60.0, 0.0), float(time_s), 0.0, math.inf)
        assert behind is Stuck.WAITS
        assert (stuck is Stuck.GOES_FIRST) == (time_s > STUCK_S)
    assert ahead.is_clear((11.0, 0.0), (60.0, 0.0))
    ahead.goes((11.0, 0.0), 9.0)
    ahead.wish((20.0, 0.0), (70.0, 0.0))
    assert ahead.is_clear((11.0, 0.0), (60.0, 0.0))
    first.goes((0.0, 0.0), 9.0)
    ahead.wish((30.0, 0.0), (80.0, 0.0))
    first.waits((0.0, 0.0), (60.0, 0.0), 10.0, 0.0, math.inf)
    assert not ahead.is_clear((11.0, 0.0), (60.0, 0.0))


def test_who_has_waited_for_too_long_gives_up_goes_home_or_waits_on():
    def asked(*, harbour, home_m, lies=False):
        traffic = Traffic(apart_m=APART_M, order=(1, 2))
        traffic.claim(1, line((0.0, 0.0)))
        traffic.claim(2, line((11.0, 0.0)))
        if lies:
            traffic.leave(2)
        boat = Lookout(traffic=traffic, boat=1, harbour=harbour)
        return boat.waits((0.0, 0.0), (60.0, 0.0), 0.0, LONGEST_WAIT_S + 1, home_m)

    assert asked(harbour=None, home_m=math.inf) is Stuck.GIVES_UP
    assert asked(harbour=(-50.0, 0.0), home_m=50.0) is Stuck.GOES_HOME
    assert asked(harbour=(-50.0, 0.0), home_m=math.inf) is Stuck.WAITS
    assert asked(harbour=(-50.0, 0.0), home_m=math.inf, lies=True) is Stuck.GIVES_UP


def test_who_is_ashore_claims_nothing_and_sets_out_once_its_place_is_clear():
    traffic, harbour = Traffic(apart_m=APART_M, order=(1, 2)), (0.0, 0.0)
    one, two = (
        Lookout(traffic=traffic, boat=boat, harbour=harbour, is_afloat=False) for boat in (1, 2)
    )
    assert one.launches(harbour)
    assert not two.launches(harbour)
    assert traffic.nearest_m(1, harbour) == math.inf
    traffic.claim(1, line((30.0, 0.0)))
    one.wish((30.0, 0.0), (0.0, 0.0))
    one.wish((20.0, 0.0), (0.0, 0.0))
    assert not two.launches(harbour)
    assert not two.is_alone
    one.over((1.0, 0.0), came_home=True)
    assert two.is_alone
    assert two.launches(harbour)


@pytest.mark.parametrize(("place", "taken"), [((30.0, 50.0), True), ((10.0, 30.0), False)])
def test_who_makes_room_goes_nowhere_that_another_has_claimed_meanwhile(monkeypatch, place, taken):
    water = Region(name="pond", frame=FRAME, water=shapely.box(0, 0, 60, 60))
    survey = plan(water, PRESETS["spyboat"], PlanSettings(cell_m=20.0)).survey
    traffic = Traffic(apart_m=APART_M, order=(1, 2))
    lookout = Lookout(traffic=traffic, boat=1)
    told = lambda *_, **__: None  # noqa: E731
    guard = Guard(survey, PRESETS["spyboat"], SafetySettings(), told, NOON, lookout=lookout)
    here = Observation(time_s=0.0, state=(30.0, 30.0, 0.0, 0.0, 0.0, 0.0))
    guard.ask(Request.HOLD, "it makes room")
    guard.assess(here, CALM, (0.0, 0.0), 0)
    assert guard.state is SafetyState.HOLDING
    traffic.claim(2, line((30.0, 50.0)))
    monkeypatch.setattr(Lookout, "place_to_wait", lambda *_: place)
    guard.assess(replace(here, time_s=0.1), CALM, (0.0, 0.0), 0)
    assert guard._memory.place == ((30.0, 30.0) if taken else place)


@pytest.mark.parametrize(
    ("cause", "renewed", "again"),
    [
        (Cause.TRAFFIC, (), True),
        (Cause.BATTERY, (), False),
        (Cause.BATTERY, (Cause.BATTERY,), True),
        (Cause.TIME, (Cause.BATTERY,), False),
        (Cause.DAYLIGHT, (Cause.BATTERY, Cause.TIME), False),
        (Cause.CURRENT, (Cause.BATTERY, Cause.TIME), False),
    ],
)
def test_who_came_home_sails_again_where_the_cause_is_none_any_more(cause, renewed, again):
    boat = Lookout(traffic=Traffic(apart_m=APART_M), boat=1, harbour=(0.0, 0.0), renewed=renewed)
    boat.sent_home(cause)
    assert boat.sails_again == again
    boat.is_called = True
    assert not boat.sails_again


def test_who_ends_on_the_water_keeps_its_claim():
    traffic = Traffic(apart_m=APART_M, order=(1, 2))
    lost = Lookout(traffic=traffic, boat=1, harbour=(0.0, 0.0))
    traffic.claim(1, line((3.0, 0.0)))
    lost.over((3.0, 0.0), came_home=False)
    assert traffic.nearest_m(2, (3.0, 0.0)) == 0.0


def test_a_simulated_boat_stays_where_it_was_launched_until_its_first_order():
    weather = SimulatedWorld().weather
    weather = replace(weather, current_north_mps=0.3)
    plant = Plant(PRESETS["spyboat"], (1.0, 2.0, 0.0, 0.0, 0.0, 0.0), weather)
    link = SimulatedLink(plant, sonde=None)
    seen = [link.observe() for _ in range(20)]
    assert seen[-1].state == seen[0].state
    assert seen[-1].time_s == pytest.approx(1.9)
    link.command(Order(thrusts=(0.0, 0.0), surge_mps=0.0, yaw_rate_radps=0.0))
    for _ in range(20):
        last = link.observe()
    assert last.state[0] > 1.2
    assert last.time_s == pytest.approx(3.9)


def narrow(path, width, at, vessels, minutes, cell_m):
    """A bent arm of a lake, 250 m long, and two different boats with one harbour in it."""
    bend = shapely.LineString([(0, 0), (125, 0), (125 + 125 * math.cos(0.7), 125 * math.sin(0.7))])
    water = bend.buffer(width / 2, cap_style="square", join_style="mitre")
    harbour = bend.interpolate(at, normalized=True)
    lonlat = FRAME.to_wgs84([(harbour.x, harbour.y)]).tolist()[0]
    wishes = PlanSettings(
        cell_m=cell_m,
        fleet=FleetSettings(boats=2, apart_m=APART_M, vessels=tuple(PRESETS[v] for v in vessels)),
        sorties=SortieSettings(minutes=minutes, harbours=(tuple(lonlat),)),
    )
    planned = plan_sorties(
        Region(name="arm", frame=FRAME, water=water), PRESETS[vessels[0]], wishes
    )
    write_survey(path, planned.survey, revision=planned.revision)


def sailed(path):
    """Sail it; return the report, the events, and the least distance of the true boats afloat."""
    plants, lookouts, events, least = {}, {}, [], [math.inf]

    def boat_at(boat, departure):
        link = replace(SimulatedWorld(), boat=boat)(departure)
        plants[boat] = link._plant
        return link

    def hear(event):
        if isinstance(event, SafetyChanged | Warned):
            events.append(event)
        afloat = [
            np.array(plant.state[:2])
            for boat, plant in plants.items()
            if boat in lookouts and boat in lookouts[boat].traffic._claims
        ]
        for i, one in enumerate(afloat):
            for other in afloat[:i]:
                least[0] = min(least[0], float(np.hypot(*(one - other))))

    def ready(boat, mission):
        lookouts[boat] = mission._lookout

    with SurveyFile.open(path) as file:
        run = FleetRun(file, boat_at, steered_by(), watches=lambda _: [hear], on_ready=ready)
        report = run.run(NOON)
    return report, events, least[0]


@pytest.mark.slow
def test_two_unlike_boats_with_one_harbour_in_a_narrow_arm_do_it_all(tmp_path):
    """They once set out from one place together, met, and waited for each other to the end."""
    narrow(tmp_path / "f.gpkg", 16.0, 0.5, ("heron", "blueboat"), 12.0, 8.0)
    report, events, least = sailed(tmp_path / "f.gpkg")
    assert report.complete
    assert APART_M <= least < math.inf
    assert any(event.code == "waits_ashore" for event in events)
    assert all(one.ended is EndReason.COMPLETE for *_, one in report.missions)


@pytest.mark.slow
def test_who_is_called_home_while_it_waits_ashore_stays_there(tmp_path):
    narrow(tmp_path / "f.gpkg", 16.0, 0.5, ("spyboat", "spyboat"), 12.0, 10.0)
    missions = {}

    def hear(event):
        if isinstance(event, Warned) and event.code == "waits_ashore":
            for mission in missions.values():
                mission.come_home("for a test")

    with SurveyFile.open(tmp_path / "f.gpkg") as file:
        report = FleetRun(
            file,
            lambda boat, departure: replace(SimulatedWorld(), boat=boat)(departure),
            steered_by(),
            watches=lambda _: [hear],
            on_ready=missions.__setitem__,
        ).run(NOON)
    ended = {boat: one for boat, _, one in report.missions}
    assert {one.ended for one in ended.values()} == {EndReason.CAME_HOME}
    assert {one.message for one in ended.values()} > {"the boat was called home before it set out"}
    assert len(report.missions) == 2


@pytest.mark.slow
@pytest.mark.parametrize("is_called", [False, True])
def test_who_came_home_for_others_sets_out_again_and_who_was_called_does_not(tmp_path, is_called):
    path = tmp_path / "f.gpkg"
    narrow(path, 16.0, 0.5, ("spyboat", "spyboat"), 12.0, 10.0)

    def ready(boat, mission):
        if boat == 1 and not readied:
            readied.append(mission)

    def hear(event):
        if isinstance(event, Reached) and event.count == 4 and not asked:
            asked.append(event)
            mission = readied[0]
            mission.come_home("for a test")
            mission._lookout.is_called = is_called
            mission._lookout.sent_home(Cause.TRAFFIC)

    readied, asked = [], []
    with SurveyFile.open(path) as file:
        report = FleetRun(
            file,
            lambda boat, departure: replace(SimulatedWorld(), boat=boat)(departure),
            steered_by(),
            watches=lambda boat: [hear] if boat == 1 else [],
            on_ready=ready,
        ).run(NOON)
        reasons = [one.reason for one in file.revisions()]
    assert report.complete
    ends = [(boat, one.ended) for boat, _, one in report.missions]
    assert ends[0] == (1, EndReason.CAME_HOME)
    assert ends[2:] == [(2 if is_called else 1, EndReason.COMPLETE)]
    assert ("boat_lost" in reasons) == is_called
