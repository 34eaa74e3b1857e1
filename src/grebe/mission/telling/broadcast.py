"""Passes the events of a mission to one recorder and any number of listeners."""

from __future__ import annotations

from collections.abc import Sequence

from grebe.core.events import MissionEvent, Warned
from grebe.mission.telling.recorders import KeepsTogether, Listener, Recorder
from grebe.mission.telling.writer import Writer


class Broadcast:
    """One recorder and any number of listeners.

    Events are held while the loop decides what the boat is to do, and released once it is told.
    """

    def __init__(self, recorder: Recorder, listeners: Sequence[Listener] = ()) -> None:
        self._recorder = recorder
        self._writer = Writer(recorder) if isinstance(recorder, KeepsTogether) else None
        self._listeners = list(listeners)
        self._held: list[MissionEvent] = []

    def hold(self, event: MissionEvent) -> None:
        """Take an event, to be kept and told with the next `release`."""
        self._held.append(event)

    def release(self) -> None:
        """Keep what is held, then tell what is kept to all who listen.

        It is held no longer where keeping fails: what is tried again might be kept twice.
        """
        events, self._held = self._held, []
        if self._writer is not None:
            for event in self._writer.keep(events):
                self._announce(event)
            return
        for event in events:
            self._recorder.record(event)
            self._announce(event)

    def close(self) -> None:
        """Release what is held, and wait until all of it is kept and told."""
        self.release()
        if self._writer is not None:
            for event in self._writer.finish():
                self._announce(event)

    def _announce(self, event: MissionEvent) -> None:
        """Tell an event; who fails to hear it is told no more, which goes to the record."""
        for listener in tuple(self._listeners):
            try:
                listener(event)
            except Exception as error:
                self._listeners.remove(listener)
                text = f"a listener failed and is told no more ({type(error).__name__}: {error})"
                self.hold(
                    Warned(
                        time=event.time,
                        elapsed_s=event.elapsed_s,
                        code="listener_dropped",
                        message=text,
                    )
                )
