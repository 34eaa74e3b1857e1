"""One drive in every log format: each is read as the same drive."""

import io
import math
import shutil
import struct
from datetime import timedelta
from pathlib import Path

import numpy as np
import pytest
from conftest import NOON
from identification.dataflash import DataflashWriter

from grebe.core.errors import InputError
from grebe.core.events import Step
from grebe.core.vessel import PRESETS
from grebe.io.export.drive_csv import DriveCsv
from grebe.io.readers.drive import read_drive
from grebe.io.store import SurveyFile
from grebe.simulation.plant import Plant

BOAT = PRESETS["blueboat"]
# Outputs of an unusual boat: the left thruster is on the third output, and reversed.
PARAMETERS = {
    "SERVO1_FUNCTION": 74, "SERVO1_MIN": 1000, "SERVO1_TRIM": 1500, "SERVO1_MAX": 2000,
    "SERVO3_FUNCTION": 73, "SERVO3_MIN": 1100, "SERVO3_TRIM": 1480, "SERVO3_MAX": 1900,
    "SERVO3_REVERSED": 1, "WP_SPEED": 2.0,
}  # fmt: skip


def sailed(seconds=40.0):
    """Return times (n,), states (n, 6) and throttles (n, 2) of a short drive, ten rows a second."""
    plant = Plant(BOAT, (5.0, -3.0, 3.0, 0.0, 0.0, 0.0))
    times, states, throttles = [], [], []
    for k in range(int(10 * seconds)):
        now = k / 10
        pair = (0.8, 0.2) if int(now / 5) % 2 else (-0.3, 0.6)
        plant.command((BOAT.thrust_of(pair[0]), BOAT.thrust_of(pair[1])))
        times.append(now)
        states.append(list(plant.state))
        throttles.append(pair)
        plant.advance(0.1)
    return np.array(times), np.array(states), np.array(throttles)


def pulses(pair):
    """Return what the autopilot sends to outputs 1 and 3 [us], by its parameters."""
    right = 1500 + 500 * pair[1]
    port = -pair[0]
    left = 1480 + (420 if port >= 0 else 380) * port
    return round(right), round(left)


def over_ground(state):
    cos, sin = math.cos(state[2]), math.sin(state[2])
    return cos * state[3] - sin * state[4], sin * state[3] + cos * state[4]


def assert_same(log, tolerance=0.02):
    times, states, throttles = sailed()
    for channel in range(6):
        known = np.isfinite(log.states[:, channel])
        assert known.sum() > 300, channel
        at = log.times[known]
        truth = np.interp(at, times, states[:, channel])
        shown = log.states[known, channel]
        offset = shown[0] - truth[0] if channel < 2 else 0.0
        if channel == 2:
            apart = np.remainder(shown - truth + np.pi, 2 * np.pi) - np.pi
            assert np.abs(apart).max() < tolerance
            assert np.abs(np.diff(shown)).max() < 1.0, "unwrapped"
        else:
            assert shown - offset == pytest.approx(truth, abs=tolerance), channel
    assert log.unit == "throttle"
    found = log.commands[np.searchsorted(log.command_times, times[1:-1] + 0.01) - 1]
    assert found == pytest.approx(throttles[1:-1], abs=0.003)


def test_a_log_of_our_own_reads_back(tmp_path):
    path = tmp_path / "drive.csv"
    with DriveCsv(path) as log:
        for time, state, pair in zip(*sailed(), strict=True):
            log.state(float(time), tuple(state.tolist()))
            log.command(float(time), pair)
    assert_same(read_drive(path), 1e-3)
    with pytest.raises(InputError, match="exists already"):
        DriveCsv(path)


def test_a_table_of_somebody_else_is_understood(tmp_path):
    """It has semicolons, degrees, velocities north and east, milliseconds since 1970, pulses."""
    path = tmp_path / "other.csv"
    rows = ["timestamp;Latitude;Longitude;Yaw (deg);VN;VE;yaw_rate_degps;pwm_left;pwm_right"]
    for time, state, pair in zip(*sailed(), strict=True):
        lat, lon = 50.0 + state[0] / 111_229.0, 3.0 + state[1] / 71_695.8
        north, east = over_ground(state)
        wrapped = math.degrees(math.remainder(state[2], 2 * math.pi)) % 360
        left, right = 1500 + 400 * pair[0], 1500 + 400 * pair[1]
        rows.append(
            f"{1.7e12 + 1000 * time:.0f};{lat:.9f};{lon:.9f};{wrapped:.4f};{north:.4f};{east:.4f};"
            f"{math.degrees(state[5]):.4f};{left:.0f};{right:.0f}"
        )
    path.write_text("\n".join(rows))
    assert_same(read_drive(path))


