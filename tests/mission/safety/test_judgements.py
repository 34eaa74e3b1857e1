"""Judgements without a boat: reserves, thrust without motion, dead thrusters, settings."""

import math
from dataclasses import replace
from datetime import datetime

import numpy as np
import pytest

from grebe.core.dynamics import CALM, Weather
from grebe.core.errors import UsageError
from grebe.core.vessel import PRESETS, vessel_named
from grebe.mission.safety.machine import (
    at_the_fence,
    next_memory,
    without_estimates,
    without_route_home,
)
from grebe.mission.safety.memory import Asked, Memory, Request
from grebe.mission.safety.reserve import Battery, must_go_home, route_home_s, updated_battery
from grebe.mission.safety.settings import SafetySettings
from grebe.mission.safety.states import Cause, Facts, SafetyState
from grebe.mission.safety.stuck import Motion
from grebe.mission.safety.thrusters import Turning, dead_thruster, updated_turning
from grebe.simulation.plant import Plant

BOAT = vessel_named("spyboat")
REST = (0.0,) * 6
EASY = SafetySettings(home_share=0.0, home_slack_s=0.0)


def facts(time_s=0.0, **what):
    known = {"elapsed_s": time_s, "state": REST, "weather": CALM}
    return Facts(time_s=time_s, **(known | what))


@pytest.mark.parametrize(
    "wrong",
    [
        {"battery_reserve": 1.0},
        {"battery_wh": 0.0},
        {"max_s": 0.0},
        {"until": datetime(2026, 1, 1)},
        {"weaker_share": 0.0},
        {"reaction_s": -1.0},
        {"tries": 0},
        {"blind_s": math.nan},
        {"mute_s": math.nan},
    ],
    ids=str,
)
def test_impossible_settings_are_refused(wrong):
    with pytest.raises(UsageError):
        SafetySettings(**wrong)


def test_the_boat_goes_home_when_the_time_left_is_that_of_the_route_home():
    settings = replace(EASY, max_s=100.0)
    assert must_go_home(Battery(), facts(69.0, home_s=30.0), settings) is None
    assert must_go_home(Battery(), facts(70.0, home_s=30.0), settings).cause is Cause.TIME


def test_reserves_for_the_route_home_bring_it_home_earlier():
    settings = SafetySettings(max_s=100.0, home_share=0.5, home_slack_s=5.0)
    assert must_go_home(Battery(), facts(49.0, home_s=30.0), settings) is None
    assert must_go_home(Battery(), facts(50.0, home_s=30.0), settings).cause is Cause.TIME


def test_daylight_counts_as_time_does():
    assert must_go_home(Battery(), facts(home_s=30.0, light_s=31.0), EASY) is None
    found = must_go_home(Battery(), facts(home_s=30.0, light_s=30.0), EASY)
    assert found.cause is Cause.DAYLIGHT


def test_a_battery_s_consumption_is_measured():
    battery = Battery()
    for second in range(101):
        share = 0.9 - 0.002 * second
        battery = updated_battery(battery, facts(float(second), battery_share=share))
    assert battery.share_per_s == pytest.approx(0.002)
    # 0.7 is left and 0.2 must stay, which is enough for 250 s.
    assert must_go_home(battery, facts(100.0, home_s=249.0), EASY) is None
    assert must_go_home(battery, facts(100.0, home_s=251.0), EASY).cause is Cause.BATTERY


def test_a_new_battery_restarts_the_measurement():
    battery = updated_battery(Battery(), facts(0.0, battery_share=0.3))
    battery = updated_battery(battery, facts(60.0, battery_share=0.25))
    battery = updated_battery(battery, facts(61.0, battery_share=1.0))
    assert (battery.first, battery.share_per_s) == (1.0, None)


def test_a_battery_in_watt_hours_keeps_its_reserve():
    settings = replace(EASY, battery_wh=100.0, battery_reserve=0.2)
    known = {"home_s": 60.0, "home_wh": 10.0}
    assert must_go_home(Battery(), facts(used_wh=69.0, **known), settings) is None
    found = must_go_home(Battery(), facts(used_wh=70.0, **known), settings)
    assert found.cause is Cause.BATTERY


