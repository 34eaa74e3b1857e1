"""The events that a mission emits, and the log entries made from them.

The survey file, the progress bar, a page and a fleet listen to them. Events are plain frozen
records; `time` is UTC, `elapsed_s` the boat's time since the mission began.
"""

from __future__ import annotations

import enum
from dataclasses import dataclass
from datetime import datetime
from typing import TYPE_CHECKING, Literal

from grebe.core.dynamics import Weather
from grebe.core.revision import PlanRevision
from grebe.core.samples import Sample

if TYPE_CHECKING:
    import numpy as np
    from numpy.typing import NDArray

State = tuple[float, float, float, float, float, float]
Thrusts = tuple[float, float]
EventLevel = Literal["info", "warning", "error"]


class EndReason(enum.Enum):
    """Reason for a mission's end; the value is the code of its log entry."""

    COMPLETE = "mission_complete"
    TARGET_GIVEN_UP = "target_not_reached"
    OUT_OF_TIME = "out_of_time"
    STOPPED = "stopped_by_operator"
    LINK_LOST = "link_lost"
    CAME_HOME = "came_home"
    HOME_NOT_REACHED = "home_not_reached"
    FENCE_NOT_KEPT = "fence_not_kept"
    BLIND = "blind"
    STUCK = "stuck"
    GROUNDED = "grounded"
    THRUSTER_DEAD = "thruster_dead"
    CURRENT_TOO_STRONG = "current_beyond_reach"
    FAILED = "mission_failed"


@dataclass(frozen=True, kw_only=True)
class MissionEvent:
    """Base of all events, with their time."""

    time: datetime
    elapsed_s: float


@dataclass(frozen=True, kw_only=True)
class Started(MissionEvent):
    """The first usable estimate has arrived: the mission begins or resumes."""

    targets: int
    reached: int


@dataclass(frozen=True, kw_only=True)
class Estimate(MissionEvent):
    """A usable state estimate (6,), its heading unwrapped, and the estimated weather."""

    state: State
    weather: Weather


@dataclass(frozen=True, kw_only=True)
class Step(MissionEvent):
    """A command to the boat: the state it was computed from, and the thrusts [N] from now on.

    `solve_ms` is None if the thrusts change within a plan that was made before.
    """

    state: State
    thrusts: tuple[float, float]
    target_seq: int | None = None
    split_stage: int | None = None
    solve_ms: float | None = None
    status: str = ""
    solved: bool = True
    current_north_mps: float | None = None
    current_east_mps: float | None = None


@dataclass(frozen=True, kw_only=True)
class Prediction(MissionEvent):
    """The planned horizon of a step.

    `after_s` (N+1,) seconds from now, `states` (N+1, 6), `thrusts` (N, 2) [N].
    """

    after_s: NDArray[np.float64]
    states: NDArray[np.float64]
    thrusts: NDArray[np.float64]


@dataclass(frozen=True, kw_only=True)
class SampleTaken(MissionEvent):
    """The sonde was read, and the reading is stored."""

    sample: Sample


@dataclass(frozen=True, kw_only=True)
class Reached(MissionEvent):
    """A target set was entered; `count` sets have now been reached."""

    target_seq: int
    count: int


@dataclass(frozen=True, kw_only=True)
class Warned(MissionEvent):
    """A warning to the operator, or to a reader of the data."""

    code: str
    message: str


@dataclass(frozen=True, kw_only=True)
class SafetyChanged(MissionEvent):
    """The boat changes its behaviour for its safety.

    `before` and `after` name the two states; `code` and `message` give the cause.
    """

    before: str
    after: str
    code: str
    message: str


@dataclass(frozen=True, kw_only=True)
class Revised(MissionEvent):
    """The rest of the order has been replanned.

    `revision` is the plan from now on, `more` the number of targets added (negative if fewer).
    """

    revision: PlanRevision
    more: int


@dataclass(frozen=True, kw_only=True)
class Ended(MissionEvent):
    """The end of the mission, with its reason."""

    reason: EndReason
    message: str


@dataclass(frozen=True, kw_only=True)
class LogEntry:
    """The survey file's record of an event that is neither track nor sample."""

    time: datetime
    level: EventLevel
    code: str
    message: str


def log_entry(event: MissionEvent) -> LogEntry | None:
    """Return the log entry of an event; None if the event is not logged."""
    match event:
        case Started():
            again = f", {event.reached} reached before" if event.reached else ""
            return _entry(event, "info", "mission_started", f"{event.targets} targets{again}")
        case Warned():
            return _entry(event, "warning", event.code, event.message)
        case SafetyChanged():
            text = f"{event.before} -> {event.after}: {event.message}"
            level = "info" if event.after == "surveying" else "warning"
            return _entry(event, level, event.code, text)
        case Step(solved=False):
            return _entry(event, "warning", "step_unsolved", event.status)
        case Ended():
            level = "info" if event.reason is EndReason.COMPLETE else "error"
            return _entry(event, level, event.reason.value, event.message)
        case _:
            return None


def _entry(event: MissionEvent, level: EventLevel, code: str, message: str) -> LogEntry:
    return LogEntry(time=event.time, level=level, code=code, message=message)
