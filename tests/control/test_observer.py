"""The observer estimates unknown weather."""

import numpy as np
import pytest

from grebe.control.observer import Observer
from grebe.core.dynamics import Weather, rates
from grebe.core.vessel import PRESETS
from grebe.simulation.plant import Plant


def watch(weather, *, noise, seconds=60.0, boat="benchmark", step=0.1):
    vessel = PRESETS[boat]
    plant = Plant(vessel, (0, 0, 0, 0, 0, 0), weather)
    observer = Observer(vessel)
    rng = np.random.default_rng(1)
    before = list(plant.state)
    for i in range(int(seconds / step)):
        turn = 4.0 * np.sin(0.1 * i * step)
        thrusts = (12.0 + turn, 12.0 - turn)
        plant.command(thrusts)
        plant.advance(step)
        after = list(plant.state)
        after[3:] = (np.array(after[3:]) + noise * rng.normal(size=3)).tolist()
        observer.update(before, thrusts, after, step)
        before = after
    return observer.weather, plant


@pytest.mark.parametrize("current", [(0.3, 0.0), (-0.2, 0.4), (0.0, -0.5)])
def test_a_current_is_found_while_the_boat_turns(current):
    weather = Weather(current_north_mps=current[0], current_east_mps=current[1])
    found, plant = watch(weather, noise=0.0)
    assert found.current_north_mps == pytest.approx(current[0], abs=0.1)
    assert found.current_east_mps == pytest.approx(current[1], abs=0.1)
    _assert_same_motion(found, weather, plant)


@pytest.mark.parametrize("force", [(8.0, 0.0), (-3.0, 6.0)])
def test_a_wind_force_is_explained(force):
    weather = Weather(wind_force_north_n=force[0], wind_force_east_n=force[1])
    found, plant = watch(weather, noise=0.02)
    _assert_same_motion(found, weather, plant, tolerance=0.15)


def test_calm_stays_calm_under_noise():
    found, _ = watch(Weather(), noise=0.02)
    assert np.hypot(found.current_north_mps, found.current_east_mps) < 0.12


def _assert_same_motion(found, true, plant, tolerance=0.05):
    """Check that the model in the estimated weather accelerates as the boat does."""
    model, truth = (
        rates(plant.vessel, plant.state, plant.thrusts, w.as_tuple()) for w in (found, true)
    )
    assert model[3:5] == pytest.approx(truth[3:5], abs=tolerance)
