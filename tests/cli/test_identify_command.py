"""From the manoeuvre to a vessel with which a survey can be planned, as a user types it."""

import json
import tomllib

import pytest
from click.testing import CliRunner
from conftest import square_survey

from grebe.cli.main import grebe
from grebe.core.errors import InputError, UsageError, VesselError
from grebe.core.vessel import PRESETS
from grebe.io.export.vessel import write_vessel
from grebe.io.readers.vessel import read_vessel
from grebe.io.store import SurveyFile
from grebe.workflow.vessels import vessel_of


def run(*words):
    return CliRunner().invoke(grebe, list(map(str, words)), catch_exceptions=False)


@pytest.fixture(scope="module")
def survey(tmp_path_factory):
    path = tmp_path_factory.mktemp("identify") / "s.gpkg"
    SurveyFile.write(path, square_survey(100.0, 20.0), meta={}, force=False)
    return path


@pytest.fixture(scope="module")
def driven(survey):
    log = survey.with_name("drive.csv")
    answer = run(
        "identify",
        survey,
        "--manoeuvre",
        "--mismatch",
        0.3,
        "--noise",
        0.01,
        "--seconds",
        100,
        "-o",
        log,
        "--json",
    )
    return log, json.loads(answer.stdout)


def test_the_manoeuvre_is_driven_and_the_survey_stays_as_it_was(survey, driven):
    log, said = driven
    assert said["complete"]
    assert log.read_text().count("\n") > 2000
    with SurveyFile.open(survey) as file:
        assert file.count("track") == 0


def test_a_log_becomes_a_vessel_with_its_errors_and_a_picture(driven):
    log, _ = driven
    to = log.with_name("boat.toml")
    answer = run("identify", log, "--vessel", "spyboat", "--name", "Nessie", "-o", to, "--json")
    said = json.loads(answer.stdout)
    assert said["hold_out"]["fitted"][0] < 0.5 * said["hold_out"]["preset"][0]
    text = to.read_text()
    boat = read_vessel(to)
    assert boat.name == "Nessie"
    assert "+-" in next(line for line in text.splitlines() if line.startswith("m11_kg"))
    assert boat.m11_kg == pytest.approx(said["parameters"]["m11_kg"]["value"], rel=1e-4)
    assert to.with_suffix(".png").read_bytes().startswith(b"\x89PNG")
    assert vessel_of(str(to)) == boat
    with pytest.raises(InputError, match="exists already"):
        run("identify", log, "-o", to)


def test_what_is_written_must_end_as_it_is(driven):
    with pytest.raises(UsageError, match="toml"):
        run("identify", driven[0], "-o", driven[0].with_name("boat.json"))


def test_a_vessel_reads_back_as_it_was_written(tmp_path):
    path = tmp_path / "otter.toml"
    write_vessel(PRESETS["otter"], path, comments={"m11_kg": "+- 1"}, head=["Of a test."])
    assert read_vessel(path) == PRESETS["otter"]
    assert path.read_text().startswith("# Of a test.\n")


BAD = {
    "mass = 1": "has no 'mass'",
    "m11_kg = 'ten'": "is not a number",
    "name = 3": "is not a text",
    'name = "a"': "needs m11_kg",
}


@pytest.mark.parametrize("text", BAD)
def test_a_vessel_that_is_none_is_refused_in_one_sentence(tmp_path, text):
    path = tmp_path / "boat.toml"
    path.write_text(text)
    with pytest.raises(VesselError, match=BAD[text]) as caught:
        read_vessel(path)
    assert str(path) in str(caught.value)


def test_impossible_numbers_are_refused_with_the_file(tmp_path):
    path = tmp_path / "boat.toml"
    write_vessel(PRESETS["otter"], path)
    path.write_text(path.read_text().replace("m11_kg = 60.5", "m11_kg = -60.5"))
    assert tomllib.loads(path.read_text())["m11_kg"] == -60.5
    with pytest.raises(VesselError, match=r"boat\.toml.*m11_kg is -60\.5"):
        read_vessel(path)
