"""grebe physics as a user types it: it serves until Ctrl-C and prints the outcome."""

import json
import os
import re
import signal
import socket
import struct
import subprocess
import sys

from click.testing import CliRunner
from conftest import square_survey

from grebe.cli.main import grebe
from grebe.core.errors import GrebeError
from grebe.workflow.files import write_survey
from grebe.workflow.physics import Rehearsal, boat_of


def test_it_serves_until_it_is_interrupted(tmp_path):
    path = tmp_path / "s.gpkg"
    write_survey(path, square_survey())
    words = ["physics", "--survey", path, "--current", "0.5,0", "--port", "0", "--json"]
    with subprocess.Popen(
        [sys.executable, "-c", "from grebe.cli.main import main; main()", *map(str, words)],
        stdout=subprocess.PIPE,
        stderr=subprocess.PIPE,
        text=True,
        env=os.environ | {"PYTHONPATH": os.pathsep.join(sys.path)},
    ) as process:
        first = process.stderr.readline()
        assert re.search(r"ardurover --model JSON:127.0.0.1 --home 50\.\d+,3\.\d+,0,\d+", first)
        port = int(process.stderr.readline().rpartition(":")[2])
        with socket.socket(socket.AF_INET, socket.SOCK_DGRAM) as firmware:
            firmware.settimeout(10.0)
            for frame in range(100):
                packet = struct.pack("<HHI16H", 18458, 20, frame, *[1500] * 16)
                firmware.sendto(packet, ("127.0.0.1", port))
                answer = json.loads(firmware.recv(2048))
        process.send_signal(signal.SIGINT)
        out, _ = process.communicate(timeout=10)
    assert answer["velocity"][0] > 0.3
    assert process.returncode == 0
    assert json.loads(out)["boat_time_s"] == 5.0


def test_what_cannot_be_is_one_sentence():
    for words in (
        [],
        ["--vessel", "raft"],
        ["--vessel", "blueboat", "--servos", "1,1"],
        ["--vessel", "blueboat", "--rate", "1"],
        ["--vessel", "blueboat", "--origin", "200,0"],
    ):
        done = CliRunner().invoke(grebe, ["physics", *words])
        assert isinstance(done.exception, GrebeError), words
    assert CliRunner().invoke(grebe, ["physics", "--servos", "1.5,2"]).exit_code == 2


def test_home_is_the_survey_s_start():
    survey = square_survey()
    vessel, origin, heading_deg = boat_of(survey, "s.gpkg")
    lat, lon, height, _ = map(
        float, Rehearsal(vessel=vessel, origin=origin, heading_deg=heading_deg).home.split(",")
    )
    north, east = survey.frame.to_local((lon, lat))
    assert abs(north - survey.start.north_m) < 0.05
    assert abs(east - survey.start.east_m) < 0.05
    assert height == 0
