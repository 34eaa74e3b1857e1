"""Converts the boat's time to ours: when a message with the boat's time was true.

MAVLink's TIMESYNC asks the autopilot for its time, and the answer is taken to be from halfway
through the round trip. Of the last exchanges the one with the shortest round trip is the most
accurate: longer ones have waited somewhere (the idea of NTP's clock filter, RFC 5905, sec. 10).
Without answers, the message that came with the least delay is taken to have had none.
"""

from __future__ import annotations

import math
from collections import deque

# The number of exchanges remembered: at one a second, the drift of two crystals in half a minute.
REMEMBERED = 30
# The boat's time runs back by more than this only if the autopilot has restarted [s].
REBOOT_S = 2.0


class BoatClock:
    """Converts times since the autopilot's start to our clock [s]."""

    def __init__(self) -> None:
        self._exchanges: deque[tuple[float, float]] = deque(maxlen=REMEMBERED)
        self._heard: deque[float] = deque(maxlen=10 * REMEMBERED)
        self._latest_boot_s = -math.inf

    @property
    def delay_s(self) -> float:
        """The one-way delay of a message [s]; not a number before any exchange."""
        return min(self._exchanges)[0] / 2 if self._exchanges else math.nan

    def exchanged(self, sent_s: float, received_s: float, boot_s: float) -> None:
        """Learn from an exchange: when it was sent and received, and the boat's time in between."""
        there_and_back = received_s - sent_s
        if there_and_back >= 0:
            self._exchanges.append((there_and_back, boot_s - (sent_s + received_s) / 2))

    def heard(self, boot_s: float, received_s: float) -> bool:
        """Learn from a message with the boat's time; return whether the autopilot has restarted."""
        afresh = boot_s < self._latest_boot_s - REBOOT_S
        if afresh:
            self._exchanges.clear()
            self._heard.clear()
        self._latest_boot_s = boot_s if afresh else max(boot_s, self._latest_boot_s)
        self._heard.append(boot_s - received_s)
        return afresh

    def ours(self, boot_s: float) -> float:
        """Return the time on our clock [s] at a time since the boat's start [s]."""
        if self._exchanges:
            return boot_s - min(self._exchanges)[1]
        return boot_s - max(self._heard, default=0.0)
