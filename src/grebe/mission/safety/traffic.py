"""Keeps boats apart: each claims the water that it may still enter, and the claims never touch.

A claim is the predicted path on which a boat continues for its reaction time and then stops; it is
predicted as for the fence. A boat gets a new claim only if that is farther than the set distance
from the present claims of all others. Otherwise it keeps the path of its old claim, and stops.
Claims are granted one at a time, so at every instant each boat is on its own claim and the claims
are apart, whatever the boats intend. Planning with the announced plans of others, with a stop
always available, is how distributed predictive control keeps its guarantees (Schouwenaars, How and
Feron 2004, AIAA GNC, "Decentralized cooperative trajectory planning of multiple aircraft with hard
safety guarantees").

Each boat also announces where its plan takes it, and the others plan with that, so that claims
seldom have to stop a boat. A boat announces its plan again at each of its estimates, so the boats
need no common clock.

The order in which the boats set out decides which of them may go first. A boat also announces where
it wishes to go, and a boat later in the order makes room if it is in the way. Boats that wait for
each other would do so for ever, so one of them goes before its turn, or home (`Traffic.stuck`).

A boat ashore at its harbour claims nothing, and sets out once its place there is clear.
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

from grebe.control.separation import AnnouncedPath
from grebe.mission.safety.waiting import Stuck, Waiting, ring, who_gives_way

if TYPE_CHECKING:
    from numpy.typing import NDArray

# Allowance for the motion of a boat that holds its position, and for errors of estimates [m].
# Claims are this much farther apart than stated. A boat stops this much before that, so that it may
# wander and still claim its place. Plans keep this much more again, so that few end in a stop.
WANDER_M = 1.0
# The tolerance to which the path of a claim is simplified [m].
ROUNDING_M = 0.05


@dataclass
class Traffic:
    """The claims and wishes of the boats of one fleet, by their numbers. Thread-safe.

    `apart_m` is the least distance between the centres of two boats. `order` lists the boats by
    precedence, by default by their numbers.
    """

    apart_m: float
    order: Sequence[int] = ()
    _claims: dict[int, BaseGeometry] = field(default_factory=dict[int, BaseGeometry])
    _wishes: dict[int, BaseGeometry] = field(default_factory=dict[int, BaseGeometry])
    _announced: dict[int, AnnouncedPath] = field(default_factory=dict[int, AnnouncedPath])
    _waits: dict[int, Waiting] = field(default_factory=dict[int, Waiting])
    _first: set[int] = field(default_factory=set[int])
    _over: set[int] = field(default_factory=set[int])
    _lock: threading.RLock = field(default_factory=threading.RLock)

    def nearest_m(self, boat: int, place: tuple[float, float]) -> float:
        """Return the distance to the nearest claim of another boat [m]; infinite without one."""
        return _away_m(shapely.Point(place), self._of_others(boat))

    def taken(self, boat: int) -> BaseGeometry:
        """Return the water that the claims of others keep this boat's centre out of."""
        return _around(self._of_others(boat), self.taken_m)

    def wished(self, boat: int, *, by_all: bool = False) -> BaseGeometry:
        """Return the water that other boats wish to cross: those that wait and have precedence, or
        all others.
        """
        with self._lock:
            wishes = [
                wish
                for other, wish in self._wishes.items()
                if other != boat and (by_all or self._is_to_be_left(other, boat))
            ]
        return _around(wishes, self.wide_m)

    @property
    def taken_m(self) -> float:
        """The distance from the claims of others within which a boat does not go on [m]."""
        return self.apart_m + 2 * WANDER_M

    @property
    def wide_m(self) -> float:
        """The distance that a boat keeps from the wished and planned paths of others [m]."""
        return self.apart_m + 3 * WANDER_M

    def announce(self, boat: int, plan: AnnouncedPath) -> None:
        """Announce where this boat is going to be."""
        with self._lock:
            self._announced[boat] = plan

    def announced(self, boat: int) -> list[AnnouncedPath]:
        """Return where the others are going to be; without an announcement, a boat is assumed to
        stay at the end of its claim.
        """
        with self._lock:
            return [
                self._announced.get(other) or AnnouncedPath.at_rest(_end(claim))
                for other, claim in self._claims.items()
                if other != boat
            ]

    def in_the_way(self, boat: int, path: NDArray[np.float64], *, of_plan: bool = False) -> Waiting:
        """Return the boats whose claims are on this boat's path (n, 2) [m], and those that have
        precedence and only wish to go there. With `of_plan`, claims count within the larger
        distance that plans keep.
        """
        line = _line(path)
        claimed_m = self.wide_m if of_plan else self.taken_m
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
        """Note for whom this boat waits; None if it no longer waits."""
        with self._lock:
            if waiting is None:
                self._waits.pop(boat, None)
            else:
                self._waits[boat] = waiting

    def stuck(self, boat: int, *, for_long: bool = False) -> Stuck:
        """Return what this boat is to do after it has waited.

        If boats wait for each other, those whose paths nobody has claimed go first. If all their
        paths are claimed, the boat nearest to its home goes home. Another follows it only if they
        have waited `for_long`.
        """
        with self._lock:
            among = ring(self._waits, boat)
            if not among:
                return Stuck.WAITS
            if not self._waits[boat].claimed_by:
                self._first.add(boat)
                return Stuck.GOES_FIRST
            others = [self._waits[one] for one in among if one != boat]
            helps = any(not one.claimed_by or one.gives_way for one in others)
            if (helps and not for_long) or who_gives_way(self._waits, among) != boat:
                return Stuck.WAITS
            return Stuck.GOES_HOME

    def takes_turn(self, boat: int) -> None:
        """Return a boat that went before its turn to its place in the order, once nobody waits for
        it.
        """
        with self._lock:
            if not any(boat in one.waits_for for one in self._waits.values()):
                self._first.discard(boat)

    def is_blocked_for_good(self, boat: int) -> bool:
        """Whether this boat waits for a boat that has ended its mission and stays there."""
        with self._lock:
            waiting = self._waits.get(boat)
            return waiting is not None and bool(waiting.claimed_by & self._over)

    def claim(self, boat: int, path: NDArray[np.float64]) -> bool:
        """Take the path (n, 2) [m] as this boat's claim; return False if it is too near to
        another's.
        """
        line = _line(path)
        with self._lock:
            if _away_m(line, self._of_others(boat)) < self.apart_m + WANDER_M:
                return False
            self._claims[boat] = line
            return True

    def wish(self, boat: int, path: NDArray[np.float64] | None, room_m: float = 0.0) -> None:
        """Announce the path on which this boat would go, with the room that it needs beside it;
        None for nowhere.
        """
        with self._lock:
            if path is None:
                self._wishes.pop(boat, None)
            else:
                self._wishes[boat] = (
                    _line(path).buffer(room_m, quad_segs=4) if room_m else _line(path)
                )

    def is_alone(self, boat: int) -> bool:
        """Whether all other boats have ended their missions."""
        with self._lock:
            return not set(self.order) - self._over - {boat}

    def leave(self, boat: int, *, ashore: bool = False) -> None:
        """Remove the wishes and plans of a boat that has ended its mission. Its claim remains,
        because it stays there, unless it is taken ashore.
        """
        self.wish(boat, None)
        self.waits(boat, None)
        with self._lock:
            self._over.add(boat)
            self._announced.pop(boat, None)
            if ashore:
                self._claims.pop(boat, None)

    def _is_to_be_left(self, one: int, other: int) -> bool:
        """Whether `other` must keep out of the wish of `one`, because that waits and has
        precedence. Boats under way plan with each other's plans, and need no more room than that.
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


def _line(path: NDArray[np.float64]) -> BaseGeometry:
    if np.ptp(path, axis=0).max() < ROUNDING_M:
        return shapely.Point(path[0])
    return shapely.LineString(path).simplify(ROUNDING_M)


def _end(claim: BaseGeometry) -> tuple[float, float]:
    north, east = shapely.get_coordinates(claim)[-1].tolist()
    return north, east


def _away_m(shape: BaseGeometry, others: list[BaseGeometry]) -> float:
    """Return the distance to the nearest of some shapes [m]; infinite without any."""
    return min((shape.distance(other) for other in others), default=math.inf)


def _around(shapes: list[BaseGeometry], distance_m: float) -> BaseGeometry:
    if not shapes:
        return shapely.Polygon()
    return shapely.union_all([shape.buffer(distance_m, quad_segs=4) for shape in shapes])
