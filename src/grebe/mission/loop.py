"""The mission: observe, decide, command, measure, say what happened - until every set is reached.

One loop joins whoever steers, a boat and a recorder; Grebe's controller, the peers it is
compared with and every front end go through it. Every state estimate is tested for entry
(Definition 5) and for a sample; every control step asks for thrusts. What is measured is kept
by the recorder before the loop goes on, so a mission can be cut off anywhere and resumed.
"""

from __future__ import annotations

import math
import time
from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace
from datetime import UTC, datetime, timedelta
from typing import Any, Protocol

import numpy as np
import shapely

from grebe.control.controller import Command
from grebe.control.observer import Observer
from grebe.control.rules.base import reached_count
from grebe.core.dynamics import CALM, Weather
from grebe.core.errors import LinkError, StoppedError
from grebe.core.events import (
    Ended,
    EndReason,
    Estimate,
    MissionEvent,
    Prediction,
    Reached,
    SampleTaken,
    Started,
    State,
    Step,
    Warned,
)
from grebe.core.inner_loop import held_motion
from grebe.core.quantities import LIMNOLOGICAL, Quantities
from grebe.core.samples import Sample, gross_range_flag
from grebe.core.survey import Survey, Target
from grebe.core.vessel import Vessel
from grebe.links.base import IDLE, BoatLink, Observation, Order
from grebe.mission.recorders import Broadcast, Listener, Recorder
from grebe.mission.sampling import EVERY_SECOND, Sampling
from grebe.mission.statistics import MissionReport, Statistics

# A target that is not reached within this time, or ten times the straight way at the lowest
# speed of its window, ends the mission as incomplete.
SHORTEST_PATIENCE_S = 180.0
PATIENCE_FACTOR = 10.0
SLOWEST_MPS = 0.2
# Where a mission is that never had an estimate.
NOWHERE: State = (0.0, 0.0, 0.0, 0.0, 0.0, 0.0)
# Time without a usable estimate after which the thrusters are stopped.
BLIND_S = 1.5
# A mission that nobody dates begins here: simulated time needs no calendar.
SOME_DAY = datetime(2000, 1, 1, tzinfo=UTC)


class Helm(Protocol):
    """Whoever steers: Grebe's `Controller`, or a peer.

    The mission sets `reached` (Definition 5) before it asks; `step` is asked every `step_s`.
    """

    reached: int

    @property
    def vessel(self) -> Vessel:
        """The boat as it is believed to be."""
        ...

    @property
    def step_s(self) -> float:
        """Time between two steps [s]."""
        ...

    def step(self, state: State, weather: Weather, elapsed_s: float | None) -> Command:
        """Return what to do from `state` in `weather`, so long after the last step."""
        ...


@dataclass(frozen=True, kw_only=True)
class MissionSettings:
    """`sampling`: which readings are kept. `limit_s`: the boat's time after which the mission
    ends whatever is left. `observes`: whether current and wind are estimated on the way.
    """

    sampling: Sampling = EVERY_SECOND
    limit_s: float = math.inf
    observes: bool = True


class _StopRequestedError(Exception):
    """Somebody wants the mission to end while no estimate can be used."""


