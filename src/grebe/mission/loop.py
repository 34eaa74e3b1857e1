"""The mission loop: observe, decide, command, measure and report, until every set is reached.

The loop connects a helm, a boat and a recorder. Grebe's controller, the peers it is compared with
and every front end use it. The loop tests every state estimate for entry into the next set
(Definition 5) and for a sample, and asks the helm for thrusts at every control step. The recorder
stores everything as it is measured, so a mission can be cut off at any point and resumed. It does
so after the boat has received its command and, unless the disk is slow, before the next estimate.
"""

from __future__ import annotations

import math
import time
from collections import deque
from collections.abc import Callable, Sequence
from dataclasses import replace
from datetime import UTC, datetime

import shapely

from grebe.control.rules.base import reached_count
from grebe.control.tracker import Tracker
from grebe.core.dynamics import Weather
from grebe.core.errors import LinkError, PlanError, StoppedError
from grebe.core.events import (
    EndReason,
    Estimate,
    Reached,
    Revised,
    Started,
    State,
    Warned,
)
from grebe.core.quantities import LIMNOLOGICAL, Quantities
from grebe.core.survey import Survey
from grebe.links.base import AsDriven, BoatLink, Instruments, Observation, as_driven
from grebe.mission.checked_link import CheckedLink
from grebe.mission.consumption import AT_HOME
from grebe.mission.estimates import EstimateReader
from grebe.mission.events.publisher import Publisher
from grebe.mission.events.recorders import Listener, Recorder
from grebe.mission.events.statistics import MissionReport, Statistics
from grebe.mission.gate import Gate, OverError
from grebe.mission.helm import AdaptableHelm, Helm
from grebe.mission.launching import launched
from grebe.mission.measuring.readings import Measuring
from grebe.mission.measuring.sampler import Sampler
from grebe.mission.replanning import Replanner
from grebe.mission.safety.guard import Guard
from grebe.mission.safety.lookout import InFleet
from grebe.mission.safety.memory import Request
from grebe.mission.safety.route_home import Pilot
from grebe.mission.safety.states import SafetyState
from grebe.mission.settings import MissionSettings
from grebe.mission.steering import Steering
from grebe.mission.time_limits import target_time_limit_s

# The state reported for a mission that never received an estimate.
NOWHERE: State = (0.0, 0.0, 0.0, 0.0, 0.0, 0.0)
# On an extension of its mission, a boat looks for another place after other boats have blocked it
# for this long [s].
ELSEWHERE_S = 30.0
# The start of a mission without a date: simulated time needs no calendar.
SOME_DAY = datetime(2000, 1, 1, tzinfo=UTC)


