"""A sensor that responds slowly: how its readings vary, how slow it is, and the water behind it."""

import numpy as np
import pytest
from conftest import TEMPERATURE
from mapping.changing_water import WATER, lanes, read, slowly, waves

from grebe.core.samples import Flag
from grebe.mapping.change import fit_change
from grebe.mapping.covariance.posterior import Posterior
from grebe.mapping.grid import make_grid
from grebe.mapping.maps import Mapper, MapSettings
from grebe.mapping.methods.base import Readings
from grebe.mapping.response_time import ages_of
from grebe.mapping.slow_sensor import Groups, Response, restored
from grebe.workflow.map_notes import change_notes
from grebe.workflow.maps import map_numbers


def covariance(problem, at):
    lower = np.tril(problem.covariance(at))
    return lower + np.tril(lower, -1).T


@pytest.mark.parametrize("count", [1, 5, 8, 40])
def test_the_mean_age_of_the_water_in_a_reading_is_the_time_constant(count):
    ages = ages_of(7.0, count)
    assert ages.shape == (count,)
    assert ages.mean() == pytest.approx(7.0)
    assert np.all(np.diff(ages) > 0)


def test_the_variance_of_a_slow_sensor_on_a_straight_line_is_the_known_one():
    """Sailed at v over water with the covariance exp(-d / r), it reads a process of the variance
    1 / (1 + tau v / r), and two readings s apart have a known covariance too.
    """
    constant_s, reach_m, apart_s = 10.0, 20.0, 4.0
    times = np.array([0.0, apart_s])
    along = times[:, None] - ages_of(constant_s, 400)
    places = np.stack([along, np.zeros_like(along)], axis=-1)
    problem = Posterior.of(places, np.array([-1.0, 1.0]), "exponential", 1e-8)
    at = np.log([reach_m / problem.extent_m, 1.0, 1e-12])
    a, b = 1 / constant_s, 1 / reach_m
    between = a * (a * np.exp(-b * apart_s) - b * np.exp(-a * apart_s)) / (a**2 - b**2)
    known = np.array([[a / (a + b), between], [between, a / (a + b)]])
    assert covariance(problem, at) == pytest.approx(known, rel=0.01)


def test_the_covariance_of_means_is_the_mean_of_covariances_and_so_are_its_slopes():
    rng = np.random.default_rng(1)
    places, values = rng.uniform(0, 50, (12, 3, 2)), rng.normal(size=12)
    times = np.abs(np.subtract.outer(np.arange(12.0), np.arange(12.0)))
    for kind in ("exponential", "matern32"):
        problem = Posterior.of(places, values, kind, 0.1, (np.exp(-times),))
        each = Posterior.of(places.reshape(-1, 2), np.repeat(values, 3), kind, 0.1)
        at = np.log([0.2, 1.3, 0.05, 0.4])
        found = covariance(problem, at)
        whole = covariance(each, np.array([*at[:2], -50.0])).reshape(12, 3, 12, 3)
        rest = np.exp(at[2]) * np.eye(12) + np.exp(at[3]) * np.exp(-times)
        assert found == pytest.approx(whole.mean(axis=(1, 3)) + rest, abs=1e-7)
        slope = problem.density_and_slope(at)[1]
        for i, step in enumerate(1e-5 * np.eye(4)):
            numeric = problem.log_density(at + step) - problem.log_density(at - step)
            assert slope[i] == pytest.approx(numeric / 2e-5, rel=1e-4, abs=1e-6)


def test_the_water_behind_a_slow_sensor_is_restored():
    """Without noise, up to what the water bends between two readings."""
    places, times = lanes()
    constant_s = 15.0
    given = Readings(positions=places, values=slowly(constant_s, 3), times=times)
    found = Groups.of(given, 1).water(constant_s)
    way = np.column_stack([np.interp(found.times, times, one) for one in places.T])
    assert found.positions == pytest.approx(way)
    # Where the boat jumps from lane to lane, the water of a second is not that of its middle.
    steady = np.hypot(*np.diff(places, axis=0).T) < 2
    error = (found.values - waves(way, 3))[steady]
    assert np.abs(error[100:]).max() < 0.02
    assert np.std(given.values[1:] - waves(places[1:], 3)) > 0.3


