"""Simulated and measured readings never share a file."""

import json
from datetime import UTC, datetime

import pytest
from click.testing import CliRunner
from conftest import square_survey

from grebe.cli.fleet_run import _water_of
from grebe.cli.main import grebe
from grebe.core.errors import InputError, SurveyFileError
from grebe.core.survey import is_simulated
from grebe.io.store import SurveyFile
from grebe.links.checks import Verdict
from grebe.workflow.differences import sailed as opened
from grebe.workflow.doctor import diagnose
from grebe.workflow.files import write_survey

MINE = '''
from grebe.links.simulated import SimulatedLink
from grebe.simulation.plant import Plant
from grebe.simulation.sonde import UniformSonde


def boat_at(departure):
    """Stands for a real boat."""
    plant = Plant(departure.vessel, departure.state)
    return SimulatedLink(plant, UniformSonde(values={"ph": 7.0}), source="my boat")
'''


def run(*words):
    return CliRunner().invoke(grebe, [str(word) for word in words])


def held(path):
    with SurveyFile.open(path) as file:
        return file.meta()["water"], file.count("samples")


@pytest.fixture
def sailed(tmp_path):
    """A survey that was begun, and the link of a boat that does not simulate."""
    mine = tmp_path / "mine.py"
    mine.write_text(MINE)

    def by(*link):
        path = tmp_path / "s.gpkg"
        write_survey(path, square_survey(60.0, 20.0))
        run("run", path, "--max-minutes", 1, *link)
        assert held(path)[1] > 0
        return path

    return by, f"python:{mine}"


def test_a_real_boat_does_not_go_on_with_a_simulated_mission(sailed):
    by, mine = sailed
    path = by()
    before = held(path)
    for link in (mine, "mavlink:udp:127.0.0.1:1", "nmea:udp:127.0.0.1:1?out=udp:127.0.0.1:2"):
        done = run("run", path, "--resume", "--link", link)
        assert isinstance(done.exception, SurveyFileError), (link, done.output)
        assert "simulated water" in str(done.exception)
        assert held(path) == before


def test_a_simulated_boat_does_not_go_on_with_a_real_mission(sailed):
    by, mine = sailed
    path = by("--link", mine)
    before = held(path)
    for words in (["--resume"], ["--resume", "--preview"]):
        done = run("run", path, *words, "--link", "sim:")
        assert isinstance(done.exception, SurveyFileError), done.output
        assert "real water" in str(done.exception)
        assert held(path) == before


def test_a_mission_goes_on_with_its_boat_if_no_other_is_named(sailed):
    """As when somebody resumes on the second day and forgets the link."""
    by, mine = sailed
    path = by("--link", mine)
    seen = run("run", path, "--resume", "--preview")
    assert f"grebe run {path} --resume --link {mine}" in seen.stdout
    water, before = held(path)
    done = run("run", path, "--resume", "--max-minutes", 30)
    assert done.exit_code == 0, done.output
    assert f"the boat is {mine}, as before" in done.stderr
    assert held(path)[0] == water == "my boat"
    assert held(path)[1] > before


def test_the_doctor_says_that_a_survey_was_rehearsed(sailed):
    by, mine = sailed

    def verdict(path):
        found = {one.what: one.verdict for one in diagnose(None, path, datetime.now(UTC))}
        return found["readings"]

    path = by()
    assert verdict(path) is Verdict.DOUBTFUL
    run("run", path, "--force", "--max-minutes", 1, "--link", mine)
    assert verdict(path) is Verdict.GOOD


def test_starting_again_discards_the_rehearsal(sailed):
    by, mine = sailed
    path = by()
    done = run("run", path, "--force", "--link", mine)
    assert done.exit_code == 0, done.output
    assert held(path)[0] == "my boat"


def test_simulated_and_measured_surveys_are_not_compared(sailed, tmp_path):
    by, mine = sailed
    real = by("--link", mine).rename(tmp_path / "real.gpkg")
    with pytest.raises(InputError, match=r"s\.gpkg are simulated and those of .*real\.gpkg"):
        opened([real, by()])


def test_a_fleet_in_which_one_boat_is_simulated_counts_as_simulated():
    real = ["mavlink:udp:a:1", "mavlink:udp:b:1"]
    assert not is_simulated(_water_of(real))
    assert is_simulated(_water_of(["sim:", real[0]]))
    assert _water_of(["sim:", "sim:"]) == "simulated, 2 boats"


def test_the_command_that_a_preview_prints_is_that_of_the_boat_it_was_asked_about(tmp_path):
    """The mission of another boat had ended before its first reading."""
    path = tmp_path / "s.gpkg"
    write_survey(path, square_survey(60.0, 20.0))
    boat = "mavlink:udp:127.0.0.1:1"
    with SurveyFile.open(path) as file:
        file.set_meta("links", json.dumps([boat]))
    for link in ("sim:", boat):
        done = run("run", path, "--resume", "--preview", "--link", link)
        assert f"--resume --link {link}" in done.output, link
