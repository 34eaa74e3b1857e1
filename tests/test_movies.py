"""Movies as files, in the report, and by the command line."""

import csv
import json
from dataclasses import replace

import numpy as np
import pytest
import xarray
from click.testing import CliRunner
from conftest import ENTRY, FRAME, TEMPERATURE
from mapping.changing_water import WATER, read
from netcdf_checks import CREDITS, NOT_KNOWN, told_of

from grebe.cli.main import grebe
from grebe.core.samples import Flag
from grebe.io.export.netcdf_movie import write_movie_netcdf
from grebe.mapping.grid import make_grid
from grebe.mapping.maps import Mapper, MapSettings
from grebe.mapping.movie import moments_of, movie_of
from grebe.report.movie_figures import MOST_MAPS, shown_moments
from grebe.workflow.tracks import import_track


@pytest.fixture(scope="module")
def movie():
    given = read(1, drift=1.5)
    mapper = Mapper(WATER, make_grid(WATER, 6.0), MapSettings(moment="middle"))
    flags = np.full(len(given), Flag.GOOD)
    still = mapper.map_quantity(TEMPERATURE, given.positions, given.values, flags, given.times)
    return movie_of(still, moments_of(given.times, np.ptp(given.times) / 5))


@pytest.mark.filterwarnings("ignore:Passing the dataset to every single check")
def test_the_checkers_of_cf_and_acdd_accept_a_movie_and_xarray_opens_it(movie, tmp_path):
    path = tmp_path / "movie.nc"
    write_movie_netcdf(path, [movie], FRAME, replace(ENTRY, comment="c", credits=CREDITS))
    told = told_of(path)
    assert sorted(told) == sorted(NOT_KNOWN)
    with xarray.open_dataset(path) as file:
        key = movie.still.quantity.key
        assert file[key].dims == file[f"{key}_sd"].dims == ("time", "y", "x")
        assert np.allclose(file["time"].values.astype("int64") / 1e9, movie.times_s, atol=1e-3)
        last = file[key].sel(time=file["time"][-1]).values
        assert np.allclose(last, movie.means[-1], equal_nan=True, atol=1e-5)
        assert (file[f"{key}_sd"].max(("y", "x")) > 0).all()


def test_times_are_drawn_evenly():
    for count in (2, 8, 9, 13, 200):
        shown = shown_moments(count)
        assert len(shown) <= MOST_MAPS
        assert shown[0] == 0
        assert shown[-1] < count
        assert len(set(np.diff(shown).tolist())) <= 1
    assert len(shown_moments(8)) == 8


@pytest.fixture(scope="module")
def survey(tmp_path_factory):
    """Water that warms while it is measured, and whose pH stays as it is."""
    folder = tmp_path_factory.mktemp("movies")
    warming, still = read(1, drift=1.5), read(3)
    latlon = FRAME.to_wgs84(warming.positions)[:, ::-1]
    with (folder / "track.csv").open("w", newline="") as file:
        writer = csv.writer(file)
        writer.writerow(["time", "latitude", "longitude", "temperature_degc", "ph"])
        writer.writerows(
            np.column_stack([warming.times, latlon, 15 + warming.values, 7 + 0.1 * still.values])
        )
    import_track(folder / "track.csv", folder / "lake.gpkg")
    return folder / "lake.gpkg"


def test_a_movie_is_made_of_what_changed_and_the_rest_is_named(survey, tmp_path):
    out = tmp_path / "maps"
    asked = ["map", survey, "--out", out, "--every", "5", "--resolution", "8", "--json"]
    found = CliRunner().invoke(grebe, list(map(str, asked)))
    assert found.exit_code == 0, found.output
    assert "no movie of pH: the samples do not show that the water changed" in found.stderr
    written = json.loads(found.stdout)["files"]
    assert {str(out / name) for name in ("movie.nc", "temperature_degc_movie.png")} <= {*written}
    with xarray.open_dataset(out / "movie.nc") as film, xarray.open_dataset(out / "map.nc") as map_:
        assert "ph" not in film
        assert len(film["time"]) == 6
        level = film["temperature_degc"].mean(("y", "x")).values
        assert level[-1] - level[0] == pytest.approx(1.3, abs=0.4)
        assert map_["temperature_degc"].attrs["moment"].startswith("2020-09-13T12:41")
    item = json.loads((out / "item.json").read_text())
    assert {"movie.nc", "temperature_degc_movie.png"} <= set(item["assets"])


@pytest.mark.parametrize(
    ("language", "shown", "still"),
    [
        ("en", "Temperature: the water at 3 moments of the survey, 12.5 min apart", "pH: the s"),
        ("fr", "Température : l'eau à 3 instants du relevé, espacés de 12,5 min", "pH. Les éch"),
    ],
)
def test_the_report_shows_the_movie_and_says_of_what_there_is_none(
    survey, tmp_path, language, shown, still
):
    page = tmp_path / "page.html"
    asked = ["report", survey, "-o", page, "--every", "12.5", "--resolution", "8"]
    found = CliRunner().invoke(grebe, [*map(str, asked), "--language", language])
    assert found.exit_code == 0, found.output
    text = page.read_text().replace("&#39;", "'")
    assert shown in text
    assert still in text


def test_a_movie_without_time_between_its_maps_is_refused_by_its_flag(survey, tmp_path):
    for minutes, told in (
        ("0", "not a number of minutes"),
        ("0.01", "a movie takes 2"),
        ("x", "'x'"),
    ):
        asked = ["map", str(survey), "--out", str(tmp_path / "maps"), "--every", minutes]
        found = CliRunner().invoke(grebe, asked)
        assert found.exit_code != 0
        assert told in found.stderr + str(found.exception)
        assert not (tmp_path / "maps").exists()
