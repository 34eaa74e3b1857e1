"""Complete small missions with faults: each ends for the right reason, always within the water."""

import itertools
import math
import threading
from dataclasses import replace
from datetime import timedelta

import numpy as np
import pytest
import shapely
from conftest import NOON, region_of, run_simulated

from grebe.control.controller import Command, Controller, StepStatus
from grebe.core.dynamics import Weather
from grebe.core.events import EndReason, Estimate, SafetyChanged, Step
from grebe.core.plan_settings import PlanSettings
from grebe.core.vessel import PRESETS
from grebe.io.store import SurveyFile
from grebe.links.base import IDLE, Reading
from grebe.links.simulated import EstimateErrors, SimulatedLink
from grebe.mission.events.recorders import MemoryRecorder
from grebe.mission.loop import Mission
from grebe.mission.safety.settings import CAREFUL, NO_FENCE, SafetySettings
from grebe.mission.settings import MissionSettings
from grebe.mission.trial import Conditions, meander, simulate
from grebe.planning.planner import plan_survey
from grebe.simulation.faults import NO_FAULTS, Faults, FaultyPlant
from grebe.simulation.plant import Plant
from grebe.simulation.sonde import UniformSonde

ELL = [(0, 0), (44, 0), (44, 16), (16, 16), (16, 44), (0, 44)]
SURVEY = plan_survey(
    region_of(ELL),
    PRESETS["spyboat"],
    PlanSettings(cell_m=8.0, speed_min_mps=0.5, speed_max_mps=1.5, shore_margin_m=1.0),
)
ACROSS = shapely.box(22, -1, 30, 17)
STILL = Weather()


class Sailed:
    """A mission that has been sailed: its report and its events."""

    def __init__(
        self,
        faults=NO_FAULTS,
        safety=CAREFUL,
        weather=STILL,
        asks=(),
        survey=SURVEY,
        helm=None,
        instruments=None,
    ):
        self.recorder, self.survey = MemoryRecorder(), survey
        plant = FaultyPlant(survey.vessel, survey.start.at_rest(), weather, faults)
        link = SimulatedLink(plant, UniformSonde(), faults=faults)
        helm = helm or Controller(survey.vessel, survey.sets, corridors=survey.corridors)
        left = sorted(asks, key=lambda ask: ask[0])

        def ask(event):
            if isinstance(event, Estimate) and left and event.elapsed_s >= left[0][0]:
                left.pop(0)[1](mission)

        settings = MissionSettings(safety=safety, limit_s=600.0)
        mission = Mission(
            survey, helm, link, self.recorder, settings,
            started=NOON, listeners=[ask], instruments=instruments,
        )  # fmt: skip
        self.report = mission.run()

    @property
    def codes(self):
        return [event.code for event in self.recorder.of(SafetyChanged)]

    @property
    def states(self):
        changes = self.recorder.of(SafetyChanged)
        for a, b in itertools.pairwise(changes):
            assert a.after == b.before
        return [event.after for event in changes]

    @property
    def stayed_in(self):
        places = [shapely.Point(event.state[:2]) for event in self.recorder.of(Estimate)]
        return all(shapely.covers(self.survey.water, places))

    def place(self):
        return shapely.Point(self.recorder.of(Estimate)[-1].state[:2])

    def away_from_home(self):
        start = self.survey.start
        return self.place().distance(shapely.Point(start.north_m, start.east_m))


@pytest.mark.parametrize("boat", ["spyboat", "benchmark", "blueboat", "heron", "otter"])
def test_the_fence_does_not_disturb_a_planned_mission(boat):
    """With and without the fence the mission is the same, bit for bit."""
    survey = replace_vessel(SURVEY, PRESETS[boat])
    fenced, free = Sailed(survey=survey), Sailed(survey=survey, safety=NO_FENCE)
    assert fenced.report.complete
    assert fenced.codes == []
    with_it, without = (one.recorder.of(Step) for one in (fenced, free))
    assert [step.thrusts for step in with_it] == [step.thrusts for step in without]