def test_the_errors_of_restored_water_have_the_stated_covariance():
    rng = np.random.default_rng(2)
    places = np.column_stack([np.arange(12.0), np.zeros(12)])
    drawn = []
    for values in rng.normal(0, 0.1, (20_000, 12)):
        groups = Groups.of(Readings(positions=places, values=values, times=places[:, 0]), 2)
        drawn.append(groups.water(5.0).values)
    stated = groups.noise(5.0, 0.01)
    assert np.cov(np.transpose(drawn)) == pytest.approx(stated, abs=0.04 * stated.max())
    # Neighbours share a group, so what one has too much the other has too little.
    assert stated[0, 1] < 0
    assert stated[0, 2] == 0


def test_nothing_is_restored_across_a_pause():
    times = np.concatenate([np.arange(30.0), 600.0 + np.arange(31.0)])
    places = np.column_stack([times, np.zeros(61)])
    given = Readings(positions=places, values=np.sin(times / 9), times=times)
    for size in (1, 2, 3):
        when = Groups.of(given, size).water(8.0).times
        assert np.all((when < 30) | (when >= 600))
        assert Groups.of(given, size).counts.sum() == 61


def test_the_order_of_readings_does_not_matter():
    given = read(5, constant_s=10.0)
    turned = given.part(np.ones(len(given), bool))
    turned = Readings(
        positions=turned.positions[::-1], values=turned.values[::-1], times=turned.times[::-1]
    )
    response = Response(constant_s=10.0, sd_s=1.0, gain=9.0)
    assert np.array_equal(restored(given, response).values, restored(turned, response).values)


@pytest.mark.parametrize(("constant_s", "seed"), [(6.0, 1), (10.0, 2), (25.0, 3)])
def test_opposing_lanes_tell_how_slow_a_sensor_is(constant_s, seed):
    change = fit_change(read(seed, constant_s=constant_s), "middle")
    assert change.response is not None
    assert change.lag_s == 0
    found = change.response
    assert found.constant_s == pytest.approx(constant_s, abs=max(3 * found.sd_s, 0.5))
    assert found.sd_s < 0.15 * constant_s


@pytest.mark.parametrize("given", [{}, {"lag_s": 10.0}, {"drift": 1.5}], ids=str)
def test_neither_a_fast_nor_a_late_sensor_is_slow(given):
    for seed in (1, 2):
        assert fit_change(read(seed, **given), "middle").response is None


@pytest.mark.parametrize("seed", [1, 2])
def test_a_sensor_that_wanders_is_not_slow(seed):
    """Over water that is alike everywhere, what it reads is as smooth in time as a slow sensor's.
    A pH on a real lake seemed to have a time constant of 91 s until this was asked.
    """
    places, times = lanes()
    rng = np.random.default_rng([seed, 7])
    wander = np.zeros(len(times))
    for i in range(1, len(times)):
        wander[i] = np.exp(-1 / 150) * wander[i - 1] + rng.normal(0, 0.1)
    values = wander + rng.normal(0, 0.01, len(times))
    given = Readings(positions=places, values=values, times=1.6e9 + times)
    assert fit_change(given, "middle").response is None


def test_a_map_of_one_moment_holds_the_water_behind_a_slow_sensor():
    held, error = {}, {}
    for moment in (None, "middle"):
        given = read(6, constant_s=10.0)
        grid = make_grid(WATER, 6.0)
        one = Mapper(WATER, grid, MapSettings(moment=moment)).map_quantity(
            TEMPERATURE, given.positions, given.values, np.full(len(given), Flag.GOOD), given.times
        )
        off = one.mean[grid.inside] - waves(grid.nodes, 6)
        held[moment] = float(np.mean(np.abs(off) <= 1.96 * one.sd[grid.inside]))
        error[moment] = float(np.sqrt(np.mean(off**2)))
        response = map_numbers(one)["change"]["sensor_response"]
        # A map of no moment corrects nothing, so only the delay is looked for, and told.
        if moment is None:
            assert response is None
            assert "delay" in " ".join(change_notes([one]))
        else:
            assert response["constant_s"] == pytest.approx(10.0, abs=1.5)
            assert not change_notes([one])
    assert held["middle"] > 0.9 > held[None]
    assert error["middle"] < 0.5 * error[None]
