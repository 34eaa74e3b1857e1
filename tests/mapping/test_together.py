"""A sparse quantity that a dense one helps to map, and quantities that nothing helps."""

import csv
import json
from dataclasses import replace

import numpy as np
import pytest
import shapely
from click.testing import CliRunner
from conftest import FRAME, OXYGEN, TEMPERATURE

from grebe.cli.main import grebe
from grebe.core.errors import InputError
from grebe.core.quantities import LIMNOLOGICAL
from grebe.core.samples import Samples
from grebe.mapping.covariance.coregionalisation_fit import _Problem, fit_coregionalisation
from grebe.mapping.covariance.models import CovarianceModel
from grebe.mapping.covariance.posterior import fit_rough
from grebe.mapping.fields.simulation import circulant_fields
from grebe.mapping.grid import make_grid
from grebe.mapping.maps import Mapper, MapSettings, map_all
from grebe.mapping.methods.base import Domain, Readings
from grebe.mapping.methods.kriging import Kriging
from grebe.mapping.methods.spde import Spde
from grebe.mapping.methods.together import Together, TogetherField
from grebe.workflow.tracks import import_track

SIDE = 120.0
WATER = shapely.box(0, 0, SIDE, SIDE)
DOMAIN = Domain(WATER, make_grid(WATER, 6.0))
UNIT = CovarianceModel(kind="exponential", sill=1.0, range_m=30.0, nugget=0.0)
NODES = DOMAIN.grid.nodes


def lanes():
    way = []
    for k, east in enumerate(np.arange(5.0, SIDE, 10.0)):
        north = np.arange(2.0, SIDE - 1, 2.0)
        way += [(n, east) for n in (north if k % 2 == 0 else north[::-1])]
    return np.array(way)


def made(seed, correlation, every=12):
    """Readings of one quantity at each `every`-th place along the lanes and of another at all of
    them; and the first one's true values at the nodes.
    """
    rng = np.random.default_rng(seed)
    dense = lanes()
    sparse = dense[::every] + rng.normal(0, 0.5, dense[::every].shape)
    at = np.vstack([sparse, dense, NODES])
    _, (shared, own) = circulant_fields(UNIT, DOMAIN.grid, at, 2, rng, 3)
    n, m = len(sparse), len(sparse) + len(dense)
    first = correlation * shared + np.sqrt(1 - correlation**2) * own
    return (
        Readings(positions=sparse, values=10 + first[:n] + rng.normal(0, 0.1, n)),
        Readings(positions=dense, values=3 * shared[n:m] + rng.normal(0, 0.1, m - n)),
        10 + first[m:],
    )


def together(first, second):
    return Together(beside=(("b", second),), alone=Kriging(fit_covariance=fit_rough)).fit(
        first, DOMAIN
    )


@pytest.mark.parametrize("correlation", [0.95, -0.95])
def test_a_sparse_quantity_is_mapped_better_by_a_dense_one_that_goes_with_it(correlation):
    errors, held = [], []
    for seed in range(4):
        first, second, truth = made(seed, correlation)
        field = together(first, second)
        alone = Kriging(fit_covariance=fit_rough).fit(first, DOMAIN)
        told = field.model.companions
        assert told.heeded
        assert told.correlations[0] == pytest.approx(correlation, abs=0.15)
        assert 0.2 < told.spared < 0.9
        errors.append([np.std(one.mean(NODES) - truth) for one in (field, alone)])
        held.append(np.mean(np.abs(field.mean(NODES) - truth) <= 1.96 * field.sd(NODES)))
    better = np.array(errors)
    assert (better[:, 0] < 0.8 * better[:, 1]).all(), better
    assert 0.88 < np.mean(held) < 0.99, held


def test_of_independent_quantities_each_is_mapped_alone():
    for seed in range(5):
        first, second, _ = made(seed, 0.0)
        field = together(first, second)
        alone = Kriging(fit_covariance=fit_rough).fit(first, DOMAIN)
        assert not field.model.companions.heeded
        assert np.array_equal(field.mean(NODES), alone.mean(NODES))
        assert np.array_equal(field.sd(NODES), alone.sd(NODES))


def test_where_both_were_read_together_the_other_gains_next_to_nothing():
    first, second, _ = made(3, 0.95, every=1)
    told = together(first, replace(second, positions=first.positions)).model.companions
    assert told.spared < 0.1


def test_what_is_left_out_of_one_is_left_out_of_the_other():
    first, second, _ = made(1, 0.9)
    field = together(first, second)
    kept = first.positions[:, 1] < 60
    left = field.given(first.part(kept))
    assert isinstance(left, TogetherField)
    assert left.beside[0].positions[:, 1].max() < 75
    assert field.given(first).beside[0].positions.shape == second.positions.shape


def test_draws_have_the_field_s_mean_and_sd():
    first, second, _ = made(2, 0.9)
    field = together(first, second)
    some = NODES[::9]
    drawn = field.draws(some, 400, 1)
    sd = field.sd(some)
    assert np.abs((drawn.mean(axis=0) - field.mean(some)) / sd).mean() < 0.1
    assert np.median(drawn.std(axis=0) / sd) == pytest.approx(1.0, abs=0.1)


