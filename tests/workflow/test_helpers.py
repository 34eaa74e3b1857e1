"""Helpers give the same results in the same order, and lose nothing, whatever happens to them."""

import os
import signal
import time
from functools import partial

import numpy as np
import pytest
import shapely
import xarray
from click.testing import CliRunner
from conftest import square_survey

from grebe.cli.main import grebe
from grebe.core.quantities import BUILTIN
from grebe.core.samples import Samples
from grebe.io.store import SurveyFile
from grebe.mapping.grid import make_grid
from grebe.mapping.maps import Mapper, MapSettings, map_all
from grebe.mapping.methods.spde import Spde
from grebe.mapping.scale import LINEAR
from grebe.workflow.files import write_survey
from grebe.workflow.helpers import WorkerPool
from grebe.workflow.maps import helpers_for

KEYS = ("temperature_degc", "dissolved_oxygen_mgl", "ph")


def rested_in(here, item):
    """Return who did it; this process, `here`, is so slow that helpers do some."""
    if os.getpid() == here:
        time.sleep(0.5)
    return item, os.getpid()


def deadly_but_in(here, item):
    if os.getpid() != here:
        os.kill(os.getpid(), signal.SIGKILL)
    time.sleep(0.3)
    return item


def odd_refused(item):
    if item % 2:
        raise ValueError(f"{item} is odd")
    return item


def running(pool):
    return [one.process.poll() is None for one in pool._helpers]


def test_several_processes_share_the_items_and_keep_their_order():
    with WorkerPool(2) as pool:
        done = list(pool.map(partial(rested_in, os.getpid()), range(12)))
        helpers = pool._helpers
    assert [item for item, _ in done] == list(range(12))
    assert len({who for _, who in done}) > 1
    assert all(one.process.poll() is not None for one in helpers)  # none outlives its crew


def test_a_killed_helper_loses_nothing():
    with WorkerPool(2) as pool:
        assert list(pool.map(partial(deadly_but_in, os.getpid()), range(12))) == list(range(12))
        assert list(pool.map(odd_refused, [0, 2, 4])) == [0, 2, 4]  # and later work is done too


def test_what_cannot_be_sent_is_done_here():
    here = os.getpid()
    with WorkerPool(1) as pool:
        assert list(pool.map(lambda item: (item, os.getpid()), [1, 2])) == [(1, here), (2, here)]


def test_an_error_is_the_items_own_and_ends_the_helpers():
    with WorkerPool(1) as pool:
        results = pool.map(odd_refused, [0, 1, 2])
        assert next(results) == 0
        with pytest.raises(ValueError, match="1 is odd"):
            next(results)
        assert not running(pool)


def lake_samples(count, keys=KEYS):
    rng = np.random.default_rng(3)
    places = rng.uniform(5, 95, (count, 2))
    waves = np.sin(places[:, 0] / 15) + np.cos(places[:, 1] / 20)
    return Samples.of(
        times=1.6e9 + np.arange(float(count)),
        positions=places,
        values={key: 8 + waves + rng.normal(0, 0.1, count) for key in keys},
        quantities=BUILTIN,
    )


@pytest.mark.parametrize("method", [None, Spde()])
def test_maps_are_the_same_to_the_digit_whoever_makes_them(method):
    samples, water = lake_samples(90), shapely.box(0, 0, 100, 100)
    mapper = Mapper(water, make_grid(water, 5.0), MapSettings(method=method, scale=LINEAR))
    alone, left_out = map_all(mapper, samples, BUILTIN)
    with WorkerPool(1) as pool:
        shared, same = map_all(mapper, samples, BUILTIN, each=pool.map)
        assert all(running(pool))
    assert [one.quantity.key for one in shared] == list(KEYS)
    assert left_out == same
    for one, other in zip(shared, alone, strict=True):
        assert np.array_equal(one.mean, other.mean, equal_nan=True)
        assert np.array_equal(one.sd, other.sd, equal_nan=True)
        assert np.array_equal(one.draws(2), other.draws(2), equal_nan=True)
        assert not one.interval95
        assert one.model.semivariance(np.array([9.0])) == other.model.semivariance(np.array([9.0]))


@pytest.mark.parametrize(
    ("count", "resolution_m", "workers", "helpers"),
    [
        (500, None, None, 3),
        (20, None, None, 0),  # a second process takes longer to begin
        (500, 0.05, None, 0),  # each process would hold the whole fine grid
        (500, None, 1, 0),
        (20, None, 2, 1),
    ],
)
def test_helpers_are_called_where_they_pay(
    tmp_path, monkeypatch, count, resolution_m, workers, helpers
):
    monkeypatch.setattr("grebe.workflow.maps.idle_cores", lambda: 3)
    path = tmp_path / "survey.gpkg"
    write_survey(path, square_survey(100.0))
    with SurveyFile.open(path) as file:
        file.extend_samples(lake_samples(count))
        assert helpers_for(file, resolution_m, workers) == helpers


def test_the_command_writes_the_same_files_by_two_processes(tmp_path):
    path = tmp_path / "survey.gpkg"
    write_survey(path, square_survey(100.0))
    with SurveyFile.open(path) as file:
        file.extend_samples(lake_samples(60, KEYS[:2]))
    for workers in ("1", "2"):
        words = ["map", str(path), "--out", str(tmp_path / workers), "--workers", workers]
        assert CliRunner().invoke(grebe, [*words, "--resolution", "5"]).exit_code == 0
    first, second = tmp_path / "1", tmp_path / "2"
    assert sorted(one.name for one in first.iterdir()) == sorted(
        one.name for one in second.iterdir()
    )
    with (
        xarray.open_dataset(first / "map.nc") as one,
        xarray.open_dataset(second / "map.nc") as two,
    ):
        assert one.equals(two)
    for picture in first.glob("*.png"):
        assert picture.read_bytes() == (second / picture.name).read_bytes()
