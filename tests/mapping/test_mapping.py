"""Variogram, kriging, validation, grid, and CF NetCDF."""

import gstools as gs
import netCDF4
import numpy as np
import pytest
import shapely
from conftest import ENTRY, FRAME, TEMPERATURE
from hypothesis import given
from hypothesis import strategies as st

from grebe.core.errors import InputError
from grebe.core.quantities import LIMNOLOGICAL
from grebe.core.samples import Flag, Samples
from grebe.io.export.netcdf import write_netcdf
from grebe.mapping.covariance.models import KINDS, CovarianceModel
from grebe.mapping.covariance.variogram import empirical_variogram, fit_model, fit_variogram
from grebe.mapping.fields.joining import merge_places
from grebe.mapping.fields.kriging import krige
from grebe.mapping.grid import make_grid
from grebe.mapping.maps import Mapper, map_all
from grebe.mapping.methods.base import Domain, Readings
from grebe.mapping.methods.kriging import Kriging
from grebe.mapping.proof.validation import validate
from grebe.simulation.water import conditioned_water, free_water

kinds = st.sampled_from(KINDS)


def scatter(n, seed=0, size=100.0):
    return np.random.default_rng(seed).uniform(0, size, (n, 2))


def smooth(positions):
    return np.sin(positions[:, 0] / 30) + 0.5 * np.cos(positions[:, 1] / 20)


MODEL = CovarianceModel(kind="exponential", sill=1.0, range_m=30.0, nugget=0.0)


@pytest.mark.parametrize(
    ("kind", "other"),
    [
        ("spherical", gs.Spherical(dim=2, len_scale=20)),
        ("exponential", gs.Exponential(dim=2, len_scale=20)),
        ("matern32", gs.Matern(dim=2, nu=1.5, len_scale=20 / np.sqrt(2))),
        ("matern52", gs.Matern(dim=2, nu=2.5, len_scale=20 / np.sqrt(2))),
        ("gaussian", gs.Gaussian(dim=2, len_scale=20 * np.sqrt(np.pi) / 2)),
    ],
)
def test_covariances_are_those_of_gstools(kind, other):
    h = np.linspace(0, 100, 50)
    ours = CovarianceModel(kind=kind, sill=1.0, range_m=20.0, nugget=0.0)
    assert ours.covariance(h) == pytest.approx(other.covariance(h), abs=1e-9)


@given(kinds)
def test_the_practical_range_is_where_five_per_cent_are_left(kind):
    model = CovarianceModel(kind=kind, sill=1.0, range_m=10.0, nugget=0.0)
    assert model.covariance(np.array([model.practical_range_m]))[0] == pytest.approx(0.05, abs=2e-3)


@given(st.integers(2, 40), st.integers(0, 1000), kinds)
def test_kriging_is_exact_at_the_data_without_nugget(n, seed, kind):
    positions = scatter(n, seed)
    values = np.random.default_rng(seed + 1).normal(size=n)
    model = CovarianceModel(kind=kind, sill=1.0, range_m=30.0, nugget=0.0)
    at, means, _ = merge_places(positions, values)
    estimate = krige(positions, values, at, model)
    assert estimate.mean == pytest.approx(means, abs=1e-3)
    assert estimate.variance == pytest.approx(np.zeros(len(at)), abs=1e-3)


@given(st.floats(-50, 50), st.floats(0.5, 3), st.integers(0, 100))
def test_kriging_is_linear_and_keeps_constants(shift, scale, seed):
    positions, targets = scatter(20, seed), scatter(15, seed + 1)
    values = smooth(positions)
    plain = krige(positions, values, targets, MODEL).mean
    moved = krige(positions, shift + scale * values, targets, MODEL).mean
    assert moved == pytest.approx(shift + scale * plain, abs=1e-6)


