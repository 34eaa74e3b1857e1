"""What a mission says, dated: each event by UTC and by the seconds since the link opened."""

from __future__ import annotations

from collections.abc import Sequence
from datetime import datetime, timedelta
from typing import Any

from grebe.core.events import Ended, EndReason, MissionEvent, SafetyChanged
from grebe.mission.telling.broadcast import Broadcast
from grebe.mission.telling.recorders import Listener, Recorder


class Announcer:
    """Dates a mission's events and passes them on; `started` is the UTC time of the link's second
    zero.
    """

    def __init__(
        self, recorder: Recorder, listeners: Sequence[Listener], started: datetime
    ) -> None:
        self._broadcast = Broadcast(recorder, listeners)
        self._started = started

    def time_at(self, time_s: float) -> datetime:
        """The UTC time of a second of the link."""
        return self._started + timedelta(seconds=time_s)

    def tell(self, kind: type[MissionEvent], time_s: float, **what: Any) -> None:
        """Say what happened, to be kept and told with the next `release`."""
        self._broadcast.hold(kind(time=self.time_at(time_s), elapsed_s=time_s, **what))

    def change(self, time_s: float, **what: str) -> None:
        """Say that the guard changed what the boat does."""
        self.tell(SafetyChanged, time_s, **what)

    def release(self) -> None:
        """Keep and tell what was said."""
        self._broadcast.release()

    def end(self, time_s: float, reason: EndReason, message: str, *, quietly: bool) -> None:
        """Say that the mission is over, and wait until all is kept; `quietly` where the recorder
        itself may be what failed.
        """
        try:
            self.tell(Ended, time_s, reason=reason, message=message)
            self._broadcast.close()
        except Exception:
            if not quietly:
                raise
