"""Maps of one quantity at several times, made from one map."""

from dataclasses import replace

import numpy as np
import pytest
from conftest import TEMPERATURE
from mapping.changing_water import WATER, read, waves

from grebe.core.errors import InputError
from grebe.core.samples import Flag
from grebe.mapping.change import fit_change
from grebe.mapping.grid import make_grid
from grebe.mapping.maps import Mapper, MapSettings
from grebe.mapping.methods.choice import KRIGING
from grebe.mapping.movie import moments_of, movie_of, shows_change
from grebe.mapping.scale import LOGARITHMIC

GRID = make_grid(WATER, 6.0)


def mapped(given, **settings):
    return Mapper(WATER, GRID, MapSettings(**settings)).map_quantity(
        TEMPERATURE, given.positions, given.values, np.full(len(given), Flag.GOOD), given.times
    )


@pytest.fixture(scope="module")
def drifting():
    given = read(1, drift=1.5)
    return given, mapped(given, moment="middle")


def test_each_map_of_a_movie_is_the_map_of_its_moment(drifting):
    given, still = drifting
    moments = moments_of(given.times, np.ptp(given.times) / 3)
    movie = movie_of(still, moments)
    assert movie.means.shape == (4, *still.mean.shape)
    for i in (0, 3):
        alone = mapped(given, moment=float(moments[i]))
        inside = still.grid.inside
        apart = np.abs(movie.means[i] - alone.mean)[inside]
        assert apart.max() < 0.02 * np.median(alone.sd[inside])
        assert np.allclose(movie.sds[i][inside], alone.sd[inside], rtol=0.15)


def test_the_middle_of_a_movie_is_the_still(drifting):
    _, still = drifting
    movie = movie_of(still, np.array([still.change.moment_s]))
    assert np.allclose(movie.means[0], still.mean, equal_nan=True, atol=1e-6)
    assert np.allclose(movie.sds[0], still.sd, equal_nan=True, atol=1e-6)


@pytest.mark.parametrize("settings", [{}, {"method": KRIGING[0]}], ids=["averaged", "place alone"])
def test_a_movie_holds_the_water_of_all_its_moments(settings):
    held, risen = [], []
    for seed in (1, 2, 3):
        given = read(seed, drift=1.5)
        still = mapped(given, moment="middle", **settings)
        assert shows_change(still)
        moments = moments_of(given.times, np.ptp(given.times) / 4)
        movie = movie_of(still, moments)
        drift = 1.5 * ((moments - given.times[0]) / np.ptp(given.times) - 0.5)
        truth = waves(GRID.nodes, seed) + drift[:, None]
        inside = still.grid.inside
        within = np.abs(movie.means[:, inside] - truth) <= 1.96 * movie.sds[:, inside]
        held.append(within.mean(axis=1))
        risen.append(np.ptp(movie.means[:, inside].mean(axis=1)))
    assert np.mean(held) > 0.9
    assert np.mean(held, axis=0).min() > 0.85
    assert np.mean(risen) == pytest.approx(1.5, abs=0.3)


def test_a_movie_of_a_logarithm_is_positive_and_multiplies():
    given = read(2, drift=1.5)
    given = replace(given, values=np.exp(0.6 * given.values))
    still = mapped(given, moment="middle", scale=LOGARITHMIC)
    assert shows_change(still)
    movie = movie_of(still, moments_of(given.times, np.ptp(given.times) / 2))
    inside = still.grid.inside
    assert movie.means[:, inside].min() > 0
    ratio = (movie.means[2] / movie.means[0])[inside]
    assert np.median(ratio) == pytest.approx(np.exp(0.9), rel=0.25)


def test_a_change_seen_from_another_moment_is_none_there():
    given = read(1, drift=1.5)
    first = float(given.times[0])
    moved, fitted = fit_change(given).seen_from(first), fit_change(given, first)
    at = np.linspace(first, given.times[-1], 9)
    for one, other in zip(moved.at(at), fitted.at(at), strict=True):
        assert np.allclose(one, other, atol=0.01)
    assert moved.at(np.array([first]))[0] == pytest.approx(0.0, abs=1e-12)


def test_water_whose_change_is_not_told_has_no_movie():
    assert not shows_change(mapped(read(1), moment="middle"))
    assert not shows_change(mapped(read(1, drift=1.5)))


def test_moments_are_so_far_apart_from_the_first_sample_on():
    times = 1e9 + np.array([600.0, 0.0, 1800.0])
    assert np.array_equal(moments_of(times, 600.0), 1e9 + 600.0 * np.arange(4))
    for every_s, message in (
        (1900.0, "makes 1 of a survey of 30 minutes; a movie takes 2 to 200"),
        (1.0, "makes 1801"),
        (0.0, "above 0 minutes, not 0"),
        (float("nan"), "above 0 minutes, not nan"),
    ):
        with pytest.raises(InputError, match=message):
            moments_of(times, every_s)