def test_kriging_is_that_of_gstools():
    positions, targets = scatter(60), scatter(40, 3)
    values = smooth(positions)
    model = gs.Exponential(dim=2, var=1.0, len_scale=30.0, nugget=0.1)
    other = gs.krige.Ordinary(model, positions.T, values, exact=False)
    mean, variance = other(targets.T)
    ours = krige(positions, values, targets, CovarianceModel(
        kind="exponential", sill=1.0, range_m=30.0, nugget=0.1))  # fmt: skip
    assert ours.mean == pytest.approx(mean, abs=1e-8)
    # GSTools includes the nugget in the variance; ours is the signal's.
    assert ours.variance + 0.1 == pytest.approx(variance, abs=1e-8)


def test_near_samples_are_enough():
    positions, targets = scatter(400), scatter(100, 3)
    values = smooth(positions)
    whole = krige(positions, values, targets, MODEL)
    near = krige(positions, values, targets, MODEL, neighbours=40)
    assert near.mean == pytest.approx(whole.mean, abs=0.02)
    assert np.all(near.variance >= whole.variance - 1e-5)


def test_samples_of_one_place_are_averaged():
    positions = np.array([[0, 0], [0, 0.001], [10, 0], [0, 10.0]])
    merged, values, counts = merge_places(positions, np.array([1.0, 3.0, 5.0, 7.0]))
    assert len(merged) == 3
    assert values[np.argmax(counts)] == 2.0


@pytest.mark.parametrize("bad", [[], [np.nan]])
def test_kriging_refuses_nothing_and_nan(bad):
    with pytest.raises(ValueError, match="sample"):
        krige(np.zeros((len(bad), 2)), np.array(bad), np.zeros((1, 2)), MODEL)


def test_a_fitted_variogram_finds_the_truth():
    truth = gs.Exponential(dim=2, var=2.0, len_scale=8.0)
    positions = scatter(1500, 1)
    values = gs.SRF(truth, seed=3)(positions.T)
    fit = fit_variogram(positions, values)
    assert fit.model.sill + fit.model.nugget == pytest.approx(2.0, rel=0.3)
    assert fit.model.practical_range_m == pytest.approx(24.0, rel=0.4)


def test_an_exact_variogram_is_fitted_exactly():
    empirical = empirical_variogram(scatter(300), smooth(scatter(300)))
    true = CovarianceModel(kind="spherical", sill=0.6, range_m=25.0, nugget=0.05)
    exact = type(empirical)(
        distance_m=empirical.distance_m,
        semivariance=true.variogram(empirical.distance_m),
        pairs=empirical.pairs,
    )
    model, misfit, _ = fit_model(exact, "spherical")
    assert (model.nugget, model.sill, model.range_m) == pytest.approx((0.05, 0.6, 25.0), rel=1e-3)
    assert misfit < 1e-8


@pytest.mark.slow
def test_intervals_cover_what_they_promise():
    """Coverage of the 95 % intervals of the signal, over 20 simulated fields."""
    inside, standardised = [], []
    for seed in range(20):
        positions, targets = scatter(250, seed), scatter(200, seed + 99)
        field = gs.SRF(gs.Exponential(dim=2, var=1.0, len_scale=25.0), seed=seed)
        truth = field(np.vstack([positions, targets]).T)
        noise = np.random.default_rng(seed).normal(0, 0.2, 250)
        model = CovarianceModel(kind="exponential", sill=1.0, range_m=25.0, nugget=0.04)
        estimate = krige(positions, truth[:250] + noise, targets, model)
        z = (estimate.mean - truth[250:]) / estimate.sd
        inside.append(np.mean(np.abs(z) < 1.96))
        standardised.append(np.mean(z**2))
    assert np.mean(inside) == pytest.approx(0.95, abs=0.02)
    assert np.mean(standardised) == pytest.approx(1.0, abs=0.1)


def test_validation_leaves_out_stretches():
    along = np.column_stack([np.linspace(0, 300, 200), np.zeros(200)])
    readings = Readings(positions=along, values=smooth(along))
    field = Kriging().fit(readings, Domain(WATER, make_grid(WATER, 5.0)))
    report = validate(readings, field)
    assert report.samples == 200
    assert "blocks" in report.left_out
    assert report.rmse > 0.01
    few = np.arange(200) < 10
    assert validate(field.readings.part(few), field) is None


