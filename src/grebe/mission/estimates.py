"""The boat's state estimates: skip unusable ones, correct headings, and stop a boat that is blind
for too long.
"""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import replace

from grebe.control.tracker import Tracker
from grebe.core.errors import LinkError
from grebe.core.events import EndReason, Warned
from grebe.links.base import BoatLink, Observation
from grebe.mission.boat_clock import BoatClock
from grebe.mission.events.publisher import Publisher
from grebe.mission.gate import OverError
from grebe.mission.headings import unwrapped
from grebe.mission.safety.guard import Guard
from grebe.mission.steering import Steering

# Time without a usable estimate after which the boat is braked and the thrusters stop [s].
BLIND_S = 1.5


class EstimateReader:
    """Reads the estimates of one link; `asked_to_stop` says who wants the mission to end, if
    anybody does.

    `last` is the last usable estimate, with the compass error corrected. `raw` is the same estimate
    as the link gave it, except that its heading is unwrapped.
    """

    def __init__(
        self,
        link: BoatLink,
        tracker: Tracker,
        guard: Guard,
        steering: Steering,
        publisher: Publisher,
        asked_to_stop: Callable[[], str],
    ) -> None:
        self._link, self._tracker, self._guard = link, tracker, guard
        self._steering, self._publisher = steering, publisher
        self._asked_to_stop = asked_to_stop
        self._clock = BoatClock()
        self.raw: Observation | None = None
        self.last: Observation | None = None

    def next(self) -> Observation:
        """Return the next usable estimate.

        Estimates that are not finite are reported and skipped. A boat that is blind for longer than
        `BLIND_S` is braked as far as dead reckoning allows, and then has no thrust until a usable
        estimate arrives.
        """
        while True:
            observation = self._link.observe()
            self._check_clock(observation)
            if all(map(math.isfinite, observation.state)):
                self.raw = unwrapped(observation, self.raw)
                corrected = self._tracker.with_compass_corrected(self.raw.state)
                is_right = corrected is self.raw.state
                self.last = self.raw if is_right else replace(self.raw, state=corrected)
                return self.last
            text = f"an estimate is not finite and is ignored: {observation.state}"
            self._publisher.publish(
                Warned, observation.time_s, code="estimate_invalid", message=text
            )
            if request := self._asked_to_stop():
                raise OverError(EndReason.STOPPED, request)
            if self.last and observation.time_s - self.last.time_s > BLIND_S:
                self._steer_blind(self.last, observation)
            self._publisher.release()

    def _check_clock(self, observation: Observation) -> None:
        """Raise `LinkError` if the boat's clock is unusable. An autopilot that has restarted, and
        whose clock therefore begins anew, reports that itself, as a request to stop.
        """
        try:
            self._clock.update(observation, had_estimate=self.last is not None)
        except LinkError:
            if request := self._asked_to_stop():
                raise OverError(EndReason.STOPPED, request) from None
            raise

    def _steer_blind(self, seen: Observation, now: Observation) -> None:
        """Brake a boat without a usable estimate since `seen`; end a mission that stays blind."""
        given, weather = self._steering.thrusts, self._tracker.weather
        thrusts = self._guard.steer_blind(seen, now, given, weather)
        if self._guard.end is not None:
            raise OverError(*self._guard.end)
        state = self._guard.dead_reckoned or seen.state
        self._steering.send(replace(now, state=state), thrusts)
