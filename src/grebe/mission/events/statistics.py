"""Listeners that summarize a mission, or report its progress and warnings."""

from __future__ import annotations

import math
from array import array
from collections.abc import Callable
from dataclasses import asdict, dataclass
from typing import Any

import numpy as np

from grebe.core.dynamics import drive_power_w
from grebe.core.events import (
    Ended,
    EndReason,
    Estimate,
    MissionEvent,
    Reached,
    Revised,
    SampleTaken,
    Started,
    Step,
    Warned,
)
from grebe.core.vessel import Vessel


@dataclass(frozen=True, kw_only=True)
class MissionReport:
    """A mission's summary; times are by the boat's clock, except the controller's `step_ms`.

    `samples` counts all readings kept, and `samples_in_sets` those within a target set and its
    speed window. `ended` says why the mission ended; None if there was nothing left to do.
    """

    reached: int
    targets: int
    steps: int
    duration_s: float
    path_m: float
    energy_wh: float
    unsolved_steps: int
    step_ms_median: float
    step_ms_p95: float
    samples: int
    samples_in_sets: int
    ended: EndReason | None
    message: str

    @property
    def complete(self) -> bool:
        """Whether every target was reached."""
        return self.reached == self.targets

    def numbers(self) -> dict[str, Any]:
        """Return the report as plain values, by name."""
        return asdict(self) | {"ended": None if self.ended is None else self.ended.value}


class Statistics:
    """A listener that summarizes a mission."""

    def __init__(self, vessel: Vessel, targets: int, reached: int) -> None:
        self._vessel = vessel
        self._targets = targets
        self._reached = reached
        self._path_m = self._energy_wh = self._duration_s = 0.0
        self._step_ms = array("d")  # some 2 MB in eight hours at 10 Hz
        self._unsolved = self._samples = self._in_sets = 0
        self._before: Estimate | None = None
        self._thrusts = (0.0, 0.0)
        self._end: Ended | None = None

    def __call__(self, event: MissionEvent) -> None:
        """Take one event into account."""
        match event:
            case Estimate():
                self._travel(event)
            case Step():
                self._thrusts = event.thrusts
                if event.solve_ms is not None:
                    self._step_ms.append(event.solve_ms)
                    self._unsolved += not event.solved
            case SampleTaken():
                self._samples += 1
                self._in_sets += event.sample.target_seq is not None
            case Reached():
                self._reached = event.count
            case Revised():
                self._targets += event.more
            case Ended():
                self._end = event
            case _:
                pass

    def _travel(self, now: Estimate) -> None:
        before, self._before = self._before, now
        if before is None:
            return
        seconds = now.elapsed_s - before.elapsed_s
        self._duration_s += seconds
        self._path_m += math.hypot(now.state[0] - before.state[0], now.state[1] - before.state[1])
        power = drive_power_w(self._vessel, self._thrusts, before.state[3])
        self._energy_wh += power * seconds / 3600

    def report(self) -> MissionReport:
        """Return the summary so far."""
        step_ms = np.array(self._step_ms or [0.0])
        return MissionReport(
            reached=self._reached,
            targets=self._targets,
            steps=len(self._step_ms),
            duration_s=round(self._duration_s, 3),
            path_m=round(self._path_m, 2),
            energy_wh=round(self._energy_wh, 3),
            unsolved_steps=self._unsolved,
            step_ms_median=round(float(np.median(step_ms)), 3),
            step_ms_p95=round(float(np.percentile(step_ms, 95)), 3),
            samples=self._samples,
            samples_in_sets=self._in_sets,
            ended=None if self._end is None else self._end.reason,
            message=self._message(),
        )

    def _message(self) -> str:
        """Return why the mission ended, in words, or that there was nothing left to do."""
        if self._end is not None:
            return self._end.message
        idle = self._reached == self._targets and not self._step_ms
        return "nothing was left to do: every target had already been reached" if idle else ""


@dataclass(frozen=True, kw_only=True)
class Progress:
    """The progress of a mission."""

    reached: int
    targets: int
    boat_time_s: float
    samples: int


class Alarm:
    """A listener that passes warnings to `say`, each code at most once in `every_s` [s]."""

    def __init__(self, say: Callable[[str], None], every_s: float = 30.0) -> None:
        self._say = say
        self._every_s = every_s
        self._said_at: dict[str, float] = {}

    def __call__(self, event: MissionEvent) -> None:
        """Pass on one event if it is a warning that is due."""
        if not isinstance(event, Warned):
            return
        before = self._said_at.get(event.code, -math.inf)
        if event.elapsed_s - before >= self._every_s:
            self._said_at[event.code] = event.elapsed_s
            self._say(f"warning: {event.message}")


class ProgressMeter:
    """A listener that calls `watch` with the progress at each control step and arrival."""

    def __init__(self, watch: Callable[[Progress], None]) -> None:
        self._targets = self._reached = self._samples = 0
        self._watch = watch

    def __call__(self, event: MissionEvent) -> None:
        """Take one event into account."""
        match event:
            case Started():
                self._targets, self._reached = event.targets, event.reached
                return
            case Revised():
                self._targets += event.more
                return
            case SampleTaken():
                self._samples += 1
                return
            case Reached():
                self._reached = event.count
            case Step() if event.solve_ms is not None:
                pass
            case _:
                return
        self._watch(
            Progress(
                reached=self._reached,
                targets=self._targets,
                boat_time_s=event.elapsed_s,
                samples=self._samples,
            )
        )