WATER = shapely.Polygon([(0, 0), (100, 0), (100, 60), (0, 100)])


def mapped(positions, values, flags):
    return Mapper(WATER, make_grid(WATER, 5.0)).map_quantity(TEMPERATURE, positions, values, flags)


def test_a_grid_lies_in_the_water():
    grid = make_grid(WATER, 2.0)
    assert shapely.contains_xy(WATER, *grid.nodes.T).all()
    assert len(grid.nodes) * 4 == pytest.approx(WATER.area, rel=0.05)
    with pytest.raises(InputError, match="nodes"):
        make_grid(WATER, 0.01)
    with pytest.raises(InputError):
        make_grid(WATER, -1)


def test_flagged_and_missing_values_stay_out():
    positions = scatter(50)
    values = smooth(positions)
    flags = np.full(50, Flag.GOOD)
    values[3], values[7] = 1e6, np.nan
    flags[3], flags[7] = Flag.FAIL, Flag.MISSING
    result = mapped(positions, values, flags)
    assert (result.samples, result.flagged) == (48, 1)
    assert np.nanmax(result.mean) < 10


@pytest.mark.parametrize(
    ("positions", "values"),
    [
        (scatter(1), [1.0]),
        (np.zeros((30, 2)), np.ones(30)),
        (np.zeros((30, 2)), np.arange(30.0)),
    ],
)
def test_samples_that_make_no_map_are_named(positions, values):
    flags = np.full(len(values), Flag.GOOD)
    with pytest.raises(InputError, match="Temperature"):
        mapped(positions, np.array(values), flags)


@pytest.mark.parametrize(
    "positions", [scatter(30), np.column_stack([np.arange(30.0), np.zeros(30)])]
)
def test_equal_values_and_a_single_line_still_map(positions):
    flags = np.full(30, Flag.GOOD)
    result = mapped(positions, np.full(30, 7.0), flags)
    assert np.nanmin(result.mean) == pytest.approx(7.0)
    assert np.nanmax(result.mean) == pytest.approx(7.0)


def test_netcdf_holds_what_was_mapped(tmp_path):
    positions = scatter(60)
    values = {key: smooth(positions) for key in LIMNOLOGICAL}
    values["turbidity_ntu"] = np.full(60, np.nan)
    column = np.zeros(60)
    samples = Samples(
        times=np.arange(60.0),
        positions=positions,
        target_seq=column.astype(int),
        speed_mps=column,
        values=values,
        flags={key: np.full(60, Flag.GOOD) for key in LIMNOLOGICAL},
    )
    maps, left_out = map_all(Mapper(WATER, make_grid(WATER, 5.0)), samples, LIMNOLOGICAL)
    assert left_out == ["Turbidity: not measured"]
    path = tmp_path / "map.nc"
    write_netcdf(path, maps, FRAME, ENTRY)
    with netCDF4.Dataset(path) as file:
        assert file.Conventions == "CF-1.8, ACDD-1.3"
        assert "turbidity_ntu" not in file.variables
        stored = file["ph"][:].filled(np.nan)
        assert np.allclose(stored, maps[2].mean, equal_nan=True, atol=1e-5)
        assert file["ph"].ancillary_variables == "ph_sd"
        north = file["y"][:][:, None] + 0 * file["x"][:][None, :]
        local = FRAME.to_local(np.stack([file["lon"][:], file["lat"][:]], axis=-1))
        assert np.allclose(local[..., 0], north, atol=1e-6)
    assert [p.name for p in tmp_path.iterdir()] == ["map.nc"]


def test_free_water_varies_as_lakes_do():
    spreads = {key: [] for key in LIMNOLOGICAL}
    for seed in range(3):
        water = free_water((0, 0, 300, 300), seed)
        for key in LIMNOLOGICAL:
            spreads[key].append(water.fields[key].std())
    for key, quantity in LIMNOLOGICAL.items():
        lake = quantity.lake
        assert 0.2 * lake.sd < np.mean(spreads[key]) < 1.5 * lake.sd


