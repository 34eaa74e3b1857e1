"""State estimates from an autopilot's LOCAL_POSITION_NED and ATTITUDE.

The autopilot counts metres north, east and down from the origin of its filter, and the survey from
the origin of its own plane. Both planes are taken as parallel, which rotates a boat's track by 0.2
mrad for each kilometre between the origins.
"""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import Any

from grebe.core.events import State
from grebe.core.frames import LocalFrame

# An attitude further than this from the time of a position is not used with it [s].
LATEST_ATTITUDE_S = 0.5
# Positions in both frames within this time of each other give the offset between the frames [s].
SAME_MOMENT_S = 0.06


@dataclass(frozen=True, kw_only=True)
class Fix:
    """A state in the survey's frame, and its time in seconds since the autopilot's start."""

    boot_s: float
    state: State


class Navigator:
    """Combines the autopilot's messages into states; each position is used once.

    Without a frame, positions are relative to the autopilot's own origin.
    """

    def __init__(self, frame: LocalFrame | None) -> None:
        self._frame = frame
        self._origin: tuple[float, float] | None = None
        self._attitude: Any = None
        self._last_ms = -1
        self._local: tuple[int, float, float] | None = None

    @property
    def has_origin(self) -> bool:
        """Whether the autopilot's origin is known."""
        return self._origin is not None

    def restart(self) -> None:
        """Forget the messages of an autopilot that has restarted."""
        self._attitude, self._local, self._last_ms, self._origin = None, None, -1, None

    def take(self, message: Any) -> Fix | None:
        """Learn from a message, and return a state if it completes one."""
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
        """Compute the origin from one place in both frames, if the autopilot does not give it."""
        if self._origin is not None or self._local is None:
            return
        at_ms, x, y = self._local
        if abs(message.time_boot_ms - at_ms) <= 1e3 * SAME_MOMENT_S:
            north, east = self._place(message.lat, message.lon)
            self._origin = (north - x, east - y)

    def _fix(self, message: Any) -> Fix | None:
        """Return the state at a position; None if that is out of order or the rest is missing."""
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
