"""The guard: runs the state machine at every estimate, and steers when the survey's helm does not.

The state machine is pure, so the guard collects its facts, such as the survey's water, the route
home and the reported battery. It reports each decision as an event and carries it out.
"""

from __future__ import annotations

import math
import threading
from collections import deque
from collections.abc import Sequence
from dataclasses import replace
from datetime import datetime
from typing import Protocol

import numpy as np
import shapely

from grebe.core.dynamics import Weather, drive_power_w
from grebe.core.events import EndReason, State, Thrusts
from grebe.core.survey import Survey
from grebe.core.vessel import Vessel
from grebe.links.base import BoatStatus, Observation
from grebe.mission.helm import Helm
from grebe.mission.safety.dead_reckoning import DeadReckoning
from grebe.mission.safety.enclosure import Enclosure
from grebe.mission.safety.fence import Schedule, fence_of
from grebe.mission.safety.lookout import LEAST_WAIT_S, WISHED_SETS, Lookout
from grebe.mission.safety.machine import (
    after_waiting,
    at_the_fence,
    going_on,
    in_traffic,
    next_memory,
    shut_in,
    without_estimates,
    without_route_home,
)
from grebe.mission.safety.memory import WAITS, Asked, Memory, Request
from grebe.mission.safety.route_home import Pilot, RouteHome, UnderWay, default_pilot
from grebe.mission.safety.settings import SafetySettings
from grebe.mission.safety.states import Cause, Facts, Place, SafetyState
from grebe.mission.safety.stopping import Stopping

# The status of a boat that has not reported any.
NO_STATUS = BoatStatus(mode="", armed=False)
# The share of full reverse thrust used to free a boat.
ASTERN_SHARE = 0.8


class SafetyListener(Protocol):
    """Receives changes of state: the time, the two states, the cause's code, and a sentence."""

    def __call__(self, time_s: float, *, before: str, after: str, code: str, message: str) -> None:
        """Receive a change."""
        ...


