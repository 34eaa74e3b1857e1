"""A boat link that reports every failure as a `LinkError`, whatever fails below it."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from contextlib import suppress
from functools import partial
from typing import TypeVar

from grebe.core.errors import LinkError
from grebe.links.base import BoatStatus, Observation, Order
from grebe.links.forwarding import ForwardingLink

_T = TypeVar("_T")


class CheckedLink(ForwardingLink):
    """A link that turns an `OSError` into a `LinkError`. `close` suppresses it instead, for a link
    that is already broken cannot be left in better order.
    """

    def observe(self) -> Observation:
        """See `BoatLink`."""
        return _checked(super().observe)

    def command(self, order: Order) -> None:
        """See `BoatLink`."""
        _checked(partial(super().command, order))

    def measure(self) -> Mapping[str, float]:
        """See `BoatLink`."""
        return _checked(super().measure)

    def status(self) -> BoatStatus:
        """See `BoatLink`."""
        return _checked(super().status)

    def stop(self) -> None:
        """See `BoatLink`."""
        _checked(super().stop)

    def close(self) -> None:
        """See `BoatLink`."""
        with suppress(OSError):
            super().close()


def _checked(call: Callable[[], _T]) -> _T:
    try:
        return call()
    except OSError as error:
        raise LinkError(f"The boat's link fails: {error}.") from error
