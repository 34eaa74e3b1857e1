"""The boat's clock by ours: when a message that carries the boat's time was true.

MAVLink's TIMESYNC asks the autopilot for its time; half of the way there and back lies between.
The exchange with the shortest way of the last ones says most: what is longer has waited somewhere
(the idea of NTP's clock filter, RFC 5905, sec. 10). Where nobody answers, the message that came
with the least delay stands for a delay of none.
"""

from __future__ import annotations

import math
from collections import deque

# Exchanges that are remembered: at one a second, half a minute of two crystals' drift.
REMEMBERED = 30
# The boat's time runs back by more than this only when the autopilot has started afresh [s].
REBOOT_S = 2.0


class BoatClock:
    """Times since the boat's start, on our clock [s]."""

    def __init__(self) -> None:
        self._exchanges: deque[tuple[float, float]] = deque(maxlen=REMEMBERED)
        self._heard: deque[float] = deque(maxlen=10 * REMEMBERED)
        self._latest_boot_s = -math.inf

    @property
    def delay_s(self) -> float:
        """How long a message takes one way; not a number before any exchange."""
        return min(self._exchanges)[0] / 2 if self._exchanges else math.nan

    def exchanged(self, sent_s: float, received_s: float, boot_s: float) -> None:
        """Learn from a question that was sent and answered, with the boat's time in the answer."""
        there_and_back = received_s - sent_s
        if there_and_back >= 0:
            self._exchanges.append((there_and_back, boot_s - (sent_s + received_s) / 2))

    def heard(self, boot_s: float, received_s: float) -> bool:
        """Learn from any message with the boat's time; whether the autopilot has started afresh."""
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
