"""The tracks of several outings are one survey."""

import json

import numpy as np
import pytest
from click.testing import CliRunner

from grebe.cli.main import grebe
from grebe.core.errors import TrackError, UsageError
from grebe.io.store import SurveyFile
from grebe.workflow.tracks import import_track

NINE, FIFTEEN = 1.6e9, 1.6e9 + 6 * 3600


def outing(folder, name, begins, *, north_m=0.0, lanes=6, extra=(), header="temp (C)"):
    """A boat's lanes of 40 m, 5 m apart, a reading each two seconds."""
    rows, at = [], begins
    for lane in range(lanes):
        along = np.arange(0, 41, 2.0)[:: 1 if lane % 2 == 0 else -1]
        for one in along:
            lat, lon = 50 + (north_m + 5 * lane) / 111_194, 3 + one / 71_700
            warm = 18 + 0.02 * one + 0.01 * (north_m + 5 * lane)
            rows.append(f"{at},{lat:.7f},{lon:.7f},{warm:.3f}" + "".join(f",{v}" for v in extra))
            at += 2
    path = folder / name
    path.write_text("\n".join([f"time,lat,lon,{header}", *rows]))
    return path


def run(*words):
    return CliRunner().invoke(grebe, [str(word) for word in words])


def test_a_morning_and_an_afternoon_become_one_survey_in_the_order_of_their_times(tmp_path):
    late = outing(tmp_path, "late.csv", FIFTEEN, north_m=30, extra=(7.2,), header="temp (C),pH")
    early = outing(tmp_path, "early.csv", NINE)
    out = tmp_path / "lake.gpkg"
    done = run("import", late, early, "-o", out, "--json")
    assert done.exit_code == 0, done.output
    told = json.loads(done.stdout)
    with SurveyFile.open(out) as file:
        samples, survey, water = file.samples(), file.survey, file.meta()["water"]
    assert told["samples"] == len(samples) == 2 * 6 * 21
    assert (np.diff(samples.times) > 0).all()
    assert np.isnan(samples.values["ph"][: 6 * 21]).all()
    assert (samples.values["ph"][6 * 21 :] == 7.2).all()
    assert water == "measured, late.csv, early.csv"
    assert survey.water.bounds[2] - survey.water.bounds[0] == pytest.approx(55, abs=1)


def test_one_outing_in_two_files_is_the_same_survey_as_in_one(tmp_path):
    whole = outing(tmp_path, "whole.csv", NINE, lanes=12)
    header, *rows = whole.read_text().splitlines()
    parts = [tmp_path / "a.csv", tmp_path / "b.csv"]
    for part, some in zip(parts, (rows[:126], rows[126:]), strict=True):
        part.write_text("\n".join([header, *some]))
    import_track(whole, tmp_path / "whole.gpkg")
    import_track(parts, tmp_path / "parts.gpkg")
    held = []
    for name in ("whole", "parts"):
        with SurveyFile.open(tmp_path / f"{name}.gpkg") as file:
            held.append(file.samples())
    one, two = held
    assert np.array_equal(one.times, two.times)
    assert np.array_equal(one.positions, two.positions)
    assert np.array_equal(one.values["temperature_degc"], two.values["temperature_degc"])
    assert np.array_equal(one.flags["temperature_degc"], two.flags["temperature_degc"])


def test_two_boats_at_once_and_two_lakes_are_no_outings_of_one(tmp_path):
    first = outing(tmp_path, "first.csv", NINE)
    beside = outing(tmp_path, "beside.csv", NINE + 60, north_m=40)
    with pytest.raises(TrackError, match=r"beside\.csv begins before .*first\.csv ends"):
        import_track([first, beside], tmp_path / "o.gpkg")
    away = outing(tmp_path, "away.csv", FIFTEEN, north_m=30_000)
    with pytest.raises(TrackError, match="30 km apart"):
        import_track([first, away], tmp_path / "o.gpkg")
    assert not (tmp_path / "o.gpkg").exists()


def test_each_outing_has_its_sonde_or_one_serves_all(tmp_path):
    boats = [
        outing(tmp_path, "a.csv", NINE, header="battery_v"),
        outing(tmp_path, "b.csv", FIFTEEN, north_m=30, header="battery_v"),
    ]
    times = [*np.arange(NINE, NINE + 260, 2), *np.arange(FIFTEEN, FIFTEEN + 260, 2)]
    sonde = tmp_path / "sonde.csv"
    lines = [f"{t},{15 + 0.001 * i}" for i, t in enumerate(times)]
    sonde.write_text("\n".join(["time,temp (C)", *lines]))
    done = import_track(boats, tmp_path / "o.gpkg", sondes=[sonde])
    assert done.samples == 2 * 126
    assert np.isfinite(done.raw.values["temperature_degc"]).all()
    with pytest.raises(UsageError, match="2 tracks and 3 files of sondes"):
        import_track(boats, tmp_path / "p.gpkg", sondes=[sonde] * 3)


def test_a_survey_file_is_no_table(tmp_path):
    import_track(outing(tmp_path, "a.csv", NINE), tmp_path / "s.gpkg")
    done = run("import", tmp_path / "s.gpkg", "-o", tmp_path / "t.gpkg")
    assert "a survey is mapped as it is" in str(done.exception)