def replace_vessel(survey, vessel):
    return replace(survey, vessel=vessel)


class AtTheShore:
    """A helm that has lost its mind: it steers east at speed, whatever is there."""

    vessel, step_s, reached = SURVEY.vessel, 0.1, 0

    def step(self, state, weather, elapsed_s):
        turn = 3.0 * math.remainder(math.pi / 2 - state[2], 2 * math.pi) - 3.0 * state[5]
        turn = min(max(turn, -5.0), 5.0)
        thrusts = (6.0 + turn, 6.0 - turn)
        status = StepStatus.SOLVED
        return Command(thrusts=thrusts, plan=None, status=status, target=self.reached, split=0)


def test_a_helm_that_steers_ashore_is_braked_and_sent_home():
    one = Sailed(helm=AtTheShore())
    assert one.stayed_in
    assert one.codes.count("fence_near") == CAREFUL.fence_tries + 1
    assert one.states[:2] == ["holding", "surveying"]
    assert one.report.ended is EndReason.CAME_HOME
    assert one.away_from_home() < 3.0


def test_without_a_fence_the_same_helm_leaves_the_water():
    one = Sailed(helm=AtTheShore(), safety=NO_FENCE)
    assert not one.stayed_in


@pytest.mark.parametrize(
    ("what", "code"),
    [
        ({"faults": Faults(battery_share=0.5, battery_s=150.0)}, "battery_low"),
        ({"safety": SafetySettings(battery_wh=0.9)}, "battery_low"),
        ({"safety": SafetySettings(max_s=70.0)}, "time_short"),
        ({"safety": SafetySettings(until=NOON + timedelta(seconds=70))}, "daylight_short"),
        ({"asks": [(30.0, lambda mission: mission.come_home("rain"))]}, "asked_to_come_home"),
        *(
            ({"faults": Faults(rising=way, rises_until_s=48.0)}, "current_too_strong")
            for way in ((0.03, 0.0), (-0.022, -0.022), (0.0, -0.03))
        ),
    ],
    ids=["battery", "battery_wh", "time", "daylight", "asked", "north", "southwest", "west"],
)
def test_the_boat_comes_home_along_the_water_in_time(what, code):
    one = Sailed(**what)
    assert one.report.ended is EndReason.CAME_HOME
    assert one.codes[0] == code
    assert one.codes[-1] == "home_reached"
    assert one.stayed_in
    assert one.away_from_home() < 3.0
    assert 0 < one.report.reached < one.report.targets
    if code in ("time_short", "daylight_short"):
        assert one.report.duration_s < 70.0


def test_home_may_be_another_place_than_the_start():
    north, east = 40.0, 8.0
    lon, lat = SURVEY.frame.to_wgs84([[north, east]])[0]
    one = Sailed(safety=SafetySettings(max_s=70.0, home=(float(lon), float(lat))))
    assert one.report.ended is EndReason.CAME_HOME
    assert one.place().distance(shapely.Point(north, east)) < 2.0
    assert one.stayed_in


def test_a_boat_in_weeds_tries_astern_and_then_stops():
    one = Sailed(Faults(weeds=ACROSS))
    assert one.report.ended is EndReason.STUCK
    assert one.states.count("freeing") >= CAREFUL.tries
    assert one.stayed_in


def test_a_boat_that_comes_free_goes_on():
    one = Sailed(Faults(weeds=ACROSS, weeds_until_s=30.0))
    assert one.report.complete
    assert set(one.states) == {"freeing", "surveying"}


def test_a_boat_over_a_shoal_backs_off_and_then_stops():
    one = Sailed(Faults(depth_m=5.0, shoal=ACROSS))
    assert one.report.ended is EndReason.GROUNDED
    assert "water_too_shallow" in one.codes
    assert one.stayed_in


@pytest.mark.parametrize("side", ["port", "starboard"])
def test_a_boat_whose_thruster_dies_ends_its_mission_with_the_reason(side):
    one = Sailed(Faults(dead=side, dead_at_s=20.0))
    assert one.report.ended is EndReason.THRUSTER_DEAD
    assert side in one.report.message
    assert one.report.duration_s < 120.0
    assert one.stayed_in


