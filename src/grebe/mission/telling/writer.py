"""The disk's own thread: a mission's events are kept while the boat is steered on.

A card in a small computer writes in a few milliseconds, and now and then takes half a second. The
loop waits for the first and not for the second: what was said to be kept is kept, what is not kept
yet is not said yet, and what has gathered meanwhile is kept in one go.
"""

from __future__ import annotations

import threading
from collections.abc import Sequence

from grebe.core.events import MissionEvent
from grebe.mission.telling.recorders import KeepsTogether

# How long the loop waits for the disk at each estimate [s]: as a rule long enough.
PATIENCE_S = 0.03
# So many events not kept yet are too many: the loop waits for the disk after all. Some 10 s.
MOST_BEHIND = 500


class Writer:
    """Keeps events in their order, in a thread that ends with `finish`."""

    def __init__(self, recorder: KeepsTogether) -> None:
        self._recorder = recorder
        self._changed = threading.Condition()
        self._waiting: list[MissionEvent] = []
        self._kept: list[MissionEvent] = []
        self._busy = False
        self._ends = False
        self._failure: Exception | None = None
        self._thread: threading.Thread | None = None

    def keep(self, events: Sequence[MissionEvent]) -> list[MissionEvent]:
        """Hand over events; return those that are kept by now, not only of these.

        What the recorder raised is raised here: the events that it was given, and those that were
        waiting, are not kept.
        """
        with self._changed:
            self._waiting += events
            if self._waiting and self._thread is None:
                self._thread = threading.Thread(target=self._work, daemon=True)
                self._thread.start()
            self._changed.notify_all()
            self._changed.wait_for(self._is_idle, PATIENCE_S)
            self._changed.wait_for(lambda: len(self._waiting) < MOST_BEHIND)
            return self._taken()

    def finish(self) -> list[MissionEvent]:
        """Wait until all is kept, and end the thread; see `keep`."""
        with self._changed:
            self._changed.wait_for(self._is_idle)
            self._ends = True
            self._changed.notify_all()
        if self._thread is not None:
            self._thread.join()
            self._thread = None
        self._ends = False
        return self._taken()

    def _is_idle(self) -> bool:
        return not self._waiting and not self._busy

    def _taken(self) -> list[MissionEvent]:
        failure, self._failure = self._failure, None
        if failure is not None:
            raise failure
        kept, self._kept = self._kept, []
        return kept

    def _work(self) -> None:
        while True:
            with self._changed:
                self._changed.wait_for(lambda: self._waiting or self._ends)
                if not self._waiting:
                    return
                events, self._waiting, self._busy = self._waiting, [], True
            more: Sequence[MissionEvent] = ()
            failure: Exception | None = None
            try:
                more = self._recorder.record_together(events)
            except Exception as error:
                failure = error
            with self._changed:
                self._busy = False
                if failure is None:
                    self._kept += [*events, *more]
                else:
                    self._failure = failure
                    self._waiting = []
                self._changed.notify_all()
