"""The report in French: its reasons, and the numbers on its pictures."""

import csv
import re

import numpy as np
import pytest
import shapely
from click.testing import CliRunner
from conftest import FRAME
from matplotlib.figure import Figure
from matplotlib.text import Text

from grebe.cli.main import grebe
from grebe.core.frames import LocalFrame
from grebe.core.quantities import LIMNOLOGICAL
from grebe.mapping.covariance.drift import linear
from grebe.mapping.grid import make_grid
from grebe.mapping.methods.averaged import Averaged
from grebe.mapping.methods.base import Domain, Readings
from grebe.mapping.methods.choice import COVARIANCE_FITS, ByShore, with_settings
from grebe.mapping.methods.kriging import Kriging
from grebe.mapping.methods.passes import Passes
from grebe.mapping.methods.spde import Spde
from grebe.mapping.proof.method_choice import best_of
from grebe.report import canvas
from grebe.report.reasons import left_out_in, reason_in
from grebe.report.texts import texts_of
from grebe.workflow.tracks import import_track

FRENCH, ENGLISH = texts_of("fr"), texts_of("en")
WATER = shapely.box(0, 0, 100, 100)
BAYS = WATER.difference(shapely.box(48, 10, 52, 100))


def readings(stretch=1.0):
    rng = np.random.default_rng(5)
    at = rng.uniform(2, 98, (120, 2))
    values = np.sin(at[:, 0] / 15) + np.cos(at[:, 1] / (15 * stretch)) + rng.normal(0, 0.05, 120)
    return Readings(positions=at, values=values, times=1e9 + np.arange(120.0))


def said_by_the_library():
    """Reasons as the methods give them, of water with a direction and without, and with land."""
    domain = Domain(WATER, make_grid(WATER, 10.0))
    bays = Domain(BAYS, make_grid(BAYS, 5.0))
    for given in (readings(), readings(12.0)):
        methods = [*(Kriging(fit_covariance=one) for one in COVARIANCE_FITS.values()), Passes()]
        yield from (one.fit(given, domain).model.reason for one in methods)
        yield best_of(methods[:2], given, domain).model.reason
        yield best_of(methods[:3], given, domain).model.reason
        yield Averaged().fit(given, domain).model.reason
        yield Spde().fit(given, bays).model.reason
        yield from (ByShore()(given, where)[1] for where in (domain, bays))
        drifting = with_settings(ByShore().straight, drift=linear)
        yield ByShore(straight=drifting)(given, domain)[1]


def test_every_reason_that_the_library_gives_has_a_french_one():
    said = list(said_by_the_library())
    assert len(set(said)) > 8
    for text in said:
        # In English only the names of covariances differ.
        assert re.sub(r"Matérn (\d)/2", r"matern\g<1>2", reason_in(text, ENGLISH)) == text
        assert all(reason_in(part, FRENCH) for part in text.split("; ")), text
        told = reason_in(text, FRENCH)
        assert not re.search(r"\d\.\d|\b(the|of|by|exponential|spherical)\b", told), told


def test_a_reason_without_a_template_is_not_printed_in_english():
    known = "nothing varies between places"
    assert reason_in(f"{known}; a whim", FRENCH) == "rien ne varie d'un lieu à l'autre"
    assert reason_in("a whim", FRENCH) == ""


def test_why_a_quantity_was_left_out_is_stated_with_its_french_name():
    for text, told in (
        ("Turbidity: not measured", "Turbidité\N{NO-BREAK SPACE}: sans mesure"),
        ("pH: 7 good samples; a map needs 10", "pH\N{NO-BREAK SPACE}: 7 échantillons bons"),
    ):
        assert left_out_in(text, LIMNOLOGICAL, FRENCH).startswith(told)
        assert left_out_in(text, LIMNOLOGICAL, ENGLISH) == text


@pytest.fixture
def survey(tmp_path):
    return imported(tmp_path, FRAME)


def imported(folder, frame):
    given = readings()
    lonlat = frame.to_wgs84(given.positions)
    with (folder / "track.csv").open("w", newline="") as file:
        writer = csv.writer(file)
        writer.writerow(["time", "latitude", "longitude", "temperature_degc", "ph"])
        for k, (lon, lat) in enumerate(lonlat):
            values = 18 + 0.1 * given.values[k], 7.5 + 0.02 * given.values[k]
            writer.writerow([1.6e9 + 60 * k, lat, lon, *values])
    import_track(folder / "track.csv", folder / "lake.gpkg")
    return folder / "lake.gpkg"


@pytest.mark.parametrize(("language", "west"), [("en", r"\.\d+° W"), ("fr", r",\d+° O")])
def test_a_lake_south_and_west_is_told_by_letters_and_not_by_signs(tmp_path, language, west):
    lake = imported(tmp_path, LocalFrame(origin_lon_deg=-72.0, origin_lat_deg=-43.0))
    page = tmp_path / "page.html"
    words = ["-o", str(page), "--resolution", "10", "--language", language]
    assert CliRunner().invoke(grebe, ["report", str(lake), *words]).exit_code == 0
    placed = rf"\b4[23][.,]\d+° S, 7[12]{west}"
    assert len(re.findall(placed, page.read_text())) == 2


def test_no_picture_of_a_french_report_has_a_decimal_point(survey, tmp_path, monkeypatch):
    drawn: list[Figure] = []
    render = canvas.png_bytes

    def kept(figure):
        drawn.append(figure)
        return render(figure)

    monkeypatch.setattr(canvas, "png_bytes", kept)
    page, words = tmp_path / "page.html", ["--resolution", "10", "--force", "--language"]
    texts: dict[str, list[str]] = {}
    for language in ("en", "fr"):
        drawn.clear()
        found = CliRunner().invoke(
            grebe, ["report", str(survey), "-o", str(page), *words, language]
        )
        assert found.exit_code == 0, found.output
        seen = [one.get_text() for figure in drawn for one in figure.findobj(Text)]
        texts[language] = [one for one in seen if re.search(r"\d[.,]\d", one)]
    assert len(texts["en"]) == len(texts["fr"]) > 10
    assert all(re.search(r"\d\.\d", one) for one in texts["en"])
    assert not [one for one in texts["fr"] if re.search(r"\d\.\d", one)]
    assert "aucune terre ne se trouve entre" in page.read_text()
