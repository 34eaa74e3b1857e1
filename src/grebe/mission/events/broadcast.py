"""Passes the events of a mission to one recorder and any number of listeners."""

from __future__ import annotations

from collections.abc import Sequence

from grebe.core.events import MissionEvent, Warned
from grebe.mission.events.recorders import Listener, Recorder, TransactionalRecorder
from grebe.mission.events.writer import Writer


class Broadcast:
    """Passes events to one recorder and any number of listeners.

    Events are held while the loop decides what the boat does, and released after its command.
    """

    def __init__(self, recorder: Recorder, listeners: Sequence[Listener] = ()) -> None:
        self._recorder = recorder
        self._writer = Writer(recorder) if isinstance(recorder, TransactionalRecorder) else None
        self._listeners = list(listeners)
        self._held: list[MissionEvent] = []

    def hold(self, event: MissionEvent) -> None:
        """Hold an event, which is stored and passed on with the next `release`."""
        self._held.append(event)

    def release(self) -> None:
        """Store the held events, then pass the stored ones to all listeners.

        Events that cannot be stored are not held any longer: a second attempt might store some of
        them twice.
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
        """Release the held events, and wait until all are stored and passed on."""
        self.release()
        if self._writer is not None:
            for event in self._writer.finish():
                self._announce(event)

    def _announce(self, event: MissionEvent) -> None:
        """Pass an event to the listeners. One that fails is dropped, which is recorded."""
        for listener in tuple(self._listeners):
            try:
                listener(event)
            except Exception as error:
                self._listeners.remove(listener)
                text = (
                    f"a listener failed and gets no more events ({type(error).__name__}: {error})"
                )
                self.hold(
                    Warned(
                        time=event.time,
                        elapsed_s=event.elapsed_s,
                        code="listener_dropped",
                        message=text,
                    )
                )
