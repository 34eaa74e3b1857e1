"""A boat behind its link, with a note of all that it said and was told."""

from __future__ import annotations

from typing import Protocol

from grebe.core.events import State
from grebe.links.base import BoatLink, Observation, Order
from grebe.links.passing import PassingLink


class DriveSink(Protocol):
    """Keeps a drive: states when the boat was in them, orders when they were given [s]."""

    def state(self, time_s: float, state: State) -> None:
        """Keep a state estimate."""
        ...

    def order(self, time_s: float, order: Order) -> None:
        """Keep an order."""
        ...


class RecordingLink(PassingLink):
    """Passes everything on, and tells a sink of estimates as they came and of orders.

    Orders are dated by the estimate before them: what an order takes to be thought of is no part
    of the boat.
    """

    def __init__(self, link: BoatLink, sink: DriveSink) -> None:
        super().__init__(link)
        self._sink = sink
        self._now_s = 0.0

    def observe(self) -> Observation:
        """See `BoatLink`."""
        observation = self._link.observe()
        self._now_s = observation.time_s
        self._sink.state(observation.time_s - observation.age_s, observation.state)
        return observation

    def command(self, order: Order) -> None:
        """See `BoatLink`."""
        self._link.command(order)
        self._sink.order(self._now_s, order)
