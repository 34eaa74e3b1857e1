"""What a mission says as it goes: a stream of typed events, and what is kept of them as a log.

Whoever wants to know what happens listens: the survey file, the progress bar, a page, a fleet.
Events are plain frozen records; `time` is UTC, `elapsed_s` the boat's time since the mission
began.
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
EventLevel = Literal["info", "warning", "error"]


class EndReason(enum.Enum):
    """Why a mission ended; the value is the code of its entry in the log."""

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
    """What all events have: when it was."""

    time: datetime
    elapsed_s: float


@dataclass(frozen=True, kw_only=True)
class Started(MissionEvent):
    """The first usable estimate has come, and the mission begins or goes on."""

    targets: int
    reached: int


@dataclass(frozen=True, kw_only=True)
class Estimate(MissionEvent):
    """A usable state estimate (6,), its heading unwrapped, and the weather that explains it."""

    state: State
    weather: Weather


@dataclass(frozen=True, kw_only=True)
class Step(MissionEvent):
    """The boat is told something: the state it is told from, and the thrusts [N] from here on.

    `solve_ms` is None where the thrusts change within a plan that was made before.
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
    """The horizon that a step planned: `after_s` (N+1,) seconds from now, `states` (N+1, 6),
    `thrusts` (N, 2) [N].
    """

    after_s: NDArray[np.float64]
    states: NDArray[np.float64]
    thrusts: NDArray[np.float64]


@dataclass(frozen=True, kw_only=True)
class SampleTaken(MissionEvent):
    """The sonde was read, and the reading is kept."""

    sample: Sample


@dataclass(frozen=True, kw_only=True)
class Reached(MissionEvent):
    """A target set was entered; `count` sets are reached now."""

    target_seq: int
    count: int


@dataclass(frozen=True, kw_only=True)
class Warned(MissionEvent):
    """Something that an operator or a reader of the data should know."""

    code: str
    message: str


@dataclass(frozen=True, kw_only=True)
class SafetyChanged(MissionEvent):
    """The boat does something else from here on, for its safety: the states before and after in
    their words, the code of the cause, and a sentence.
    """

    before: str
    after: str
    code: str
    message: str


@dataclass(frozen=True, kw_only=True)
class Revised(MissionEvent):
    """The rest of the order has been planned anew: the plan from here on, and how many `more`
    targets the mission has by it (fewer: negative).
    """

    revision: PlanRevision
    more: int


@dataclass(frozen=True, kw_only=True)
class Ended(MissionEvent):
    """The mission is over, and why."""

    reason: EndReason
    message: str


@dataclass(frozen=True, kw_only=True)
class LogEntry:
    """What the survey file keeps of an event that is neither track nor sample."""

    time: datetime
    level: EventLevel
    code: str
    message: str


def log_entry(event: MissionEvent) -> LogEntry | None:
    """Return the entry that the log keeps of an event; None where the log keeps nothing of it."""
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
