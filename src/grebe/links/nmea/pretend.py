"""A pretend boat for rehearsals and tests: our plant, NMEA 0183 out, lines of thrust in.

In memory it sails only while its caller waits for sentences, so that a mission takes only the time
of its computation and is the same every time. Over UDP it is a boat like any other.
"""

from __future__ import annotations

import math
import time
from collections.abc import Callable
from dataclasses import dataclass

import numpy as np

from grebe.core.errors import UsageError
from grebe.core.frames import LocalFrame
from grebe.links.nmea.sentences import KNOT_MPS
from grebe.links.nmea.thrusts import RECEIVER_S, read_thrust_line
from grebe.links.wires import UdpWire
from grebe.simulation.plant import PLANT_STEP_S, Plant
from grebe.simulation.sonde import ReadsWater

DAY_S = 86_400
# How long a boat that keeps step with its helm waits for a line after its sentences [s].
ANSWER_S = 0.05


@dataclass(frozen=True, kw_only=True)
class OutputSettings:
    """How a pretend boat speaks.

    It sends a compass's sentence (HDT, THS, or HDM with `variation_deg`) every `period_s`, and a
    position every `place_every`-th time, as `talker` and beginning at a time of day.
    `damaged_share` of the sentences are damaged in transfer, and `position_error_m` is the standard
    deviation of the positions. The boat is `silent`, or has `no_fix`, in a span (from, until) of
    its own time [s].

    Raises `UsageError` for impossible values.
    """

    period_s: float = 0.1
    place_every: int = 1
    from_second_of_day: float = 43_200.0
    talker: str = "GN"
    compass: str = "HDT"
    variation_deg: float = 0.0
    damaged_share: float = 0.0
    position_error_m: float = 0.0
    silent: tuple[float, float] = (math.inf, math.inf)
    no_fix: tuple[float, float] = (math.inf, math.inf)
    seed: int = 0

    def __post_init__(self) -> None:
        if not (
            self.period_s > 0
            and self.place_every > 0
            and 0 <= self.damaged_share < 1
            and self.position_error_m >= 0
        ):
            raise UsageError(
                "A simulated boat's periods must be above 0, its share of damaged sentences 0 "
                "to less than 1, and its position error 0 or more."
            )
        if self.compass not in ("HDT", "THS", "HDM"):
            raise UsageError(f"A simulated compass sends HDT, THS or HDM, not {self.compass}.")


PLAIN = OutputSettings()


class PretendBoat:
    """A plant with a receiver, a compass, a probe and a small board that reads lines of thrust."""

    def __init__(
        self,
        plant: Plant,
        frame: LocalFrame,
        sonde: ReadsWater | None = None,
        output: OutputSettings = PLAIN,
    ) -> None:
        self.plant = plant
        self.output = output
        self.lines = 0
        self._frame, self._sonde = frame, sonde
        self._random = np.random.default_rng(output.seed)
        self._heard_s = 0.0
        self._spoken = 0

    def advance(self, duration_s: float) -> None:
        """Let time pass; without a line for `RECEIVER_S` the board removes the thrust."""
        steps = max(1, math.ceil(duration_s / PLANT_STEP_S - 1e-9))
        for _ in range(steps):
            if self.plant.time_s - self._heard_s > RECEIVER_S:
                self.plant.command((0.0, 0.0))
            self.plant.advance(duration_s / steps)

    def receive(self, data: bytes) -> None:
        """Take lines of thrust; the last intact one holds."""
        for line in data.splitlines():
            said = read_thrust_line(line)
            if said is not None:
                vessel = self.plant.vessel
                self.plant.command((vessel.thrust_of(said.port), vessel.thrust_of(said.starboard)))
                self._heard_s = self.plant.time_s
                self.lines += 1

    def due(self) -> bytes:
        """Return the present sentences; none while the boat is silent."""
        output, now_s = self.output, self.plant.time_s
        if output.silent[0] <= now_s < output.silent[1]:
            return b""
        placed = self._spoken % output.place_every == 0
        self._spoken += 1
        bodies = [*(self._receiver() if placed else []), *self._compass(), *self._probe()]
        return b"".join(self._sent(body) for body in bodies)

    def _receiver(self) -> list[str]:
        output, now_s = self.output, self.plant.time_s
        clock = _clock_text((output.from_second_of_day + now_s) % DAY_S)
        if output.no_fix[0] <= now_s < output.no_fix[1]:
            return [
                f"{output.talker}GGA,{clock},,,,,0,00,99.9,,M,,M,,",
                f"{output.talker}RMC,{clock},V,,,,,,,010526,,,N",
            ]
        north, east, heading, surge, sway, _ = self.plant.state
        error = self._random.normal(0.0, 1.0, 2) * output.position_error_m
        lon, lat = self._frame.to_wgs84((north + error[0], east + error[1])).tolist()
        place = f"{_angle_text(lat, 2, 'NS')},{_angle_text(lon, 3, 'EW')}"
        speed = math.hypot(surge, sway) / KNOT_MPS
        course = math.degrees(heading + math.atan2(sway, surge)) % 360
        side = "E" if output.variation_deg >= 0 else "W"
        variation = f"{abs(output.variation_deg):.2f},{side}"
        motion = f"{speed:.4f},{course:.4f},010526,{variation},A"
        return [
            f"{output.talker}GGA,{clock},{place},8,12,0.6,0.0,M,0.0,M,,",
            f"{output.talker}RMC,{clock},A,{place},{motion}",
        ]

    def _compass(self) -> list[str]:
        compass, heading = self.output.compass, math.degrees(self.plant.state[2])
        turn = f"HEROT,{math.degrees(self.plant.state[5]) * 60:.4f},A"
        if compass == "HDM":
            return [f"HCHDM,{(heading - self.output.variation_deg) % 360:.4f},M", turn]
        return [f"HE{compass},{heading % 360:.4f},{'A' if compass == 'THS' else 'T'}", turn]

    def _probe(self) -> list[str]:
        if self._sonde is None:
            return []
        reading = self._sonde.read(self.plant.state[0], self.plant.state[1])
        temperature = reading.get("temperature_degc")
        return [] if temperature is None else [f"YXMTW,{temperature:.3f},C"]

    def _sent(self, body: str) -> bytes:
        """Return a sentence with its sum, as it arrives."""
        total = 0
        for byte in body.encode():
            total ^= byte
        line = bytearray(f"${body}*{total:02X}\r\n".encode())
        if self._random.uniform() < self.output.damaged_share:
            line[int(self._random.integers(1, len(line) - 5))] ^= 0x03
        return bytes(line)


