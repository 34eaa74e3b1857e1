"""A boat's lookout: what of the others its guard has to know, and what the others know of it."""

from __future__ import annotations

import math
from collections.abc import Callable, Collection
from dataclasses import dataclass, field, replace
from typing import TYPE_CHECKING

import numpy as np
import shapely
from shapely.geometry.base import BaseGeometry

from grebe.control.apart import Announced
from grebe.mission.safety.fence import Fence
from grebe.mission.safety.states import Cause, Place
from grebe.mission.safety.traffic import WANDER_M, Traffic
from grebe.mission.safety.waiting import Approach, Stuck
from grebe.mission.spent import AT_HARBOUR_M

if TYPE_CHECKING:
    from numpy.typing import NDArray

# So far ahead a boat says where it wishes to go [m], through no more sets than this; it goes on
# when its way to the first of them is clear, or as much of it.
WISH_M, WISHED_SETS = 12.0, 8
# Boats farther apart than this need no lookout: two of them stop within less.
NEAR_M = 60.0
# A boat that waits, waits so long at least, and at most: then others stand in its way for good [s].
LEAST_WAIT_S, LONGEST_WAIT_S = 2.0, 600.0
# Boats that have waited so long on the way to one place, and wait for each other, are stuck; after
# so long it has not helped that one of them makes way [s].
STUCK_S, LONG_STUCK_S = 6.0, 60.0
# With each time that it is refused on its way to a place a boat asks for so much more room beside
# it, up to the second: a large hull turns wide [m].
MORE_ROOM_M, MOST_ROOM_M = 1.0, 12.0


