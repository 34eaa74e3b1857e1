"""A boat's lookout: what its guard needs to know of the other boats, and what they know of it."""

from __future__ import annotations

import math
from collections.abc import Callable, Collection
from dataclasses import dataclass, field, replace
from typing import TYPE_CHECKING

import numpy as np
import shapely
from shapely.geometry.base import BaseGeometry

from grebe.control.separation import AnnouncedPath
from grebe.mission.consumption import AT_HARBOUR_M
from grebe.mission.safety.fence import Fence
from grebe.mission.safety.states import Cause, Place
from grebe.mission.safety.traffic import WANDER_M, Traffic
from grebe.mission.safety.waiting import Approach, Stuck

if TYPE_CHECKING:
    from numpy.typing import NDArray

# A boat announces where it wishes to go this far ahead [m], through at most this many sets. A
# waiting boat goes on once its path to the first of them is clear, or this length of the path.
WISH_M, WISHED_SETS = 12.0, 8
# Boats farther apart than this need no lookout: two of them stop within less [m].
NEAR_M = 60.0
# The least and the longest time that a boat waits; after the longest, the others block it for good
# [s].
LEAST_WAIT_S, LONGEST_WAIT_S = 2.0, 600.0
# Boats that wait for each other are stuck once they have waited for `STUCK_S` on their path to one
# place. After `LONG_STUCK_S` it has not helped that one of them gave way [s].
STUCK_S, LONG_STUCK_S = 6.0, 60.0
# Each time that a boat is refused on its path to a place, it requires `MORE_ROOM_M` more room
# beside the path, up to `MOST_ROOM_M`: a large hull turns wide [m].
MORE_ROOM_M, MOST_ROOM_M = 1.0, 12.0