def test_the_slope_of_the_density_is_its_derivative():
    first, second, _ = made(1, 0.7)
    problem = _Problem.of((first, second.part(np.arange(len(second)) % 8 == 0), first))
    likeness = np.array([[1, 0.5, 0.3], [0.5, 1, 0.2], [0.3, 0.2, 1]])
    at = problem.start(likeness) + 0.1
    _, slope = problem.density_and_slope(at)
    for i, step in enumerate(1e-5 * np.eye(len(at))):
        ends = [problem.density_and_slope(at + side * step)[0] for side in (1, -1)]
        assert slope[i] == pytest.approx((ends[0] - ends[1]) / 2e-5, rel=1e-4, abs=1e-4)


def test_a_quantity_that_does_not_vary_is_refused():
    first, second, _ = made(1, 0.7)
    flat = replace(second, values=np.ones(len(second)))
    with pytest.raises(ValueError, match="do not vary"):
        fit_coregionalisation((first, flat))


def samples_of(first, second):
    positions = np.vstack([first.positions, second.positions])
    n = len(first)
    values = np.full((2, len(positions)), np.nan)
    values[0, :n], values[1, n:] = first.values, 20 + second.values
    return Samples.of(
        times=1.6e9 + np.arange(len(positions)),
        positions=positions,
        values={OXYGEN.key: values[0], TEMPERATURE.key: values[1]},
        quantities=LIMNOLOGICAL,
    )


def test_what_is_asked_for_together_is_mapped_together():
    first, second, truth = made(0, 0.95)
    samples = samples_of(first, second)
    keys = (OXYGEN.key, TEMPERATURE.key)
    maps, _ = map_all(Mapper(WATER, DOMAIN.grid, MapSettings(together=keys)), samples, LIMNOLOGICAL)
    sparse, dense = sorted(maps, key=lambda one: one.samples)
    assert sparse.method.key == "cokriging"
    assert dense.method.key == ("cokriging" if dense.model.companions.heeded else "kriging")
    assert sparse.model.companions.names == (TEMPERATURE.key,)
    assert sparse.model.companions.heeded
    within = np.abs(sparse.mean[sparse.grid.inside] - truth) <= 1.96 * sparse.sd[sparse.grid.inside]
    assert within.mean() > 0.85
    # The dense one gains next to nothing from the sparse one.
    assert dense.model.companions.spared < 0.05


def test_land_between_is_mapped_alone():
    first, second, _ = made(0, 0.95)
    settings = MapSettings(together=(OXYGEN.key, TEMPERATURE.key), method=Spde())
    maps, _ = map_all(Mapper(WATER, DOMAIN.grid, settings), samples_of(first, second), LIMNOLOGICAL)
    assert {one.model.companions for one in maps} == {None}


def test_what_was_not_measured_cannot_be_together_with_others():
    samples = samples_of(*made(0, 0.95)[:2])
    mapper = Mapper(WATER, DOMAIN.grid, MapSettings(together=(OXYGEN.key, "ph")))
    with pytest.raises(InputError, match="ph was not measured, so it cannot be mapped together"):
        map_all(mapper, samples, LIMNOLOGICAL)
    with pytest.raises(InputError, match="at least two, not ph alone"):
        MapSettings(together=("ph", "ph"))


def test_the_command_line_says_what_it_brought(tmp_path):
    first, second, _ = made(0, 0.95)
    lonlat = FRAME.to_wgs84(second.positions)
    with (tmp_path / "track.csv").open("w", newline="") as file:
        writer = csv.writer(file)
        writer.writerow(["time", "latitude", "longitude", OXYGEN.key, TEMPERATURE.key])
        for k, (lon, lat) in enumerate(lonlat):
            oxygen = "" if k % 12 else 8 + 0.05 * first.values[k // 12]
            writer.writerow([1.6e9 + 4 * k, lat, lon, oxygen, 18 + 0.05 * second.values[k]])
    survey = tmp_path / "lake.gpkg"
    import_track(tmp_path / "track.csv", survey)
    asked = ["--resolution", "8", "--together", f"{OXYGEN.key},{TEMPERATURE.key}"]
    found = CliRunner().invoke(
        grebe, ["map", str(survey), "--out", str(tmp_path / "maps"), *asked, "--json"]
    )
    assert found.exit_code == 0, found.output
    assert "Dissolved oxygen: mapped together with temperature (correlation 0.9" in found.stderr
    assert "movie" not in found.stderr
    told = {one["quantity"]: one["together"] for one in json.loads(found.stdout)["maps"]}
    assert told[OXYGEN.key]["heeded"]
    assert told[OXYGEN.key]["names"] == [TEMPERATURE.key]
    page = tmp_path / "page.html"
    for language, said in (
        ("en", "was mapped together with tem"),
        ("fr", "Cartographié avec : tem"),
    ):
        made_page = ["report", str(survey), "-o", str(page), "--force", "--language", language]
        found = CliRunner().invoke(grebe, [*made_page, *asked])
        assert found.exit_code == 0, found.output
        assert said in page.read_text()
