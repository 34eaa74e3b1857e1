"""Area, volume and hypsographic curve against closed forms."""

import csv
from dataclasses import replace

import numpy as np
import pytest
import shapely
from conftest import TEMPERATURE

from grebe.core.errors import InputError
from grebe.core.samples import Flag
from grebe.mapping.bathymetry import WATER_DEPTH, bathymetry
from grebe.mapping.grid import make_grid
from grebe.mapping.maps import Mapper, MapSettings
from grebe.mapping.methods.choice import KRIGING
from grebe.mapping.methods.spde import Spde
from grebe.report.bathymetry import hypsographic_figure, write_hypsography

RADIUS, DEEP = 100.0, 12.0
LAKE = shapely.Point(0, 0).buffer(RADIUS, quad_segs=64)
AREA = np.pi * RADIUS**2
NODES = make_grid(LAKE, 1.0).nodes
REACH = np.minimum(np.hypot(*NODES.T) / RADIUS, 1.0)
CONE, PARABOLOID = DEEP * (1 - REACH), DEEP * (1 - REACH**2)
DEPTH = replace(
    TEMPERATURE,
    key=WATER_DEPTH,
    labels={"en": "Depth of the water"},
    unit="m",
    resolution=0.0,
)


@pytest.mark.parametrize(("depths", "share"), [(CONE, 1 / 3), (PARABOLOID, 1 / 2)])
def test_the_volume_is_that_of_the_solid(depths, share):
    lake = bathymetry(depths, AREA)
    assert lake.volume_m3 == pytest.approx(share * AREA * DEEP, rel=1e-3)
    assert lake.mean_depth_m == pytest.approx(share * DEEP, rel=1e-3)
    assert lake.max_depth_m == pytest.approx(DEEP, rel=0.01)


@pytest.mark.parametrize(
    ("depths", "area", "volume"),
    [
        (CONE, lambda s: s**2, lambda s: s**3 / 3),
        (PARABOLOID, lambda s: s, lambda s: s**2 / 2),
    ],
)
def test_the_curve_is_that_of_the_solid(depths, area, volume):
    curve = bathymetry(depths, AREA).curve
    left = np.clip(1 - curve.depth_m / DEEP, 0, None)
    assert curve.area_m2 == pytest.approx(AREA * area(left), abs=3e-3 * AREA)
    assert curve.volume_m3 == pytest.approx(AREA * DEEP * volume(left), abs=1e-3 * AREA * DEEP)
    assert curve.volume_m3[0] == bathymetry(depths, AREA).volume_m3


def test_the_volume_is_the_integral_of_the_area():
    rng = np.random.default_rng(0)
    curve = bathymetry(rng.gamma(2, 3, 500), 4e4, levels=np.linspace(0, 60, 6001)).curve
    below = np.trapezoid(curve.area_m2[::-1], -curve.depth_m[::-1])
    assert below == pytest.approx(curve.volume_m3[0], rel=1e-3)


def test_the_volume_s_sd_is_that_of_a_common_error():
    """If all depths are off by one draw of sd 0.5 m, the volume is off by that times the area."""
    rng = np.random.default_rng(1)
    offsets = rng.normal(0, 0.5, 4000)
    lake = bathymetry(np.full(50, 20.0), 1000.0, 20.0 + offsets[:, None] + np.zeros(50))
    assert lake.volume_sd_m3 == pytest.approx(500.0, rel=0.04)
    assert lake.max_depth_sd_m == pytest.approx(0.5, rel=0.04)


def test_what_rises_above_the_water_has_no_volume():
    assert bathymetry(np.array([-3.0, 2.0]), 10.0).volume_m3 == 10.0


@pytest.mark.parametrize(("depths", "area"), [([], 1.0), ([np.nan], 1.0), ([1.0], 0.0)])
def test_no_depths_and_no_water_are_refused(depths, area):
    with pytest.raises(ValueError, match="finite depths"):
        bathymetry(np.array(depths), area)


def sounded(**settings):
    """A paraboloid that was sounded only in its middle."""
    rng = np.random.default_rng(3)
    places = rng.uniform(-60, 60, (200, 2))
    values = DEEP * (1 - np.sum(places**2, axis=1) / RADIUS**2) + rng.normal(0, 0.05, 200)
    mapper = Mapper(LAKE, make_grid(LAKE, 5.0), MapSettings(**settings))
    return mapper.map_quantity(DEPTH, places, values, np.full(200, Flag.GOOD))


def test_the_shore_is_depth_zero_only_where_it_is_asked_for():
    free, held = sounded(method=KRIGING), sounded(method=KRIGING, shore_depth_sd_m=0.1)
    rim = np.hypot(*free.grid.nodes.T) > 96
    inside = free.grid.inside
    assert np.abs(held.mean[inside][rim]).max() < 1.2
    assert np.median(free.sd[inside][rim]) > 2 * np.median(held.sd[inside][rim])
    lake = bathymetry(held.mean[inside], LAKE.area, held.draws(60)[:, inside])
    assert lake.volume_m3 == pytest.approx(AREA * DEEP / 2, rel=0.03)
    assert abs(lake.volume_m3 - AREA * DEEP / 2) < 3 * lake.volume_sd_m3
    assert lake.volume_sd_m3 < 0.05 * lake.volume_m3


def test_the_bed_does_not_change_but_where_a_moment_is_asked_for():
    """A drift of the sonar's zero, or a tide, of a metre within the hour."""
    rng = np.random.default_rng(3)
    lanes = [
        np.column_stack([np.arange(-60.0, 60, 3)[:: (-1) ** i], np.full(40, east)])
        for i, east in enumerate((*np.arange(-60.0, 60, 10), *np.arange(-55.0, 60, 10)))
    ]
    places = np.concatenate(lanes)
    times = 3600.0 * np.arange(len(places)) / len(places)
    values = DEEP * (1 - np.sum(places**2, axis=1) / RADIUS**2) + times / 3600
    values += rng.normal(0, 0.02, len(values))
    given = (DEPTH, places, values, np.full(len(values), Flag.GOOD), times)
    found = [
        Mapper(LAKE, make_grid(LAKE, 5.0), MapSettings(moment=moment)).map_quantity(*given)
        for moment in (None, "middle")
    ]
    assert not found[0].change.is_significant
    assert found[1].change.is_significant


def test_a_method_of_one_noise_says_so_and_an_impossible_sd_is_refused():
    with pytest.raises(InputError, match="use kriging"):
        sounded(method=Spde(), shore_depth_sd_m=0.1)
    with pytest.raises(InputError, match="shore_depth_sd_m"):
        MapSettings(shore_depth_sd_m=0.0)


def test_the_curve_is_drawn_and_written(tmp_path):
    lake = bathymetry(CONE, AREA, np.stack([CONE, CONE + 0.1]))
    write_hypsography(tmp_path / "hypsography.csv", lake)
    with (tmp_path / "hypsography.csv").open() as file:
        rows = list(csv.DictReader(file))
    assert [float(row["depth_m"]) for row in rows] == pytest.approx(lake.curve.depth_m, rel=1e-5)
    assert float(rows[0]["volume_below_m3"]) == pytest.approx(lake.volume_m3, rel=1e-5)
    bottom, top = hypsographic_figure(lake).axes[0].get_ylim()
    assert bottom > top
