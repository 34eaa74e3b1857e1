"""Samples for other programs: a table, GeoParquet, results for the exchange."""

import csv
import json

import numpy as np
import pyarrow.parquet as pq
import pytest
import shapely
from click.testing import CliRunner
from conftest import CHINA, FRAME, needs_tracks

from grebe.cli.main import grebe
from grebe.core.errors import InputError
from grebe.core.quantities import BUILTIN
from grebe.core.samples import Flag, Samples
from grebe.io.export.samples import (
    CHARACTERISTICS,
    Measured,
    write_geoparquet,
    write_results,
    write_table,
    writer_of,
)
from grebe.io.readers.track import read_track

N = 6


@pytest.fixture
def measured():
    """Return six samples: a missing value, a failed one, a quantity unnamed in the exchange."""
    samples = Samples.of(
        times=1.75e9 + 0.5 * np.arange(N),
        positions=np.column_stack([np.arange(N), 2.0 * np.arange(N)]),
        values={
            "temperature_degc": np.array([20.1, 20.2, np.nan, 20.4, 20.5, 20.6]),
            "ph": np.array([7.0, 7.1, 7.2, 99.0, 7.4, 7.5]),
            "chlorophyll_rfu": np.linspace(0.1, 0.6, N),
        },
        quantities=BUILTIN,
    )
    return Measured(samples=samples, frame=FRAME, name="pond")


def test_the_table_is_read_back_by_grebe_itself(measured, tmp_path):
    path = tmp_path / "samples.csv"
    assert write_table(measured, path) == N
    track = read_track(path, quantities=BUILTIN)
    assert np.allclose(track.times, measured.samples.times)
    assert FRAME.to_local(track.lonlat) == pytest.approx(measured.samples.positions, abs=0.02)
    for key, values in measured.samples.values.items():
        assert track.values[key] == pytest.approx(values, nan_ok=True)
    with path.open() as file:
        flags = [int(row["ph_flag"]) for row in csv.DictReader(file)]
    assert flags == measured.samples.flags["ph"].tolist()
    assert flags[3] == Flag.FAIL


def test_geoparquet_holds_points_in_wgs_84(measured, tmp_path):
    path = tmp_path / "samples.parquet"
    assert write_geoparquet(measured, path) == N
    table = pq.read_table(path)
    geo = json.loads(table.schema.metadata[b"geo"])
    assert geo["version"] == "1.1.0"
    column = geo["columns"][geo["primary_column"]]
    assert (column["encoding"], column["geometry_types"]) == ("WKB", ["Point"])
    points = shapely.from_wkb(table.column(geo["primary_column"]).to_pylist())
    assert shapely.get_coordinates(points) == pytest.approx(measured.lonlat)
    assert column["bbox"] == pytest.approx(shapely.total_bounds(points).tolist())
    times = [one.timestamp() for one in table.column("time").to_pylist()]
    assert times == pytest.approx(measured.samples.times.tolist())
    assert np.isnan(table.column("temperature_degc").to_pylist()[2])


def test_results_are_usable_values_under_the_portal_s_names(measured, tmp_path):
    path = tmp_path / "lake.wqx.csv"
    assert write_results(measured, path) == 2 * N - 2
    with path.open() as file:
        rows = list(csv.DictReader(file))
    assert {row["CharacteristicName"] for row in rows} == {"Temperature, water", "pH"}
    assert max(float(row["ResultMeasureValue"]) for row in rows) < 30
    first = rows[0]
    assert (first["ActivityStartDate"], first["ActivityStartTime/Time"]) == (
        "2025-06-15",
        "15:06:40",
    )
    assert first["ResultMeasure/MeasureUnitCode"] == "deg C"
    assert measured.unnamed() == ["chlorophyll_rfu"]
    assert set(CHARACTERISTICS) <= set(BUILTIN)


def test_a_name_says_what_is_written(tmp_path):
    assert writer_of(tmp_path / "A.WQX.CSV") is write_results
    assert writer_of(tmp_path / "a.csv") is write_table
    assert writer_of(tmp_path / "a.plan") is None


@needs_tracks
def test_the_command_exports_a_track(tmp_path):
    def run(*words):
        done = CliRunner().invoke(grebe, [str(word) for word in words])
        return done.exit_code, done.output + str(done.exception)

    survey, out = tmp_path / "s.gpkg", tmp_path / "out.wqx.csv"
    run("import", CHINA, "-o", survey)
    code, said = run("export", survey, "-o", out, "--json")
    assert code == 0, said
    assert "chlorophyll_rfu" in said
    with out.open() as file:
        assert sum(1 for _ in file) > 10_000
    code, said = run("export", survey, "-o", out)
    assert code != 0
    assert "exists already" in said


def test_results_have_the_sonde_s_depth_and_no_more_digits_than_it_resolves(measured, tmp_path):
    values = dict(measured.samples.values) | {"sonde_depth_m": np.full(N, 0.5123)}
    values["ph"] = np.full(N, 7.123456)
    samples = Samples.of(
        times=measured.samples.times, positions=measured.samples.positions, values=values,
        quantities=BUILTIN,
    )  # fmt: skip
    measured = Measured(samples=samples, frame=FRAME, name="pond")
    path = tmp_path / "lake.wqx.csv"
    write_results(measured, path)
    with path.open() as file:
        rows = list(csv.DictReader(file))
    assert {row["ActivityDepthHeightMeasure/MeasureValue"] for row in rows} == {"0.51"}
    assert {r["ResultMeasureValue"] for r in rows if r["CharacteristicName"] == "pH"} == {"7.123"}
    assert measured.unnamed() == ["chlorophyll_rfu"]


def test_what_was_simulated_is_no_result(simulated_survey, tmp_path):
    words = ["export", str(simulated_survey[0]), "-o", str(tmp_path / "lake.wqx.csv")]
    done = CliRunner().invoke(grebe, words)
    assert isinstance(done.exception, InputError)
    assert "was sailed in simulation" in str(done.exception)
    words[-1] = str(tmp_path / "lake.csv")
    assert CliRunner().invoke(grebe, words).exit_code == 0