class Guard:
    """Guards one mission; `report` receives every change of state; `lookout` is for boats in a
    fleet.

    `by_motion`: an autopilot holds the boat's motion, and how it does so is not known exactly.
    `waits`: the boat's time is not the clock's, so nothing is computed in the background.
    """

    def __init__(
        self,
        survey: Survey,
        vessel: Vessel,
        settings: SafetySettings,
        report: SafetyListener,
        started: datetime,
        pilot: Pilot | None = None,
        lookout: Lookout | None = None,
        by_motion: bool = False,
        waits: bool = True,
    ) -> None:
        self._lookout, self._waits = lookout, waits
        self._survey, self._vessel, self._settings = survey, vessel, settings
        self._stopping = Stopping(vessel, settings, lookout, by_motion=by_motion)
        self._report_change = report
        # Faults are detected against the original model, not against one corrected for the faults.
        self._model = vessel
        # The time by which the boat must be home because of daylight, on the link's clock.
        until = settings.until
        self._dark_s = math.inf if until is None else (until - started).total_seconds()
        self._pilot = pilot or default_pilot(vessel)
        self._memory = Memory()
        self._asked: deque[Asked] = deque()
        if settings.comes_home:
            self.ask(Request.HOME, settings.comes_home)
        self._enclosure = Enclosure()
        self._home = RouteHome(survey, settings)
        self._next_home: RouteHome | None = None
        self._blind = DeadReckoning()
        self._began_s: float | None = None
        self._before_s = 0.0
        self._used_wh = settings.used_wh or 0.0
        self.depth_m: float | None = None
        # The name of a silent instrument, and for how long it has been silent [s].
        self.mute: tuple[str, float] = ("", 0.0)

    def take_for(self, vessel: Vessel) -> None:
        """Judge by the corrected model `vessel` from now on."""
        self._vessel = self._stopping.vessel = vessel

    def take_order(self, survey: Survey) -> None:
        """Judge by another order of the same survey from now on."""
        self._survey = replace(survey, no_go=self._survey.no_go)

    def close(self, zones: Sequence[shapely.Polygon], observation: Observation) -> None:
        """Keep the boat, and its routes home, out of zones from now on."""
        place = (observation.state[0], observation.state[1])
        self._survey = replace(self._survey, no_go=(*self._survey.no_go, *zones))
        if self._settings.fence and self._began_s is not None:
            self._enclosure.close(zones, place)
        self._next_home = RouteHome(self._survey, self._settings)
        measuring = threading.Thread(target=self._next_home.measure, daemon=True)
        measuring.start()
        if self._waits:
            measuring.join()
        self._take_next_home(observation)
        if self.state is SafetyState.HOLDING:
            held = fence_of(self._survey.water, self._survey.no_go, place)
            if not held.contains(self._memory.place):
                self._memory = replace(self._memory, place=held.refuge(self._memory.place))

    def _take_next_home(self, observation: Observation) -> None:
        """Use routes home that avoid the closed areas, once these are computed. Until then only the
        fence keeps the boat out.
        """
        if self._next_home is None or not self._next_home.is_measured:
            return
        self._home, self._next_home = self._next_home, None
        if self.state is SafetyState.RETURNING:
            self._set_out_for_home(observation)

    def waits_at(self, observation: Observation, weather: Weather, place: Place) -> Thrusts:
        """Return the thrusts that keep the boat at a place while it waits for a route."""
        return self._stopping.keeper.keep(observation.state, weather, place)

    def ask(self, request: Request, why: str) -> None:
        """Make a request, which is answered at the next estimate. Thread-safe."""
        if self._lookout and request is Request.HOME:
            self._lookout.is_called = True
        self._asked.append(Asked(request=request, why=why))

    @property
    def state(self) -> SafetyState:
        """What the boat does now."""
        return self._memory.state

    @property
    def end(self) -> tuple[EndReason, str] | None:
        """Why the mission ends; None while it continues."""
        reason = self._memory.end
        return None if reason is None else (reason, self._memory.message)

    @property
    def used_wh(self) -> float:
        """The energy used by the drives since the harbour, computed from their thrusts [Wh]."""
        return self._used_wh

    def crowded_s(self, time_s: float) -> float:
        """How long the boat has waited for others to clear its path [s]."""
        waits = self.state is SafetyState.HOLDING and self._memory.cause is Cause.TRAFFIC
        return time_s - self._memory.since_s if waits else 0.0

    @property
    def helm(self) -> Helm | None:
        """The helm of the route home; None unless the boat is returning."""
        route = self._route
        return None if route is None else route.helm

    def assess(
        self,
        observation: Observation,
        weather: Weather,
        thrusts: Thrusts,
        reached: int,
        status: BoatStatus = NO_STATUS,
        ahead: Schedule | None = None,
    ) -> None:
        """Judge an estimate. `thrusts` led to it; `ahead` are the planned thrusts, by default the
        same.
        """
        if self._began_s is None:
            self._begin(observation)
        self._blind.end()
        self._take_next_home(observation)
        self._spend(observation, thrusts)
        if self.state is SafetyState.RETURNING:
            self._home.follow(observation)
        facts = self._facts(observation, weather, thrusts, reached, status)
        # Requests are removed one by one, because another thread may add one meanwhile.
        asked = tuple(self._asked.popleft() for _ in range(len(self._asked)))
        self.depth_m = None
        after = next_memory(self._memory, facts, self._settings, self._model, asked)
        self._enter(after, observation)
        self._act_in_traffic(observation, facts)
        own = self.own_thrusts(observation, weather)
        if own is not None or ahead is None:
            held = own or thrusts
            ahead = lambda _: held  # noqa: E731
        self.permitted(observation, ahead, weather, reached)

    def permitted(
        self, observation: Observation, ahead: Schedule, weather: Weather, reached: int
    ) -> bool:
        """Whether the boat may have the thrusts `ahead` until the next estimate; if not, the guard
        steers from now on.
        """
        drives = self.state not in (SafetyState.HOLDING, SafetyState.STOPPED)
        fence = self._enclosure.fence
        if fence is None or not self._enclosure.fenced or not drives:
            return True
        if self._stopping.can_stop(fence, observation, ahead, weather):
            return True
        facts = self._facts(observation, weather, ahead(0.0), reached, NO_STATUS)
        if self._lookout and self._stopping.escape_plan(fence, observation, ahead, weather):
            self._lookout.refused()
            waits = self._lookout.place_to_wait(fence, facts.place)
            self._enter(in_traffic(self._memory, facts, waits), observation)
            return False
        refuge = self._stopping.refuge(observation.time_s) or fence.refuge(facts.place)
        self._enter(at_the_fence(self._memory, facts, self._settings, refuge), observation)
        return False

    def _act_in_traffic(self, observation: Observation, facts: Facts) -> None:
        """Announce where the boat wishes to go; if it waits for others, make room or go on."""
        lookout, fence = self._lookout, self._enclosure.fence
        if lookout is None or fence is None:
            return
        places = self._next_places(facts.reached)
        ahead = places[0] if places else None
        lookout.wish(facts.place, *places)
        if self.state is not SafetyState.HOLDING:
            lookout.goes(facts.place, facts.time_s)
            return
        if self._memory.cause is Cause.TRAFFIC:
            after = self._after_waiting(lookout, facts, ahead)
            if after is not None:
                lookout.goes(facts.place, facts.time_s)
                self._enter(after, observation)
                return
        if self._memory.cause in (Cause.TRAFFIC, *WAITS):
            place = lookout.place_to_wait(fence, facts.place)
            # Another boat may have claimed that water meanwhile.
            if place != facts.place and lookout.claim(np.array([facts.place, place])):
                self._memory = replace(self._memory, place=place)
                return
        lookout.claim(np.array([facts.place, self._memory.place]))

    def _after_waiting(self, lookout: Lookout, facts: Facts, ahead: Place | None) -> Memory | None:
        """Return the memory of a boat that has waited for others; None if it waits on."""
        memory, waited_s = self._memory, facts.time_s - self._memory.since_s
        if waited_s <= LEAST_WAIT_S:
            return None
        if ahead is None or lookout.is_clear(facts.place, ahead):
            return going_on(memory, facts)
        may_go = memory.resumes is not SafetyState.RETURNING and lookout.harbour is not None
        home_m = self._home.length_m(facts.place) if may_go else math.inf
        return after_waiting(
            memory, facts, lookout.waits(facts.place, ahead, facts.time_s, waited_s, home_m)
        )

    def _next_places(self, reached: int) -> list[Place]:
        """Return the centres of the sets ahead of the boat, those that it would resume while it
        holds its position; none if no set is left.
        """
        going = self._memory.resumes if self.state is SafetyState.HOLDING else self.state
        route = self._home.under_way if going is SafetyState.RETURNING else None
        sets, done = (
            (route.survey.sets, route.helm.reached) if route else (self._survey.sets, reached)
        )
        centres = (one.centre for one in sets[done : done + WISHED_SETS])
        return [(float(north), float(east)) for north, east in centres]

    def own_thrusts(self, observation: Observation, weather: Weather) -> Thrusts | None:
        """Return the guard's own thrusts; None if a helm steers."""
        if self.state is SafetyState.STOPPED:
            return 0.0, 0.0
        if self.state is SafetyState.HOLDING:
            braked = self._memory.cause is Cause.FENCE
            left = self._stopping.thrusts(observation.time_s) if braked else None
            return left or self._stopping.keeper.keep(
                observation.state, weather, self._memory.place
            )
        if self.state is SafetyState.FREEING:
            each = ASTERN_SHARE * self._vessel.thrust_min_n
            return each, each
        return None

    @property
    def dead_reckoned(self) -> State | None:
        """The state of a blind boat by dead reckoning; None if the boat is not blind."""
        return self._blind.state

    def steer_blind(
        self, seen: Observation, now: Observation, thrusts: Thrusts, weather: Weather
    ) -> Thrusts:
        """Return the thrusts that brake a blind boat, and none once it must have stopped. The boat
        was last `seen` then, and has had `thrusts` since the last call.
        """
        seconds = now.time_s - seen.time_s
        self._report(without_estimates(self._memory, now.time_s, seconds, self._settings))
        return self._blind.brake(seen, now, thrusts, weather, self._stopping.keeper)

    def _begin(self, observation: Observation) -> None:
        self._began_s = self._before_s = observation.time_s
        if self._settings.fence:
            self._enclosure.draw(self._survey, (observation.state[0], observation.state[1]))

    def _spend(self, observation: Observation, thrusts: Thrusts) -> None:
        seconds = observation.time_s - self._before_s
        self._before_s = observation.time_s
        surge = observation.state[3]
        self._used_wh += drive_power_w(self._vessel, thrusts, surge) * seconds / 3600

    def _facts(
        self,
        observation: Observation,
        weather: Weather,
        thrusts: Thrusts,
        reached: int,
        status: BoatStatus,
    ) -> Facts:
        place = (observation.state[0], observation.state[1])
        inside = self._enclosure.contains(place)
        home_s, home_wh = self._cost_home(observation, weather, status)
        route = self._route
        return Facts(
            time_s=observation.time_s,
            elapsed_s=observation.time_s - (self._began_s or 0.0),
            state=observation.state,
            weather=weather,
            thrusts=thrusts,
            reached=reached,
            home_s=home_s,
            home_wh=home_wh,
            at_home=route is not None and route.helm.reached == len(route.survey.targets),
            home_given_up=route is not None and observation.time_s > route.deadline_s,
            battery_share=status.battery_share,
            used_wh=self._used_wh,
            depth_m=self.depth_m,
            light_s=self._dark_s - observation.time_s,
            outside=self._enclosure.fenced and not inside,
            mute=self.mute[0],
            mute_s=self.mute[1],
        )

    def _cost_home(
        self, observation: Observation, weather: Weather, status: BoatStatus
    ) -> tuple[float | None, float]:
        """Return the time [s] and energy [Wh] home; None and 0 if they are not needed."""
        memory = self._memory
        asks = self._settings.watches_home or status.battery_share is not None
        asks = asks or bool(self._asked or memory.asked)
        asks = asks or memory.against_s is not None or memory.strong_since_s is not None
        if not asks:
            return None, 0.0
        return self._home.cost(observation, weather, self._vessel)

    @property
    def _route(self) -> UnderWay | None:
        """The route home that is being sailed; None unless the boat is returning."""
        return self._home.under_way if self.state is SafetyState.RETURNING else None

    def _enter(self, after: Memory, observation: Observation) -> None:
        """Take a new state, and set out on a route if it sends the boat home."""
        before = self.state
        self._report(after)
        if after.state is SafetyState.RETURNING and before is not SafetyState.RETURNING:
            if self._lookout:
                self._lookout.sent_home(after.cause)
            self._set_out_for_home(observation)

    def _report(self, after: Memory) -> None:
        before, self._memory = self._memory, after
        if after.cause is not None and (after.state, after.cause) != (before.state, before.cause):
            self._report_change(
                after.since_s,
                before=before.state.value,
                after=after.state.value,
                code=after.cause.value,
                message=after.message,
            )

    def _set_out_for_home(self, observation: Observation) -> None:
        if self._home.set_out(observation, self._vessel, self._pilot):
            return
        no_route = self._home.no_route
        if self._home.is_closed:
            self._report(shut_in(self._memory, observation, no_route))
        else:
            self._report(without_route_home(self._memory, observation.time_s, no_route))