@dataclass
class Lookout:
    """What one boat, by its number, sees of a fleet's traffic. `is_done`: it has nothing left to
    do, and makes room for all. `room_m`: what it asks for beside its way `towards` a place.

    `harbour`: where it is launched, and taken ashore when it comes home; None for a boat that lies
    on the water before and after; `is_afloat` where it is on it already. `renewed`: causes of going
    home that are none any more once it is there, such as a spent battery. `waited_s`: how long it
    has waited for others on its way to that place. `gave_way`: it went home for their sake;
    `is_spent`: for what is renewed there; `is_called`: because somebody asked it to.
    """

    traffic: Traffic
    boat: int
    is_done: bool = False
    room_m: float = 0.0
    towards: Place | None = None
    harbour: Place | None = None
    is_afloat: bool = True
    renewed: Collection[Cause] = ()
    waited_s: float = 0.0
    gave_way: bool = False
    is_spent: bool = False
    is_called: bool = False
    _seen_s: float | None = None
    _approach: Approach = field(default_factory=Approach)

    def launches(self, place: Place) -> bool:
        """Whether the boat is on the water: one that is ashore waits until its place is neither
        claimed nor wished by another.
        """
        if self.is_afloat:
            return True
        if self.traffic.wished(self.boat, by_all=True).intersects(shapely.Point(place)):
            return False
        self.is_afloat = self.traffic.claim(self.boat, np.array([place]))
        return self.is_afloat

    @property
    def sails_again(self) -> bool:
        """Whether nothing keeps the boat, once home, from setting out for what it has left."""
        return (self.gave_way or self.is_spent) and not self.is_called

    def sent_home(self, cause: Cause | None) -> None:
        """The boat goes home: for others, for what is renewed there, or for what is wrong."""
        self.gave_way = self.gave_way or cause is Cause.TRAFFIC
        self.is_spent = self.is_spent or cause in self.renewed

    def goes(self, place: Place, time_s: float) -> None:
        """The boat is under way. One whose plans no longer bring it nearer to where it goes, for
        others are there, waits for these as one does that has been stopped.
        """
        self._seen_s = None
        self._approach = self._approach.seen(place, self.towards, time_s)
        waiting = None
        if self.towards is not None and self._approach.idle_s(time_s) > STUCK_S:
            way = _way_to(place, self.towards)
            stands = self.traffic.in_the_way(self.boat, way, of_plan=True)
            waiting = stands if stands.waits_for else None
        self.traffic.waits(self.boat, waiting)

    def waits(
        self, place: Place, towards: Place, time_s: float, held_s: float, home_m: float
    ) -> Stuck:
        """Say that the boat, held for so long, waits to go on towards a place, and how long its
        way home is [m], infinite where it cannot make way so; return what it is to do.
        """
        self.waited_s += 0.0 if self._seen_s is None else time_s - self._seen_s
        self._seen_s, self._approach = time_s, Approach()
        stands = self.traffic.in_the_way(self.boat, _way_to(place, towards))
        makes_way = self.gave_way and not math.isfinite(home_m)
        self.traffic.waits(self.boat, replace(stands, home_m=home_m, makes_way=makes_way))
        stuck = Stuck.WAITS
        if self.waited_s > STUCK_S:
            stuck = self.traffic.stuck(self.boat, for_long=self.waited_s > LONG_STUCK_S)
        if stuck is not Stuck.WAITS or held_s <= LONGEST_WAIT_S:
            return stuck
        if math.isfinite(home_m):
            return Stuck.GOES_HOME
        # On its way to a harbour others end before it: it waits for as long as they sail.
        waits_on = self.harbour is not None and not self.traffic.is_blocked_for_good(self.boat)
        return Stuck.WAITS if waits_on else Stuck.GIVES_UP

    @property
    def is_alone(self) -> bool:
        """Whether no other boat sails any more."""
        return self.traffic.is_alone(self.boat)

    def over(self, place: Place, *, came_home: bool) -> None:
        """The boat is over: where it has come home it is taken ashore, else it lies where it is."""
        harbour = self.harbour
        near = harbour is not None and math.dist(place, harbour) < AT_HARBOUR_M
        self.traffic.leave(self.boat, ashore=came_home and near)

    def is_near(self, place: Place) -> bool:
        """Whether another boat is so near that its claim matters."""
        return self.traffic.nearest_m(self.boat, place) < NEAR_M

    def fence(self, fence: Fence, place: Place) -> Fence:
        """What the others leave of a fence about a place: neither claimed, nor wished by who goes
        first.
        """
        return fence.less(self._blocked(), place, NEAR_M)

    def claim(self, way: NDArray[np.float64]) -> bool:
        """Claim a way (n, 2); False where another holds it."""
        return self.traffic.claim(self.boat, way)

    def announce(self, plan: Announced) -> None:
        """Say where the boat is going to be."""
        self.traffic.announce(self.boat, plan)

    def announced(self, place: Place) -> list[Announced]:
        """Where others are going to be that are near to a place."""
        return self.traffic.announced(self.boat) if self.is_near(place) else []

    def refused(self) -> None:
        """The boat has to wait: it asks for more room from now on."""
        self.room_m = min(self.room_m + MORE_ROOM_M, MOST_ROOM_M)

    def wish(self, place: Place, *places: Place) -> None:
        """Say where the boat would go next, from a place through others; towards another first one
        than before it needs no more room than others.
        """
        towards = places[0] if places else None
        if towards != self.towards:
            self.towards, self.room_m, self.waited_s = towards, 0.0, 0.0
            self.traffic.takes_turn(self.boat)
        way = _way_to(place, *places) if places else None
        self.traffic.wish(self.boat, way, self.room_m)

    def is_clear(self, place: Place, towards: Place) -> bool:
        """Whether the next piece of the way is neither claimed nor wished by others."""
        way = shapely.LineString(_way_to(place, towards))
        return not self._blocked().intersects(way)

    def place_to_wait(self, fence: Fence, place: Place) -> Place:
        """Where to wait in nobody's way, if a straight way leads there; else where the boat is.

        So one that has stopped a little nearer to another than it may set out from backs off.
        """
        if not self._blocked().intersects(shapely.Point(place)):
            return place
        refuge = self.fence(fence, place).refuge(place)
        way = shapely.LineString([place, refuge])
        if not fence.holds_way(np.array([place, refuge])):
            return place
        # One that lies within another's distance already may leave it, and not cross it.
        inner = self.traffic.taken(self.boat).buffer(-WANDER_M)
        return place if inner.intersects(way) else refuge

    def _wished(self) -> BaseGeometry:
        return self.traffic.wished(self.boat, by_all=self.is_done)

    def _blocked(self) -> BaseGeometry:
        return self.traffic.taken(self.boat).union(self._wished())


def _way_to(*places: Place) -> NDArray[np.float64]:
    """The beginning (n, 2) of the way through some places, `WISH_M` of it at most."""
    corners = np.array(places)
    gone_m = np.concatenate([[0.0], np.cumsum(np.hypot(*np.diff(corners, axis=0).T))])
    within = gone_m < WISH_M
    end_m = min(WISH_M, gone_m[-1])
    end = [np.interp(end_m, gone_m, axis) for axis in corners.T]
    return np.vstack([corners[within], end])


@dataclass(frozen=True, kw_only=True)
class InFleet:
    """What a mission has to know of the fleet that its boat is one of: `lookout` is the boat's, and
    `stands_by` says whether it is to wait when it is done, for others still sail.
    """

    lookout: Lookout
    stands_by: Callable[[], bool]
