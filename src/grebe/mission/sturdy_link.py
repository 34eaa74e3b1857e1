"""A boat's link whose failures are all `LinkError`, whatever fails below it."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from contextlib import suppress
from typing import TypeVar

from grebe.core.errors import LinkError
from grebe.links.base import BoatLink, BoatStatus, Observation, Order

_T = TypeVar("_T")


class SturdyLink:
    """Hands everything on to a link; an `OSError` of its line becomes a `LinkError`, but where the
    link is closed: what is broken already cannot be left in better order.
    """

    def __init__(self, link: BoatLink) -> None:
        self._link = link

    @property
    def source(self) -> str:
        """See `BoatLink`."""
        return self._link.source

    def observe(self) -> Observation:
        """See `BoatLink`."""
        return _told(self._link.observe)

    def command(self, order: Order) -> None:
        """See `BoatLink`."""
        _told(lambda: self._link.command(order))

    def measure(self) -> Mapping[str, float]:
        """See `BoatLink`."""
        return _told(self._link.measure)

    def status(self) -> BoatStatus:
        """See `BoatLink`."""
        return _told(self._link.status)

    def stop(self) -> None:
        """See `BoatLink`."""
        _told(self._link.stop)

    def close(self) -> None:
        """See `BoatLink`."""
        with suppress(OSError):
            self._link.close()


def _told(call: Callable[[], _T]) -> _T:
    try:
        return call()
    except OSError as error:
        raise LinkError(f"The boat's link fails: {error}.") from error
