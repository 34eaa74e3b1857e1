"""What is known of the boat on its way: where it is now, the weather, and what it is itself like.

Orders and estimates go in; out come the state that the next order will meet, the weather that
explains how the boat moves, and the boat as it has turned out to be. As long as estimates come
at once and exact and the boat is as its model says, all of that is the observer's alone.
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
from grebe.control.flown import Flown
from grebe.control.observer import Observer
from grebe.control.rollout import SUBSTEPS_PER_S
from grebe.control.slow_thrusters import SlowThrusters
from grebe.control.state_filter import StateFilter
from grebe.core.dynamics import Weather
from grebe.core.events import State
from grebe.core.motion import advance, parameter_vector
from grebe.core.vessel import Vessel

if TYPE_CHECKING:
    from numpy.typing import NDArray

    Array = NDArray[np.float64]

Thrusts = tuple[float, float]
# Roll-outs of the model that are done for the correction at one estimate: some 3 ms.
WORK_PER_ESTIMATE = 12
# The share of a lag within which thrusters respond.
HURRY = 0.2
# What thrusters were told so many lags ago is forgotten; and the pieces in which what they give is
# taken as constant [s].
FORGOTTEN_LAGS, LAG_PIECE_S = 6.0, 0.05
# Ages below this are treated as zero: a link's clock is no better than that [s].
LEAST_AGE_S = 0.02
# Longer gaps between estimates are not learned from [s].
LONGEST_GAP_S = 2.0
MEMORY_S = WINDOW_S + 10.0


@dataclass(frozen=True, kw_only=True)
class _Order:
    """What was sent, when, and the integral of all orders until then [N s]."""

    time_s: float
    thrusts: Thrusts
    impulse: tuple[float, float]


class Tracker:
    """Follows one boat. `model` is the boat as it is said to be; `corrects`: whether that is
    put to the test; `observes` whether current and wind are estimated; `holds_motion`: the boat's
    autopilot holds the motion that it is told.
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
        # An autopilot that holds a motion makes up for its thrusters itself.
        self._modelled = AS_MODELLED if holds_motion else as_modelled(model)
        self.correction = self._modelled
        self._corrects = corrects
        self._observer = Observer(model, by_sway=holds_motion) if observes else None
        # The thrusts that would predict a boat which holds a motion are not known.
        self._filter = StateFilter() if observes and not holds_motion else None
        self._orders: deque[_Order] = deque()
        self._seen: deque[tuple[float, State]] = deque()
        self._work: Generator[None, None, Found | None] | None = None
        self._next_fit_s = -math.inf

    @property
    def vessel(self) -> Vessel:
        """The boat that is to be planned for."""
        correction = self.correction
        return self.model if correction is self._modelled else correction.vessel(self.model)

    @property
    def finding(self) -> str:
        """What the boat has turned out to be, in a sentence."""
        return str(AS_MODELLED if self.correction == self._modelled else self.correction)

    @property
    def weather(self) -> Weather:
        """The weather that explains how the boat moves."""
        return Weather() if self._observer is None else self._observer.weather

    @property
    def hurries(self) -> bool:
        """Whether what the boat is told changes while what it is to do does not."""
        return self.correction.lag_s > LEAST_LAG_S

    def told(self, time_s: float, thrusts: Thrusts) -> Thrusts:
        """Return what the thrusters must be told now so that they soon give `thrusts` [N].

        Thrusters with a lag are told more than they are to give until they give it (the lag's
        inverse over `HURRY` of it); what they give is reckoned from what they were told.
        """
        correction = self.correction
        wanted = thrusts[0] / correction.port, thrusts[1] / correction.starboard
        if not self.hurries:
            return wanted
        gives = self._gives(time_s)
        return self._more(wanted[0], gives[0]), self._more(wanted[1], gives[1])

    def _more(self, wanted_n: float, gives_n: float) -> float:
        told = gives_n + (wanted_n - gives_n) / (1.0 - math.exp(-HURRY))
        return min(max(told, self.model.thrust_min_n), self.model.thrust_max_n)

    def given(self, time_s: float, told: Thrusts) -> Thrusts:
        """What the thrusters that were last told `told` give at a time, as far as it is known."""
        return self._gives(time_s) if self.hurries else told

    def thrusters(self, time_s: float) -> SlowThrusters | None:
        """The thrusters as an order of that time will find them; None where they are quick."""
        if not self.hurries:
            return None
        correction, boat = self.correction, self.vessel
        shares = correction.port, correction.starboard
        now = self._gives(time_s + correction.dead_s)
        return SlowThrusters(
            now_n=(shares[0] * now[0], shares[1] * now[1]),
            least_n=boat.thrust_min_n,
            most_n=boat.thrust_max_n,
            lag_s=correction.lag_s,
        )

    def _gives(self, time_s: float) -> Thrusts:
        """What thrusters with a lag give at a time of what they were told, reckoned."""
        lag_s, dead_s = self.correction.lag_s, self.correction.dead_s
        port, starboard, since_s = 0.0, 0.0, -math.inf
        told: Thrusts = (0.0, 0.0)
        for order in self._orders_since(time_s - dead_s - FORGOTTEN_LAGS * lag_s):
            at_s = min(order.time_s + dead_s, time_s)
            share = 1.0 - math.exp(-(at_s - since_s) / lag_s)
            port += share * (told[0] - port)
            starboard += share * (told[1] - starboard)
            told, since_s = order.thrusts, at_s
            if at_s >= time_s:
                return port, starboard
        share = 1.0 - math.exp(-(time_s - since_s) / lag_s)
        return port + share * (told[0] - port), starboard + share * (told[1] - starboard)

    def sent(self, time_s: float, thrusts: Thrusts) -> None:
        """Take note of thrusts [N] that the boat was told at a time [s]."""
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

    def righted(self, state: State) -> State:
        """Return an estimate with the compass put right."""
        if self.correction.heading_rad == 0.0:
            return state
        return _state(turned(np.array([state]), -self.correction.heading_rad)[0])

    def see(self, time_s: float, state: State) -> bool:
        """Learn from an estimate of the state at a time [s], as it came; whether the boat is now
        taken for another one than before.
        """
        before = self._seen[-1] if self._seen else None
        if before is not None and not 0 < time_s - before[0] <= LONGEST_GAP_S:
            self._forget()
        elif before is not None and self._observer is not None:
            self._observe(before, (time_s, state))
        self._seen.append((time_s, state))
        while self._seen[0][0] < time_s - WINDOW_S:
            self._seen.popleft()
        return self._corrects and self._advance_work(time_s)

    def ahead(self, time_s: float, now_s: float, state: State) -> State:
        """Return the state that an order of now will meet, from the righted estimate at `time_s`,
        the last that was seen.
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
        """The thrusts that act in a span, piece by piece: as they were sent so much earlier, or
        what thrusters with a lag make of them.
        """
        if self.hurries:
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
            port, starboard = self._gives((left + right) / 2)
            mine = (port * self.correction.port, starboard * self.correction.starboard)
            pieces.append((left, right, mine))
        return pieces

    def _orders_since(self, time_s: float) -> list[_Order]:
        """The orders since a time, and the one that held then."""
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
        pair = self.righted(start), thrusts, self.righted(end), seconds
        self._observer.update(*pair)
        if self._filter is not None:
            # Predicted once more: in the weather that has just been learned, and in finer steps.
            vessel = self.vessel
            per_second = max(SUBSTEPS_PER_S, vessel.fastest_rate_hz)
            substeps = max(2, math.ceil(seconds * per_second))
            self._filter.see(self._parameters(vessel), *pair, substeps)

    def _parameters(self, vessel: Vessel) -> Array:
        """The numbers of the equations of motion, of a boat and the weather as it is known."""
        return parameter_vector(vessel, np.array(self.weather.as_tuple()))

    def _forget(self) -> None:
        """After a gap nothing of before can be joined to what comes."""
        self._seen.clear()
        self._work = None
        if self._filter is not None:
            self._filter.forget()

    def _advance_work(self, time_s: float) -> bool:
        """Go on with the search for a correction; whether it has ended with another one."""
        if self._work is None:
            full = self._seen[-1][0] - self._seen[0][0] >= LEAST_S
            if full and time_s >= self._next_fit_s and self._orders:
                self._next_fit_s = time_s + EVERY_S
                self._work = fitting(self.model, self._flown(), self.correction, self.weather)
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
            self._observer = Observer(self.vessel, found[1])
        if self._filter is not None:
            # It has followed a boat with another compass.
            self._filter.forget()
        return True

    def _flown(self) -> Flown:
        times = np.array([time_s for time_s, _ in self._seen])
        last = self._orders[-1]
        held = times[-1] + 1.0 - last.time_s
        end = (last.impulse[0] + held * last.thrusts[0], last.impulse[1] + held * last.thrusts[1])
        return Flown(
            times=times,
            states=np.array([state for _, state in self._seen]),
            order_times=np.array([*(o.time_s for o in self._orders), times[-1] + 1.0]),
            impulses=np.array([*(o.impulse for o in self._orders), end]),
            noise_sd=np.zeros(6) if self._filter is None else np.sqrt(self._filter.variances),
        )


def _state(z: Array) -> State:
    north, east, heading, surge, sway, yaw_rate = z.tolist()
    return north, east, heading, surge, sway, yaw_rate
