"""Correction of a boat's model: found if the data show a difference, and only then."""

import math
from dataclasses import replace

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from grebe.control.adaptation import fitted
from grebe.control.controller import Controller
from grebe.control.correction import AS_MODELLED, Correction, turned
from grebe.control.motion_record import MotionRecord
from grebe.control.tracker import Tracker
from grebe.core.dynamics import Weather
from grebe.core.events import Warned
from grebe.core.vessel import PRESETS
from grebe.links.simulated import EstimateErrors
from grebe.mission import loop
from grebe.mission.trial import Conditions, meander, simulate
from grebe.simulation.changing import Tide
from grebe.simulation.plant import Plant

SPYBOAT = PRESETS["spyboat"]
AT_REST = (0.0, 0.0, 0.0, 0.0, 0.0, 0.0)
# Velocities over ground, as measured by a good receiver and a gyro.
NOISE = np.array([0.02, 0.02, 0.005, 0.02, 0.02, 0.005])


def orders(vessel, seconds, seed):
    """Thrusts that change every second, mostly ahead."""
    rng = np.random.default_rng(seed)
    full = vessel.thrust_max_n
    return rng.uniform(-0.2, 0.9, (seconds, 2)) * full


def drive(vessel, *, plant, late_s=0.0, compass_rad=0.0, noise=0.0, seed=3):
    """Forty seconds of orders and estimates of the boat `plant`."""
    rng = np.random.default_rng(seed)
    told = orders(vessel, 40, seed)
    times, states = [], []
    for i in range(400):
        if i % 10 == 0:
            plant.command(tuple(told[i // 10]))
        times.append(plant.time_s + late_s)
        states.append(plant.state)
        plant.advance(0.1)
    seen = np.array(states) + noise * NOISE * rng.normal(size=(400, 6))
    impulses = np.vstack([np.zeros(2), np.cumsum(told, axis=0)])
    impulses = np.vstack([impulses, impulses[-1] + 5 * told[-1]])
    keep = np.array(times) <= 40.0
    return MotionRecord(
        times=np.array(times)[keep],
        states=turned(seen, compass_rad)[keep],
        order_times=np.append(np.arange(41.0), 45.0),
        impulses=impulses,
        noise_sd=noise * NOISE,
    )


@given(st.integers(0, 50), st.sampled_from(["spyboat", "blueboat", "otter", "benchmark"]))
@settings(max_examples=10)
def test_a_boat_as_modelled_is_not_corrected_whatever_the_current(seed, name):
    boat = PRESETS[name]
    rng = np.random.default_rng(seed)
    weather = Weather(
        current_north_mps=rng.uniform(-0.4, 0.4), current_east_mps=rng.uniform(-0.4, 0.4)
    )
    model = replace(boat, thruster_lag_s=0.0)
    plant = Plant(model, AT_REST, weather)
    assert fitted(model, drive(model, plant=plant, noise=1.0, seed=seed)) is None


@pytest.mark.slow
@pytest.mark.parametrize(("north_mps", "east_mps"), [(0.0, 0.3), (0.0, -0.3), (0.2, 0.2)])
def test_noise_in_a_cross_current_is_not_taken_for_another_boat(north_mps, east_mps):
    """The effect of noise in sway on a fast hull depends on its motion through the water.

    Without the current in it, missions across a current were corrected every half minute.
    """
    sets, boat = meander(rows=4), PRESETS["benchmark"]
    weather = Weather(current_north_mps=north_mps, current_east_mps=east_mps)
    noise = EstimateErrors(velocity_mps=0.03, position_m=0.02, heading_rad=0.005)
    helm = Controller(boat, sets)
    flight = simulate(
        boat, sets, helm, (-10.0, 2.5, 0, 0, 0, 0), Conditions(weather=weather, errors=noise)
    )
    assert flight.complete
    assert not [one for one in flight.recorder.of(Warned) if one.code == "model_corrected"]


def test_a_tide_that_turns_is_no_fault_of_the_boat():
    tide = Tide(current_mps=0.3, period_s=400.0, bearing_rad=1.0)
    assert fitted(SPYBOAT, drive(SPYBOAT, plant=Plant(SPYBOAT, AT_REST, tide), noise=1.0)) is None


WRONG = {
    "a weak thruster": (
        {"effectiveness": (0.6, 1.0)}, {}, {"port": (0.6, 0.05), "starboard": (1.0, 0.05)},
    ),
    "twice the drag": (
        {"boat": {"x_u": 2.0, "y_v": 2.0, "n_r": 2.0}},
        {},
        {"drag": (2.0, 0.15), "yaw_drag": (2.0, 0.2)},
    ),
    "a third more mass": (
        {"boat": {"m11_kg": 1.3, "m22_kg": 1.3, "m33_kgm2": 1.3}},
        {},
        {"port": (1 / 1.3, 0.05), "drag": (1 / 1.3, 0.05)},
    ),
    "a lag": ({"lag_s": 1.0}, {}, {"lag_s": (1.0, 0.15), "dead_s": (0.0, 0.1)}),
    "late estimates": ({}, {"late_s": 0.8}, {"dead_s": (0.8, 0.1), "lag_s": (0.0, 0.15)}),
    "a compass that is off": (
        {}, {"compass_rad": math.radians(10)}, {"heading_rad": (math.radians(10), 0.02)},
    ),
}  # fmt: skip


@pytest.mark.parametrize("what", WRONG)
def test_what_is_wrong_is_found_with_its_size(what):
    boat, seen, sizes = WRONG[what]
    factors = boat.get("boat", {})
    true = replace(
        SPYBOAT,
        thruster_lag_s=boat.get("lag_s", 0.0),
        **{name: factor * getattr(SPYBOAT, name) for name, factor in factors.items()},
    )
    weather = Weather(current_north_mps=0.1, current_east_mps=-0.15)
    plant = Plant(true, AT_REST, weather, boat.get("effectiveness", (1.0, 1.0)))
    found = fitted(SPYBOAT, drive(SPYBOAT, plant=plant, noise=0.5, **seen))
    assert found is not None
    correction, explained = found
    for name, (size, tolerance) in sizes.items():
        assert getattr(correction, name) == pytest.approx(size, abs=tolerance), str(correction)
    assert explained.current_north_mps == pytest.approx(0.1, abs=0.05)
    assert explained.current_east_mps == pytest.approx(-0.15, abs=0.05)


@pytest.mark.parametrize("every_s", [0.5, 1.0])
def test_turns_of_a_boat_that_is_seen_seldom_are_no_noise(every_s):
    """The noise is not estimated from second differences.

    With these, exact estimates once a second had a noise of 0.14 m and 0.15 m/s, and half a
    thruster was found after 55 s instead of 21.
    """
    rng, plant = np.random.default_rng(2), Plant(SPYBOAT, AT_REST, effectiveness=(0.5, 1.0))
    tracker, found_s = Tracker(SPYBOAT), math.inf
    for i in range(round(30 / every_s)):
        if tracker.update(plant.time_s, plant.state):
            found_s = min(found_s, plant.time_s)
        if i % round(2 / every_s) == 0:
            told = tuple((rng.uniform(0.0, 0.9, 2) * SPYBOAT.thrust_max_n).tolist())
            plant.command(told)
            tracker.sent(plant.time_s, told)
        plant.advance(every_s)
    assert found_s < 25


def test_too_little_is_no_ground_for_a_correction():
    flown = drive(SPYBOAT, plant=Plant(SPYBOAT, AT_REST, effectiveness=(0.5, 1.0)))
    short = replace(flown, times=flown.times[:40], states=flown.states[:40])
    assert fitted(SPYBOAT, short) is None


def test_a_state_without_a_delay_is_left_as_it_is():
    tracker = Tracker(SPYBOAT)
    tracker.sent(0.0, (3.0, 4.0))
    state = (1.0, 2.0, 0.3, 0.5, 0.0, 0.1)
    assert tracker.ahead(0.0, 0.0, state) is state
    assert tracker.with_compass_corrected(state) is state
    assert tracker.orders_for(0.0, (3.0, 4.0)) == (3.0, 4.0)
    assert tracker.vessel is SPYBOAT


def test_an_old_estimate_is_carried_to_now_by_what_was_sent():
    plant, tracker = Plant(SPYBOAT, AT_REST), Tracker(SPYBOAT, observes=False)
    old = None
    for i in range(30):
        thrusts = (8.0, 5.0) if i < 24 else (2.0, 9.0)
        if i in (0, 24):
            plant.command(thrusts)
            tracker.sent(plant.time_s, thrusts)
        if i == 20:
            old = (plant.time_s, tuple(plant.state))
        plant.advance(0.1)
    assert tracker.ahead(*old[:1], plant.time_s, old[1]) == pytest.approx(plant.state, abs=1e-4)


def test_thrusters_with_a_lag_are_hurried_within_their_limits():
    tracker = Tracker(SPYBOAT)
    tracker.correction = Correction(lag_s=1.0, port=0.8)
    tracker.sent(0.0, (0.0, 0.0))
    port, starboard = tracker.orders_for(5.0, (4.0, 4.0))
    assert SPYBOAT.thrust_max_n >= port > 4.0 / 0.8
    assert SPYBOAT.thrust_max_n >= starboard > 4.0
    tracker.sent(5.0, (5.0, 4.0))
    assert tracker.orders_for(60.0, (4.0, 4.0)) == pytest.approx((5.0, 4.0), abs=1e-6)


def sail(conditions):
    sets = meander(rows=3, columns=6)
    start = (-5.0, 2.0, 0.0, 0.0, 0.0, 0.0)
    return simulate(SPYBOAT, sets, Controller(SPYBOAT, sets), start, conditions)


def test_a_mission_as_modelled_is_the_same_whether_the_model_is_doubted_or_not(monkeypatch):
    conditions = Conditions(errors=EstimateErrors(velocity_mps=0.02), seed=4)
    doubted = sail(conditions)
    trusting = type("Trusting", (Tracker,), {"_advance_work": lambda *_: False})
    monkeypatch.setattr(loop, "Tracker", trusting)
    trusted = sail(conditions)
    assert np.array_equal(doubted.track, trusted.track)


@pytest.mark.parametrize(
    ("conditions", "longest"),
    [
        (Conditions(errors=EstimateErrors(late_s=0.8)), 1.3),
        (Conditions(errors=EstimateErrors(heading_bias_rad=math.radians(10))), 1.35),
        (Conditions(effectiveness=(0.6, 1.0)), 1.7),
    ],
    ids=["late", "compass", "weak thruster"],
)
def test_a_boat_unlike_its_model_takes_little_longer(conditions, longest):
    base, other = sail(Conditions()), sail(conditions)
    assert other.complete
    assert other.duration_s < longest * base.duration_s
    corrected = [event for event in other.recorder.of(Warned) if event.code == "model_corrected"]
    assert bool(corrected) == (conditions.errors.late_s == 0)


def test_a_correction_says_what_it_is():
    assert "port" not in str(AS_MODELLED)
    assert "0.60 and 1.00 of their orders" in str(Correction(port=0.6))