def test_telemetry_reads_back(tmp_path):
    mavlink = pytest.importorskip("pymavlink.dialects.v20.ardupilotmega")
    path = tmp_path / "boat.tlog"
    voice = mavlink.MAVLink(io.BytesIO(), srcSystem=7, srcComponent=1)
    station = mavlink.MAVLink(io.BytesIO(), srcSystem=255, srcComponent=1)
    data = bytearray()

    def say(message, seconds, who=voice):
        stamp = int((1.7e9 + seconds) * 1e6)
        data.extend(struct.pack(">Q", stamp) + message.pack(who))

    say(voice.heartbeat_encode(10, 3, 0, 15, 4), 0.0)
    for name, value in PARAMETERS.items():
        say(voice.param_value_encode(name.encode(), value, 9, len(PARAMETERS), 0), 0.0)
    for time, state, pair in zip(*sailed(), strict=True):
        # The autopilot has been up for so long that its clock of microseconds starts again.
        boot = 4280.0 + float(time)
        right, left = pulses(pair)
        yaw = math.remainder(state[2], 2 * math.pi)
        north, east = over_ground(state)
        ms = round(1000 * boot)
        say(
            voice.servo_output_raw_encode(round(1e6 * boot) % 2**32, 0, right, 0, left, *[0] * 5),
            time,
        )
        say(voice.attitude_encode(ms, 0, 0, yaw, 0, 0, state[5]), time)
        say(voice.local_position_ned_encode(ms, state[0], state[1], 0, north, east, 0), time)
        say(station.heartbeat_encode(6, 8, 0, 0, 4), time, station)
    path.write_bytes(data)
    assert_same(read_drive(path))


@pytest.mark.parametrize("source", ["XKF1", "POS"])
def test_dataflash_reads_back(tmp_path, source):
    pytest.importorskip("pymavlink.DFReader")
    log = DataflashWriter()
    log.define("PARM", "QNff", "TimeUS,Name,Value,Default")
    log.define("XKF1", "QBccCfffffff", "TimeUS,C,Roll,Pitch,Yaw,VN,VE,VD,dPD,PN,PE,PD")
    log.define("POS", "QLLff", "TimeUS,Lat,Lng,Alt,RelHomeAlt")
    log.define("ATT", "QccC", "TimeUS,Roll,Pitch,Yaw")
    log.define("IMU", "QBfff", "TimeUS,I,GyrX,GyrY,GyrZ")
    log.define("RCOU", "QHHHH", "TimeUS,C1,C2,C3,C4")
    for name, value in PARAMETERS.items():
        log.row("PARM", 0, name, value, 0.0)
    for time, state, pair in zip(*sailed(), strict=True):
        us = round(1e6 * (12.0 + time))
        right, left = pulses(pair)
        yaw = math.degrees(state[2]) % 360
        north, east = over_ground(state)
        log.row("RCOU", us, right, 0, left, 0)
        log.row("IMU", us, 0, 0.0, 0.0, state[5])
        log.row("IMU", us, 1, 0.0, 0.0, 9.0)
        if source == "XKF1":
            for core, off in ((0, 0.0), (1, 50.0)):
                log.row("XKF1", us, core, 0, 0, yaw, north, east, 0, 0, state[0] + off, state[1], 0)
        else:
            log.row("ATT", us, 0, 0, yaw)
            log.row("POS", us, 50.0 + state[0] / 111_229.0, 3.0 + state[1] / 71_695.8, 0.0, 0.0)
    path = tmp_path / "boat.bin"
    path.write_bytes(log.data)
    found = read_drive(path)
    if source == "POS":
        assert np.isnan(found.states[:, 3:5]).all(), "positions alone tell no velocities"
        times, states, _ = sailed()
        known = np.isfinite(found.states[:, 0])
        north = np.interp(found.times[known], times, states[:, 0])
        shown = found.states[known, 0]
        assert shown - shown[0] == pytest.approx(north - north[0], abs=0.03)
        return
    # The gyroscope's mean over a step slightly lags or leads a jump of the yaw acceleration.
    assert_same(found, 0.03)


def test_the_track_of_a_survey_is_a_drive(tmp_path):
    path = tmp_path / "s.gpkg"
    shutil.copy(Path(__file__).parents[1] / "data" / "mission_0_1_0.gpkg", path)
    with SurveyFile.open(path) as file:
        file.clear_mission()
    with pytest.raises(InputError, match="no track"):
        read_drive(path)
    with SurveyFile.open(path) as file:
        for k, (time, state, pair) in enumerate(zip(*sailed(), strict=True)):
            moment = NOON + timedelta(seconds=float(time))
            step = Step(time=moment, elapsed_s=k, state=tuple(state.tolist()), thrusts=pair)
            file.append_track(step)
    log = read_drive(path)
    assert log.unit == "newton"
    assert log.commands == pytest.approx(sailed()[2])
    assert log.states == pytest.approx(sailed()[1])


BAD = {
    "a.csv": ("time_s,heading_deg,surge_mps\n0,1,1\n1,1,1\n", "commands of both thrusters"),
    "b.csv": ("heading_deg,throttle_port,throttle_starboard\n0,1,1\n", "looks like a time"),
    "c.csv": ("time_s,surge,throttle_port,throttle_starboard\n0,1,1,1\n", "looks like a heading"),
    "d.csv": ("time_s,heading,throttle_port,throttle_starboard\nnoon,1,1,1\n", "the time 'noon'"),
    "e.csv": ("", "empty"),
    "f.txt": ("x", "read from .csv, .tlog, .bin"),
    "g.bin": ("not a log", "g.bin"),
    "h.tlog": ("not a log either", "h.tlog"),
}


@pytest.mark.parametrize("name", BAD)
def test_what_is_no_drive_is_refused_in_one_sentence(tmp_path, name):
    text, words = BAD[name]
    path = tmp_path / name
    path.write_text(text)
    with pytest.raises(InputError, match=words) as caught:
        read_drive(path)
    assert name in str(caught.value)


def test_a_file_that_is_not_there_is_named(tmp_path):
    with pytest.raises(InputError, match="no such"):
        read_drive(tmp_path / "none.csv")
