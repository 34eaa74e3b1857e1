"""The mission: observe, decide, command, measure, say what happened - until every set is reached.

One loop joins whoever steers, a boat and a recorder; Grebe's controller, the peers it is
compared with and every front end go through it. Every state estimate is tested for entry
(Definition 5) and for a sample; every control step asks for thrusts. What is measured is kept
by the recorder before the loop goes on, so a mission can be cut off anywhere and resumed; it is
kept once the boat has been told what to do, and a disk that is slow is not waited for.
"""

from __future__ import annotations

import math
import time
from collections import deque
from collections.abc import Callable, Sequence
from dataclasses import replace
from datetime import UTC, datetime

import numpy as np
import shapely

from grebe.control.controller import Command
from grebe.control.rules.base import reached_count
from grebe.control.tracker import Tracker
from grebe.core.dynamics import Weather
from grebe.core.errors import LinkError, PlanError, StoppedError
from grebe.core.events import (
    EndReason,
    Estimate,
    Prediction,
    Reached,
    Revised,
    SampleTaken,
    Started,
    State,
    Step,
    Warned,
)
from grebe.core.inner_loop import held_motion
from grebe.core.quantities import LIMNOLOGICAL, Quantities
from grebe.core.survey import Survey
from grebe.links.base import (
    BoatLink,
    Instruments,
    Observation,
    Order,
    as_driven,
)
from grebe.mission.announcer import Announcer
from grebe.mission.boat_clock import BoatClock
from grebe.mission.gate import Gate, OverError
from grebe.mission.guard import Guard
from grebe.mission.headings import unwrapped
from grebe.mission.helm import (
    AdaptableHelm,
    ForeseeingHelm,
    Helm,
    possible_thrusts,
    step_of,
)
from grebe.mission.lookout import Lookout
from grebe.mission.patience import patience_s
from grebe.mission.recorders import Listener, Recorder
from grebe.mission.replanning import Replanner
from grebe.mission.safety.fence import Schedule
from grebe.mission.safety.machine import Request
from grebe.mission.safety.states import SafetyState
from grebe.mission.sampler import Sampler
from grebe.mission.settings import MissionSettings
from grebe.mission.statistics import MissionReport, Statistics
from grebe.mission.sturdy_link import SturdyLink
from grebe.mission.way_home import Pilot

# The state that is told of a mission that never received an estimate.
NOWHERE: State = (0.0, 0.0, 0.0, 0.0, 0.0, 0.0)
# Time without a usable estimate after which the thrusters are stopped.
BLIND_S = 1.5
# The quantity that says how much water is below the boat.
DEPTH = "water_depth_m"
# Where a mission begins that is given no date: simulated time needs no calendar.
SOME_DAY = datetime(2000, 1, 1, tzinfo=UTC)


