"""How a boat is stopped by somebody else, when the mission that steers it has died or hangs.

A link that has such a way says so in its `emergency`; a process of its own is then told what to do
before the boat moves, and does it without the mission's memory, sockets or locks. So a stop is a
function by its name, and the plain values that it is called with.
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
    """`action`, as "package.module:function" or "FILE.py:function", is called with `settings`.

    It opens what it needs, takes all thrust away, and returns once that is done; where it raises
    it is called again. Settings must be JSON. `patience_s` is the longest silence of the mission
    [s] that is none of the boat's business: longer than its slowest step and its disk.
    """

    action: str
    settings: Mapping[str, Plain] = field(default_factory=dict[str, Plain])
    patience_s: float = 2.0

    def __post_init__(self) -> None:
        home, colon, name = self.action.rpartition(":")
        if not (home and colon and name.isidentifier()):
            raise LinkError(
                f"An emergency stop is MODULE:FUNCTION or FILE.py:FUNCTION, not {self.action!r}."
            )
        if not self.patience_s > 0:
            raise LinkError(f"A watchdog cannot be patient for {self.patience_s} s; give more.")
        try:
            json.dumps(dict(self.settings))
        except TypeError:
            raise LinkError(
                "The settings of an emergency stop must be plain: texts, numbers, true and false."
            ) from None


@runtime_checkable
class StopsInEmergency(Protocol):
    """A link that somebody else can stop the boat of; None where this one cannot."""

    @property
    def emergency(self) -> EmergencyStop | None:
        """How the boat is stopped without the mission."""
        ...


def emergency_of(link: object) -> EmergencyStop | None:
    """How a link's boat is stopped without the mission; None where nobody else can."""
    return link.emergency if isinstance(link, StopsInEmergency) else None