def test_conditioned_water_goes_through_the_samples():
    positions = scatter(150)
    values = {"ph": 7.5 + 0.3 * smooth(positions)}
    water = conditioned_water((0, 0, 100, 100), positions, values, seed=2)
    there = water.value("ph", positions)
    assert np.sqrt(np.mean((there - values["ph"]) ** 2)) < 0.25 * values["ph"].std()
    assert set(water.fields) == {"ph"}


def test_windows_by_tiles_are_as_good_as_all_samples_along_a_track():
    """For two thousand samples along legs, the map by tiles differs from that of the complete
    system by a fortieth of its own error, and nowhere by more than a quarter.
    """
    rng = np.random.default_rng(4)
    corners = rng.uniform(0, 300, (15, 2))
    along = np.linspace(0, 14, 2000)
    positions = np.column_stack([np.interp(along, np.arange(15), c) for c in corners.T])
    model = CovarianceModel(kind="matern32", sill=1.0, range_m=40.0, nugget=0.05)
    values = smooth(positions) + rng.normal(0, 0.2, 2000)
    targets = make_grid(shapely.box(0, 0, 300, 300), 6.0).nodes
    tiled = krige(positions, values, targets, model)
    whole = krige(positions, values, targets, model, neighbours=2000)
    apart = np.abs(tiled.mean - whole.mean) / whole.sd
    assert np.sqrt(np.mean(apart**2)) < 0.03
    assert apart.max() < 0.25
    assert tiled.sd == pytest.approx(whole.sd, rel=0.05)


@pytest.mark.slow
def test_a_million_samples_in_one_spot_make_no_trouble():
    rng = np.random.default_rng(0)
    positions = np.full((1_000_000, 2), 50.0)
    values = rng.normal(7.0, 0.1, 1_000_000)
    model = CovarianceModel(kind="exponential", sill=1.0, range_m=30.0, nugget=0.01)
    found = krige(positions, values, np.array([[50.0, 50.0], [80.0, 50.0]]), model)
    assert found.mean == pytest.approx([7.0, 7.0], abs=1e-3)
    assert found.variance[0] < 1e-3 < found.variance[1]


@pytest.mark.parametrize("count", [300, 900])
def test_a_reading_that_is_recorded_twice_counts_once(count):
    positions, targets = scatter(count), scatter(20, 5)
    values = smooth(positions) + np.random.default_rng(0).normal(0, 0.3, count)
    model = CovarianceModel(kind="exponential", sill=1.0, range_m=30.0, nugget=0.09)
    once = krige(positions, values, targets, model)
    twice = krige(np.tile(positions, (2, 1)), np.tile(values, 2), targets, model)
    assert twice.mean == pytest.approx(once.mean)
    assert twice.variance == pytest.approx(once.variance)
    flags = np.full(count, Flag.GOOD)
    single = mapped(positions, values, flags)
    double = mapped(np.tile(positions, (2, 1)), np.tile(values, 2), np.tile(flags, 2))
    assert double.model == single.model


@pytest.mark.parametrize("factor", [1.0, 1e5])
def test_the_unit_does_not_matter(factor):
    positions, values = scatter(40), 5 + smooth(scatter(40))
    model = CovarianceModel(kind="exponential", sill=factor**2, range_m=30.0, nugget=0.0)
    far = krige(positions, factor * values, np.array([[2000.0, 2000.0]]), model)
    plain = krige(positions, values, np.array([[2000.0, 2000.0]]), MODEL)
    assert far.mean / factor == pytest.approx(plain.mean, rel=1e-6)
    assert far.sd / factor == pytest.approx(plain.sd, rel=1e-6)


def test_a_grid_of_one_row_is_no_map():
    with pytest.raises(InputError, match="finer resolution"):
        make_grid(WATER, 120.0)


def test_what_does_not_vary_is_not_known_better_than_the_sensor_resolves():
    one = mapped(scatter(30), np.full(30, 7.0), np.full(30, Flag.GOOD))
    assert np.nanmin(one.sd) == pytest.approx(TEMPERATURE.resolution / np.sqrt(12))
