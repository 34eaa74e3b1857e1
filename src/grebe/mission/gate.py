"""The gate between a mission and its boat: whoever stops the mission shuts it at once.

A stop may come from another thread while a step is solved or an estimate is waited for. It takes
the thrust away then and there; what the mission decides afterwards no longer gets through.
"""

from __future__ import annotations

import threading

from grebe.core.events import EndReason
from grebe.links.base import BoatLink, Order


class OverError(Exception):
    """The mission is over in the middle of waiting for something; why, and in words."""

    def __init__(self, reason: EndReason, message: str) -> None:
        super().__init__(message)
        self.reason = reason


class Gate:
    """Hands orders to a link until it is shut; `why` says who shut it, empty while it is open."""

    def __init__(self, link: BoatLink) -> None:
        self._link = link
        self._lock = threading.Lock()
        self.why = ""

    def command(self, order: Order) -> None:
        """Give the boat an order, unless the gate is shut."""
        with self._lock:
            if not self.why:
                self._link.command(order)

    def shut(self, why: str) -> None:
        """Take all thrust away, for good. Safe from any thread."""
        with self._lock:
            self.why = self.why or why or "stopped"
            self._link.stop()
