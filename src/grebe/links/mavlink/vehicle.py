"""What an autopilot has last reported: its mode, battery, fix and parameters."""

from __future__ import annotations

import math
import struct
from dataclasses import dataclass, field
from typing import Any

from pymavlink.dialects.v20 import ardupilotmega as mavlink

from grebe.links.mavlink.dialects import ARDUPILOTMEGA, ARDUROVER, DIALECTS, PX4, Dialect

FIXES = ("no receiver", "no fix", "2D fix", "3D fix", "DGPS", "RTK float", "RTK fixed")
# The flag by which the filter reports that its absolute position can be used.
ABSOLUTE_POSITION = mavlink.EKF_POS_HORIZ_ABS
KEPT_TEXTS = 50


@dataclass
class Vehicle:
    """The latest reports of an autopilot; `take` learns from every message.

    Times are on our clock [s]. `system` and `component` are the autopilot's MAVLink numbers, 0
    before its first heartbeat.
    """

    system: int = 0
    component: int = 0
    autopilot: int = ARDUPILOTMEGA
    mode: int = -1
    armed: bool = False
    battery_share: float | None = None
    fix: int | None = None
    satellites: int = 0
    position_good: bool | None = None
    heard_s: float = -math.inf
    parameters: dict[str, float] = field(default_factory=dict[str, float])
    texts: list[str] = field(default_factory=list[str])
    results: dict[int, int] = field(default_factory=dict[int, int])

    @property
    def dialect(self) -> Dialect:
        """The names of this autopilot's modes, and what a survey requires of it."""
        return DIALECTS.get(self.autopilot, ARDUROVER)

    @property
    def numbers(self) -> tuple[int, int]:
        """The system and component numbers."""
        return self.system, self.component

    @property
    def mode_name(self) -> str:
        """The present mode in the autopilot's words."""
        return self.dialect.mode_name(self.mode)

    @property
    def fix_name(self) -> str:
        """The receiver's fix in words; empty before it is known."""
        if self.fix is None:
            return ""
        kind = FIXES[min(self.fix, len(FIXES) - 1)]
        return f"{kind}, {self.satellites} satellites"

    def is_from(self, message: Any) -> bool:
        """Whether a message comes from this autopilot rather than another on the same line."""
        return (message.get_srcSystem(), message.get_srcComponent()) == (
            self.system,
            self.component,
        )

    def take(self, message: Any, now_s: float) -> None:
        """Learn from a message of this autopilot."""
        self.heard_s = now_s
        kind = message.get_type()
        learn = getattr(self, f"_take_{kind.lower()}", None)
        if learn is not None:
            learn(message)

    def adopt(self, heartbeat: Any) -> bool:
        """Take a heartbeat's sender as the boat if it is an autopilot; return whether it is."""
        if heartbeat.autopilot == mavlink.MAV_AUTOPILOT_INVALID:
            return False
        self.system = heartbeat.get_srcSystem()
        self.component = heartbeat.get_srcComponent()
        self.autopilot = heartbeat.autopilot
        return True

    def _take_heartbeat(self, message: Any) -> None:
        self.mode = message.custom_mode
        self.armed = bool(message.base_mode & mavlink.MAV_MODE_FLAG_SAFETY_ARMED)

    def _take_sys_status(self, message: Any) -> None:
        if message.battery_remaining >= 0:
            self.battery_share = message.battery_remaining / 100

    def _take_gps_raw_int(self, message: Any) -> None:
        self.fix, self.satellites = message.fix_type, message.satellites_visible

    def _take_ekf_status_report(self, message: Any) -> None:
        self.position_good = bool(message.flags & ABSOLUTE_POSITION)

    def _take_estimator_status(self, message: Any) -> None:
        self.position_good = bool(message.flags & mavlink.ESTIMATOR_POS_HORIZ_ABS)

    def _take_param_value(self, message: Any) -> None:
        value = float(message.param_value)
        if self.autopilot == PX4 and message.param_type == mavlink.MAV_PARAM_TYPE_INT32:
            # PX4 sends the four bytes of an integer in the field of a float.
            (value,) = map(float, struct.unpack("<i", struct.pack("<f", value)))
        self.parameters[message.param_id] = value

    def _take_command_ack(self, message: Any) -> None:
        self.results[message.command] = message.result

    def _take_statustext(self, message: Any) -> None:
        self.texts = [*self.texts, message.text][-KEPT_TEXTS:]