class PretendWire:
    """A wire to a pretend boat in memory, which sails while the caller waits, on its own clock."""

    def __init__(self, boat: PretendBoat) -> None:
        self._boat = boat
        self._next_s = boat.plant.time_s

    def now_s(self) -> float:
        """See `Wire`."""
        return self._boat.plant.time_s

    def send(self, data: bytes) -> None:
        """See `Wire`."""
        self._boat.receive(data)

    def receive(self, timeout_s: float) -> bytes:
        """See `Wire`; the boat sails to its next sentences, or until the time is up."""
        end_s = self.now_s() + timeout_s
        until_s = min(self._next_s, end_s)
        if until_s > self.now_s() + 1e-9:
            self._boat.advance(until_s - self.now_s())
        if self._next_s > end_s + 1e-9:
            return b""
        self._next_s += self._boat.output.period_s
        return self._boat.due()

    def close(self) -> None:
        """See `Wire`; the boat can still be advanced."""


def serve(
    boat: PretendBoat,
    output_wire: UdpWire,
    input_wire: UdpWire,
    stopped: Callable[[], bool],
    speed: float | None = 1.0,
) -> None:
    """Run a boat over UDP, `speed` times as fast as real time; without a speed it keeps step with
    its helm, as fast as lines come.
    """
    began_s, sailed_s = time.monotonic(), boat.plant.time_s
    while not stopped():
        output_wire.send(boat.due())
        if speed is None:
            received = input_wire.receive(ANSWER_S)
            while received:
                boat.receive(received)
                received = input_wire.receive(0.0)
        else:
            due_s = began_s + (boat.plant.time_s + boat.output.period_s - sailed_s) / speed
            while (left_s := due_s - time.monotonic()) > 0:
                boat.receive(input_wire.receive(left_s))
        boat.advance(boat.output.period_s)


def _clock_text(second_of_day: float) -> str:
    hundredths = round(100 * second_of_day) % (100 * DAY_S)
    seconds, part = divmod(hundredths, 100)
    minutes, second = divmod(seconds, 60)
    hour, minute = divmod(minutes, 60)
    return f"{hour:02d}{minute:02d}{second:02d}.{part:02d}"


def _angle_text(degrees: float, digits: int, sides: str) -> str:
    whole, minutes = divmod(round(abs(degrees) * 60, 7), 60)
    side = sides[0] if degrees >= 0 else sides[1]
    return f"{int(whole):0{digits}d}{minutes:010.7f},{side}"
