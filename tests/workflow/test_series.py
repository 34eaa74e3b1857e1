"""Surveys of the same water over the years, from loggers' files to trends."""

import csv
import json
from datetime import UTC, datetime

import netCDF4
import numpy as np
import pytest
import rasterio
from click.testing import CliRunner

from grebe.cli.main import grebe
from grebe.core.errors import InputError
from grebe.io.store import SurveyFile
from grebe.workflow.differences import compare_surveys
from grebe.workflow.series import map_series
from grebe.workflow.tracks import import_track

WIDE_M, DEG_M = 120.0, 111_320.0


def sailed(folder, year, month=7, warmer=0.0, seed=0, columns=("temperature_degc", "ph")):
    """Make a survey file of lanes 10 m apart; its eastern half is warmer, and its pH is a wave."""
    rng = np.random.default_rng(seed)
    along = np.arange(0, WIDE_M + 1, 3.0)
    lanes = [(n, e) for k, n in enumerate(range(0, 121, 10)) for e in along[:: (-1) ** k]]
    north, east = np.array(lanes).T
    start = datetime(year, month, 1, 10, tzinfo=UTC).timestamp()
    wave = 0.4 * np.sin(2 * np.pi * north / 90) + 0.2 * np.cos(2 * np.pi * east / 70)
    values = {
        "temperature_degc": 18
        + wave
        + warmer * (east > WIDE_M / 2)
        + rng.normal(0, 0.02, len(east)),
        "ph": 7.5 + 0.3 * wave + rng.normal(0, 0.02, len(east)),
    }
    path = folder / f"{year}-{month:02}.csv"
    with path.open("w", newline="") as file:
        writer = csv.writer(file)
        writer.writerow(["time", "latitude", "longitude", *columns])
        for k in range(len(east)):
            place = 50.6 + north[k] / DEG_M, 3.17 + east[k] / DEG_M / np.cos(np.radians(50.6))
            writer.writerow([start + 2 * k, *place, *(values[key][k] for key in columns)])
    import_track(path, path.with_suffix(".gpkg"))
    return path.with_suffix(".gpkg")


@pytest.fixture(scope="module")
def years(tmp_path_factory):
    folder = tmp_path_factory.mktemp("years")
    return [sailed(folder, 2020 + k, warmer=0.5 * k, seed=k) for k in range(5)]


@pytest.fixture(scope="module")
def told(years, tmp_path_factory):
    """Return what the command line says about the five, given in no order, and its folder."""
    out = tmp_path_factory.mktemp("out") / "trend"
    words = ["diff", *map(str, years[::-1]), "--out", str(out), "--resolution", "5", "--json"]
    done = CliRunner().invoke(grebe, words, standalone_mode=False, catch_exceptions=False)
    return json.loads(done.stdout), out


def test_a_half_that_warms_is_found_and_the_other_is_not(told):
    rows, out = told
    with rasterio.open(out / "temperature_degc_trend.tif") as raster:
        slope, sd, p = raster.read(masked=True)
        assert raster.descriptions == ("trend per year", "sd", "P(adjusted)")
        assert raster.units == ("°C / year", "°C / year", "1")
        columns = np.arange(raster.width) * 5.0
    west, east = slope[:, columns < 50], slope[:, columns > 70]
    assert west.mean() == pytest.approx(0.0, abs=0.05)
    assert east.mean() == pytest.approx(0.5, abs=0.05)
    assert (p[:, columns > 70] < 0.05).mean() > 0.9
    assert sd.min() > 0
    assert rows["temperature_degc"]["trend_per_year"] == pytest.approx(0.25, abs=0.05)
    assert rows["temperature_degc"]["p"] < 1e-3


def test_water_that_stays_as_it_is_has_no_trend(told):
    rows, _ = told
    ph = rows["ph"]
    assert abs(ph["trend_per_year"]) < ph["half_width_95"]
    assert ph["p_adjusted"] > 0.05
    assert ph["changed_share"] == 0.0


