"""What a mission needs of a boat: the port that every boat link fills.

A link delivers state estimates at its own pace, takes thrusts that hold until the next
ones, and hands out what the sonde says. It knows nothing of targets or maps. Time is the
link's: a simulated boat's seconds pass as fast as they are computed.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from typing import Protocol

State = tuple[float, float, float, float, float, float]


@dataclass(frozen=True, kw_only=True)
class Observation:
    """A state estimate z in the survey's frame, velocities over ground, and its time [s]
    since the link was opened.
    """

    time_s: float
    state: State


class BoatLink(Protocol):
    """A boat that can be observed, commanded and asked for a measurement."""

    def observe(self) -> Observation:
        """Wait for the next state estimate and return it; `LinkError` when none comes.

        An estimate may hold numbers that are not finite: it is then passed over.
        """
        ...

    def command(self, thrusts: tuple[float, float]) -> None:
        """Set the thrusts (F_1 port, F_2 starboard) [N] until the next command."""
        ...

    def measure(self) -> Mapping[str, float]:
        """Return the newest reading of the sonde, keyed by quantity; empty when none."""
        ...

    def close(self) -> None:
        """Leave the boat without thrust and give it back."""
        ...