def test_a_route_against_the_current_takes_longer_and_an_impossible_one_infinitely_long():
    path = np.array([[0.0, 0.0], [100.0, 0.0]])
    calm, _ = route_home_s(BOAT, path, CALM, 2.0)
    against, _ = route_home_s(BOAT, path, Weather(current_north_mps=-1.0), 2.0)
    never, _ = route_home_s(BOAT, path, Weather(current_north_mps=-3.0), 2.0)
    assert 50.0 < calm < 60.0
    assert calm < against < math.inf == never


def weaving(share_port=1.0, share_starboard=1.0):
    """Return the class of a plant whose thrusters give a share of the commanded thrusts."""

    class Weak(Plant):
        def command(self, thrusts):
            super().command((share_port * thrusts[0], share_starboard * thrusts[1]))

    return Weak


@pytest.mark.parametrize("boat", PRESETS.values(), ids=lambda boat: boat.name)
@pytest.mark.parametrize(
    ("shares", "dead"),
    [((1.0, 1.0), None), ((0.6, 1.0), None), ((0.0, 1.0), "port"), ((1.0, 0.0), "starboard")],
)
def test_a_dead_thruster_is_distinguished_from_a_weak_and_a_sound_one(boat, shares, dead):
    plant, turning, thrusts = weaving(*shares)(boat, REST), Turning(), (0.0, 0.0)
    found = None
    for k in range(400):
        seen = facts(0.1 * k, state=tuple(plant.state), thrusts=thrusts)
        turning = updated_turning(turning, seen, boat)
        found = found or dead_thruster(turning)
        # Go ahead, weaving to both sides in turn as a helm does.
        side = 0.25 * math.sin(0.8 * k / 10)
        thrusts = ((0.3 + side) * boat.thrust_max_n, (0.3 - side) * boat.thrust_max_n)
        plant.command(thrusts)
        plant.advance(0.1)
    assert (found is None) == (dead is None)
    assert dead is None or dead in found.message


def test_a_survey_waits_for_its_sonde_unless_asked_to_go_on():
    settings = SafetySettings(mute_s=20.0)

    def at(time_s, memory, *, mute_s=0.0, asked=None):
        name = "the sonde" if mute_s else ""
        return next_memory(
            memory, facts(time_s, mute=name, mute_s=mute_s), settings, BOAT, asked or ()
        )

    waiting = at(31.0, at(30.0, Memory(), mute_s=20.0), mute_s=21.0)
    assert (waiting.state, waiting.cause) == (SafetyState.HOLDING, Cause.UNMEASURED)
    assert "the sonde has sent nothing for 21 s" in waiting.message
    again = at(50.0, waiting)
    assert (again.state, again.cause) == (SafetyState.SURVEYING, Cause.MEASURES)
    told = Asked(request=Request.GO_ON, why="temperature will do")
    without = at(60.0, waiting, mute_s=50.0, asked=(told,))
    assert without.state is SafetyState.SURVEYING
    assert at(90.0, without, mute_s=80.0).state is SafetyState.SURVEYING
    # After a reading its next silence counts again.
    spoken = at(100.0, without)
    assert at(130.0, spoken, mute_s=21.0).state is SafetyState.HOLDING


def test_a_boat_that_waits_goes_home_while_the_battery_lasts():
    settings = replace(EASY, max_s=100.0)
    held = next_memory(
        Memory(), facts(10.0), settings, BOAT, (Asked(request=Request.HOLD, why="wait"),)
    )
    assert next_memory(held, facts(69.0, home_s=30.0), settings, BOAT).state is SafetyState.HOLDING
    sent = next_memory(held, facts(70.0, home_s=30.0), settings, BOAT)
    assert (sent.state, sent.cause) == (SafetyState.RETURNING, Cause.TIME)


