"""A sonde that repeats itself while the boat goes on is flagged; calm water is not."""

import numpy as np
import pytest
import shapely

from grebe.core.quantities import BUILTIN
from grebe.core.samples import Flag, Samples
from grebe.mapping.quality.control import check_quality
from grebe.mapping.quality.stuck import stuck

WATER = shapely.box(-10, -10, 2000, 50)
N = 900
T = np.arange(float(N))
ALONG = np.column_stack([T, np.zeros(N)])
STILL = slice(300, 900)
REPEATED = np.arange(301, 900)


def sensors(seed=1, repeats=1):
    """Temperature and pH with their noise; each reading is logged `repeats` times."""
    rng = np.random.default_rng(seed)
    k = (np.arange(N) // repeats) * repeats
    temperature = np.round(20 + 0.2 * np.sin(T / 60) + rng.normal(0, 0.01, N), 3)[k]
    return [temperature, np.round(7.8 + rng.normal(0, 0.01, N), 2)[k]]


def held(columns, part=STILL):
    for one in columns:
        one[part] = one[part.start]
    return columns


def test_readings_that_all_sensors_repeat_are_found_from_the_second_on():
    assert np.flatnonzero(stuck(held(sensors()), T, ALONG)).tolist() == REPEATED.tolist()


@pytest.mark.parametrize("repeats", [1, 4, 10])
def test_a_logger_quicker_than_its_sonde_is_not_stuck(repeats):
    assert not stuck(sensors(repeats=repeats), T, ALONG).any()
    assert stuck(held(sensors(repeats=repeats)), T, ALONG)[320:].all()


def test_one_sensor_that_moves_tells_that_the_sonde_lives():
    temperature, ph = sensors()
    held([ph])
    assert not stuck([temperature, ph], T, ALONG).any()


def test_a_single_sensor_tells_nothing():
    assert not stuck(held(sensors())[:1], T, ALONG).any()


def test_a_boat_that_lies_still_may_read_the_same():
    assert not stuck(held(sensors()), T, np.zeros((N, 2))).any()


def test_a_short_repetition_is_none():
    assert not stuck(held(sensors(), slice(300, 325)), T, ALONG).any()


@pytest.mark.parametrize("seed", range(20))
def test_coarse_readings_of_calm_water_are_not_stuck(seed):
    """Readings that repeat nine times out of ten, as chance has it."""
    moves = np.cumsum(np.random.default_rng(seed).random(N) < 0.1)
    assert not stuck([20 + 0.1 * moves, 7 + 0.01 * moves], T, ALONG).any()


def test_the_flags_say_so_for_each_sensor_of_the_sonde():
    temperature, ph = held(sensors(), slice(300, 420))
    values = {"temperature_degc": temperature, "ph": ph}
    one = Samples.of(times=1.6e9 + T, positions=ALONG, values=values, quantities=BUILTIN)
    quality = check_quality(one, WATER)
    for key in values:
        assert np.all(quality.flags[key][301:420] == Flag.FAIL)
        assert quality.flags[key][300] == Flag.GOOD
        assert quality.counts[key]["stuck sonde"] == (0, 119)


def test_a_flat_line_is_suspect_from_its_beginning():
    """One sensor stuck for less than the test's limit for a failure."""
    temperature, ph = sensors()
    held([ph], slice(300, 700))
    values = {"temperature_degc": temperature, "ph": ph}
    one = Samples.of(times=1.6e9 + T, positions=ALONG, values=values, quantities=BUILTIN)
    flags = check_quality(one, WATER).flags["ph"]
    assert np.all(flags[300:700] == Flag.SUSPECT)
