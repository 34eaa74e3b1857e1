"""Boats that keep apart: each claims the water that it may still come to, and no two claims touch.

A claim is the way on which a boat would go on for its reaction time and then stop, foreseen as the
fence foresees it. A boat takes a new claim only where that is farther than the stated distance from
the claims that the others hold at that moment, and keeps the way of its old one otherwise: it
stops. Claims are taken one after the other, so at every instant each boat is on a claim of its own
and the claims are apart, whatever the boats intend. Planning with what the others have announced,
and a stop that is always at hand, is how distributed predictive control keeps what it promises
(Schouwenaars, How and Feron 2004, AIAA GNC, "Decentralized cooperative trajectory planning of
multiple aircraft with hard safety guarantees").

So that claims seldom have to stop a boat, each plans with what the others have announced: where
they are going to be by their own plans, told anew at each of their estimates, which needs no clock
that they share.

Who may go first is decided beforehand, by the order in which the boats set out: a boat also says
where it wishes to go, and one of a later place that lies in the way makes room. Boats that wait for
each other would do so for good: one of them then goes before its turn, or home (`Traffic.stuck`).

A boat that is ashore at its harbour claims nothing, and sets out once its place there is clear.
"""

from __future__ import annotations

import math
import threading
from collections.abc import Sequence
from dataclasses import dataclass, field
from typing import TYPE_CHECKING

import numpy as np
import shapely
from shapely.geometry.base import BaseGeometry

from grebe.control.apart import Announced
from grebe.mission.safety.waiting import Stuck, Waiting, ring, who_makes_way

if TYPE_CHECKING:
    from numpy.typing import NDArray

# A boat that holds its place wanders about it by so much, and estimates are off [m].
WANDER_M = 1.0
# A claim's way is rounded to this [m].
ROUNDING_M = 0.05


