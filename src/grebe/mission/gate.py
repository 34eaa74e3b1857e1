"""The gate between a mission and its boat: a stop of the mission shuts it at once.

A stop may come from another thread while the mission solves a step or waits for an estimate. The
gate then removes the thrust immediately and blocks every later command of the mission.
"""

from __future__ import annotations

import threading

from grebe.core.events import EndReason
from grebe.links.base import BoatLink, Order


class OverError(Exception):
    """The mission ended while it was waiting; carries the reason and a message."""

    def __init__(self, reason: EndReason, message: str) -> None:
        super().__init__(message)
        self.reason = reason


class Gate:
    """Passes orders to a link until it is shut; `why` says who shut it and is empty before."""

    def __init__(self, link: BoatLink) -> None:
        self._link = link
        self._lock = threading.Lock()
        self.why = ""

    def command(self, order: Order) -> None:
        """Pass an order to the boat, unless the gate is shut."""
        with self._lock:
            if not self.why:
                self._link.command(order)

    def shut(self, why: str) -> None:
        """Remove all thrust, for good. Thread-safe."""
        with self._lock:
            self.why = self.why or why or "stopped"
            self._link.stop()
