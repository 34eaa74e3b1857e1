"""The mission: observe, decide, command, measure, record - until every set is reached.

One loop joins controller, boat and survey file. Every state estimate is tested for entry
(Definition 5) and for a sample; every control step asks the controller for thrusts. What
is measured is on the disk before the loop goes on, so a mission can be cut off anywhere
and resumed.
"""

from __future__ import annotations

import math
import time
from collections.abc import Callable
from dataclasses import dataclass
from datetime import datetime, timedelta

import numpy as np
import shapely

from grebe.control.controller import Command, Controller, StepStatus
from grebe.control.observer import Observer
from grebe.core.dynamics import drive_power_w
from grebe.core.events import Event, EventLevel, TrackPoint
from grebe.core.samples import Sample, gross_range_flag
from grebe.core.survey import Target
from grebe.io.store import SurveyFile
from grebe.links.base import BoatLink, Observation

SAMPLE_PERIOD_S = 1.0
# A target that is not reached within this time, or ten times the straight way at the lowest
# speed of its window, ends the mission as incomplete.
SHORTEST_PATIENCE_S = 180.0
PATIENCE_FACTOR = 10.0
SLOWEST_MPS = 0.2
# Time without a usable estimate after which the thrusters are stopped.
BLIND_S = 1.5


@dataclass(frozen=True, kw_only=True)
class MissionReport:
    """What a mission came to; times are the boat's, `step_ms` the controller's own."""

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

    @property
    def complete(self) -> bool:
        """Whether every target was reached."""
        return self.reached == self.targets


@dataclass(frozen=True, kw_only=True)
class Progress:
    """How far the mission is, for whoever watches."""

    reached: int
    targets: int
    boat_time_s: float
    samples: int