def test_the_states_and_how_they_follow_each_other():
    """From the survey to the fence and back, held, called home, and home."""
    settings = SafetySettings()
    memory = at_the_fence(Memory(), facts(1.0), settings, (0.0, 0.0))
    assert (memory.state, memory.cause) == (SafetyState.HOLDING, Cause.FENCE)
    memory = next_memory(memory, facts(3.0), settings, BOAT)
    assert (memory.state, memory.cause) == (SafetyState.SURVEYING, Cause.INSIDE_AGAIN)
    memory = next_memory(
        memory, facts(4.0), settings, BOAT, (Asked(request=Request.HOLD, why="wait"),)
    )
    assert (memory.state, memory.message) == (SafetyState.HOLDING, "wait")
    memory = without_estimates(memory, 5.0, 2.0, settings)
    assert memory.cause is Cause.BLIND
    memory = next_memory(memory, facts(6.0), settings, BOAT)
    assert (memory.state, memory.message) == (SafetyState.HOLDING, "wait")
    on = Asked(request=Request.GO_ON, why="now")
    memory = next_memory(memory, facts(6.5), settings, BOAT, (on,))
    memory = without_estimates(memory, 6.6, 2.0, settings)
    memory = next_memory(memory, facts(6.8), settings, BOAT)
    assert (memory.state, memory.cause) == (SafetyState.SURVEYING, Cause.SEES)
    asked = Asked(request=Request.HOME, why="rain")
    memory = next_memory(memory, facts(7.0, home_s=10.0), settings, BOAT, (asked,))
    assert (memory.state, memory.message) == (SafetyState.RETURNING, "rain")
    memory = next_memory(memory, facts(9.0, at_home=True), settings, BOAT)
    assert memory.state is SafetyState.STOPPED
    assert memory.end.value == "came_home"


def test_a_boat_that_is_braked_at_the_fence_too_often_goes_home_and_then_ends():
    settings = SafetySettings(fence_tries=1)
    memory = Memory()
    for state in (SafetyState.SURVEYING, SafetyState.RETURNING, SafetyState.RETURNING):
        memory = replace(memory, state=SafetyState.SURVEYING) if state is None else memory
        memory = at_the_fence(memory, facts(1.0), settings, (0.0, 0.0))
        assert memory.state is SafetyState.HOLDING
        assert memory.resumes is state
        memory = replace(memory, state=memory.resumes)
    memory = at_the_fence(memory, facts(1.0), settings, (0.0, 0.0))
    assert memory.end.value == "fence_not_kept"


def test_a_boat_without_a_route_home_ends_where_it_is():
    asked = Asked(request=Request.HOME, why="rain")
    memory = next_memory(Memory(), facts(), SafetySettings(), BOAT, (asked,))
    memory = without_route_home(memory, 1.0, "home is on land")
    assert memory.end.value == "home_not_reached"
    assert memory.message == "rain, but: home is on land"


def test_a_limit_that_is_none_sends_nobody_home():
    assert must_go_home(Battery(), facts(1e6, home_s=math.inf), EASY) is None


def test_what_is_asked_while_the_boat_must_be_freed_is_answered_after():
    """A boat called home at the estimate at which weeds are found goes home once it is free."""
    settings = SafetySettings()
    held = Motion(behind_m=99.0, since_s=0.0, time_s=60.0)
    asked = (Asked(request=Request.HOME, why="rain"),)
    memory = next_memory(Memory(motion=held), facts(60.0), settings, BOAT, asked)
    assert memory.state is SafetyState.FREEING
    free = next_memory(memory, facts(61.0 + settings.astern_s), settings, BOAT)
    home = next_memory(free, facts(62.0 + settings.astern_s), settings, BOAT)
    assert (home.state, home.message) == (SafetyState.RETURNING, "rain")


def test_simultaneous_requests_are_answered_in_order():
    both = (Asked(request=Request.HOME, why="rain"), Asked(request=Request.HOLD, why="a swimmer"))
    memory = next_memory(Memory(), facts(), SafetySettings(), BOAT, both)
    assert (memory.state, memory.resumes) == (SafetyState.HOLDING, SafetyState.RETURNING)
    assert memory.message == "a swimmer"
