"""A boat's lookout: what of the others its guard has to know, and what the others know of it."""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np
import shapely
from shapely.geometry.base import BaseGeometry

from grebe.mission.safety.fence import Fence
from grebe.mission.safety.states import Place
from grebe.mission.safety.traffic import WANDER_M, Traffic

if TYPE_CHECKING:
    from numpy.typing import NDArray

# So far ahead a boat says where it wishes to go [m]; it goes on when as much of its way is clear.
WISH_M = 12.0
# Boats farther apart than this need no lookout: two of them stop within less.
NEAR_M = 60.0
# A boat that waits, waits so long at least, and at most: then others stand in its way for good [s].
LEAST_WAIT_S, LONGEST_WAIT_S = 2.0, 600.0
# With each time that it is refused on its way to a place a boat asks for so much more room beside
# it, up to the second: a large hull turns wide [m].
MORE_ROOM_M, MOST_ROOM_M = 1.0, 12.0


@dataclass
class Lookout:
    """What one boat, by its number, sees of a fleet's traffic. `is_done`: it has nothing left to
    do, and makes room for all. `room_m`: what it asks for beside its way `towards` a place.
    """

    traffic: Traffic
    boat: int
    is_done: bool = False
    room_m: float = 0.0
    towards: Place | None = None

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

    def refused(self) -> None:
        """The boat has to wait: it asks for more room from now on."""
        self.room_m = min(self.room_m + MORE_ROOM_M, MOST_ROOM_M)

    def wish(self, place: Place, towards: Place | None) -> None:
        """Say where the boat would go next; for another place than before it needs no more room
        than others.
        """
        if towards != self.towards:
            self.towards, self.room_m = towards, 0.0
        way = None if towards is None else _way_to(place, towards)
        self.traffic.wish(self.boat, way, self.room_m)

    def is_clear(self, place: Place, towards: Place) -> bool:
        """Whether the next piece of the way is neither claimed nor wished by others."""
        way = shapely.LineString(_way_to(place, towards))
        return not self._blocked().intersects(way)

    def place_to_wait(self, fence: Fence, place: Place) -> Place:
        """Where to wait in nobody's way, if a straight way leads there; else where the boat is."""
        if not self._wished().intersects(shapely.Point(place)):
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


def _way_to(place: Place, towards: Place) -> NDArray[np.float64]:
    north, east = towards[0] - place[0], towards[1] - place[1]
    share = min(1.0, WISH_M / max(math.hypot(north, east), 1e-9))
    return np.array([place, (place[0] + share * north, place[1] + share * east)])


@dataclass(frozen=True, kw_only=True)
class InFleet:
    """What a mission has to know of the fleet that its boat is one of: `lookout` is the boat's, and
    `stands_by` says whether it is to wait when it is done, for others still sail.
    """

    lookout: Lookout
    stands_by: Callable[[], bool]
