"""Stopping, and holding a position."""

import math

import numpy as np
import pytest

from grebe.control.station import (
    APPROACH_PER_S,
    IDLE_MPS,
    THERE_M,
    StationKeeper,
    drift_mps,
    reach_mps,
)
from grebe.core.dynamics import CALM, Weather
from grebe.core.inner_loop import braking_share, held_motion, under_speed_control
from grebe.core.vessel import PRESETS
from grebe.mission.safety.settings import CAREFUL
from grebe.simulation.plant import Plant

PLACE = (0.0, 0.0)
BOATS = pytest.mark.parametrize("boat", PRESETS.values(), ids=lambda boat: boat.name)


def held(boat, weather, seconds, state=(0.0,) * 6):
    """Distances from the place while the boat holds it, ten a second."""
    plant, away = Plant(boat, state, weather), []
    for _ in range(round(10 * seconds)):
        plant.command(StationKeeper(vessel=boat).keep(plant.state, weather, PLACE))
        plant.advance(0.1)
        away.append(math.hypot(*plant.state[:2]))
    return np.array(away)


@BOATS
@pytest.mark.parametrize("bearing", [0.5, 2.0, 3.5])
def test_a_place_is_held_against_a_current_within_the_stated_radius(boat, bearing):
    weather = Weather(
        current_north_mps=0.4 * math.cos(bearing), current_east_mps=0.4 * math.sin(bearing)
    )
    away = held(boat, weather, 60)
    assert away.max() < CAREFUL.hold_radius_m
    assert away[-200:].max() < 1.5


@BOATS
@pytest.mark.parametrize("share", [0.5, 0.65, 0.8])
@pytest.mark.parametrize("heading", [0.0, 1.5, 3.1, -1.5])
def test_a_place_is_held_in_any_current_that_the_boat_is_faster_than(boat, share, heading):
    """At any initial heading the boat drifts off for some seconds while it turns, and comes back.

    A law that braked first, and drove on with its bow off the current, was carried away from 0.65
    on.
    """
    current = share * reach_mps(boat, CALM)
    away = held(boat, Weather(current_north_mps=current), 90, (0.0, 0.0, heading, 0.0, 0.0, 0.0))
    assert away[-100:].max() < 1.5
    assert away.max() < 12.0 * current


@BOATS
def test_a_boat_returns_to_the_place_that_it_holds(boat):
    away = held(boat, CALM, 90, (8.0, -6.0, 1.0, 0.0, 0.0, 0.0))
    # Nearer than this, the wanted speed is too small to need a heading.
    assert away[-100:].max() <= THERE_M + IDLE_MPS / APPROACH_PER_S


@BOATS
def test_a_braked_boat_goes_straight_on_and_stops(boat):
    plant = Plant(boat, (0.0, 0.0, 0.0, 1.0, 0.0, 0.0))
    for _ in range(100):
        plant.command(StationKeeper(vessel=boat).brake(plant.state, CALM))
        plant.advance(0.1)
    assert abs(plant.state[3]) < 0.02
    assert plant.state[1] == plant.state[2] == 0.0


def test_braking_uses_no_more_than_the_weaker_thruster_has():
    boat = PRESETS["spyboat"]
    keeper = StationKeeper(vessel=boat, weaker_share=0.5)
    port, starboard = keeper.brake((0, 0, 0, 2.0, 0, 0), CALM)
    assert port == starboard == 0.5 * boat.thrust_min_n


def test_a_boat_is_carried_off_by_a_current_that_is_faster_than_it():
    boat = PRESETS["heron"]
    assert reach_mps(boat, Weather(current_north_mps=1.0)) > 0
    assert reach_mps(boat, Weather(current_north_mps=1.6)) < 0


def test_wind_counts_as_the_speed_that_its_force_would_give():
    boat = PRESETS["spyboat"]
    wind = Weather(wind_force_north_n=boat.surge_drag_n(0.7))
    assert drift_mps(boat, wind) == pytest.approx(0.7)


@BOATS
def test_under_an_autopilot_the_boat_is_braked_before_it_turns_and_no_noise_becomes_an_order(boat):
    """Over an inner loop that turns first, a law that jumps from braking to turning never stops.

    So the law has no jump: it turns more the slower the boat is.
    """
    model = under_speed_control(boat)
    keeper = StationKeeper(vessel=model, by_motion=True)
    place = (1.0, 10.0)

    def orders(surge):
        state = (0.0, 0.0, 0.0, surge, 0.0, 0.0)
        return held_motion(model, state, keeper.keep(state, CALM, place), CALM)

    turns = np.array([abs(orders(surge)[1]) for surge in np.arange(0.0, 0.6, 0.01)])
    assert turns[0] > 0.2
    assert turns[36:] == pytest.approx(0.0, abs=1e-9)
    assert np.abs(np.diff(turns)).max() < 0.15 * turns[0]
    noisy = (0.0, 0.0, 0.0, 0.0, 0.0, 0.05)
    assert held_motion(model, noisy, keeper.keep(noisy, CALM, place), CALM)[1] == pytest.approx(
        orders(0.0)[1]
    )


def test_what_lies_behind_is_turned_to_over_starboard():
    keeper = StationKeeper(vessel=PRESETS["spyboat"])
    for east in (-0.5, 0.0, 0.5):
        port, starboard = keeper.keep((0.0,) * 6, CALM, (-10.0, east))
        assert port > starboard


def test_under_an_autopilot_a_boat_goes_back_as_it_came_where_it_can_go_astern():
    behind, still = (-10.0, 0.5), (0.0,) * 6
    for name, backs in (("blueboat", True), ("heron", False)):
        model = under_speed_control(PRESETS[name])
        share = braking_share(PRESETS[name], model)
        keeper = StationKeeper(vessel=model, weaker_share=share, by_motion=True)
        surge, yaw_rate = held_motion(model, still, keeper.keep(still, CALM, behind), CALM)
        assert (surge < -0.3) == backs
        assert (abs(yaw_rate) < 0.1) == backs
