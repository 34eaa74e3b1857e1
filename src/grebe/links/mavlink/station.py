"""Our end of a MAVLink line: messages packed and parsed, questions asked until they are answered.

We speak as a ground station (system 255), which ArduPilot heeds for sticks too. Everything here
waits on the wire's own clock, so that a line that exists in a test alone passes time as it likes.
"""

from __future__ import annotations

import math
import threading
from collections.abc import Callable, Iterator, Sequence
from typing import Any

from pymavlink.dialects.v20 import ardupilotmega as mavlink

from grebe.core.errors import LinkError
from grebe.links.mavlink.clock import BoatClock
from grebe.links.mavlink.vehicle import Vehicle
from grebe.links.wires import Wire

OUR_SYSTEM, OUR_COMPONENT = 255, mavlink.MAV_COMP_ID_MISSIONPLANNER
HEARTBEAT_S = 1.0
# A question that is not answered is asked again after this long [s].
ASK_AGAIN_S = 0.7
RESULTS = {
    mavlink.MAV_RESULT_TEMPORARILY_REJECTED: "not now",
    mavlink.MAV_RESULT_DENIED: "denied",
    mavlink.MAV_RESULT_UNSUPPORTED: "it does not know how",
    mavlink.MAV_RESULT_FAILED: "it failed",
}


class Station:
    """Talks with one autopilot over a wire; `vehicle` and `clock` hold what it has said."""

    def __init__(self, wire: Wire, wanted_system: int = 0) -> None:
        self.wire = wire
        self.vehicle = Vehicle()
        self.clock = BoatClock()
        self.restarted = False
        self._wanted_system = wanted_system
        self._codec: Any = mavlink.MAVLink(None, OUR_SYSTEM, OUR_COMPONENT)
        self._codec.robust_parsing = True
        self._lock = threading.Lock()
        self._beat_s = -math.inf

    def send(self, message: Any) -> None:
        """Pack and send a message; safe from any thread, for a stop comes from anywhere."""
        with self._lock:
            self.wire.send(message.pack(self._codec))

    def messages(self, timeout_s: float) -> Iterator[Any]:
        """Yield the autopilot's messages that have come, waiting at most so long for the first."""
        self._beat()
        data = self.wire.receive(timeout_s)
        while data:
            now_s = self.wire.now_s()
            for message in self._codec.parse_buffer(data) or ():
                if self._learn(message, now_s):
                    yield message
            data = self.wire.receive(0.0)

    def ask(
        self,
        question: Callable[[], Any],
        answered: Callable[[Any], bool],
        timeout_s: float,
    ) -> Any:
        """Send a question until a message answers it; None when none does in time.

        What else comes meanwhile is learned from, and not lost to the vehicle's state.
        """
        end_s = self.wire.now_s() + timeout_s
        next_s = -math.inf
        while self.wire.now_s() < end_s:
            if self.wire.now_s() >= next_s:
                self.send(question())
                next_s = self.wire.now_s() + ASK_AGAIN_S
            for message in self.messages(0.05):
                if answered(message):
                    return message
        return None

    def command(self, number: int, parameters: Sequence[float], timeout_s: float = 5.0) -> str:
        """Give a MAV_CMD and wait for its answer; returns why it was not done, or nothing."""
        values = [*parameters, *[0.0] * (7 - len(parameters))]
        vehicle = self.vehicle
        answer = self.ask(
            lambda: mavlink.MAVLink_command_long_message(
                vehicle.system, vehicle.component, number, 0, *values
            ),
            lambda m: (
                m.get_type() == "COMMAND_ACK"
                and m.command == number
                and m.result != mavlink.MAV_RESULT_IN_PROGRESS
            ),
            timeout_s,
        )
        if answer is None:
            return f"no answer within {timeout_s:g} s"
        if answer.result == mavlink.MAV_RESULT_ACCEPTED:
            return ""
        return RESULTS.get(answer.result, f"result {answer.result}")

    def find(self, timeout_s: float) -> None:
        """Wait for the heartbeat of an autopilot; `LinkError` when none is heard."""
        end_s = self.wire.now_s() + timeout_s
        while not self.vehicle.system:
            if self.wire.now_s() >= end_s:
                raise LinkError(
                    f"No autopilot is heard within {timeout_s:g} s; check the address, that the "
                    "autopilot (or its router) sends there, and its system number."
                )
            for _ in self.messages(0.1):
                pass

    def match_clocks(self, rounds: int = 5) -> None:
        """Ask for the boat's time a few times; one that does not answer is taken as prompt."""
        for _ in range(rounds):
            if not self._ask_time(1.0):
                return

    def parameter(self, name: str, timeout_s: float = 3.0) -> float | None:
        """Read a parameter; None where the autopilot has none of that name."""
        vehicle = self.vehicle
        self.ask(
            lambda: mavlink.MAVLink_param_request_read_message(
                vehicle.system, vehicle.component, name.encode(), -1
            ),
            lambda m: m.get_type() == "PARAM_VALUE" and m.param_id == name,
            timeout_s,
        )
        return vehicle.parameters.get(name)

    def _ask_time(self, timeout_s: float) -> bool:
        asked_ns = round(self.wire.now_s() * 1e9)
        answer = self.ask(
            lambda: mavlink.MAVLink_timesync_message(0, round(self.wire.now_s() * 1e9)),
            lambda m: m.get_type() == "TIMESYNC" and m.tc1 > 0 and m.ts1 >= asked_ns,
            timeout_s,
        )
        return answer is not None

    def _beat(self) -> None:
        """Once a second: that we are there, and what time it is on the boat."""
        if self.wire.now_s() < self._beat_s + HEARTBEAT_S:
            return
        self._beat_s = self.wire.now_s()
        self.send(
            mavlink.MAVLink_heartbeat_message(
                mavlink.MAV_TYPE_GCS, mavlink.MAV_AUTOPILOT_INVALID, 0, 0,
                mavlink.MAV_STATE_ACTIVE, 3,
            )
        )  # fmt: skip
        if self.vehicle.system:
            self.send(mavlink.MAVLink_timesync_message(0, round(self.wire.now_s() * 1e9)))

    def _learn(self, message: Any, now_s: float) -> bool:
        """Learn from a message; whether it is our autopilot's."""
        vehicle, kind = self.vehicle, message.get_type()
        if kind == "BAD_DATA":
            return False
        if not vehicle.system and kind == "HEARTBEAT":
            wanted = self._wanted_system
            if not wanted or message.get_srcSystem() == wanted:
                vehicle.adopt(message)
        if not vehicle.is_from(message):
            return False
        if kind == "TIMESYNC" and message.tc1 > 0:
            self.clock.exchanged(message.ts1 * 1e-9, now_s, message.tc1 * 1e-9)
        boot_ms = getattr(message, "time_boot_ms", None)
        if boot_ms is not None and self.clock.heard(1e-3 * boot_ms, now_s):
            self.restarted = True
        vehicle.take(message, now_s)
        return True
