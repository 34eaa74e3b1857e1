"""Over real sockets: the command line sails the stand-in, and MAVSDK reads it as any autopilot."""

import json
import math
import socket
import subprocess
import sys
import threading
import time
from contextlib import contextmanager

import pytest
from conftest import square_survey
from links.boats import EXACT, standin
from mavsdk import ComponentType, Configuration, Mavsdk
from mavsdk.plugins.telemetry import Telemetry

from grebe.io.store import SurveyFile
from grebe.links.mavlink.rehearsal import serve
from grebe.links.wires import UdpWire
from grebe.simulation.autopilot import Mode
from grebe.workflow.files import write_survey

SURVEY = square_survey()
GREBE = [sys.executable, "-c", "from grebe.cli.main import main; main()"]


def free_port():
    with socket.socket(socket.AF_INET, socket.SOCK_DGRAM) as one:
        one.bind(("127.0.0.1", 0))
        return one.getsockname()[1]


@contextmanager
def autopilot(survey_path, port):
    command = [*GREBE, "autopilot", str(survey_path), "--to", f"127.0.0.1:{port}", "--ready", "0"]
    process = subprocess.Popen(command, stderr=subprocess.PIPE, text=True)
    try:
        yield process
    finally:
        process.terminate()
        process.communicate(timeout=10)


@pytest.fixture
def path(tmp_path):
    path = tmp_path / "s.gpkg"
    write_survey(path, SURVEY)
    return path


@pytest.mark.slow
def test_the_command_line_sails_a_boat_behind_a_socket(path):
    port = free_port()
    url = f"mavlink:udp:127.0.0.1:{port}"
    with autopilot(path, port):
        doctor = subprocess.run(
            [*GREBE, "doctor", url, "--survey", str(path), "--json"],
            capture_output=True, text=True, timeout=60, check=False,
        )  # fmt: skip
        lines = {one["what"]: one for one in json.loads(doctor.stdout)}
        assert lines["estimates"]["verdict"] == "ok", doctor.stderr
        assert lines["place"]["verdict"] == "ok"
        declined = subprocess.run(
            [*GREBE, "run", str(path), "--link", url], input="yes\n",
            capture_output=True, text=True, timeout=60, check=False,
        )  # fmt: skip
        assert declined.returncode == 6
        assert "nobody confirmed the start" in declined.stderr
        done = subprocess.run(
            [*GREBE, "run", str(path), "--link", url, "--json"], input="ARM\n",
            capture_output=True, text=True, timeout=120, check=False,
        )  # fmt: skip
    assert done.returncode == 0, done.stderr
    report = json.loads(done.stdout[done.stdout.index("{") :])
    assert report["reached"] == len(SURVEY.targets)
    with SurveyFile.open(path) as file:
        assert file.meta()["water"].startswith("MAVLink, ArduPilot Rover, system 1, speed")


@contextmanager
def looked_at(boat):
    """The stand-in over UDP in real time, and MAVSDK's telemetry of it."""
    port, stopped = free_port(), threading.Event()
    with Mavsdk(Configuration.create_with_component_type(ComponentType.GROUND_STATION)) as mavsdk:
        mavsdk.add_any_connection(f"udpin://127.0.0.1:{port}")
        wire = UdpWire("127.0.0.1", port, speaks_first=True)
        life = threading.Thread(target=serve, args=(boat, wire, stopped.is_set))
        life.start()
        try:
            yield Telemetry(mavsdk.first_autopilot(10.0))
        finally:
            stopped.set()
            life.join()
            wire.close()


def within(seconds, what):
    """Wait until a condition holds; return whether it does."""
    end = time.monotonic() + seconds
    while time.monotonic() < end:
        if what():
            return True
        time.sleep(0.05)
    return False


def test_mavsdk_reads_the_stand_in_as_an_autopilot():
    boat = standin(SURVEY, ready_s=0.0, **EXACT)
    with looked_at(boat) as telemetry:
        telemetry.set_rate_position_velocity_ned(10.0)
        telemetry.set_rate_attitude_euler(10.0)
        assert boat.autopilot.set_mode(Mode.GUIDED)
        boat.autopilot.arm(arms=True)
        boat.autopilot.follow(1.0, 0.0)
        assert within(3.0, telemetry.armed)
        assert within(3.0, lambda: telemetry.position_velocity_ned().velocity.north_m_s != 0.0)
        assert telemetry.health().is_global_position_ok in (True, False)
        # The boat stops, as it has had no order for three seconds, so both can be read at leisure.
        assert within(8.0, lambda: abs(boat.autopilot.plant.state[3]) < 0.01)
        time.sleep(0.3)
        place = telemetry.position_velocity_ned().position
        north, east, heading, *_ = boat.autopilot.plant.state
        origin = boat._origin
        assert place.north_m == pytest.approx(north - origin[0], abs=0.05)
        assert place.east_m == pytest.approx(east - origin[1], abs=0.05)
        yaw = math.radians(telemetry.attitude_euler().yaw_deg)
        assert math.remainder(yaw - heading, 2 * math.pi) == pytest.approx(0.0, abs=0.01)
        assert telemetry.position().latitude_deg == pytest.approx(
            SURVEY.frame.to_wgs84((north, east))[1], abs=1e-6
        )
