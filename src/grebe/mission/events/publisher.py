"""Dates the events of a mission in UTC and in seconds since the link opened."""

from __future__ import annotations

from collections.abc import Sequence
from datetime import datetime, timedelta
from typing import Any

from grebe.core.events import Ended, EndReason, MissionEvent, SafetyChanged
from grebe.mission.events.broadcast import Broadcast
from grebe.mission.events.recorders import Listener, Recorder


class Publisher:
    """Dates the events of a mission and passes them on; `started` is the UTC time of the link's
    second zero.
    """

    def __init__(
        self, recorder: Recorder, listeners: Sequence[Listener], started: datetime
    ) -> None:
        self._broadcast = Broadcast(recorder, listeners)
        self._started = started

    def time_at(self, time_s: float) -> datetime:
        """Return the UTC time of a second of the link."""
        return self._started + timedelta(seconds=time_s)

    def publish(self, kind: type[MissionEvent], time_s: float, **fields: Any) -> None:
        """Hold an event, which is stored and passed on with the next `release`."""
        self._broadcast.hold(kind(time=self.time_at(time_s), elapsed_s=time_s, **fields))

    def publish_safety(self, time_s: float, **fields: str) -> None:
        """Report that the guard changed what the boat does."""
        self.publish(SafetyChanged, time_s, **fields)

    def release(self) -> None:
        """Store the held events and pass them on."""
        self._broadcast.release()

    def end(self, time_s: float, reason: EndReason, message: str, *, quietly: bool) -> None:
        """Report the end of the mission, and wait until everything is stored; `quietly` if the
        recorder itself may have failed.
        """
        try:
            self.publish(Ended, time_s, reason=reason, message=message)
            self._broadcast.close()
        except Exception:
            if not quietly:
                raise