@dataclass
class Lookout:
    """The view that one boat, given by its number, has of a fleet's traffic.

    `is_done`: the boat has nothing left to do and makes room for all others. `room_m` is the room
    that it requires beside its path `towards` a place, and `waited_s` the time that it has waited
    for others on that path. `harbour` is where it is launched and taken ashore, or None for a boat
    that is on the water before and after; `is_afloat` says whether it is on the water now.
    `renewed` are the causes of going home that end there, such as a spent battery. The boat went
    home to give way to others (`gave_way`), for a cause that ends there (`is_spent`), or on
    request (`is_called`).
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
        """Whether the boat is on the water. A boat ashore is launched once no other boat claims
        its place or wishes to go there.
        """
        if self.is_afloat:
            return True
        if self.traffic.wished(self.boat, by_all=True).intersects(shapely.Point(place)):
            return False
        self.is_afloat = self.traffic.claim(self.boat, np.array([place]))
        return self.is_afloat

    @property
    def sails_again(self) -> bool:
        """Whether the boat, once home, may set out again for its remaining targets."""
        return (self.gave_way or self.is_spent) and not self.is_called

    def sent_home(self, cause: Cause | None) -> None:
        """Note that the boat goes home: for other boats, for a cause that ends there, or for a
        fault.
        """
        self.gave_way = self.gave_way or cause is Cause.TRAFFIC
        self.is_spent = self.is_spent or cause in self.renewed

    def goes(self, place: Place, time_s: float) -> None:
        """Note that the boat is under way. If its plans no longer bring it nearer to its place
        because other boats are there, it waits for them as a stopped boat does.
        """
        self._seen_s = None
        self._approach = self._approach.seen(place, self.towards, time_s)
        waiting = None
        if self.towards is not None and self._approach.idle_s(time_s) > STUCK_S:
            path = _path_to(place, self.towards)
            stands = self.traffic.in_the_way(self.boat, path, of_plan=True)
            waiting = stands if stands.waits_for else None
        self.traffic.waits(self.boat, waiting)

    def waits(
        self, place: Place, towards: Place, time_s: float, held_s: float, home_m: float
    ) -> Stuck:
        """Note that the boat waits to go on towards a place, and return what it is to do.

        It has been held for `held_s`. `home_m` is the length of its route home [m], infinite if it
        cannot give way by going home.
        """
        self.waited_s += 0.0 if self._seen_s is None else time_s - self._seen_s
        self._seen_s, self._approach = time_s, Approach()
        stands = self.traffic.in_the_way(self.boat, _path_to(place, towards))
        gives_way = self.gave_way and not math.isfinite(home_m)
        self.traffic.waits(self.boat, replace(stands, home_m=home_m, gives_way=gives_way))
        stuck = Stuck.WAITS
        if self.waited_s > STUCK_S:
            stuck = self.traffic.stuck(self.boat, for_long=self.waited_s > LONG_STUCK_S)
        if stuck is not Stuck.WAITS or held_s <= LONGEST_WAIT_S:
            return stuck
        if math.isfinite(home_m):
            return Stuck.GOES_HOME
        # On its route to a harbour it waits as long as others sail: they may end before it.
        waits_on = self.harbour is not None and not self.traffic.is_blocked_for_good(self.boat)
        return Stuck.WAITS if waits_on else Stuck.GIVES_UP

    @property
    def is_alone(self) -> bool:
        """Whether no other boat is sailing any more."""
        return self.traffic.is_alone(self.boat)

    def over(self, place: Place, *, came_home: bool) -> None:
        """End the boat's mission: it is taken ashore if it came home, and otherwise stays."""
        harbour = self.harbour
        near = harbour is not None and math.dist(place, harbour) < AT_HARBOUR_M
        self.traffic.leave(self.boat, ashore=came_home and near)

    def is_near(self, place: Place) -> bool:
        """Whether another boat is near enough for its claim to matter."""
        return self.traffic.nearest_m(self.boat, place) < NEAR_M

    def fence(self, fence: Fence, place: Place) -> Fence:
        """Return the fence around a place, without the water that others claim, or that those with
        precedence wish to cross.
        """
        return fence.without(self._blocked(), place, NEAR_M)

    def claim(self, path: NDArray[np.float64]) -> bool:
        """Claim a path (n, 2) [m]; return False if another boat holds it."""
        return self.traffic.claim(self.boat, path)

    def announce(self, plan: AnnouncedPath) -> None:
        """Announce where the boat is going to be."""
        self.traffic.announce(self.boat, plan)

    def announced(self, place: Place) -> list[AnnouncedPath]:
        """Return where the others are going to be, if any of them is near to a place."""
        return self.traffic.announced(self.boat) if self.is_near(place) else []

    def refused(self) -> None:
        """Note that the boat has to wait; it requires more room from now on."""
        self.room_m = min(self.room_m + MORE_ROOM_M, MOST_ROOM_M)

    def wish(self, place: Place, *places: Place) -> None:
        """Announce where the boat would go next, from a place through others. When the first of
        these changes, the required room and the time waited start again from zero.
        """
        towards = places[0] if places else None
        if towards != self.towards:
            self.towards, self.room_m, self.waited_s = towards, 0.0, 0.0
            self.traffic.takes_turn(self.boat)
        path = _path_to(place, *places) if places else None
        self.traffic.wish(self.boat, path, self.room_m)

    def is_clear(self, place: Place, towards: Place) -> bool:
        """Whether no other boat claims the next piece of the path, and none with precedence wishes
        to cross it.
        """
        path = shapely.LineString(_path_to(place, towards))
        return not self._blocked().intersects(path)

    def place_to_wait(self, fence: Fence, place: Place) -> Place:
        """Return where to wait in nobody's way if a straight path leads there, and otherwise
        `place`.

        A boat that has stopped too near to another to set out again thus backs off.
        """
        if not self._blocked().intersects(shapely.Point(place)):
            return place
        refuge = self.fence(fence, place).refuge(place)
        path = shapely.LineString([place, refuge])
        if not fence.contains_path(np.array([place, refuge])):
            return place
        # A boat that is already too near to another may move away from it, but not cross its water.
        inner = self.traffic.taken(self.boat).buffer(-WANDER_M)
        return place if inner.intersects(path) else refuge

    def _wished(self) -> BaseGeometry:
        return self.traffic.wished(self.boat, by_all=self.is_done)

    def _blocked(self) -> BaseGeometry:
        return self.traffic.taken(self.boat).union(self._wished())


def _path_to(*places: Place) -> NDArray[np.float64]:
    """Return the first `WISH_M` of the path (n, 2) through some places, or all of a shorter one."""
    corners = np.array(places)
    gone_m = np.concatenate([[0.0], np.cumsum(np.hypot(*np.diff(corners, axis=0).T))])
    within = gone_m < WISH_M
    end_m = min(WISH_M, gone_m[-1])
    end = [np.interp(end_m, gone_m, axis) for axis in corners.T]
    return np.vstack([corners[within], end])


@dataclass(frozen=True, kw_only=True)
class InFleet:
    """What a mission has to know of its boat's fleet: the boat's `lookout`, and `stands_by`, which
    returns whether a boat that is done has to wait because others still sail.
    """

    lookout: Lookout
    stands_by: Callable[[], bool]
