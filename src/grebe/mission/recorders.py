"""Who listens to a mission: the survey file, a list in memory, and whoever else wants to know.

A recorder keeps what the mission found, and the mission ends when it cannot. A listener only
watches: one that fails is dropped, and the mission goes on, for no display may stop a boat.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from typing import Protocol, TypeVar

from grebe.core.events import (
    Estimate,
    MissionEvent,
    Prediction,
    Reached,
    SampleTaken,
    Step,
    log_entry,
)
from grebe.io.store import SurveyFile

E = TypeVar("E", bound=MissionEvent)
Listener = Callable[[MissionEvent], None]


class Recorder(Protocol):
    """Keeps a mission's events; what `record` returned from is kept for good."""

    def record(self, event: MissionEvent) -> None:
        """Keep one event."""
        ...


class SurveyRecorder:
    """Writes a mission into its survey file: each event is on the disk before the next step."""

    def __init__(self, survey_file: SurveyFile) -> None:
        self._file = survey_file

    def record(self, event: MissionEvent) -> None:
        """See `Recorder`."""
        match event:
            case Step():
                self._file.append_track(event)
            case SampleTaken():
                self._file.append_samples([event.sample])
            case Reached():
                self._file.mark_reached(event.target_seq, event.time)
            case Estimate() | Prediction():
                return
            case _:
                pass
        entry = log_entry(event)
        if entry is not None:
            self._file.append_event(entry)


class MemoryRecorder:
    """Keeps every event in a list, in their order."""

    def __init__(self) -> None:
        self.events: list[MissionEvent] = []

    def record(self, event: MissionEvent) -> None:
        """See `Recorder`."""
        self.events.append(event)

    def of(self, kind: type[E]) -> list[E]:
        """Return the events of one kind."""
        return [event for event in self.events if isinstance(event, kind)]


class Broadcast:
    """One recorder and any number of listeners behind the recorder's page."""

    def __init__(self, recorder: Recorder, listeners: Sequence[Listener] = ()) -> None:
        self._recorder = recorder
        self._listeners = list(listeners)

    def record(self, event: MissionEvent) -> None:
        """Keep an event, then tell it to all who listen."""
        self._recorder.record(event)
        for listener in tuple(self._listeners):
            try:
                listener(event)
            except Exception:
                self._listeners.remove(listener)
