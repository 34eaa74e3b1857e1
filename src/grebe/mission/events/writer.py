"""A thread that writes the events of a mission to disk while the boat is steered.

The card of a small computer writes in a few milliseconds, and now and then takes half a second. The
loop waits for the former but not for the latter. Events reach the listeners only once they are
stored, and events that have gathered meanwhile are stored together.
"""

from __future__ import annotations

import threading
from collections.abc import Sequence

from grebe.core.events import MissionEvent
from grebe.mission.events.recorders import TransactionalRecorder

# How long the loop waits for the disk at each estimate [s]; usually long enough.
TIMEOUT_S = 0.03
# With this many unstored events, some 10 s of them, the loop waits for the disk after all.
MOST_BEHIND = 500


class Writer:
    """Stores events in order, in a thread that ends with `finish`."""

    def __init__(self, recorder: TransactionalRecorder) -> None:
        self._recorder = recorder
        self._changed = threading.Condition()
        self._waiting: list[MissionEvent] = []
        self._kept: list[MissionEvent] = []
        self._busy = False
        self._ends = False
        self._failure: Exception | None = None
        self._thread: threading.Thread | None = None

    def keep(self, events: Sequence[MissionEvent]) -> list[MissionEvent]:
        """Hand over events; return those stored since the last call, including earlier ones.

        Raises what the recorder has raised. The events that it was given, and those waiting then,
        are not stored.
        """
        with self._changed:
            self._waiting += events
            if self._waiting and self._thread is None:
                self._thread = threading.Thread(target=self._work, daemon=True)
                self._thread.start()
            self._changed.notify_all()
            self._changed.wait_for(self._is_idle, TIMEOUT_S)
            self._changed.wait_for(lambda: len(self._waiting) < MOST_BEHIND)
            return self._taken()

    def finish(self) -> list[MissionEvent]:
        """Wait until all events are stored, and end the thread; see `keep`."""
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
