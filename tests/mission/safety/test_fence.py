"""The fence: its predictions come true, and the boat stays inside."""

import itertools
import math

import numpy as np
import pytest
import shapely
from hypothesis import given
from hypothesis import strategies as st

from grebe.control.station import StationKeeper
from grebe.core.dynamics import CALM, Weather
from grebe.core.inner_loop import braking_share, held_motion, under_speed_control
from grebe.core.vessel import PRESETS, vessel_named
from grebe.mission.safety.fence import (
    FOLLOWED_DOUBT,
    FOLLOWED_S,
    MOST_DOUBT_M,
    Fence,
    braking_distance_m,
    dead_reckoned,
    escape,
    fence_of,
    predicted_stop,
)
from grebe.mission.safety.settings import CAREFUL
from grebe.simulation.autopilot import Autopilot, AutopilotSettings, Mode
from grebe.simulation.plant import Plant, mismatched

POND = Fence(water=shapely.box(-15, -15, 15, 15))
SHARE, REACTION_S = CAREFUL.weaker_share, CAREFUL.reaction_s
BOATS = pytest.mark.parametrize("boat", PRESETS.values(), ids=lambda boat: boat.name)


def test_without_drag_the_braking_distance_is_that_of_the_textbook():
    """It is u^2 / 2 a for a hull with hardly any drag, and u t for the reaction."""
    boat = vessel_named("tianjin")
    free = type(boat)(**{**vars_of(boat), "x_u": -1e-6, "x_uu": 0.0, "thruster_lag_s": 0.0})
    found = braking_distance_m(free, 1.0, CALM, reaction_s=0.5, weaker_share=0.4)
    slowing = 2 * 0.4 * 100.0 / free.m11_kg
    # The last centimetres per second are braked softly.
    assert found == pytest.approx(0.5 + 1 / (2 * slowing), abs=0.25)
    assert found > 0.5 + 1 / (2 * slowing)


def vars_of(boat):
    return {name: getattr(boat, name) for name in boat.__dataclass_fields__}


@BOATS
def test_the_braking_distance_grows_with_speed_with_the_wind_and_with_the_weaker_thruster(boat):
    slow, fast = (braking_distance_m(boat, speed, CALM) for speed in (0.5, 1.0))
    pushed = braking_distance_m(boat, 1.0, Weather(wind_force_north_n=3.0))
    weak = braking_distance_m(boat, 1.0, CALM, weaker_share=0.4)
    assert 0.5 * REACTION_S < slow < fast < pushed
    assert fast < weak


@BOATS
def test_what_is_foreseen_is_what_the_boat_does(boat):
    weather = Weather(current_north_mps=0.2, wind_force_east_n=2.0)
    state, refuge = (0.0, 0.0, 0.3, 0.9, 0.1, 0.05), (-3.0, 1.0)
    thrusts = [(4.0, 2.0)] * 5
    states = predicted_stop(POND, keeper(boat), state, thrusts, weather, refuge)
    plant = Plant(boat if boat.thruster_lag_s == 0 else without_lag(boat), state, weather)
    for k, ahead in enumerate(states[1:-1]):
        given = thrusts[k] if k < 5 else keeper(boat).keep(plant.state, weather, refuge)
        plant.command(given)
        plant.advance(0.1)
        assert plant.state[:2] == pytest.approx(ahead[:2], abs=0.01)


def without_lag(boat):
    return type(boat)(**{**vars_of(boat), "thruster_lag_s": 0.0})


@BOATS
@pytest.mark.parametrize("weather", [CALM, Weather(current_east_mps=0.3)], ids=["calm", "current"])
def test_whoever_steers_at_full_speed_at_the_shore_is_kept_in(boat, weather):
    """Full ahead from every bearing; the guard's law takes over and the boat never leaves."""
    boat, refused = without_lag(boat), 0
    for bearing in np.arange(0.0, 2 * math.pi, math.pi / 3):
        plant = Plant(boat, (0.0, 0.0, bearing, 0.0, 0.0, 0.0), weather)
        full = (boat.thrust_max_n, boat.thrust_max_n)
        refuge = None
        for _ in range(250):
            state = tuple(plant.state)
            if refuge is None and not may(boat, state, full, weather):
                refuge = POND.refuge(state[:2])
            thrusts = full if refuge is None else keeper(boat).keep(state, weather, refuge)
            plant.command(thrusts)
            plant.advance(0.1)
            assert POND.contains(tuple(plant.state[:2]))
        refused += refuge is not None
    # In the current some hulls only circle at full thrust, and never reach a shore.
    assert refused == 6 or weather is not CALM


def may(boat, state, thrusts, weather):
    escape_plan = escape(
        POND, keeper(boat), state, lambda _: thrusts, weather, reaction_s=REACTION_S
    )
    return escape_plan is not None


def keeper(boat):
    return StationKeeper(vessel=boat, weaker_share=SHARE)


