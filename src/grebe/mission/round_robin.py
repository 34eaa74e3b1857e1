"""Boats that share one simulated clock act in turn, so that every run is the same.

Each mission runs in its own thread, and only the boat whose turn it is proceeds, from one estimate
to the next. A boat that has ended its mission has no more turns.
"""

from __future__ import annotations

import threading

from grebe.links.base import BoatLink, Observation
from grebe.links.forwarding import ForwardingLink


class RoundRobin:
    """Keeps track of whose turn it is; boats are identified by their numbers."""

    def __init__(self, boats: list[int]) -> None:
        self._boats = list(boats)
        self._turn = 0
        self._changed = threading.Condition()

    def wait(self, boat: int) -> None:
        """Wait until it is the boat's turn."""
        with self._changed:
            self._changed.wait_for(lambda: boat not in self._boats or self._has_turn(boat))

    def end(self, boat: int) -> None:
        """End the boat's turn and begin the next boat's."""
        with self._changed:
            if boat in self._boats and self._has_turn(boat):
                self._turn = (self._turn + 1) % len(self._boats)
                self._changed.notify_all()

    def leave(self, boat: int) -> None:
        """Remove a boat whose mission is over."""
        with self._changed:
            if boat in self._boats:
                place = self._boats.index(boat)
                self._boats.remove(boat)
                if place < self._turn:
                    self._turn -= 1
                if self._boats:
                    self._turn %= len(self._boats)
                self._changed.notify_all()

    def _has_turn(self, boat: int) -> bool:
        return self._boats[self._turn] == boat


class RoundRobinLink(ForwardingLink):
    """A boat's link that advances only in the boat's turn."""

    def __init__(self, link: BoatLink, turns: RoundRobin, boat: int) -> None:
        super().__init__(link)
        self._turns, self._boat = turns, boat

    def observe(self) -> Observation:
        """Let the other boats act, and return the next estimate when it is this boat's turn."""
        self._turns.end(self._boat)
        self._turns.wait(self._boat)
        return self._link.observe()

    def close(self) -> None:
        """See `BoatLink`; also ends its turns."""
        self._link.close()
        self._turns.leave(self._boat)