@pytest.mark.parametrize("seed", [3, 15, 31])
def test_no_thruster_is_called_dead_for_a_current_that_is_not_known_yet(seed):
    """In an unknown current across its course, a hull may need one thruster's full moment to hold
    it: the coupling of surge and sway, Eq. (9), makes as much.
    """
    rng = np.random.default_rng(seed)
    around, where, heading, wind_from = rng.uniform(0, 2 * np.pi, 4)
    radius, boat = 100 * np.sqrt(rng.uniform()), PRESETS["benchmark"]
    weather = Weather(
        current_north_mps=0.5 * np.cos(around),
        current_east_mps=0.5 * np.sin(around),
        wind_force_north_n=10.0 * np.cos(wind_from),
        wind_force_east_n=10.0 * np.sin(wind_from),
    )
    noisy = EstimateErrors(velocity_mps=0.02)
    flight = simulate(
        boat,
        cells := meander(rows=4),
        Controller(boat, cells),
        (radius * np.cos(where), radius * np.sin(where), heading, 0, 0, 0),
        Conditions(weather=weather, errors=noisy, seed=seed, limit_s=40.0),
    )
    assert flight.report.ended is EndReason.OUT_OF_TIME


def test_a_current_beyond_reach_ends_the_mission_soon():
    one = Sailed(weather=Weather(current_north_mps=-4.0), safety=NO_FENCE)
    assert one.report.ended is EndReason.CURRENT_TOO_STRONG
    assert one.report.duration_s < 60.0


def test_a_blind_boat_is_braked_by_dead_reckoning_and_goes_on_when_it_sees():
    one = Sailed(Faults(blind=((20.0, 30.0),)))
    assert one.report.complete
    assert one.codes == ["no_estimates", "estimates_again"]
    after = next(e for e in one.recorder.of(Estimate) if e.elapsed_s >= 30.0)
    assert abs(after.state[3]) < 0.1
    assert one.stayed_in


def test_a_boat_that_stays_blind_ends_its_mission():
    one = Sailed(Faults(blind=((20.0, 1000.0),)))
    assert one.report.ended is EndReason.BLIND
    assert one.codes == ["no_estimates", "no_estimates"]
    assert 20.0 + CAREFUL.blind_s - 1.0 < one.recorder.events[-2].elapsed_s < 22.0 + CAREFUL.blind_s


def test_a_place_is_held_on_request_against_a_current_and_left_again():
    hold = (20.0, lambda mission: mission.hold_station("a ferry"))
    on = (60.0, lambda mission: mission.go_on("it has passed"))
    one = Sailed(asks=[hold, on], weather=Weather(current_north_mps=0.3))
    assert one.report.complete
    assert one.codes == ["asked_to_hold", "asked_to_go_on"]
    held = [e for e in one.recorder.of(Estimate) if 25.0 < e.elapsed_s < 60.0]
    places = [shapely.Point(e.state[:2]) for e in held]
    first = next(e for e in one.recorder.of(Estimate) if e.elapsed_s >= 20.0)
    anchor = shapely.Point(first.state[:2])
    assert max(shapely.distance(anchor, places)) < CAREFUL.hold_radius_m
    assert one.stayed_in


class Interrupted:
    """A sonde that gives no readings while it is unplugged."""

    keys = ("temperature_degc",)

    def __init__(self):
        self.silent = ()

    def unplug(self, _):
        self.silent = ("the sonde",)

    def plug(self, _):
        self.silent = ()

    def readings(self):
        return [] if self.silent else [Reading(age_s=0.0, values={"temperature_degc": 18.0})]

    def notes(self):
        return []

    def close(self):
        pass


