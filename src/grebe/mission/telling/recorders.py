"""Who listens to a mission: the survey file, a list in memory, and whoever else wants to know.

A recorder keeps what the mission found, and the mission ends when it cannot. A listener only
watches: one that fails is dropped, and the mission goes on, for no display may stop a boat.
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
    """Keeps a mission's events; what `record` returned from is kept for good."""

    def record(self, event: MissionEvent) -> None:
        """Keep one event."""
        ...


@runtime_checkable
class KeepsTogether(Recorder, Protocol):
    """A recorder that can keep all that happened at one estimate, or nothing of it."""

    def record_together(self, events: Sequence[MissionEvent]) -> Sequence[MissionEvent]:
        """Keep events, all or none; return what keeping them gave rise to, which is kept too."""
        ...


class SurveyRecorder:
    """Writes a mission into its survey file: each event is on the disk before the next estimate.

    What happened at one estimate is one transaction: a sample, what was reached and the track
    agree wherever the mission is cut off, and the disk is waited for once. Of a fleet each `boat`
    has its own, and says its number in the log.
    """

    def __init__(self, survey_file: SurveyFile, boat: int | None = None) -> None:
        self._file = survey_file
        self._boat = boat

    def record(self, event: MissionEvent) -> None:
        """See `Recorder`."""
        self.record_together([event])

    def record_together(self, events: Sequence[MissionEvent]) -> Sequence[MissionEvent]:
        """See `KeepsTogether`."""
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
                # Of a fleet it was kept when it was made, for all boats share the plan.
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
    """One of several recorders that write one file, each from a thread of its own."""

    def __init__(self, recorder: SurveyRecorder, lock: AbstractContextManager[Any]) -> None:
        self._recorder, self._lock = recorder, lock

    def record(self, event: MissionEvent) -> None:
        """See `Recorder`."""
        self.record_together([event])

    def record_together(self, events: Sequence[MissionEvent]) -> Sequence[MissionEvent]:
        """See `KeepsTogether`."""
        with self._lock:
            return self._recorder.record_together(events)


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
