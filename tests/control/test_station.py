"""Stopping and holding a place."""

import math

import numpy as np
import pytest

from grebe.control.station import (
    APPROACH_PER_S,
    IDLE_MPS,
    THERE_M,
    brake,
    drift_mps,
    keep,
    reach_mps,
)
from grebe.core.dynamics import CALM, Weather
from grebe.core.vessel import PRESETS
from grebe.mission.safety.settings import CAREFUL
from grebe.simulation.plant import Plant

PLACE = (0.0, 0.0)
BOATS = pytest.mark.parametrize("boat", PRESETS.values(), ids=lambda boat: boat.name)


def held(boat, weather, seconds, state=(0.0,) * 6):
    """Distances from the place while it is held, ten a second."""
    plant, away = Plant(boat, state, weather), []
    for _ in range(round(10 * seconds)):
        plant.command(keep(boat, plant.state, weather, PLACE))
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
def test_a_boat_returns_to_the_place_that_it_holds(boat):
    away = held(boat, CALM, 90, (8.0, -6.0, 1.0, 0.0, 0.0, 0.0))
    # Nearer than this no speed is wanted that needs a heading.
    assert away[-100:].max() <= THERE_M + IDLE_MPS / APPROACH_PER_S


@BOATS
def test_a_braked_boat_goes_straight_on_and_stops(boat):
    plant = Plant(boat, (0.0, 0.0, 0.0, 1.0, 0.0, 0.0))
    for _ in range(100):
        plant.command(brake(boat, plant.state, CALM))
        plant.advance(0.1)
    assert abs(plant.state[3]) < 0.02
    assert plant.state[1] == plant.state[2] == 0.0


def test_braking_uses_no_more_than_the_weaker_thruster_has():
    boat = PRESETS["spyboat"]
    port, starboard = brake(boat, (0, 0, 0, 2.0, 0, 0), CALM, weaker_share=0.5)
    assert port == starboard == 0.5 * boat.thrust_min_n


def test_a_boat_is_carried_off_by_a_current_that_is_faster_than_it():
    boat = PRESETS["heron"]
    assert reach_mps(boat, Weather(current_north_mps=1.0)) > 0
    assert reach_mps(boat, Weather(current_north_mps=1.6)) < 0


def test_wind_counts_as_the_speed_that_its_force_would_give():
    boat = PRESETS["spyboat"]
    wind = Weather(wind_force_north_n=boat.surge_drag_n(0.7))
    assert drift_mps(boat, wind) == pytest.approx(0.7)
