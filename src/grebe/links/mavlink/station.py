"""Our end of a MAVLink line: packs and parses messages, and repeats requests until answered.

We are a ground station (system 255), from which ArduPilot also accepts sticks. All waiting uses the
wire's own clock, so that a line in a test can have its own time.
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
# A request without an answer is repeated after this long [s].
ASK_AGAIN_S = 0.7
RESULTS = {
    mavlink.MAV_RESULT_TEMPORARILY_REJECTED: "not now",
    mavlink.MAV_RESULT_DENIED: "denied",
    mavlink.MAV_RESULT_UNSUPPORTED: "not supported",
    mavlink.MAV_RESULT_FAILED: "failed",
}


class Station:
    """Communicates with one autopilot over a wire; `vehicle` and `clock` hold its reports."""

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
        """Pack and send a message. Thread-safe, because a stop may come from any thread."""
        with self._lock:
            self.wire.send(message.pack(self._codec))

    def messages(self, timeout_s: float) -> Iterator[Any]:
        """Yield the autopilot's messages received, waiting at most `timeout_s` for the first."""
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
        """Send a request until a message answers it, and return that; None if none does in time.

        Other messages received meanwhile also update the vehicle's state.
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
        """Send a MAV_CMD and wait for its answer; return why it was refused, empty if accepted."""
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
        """Wait for the heartbeat of an autopilot; `LinkError` if none comes."""
        end_s = self.wire.now_s() + timeout_s
        while not self.vehicle.system:
            if self.wire.now_s() >= end_s:
                raise LinkError(
                    f"No autopilot was heard within {timeout_s:g} s; check the address, the "
                    "system number, and that the autopilot (or its router) sends there."
                )
            for _ in self.messages(0.1):
                pass

    def match_clocks(self, rounds: int = 5) -> None:
        """Request the boat's time a few times; without answers its messages count as undelayed."""
        for _ in range(rounds):
            if not self._ask_time(1.0):
                return

    def parameter(self, name: str, timeout_s: float = 3.0) -> float | None:
        """Read a parameter; None if the autopilot has none of that name."""
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
        """Send a heartbeat and a request for the boat's time, once a second."""
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
        """Learn from a message; return whether it is from our autopilot."""
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
