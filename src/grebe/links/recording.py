"""A link that records the estimates and orders of a boat."""

from __future__ import annotations

from typing import Protocol

from grebe.core.events import State
from grebe.links.base import BoatLink, Observation, Order
from grebe.links.forwarding import ForwardingLink


class DriveSink(Protocol):
    """Stores a drive: states with the times [s] at which the boat was in them, orders with those at
    which they were given.
    """

    def state(self, time_s: float, state: State) -> None:
        """Store a state estimate."""
        ...

    def order(self, time_s: float, order: Order) -> None:
        """Store an order."""
        ...


class RecordingLink(ForwardingLink):
    """Passes everything on, and gives a sink the estimates, as they came, and the orders.

    An order has the time of the estimate before it: the time that the helm takes to compute it is
    not part of the boat.
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
