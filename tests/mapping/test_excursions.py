"""Excursions of readings, a sensor that is stuck, and maps within the possible range."""

from __future__ import annotations

import numpy as np
import pytest
import shapely

from grebe.core.quantities import BUILTIN
from grebe.core.samples import Flag, Samples
from grebe.mapping.grid import make_grid
from grebe.mapping.maps import Mapper, MapSettings, map_all
from grebe.mapping.quality.control import check_quality
from grebe.mapping.stamps import spread_times, usual_step_s

WATER = shapely.box(-10, -10, 3_010, 110)


def samples(**columns: np.ndarray) -> Samples:
    """One reading a second along a line."""
    count = len(next(iter(columns.values())))
    places = np.column_stack([np.arange(float(count)), np.full(count, 50.0)])
    return Samples.of(
        times=1e9 + np.arange(float(count)), positions=places, values=columns,
        quantities=BUILTIN, speed_mps=np.ones(count),
    )  # fmt: skip


def good(key: str, values: np.ndarray) -> np.ndarray:
    """Which values pass quality control."""
    return check_quality(samples(**{key: values}), WATER).flags[key] == Flag.GOOD


def lake(count: int = 600, mean: float = 8.3, sd: float = 0.05) -> np.ndarray:
    """A quantity that varies slowly, with a little noise."""
    noise = np.random.default_rng(0).normal(0, 0.1 * sd, count)
    return mean + sd * np.sin(np.arange(count) / 40) + noise


@pytest.mark.parametrize(("first", "last"), [(200, 245), (0, 30), (570, 600)])
def test_a_dropout_to_zero_is_no_water(first: int, last: int) -> None:
    values = lake()
    values[first:last] = 0.0
    passed = good("dissolved_oxygen_mgl", values)
    assert not passed[first:last].any()
    assert passed.sum() >= 600 - (last - first) - 2


def test_an_echo_that_runs_away_by_and_by_is_not_followed() -> None:
    depth = lake(mean=25.0, sd=2.0)
    depth[300:312] = [35, 45, 55, 65, 75, 90, 95, 92, 90, 70, 50, 35]
    assert not good("water_depth_m", depth)[300:312].any()


def test_a_front_that_stays_is_another_water() -> None:
    values = lake(mean=15.0)
    values[300:] += 5.0
    assert good("temperature_degc", values).sum() >= 598


def test_a_plume_of_turbid_water_is_kept() -> None:
    values = lake(mean=5.0, sd=0.5)
    values[300:340] += 200.0
    assert good("turbidity_ntu", values)[305:335].all()


def test_a_plume_of_an_inflow_is_kept() -> None:
    noise = np.random.default_rng(2).normal(0, 2.0, 600)
    values = lake(mean=250.0, sd=5.0) + noise
    values[200:500] += 400.0
    assert good("conductivity_uscm", values)[205:495].all()


def test_a_long_beginning_elsewhere_is_another_water() -> None:
    values = lake(mean=250.0, sd=5.0, count=3000)
    values[:1000] = 600.0
    values[:1000] += np.random.default_rng(3).normal(0, 1.0, 1000)
    assert good("conductivity_uscm", values)[:990].all()


def test_the_deep_half_of_a_quarry_is_its_bed() -> None:
    depth = lake(mean=4.0, sd=0.2)
    for first in range(50, 600, 100):
        depth[first : first + 40] += 21.0
    assert good("water_depth_m", depth)[55:85].all()


def test_a_logger_of_few_digits_is_not_stuck_from_the_beginning() -> None:
    values = np.round(lake(mean=7.8, sd=0.3, count=3000), 1)
    values[500:1500] = 7.8
    assert good("ph", values)[500:700].all()


def test_a_stuck_sensor_was_stuck_from_the_beginning() -> None:
    values = lake(mean=7.8, sd=0.1, count=1500)
    values[300:1400] = 7.85
    passed = good("ph", values)
    assert not passed[300:1400].any()
    assert passed[:300].all()


def test_a_map_of_depths_never_runs_into_the_air() -> None:
    rng = np.random.default_rng(1)
    north, east = np.meshgrid(np.arange(0.0, 100, 2), np.arange(0.0, 60, 12), indexing="ij")
    places = np.column_stack([north.ravel(), east.ravel()])
    depth = np.maximum(0.02, 3 * np.sin(places[:, 0] / 9) + rng.normal(0, 0.3, len(places)))
    water = shapely.box(-5, -5, 105, 65)
    mapper = Mapper(water, make_grid(water, 3.0), MapSettings())
    flags = np.full(len(depth), Flag.GOOD)
    one = mapper.map_quantity(BUILTIN["water_depth_m"], places, depth, flags)
    assert float(np.nanmin(one.mean)) >= 0.0
    assert float(one.at(places + 1.0).mean.min()) >= 0.0


def test_water_that_is_the_same_everywhere_is_known_so(recwarn: pytest.WarningsRecorder) -> None:
    water = shapely.box(-10, -10, 310, 110)
    maps, _ = map_all(
        Mapper(water, make_grid(water, 10.0), MapSettings()),
        samples(ph=np.full(300, 7.85)),
        BUILTIN.subset(["ph"]),
    )
    assert np.nanmax(np.abs(maps[0].mean - 7.85)) < 1e-9
    assert maps[0].validation is not None
    assert (maps[0].validation.msdr, maps[0].validation.coverage95) == (0.0, 1.0)
    assert not [one for one in recwarn if issubclass(one.category, RuntimeWarning)]


def test_times_to_the_minute_are_spread_within_it() -> None:
    exact = 1e9 + np.arange(600.0)
    spread = spread_times(np.floor(exact / 60) * 60)
    assert np.all(np.diff(spread) > 0)
    assert np.abs(spread - exact)[60:-60].max() < 60.0
    assert np.median(np.diff(spread)) == pytest.approx(1.0, rel=0.1)


def test_times_are_not_spread_over_a_pause() -> None:
    spread = spread_times(np.repeat([100.0, 101.0, 102.0, 701.0, 702.0], 4))
    assert spread[8:12].max() < 110.0
    minutes = np.repeat(60.0 * np.arange(10.0), 4)
    assert usual_step_s(minutes) == pytest.approx(15.0)


def test_the_usual_step_leaves_pauses_out() -> None:
    times = np.concatenate([np.arange(0.0, 143.0, 1.43), [9_000.0, 9_001.43]])
    assert usual_step_s(times) == pytest.approx(1.43)