def test_the_survey_waits_for_a_silent_sonde_and_goes_on_when_it_speaks():
    sonde = Interrupted()
    one = Sailed(asks=[(15.0, sonde.unplug), (60.0, sonde.plug)], instruments=sonde)
    assert one.report.complete
    assert one.codes == ["nothing_measured", "measured_again"]
    held = [e for e in one.recorder.of(Estimate) if 45.0 < e.elapsed_s < 60.0]
    assert max(math.hypot(*e.state[3:5]) for e in held) < 0.3
    assert one.stayed_in


class Noted(SimulatedLink):
    """A link that records its orders, and may keep an observer waiting."""

    def __init__(self, *given):
        super().__init__(*given)
        self.told, self.waits = [], None

    def command(self, order):
        self.told.append(order)
        super().command(order)

    def stop(self):
        self.told.append(IDLE)
        super().stop()

    def observe(self):
        if self.waits is not None and len(self.told) > 20:
            self.waits()
        return super().observe()


def stopped_while(waits_where):
    """Stop a mission from another thread while it waits; return the orders to the boat."""
    waiting, may_go_on = threading.Event(), threading.Event()

    def wait():
        waiting.set()
        assert may_go_on.wait(10.0)

    link = Noted(Plant(SURVEY.vessel, SURVEY.start.at_rest()), UniformSonde())
    helm = Controller(SURVEY.vessel, SURVEY.sets, corridors=SURVEY.corridors)
    if waits_where == "observe":
        link.waits = wait
    else:
        step = helm.step

        def slow(*given):
            if len(link.told) > 20:
                wait()
            return step(*given)

        helm.step = slow
    mission = Mission(SURVEY, helm, link, MemoryRecorder(), started=NOON)
    reports = []
    sailing = threading.Thread(target=lambda: reports.append(mission.run()))
    sailing.start()
    assert waiting.wait(60.0)
    mission.stop("stop")
    told = list(link.told)
    may_go_on.set()
    sailing.join(60.0)
    return told, link.told[len(told) :], reports[0]


@pytest.mark.parametrize("where", ["step", "observe"])
def test_a_stop_takes_the_thrust_away_before_it_returns_and_for_good(where):
    """Also while it solves a step or waits for an estimate; later decisions have no effect."""
    before, after, report = stopped_while(where)
    assert before[-1] == IDLE
    assert all(order == IDLE for order in after)
    assert (report.ended, report.message) == (EndReason.STOPPED, "stop")


def test_every_change_is_in_the_survey_file_and_a_boat_is_brought_home_afterwards(tmp_path):
    with SurveyFile.create(tmp_path / "s.gpkg", SURVEY, meta={}, force=True) as file:
        cut = run_simulated(file, settings=MissionSettings(limit_s=25.0))
        assert cut.ended is EndReason.OUT_OF_TIME
        home = MissionSettings(safety=SafetySettings(comes_home="asked"))
        report = run_simulated(file, settings=home, resume=True)
        assert report.ended is EndReason.CAME_HOME
        assert report.reached == file.progress().reached
        codes = [event.code for event in file.events()]
        assert codes[-3:] == ["asked_to_come_home", "home_reached", "came_home"]
        texts = [event.message for event in file.events() if event.code == "asked_to_come_home"]
        assert texts == ["surveying -> returning: asked"]


@pytest.mark.parametrize("share", [1, 20, 87])
def test_a_boat_that_takes_minutes_to_stop_never_leaves_the_water(share):
    light = replace(PRESETS["blueboat"], name="punt", thrust_max_n=25.0, thrust_min_n=-12.0)
    heavy = replace(
        light, m11_kg=23.1 * share, m22_kg=44.0 * share, m33_kgm2=9.3 * share, x_u=-15.0, x_uu=0.0,
        y_v=-60.0, n_r=-10.0,
    )  # fmt: skip
    one = Sailed(survey=replace_vessel(SURVEY, heavy))
    assert one.stayed_in
    # A boat that hardly responds to its thrusters may look like one held by weeds.
    assert one.report.ended in {
        EndReason.COMPLETE, EndReason.FENCE_NOT_KEPT, EndReason.OUT_OF_TIME, EndReason.STUCK,
    }  # fmt: skip
