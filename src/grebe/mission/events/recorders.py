"""The receivers of a mission's events: the survey file, a list in memory, and listeners.

A recorder stores what the mission found, and the mission ends if it cannot. A listener only
watches: if one fails it is dropped and the mission continues, because no display may stop a boat.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from contextlib import AbstractContextManager
from dataclasses import replace
from typing import Any, Protocol, TypeVar, runtime_checkable

from grebe.core.events import (
    Estimate,
    MissionEvent,
    Prediction,
    Reached,
    Revised,
    SampleTaken,
    Step,
    Warned,
    log_entry,
)
from grebe.io.store import SurveyFile

E = TypeVar("E", bound=MissionEvent)
Listener = Callable[[MissionEvent], None]


class Recorder(Protocol):
    """Stores a mission's events; an event is stored for good once `record` has returned."""

    def record(self, event: MissionEvent) -> None:
        """Store one event."""
        ...


@runtime_checkable
class TransactionalRecorder(Recorder, Protocol):
    """A recorder that can store the events of one estimate together: all or none."""

    def record_together(self, events: Sequence[MissionEvent]) -> Sequence[MissionEvent]:
        """Store events, all or none; return further events that this caused."""
        ...


class SurveyRecorder:
    """Writes a mission into its survey file: an event is on the disk once its call has returned.

    The events of one estimate are one transaction, so samples, reached targets and the track agree
    wherever the mission is cut off, and the disk is waited for only once. In a fleet each `boat`
    has its own recorder, which adds the boat's number to the log.
    """

    def __init__(self, survey_file: SurveyFile, boat: int | None = None) -> None:
        self._file = survey_file
        self._boat = boat

    def record(self, event: MissionEvent) -> None:
        """See `Recorder`."""
        self.record_together([event])

    def record_together(self, events: Sequence[MissionEvent]) -> Sequence[MissionEvent]:
        """See `TransactionalRecorder`."""
        worth = [event for event in events if not isinstance(event, Estimate | Prediction)]
        if not worth:
            return ()
        with self._file.together():
            for event in worth:
                self._write(event)
        last = worth[-1]
        said = self._file.stay_safe(last.time)
        if not said:
            return ()
        code = "file_replaced"
        return (Warned(time=last.time, elapsed_s=last.elapsed_s, code=code, message=said),)

    def _write(self, event: MissionEvent) -> None:
        match event:
            case Step():
                self._file.append_track(event, self._boat or 1)
            case SampleTaken():
                self._file.append_samples([event.sample], self._boat or 1)
            case Revised():
                # In a fleet it was stored when it was made, because all boats share the plan.
                if event.revision.number > self._file.revision.number:
                    self._file.append_revision(event.revision)
            case Reached():
                self._file.mark_reached(event.target_seq, event.time)
            case _:
                pass
        entry = log_entry(event)
        if entry is not None:
            whose = "" if self._boat is None else f"boat {self._boat}: "
            self._file.append_event(replace(entry, message=whose + entry.message))


class SharedRecorder:
    """One of several recorders that write one file, each from its own thread."""

    def __init__(self, recorder: SurveyRecorder, lock: AbstractContextManager[Any]) -> None:
        self._recorder, self._lock = recorder, lock

    def record(self, event: MissionEvent) -> None:
        """See `Recorder`."""
        self.record_together([event])

    def record_together(self, events: Sequence[MissionEvent]) -> Sequence[MissionEvent]:
        """See `TransactionalRecorder`."""
        with self._lock:
            return self._recorder.record_together(events)


class MemoryRecorder:
    """Stores all events in a list, in order."""

    def __init__(self) -> None:
        self.events: list[MissionEvent] = []

    def record(self, event: MissionEvent) -> None:
        """See `Recorder`."""
        self.events.append(event)

    def of(self, kind: type[E]) -> list[E]:
        """Return the events of one kind."""
        return [event for event in self.events if isinstance(event, kind)]
