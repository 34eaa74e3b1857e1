"""Boats that share one simulated time: each acts in its turn, so that every run is the same.

Each mission runs in a thread of its own, and only the one whose turn it is goes on: from one
estimate to the next, then the next boat. A boat that is over leaves the rota.
"""

from __future__ import annotations

import threading

from grebe.links.base import BoatLink, Observation
from grebe.links.passing import PassingLink


class Rota:
    """Whose turn it is, among the numbers of some boats."""

    def __init__(self, boats: list[int]) -> None:
        self._boats = list(boats)
        self._turn = 0
        self._changed = threading.Condition()

    def wait(self, boat: int) -> None:
        """Wait until it is the boat's turn."""
        with self._changed:
            self._changed.wait_for(lambda: boat not in self._boats or self._has_turn(boat))

    def end(self, boat: int) -> None:
        """The boat has acted: it is the next one's turn."""
        with self._changed:
            if boat in self._boats and self._has_turn(boat):
                self._turn = (self._turn + 1) % len(self._boats)
                self._changed.notify_all()

    def leave(self, boat: int) -> None:
        """The boat is over."""
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


class InTurn(PassingLink):
    """A boat's link that advances in the boat's turn."""

    def __init__(self, link: BoatLink, rota: Rota, boat: int) -> None:
        super().__init__(link)
        self._rota, self._boat = rota, boat

    def observe(self) -> Observation:
        """Let the others act, and return the next estimate when it is this boat's turn again."""
        self._rota.end(self._boat)
        self._rota.wait(self._boat)
        return self._link.observe()

    def close(self) -> None:
        """See `BoatLink`; the boat leaves the rota."""
        self._link.close()
        self._rota.leave(self._boat)
