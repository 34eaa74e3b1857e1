"""The physics for ArduPilot's real firmware: its JSON interface, without a socket.

The firmware (with model `JSON:HOST`) sends its servo outputs as one binary packet and waits. The
answer is the boat's motion as one line of JSON, and only then comes the next packet. So both run in
lock-step, at the speed that the firmware requests. Packet and answer are those of ArduPilot's
`libraries/SITL/examples/JSON/readme.md`. The frame is north, east, down, and the boat floats level:
no roll, pitch or heave.
"""

from __future__ import annotations

import json
import math
import struct
from collections.abc import Sequence
from dataclasses import dataclass

from grebe.core.dynamics import CALM, Weather
from grebe.core.errors import UsageError
from grebe.core.events import State
from grebe.core.vessel import Vessel
from grebe.simulation.plant import PLANT_STEP_S, Plant

# Number of channels in a packet, by its magic number.
CHANNELS = {18458: 16, 29569: 32}
HEADER = struct.Struct("<HHI")
GRAVITY_MPS2 = 9.80665
# The neutral pulse of an actuator, and the distance of full command from it [us].
TRIM_US, SPAN_US = 1500, 400
# Range of valid pulses [us]; an output that is off sends 0.
PULSES_US = (800, 2200)
# A frame older than the last by fewer than this is a late copy; an older one is a restart.
LATE_FRAMES = 100


@dataclass(frozen=True, kw_only=True)
class ServoPacket:
    """A packet from the firmware.

    The rate of its frames [Hz], the number of this one, and the pulses of 16 or 32 outputs [us].
    """

    frame_rate_hz: int
    frame: int
    pulses_us: tuple[int, ...]


def read_packet(data: bytes) -> ServoPacket | None:
    """Return the packet in some bytes; None if they are foreign or incomplete."""
    if len(data) < HEADER.size:
        return None
    magic, rate, frame = HEADER.unpack_from(data)
    count = CHANNELS.get(magic)
    if count is None or len(data) != HEADER.size + 2 * count:
        return None
    pulses = struct.unpack_from(f"<{count}H", data, HEADER.size)
    return ServoPacket(frame_rate_hz=rate, frame=frame, pulses_us=pulses)


def throttle_of_pulse(pulse_us: int) -> float:
    """Return the command of an actuator, -1 to 1, for a servo pulse [us]; 0 for an invalid one."""
    if not PULSES_US[0] <= pulse_us <= PULSES_US[1]:
        return 0.0
    return min(max((pulse_us - TRIM_US) / SPAN_US, -1.0), 1.0)


@dataclass(frozen=True, kw_only=True)
class PhysicsSettings:
    """Settings of the physics.

    `servos`: the outputs, counted from 1, of the port and the starboard thruster (functions 73
    and 74, throttle left and right). `rate_hz`: steps a second; None for the rate that the firmware
    requests (its SIM_RATE_HZ). Raises `UsageError` for an invalid setting.
    """

    servos: tuple[int, int] = (1, 3)
    rate_hz: float | None = None

    def __post_init__(self) -> None:
        most = max(CHANNELS.values())
        if len(set(self.servos)) != 2 or not all(1 <= servo <= most for servo in self.servos):
            raise UsageError(
                f"The thrusters' servos {self.servos} must be two outputs from 1 to {most}.",
                settings=("servos",),
            )
        lowest = 1 / PLANT_STEP_S
        if self.rate_hz is not None and not lowest <= self.rate_hz <= 10_000:
            raise UsageError(
                f"A physics rate of {self.rate_hz:g} Hz is not between {lowest:g} and 10000 Hz; "
                "the firmware's own loop needs at least its own rate, 50 Hz for a boat.",
                settings=("rate_hz",),
            )


class Physics:
    """One boat under one firmware; `answer` takes its packets in order.

    Positions are metres from the boat's start, which is the firmware's home. A repeated packet gets
    the same answer, and nothing moves. If frames count from the beginning again, the firmware has
    restarted, and so does the boat.
    """

    def __init__(
        self,
        vessel: Vessel,
        weather: Weather = CALM,
        settings: PhysicsSettings | None = None,
        *,
        heading_rad: float = 0.0,
    ) -> None:
        self._vessel = vessel
        self._weather = weather
        self._settings = settings or PhysicsSettings()
        self._start: State = (0.0, 0.0, heading_rad, 0.0, 0.0, 0.0)
        self.starts = self.frames = self.lost = 0
        self.restart()

    def restart(self) -> None:
        """Put the boat back to its start, at rest; the next packet may have any number."""
        self.plant = Plant(self._vessel, self._start, self._weather)
        self._frame: int | None = None
        self._last = b""

    def answer(self, packet: ServoPacket) -> bytes | None:
        """Return the answer to a packet; None for a late copy of one answered before."""
        before = self._frame
        if before is not None and packet.frame < before:
            if packet.frame > 0 and before - packet.frame < LATE_FRAMES:
                return None
            self.restart()
            before = None
        if packet.frame == before:
            return self._last
        if before is None:
            self.starts += 1
        else:
            self.lost += packet.frame - before - 1
        self._frame, self.frames = packet.frame, self.frames + 1
        self._last = self._step(packet)
        return self._last

    def _step(self, packet: ServoPacket) -> bytes:
        before = _ground_velocity(self.plant.state)
        self.plant.command(self._thrusts(packet.pulses_us))
        rate_hz = self._settings.rate_hz or packet.frame_rate_hz
        step_s = min(1 / rate_hz, PLANT_STEP_S) if rate_hz else PLANT_STEP_S
        self.plant.advance(step_s)
        return answer_line(self.plant.time_s, self.plant.state, before, step_s)

    def _thrusts(self, pulses_us: Sequence[int]) -> tuple[float, float]:
        """Thrusts [N] for servo pulses; 0 for an output that is not sent."""
        port, starboard = (
            self._vessel.thrust_of(throttle_of_pulse(pulses_us[servo - 1]))
            if servo <= len(pulses_us)
            else 0.0
            for servo in self._settings.servos
        )
        return port, starboard


def answer_line(
    time_s: float, state: Sequence[float], velocity_before: tuple[float, float], step_s: float
) -> bytes:
    """Return the answer for a state (6,) reached in `step_s` from another velocity.

    `velocity_before` is over ground (north, east) [m/s]. The accelerometer measures the mean
    acceleration of the step, rotated by the heading of this answer, and buoyancy: -g on the axis
    that points down. Integrated with these headings it gives the velocity, up to rounding.
    """
    north, east, heading, _, _, yaw_rate = state
    velocity = _ground_velocity(state)
    forth, across = (
        (now - old) / step_s for now, old in zip(velocity, velocity_before, strict=True)
    )
    cos, sin = math.cos(heading), math.sin(heading)
    body = [forth * cos + across * sin, across * cos - forth * sin, -GRAVITY_MPS2]
    answer = {
        "timestamp": time_s,
        "imu": {"gyro": [0.0, 0.0, yaw_rate], "accel_body": body},
        "position": [north, east, 0.0],
        "attitude": [0.0, 0.0, math.remainder(heading, 2 * math.pi)],
        "velocity": [*velocity, 0.0],
    }
    # The firmware finds fields by plain text; a blank after a colon or comma would hide them.
    return b"\n" + json.dumps(answer, separators=(",", ":")).encode() + b"\n"


def _ground_velocity(state: Sequence[float]) -> tuple[float, float]:
    """Velocity over ground, north and east [m/s]."""
    _, _, heading, surge, sway, _ = state
    cos, sin = math.cos(heading), math.sin(heading)
    return surge * cos - sway * sin, surge * sin + sway * cos
