"""Water that changes while it is measured, and a sensor that responds late."""

import numpy as np
import pytest
from conftest import TEMPERATURE
from mapping.changing_water import WATER, read, waves

from grebe.core.errors import InputError
from grebe.core.quantities import LIMNOLOGICAL
from grebe.core.samples import Flag, Samples
from grebe.mapping.change import fit_change, no_change
from grebe.mapping.grid import make_grid
from grebe.mapping.maps import Mapper, MapSettings, map_all
from grebe.mapping.methods.base import Readings
from grebe.mapping.methods.choice import KRIGING


@pytest.mark.parametrize("seed", [1, 2, 3])
def test_a_drift_of_all_the_water_is_found(seed):
    given = read(seed, drift=1.5)
    change = fit_change(given)
    assert change.is_significant
    mean, sd = change.at(given.times)
    truth = 1.5 * (given.times - change.moment_s) / np.ptp(given.times)
    assert np.sqrt(np.mean((mean - truth) ** 2)) < 0.15
    assert np.mean(np.abs(mean - truth) <= 2 * sd + 1e-9) > 0.8
    assert change.lag_s == 0


@pytest.mark.parametrize("seed", [1, 2, 3])
def test_nothing_is_made_up_of_water_that_stays_as_it_is(seed):
    change = fit_change(read(seed))
    assert not change.is_significant
    assert change.lag_s == 0
    # And an undetected change is smaller than the field's own variation.
    assert change.unseen_sd < 1.5


@pytest.mark.parametrize("seed", range(6))
def test_a_smooth_plume_is_no_change(seed):
    """Lanes one after the other across a plume. With a rough covariance alone, four of six such
    waters seemed to have changed, and a map of one time lost the plume.
    """
    rng = np.random.default_rng(seed)
    north, east = np.meshgrid(np.arange(0.0, 121.0, 10.0), np.arange(0.0, 121.0, 4.0))
    places = np.column_stack([north.T.ravel(), east.T.ravel()])
    centre, wide = rng.uniform(30, 90, 2), rng.uniform(25, 45)
    plume = np.exp(-np.sum((places - centre) ** 2, axis=1) / (2 * wide**2))
    values = np.log(2 + 30 * plume) + rng.normal(0, 0.02, len(places))
    times = 1.6e9 + 3.0 * np.arange(len(places))
    given = Readings(positions=places, values=values, times=times)
    assert not fit_change(given).is_significant


@pytest.mark.parametrize("lag_s", [6.0, 12.0])
def test_a_late_sensor_is_found_by_its_opposing_lanes(lag_s):
    change = fit_change(read(4, lag_s=lag_s))
    assert change.lag_s == pytest.approx(lag_s, abs=2.0)


def test_a_map_of_one_moment_holds_the_water_of_that_moment():
    """As measured, 95 % intervals held half of water that drifts by 1.5 standard deviations."""
    held = {}
    for moment in (None, "middle"):
        within = []
        for seed in (1, 2, 3):
            given = read(seed, drift=1.5)
            settings = MapSettings(moment=moment, method=KRIGING[0])
            one = Mapper(WATER, make_grid(WATER, 4.0), settings).map_quantity(
                TEMPERATURE,
                given.positions,
                given.values,
                np.full(len(given), Flag.GOOD),
                given.times,
            )
            nodes = one.grid.nodes
            mean, sd = (field[one.grid.inside] for field in (one.mean, one.sd))
            within.append(np.abs(mean - waves(nodes, seed)) <= 1.96 * sd)
        held[moment] = float(np.mean(np.concatenate(within)))
    assert held["middle"] > 0.9
    assert held["middle"] > held[None]


def test_without_times_nothing_is_said():
    given = read(1, drift=1.5)
    untimed = Readings(positions=given.positions, values=given.values)
    assert not fit_change(untimed).is_significant
    assert not no_change(untimed).is_significant


def test_the_moment_is_where_the_change_is_none():
    given = read(1, drift=1.5)
    first = float(given.times[0])
    change = fit_change(given, first)
    mean, sd = change.at(np.array([first]))
    assert mean[0] == pytest.approx(0.0, abs=1e-9)
    assert sd[0] == pytest.approx(0.0, abs=1e-4)
    assert change.at(given.times[-1:])[0][0] == pytest.approx(1.5, abs=0.4)


def test_a_moment_in_which_nobody_measured_is_refused_in_one_sentence():
    given = read(1)
    samples = Samples.of(
        times=given.times,
        positions=given.positions,
        values={"temperature_degc": given.values},
        quantities=LIMNOLOGICAL,
    )
    mapper = Mapper(WATER, make_grid(WATER, 8.0), MapSettings(moment=0.0))
    with pytest.raises(InputError, match="00Z is outside the survey; give a moment from 2020"):
        map_all(mapper, samples, LIMNOLOGICAL)
