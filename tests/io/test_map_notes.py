"""What `grebe map` and the report say about the readings before anyone uses the maps."""

import numpy as np
import pytest
import xarray as xr
from click.testing import CliRunner

from grebe.cli.main import grebe
from grebe.io.store import SurveyFile

DAY = 86_400.0


def lanes(begins, lanes, chlorophyll):
    """Rows of lanes 5 m apart; `chlorophyll` (n,) in µg/L."""
    rows, at, k = [], begins, 0
    for lane in range(lanes):
        for one in np.arange(0, 41, 2.0)[:: 1 if lane % 2 == 0 else -1]:
            warm = 18 + 0.01 * one + 0.02 * lane + 0.01 * np.sin(k)
            lat, lon = 50 + 5 * lane / 111_194, 3 + one / 71_700
            rows.append(f"{at:.0f},{lat:.7f},{lon:.7f},{warm:.3f},{chlorophyll[k]:.3f}")
            at, k = at + 2, k + 1
    return rows


@pytest.fixture(scope="module")
def survey(tmp_path_factory):
    """Two days; clear water in which the fluorometer reads just below zero now and then; and ten
    rows that a logger wrote twice.
    """
    folder = tmp_path_factory.mktemp("notes")
    one_day, other_day = np.random.default_rng(2).normal(0.02, 0.1, (2, 126)).round(3)
    first = lanes(1.6e9, 6, one_day)
    second = lanes(1.6e9 + 2 * DAY, 6, other_day)
    rows = [*first, *second, *(row.replace(",", ".5,", 1) for row in second[50:60])]
    path = folder / "track.csv"
    path.write_text("\n".join(["time,lat,lon,temp (C),chl (ug/L)", *rows]))
    done = CliRunner().invoke(grebe, ["import", str(path), "-o", str(folder / "s.gpkg")])
    assert done.exit_code == 0, done.output
    with SurveyFile.open(folder / "s.gpkg") as file:
        samples = file.samples()
    good = samples.usable("chlorophyll_ugl")
    return folder / "s.gpkg", int((samples.values["chlorophyll_ugl"][good] < 0).sum())


def test_a_map_s_notes_name_outings_readings_below_zero_and_repeats(survey, tmp_path):
    path, below = survey
    words = ["map", str(path), "--out", str(tmp_path / "maps"), "--resolution", "4"]
    done = CliRunner().invoke(grebe, words)
    assert done.exit_code == 0, done.output
    assert "the readings are of 2 outings, with a pause of up to 2.0 days" in done.stderr
    assert below > 20
    assert f"Chlorophyll: {below} of " in done.stderr
    with xr.open_dataset(tmp_path / "maps" / "map.nc") as maps:
        mapped = maps["chlorophyll_ugl"].values
    share = (mapped[np.isfinite(mapped)] < 0).mean()
    assert share > 0.01
    assert f"Chlorophyll: the map is below 0 on {share:.1%} of its area" in done.stderr
    assert "Chlorophyll: 10 samples repeat the place and the reading of another" in done.stderr
    assert "Temperature: 0 of" not in done.stderr


def test_the_report_says_so_too_in_its_language(survey, tmp_path):
    path, _ = survey
    for language, said in (("en", "the sensor's zero may be off"), ("fr", "le zéro du capteur")):
        page = tmp_path / f"{language}.html"
        words = ["report", str(path), "-o", str(page), "--resolution", "4", "--language", language]
        done = CliRunner().invoke(grebe, words)
        assert done.exit_code == 0, done.output
        assert said in page.read_text().replace("&#39;", "'")
