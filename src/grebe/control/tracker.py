"""Tracking of the boat during a mission: its present state, the weather, and its parameters.

The tracker takes orders and estimates. It returns the state at which the next order will act, the
weather estimated from the motion, and the boat's corrected model. If estimates are exact and
without delay, and the boat behaves as its model, only the observer is at work.
"""

from __future__ import annotations

import math
from collections import deque
from collections.abc import Generator
from dataclasses import dataclass
from itertools import pairwise
from typing import TYPE_CHECKING

import numpy as np

from grebe.control.adaptation import EVERY_S, LEAST_S, WINDOW_S, Found, fitting
from grebe.control.correction import AS_MODELLED, LEAST_LAG_S, as_modelled, moved_enough, turned
from grebe.control.motion_record import MotionRecord
from grebe.control.observer import Observer
from grebe.control.rollout import SUBSTEPS_PER_S
from grebe.control.slow_thrusters import SlowThrusters
from grebe.control.state_filter import StateFilter
from grebe.core.dynamics import Weather
from grebe.core.events import State, Thrusts
from grebe.core.motion import advance, parameter_vector
from grebe.core.vessel import Vessel

if TYPE_CHECKING:
    from numpy.typing import NDArray

    Array = NDArray[np.float64]

# Simulations of the model that are run for the correction at each estimate: 2 ms at most.
WORK_PER_ESTIMATE = 12
# Thrusters should respond within this many lags.
RESPONSE_LAGS = 0.2
# Orders older than this many lags are ignored; thrust is constant in pieces of this length [s].
FORGOTTEN_LAGS, LAG_PIECE_S = 6.0, 0.05
# Ages below this are treated as zero, because a link's clock is no better [s].
LEAST_AGE_S = 0.02
# Longest gap between two estimates from which anything is learned [s].
LONGEST_GAP_S = 2.0
MEMORY_S = WINDOW_S + 10.0


@dataclass(frozen=True, kw_only=True)
class _Order:
    """An order: its time, its thrusts, and the integral of all orders until then [N s]."""

    time_s: float
    thrusts: Thrusts
    impulse: tuple[float, float]