class Mission:
    """Runs one survey with one boat; `run` returns when it is complete or given up."""

    def __init__(
        self,
        survey_file: SurveyFile,
        controller: Controller,
        link: BoatLink,
        started: datetime,
        watch: Callable[[Progress], None] | None = None,
    ) -> None:
        self._file = survey_file
        self._targets = survey_file.survey.targets
        self._controller = controller
        self._link = link
        self._started = started
        self._watch = watch or (lambda _: None)
        self._tree = shapely.STRtree([target.set.polygon for target in self._targets])
        self._statistics = _Statistics()
        self._samples = 0
        self._next_step_s = 0.0
        self._next_sample_s = 0.0
        self._deadline_s = math.inf
        self._observer = Observer(controller.vessel)
        self._before: Observation | None = None
        self._command: tuple[float, Command] | None = None
        self._thrusts = (0.0, 0.0)

    def run(self) -> MissionReport:
        """Steer until every target is reached, or one cannot be; the boat is left at rest."""
        try:
            if not self._controller.done:
                self._loop()
        finally:
            self._link.close()
        return self._statistics.report(
            reached=self._controller.reached, targets=len(self._targets), samples=self._samples
        )

    def _loop(self) -> None:
        observation = self._before = self._observe()
        self._give_patience(observation)
        self._event("info", "mission_started", f"{len(self._targets)} targets", observation)
        while True:
            self._visit(observation)
            if self._controller.done:
                self._event("info", "mission_complete", "every target is reached", observation)
                return
            if observation.time_s > self._deadline_s:
                seq = self._controller.reached + 1
                text = f"target {seq} was not reached in time; the mission ends here"
                self._event("error", "target_not_reached", text, observation)
                return
            if observation.time_s >= self._next_step_s - 1e-9:
                self._steer(observation)
            else:
                self._follow_plan(observation)
            observation = self._advance()

    def _observe(self) -> Observation:
        """The next estimate that can be used.

        What is not a number is reported and passed over; a boat that is blind for longer than
        `BLIND_S` is left without thrust until it sees again.
        """
        while True:
            observation = self._link.observe()
            if all(map(math.isfinite, observation.state)):
                return observation
            text = f"an estimate is not a number and is passed over: {observation.state}"
            self._event("warning", "estimate_invalid", text, observation)
            if self._before and observation.time_s - self._before.time_s > BLIND_S:
                self._thrusts = (0.0, 0.0)
                self._link.command(self._thrusts)

    def _advance(self) -> Observation:
        observation = self._observe()
        if self._before is not None:
            self._statistics.travel(self._controller, self._before, observation, self._thrusts)
            self._observer.update(
                self._before.state,
                self._thrusts,
                observation.state,
                observation.time_s - self._before.time_s,
            )
        self._before = observation
        return observation

    def _visit(self, observation: Observation) -> None:
        """Count what this estimate reaches, and measure where a sample is due."""
        before = self._controller.reached
        reached = self._controller.see(observation.state)
        due = observation.time_s >= self._next_sample_s - 1e-9
        within = [self._targets[before + i] for i in range(reached)]
        if not within and due:
            within = self._containing(observation.state)[:1]
        if within:
            self._measure(observation, within)
            self._next_sample_s = observation.time_s + SAMPLE_PERIOD_S
        for target in self._targets[before : before + reached]:
            self._file.mark_reached(target.seq, self._time(observation))
        if reached:
            self._give_patience(observation)
            self._report_progress(observation)

    def _containing(self, state: tuple[float, ...]) -> list[Target]:
        point = shapely.Point(state[0], state[1])
        places = np.sort(self._tree.query(point)).tolist()
        return [t for t in (self._targets[i] for i in places) if t.set.contains(state)]

    def _measure(self, observation: Observation, targets: list[Target]) -> None:
        """Record a reading once for each target it belongs to (sets may overlap)."""
        reading = dict(self._link.measure())
        if not reading:
            return
        north, east, _, surge, _, _ = observation.state
        flags = {
            key: gross_range_flag(reading.get(key), one.span)
            for key, one in self._file.quantities.items()
        }
        self._file.append_samples(
            [
                Sample(
                    time=self._time(observation),
                    north_m=north,
                    east_m=east,
                    target_seq=target.seq,
                    speed_mps=surge,
                    values=reading,
                    flags=flags,
                )
                for target in targets
            ]
        )
        self._samples += len(targets)

    def _steer(self, observation: Observation) -> None:
        began = time.perf_counter()
        elapsed = None if self._command is None else observation.time_s - self._command[0]
        command = self._controller.step(observation.state, self._observer.weather, elapsed)
        solve_ms = 1e3 * (time.perf_counter() - began)
        self._command = (observation.time_s, command)
        self._apply(observation, command.thrusts_at(0.0), solve_ms)
        if not command.status.is_solved:
            self._event("warning", "step_unsolved", command.status.value, observation)
        self._statistics.step(command.status, solve_ms)
        self._next_step_s = observation.time_s + self._controller.settings.step_s
        self._report_progress(observation)

    def _follow_plan(self, observation: Observation) -> None:
        """Between two control steps: change the thrusts where the plan does."""
        if self._command is None:
            return
        since, command = self._command
        thrusts = command.thrusts_at(observation.time_s - since)
        if thrusts != self._thrusts:
            self._apply(observation, thrusts, None)

    def _apply(
        self, observation: Observation, thrusts: tuple[float, float], solve_ms: float | None
    ) -> None:
        """Send thrusts and record them with the state they are sent from."""
        self._link.command(thrusts)
        self._thrusts = thrusts
        if self._command is None:
            return
        _, command = self._command
        weather = self._observer.weather
        self._file.append_track(
            TrackPoint(
                time=self._time(observation),
                state=observation.state,
                thrusts=thrusts,
                target_seq=self._targets[command.target].seq,
                split_stage=command.split,
                solve_ms=solve_ms,
                status=command.status.value,
                current_north_mps=weather.current_north_mps,
                current_east_mps=weather.current_east_mps,
            )
        )

    def _give_patience(self, observation: Observation) -> None:
        if self._controller.done:
            return
        target = self._targets[self._controller.reached].set
        way = target.footprint_distance(observation.state[0], observation.state[1])
        slowest = max(target.speed_min_mps, SLOWEST_MPS)
        self._deadline_s = observation.time_s + max(
            SHORTEST_PATIENCE_S, PATIENCE_FACTOR * way / slowest
        )

    def _report_progress(self, observation: Observation) -> None:
        self._watch(
            Progress(
                reached=self._controller.reached,
                targets=len(self._targets),
                boat_time_s=observation.time_s,
                samples=self._samples,
            )
        )

    def _time(self, observation: Observation) -> datetime:
        return self._started + timedelta(seconds=observation.time_s)

    def _event(self, level: EventLevel, code: str, message: str, observation: Observation) -> None:
        self._file.append_event(
            Event(time=self._time(observation), level=level, code=code, message=message)
        )


class _Statistics:
    """Sums up a mission as it goes."""

    def __init__(self) -> None:
        self.path_m = 0.0
        self.energy_wh = 0.0
        self.duration_s = 0.0
        self.step_ms: list[float] = []
        self.unsolved = 0

    def step(self, status: StepStatus, solve_ms: float) -> None:
        self.step_ms.append(solve_ms)
        self.unsolved += not status.is_solved

    def travel(
        self,
        controller: Controller,
        before: Observation,
        now: Observation,
        thrusts: tuple[float, float],
    ) -> None:
        seconds = now.time_s - before.time_s
        self.duration_s += seconds
        self.path_m += math.hypot(now.state[0] - before.state[0], now.state[1] - before.state[1])
        power = drive_power_w(controller.vessel, thrusts, before.state[3])
        self.energy_wh += power * seconds / 3600

    def report(self, *, reached: int, targets: int, samples: int) -> MissionReport:
        step_ms = self.step_ms or [0.0]
        return MissionReport(
            reached=reached,
            targets=targets,
            steps=len(self.step_ms),
            duration_s=round(self.duration_s, 3),
            path_m=round(self.path_m, 2),
            energy_wh=round(self.energy_wh, 3),
            unsolved_steps=self.unsolved,
            step_ms_median=round(float(np.median(step_ms)), 3),
            step_ms_p95=round(float(np.percentile(step_ms, 95)), 3),
            samples=samples,
        )
