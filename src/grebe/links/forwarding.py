"""A link that passes everything on to another: the base of links that change a single thing."""

from __future__ import annotations

from collections.abc import Mapping

from grebe.links.base import AsDriven, BoatLink, BoatStatus, Observation, Order, as_driven
from grebe.links.emergency import EmergencyStop, emergency_of


class ForwardingLink:
    """Passes everything on to another link."""

    def __init__(self, link: BoatLink) -> None:
        self._link = link

    @property
    def source(self) -> str:
        """See `BoatLink`."""
        return self._link.source

    def observe(self) -> Observation:
        """See `BoatLink`."""
        return self._link.observe()

    def command(self, order: Order) -> None:
        """See `BoatLink`."""
        self._link.command(order)

    def measure(self) -> Mapping[str, float]:
        """See `BoatLink`."""
        return self._link.measure()

    def status(self) -> BoatStatus:
        """See `BoatLink`."""
        return self._link.status()

    def stop(self) -> None:
        """See `BoatLink`."""
        self._link.stop()

    @property
    def as_driven(self) -> AsDriven:
        """See `DrivenLink`."""
        return as_driven(self._link)

    @property
    def emergency(self) -> EmergencyStop | None:
        """See `StopsInEmergency`."""
        return emergency_of(self._link)

    def close(self) -> None:
        """See `BoatLink`."""
        self._link.close()
