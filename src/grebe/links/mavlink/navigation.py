"""State estimates from an autopilot's LOCAL_POSITION_NED and ATTITUDE.

The autopilot counts metres north, east and down from the origin of its filter, the survey from
the origin of its own plane; both planes are taken as parallel, which turns a boat's way by 0.2 mrad
for each kilometre between the origins.
"""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import Any

from grebe.core.events import State
from grebe.core.frames import LocalFrame

# An attitude that is older than this says nothing of a position's moment [s].
LATEST_ATTITUDE_S = 0.5
# Positions in both frames that lie this near in time tell one frame's place in the other [s].
SAME_MOMENT_S = 0.06


@dataclass(frozen=True, kw_only=True)
class Fix:
    """A state in the survey's frame, and when it was, in seconds since the autopilot's start."""

    boot_s: float
    state: State


class Navigator:
    """Joins the autopilot's messages into states; each position is used once.

    Without a frame places are counted from the autopilot's own origin.
    """

    def __init__(self, frame: LocalFrame | None) -> None:
        self._frame = frame
        self._origin: tuple[float, float] | None = None
        self._attitude: Any = None
        self._last_ms = -1
        self._local: tuple[int, float, float] | None = None

    @property
    def has_origin(self) -> bool:
        """Whether it is known where the autopilot counts from."""
        return self._origin is not None

    def restart(self) -> None:
        """Forget what an autopilot said that has started afresh."""
        self._attitude, self._local, self._last_ms, self._origin = None, None, -1, None

    def take(self, message: Any) -> Fix | None:
        """Learn from a message; returns a state where it completes one."""
        kind = message.get_type()
        if kind == "ATTITUDE":
            if self._attitude is None or message.time_boot_ms > self._attitude.time_boot_ms:
                self._attitude = message
        elif kind == "GPS_GLOBAL_ORIGIN":
            self._origin = self._place(message.latitude, message.longitude)
        elif kind == "GLOBAL_POSITION_INT":
            self._learn_origin(message)
        elif kind == "LOCAL_POSITION_NED":
            return self._fix(message)
        return None

    def _place(self, lat_1e7: int, lon_1e7: int) -> tuple[float, float]:
        if self._frame is None:
            return 0.0, 0.0
        north, east = self._frame.to_local((lon_1e7 * 1e-7, lat_1e7 * 1e-7)).tolist()
        return north, east

    def _learn_origin(self, message: Any) -> None:
        """Where the autopilot does not say its origin: from one place in both frames."""
        if self._origin is not None or self._local is None:
            return
        at_ms, x, y = self._local
        if abs(message.time_boot_ms - at_ms) <= 1e3 * SAME_MOMENT_S:
            north, east = self._place(message.lat, message.lon)
            self._origin = (north - x, east - y)

    def _fix(self, message: Any) -> Fix | None:
        """The state at a position, unless it came out of its order or lacks the rest."""
        if message.time_boot_ms <= self._last_ms:
            return None
        self._last_ms = message.time_boot_ms
        self._local = (message.time_boot_ms, message.x, message.y)
        if self._origin is None or self._attitude is None:
            return None
        since_s = 1e-3 * (message.time_boot_ms - self._attitude.time_boot_ms)
        if abs(since_s) > LATEST_ATTITUDE_S:
            return None
        yaw_rate = self._attitude.yawspeed
        heading = self._attitude.yaw + yaw_rate * since_s
        cos, sin = math.cos(heading), math.sin(heading)
        north, east = self._origin[0] + message.x, self._origin[1] + message.y
        surge = cos * message.vx + sin * message.vy
        sway = cos * message.vy - sin * message.vx
        state = (north, east, heading, surge, sway, yaw_rate)
        return Fix(boot_s=1e-3 * message.time_boot_ms, state=state)