def test_the_series_is_a_netcdf_over_time_that_others_read(told, years):
    _, out = told
    with netCDF4.Dataset(out / "series.nc") as data:
        when = netCDF4.num2date(data["time"][:], data["time"].units)
        assert [one.year for one in when] == [2020, 2021, 2022, 2023, 2024]
        assert data["temperature_degc"].dimensions == ("time", "y", "x")
        assert data["temperature_degc_trend"].units == "degree_Celsius year-1"
        warmer = data["temperature_degc"][4] - data["temperature_degc"][0]
        assert float(np.nanmax(warmer)) == pytest.approx(2.0, abs=0.2)
        assert data.time_coverage_start.startswith("2020-07")
    assert (out / "temperature_degc_trend.png").stat().st_size > 20_000


def test_a_quantity_that_few_measured_is_left_out_with_the_reason(years, tmp_path):
    only = [sailed(tmp_path, 2030 + k, columns=("temperature_degc",)) for k in range(2)]
    series = map_series([*years[:2], *only], 10.0)
    assert set(series.by_quantity) == {"temperature_degc"}
    assert len(series.by_quantity["temperature_degc"].times_s) == 4
    assert any("pH" in text and "surveys of 2 days" in text for text in series.left_out)


@pytest.mark.parametrize(
    ("count", "more", "code", "says"),
    [
        (1, (), 2, "a change takes two"),
        (2, ("--seasonal",), 2, "Two surveys are too few"),
        (5, ("--seasonal",), 3, "6 surveys over 2 years; there are 5"),
    ],
)
def test_too_few_surveys_are_refused_in_a_sentence(years, tmp_path, count, more, code, says):
    words = ["diff", *map(str, years[:count]), "--out", str(tmp_path / "x"), "--resolution", "20"]
    with pytest.raises(Exception, match=says) as caught:
        CliRunner().invoke(grebe, [*words, *more], standalone_mode=False, catch_exceptions=False)
    assert caught.value.exit_code == code


def test_of_two_surveys_the_later_less_the_earlier(years):
    changes = compare_surveys(years[0], years[2], 5.0)
    change = changes.by_quantity["temperature_degc"]
    east = change.before.grid.spread(change.before.grid.nodes[:, 1])
    middle = (np.nanmin(east) + np.nanmax(east)) / 2
    assert np.nanmean(change.difference.mean[east > middle + 10]) == pytest.approx(1.0, abs=0.05)
    assert np.nanmean(change.difference.mean[east < middle - 10]) == pytest.approx(0.0, abs=0.05)
    assert change.difference.clear[east > middle + 10].mean() > 0.95
    assert np.isfinite(change.difference.sd[change.before.grid.inside]).all()


def test_a_survey_without_samples_and_water_apart_are_refused(years, tmp_path):
    with SurveyFile.open(years[0]) as file:
        survey = file.survey
    empty = tmp_path / "empty.gpkg"
    with SurveyFile.create(empty, survey, meta={}, force=False):
        pass
    with pytest.raises(Exception, match="holds no samples"):
        map_series([*years[:2], empty])


def test_surveys_of_one_day_are_one_date(years, tmp_path):
    """Two on one day and one on another show no trend, however accurate their maps claim to be."""
    again = sailed(tmp_path, 2020, seed=7, warmer=0.1)
    with pytest.raises(InputError, match="surveys of 3 days, not 2"):
        map_series([years[0], again, years[1]], 10.0)
    series = map_series([years[0], again, *years[1:3]], 10.0)
    assert len(series.by_quantity["ph"].times_s) == 3


def test_a_difference_within_a_day_says_the_time(years, tmp_path):
    again = sailed(tmp_path, 2020, seed=7)
    assert compare_surveys(years[0], again, 20.0).days == ("2020-07-01 10:00", "2020-07-01 10:00")
    assert compare_surveys(years[0], years[1], 20.0).days == ("2020-07-01", "2021-07-01")