@given(
    north=st.floats(-14, 14),
    east=st.floats(-14, 14),
    heading=st.floats(-3, 3),
    surge=st.floats(-0.5, 2.5),
)
def test_where_nothing_is_foreseen_because_the_fence_is_far_nothing_had_to_be(
    north, east, heading, surge
):
    boat = vessel_named("benchmark")
    state = (north, east, heading, surge, 0.0, 0.0)
    full = (boat.thrust_max_n, boat.thrust_max_n)
    escape_plan = escape(POND, keeper(boat), state, lambda _: full, CALM, reaction_s=REACTION_S)
    if escape_plan is not None and escape_plan.refuge is None:
        path = predicted_stop(POND, keeper(boat), state, [full] * 3, CALM, POND.refuge(state[:2]))
        assert POND.contains_path(path[:, :2])


def test_no_go_zones_are_outside():
    fence = fence_of(POND.water, [shapely.box(-2, -15, 2, 15)], (-8.0, 0.0))
    assert fence.contains((-8.0, 0.0))
    assert not fence.contains((0.0, 0.0))
    assert not fence.contains((8.0, 0.0))


def test_a_refuge_lies_inside_and_in_sight():
    bay = Fence(water=shapely.Polygon([(0, 0), (30, 0), (30, 30), (1, 30), (1, 1), (0, 1)]))
    for place in ((0.5, 0.5), (29.5, 29.5), (1.2, 20.0)):
        refuge = bay.refuge(place)
        assert bay.contains_path(np.array([place, refuge]))


def test_dead_reckoning_is_the_model():
    boat, state = vessel_named("spyboat"), (1.0, 2.0, 0.5, 1.0, 0.0, 0.1)
    plant = Plant(boat, state)
    plant.command((3.0, 2.0))
    plant.advance(1.0)
    assert dead_reckoned(boat, state, (3.0, 2.0), CALM, 1.0) == pytest.approx(plant.state, abs=1e-3)


HULLS = pytest.mark.parametrize("name", ["spyboat", "blueboat", "heron", "otter"])


@HULLS
@pytest.mark.parametrize("seed", range(3))
@pytest.mark.parametrize("speed_mps", [0.7, 1.5])
def test_behind_an_autopilot_a_boat_stops_no_later_than_is_foreseen_with_its_doubt(
    name, speed_mps, seed
):
    """Hulls differ from their model by a fifth. The stand-in ramps its speed, turns first, and
    brakes with the remaining thrust; Clearpath's Heron has hardly any astern.
    """
    hull = vessel_named(name)
    model = under_speed_control(hull)
    share = SHARE * braking_share(hull, model)
    keeper = StationKeeper(vessel=model, weaker_share=share, by_motion=True)
    plant = Plant(mismatched(hull, 0.2, seed), (0.0, 0.0, 0.0, speed_mps, 0.0, 0.0), CALM)
    pilot = Autopilot(plant, AutopilotSettings(seed=seed), mode=Mode.GUIDED, armed=True)
    for _ in range(30):
        pilot.follow(speed_mps, 0.0)
        pilot.advance(0.1)
    here = tuple(plant.state)
    lake = Fence(water=shapely.box(-100, -100, 100, 100))
    each = 0.5 * model.surge_drag_n(speed_mps)
    goes_on = [(each, each)] * round(10 * (REACTION_S + FOLLOWED_S))
    refuge = (here[0] - 2.0, here[1])
    path = predicted_stop(lake, keeper, here, goes_on, CALM, refuge)[:, 0] - here[0]
    farthest = 0.0
    for k in range(200):
        state = pilot.estimate()
        given = (each, each) if k < 10 * REACTION_S else keeper.keep(state, CALM, refuge)
        pilot.follow(*held_motion(model, state, given, CALM))
        pilot.advance(0.1)
        farthest = max(farthest, plant.state[0] - here[0])
    assert farthest < path.max() + min(FOLLOWED_DOUBT * path.max(), MOST_DOUBT_M)
    assert plant.state[0] < here[0]


@pytest.mark.parametrize("name", ["blueboat", "heron", "otter", "spyboat"])
def test_in_a_channel_hardly_wider_than_the_boat_a_predicted_stop_stays_inside(name):
    """A current sets across the channel. Beyond the refuge, half a metre inside, is the other
    shore; a boat that goes on to its refuge by the law must not reach it.
    """
    boat, across = without_lag(vessel_named(name)), Weather(current_east_mps=0.2)
    channel = Fence(water=shapely.box(-30, -0.6, 30, 0.6))
    proved = 0
    for east, heading in itertools.product((-0.48, -0.24, 0.0, 0.24, 0.48), np.arange(-6, 6)):
        state = (0.0, east, heading * math.pi / 6, 0.3, 0.0, 0.0)
        escape_plan = escape(
            channel, keeper(boat), state, lambda _: (0.0, 0.0), across, reaction_s=0.3
        )
        if escape_plan is None:
            continue
        proved += 1
        plant = Plant(boat, state, across)
        for k in range(200):
            later = keeper(boat).keep(tuple(plant.state), across, escape_plan.refuge)
            plant.command(escape_plan.thrusts[k] if k < len(escape_plan.thrusts) else later)
            plant.advance(0.1)
            assert channel.contains(tuple(plant.state[:2])), (east, heading, k)
    assert proved > 20