class Tracker:
    """Tracks one boat.

    `model` is the boat's given model. `corrects`: the model is tested and corrected. `observes`:
    current and wind are estimated. `holds_motion`: the boat's autopilot holds the motion that is
    ordered.
    """

    def __init__(
        self,
        model: Vessel,
        *,
        observes: bool = True,
        corrects: bool = True,
        holds_motion: bool = False,
    ) -> None:
        self.model = model
        # An autopilot that holds a motion compensates for its thrusters itself.
        self._modelled = AS_MODELLED if holds_motion else as_modelled(model)
        self.correction = self._modelled
        self._corrects = corrects
        self._holds_motion = holds_motion
        self._observer = Observer(model, by_sway=holds_motion) if observes else None
        # The thrusts of a boat that holds a motion are not known, so it cannot be predicted.
        self._filter = StateFilter() if observes and not holds_motion else None
        self._orders: deque[_Order] = deque()
        self._seen: deque[tuple[float, State]] = deque()
        self._work: Generator[None, None, Found | None] | None = None
        self._next_fit_s = -math.inf

    @property
    def vessel(self) -> Vessel:
        """The boat to plan for: the corrected model."""
        correction = self.correction
        return self.model if correction is self._modelled else correction.vessel(self.model)

    @property
    def finding(self) -> str:
        """The estimated difference between boat and model, as a sentence."""
        return str(AS_MODELLED if self.correction == self._modelled else self.correction)

    @property
    def weather(self) -> Weather:
        """The weather estimated from the boat's motion."""
        filtered = None if self._filter is None else self._filter.weather
        if filtered is not None:
            return filtered
        return Weather() if self._observer is None else self._observer.weather

    @property
    def compensates_lag(self) -> bool:
        """Whether a lag is compensated, so that orders change while the wanted thrusts do not."""
        return self.correction.lag_s > LEAST_LAG_S

    def orders_for(self, time_s: float, thrusts: Thrusts) -> Thrusts:
        """Return the thrusts [N] to order now so that the thrusters soon give `thrusts` [N].

        Thrusters with a lag are ordered to give more than the wanted thrust until they give it (the
        lag's inverse over `RESPONSE_LAGS` lags). Their present thrust is computed from past orders.
        """
        correction = self.correction
        wanted = thrusts[0] / correction.port, thrusts[1] / correction.starboard
        if not self.compensates_lag:
            return wanted
        gives = self._delivered(time_s)
        return self._more(wanted[0], gives[0]), self._more(wanted[1], gives[1])

    def _more(self, wanted_n: float, gives_n: float) -> float:
        ordered = gives_n + (wanted_n - gives_n) / (1.0 - math.exp(-RESPONSE_LAGS))
        return min(max(ordered, self.model.thrust_min_n), self.model.thrust_max_n)

    def delivered(self, time_s: float, ordered: Thrusts) -> Thrusts:
        """Estimated thrusts at a time, if the last order was `ordered`."""
        return self._delivered(time_s) if self.compensates_lag else ordered

    def thrusters(self, time_s: float) -> SlowThrusters | None:
        """State of the thrusters when an order of that time acts; None without a lag."""
        if not self.compensates_lag:
            return None
        correction, boat = self.correction, self.vessel
        shares = correction.port, correction.starboard
        now = self._delivered(time_s + correction.dead_s)
        return SlowThrusters(
            now_n=(shares[0] * now[0], shares[1] * now[1]),
            least_n=boat.thrust_min_n,
            most_n=boat.thrust_max_n,
            lag_s=correction.lag_s,
        )

    def _delivered(self, time_s: float) -> Thrusts:
        """Thrusts of thrusters with a lag at a time, computed from past orders."""
        lag_s, dead_s = self.correction.lag_s, self.correction.dead_s
        port, starboard, since_s = 0.0, 0.0, -math.inf
        ordered: Thrusts = (0.0, 0.0)
        for order in self._orders_since(time_s - dead_s - FORGOTTEN_LAGS * lag_s):
            at_s = min(order.time_s + dead_s, time_s)
            share = 1.0 - math.exp(-(at_s - since_s) / lag_s)
            port += share * (ordered[0] - port)
            starboard += share * (ordered[1] - starboard)
            ordered, since_s = order.thrusts, at_s
            if at_s >= time_s:
                return port, starboard
        share = 1.0 - math.exp(-(time_s - since_s) / lag_s)
        return port + share * (ordered[0] - port), starboard + share * (ordered[1] - starboard)

    def sent(self, time_s: float, thrusts: Thrusts) -> None:
        """Record the thrusts [N] that were ordered at a time [s]."""
        impulse = (0.0, 0.0)
        if self._orders:
            last = self._orders[-1]
            lasted = time_s - last.time_s
            impulse = (
                last.impulse[0] + lasted * last.thrusts[0],
                last.impulse[1] + lasted * last.thrusts[1],
            )
        self._orders.append(_Order(time_s=time_s, thrusts=thrusts, impulse=impulse))
        while self._orders[0].time_s < time_s - MEMORY_S:
            self._orders.popleft()

    def with_compass_corrected(self, state: State) -> State:
        """Return an estimate with the compass's error removed."""
        if self.correction.heading_rad == 0.0:
            return state
        return _state(turned(np.array([state]), -self.correction.heading_rad)[0])

    def update(self, time_s: float, state: State) -> bool:
        """Update from a raw estimate of the state at a time [s]; whether the correction changed."""
        before = self._seen[-1] if self._seen else None
        if before is not None and not 0 < time_s - before[0] <= LONGEST_GAP_S:
            self._reset()
        elif before is not None and self._observer is not None:
            self._observe(before, (time_s, state))
        self._seen.append((time_s, state))
        while self._seen[0][0] < time_s - WINDOW_S:
            self._seen.popleft()
        return self._corrects and self._advance_work(time_s)

    def ahead(self, time_s: float, now_s: float, state: State) -> State:
        """Return the predicted state at which an order sent at `now_s` will act.

        `state` is the last estimate seen, at `time_s`, after `with_compass_corrected`.
        """
        until_s = now_s + self.correction.dead_s
        if self._filter is not None:
            state = self._filter.filtered(state)
        if until_s - time_s < LEAST_AGE_S or not self._orders:
            return state
        p = self._parameters(self.vessel)
        z, out = np.array(state), np.empty(6)
        for begins_s, ends_s, thrusts in self._acting(time_s, until_s):
            substeps = max(2, math.ceil((ends_s - begins_s) * SUBSTEPS_PER_S))
            advance(p, z, np.array(thrusts), ends_s - begins_s, substeps, out)
            z[:] = out
        return _state(z)

    def _acting(self, from_s: float, until_s: float) -> list[tuple[float, float, Thrusts]]:
        """The thrusts that act in a time span, piece by piece, after dead time and lag."""
        if self.compensates_lag:
            return self._acting_late(from_s, until_s)
        dead_s, share = self.correction.dead_s, (self.correction.port, self.correction.starboard)
        since = self._orders_since(from_s - dead_s)
        recent = [(order.time_s + dead_s, order.thrusts) for order in since]
        edges = sorted({from_s, until_s, *(t for t, _ in recent if from_s < t < until_s)})
        pieces: list[tuple[float, float, Thrusts]] = []
        for left, right in pairwise(edges):
            sent = [thrusts for t, thrusts in recent if t <= left]
            port, starboard = sent[-1] if sent else (0.0, 0.0)
            pieces.append((left, right, (port * share[0], starboard * share[1])))
        return pieces

    def _acting_late(self, from_s: float, until_s: float) -> list[tuple[float, float, Thrusts]]:
        count = max(1, math.ceil((until_s - from_s) / LAG_PIECE_S))
        edges = np.linspace(from_s, until_s, count + 1).tolist()
        pieces: list[tuple[float, float, Thrusts]] = []
        for left, right in pairwise(edges):
            port, starboard = self._delivered((left + right) / 2)
            mine = (port * self.correction.port, starboard * self.correction.starboard)
            pieces.append((left, right, mine))
        return pieces

    def _orders_since(self, time_s: float) -> list[_Order]:
        """The orders since a time, and the one in effect then."""
        recent: list[_Order] = []
        for order in reversed(self._orders):
            recent.append(order)
            if order.time_s <= time_s:
                break
        return recent[::-1]

    def _observe(self, before: tuple[float, State], after: tuple[float, State]) -> None:
        assert self._observer is not None
        (from_s, start), (until_s, end) = before, after
        seconds = until_s - from_s
        pieces = self._acting(from_s, until_s)
        if len(pieces) == 1:
            thrusts = pieces[0][2]
        else:
            port = sum((b - a) * f[0] for a, b, f in pieces) / seconds
            starboard = sum((b - a) * f[1] for a, b, f in pieces) / seconds
            thrusts = (port, starboard)
        pair = (
            self.with_compass_corrected(start),
            thrusts,
            self.with_compass_corrected(end),
            seconds,
        )
        self._observer.update(*pair)
        if self._filter is not None:
            # Predict again, in the weather that has just been estimated and in finer steps.
            vessel = self.vessel
            per_second = max(SUBSTEPS_PER_S, vessel.fastest_rate_hz)
            substeps = max(2, math.ceil(seconds * per_second))
            self._filter.update(self._parameters(vessel), *pair, substeps, self._observer)

    def _parameters(self, vessel: Vessel) -> Array:
        """Parameters of the equations of motion for a boat in the estimated weather."""
        return parameter_vector(vessel, np.array(self.weather.as_tuple()))

    def _reset(self) -> None:
        """Drop the past after a gap, because it cannot be joined to what follows."""
        self._seen.clear()
        self._work = None
        if self._filter is not None:
            self._filter.reset()

    def _advance_work(self, time_s: float) -> bool:
        """Continue the search for a correction; return whether the correction changed."""
        if self._work is None:
            full = self._seen[-1][0] - self._seen[0][0] >= LEAST_S
            if full and time_s >= self._next_fit_s and self._orders:
                self._next_fit_s = time_s + EVERY_S
                self._work = fitting(self.model, self._record(), self.correction, self.weather)
            return False
        try:
            for _ in range(WORK_PER_ESTIMATE):
                next(self._work)
        except StopIteration as done:
            self._work = None
            return self._adopt(done.value)
        return False

    def _adopt(self, found: Found | None) -> bool:
        if found is None or not moved_enough(self.correction, found[0]):
            return False
        self.correction = found[0]
        if self._observer is not None:
            self._observer = Observer(self.vessel, found[1], by_sway=self._holds_motion)
        if self._filter is not None:
            # Its state belongs to another compass error.
            self._filter.reset()
        return True

    def _record(self) -> MotionRecord:
        times = np.array([time_s for time_s, _ in self._seen])
        last = self._orders[-1]
        held = times[-1] + 1.0 - last.time_s
        end = (last.impulse[0] + held * last.thrusts[0], last.impulse[1] + held * last.thrusts[1])
        return MotionRecord(
            times=times,
            states=np.array([state for _, state in self._seen]),
            order_times=np.array([*(o.time_s for o in self._orders), times[-1] + 1.0]),
            impulses=np.array([*(o.impulse for o in self._orders), end]),
            noise_sd=np.zeros(6) if self._filter is None else np.sqrt(self._filter.variances),
        )


def _state(z: Array) -> State:
    north, east, heading, surge, sway, yaw_rate = z.tolist()
    return north, east, heading, surge, sway, yaw_rate