class Mission:
    """Runs one survey with one boat; `run` returns when it is over, and says why.

    `reached` targets count as reached before it begins; `started` is the UTC time of the link's
    second zero; `stopwatch` times the steps [s]; `pilot` makes who steers a way home;
    `instruments` are sondes apart from the boat, which the caller closes. Of a fleet `lookout` is
    the boat's, and `stands_by` says whether it is to wait when it is done, for others still sail.
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
        pilot: Pilot | None = None,
        replanner: Replanner | None = None,
        instruments: Instruments | None = None,
        lookout: Lookout | None = None,
        stands_by: Callable[[], bool] | None = None,
    ) -> None:
        self._replanner = replanner
        self._lookout, self._stands_by = lookout, stands_by
        self._targets = survey.targets
        self._sets = survey.sets
        self._controller = controller
        driven = as_driven(link)
        self._link = link = SturdyLink(link)
        self._settings = settings or MissionSettings()
        self._stopwatch = stopwatch
        self._statistics = Statistics(controller.vessel, len(self._targets), reached)
        self._announcer = Announcer(recorder, [self._statistics, *listeners], started)
        self._sampler = Sampler(
            self._targets, link, self._settings.sampling, quantities, instruments
        )
        observes = self._settings.observes
        self._tracker = Tracker(
            controller.vessel,
            observes=observes,
            corrects=observes and not driven.holds_motion and isinstance(controller, AdaptableHelm),
            holds_motion=driven.holds_motion,
        )
        self._reached = controller.reached = reached
        self._gate, self._clock = Gate(link), BoatClock()
        safety = self._settings.safety
        self._guard = Guard(
            survey,
            controller.vessel,
            replace(safety, weaker_share=safety.weaker_share * driven.braking_share),
            self._announcer.change,
            started,
            pilot,
            lookout,
            by_motion=driven.holds_motion,
        )
        self._closings: deque[tuple[tuple[shapely.Polygon, ...], str]] = deque()
        # Whether it is to be seen if the boat can sail straight on to its next target.
        self._looks_on = True
        self._next_step_s = 0.0
        self._deadline_s = math.inf
        self._raw: Observation | None = None
        self._before: Observation | None = None
        self._command: tuple[float, Command] | None = None
        self._thrusts = self._told = (0.0, 0.0)

    def stop(self, why: str) -> None:
        """Take the boat's thrust away at once and end the mission. Safe from any thread."""
        self._gate.shut(why)

    def come_home(self, why: str) -> None:
        """Ask for the way home; the mission ends there. Safe from any thread."""
        self._guard.ask(Request.HOME, why)

    def hold_station(self, why: str) -> None:
        """Ask the boat to hold the place where it is, until `go_on`. Safe from any thread."""
        self._guard.ask(Request.HOLD, why)

    def go_on(self, why: str) -> None:
        """Ask a boat that holds its place to go on with what it did. Safe from any thread."""
        self._guard.ask(Request.GO_ON, why)

    def close(self, zones: Sequence[shapely.Polygon], why: str) -> None:
        """Keep the boat out of local zones from the next estimate on. Safe from any thread."""
        self._closings.append((tuple(zones), why))

    def run(self) -> MissionReport:
        """Steer until every target is reached, or one cannot be, or somebody stops it; the boat
        is left without thrust.

        An error that is nobody's decision is told to the recorder and raised again.
        """
        try:
            if not self._done or self._settings.safety.comes_home:
                self._tell_end(*self._loop())
        except OverError as over:
            self._tell_end(over.reason, str(over))
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
        observation = self._advance()
        self._give_patience(observation)
        self._announcer.tell(
            Started, observation.time_s, targets=len(self._targets), reached=self._reached
        )
        while True:
            self._announcer.tell(
                Estimate, observation.time_s, state=observation.state, weather=self._weather
            )
            self._visit(observation)
            self._read_instruments(observation)
            self._close_areas(observation)
            self._watch(observation)
            self._replan(observation)
            end = self._end_reached(observation)
            if end is not None:
                return end
            self._act(observation)
            self._announcer.release()
            observation = self._advance()

    def _close_areas(self, observation: Observation) -> None:
        """Keep out of what has been closed since the last estimate."""
        while self._closings:
            zones, why = self._closings.popleft()
            self._announcer.tell(Warned, observation.time_s, code="area_closed", message=why)
            self._guard.close(zones, observation)
            if self._replanner is not None and not self._done:
                place = observation.state[:2]
                self._replanner.close(zones, self._reached, place, self._weather)

    def _watch(self, observation: Observation) -> None:
        """Let the guard judge the estimate; what goes on after a change begins with a new step."""
        before = self._guard.state
        status, ahead = self._link.status(), self._ahead(observation)
        given = self._tracker.given(observation.time_s, self._told)
        self._guard.look(observation, self._weather, given, self._reached, status, ahead)
        if self._guard.state is not before:
            self._next_step_s, self._looks_on = observation.time_s, True
            self._give_patience(observation)

    def _end_reached(self, observation: Observation) -> tuple[EndReason, str] | None:
        """Why the mission ends at this estimate; None where it goes on."""
        surveys = self._guard.state is SafetyState.SURVEYING
        if self._done and not self._waits_for_others() and not self._extends(observation):
            why = "" if self._replanner is None else self._replanner.over
            return EndReason.COMPLETE, "every target is reached" + (f"; {why}" if why else "")
        if request := self._requested_stop():
            return EndReason.STOPPED, request
        if self._guard.end is not None:
            return self._guard.end
        if surveys and observation.time_s > self._deadline_s and not self._gives_up(observation):
            seq = self._targets[self._reached].seq
            return (
                EndReason.TARGET_GIVEN_UP,
                f"target {seq} was not reached in time; the mission ends here",
            )
        if observation.time_s > self._settings.limit_s:
            limit = self._settings.limit_s
            return EndReason.OUT_OF_TIME, f"the {limit:g} s that the mission was given are over"
        return None

    def _waits_for_others(self) -> bool:
        """Whether the boat is not free to end: it is sent home, or makes room for others."""
        if self._lookout is None or self._stands_by is None:
            return self._guard.state is not SafetyState.SURVEYING
        if not self._stands_by():
            return self._guard.state is SafetyState.RETURNING
        if not self._lookout.is_done:
            self._lookout.is_done = True
            self._guard.ask(Request.HOLD, "its part is done, and it makes room for others")
        return True

    def _extends(self, observation: Observation) -> bool:
        """Whether the mission goes on after its last target; the boat waits for where."""
        plans, place = self._replanner, observation.state[:2]
        return plans is not None and plans.goes_on(observation.time_s, self._reached, place)

    def _gives_up(self, observation: Observation) -> bool:
        """Whether the mission goes on without the target that it does not reach."""
        if self._replanner is None or self._done:
            return False
        seq, place = self._targets[self._reached].seq, observation.state[:2]
        self._replanner.give_up(seq, self._reached, place, self._weather)
        return self._replanner.is_busy

    def _replan(self, observation: Observation) -> None:
        """Take a new order of what is left where there is one, or ask for one."""
        plans, place = self._replanner, observation.state[:2]
        if plans is None or self._guard.state is not SafetyState.SURVEYING:
            return
        if self._looks_on and not self._done:
            self._looks_on = False
            plans.lead_on(self._reached, place, self._weather)
        if not self._done:
            plans.watch(observation.time_s, self._reached, place, self._weather)
        try:
            new = plans.ready(self._reached, place, self._weather)
        except PlanError as error:
            if plans.asked != "closed":
                raise OverError(EndReason.TARGET_GIVEN_UP, str(error)) from None
            self._guard.ask(Request.HOME, str(error))
            return
        if new is None:
            return
        more = len(new.survey.targets) - len(self._targets)
        self._targets, self._sets = new.survey.targets, new.survey.sets
        self._sampler.look_for(self._targets)
        self._controller = new.helm
        self._guard.take_order(new.survey)
        self._controller.reached = self._reached
        if isinstance(new.helm, AdaptableHelm) and new.helm.vessel != self._tracker.vessel:
            new.helm.take_for(self._tracker.vessel)
        self._command, self._next_step_s = None, observation.time_s
        self._announcer.tell(Revised, observation.time_s, revision=new.revision, more=more)
        self._announcer.tell(
            Warned, observation.time_s, code="plan_revised", message=new.revision.note
        )
        self._give_patience(observation)

    def _requested_stop(self) -> str:
        """Who wants the mission to end, and why; empty where nobody does."""
        return self._gate.why or self._link.status().stop_request

    def _act(self, observation: Observation) -> None:
        """Give the boat its thrusts: the guard's own, a new step's, or those of the last plan."""
        own = self._guard.own_thrusts(observation, self._weather)
        if own is not None:
            if own != self._thrusts:
                self._send(observation, own)
                self._tell_step(observation, None)
        elif self._helm is self._controller and (self._done or self._is_led):
            self._send(observation, (0.0, 0.0))
        elif observation.time_s >= self._next_step_s - 1e-9:
            self._steer(observation)
        else:
            self._follow_plan(observation)

    @property
    def _is_led(self) -> bool:
        """Whether the boat waits for a way to its next target."""
        return self._replanner is not None and self._replanner.leads

    def _ahead(self, observation: Observation) -> Schedule | None:
        """The thrusts that the boat is going to have, as far as they are planned."""
        if self._command is None:
            return None
        since, command = self._command
        return lambda seconds: command.thrusts_at(observation.time_s - since + seconds)

    @property
    def _helm(self) -> Helm:
        """Who steers now: the survey's helm, or the one of the way home."""
        return self._guard.helm or self._controller

    @property
    def _weather(self) -> Weather:
        return self._tracker.weather

    def _observe(self) -> Observation:
        """The next estimate that can be used, its heading unwrapped.

        What is not a number is reported and passed over; a boat that is blind for longer than
        `BLIND_S` is braked, as far as that can be reckoned, and left without thrust until it sees
        again.
        """
        while True:
            observation = self._link.observe()
            self._check_clock(observation)
            if all(map(math.isfinite, observation.state)):
                self._raw = unwrapped(observation, self._raw)
                return replace(self._raw, state=self._tracker.righted(self._raw.state))
            text = f"an estimate is not a number and is passed over: {observation.state}"
            self._announcer.tell(Warned, observation.time_s, code="estimate_invalid", message=text)
            if request := self._requested_stop():
                raise OverError(EndReason.STOPPED, request)
            if self._before and observation.time_s - self._before.time_s > BLIND_S:
                self._grope(self._before, observation)
            self._announcer.release()

    def _check_clock(self, observation: Observation) -> None:
        """End a mission whose boat's clock is none; an autopilot that has started afresh, and whose
        clock therefore begins anew, says so itself.
        """
        try:
            self._clock.see(observation, seen_before=self._before is not None)
        except LinkError:
            if request := self._requested_stop():
                raise OverError(EndReason.STOPPED, request) from None
            raise

    def _grope(self, seen: Observation, now: Observation) -> None:
        """Brake a boat that has not been seen since `seen`; ends the mission that stays blind."""
        thrusts = self._guard.blind(seen, now, self._thrusts, self._weather)
        if self._guard.end is not None:
            raise OverError(*self._guard.end)
        state = self._guard.reckoned or seen.state
        self._send(replace(now, state=state), thrusts)

    def _advance(self) -> Observation:
        """The next estimate, and what is learned from it of the weather and of the boat."""
        observation = self._before = self._observe()
        assert self._raw is not None
        then_s = observation.time_s - observation.age_s
        if self._tracker.see(then_s, self._raw.state):
            self._take_for_another_boat(observation)
        return observation

    def _take_for_another_boat(self, observation: Observation) -> None:
        """Plan for the boat that it has turned out to be."""
        vessel = self._tracker.vessel
        for one in (self._controller, self._guard.helm, self._guard):
            if isinstance(one, AdaptableHelm):
                one.take_for(vessel)
        message = self._tracker.finding
        self._announcer.tell(Warned, observation.time_s, code="model_corrected", message=message)

    def _visit(self, observation: Observation) -> None:
        """Count what this estimate reaches, and measure where a sample is due."""
        before = self._reached
        ahead = self._sets[min(before, len(self._sets) - 1)]
        self._reached = reached_count(self._sets, before, observation.state)
        entered = self._targets[before : self._reached]
        self._controller.reached = self._reached
        sample = self._sampler.take(
            observation, self._announcer.time_at(observation.time_s), entered, ahead
        )
        if sample is not None:
            self._guard.depth_m = sample.values.get(DEPTH)
            self._announcer.tell(SampleTaken, observation.time_s, sample=sample)
        for i, target in enumerate(entered, before + 1):
            self._announcer.tell(Reached, observation.time_s, target_seq=target.seq, count=i)
        if entered:
            self._give_patience(observation)

    def _read_instruments(self, observation: Observation) -> None:
        """Take what instruments apart from the boat have measured, and what they are like."""
        for sample in self._sampler.instruments(observation, self._announcer.time_at):
            self._guard.depth_m = sample.values.get(DEPTH, self._guard.depth_m)
            self._announcer.tell(SampleTaken, observation.time_s, sample=sample)
        self._guard.mute = self._sampler.mute(observation.time_s)
        for code, message in self._sampler.notes():
            self._announcer.tell(Warned, observation.time_s, code=code, message=message)

    def _steer(self, observation: Observation) -> None:
        began = self._stopwatch()
        helm = self._helm
        elapsed = None if self._command is None else observation.time_s - self._command[0]
        then_s = observation.time_s - observation.age_s
        state = self._tracker.ahead(then_s, observation.time_s, observation.state)
        if isinstance(helm, ForeseeingHelm):
            helm.expect(self._tracker.thrusters(observation.time_s))
        command = helm.step(state, self._weather, elapsed)
        solve_ms = 1e3 * (self._stopwatch() - began)
        self._command = (observation.time_s, command)
        self._apply(observation, self._possible(command.thrusts_at(0.0)), solve_ms)
        if command.plan is not None:
            self._announcer.tell(
                Prediction,
                observation.time_s,
                after_s=np.concatenate([[0.0], np.cumsum(command.plan.durations)]),
                states=command.plan.states,
                thrusts=command.plan.thrusts,
            )
        self._next_step_s = observation.time_s + step_of(helm)

    def _follow_plan(self, observation: Observation) -> None:
        """Between two control steps: change the thrusts where the plan does."""
        if self._command is None:
            return
        since, command = self._command
        thrusts = self._possible(command.thrusts_at(observation.time_s - since))
        if thrusts != self._thrusts or self._tracker.hurries:
            self._apply(observation, thrusts, None)

    def _possible(self, thrusts: Sequence[float]) -> tuple[float, float]:
        return possible_thrusts(self._controller.vessel, thrusts)

    def _apply(
        self, observation: Observation, thrusts: tuple[float, float], solve_ms: float | None
    ) -> None:
        """Send thrusts that the boat may have, and say from which state they are sent."""
        ahead = self._ahead(observation) or (lambda _: thrusts)
        if not self._guard.permitted(observation, ahead, self._weather, self._reached):
            self._next_step_s = observation.time_s
            thrusts = self._guard.own_thrusts(observation, self._weather) or (0.0, 0.0)
        self._send(observation, thrusts)
        self._tell_step(observation, solve_ms)

    def _send(self, observation: Observation, thrusts: tuple[float, float]) -> None:
        vessel = self._controller.vessel
        surge, yaw_rate = held_motion(vessel, observation.state, thrusts, self._weather)
        told = self._tracker.told(observation.time_s, thrusts)
        self._gate.command(Order(thrusts=told, surge_mps=surge, yaw_rate_radps=yaw_rate))
        self._tracker.sent(observation.time_s, told)
        self._thrusts, self._told = thrusts, told

    def _tell_step(self, observation: Observation, solve_ms: float | None) -> None:
        """Say what the boat has been told: by a helm's command, or by the guard."""
        surveys = self._guard.state is SafetyState.SURVEYING
        command = None if self._command is None else self._command[1]
        steered = command is not None and (surveys or self._guard.helm is not None)
        self._announcer.tell(
            Step,
            observation.time_s,
            state=observation.state,
            thrusts=self._thrusts,
            target_seq=self._targets[command.target].seq if command and surveys else None,
            split_stage=command.split if command and steered else None,
            solve_ms=solve_ms,
            status=command.status.value if command and steered else self._guard.state.value,
            solved=not (command and steered) or command.status.is_solved or solve_ms is None,
            current_north_mps=self._weather.current_north_mps,
            current_east_mps=self._weather.current_east_mps,
        )

    def _give_patience(self, observation: Observation) -> None:
        if self._done:
            return
        longest = patience_s(self._sets[self._reached], observation.state)
        self._deadline_s = observation.time_s + longest

    def _tell_end(self, reason: EndReason, message: str, *, quietly: bool = False) -> None:
        """Say that the mission is over; `quietly` where the recorder itself may be what failed.

        The boat is given back first: a disk that is full or slow must not keep it going. That is
        the link's `close` and not its `stop`, for a pilot who took over has the boat already.
        """
        last = self._before or Observation(time_s=0.0, state=NOWHERE)
        try:
            self._link.close()
        finally:
            self._announcer.end(last.time_s, reason, message, quietly=quietly)