class Mission:
    """Runs one survey with one boat; `run` returns when the mission is over, and reports why.

    The first `reached` targets count as reached before the mission begins. `started` is the UTC
    time of the link's second zero. `stopwatch` times the control steps [s]. `pilot` makes the helm
    for a route home. `instruments` are sondes with their own connections; the caller closes them.
    `fleet` holds what is known of the other boats, if there are any.
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
        fleet: InFleet | None = None,
    ) -> None:
        self._replanner = replanner
        self._fleet = fleet
        self._lookout = None if fleet is None else fleet.lookout
        self._targets = survey.targets
        self._sets = survey.sets
        driven = as_driven(link)
        self._link = link = CheckedLink(link)
        self._settings = settings or MissionSettings()
        self._statistics = Statistics(controller.vessel, len(self._targets), reached)
        self._publisher = Publisher(recorder, [self._statistics, *listeners], started)
        self._sampler = Sampler(
            self._targets, link, self._settings.sampling, quantities, instruments
        )
        self._tracker = self._tracker_of(controller, driven)
        self._reached = controller.reached = reached
        self._gate = Gate(link)
        safety = self._settings.safety
        self._guard = Guard(
            survey,
            controller.vessel,
            replace(safety, weaker_share=safety.weaker_share * driven.braking_share),
            self._publisher.publish_safety,
            started,
            pilot,
            self._lookout,
            by_motion=driven.holds_motion,
            waits=replanner is None or replanner.waits,
        )
        self._measuring = Measuring(self._sampler, self._guard, self._publisher)
        self._closings: deque[tuple[tuple[shapely.Polygon, ...], str]] = deque()
        # Whether to check at the next estimate that the boat can sail straight to its next target.
        self._checks_leg, self._waits_at = True, (0.0, 0.0)
        self._deadline_s = math.inf
        self._steering = Steering(
            controller, self._targets, self._gate, self._tracker, self._guard, self._publisher,
            stopwatch, self._lookout,
        )  # fmt: skip
        self._estimates = EstimateReader(
            link, self._tracker, self._guard, self._steering, self._publisher, self._requested_stop
        )

    def _tracker_of(self, controller: Helm, driven: AsDriven) -> Tracker:
        observes = self._settings.observes
        adapts = not driven.holds_motion and isinstance(controller, AdaptableHelm)
        return Tracker(
            controller.vessel,
            observes=observes,
            corrects=observes and adapts,
            holds_motion=driven.holds_motion,
        )

    def stop(self, why: str) -> None:
        """Remove the boat's thrust at once and end the mission. Thread-safe."""
        self._gate.shut(why)

    def come_home(self, why: str) -> None:
        """Request the return home, where the mission ends. Thread-safe."""
        self._guard.ask(Request.HOME, why)

    def hold_station(self, why: str) -> None:
        """Request that the boat hold its position until `go_on`. Thread-safe."""
        self._guard.ask(Request.HOLD, why)

    def go_on(self, why: str) -> None:
        """Request that a boat holding its position resume what it did before. Thread-safe."""
        self._guard.ask(Request.GO_ON, why)

    def close(self, zones: Sequence[shapely.Polygon], why: str) -> None:
        """Keep the boat out of `zones` (local frame) from the next estimate on. Thread-safe."""
        self._closings.append((tuple(zones), why))

    def run(self) -> MissionReport:
        """Steer until every target is reached, a target cannot be reached, or somebody stops the
        mission; then leave the boat without thrust.

        An unexpected error is reported to the recorder and raised again.
        """
        try:
            if not self._done or self._settings.safety.comes_home:
                self._publish_end(*self._loop())
        except OverError as over:
            self._publish_end(over.reason, str(over))
        except LinkError as error:
            self._publish_end(EndReason.LINK_LOST, str(error))
        except (StoppedError, KeyboardInterrupt) as error:
            self._publish_end(EndReason.STOPPED, str(error) or "interrupted from the keyboard")
            raise
        except Exception as error:
            self._publish_end(EndReason.FAILED, f"{type(error).__name__}: {error}", quietly=True)
            raise
        finally:
            self._link.close()
        return self._statistics.report()

    @property
    def _done(self) -> bool:
        return self._reached == len(self._targets)

    def _loop(self) -> tuple[EndReason, str]:
        observation = launched(
            self._estimates, self._publisher, self._lookout, self._requested_stop
        )
        self._update_model(observation)
        self._set_time_limit(observation)
        self._publisher.publish(
            Started, observation.time_s, targets=len(self._targets), reached=self._reached
        )
        while True:
            self._publisher.publish(
                Estimate, observation.time_s, state=observation.state, weather=self._weather
            )
            self._visit(observation)
            self._measuring.read_instruments(observation)
            self._close_areas(observation)
            self._assess(observation)
            self._replan(observation)
            end = self._end_reached(observation)
            if end is not None:
                return end
            waits_at = self._waits_at if self._waits_for_route else None
            self._steering.act(observation, self._reached, idle=self._done, waits_at=waits_at)
            self._publisher.release()
            observation = self._estimates.next()
            self._update_model(observation)

    def _close_areas(self, observation: Observation) -> None:
        """Keep out of the areas that have been closed since the last estimate."""
        while self._closings:
            zones, why = self._closings.popleft()
            self._publisher.publish(Warned, observation.time_s, code="area_closed", message=why)
            self._guard.close(zones, observation)
            if self._replanner is not None and not self._done:
                place = observation.state[:2]
                self._replanner.close(zones, self._reached, place, self._weather)

    def _assess(self, observation: Observation) -> None:
        """Let the guard judge the estimate; after a change of its state, begin with a new step."""
        before = self._guard.state
        status, ahead = self._link.status(), self._steering.ahead(observation)
        given = self._tracker.delivered(observation.time_s, self._steering.ordered)
        self._guard.assess(observation, self._weather, given, self._reached, status, ahead)
        if self._guard.state is not before:
            self._checks_leg = True
            self._steering.restart(observation.time_s)
            self._set_time_limit(observation)

    def _end_reached(self, observation: Observation) -> tuple[EndReason, str] | None:
        """Return why the mission ends at this estimate, or None if it continues."""
        surveys = self._guard.state is SafetyState.SURVEYING
        if self._done and not self._extends(observation) and not self._waits_for_others():
            why = "" if self._replanner is None else self._replanner.why_over
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
            return EndReason.OUT_OF_TIME, f"the mission's time limit of {limit:g} s has passed"
        return None

    def _waits_for_others(self) -> bool:
        """Whether the boat may not end yet, because it is sent home or makes room for others."""
        if self._fleet is None:
            return self._guard.state is not SafetyState.SURVEYING
        if not self._fleet.stands_by():
            return self._guard.state is SafetyState.RETURNING
        if not self._fleet.lookout.is_done:
            self._fleet.lookout.is_done = True
            self._guard.ask(Request.HOLD, "its part is done; it keeps clear of the others")
        return True

    def _extends(self, observation: Observation) -> bool:
        """Whether the mission continues after its last target; the boat waits for the next one."""
        plans, place = self._replanner, observation.state[:2]
        if plans is None or self._guard.state is not SafetyState.SURVEYING:
            return plans is not None and plans.may_extend
        return plans.asks_to_extend(observation.time_s, self._reached, place)

    def _gives_up(self, observation: Observation) -> bool:
        """Whether the mission continues without the target that it fails to reach."""
        if self._replanner is None or self._done:
            return False
        seq, place = self._targets[self._reached].seq, observation.state[:2]
        if self._replanner.asks_for_another_place(observation.time_s, self._reached, place):
            return True
        self._replanner.give_up(seq, self._reached, place, self._weather)
        return self._replanner.is_busy

    def _replan(self, observation: Observation) -> None:
        """Take a new order of the remaining targets if one is ready, or request one."""
        plans, place = self._replanner, observation.state[:2]
        if plans is None or not self._asks_for_order(plans, observation):
            return
        try:
            new = plans.ready(self._reached, place, self._weather)
        except PlanError as error:
            if plans.asked != "closed":
                raise OverError(EndReason.TARGET_GIVEN_UP, str(error)) from None
            self._guard.ask(Request.HOME, str(error).rstrip("."))
            return
        if plans.why_kept:
            message, plans.why_kept = plans.why_kept, ""
            self._publisher.publish(Warned, observation.time_s, code="plan_kept", message=message)
        if new is None:
            return
        more = len(new.survey.targets) - len(self._targets)
        self._targets, self._sets = new.survey.targets, new.survey.sets
        self._sampler.look_for(self._targets)
        self._guard.take_order(new.survey)
        new.helm.reached = self._reached
        self._steering.take_order(new.helm, self._targets, observation.time_s)
        self._publisher.publish(Revised, observation.time_s, revision=new.revision, more=more)
        self._publisher.publish(
            Warned, observation.time_s, code="plan_revised", message=new.revision.note
        )
        self._set_time_limit(observation)

    def _asks_for_order(self, plans: Replanner, observation: Observation) -> bool:
        """Request a new order if there is cause. Return whether the boat would sail one, which it
        does not on its route home.
        """
        time_s, place = observation.time_s, observation.state[:2]
        if self._guard.state is not SafetyState.SURVEYING:
            crowded = self._guard.crowded_s(time_s) > ELSEWHERE_S
            return crowded and plans.asks_for_another_place(time_s, self._reached, place)
        if self._done:
            # If the loop waits for new orders, this one is requested and taken at the same
            # estimate. In a simulated fleet no other boat then acts in between, and each boat plans
            # with what the boats before it have announced.
            plans.asks_to_extend(time_s, self._reached, place)
            return True
        if self._checks_leg:
            self._checks_leg, self._waits_at = False, (place[0], place[1])
            plans.connect(self._reached, place, self._weather)
        plans.watch(time_s, self._reached, place, self._weather, self._guard.used_wh)
        return True

    def _requested_stop(self) -> str:
        """Who wants the mission to end, and why; empty if nobody does."""
        return self._gate.why or self._link.status().stop_request

    @property
    def _waits_for_route(self) -> bool:
        """Whether the boat waits for a route to its next target."""
        return self._replanner is not None and self._replanner.is_connecting

    @property
    def _weather(self) -> Weather:
        return self._tracker.weather

    def _update_model(self, observation: Observation) -> None:
        """Update the estimates of the weather and of the boat's parameters from an observation."""
        assert self._estimates.raw is not None
        then_s = observation.time_s - observation.age_s
        if self._tracker.update(then_s, self._estimates.raw.state):
            self._adopt_model(observation)

    def _adopt_model(self, observation: Observation) -> None:
        """Plan with the boat's estimated parameters from now on."""
        self._steering.adopt_model()
        message = self._tracker.finding
        self._publisher.publish(Warned, observation.time_s, code="model_corrected", message=message)

    def _visit(self, observation: Observation) -> None:
        """Count the targets that this estimate reaches, and measure if a sample is due."""
        before = self._reached
        ahead = self._sets[min(before, len(self._sets) - 1)]
        self._reached = reached_count(self._sets, before, observation.state)
        entered = self._targets[before : self._reached]
        self._steering.controller.reached = self._reached
        self._measuring.take(observation, entered, ahead)
        for i, target in enumerate(entered, before + 1):
            self._publisher.publish(Reached, observation.time_s, target_seq=target.seq, count=i)
        if entered:
            self._set_time_limit(observation)

    def _set_time_limit(self, observation: Observation) -> None:
        if self._done:
            return
        longest = target_time_limit_s(self._sets[self._reached], observation.state)
        self._deadline_s = observation.time_s + longest

    def _publish_end(self, reason: EndReason, message: str, *, quietly: bool = False) -> None:
        """Report the end of the mission; `quietly` if the recorder itself may have failed.

        The link is closed first: a full or slow disk must not keep the boat going. `close` is
        called and not `stop`, because a pilot who took over already controls the boat.
        """
        last = self._estimates.last or Observation(time_s=0.0, state=NOWHERE)
        if self._lookout is not None:
            self._lookout.over((last.state[0], last.state[1]), came_home=reason in AT_HOME)
        try:
            self._link.close()
        finally:
            self._publisher.end(last.time_s, reason, message, quietly=quietly)
