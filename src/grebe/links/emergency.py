"""How another process stops a boat when the mission that steers it has died or hangs.

A link that supports this describes it in its `emergency`. Before the boat moves, a separate process
gets this description, and later acts on it without the mission's memory, sockets or locks. A stop
is therefore the name of a function and the plain values for its call.
"""

from __future__ import annotations

import json
from collections.abc import Mapping
from dataclasses import dataclass, field
from typing import Protocol, runtime_checkable

from grebe.core.errors import LinkError

Plain = str | float | bool | None


@dataclass(frozen=True, kw_only=True)
class EmergencyStop:
    """A stop: `action`, "package.module:function" or "FILE.py:function", is called with `settings`.

    The function opens what it needs, removes all thrust, and returns once that is done; if it
    raises an error it is called again. `settings` must be JSON. `patience_s` is the longest silence
    of the mission [s] that does not stop the boat: longer than its slowest step and its disk take.
    """

    action: str
    settings: Mapping[str, Plain] = field(default_factory=dict[str, Plain])
    patience_s: float = 2.0

    def __post_init__(self) -> None:
        home, colon, name = self.action.rpartition(":")
        if not (home and colon and name.isidentifier()):
            raise LinkError(
                "An emergency stop must be MODULE:FUNCTION or FILE.py:FUNCTION, not "
                f"{self.action!r}."
            )
        if not self.patience_s > 0:
            raise LinkError(f"A watchdog cannot wait {self.patience_s} s; give more than 0.")
        try:
            json.dumps(dict(self.settings))
        except TypeError:
            raise LinkError(
                "The settings of an emergency stop must be texts, numbers, true or false."
            ) from None


@runtime_checkable
class StopsInEmergency(Protocol):
    """A link whose boat another process may be able to stop."""

    @property
    def emergency(self) -> EmergencyStop | None:
        """How the boat is stopped without the mission; None if it cannot be."""
        ...


def emergency_of(link: object) -> EmergencyStop | None:
    """Return how a link's boat is stopped without the mission; None if it cannot be."""
    return link.emergency if isinstance(link, StopsInEmergency) else None
