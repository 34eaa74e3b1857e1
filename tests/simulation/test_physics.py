"""Packets and answers of ArduPilot's JSON interface, as documented by ArduPilot."""

import json
import math
import struct

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from grebe.core.dynamics import Weather
from grebe.core.errors import UsageError
from grebe.core.vessel import PRESETS
from grebe.simulation.physics import (
    GRAVITY_MPS2,
    Physics,
    PhysicsSettings,
    ServoPacket,
    read_packet,
    throttle_of_pulse,
)
from grebe.simulation.plant import Plant

BOAT = PRESETS["blueboat"]


def packet(frame, port=1500, starboard=1500, rate=200):
    return ServoPacket(
        frame_rate_hz=rate, frame=frame, pulses_us=(port, 1500, starboard, *[0] * 13)
    )


def answered(physics, *what, **more):
    return json.loads(physics.answer(packet(*what, **more)))


def test_a_packet_is_read_as_the_documentation_writes_it():
    pulses = tuple(range(1000, 1016))
    data = struct.pack("<HHI16H", 18458, 400, 70_000, *pulses)
    assert read_packet(data) == ServoPacket(frame_rate_hz=400, frame=70_000, pulses_us=pulses)
    more = tuple(range(1000, 1032))
    data = struct.pack("<HHI32H", 29569, 400, 7, *more)
    assert read_packet(data).pulses_us == more


@given(st.binary(max_size=90))
def test_foreign_bytes_are_no_packet(data):
    assert read_packet(data) is None or data[:2] in (b"\x1a\x48", b"\x81\x73")


def test_a_packet_that_is_cut_off_or_longer_is_none():
    data = struct.pack("<HHI16H", 18458, 400, 1, *[1500] * 16)
    for size in range(len(data)):
        assert read_packet(data[:size]) is None
    assert read_packet(data + b"\0") is None


def test_pulses_become_throttles():
    cases = {1100: -1.0, 1300: -0.5, 1500: 0.0, 1700: 0.5, 1900: 1.0, 2000: 1.0, 1000: -1.0}
    assert {pulse: throttle_of_pulse(pulse) for pulse in cases} == cases
    assert [throttle_of_pulse(off) for off in (0, 65_535)] == [0.0, 0.0]


def test_a_boat_at_rest_feels_its_weight_alone_and_the_line_is_compact():
    line = Physics(BOAT).answer(packet(0))
    assert line.startswith(b"\n")
    assert line.endswith(b"\n")
    assert line.count(b"\n") == 2
    assert b" " not in line
    assert json.loads(line) == {
        "timestamp": 0.005,
        "imu": {"gyro": [0, 0, 0], "accel_body": [0, 0, -GRAVITY_MPS2]},
        "position": [0, 0, 0],
        "attitude": [0, 0, 0],
        "velocity": [0, 0, 0],
    }


def test_time_passes_by_one_frame_for_each_packet_and_the_motion_is_the_plant_s():
    weather = Weather(current_north_mps=0.3, wind_force_east_n=4.0)
    physics, plant = Physics(BOAT, weather), Plant(BOAT, (0.0,) * 6, weather)
    plant.command((BOAT.thrust_of(0.75), BOAT.thrust_of(-0.25)))
    for frame in range(400):
        answer = answered(physics, frame, 1800, 1400)
        plant.advance(0.005)
    assert answer["timestamp"] == pytest.approx(2.0)
    assert [*answer["position"][:2], answer["imu"]["gyro"][2]] == [*plant.state[:2], plant.state[5]]


def test_accelerations_sum_up_to_the_velocity_and_velocities_to_the_place():
    physics = Physics(BOAT, Weather(current_east_mps=0.4), heading_rad=1.0)
    pulses = np.random.default_rng(1).integers(1100, 1900, (1000, 2))
    velocity, place = np.zeros(3), np.zeros(3)
    for frame, (port, starboard) in enumerate(pulses.tolist()):
        answer = answered(physics, frame, port, starboard)
        yaw = answer["attitude"][2]
        turn = np.array(
            [[math.cos(yaw), -math.sin(yaw), 0], [math.sin(yaw), math.cos(yaw), 0], [0, 0, 1]]
        )
        felt = turn @ answer["imu"]["accel_body"] + (0, 0, GRAVITY_MPS2)
        place += 0.005 * (velocity + 0.0025 * felt)
        velocity += 0.005 * felt
        assert velocity == pytest.approx(answer["velocity"], abs=1e-9)
    assert place == pytest.approx(answer["position"], abs=1e-3)


def test_gyroscope_and_heading_agree():
    physics, turned = Physics(BOAT), 0.0
    for frame in range(4000):
        answer = answered(physics, frame, 1900, 1100)
        turned += 0.005 * answer["imu"]["gyro"][2]
        assert abs(answer["attitude"][2]) <= math.pi
    assert turned > 2 * math.pi
    assert math.remainder(turned - answer["attitude"][2], 2 * math.pi) == pytest.approx(0, abs=0.01)


def test_a_frame_that_comes_twice_is_answered_alike_and_nothing_moves():
    physics = Physics(BOAT)
    physics.answer(packet(0))
    first = physics.answer(packet(1, 1900, 1900))
    assert physics.answer(packet(1, 1100, 1100)) == first
    assert physics.frames == 2


def test_a_late_copy_of_an_older_frame_gets_no_answer():
    physics = Physics(BOAT)
    for frame in range(50):
        physics.answer(packet(frame, 1900, 1900))
    place = list(physics.plant.state)
    assert physics.answer(packet(40, 1900, 1900)) is None
    assert physics.plant.state == place


@pytest.mark.parametrize(("last", "then"), [(5, 0), (5000, 3)])
def test_restarted_frames_put_the_boat_back(last, then):
    physics = Physics(BOAT, heading_rad=0.5)
    for frame in (0, *range(last - 3, last + 1)):
        physics.answer(packet(frame, 1900, 1900))
    answer = answered(physics, then)
    assert answer["timestamp"] == 0.005
    assert answer["position"] == [0, 0, 0]
    assert answer["attitude"][2] == 0.5
    assert physics.starts == 2


def test_physics_that_begins_later_than_the_firmware_takes_its_frame_as_the_first():
    physics = Physics(BOAT)
    assert answered(physics, 12_345)["timestamp"] == 0.005
    assert (physics.starts, physics.lost) == (1, 0)
    answered(physics, 12_350)
    assert physics.lost == 4


def test_the_rate_can_be_ours_and_no_step_is_longer_than_the_plant_s():
    assert answered(Physics(BOAT, settings=PhysicsSettings(rate_hz=100)), 0)["timestamp"] == 0.01
    assert answered(Physics(BOAT), 0, rate=1)["timestamp"] == 0.05
    assert answered(Physics(BOAT), 0, rate=0)["timestamp"] == 0.05


def test_the_thrusters_may_be_at_other_outputs():
    physics = Physics(BOAT, settings=PhysicsSettings(servos=(3, 1)))
    assert answered(physics, 0, 1100, 1900)["imu"]["gyro"][2] > 0
    beyond = Physics(BOAT, settings=PhysicsSettings(servos=(1, 20)))
    assert answered(beyond, 0, 1500, 1900)["velocity"] == [0, 0, 0]


@pytest.mark.parametrize(
    "wrong", [{"servos": (1, 1)}, {"servos": (0, 3)}, {"servos": (1, 33)}, {"rate_hz": 5.0}]
)
def test_settings_that_cannot_be_are_refused(wrong):
    with pytest.raises(UsageError):
        PhysicsSettings(**wrong)