@dataclass
class Traffic:
    """What the boats of one fleet claim and wish, by their numbers; safe from any thread.

    `apart_m` is the distance between two boats' centres that is kept. `order`: who goes before
    whom; by their numbers without it.
    """

    apart_m: float
    order: Sequence[int] = ()
    _claims: dict[int, BaseGeometry] = field(default_factory=dict[int, BaseGeometry])
    _wishes: dict[int, BaseGeometry] = field(default_factory=dict[int, BaseGeometry])
    _announced: dict[int, Announced] = field(default_factory=dict[int, Announced])
    _waits: dict[int, Waiting] = field(default_factory=dict[int, Waiting])
    _first: set[int] = field(default_factory=set[int])
    _over: set[int] = field(default_factory=set[int])
    _lock: threading.RLock = field(default_factory=threading.RLock)

    def nearest_m(self, boat: int, place: tuple[float, float]) -> float:
        """How far the nearest claim of another is; infinite where there is none."""
        return _away_m(shapely.Point(place), self._of_others(boat))

    def taken(self, boat: int) -> BaseGeometry:
        """The water that others' claims keep this boat's centre out of."""
        return _around(self._of_others(boat), self.apart_m + 2 * WANDER_M)

    def wished(self, boat: int, *, by_all: bool = False) -> BaseGeometry:
        """The water that boats wish to cross which wait and go before this one, or all others."""
        with self._lock:
            wishes = [
                wish
                for other, wish in self._wishes.items()
                if other != boat and (by_all or self._is_to_be_left(other, boat))
            ]
        return _around(wishes, self.wide_m)

    @property
    def wide_m(self) -> float:
        """How far a boat keeps from the ways that others wish to go, or plan."""
        return self.apart_m + 3 * WANDER_M

    def announce(self, boat: int, plan: Announced) -> None:
        """Say where this boat is going to be."""
        with self._lock:
            self._announced[boat] = plan

    def announced(self, boat: int) -> list[Announced]:
        """Where the others are going to be; one that has not said so lies at its claim's end."""
        with self._lock:
            return [
                self._announced.get(other) or Announced.lying(_end(claim))
                for other, claim in self._claims.items()
                if other != boat
            ]

    def in_the_way(self, boat: int, way: NDArray[np.float64], *, of_plan: bool = False) -> Waiting:
        """Whose claims, and whose mere wishes that go before this boat's, are on its way (n, 2), or
        so near to it that a plan would not go there.
        """
        line = _line(way)
        claimed_m = self.wide_m if of_plan else self.apart_m + 2 * WANDER_M
        with self._lock:
            claimed = {
                other
                for other, claim in self._claims.items()
                if other != boat and claim.distance(line) <= claimed_m
            }
            wished = {
                other
                for other, wish in self._wishes.items()
                if self._is_to_be_left(other, boat) and wish.distance(line) <= self.wide_m
            }
        return Waiting(claimed_by=frozenset(claimed), wished_by=frozenset(wished - claimed))

    def waits(self, boat: int, waiting: Waiting | None) -> None:
        """Say for whom this boat waits; None for nobody any more."""
        with self._lock:
            if waiting is None:
                self._waits.pop(boat, None)
            else:
                self._waits[boat] = waiting

    def stuck(self, boat: int, *, for_long: bool = False) -> Stuck:
        """What this boat is to do that waits and has waited: where boats wait for each other, those
        go first whose way nobody has claimed; where it is claimed for all of them, the one goes
        home that is nearest to it. Another goes home after it only where they wait `for_long`.
        """
        with self._lock:
            among = ring(self._waits, boat)
            if not among:
                return Stuck.WAITS
            if not self._waits[boat].claimed_by:
                self._first.add(boat)
                return Stuck.GOES_FIRST
            others = [self._waits[one] for one in among if one != boat]
            helps = any(not one.claimed_by or one.makes_way for one in others)
            if (helps and not for_long) or who_makes_way(self._waits, among) != boat:
                return Stuck.WAITS
            return Stuck.GOES_HOME

    def takes_turn(self, boat: int) -> None:
        """Let a boat that went before its turn go in its turn again, once nobody waits for it."""
        with self._lock:
            if not any(boat in one.waits_for for one in self._waits.values()):
                self._first.discard(boat)

    def is_blocked_for_good(self, boat: int) -> bool:
        """Whether one is in the way of this boat, which waits, that is over and lies there."""
        with self._lock:
            waiting = self._waits.get(boat)
            return waiting is not None and bool(waiting.claimed_by & self._over)

    def claim(self, boat: int, way: NDArray[np.float64]) -> bool:
        """Take the way (n, 2) as this boat's claim; False where it is too near to another's."""
        line = _line(way)
        with self._lock:
            if _away_m(line, self._of_others(boat)) < self.apart_m + WANDER_M:
                return False
            self._claims[boat] = line
            return True

    def wish(self, boat: int, way: NDArray[np.float64] | None, room_m: float = 0.0) -> None:
        """Say where this boat would go, with what it needs beside it; None for nowhere."""
        with self._lock:
            if way is None:
                self._wishes.pop(boat, None)
            else:
                self._wishes[boat] = (
                    _line(way).buffer(room_m, quad_segs=4) if room_m else _line(way)
                )

    def is_alone(self, boat: int) -> bool:
        """Whether all others are over."""
        with self._lock:
            return not set(self.order) - self._over - {boat}

    def leave(self, boat: int, *, ashore: bool = False) -> None:
        """A boat that is over wishes nothing any more; it keeps its claim, for it lies there, but
        for one that is taken ashore.
        """
        self.wish(boat, None)
        self.waits(boat, None)
        with self._lock:
            self._over.add(boat)
            self._announced.pop(boat, None)
            if ashore:
                self._claims.pop(boat, None)

    def _is_to_be_left(self, one: int, other: int) -> bool:
        """Whether one boat's wish is to be left by another: it waits, and goes before that. Boats
        under way plan with each other's plans, and need no more room than these.
        """
        return one in self._waits and self._goes_before(one, other)

    def _goes_before(self, one: int, other: int) -> bool:
        return self._turn(one) < self._turn(other)

    def _turn(self, boat: int) -> tuple[bool, int]:
        place = self.order.index(boat) if boat in self.order else len(self.order) + boat
        return boat not in self._first, place

    def _of_others(self, boat: int) -> list[BaseGeometry]:
        with self._lock:
            return [claim for other, claim in self._claims.items() if other != boat]


def _line(way: NDArray[np.float64]) -> BaseGeometry:
    if np.ptp(way, axis=0).max() < ROUNDING_M:
        return shapely.Point(way[0])
    return shapely.LineString(way).simplify(ROUNDING_M)


def _end(claim: BaseGeometry) -> tuple[float, float]:
    north, east = shapely.get_coordinates(claim)[-1].tolist()
    return north, east


def _away_m(shape: BaseGeometry, others: list[BaseGeometry]) -> float:
    """The distance to the nearest of some shapes; infinite without any."""
    return min((shape.distance(other) for other in others), default=math.inf)


def _around(shapes: list[BaseGeometry], distance_m: float) -> BaseGeometry:
    if not shapes:
        return shapely.Polygon()
    return shapely.union_all([shape.buffer(distance_m, quad_segs=4) for shape in shapes])
