"""A user's own link, in one file, sails from the command line."""

import json

from click.testing import CliRunner
from conftest import square_survey

from grebe.cli.main import grebe
from grebe.core.errors import LinkError
from grebe.io.store import SurveyFile
from grebe.workflow.files import write_survey

MINE = '''
from grebe.links.simulated import SimulatedLink
from grebe.simulation.plant import Plant
from grebe.simulation.sonde import UniformSonde


class MyBoat(SimulatedLink):
    """Stands for a boat behind a protocol of its own."""


def boat_at(departure):
    plant = Plant(departure.vessel, departure.state)
    return MyBoat(plant, UniformSonde(values={"ph": 7.0}), source="my boat")
'''


def run(*words):
    return CliRunner().invoke(grebe, [str(word) for word in words])


def test_a_link_of_one_s_own_sails_the_survey(tmp_path):
    path, mine = tmp_path / "s.gpkg", tmp_path / "my_boat.py"
    write_survey(path, square_survey())
    mine.write_text(MINE)
    done = run("run", path, "--link", f"python:{mine}", "--json")
    assert done.exit_code == 0, done.output
    assert json.loads(done.stdout)["ended"] == "mission_complete"
    with SurveyFile.open(path) as file:
        assert file.meta()["water"] == "my boat"
        assert set(file.samples().values["ph"]) == {7.0}


def test_a_file_without_the_function_is_named(tmp_path):
    path, mine = tmp_path / "s.gpkg", tmp_path / "empty.py"
    write_survey(path, square_survey())
    mine.write_text("x = 1")
    for url in (f"python:{mine}", "python:none.py", "mavlink:udp:127.0.0.1", "sim:fast", "radio"):
        done = run("run", path, "--link", url)
        assert isinstance(done.exception, LinkError), url