class Mission:
    """Runs one survey with one boat; `run` returns when it is over, and says why.

    `reached` targets count as reached before it begins; `started` is the UTC time of the link's
    second zero; `stopwatch` times the steps [s].
    """

    def __init__(
        self,
        survey: Survey,
        controller: Helm,
        link: BoatLink,
        recorder: Recorder,
        settings: MissionSettings | None = None,
        *,
        quantities: Quantities = LIMNOLOGICAL,
        listeners: Sequence[Listener] = (),
        started: datetime = SOME_DAY,
        reached: int = 0,
        stopwatch: Callable[[], float] = time.perf_counter,
    ) -> None:
        self._targets = survey.targets
        self._sets = survey.sets
        self._controller = controller
        self._link = link
        self._settings = settings or MissionSettings()
        self._quantities = quantities
        self._started = started
        self._stopwatch = stopwatch
        self._statistics = Statistics(controller.vessel, len(self._targets), reached)
        self._ears = Broadcast(recorder, [self._statistics, *listeners])
        self._tree = shapely.STRtree([target.set.polygon for target in self._targets])
        self._observer = Observer(controller.vessel) if self._settings.observes else None
        self._reached = controller.reached = reached
        self._stop_request = ""
        self._next_step_s = 0.0
        self._next_sample_s = 0.0
        self._deadline_s = math.inf
        self._before: Observation | None = None
        self._command: tuple[float, Command] | None = None
        self._thrusts = (0.0, 0.0)

    def stop(self, why: str) -> None:
        """Ask the mission to end; it does before the next estimate. Safe from any thread."""
        self._stop_request = why

    def run(self) -> MissionReport:
        """Steer until every target is reached, or one cannot be, or somebody stops it; the boat
        is left without thrust.

        An error that is nobody's decision is told to the recorder and raised again.
        """
        try:
            if not self._done:
                self._tell_end(*self._loop())
        except _StopRequestedError as error:
            self._tell_end(EndReason.STOPPED, str(error))
        except LinkError as error:
            self._tell_end(EndReason.LINK_LOST, str(error))
        except (StoppedError, KeyboardInterrupt) as error:
            self._tell_end(EndReason.STOPPED, str(error) or "interrupted from the keyboard")
            raise
        except Exception as error:
            self._tell_end(EndReason.FAILED, f"{type(error).__name__}: {error}", quietly=True)
            raise
        finally:
            self._link.close()
        return self._statistics.report()

    @property
    def _done(self) -> bool:
        return self._reached == len(self._targets)

    def _loop(self) -> tuple[EndReason, str]:
        observation = self._before = self._observe()
        self._give_patience(observation)
        self._tell(Started, observation, targets=len(self._targets), reached=self._reached)
        while True:
            self._tell(Estimate, observation, state=observation.state, weather=self._weather)
            self._visit(observation)
            end = self._end_reached(observation)
            if end is not None:
                return end
            if observation.time_s >= self._next_step_s - 1e-9:
                self._steer(observation)
            else:
                self._follow_plan(observation)
            observation = self._advance()

    def _end_reached(self, observation: Observation) -> tuple[EndReason, str] | None:
        """Why the mission ends at this estimate; None where it goes on."""
        if self._done:
            return EndReason.COMPLETE, "every target is reached"
        if request := self._requested_stop():
            return EndReason.STOPPED, request
        if observation.time_s > self._deadline_s:
            seq = self._targets[self._reached].seq
            return (
                EndReason.TARGET_GIVEN_UP,
                f"target {seq} was not reached in time; the mission ends here",
            )
        if observation.time_s > self._settings.limit_s:
            limit = self._settings.limit_s
            return EndReason.OUT_OF_TIME, f"the {limit:g} s that the mission was given are over"
        return None

    def _requested_stop(self) -> str:
        """Who wants the mission to end, and why; empty where nobody does."""
        return self._stop_request or self._link.status().stop_request

    @property
    def _weather(self) -> Weather:
        return CALM if self._observer is None else self._observer.weather

    def _observe(self) -> Observation:
        """The next estimate that can be used, its heading unwrapped.

        What is not a number is reported and passed over; a boat that is blind for longer than
        `BLIND_S` is left without thrust until it sees again.
        """
        while True:
            observation = self._link.observe()
            if all(map(math.isfinite, observation.state)):
                return _unwrapped(observation, self._before)
            text = f"an estimate is not a number and is passed over: {observation.state}"
            self._tell(Warned, observation, code="estimate_invalid", message=text)
            if request := self._requested_stop():
                raise _StopRequestedError(request)
            if self._before and observation.time_s - self._before.time_s > BLIND_S:
                self._thrusts = IDLE.thrusts
                self._link.command(IDLE)

    def _advance(self) -> Observation:
        before = self._before
        observation = self._observe()
        if before is not None and self._observer is not None:
            seconds = observation.time_s - before.time_s
            self._observer.update(before.state, self._thrusts, observation.state, seconds)
        self._before = observation
        return observation

    def _visit(self, observation: Observation) -> None:
        """Count what this estimate reaches, and measure where a sample is due."""
        before = self._reached
        ahead = self._sets[before]
        self._reached = reached_count(self._sets, before, observation.state)
        entered = self._targets[before : self._reached]
        self._controller.reached = self._reached
        due = observation.time_s >= self._next_sample_s - 1e-9
        if entered or due:
            within = entered or self._containing(observation.state)
            surge = observation.state[3]
            if self._settings.sampling.keeps(surge, ahead, within):
                self._measure(observation, within[0].seq if within else None)
                self._next_sample_s = observation.time_s + self._settings.sampling.period_s
        for i, target in enumerate(entered, before + 1):
            self._tell(Reached, observation, target_seq=target.seq, count=i)
        if entered:
            self._give_patience(observation)

    def _containing(self, state: State) -> list[Target]:
        point = shapely.Point(state[0], state[1])
        places = np.sort(self._tree.query(point)).tolist()
        return [t for t in (self._targets[i] for i in places) if t.set.contains(state)]

    def _measure(self, observation: Observation, target_seq: int | None) -> None:
        reading = dict(self._link.measure())
        if not reading:
            return
        north, east, _, surge, _, _ = observation.state
        sample = Sample(
            time=self._time(observation),
            north_m=north,
            east_m=east,
            target_seq=target_seq,
            speed_mps=surge,
            values=reading,
            flags={
                key: gross_range_flag(reading.get(key), one.span)
                for key, one in self._quantities.items()
            },
        )
        self._tell(SampleTaken, observation, sample=sample)

    def _steer(self, observation: Observation) -> None:
        began = self._stopwatch()
        elapsed = None if self._command is None else observation.time_s - self._command[0]
        command = self._controller.step(observation.state, self._weather, elapsed)
        solve_ms = 1e3 * (self._stopwatch() - began)
        self._command = (observation.time_s, command)
        self._apply(observation, command.thrusts_at(0.0), solve_ms)
        if command.plan is not None:
            self._tell(
                Prediction,
                observation,
                after_s=np.concatenate([[0.0], np.cumsum(command.plan.durations)]),
                states=command.plan.states,
                thrusts=command.plan.thrusts,
            )
        self._next_step_s = observation.time_s + self._controller.step_s

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
        """Send thrusts, and say from which state they are sent."""
        vessel = self._controller.vessel
        surge, yaw_rate = held_motion(vessel, observation.state, thrusts, self._weather)
        self._link.command(Order(thrusts=thrusts, surge_mps=surge, yaw_rate_radps=yaw_rate))
        self._thrusts = thrusts
        if self._command is None:
            return
        _, command = self._command
        self._tell(
            Step,
            observation,
            state=observation.state,
            thrusts=thrusts,
            target_seq=self._targets[command.target].seq,
            split_stage=command.split,
            solve_ms=solve_ms,
            status=command.status.value,
            solved=command.status.is_solved or solve_ms is None,
            current_north_mps=self._weather.current_north_mps,
            current_east_mps=self._weather.current_east_mps,
        )

    def _give_patience(self, observation: Observation) -> None:
        if self._done:
            return
        target = self._sets[self._reached]
        way = target.footprint_distance(observation.state[0], observation.state[1])
        slowest = max(target.speed_min_mps, SLOWEST_MPS)
        self._deadline_s = observation.time_s + max(
            SHORTEST_PATIENCE_S, PATIENCE_FACTOR * way / slowest
        )

    def _time(self, observation: Observation) -> datetime:
        return self._started + timedelta(seconds=observation.time_s)

    def _tell(self, kind: type[MissionEvent], observation: Observation, **what: Any) -> None:
        self._ears.record(kind(time=self._time(observation), elapsed_s=observation.time_s, **what))

    def _tell_end(self, reason: EndReason, message: str, *, quietly: bool = False) -> None:
        """Say that the mission is over; `quietly` where the recorder itself may be what failed."""
        last = self._before or Observation(time_s=0.0, state=NOWHERE)
        try:
            self._tell(Ended, last, reason=reason, message=message)
        except Exception:
            if not quietly:
                raise


def _unwrapped(observation: Observation, before: Observation | None) -> Observation:
    """The observation with its heading within half a turn of the one before.

    One that is so already is left as it is, to the last digit.
    """
    if before is None:
        return observation
    north, east, heading, *velocities = observation.state
    turns = round((heading - before.state[2]) / (2 * math.pi))
    if turns == 0:
        return observation
    surge, sway, yaw_rate = velocities
    state = (north, east, heading - 2 * math.pi * turns, surge, sway, yaw_rate)
    return replace(observation, state=state)
