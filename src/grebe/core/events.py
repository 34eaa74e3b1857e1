"""What a mission writes down beside its samples: the track, and what happened."""

from __future__ import annotations

from dataclasses import dataclass
from datetime import datetime
from typing import Literal

EventLevel = Literal["info", "warning", "error"]


@dataclass(frozen=True, kw_only=True)
class TrackPoint:
    """The boat where it is told something, and what it is told to do from there on."""

    time: datetime
    state: tuple[float, float, float, float, float, float]
    thrusts: tuple[float, float]
    target_seq: int | None = None
    split_stage: int | None = None
    solve_ms: float | None = None
    status: str = ""
    current_north_mps: float | None = None
    current_east_mps: float | None = None


@dataclass(frozen=True, kw_only=True)
class Event:
    """Something that an operator or a reader of the data should know."""

    time: datetime
    level: EventLevel
    code: str
    message: str
