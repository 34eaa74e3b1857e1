"""The contract of every map method: the built-in ones, and the one of the how-to."""

import re
from pathlib import Path

import numpy as np
import pytest
import shapely
from conftest import TEMPERATURE

from grebe.core.errors import InputError
from grebe.core.samples import Flag
from grebe.mapping.covariance.likelihood import fit_reml
from grebe.mapping.covariance.variogram import fit_variogram
from grebe.mapping.grid import make_grid
from grebe.mapping.maps import Mapper, MapSettings
from grebe.mapping.methods.base import Domain, Readings
from grebe.mapping.methods.choice import METHODS, with_settings
from grebe.mapping.methods.kriging import Kriging
from grebe.mapping.methods.spde import Spde

PAGE = Path(__file__).parents[2] / "docs" / "how-to" / "add-a-map-method.md"
BLOCKS = re.findall(r"```python\n(.*?)```", PAGE.read_text("utf-8"), re.DOTALL)


def of_the_page():
    names = {"__name__": __name__}
    for block in BLOCKS:
        exec(compile(block, str(PAGE), "exec"), names)
    return names


TOLD = of_the_page()
ALL = [
    Kriging(fit_covariance=fit_reml),
    Kriging(fit_covariance=fit_variogram),
    Spde(),
    TOLD["InverseDistance"](),
]
WATER = shapely.box(0, 0, 120, 100)
DOMAIN = Domain(WATER, make_grid(WATER, 4.0))
every = pytest.mark.parametrize("method", ALL, ids=lambda one: one.key)


def truth(places):
    return np.sin(places[:, 0] / 12) + 0.5 * np.cos(places[:, 1] / 9)


def readings(noise=0.0, shift=0.0, scale=1.0):
    """Readings in a part of the water, none of them beyond north 60 m."""
    rng = np.random.default_rng(4)
    places = rng.uniform((5, 5), (60, 95), (150, 2))
    values = truth(places) + rng.normal(0, noise, len(places)) if noise else truth(places)
    return Readings(positions=places, values=shift + scale * values)


@every
def test_at_the_readings_it_says_what_was_read_within_the_noise(method):
    given = readings()
    field = method.fit(given, DOMAIN)
    error = field.mean(given.positions) - given.values
    # The mesh of 4 m resolves the signal to some hundredths.
    assert np.sqrt(np.mean(error**2)) < 0.03 + np.sqrt(field.model.nugget)


@every
def test_the_sd_is_none_below_zero_and_grows_away_from_the_readings(method):
    field = method.fit(readings(0.1), DOMAIN)
    nodes = DOMAIN.grid.nodes
    sd = field.sd(nodes)
    assert np.isfinite(sd).all()
    assert (sd >= 0).all()
    among, beyond = nodes[:, 0] < 55, nodes[:, 0] > 100
    assert np.median(sd[beyond]) > 1.5 * np.median(sd[among])


@every
def test_draws_have_the_field_s_mean_and_sd(method):
    field = method.fit(readings(0.1), DOMAIN)
    places = np.random.default_rng(1).uniform((5, 5), (115, 95), (60, 2))
    drawn = field.draws(places, 400, seed=5)
    assert drawn.shape == (400, 60)
    mean, sd = field.mean(places), field.sd(places)
    assert np.abs((drawn.mean(axis=0) - mean) / sd).max() < 0.3
    assert np.median(drawn.std(axis=0) / sd) == pytest.approx(1.0, abs=0.1)
    assert field.draws(places, 3, seed=5) == pytest.approx(field.draws(places, 3, seed=5))
    assert not np.allclose(field.draws(places, 3, seed=6), drawn[:3])


@every
@pytest.mark.parametrize(("shift", "scale"), [(7.0, 1.0), (0.0, 8.0), (-3.0, -2.0)])
def test_another_unit_gives_the_same_map(method, shift, scale):
    plain = method.fit(readings(0.1), DOMAIN)
    moved = method.fit(readings(0.1, shift, scale), DOMAIN)
    places = DOMAIN.grid.nodes[::7]
    sd = plain.sd(places)
    # The search for parameters ends within its tolerance, some thousandths of the sd.
    error = (moved.mean(places) - shift) / scale - plain.mean(places)
    assert np.abs(error / np.maximum(sd, 1e-6)).max() < 0.02
    assert moved.sd(places) / abs(scale) == pytest.approx(sd, rel=0.02, abs=1e-6)


@every
def test_the_same_model_forgets_readings_that_it_is_not_given(method):
    given = readings(0.1)
    field = method.fit(given, DOMAIN)
    south = given.positions[:, 0] < 30
    rest = field.given(given.part(south))
    assert rest.model == field.model
    there = given.positions[~south]
    assert rest.sd(there).mean() > field.sd(there).mean()


@every
def test_it_maps_a_quantity_and_is_validated_and_named(method):
    given = readings(0.1)
    mapper = Mapper(WATER, DOMAIN.grid, MapSettings(method=method))
    flags = np.full(len(given), Flag.GOOD)
    one = mapper.map_quantity(TEMPERATURE, given.positions, given.values, flags)
    assert one.method is method
    assert one.reason == "as asked"
    assert one.model == one.field.model
    assert one.validation is not None
    inside = DOMAIN.grid.inside
    assert np.isfinite(one.mean[inside]).all()
    assert one.draws(2).shape == (2, *inside.shape)


def test_of_several_methods_the_one_that_predicts_better_is_taken_whatever_the_order():
    given = readings(0.05)
    flags = np.full(len(given), Flag.GOOD)
    chosen = []
    for several in ((ALL[3], ALL[0]), (ALL[0], ALL[3])):
        mapper = Mapper(WATER, DOMAIN.grid, MapSettings(method=several))
        one = mapper.map_quantity(TEMPERATURE, given.positions, given.values, flags)
        chosen.append(one.method)
        assert "two ways" in one.model.reason
    assert chosen == [ALL[0], ALL[0]]


def test_the_choice_is_a_function_of_one_s_own():
    given = readings(0.05)
    mine = ALL[3]
    settings = MapSettings(choice=lambda readings, domain: ((mine,), "I like it"))
    mapper = Mapper(WATER, DOMAIN.grid, settings)
    flags = np.full(len(given), Flag.GOOD)
    one = mapper.map_quantity(TEMPERATURE, given.positions, given.values, flags)
    assert (one.method, one.reason) == (mine, "I like it")


def test_a_setting_that_a_method_lacks_is_named():
    with pytest.raises(InputError, match="spde has no setting 'drift'") as error:
        with_settings(METHODS["spde"], drift=lambda positions: positions)
    assert "--" not in str(error.value)
