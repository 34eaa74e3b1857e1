"""What a report must say about a hull, a simulation, a corrected lag, and a map of one moment."""

from __future__ import annotations

from pathlib import Path

import netCDF4
import pytest
from click.testing import CliRunner
from conftest import CHINA, needs_tracks, square_survey

from grebe.cli.main import grebe
from grebe.core.errors import IncompleteError
from grebe.io.store import SurveyFile
from grebe.report.texts import texts_of
from grebe.workflow.files import write_survey


def run(*words: object) -> str:
    """Return what a command prints; it must succeed."""
    done = CliRunner().invoke(grebe, [str(one) for one in words], catch_exceptions=False)
    assert done.exit_code == 0, done.output
    return done.stdout


@pytest.fixture(scope="module")
def china(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """Import a real track, with its oxygen delayed by 18 s."""
    file = tmp_path_factory.mktemp("china") / "china.gpkg"
    run("import", CHINA, "-o", file)
    run("check", file, "--lag", "dissolved_oxygen_mgl=18")
    return file


@needs_tracks
def test_a_report_says_of_a_track_what_it_is_of(china: Path, tmp_path: Path) -> None:
    page = tmp_path / "page.html"
    run("report", china, "-o", page, "--resolution", "8", "--moment", "middle")
    text = page.read_text()
    assert "ha within the convex hull of the track from 2,655 samples" in text
    assert "The sensor&#39;s delay of 18 s and its time constant of 0 s were made up for" in text
    assert text.count("The map is of 2020-09-15 16:36 UTC") == 8
    # No change was found in three quantities, so nothing is removed from them.
    assert text.count("The map is of 2020-09-15 16:36 UTC, corrected for this.") == 5
    assert "by quantity, " in text
    run("report", china, "-o", page, "--resolution", "8", "--language", "fr", "--force")
    text = page.read_text()
    assert "4,15 ha à l&#39;intérieur de l&#39;enveloppe convexe du trajet" in text
    for english in ("the mean of", "practical range", "passes that", "(kriging)"):
        assert english not in text


def imported(folder: Path, pause_s: int = 0, across: float = 0.0) -> Path:
    """A survey of temperature in ten rows, with a pause in the middle, and a slope across them."""
    rows = [
        f"{1_600_000_000 + pause_s * (k // 100) + k},{44.4 + 1e-5 * (k % 20):.5f},"
        f"{-69.6 + 1e-5 * (k // 20):.5f},{20 + 0.01 * (k % 20) + across * (k // 20):.3f}"
        for k in range(200)
    ]
    track, file = folder / "track.csv", folder / "track.gpkg"
    track.write_text("\n".join(["time,latitude,longitude,Temp (C)", *rows]))
    run("import", track, "-o", file)
    return file


def test_one_quantity_is_reported_in_the_singular(tmp_path: Path) -> None:
    file, page = imported(tmp_path), tmp_path / "one.html"
    run("report", file, "-o", page, "--resolution", "4")
    assert "One quantity of the surface water was mapped over" in page.read_text()
    run("report", file, "-o", page, "--resolution", "4", "--language", "fr", "--force")
    assert "Un paramètre de l&#39;eau de surface a été cartographié" in page.read_text()


def test_readings_of_two_days_are_said_to_be_of_two(tmp_path: Path) -> None:
    file, page = imported(tmp_path, pause_s=200_000, across=0.003), tmp_path / "two.html"
    run("report", file, "-o", page, "--resolution", "4")
    assert "are of 2 outings, with a pause of up to 2.3 days" in page.read_text()
    run("report", file, "-o", page, "--resolution", "4", "--language", "fr", "--force")
    assert "viennent de 2 sorties, séparées de 2,3 jours" in page.read_text()


@needs_tracks
def test_no_shore_is_known_of_a_track(china: Path, tmp_path: Path) -> None:
    words = ["map", str(china), "--out", str(tmp_path / "m"), "--shore-depth-sd", "0.5"]
    done = CliRunner().invoke(grebe, words)
    assert "the hull of its track and not a shore" in str(done.exception)


def test_simulated_data_are_reported_as_simulated(
    simulated_survey: tuple[Path, object], tmp_path: Path
) -> None:
    file, page = simulated_survey[0], tmp_path / "page.html"
    run("map", file, "--out", tmp_path / "m", "--resolution", "4")
    with netCDF4.Dataset(tmp_path / "m" / "map.nc") as maps:
        assert maps.title.startswith("Simulated water of")
        assert "a simulated boat" in maps.summary
    run("report", file, "-o", page, "--resolution", "4")
    text = page.read_text()
    # At the top, before any number, and in the paragraph for a paper.
    assert text.count("This survey was simulated: nothing was measured.") == 2
    assert text.index("This survey was simulated") < text.index("were mapped over")
    assert "The survey is not complete" not in text


def test_a_survey_that_was_broken_off_is_said_to_be_incomplete(tmp_path: Path) -> None:
    file, page = tmp_path / "s.gpkg", tmp_path / "page.html"
    write_survey(file, square_survey(100.0, 25.0))
    words = ["run", str(file), "--max-minutes", "2"]
    assert isinstance(CliRunner().invoke(grebe, words).exception, IncompleteError)
    with SurveyFile.open(file) as half:
        reached = half.progress().reached
    assert 0 < reached < 16
    run("report", file, "-o", page, "--resolution", "4")
    assert f"The survey is not complete: {reached} of 16 target sets" in page.read_text()
    run("report", file, "-o", page, "--resolution", "4", "--language", "fr", "--force")
    assert f"La campagne n&#39;est pas complète : {reached} des 16" in page.read_text()


@pytest.mark.parametrize(
    ("text", "french"),
    [("2,655", "2\N{NARROW NO-BREAK SPACE}655"), ("4.15 ha", "4,15 ha"), ("0.1.0", "0,1,0")],
)
def test_numbers_are_written_as_the_language_has_them(text: str, french: str) -> None:
    assert texts_of("fr").number(text) == french
    assert texts_of("en").number(text) == text
    assert texts_of("fr").share(0.125, 1) == "12,5\N{NO-BREAK SPACE}%"
