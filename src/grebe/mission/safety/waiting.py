"""Who waits for whom: boats of which each waits for another, round in a ring, wait for good.

A boat that waits needs all of those to move that it waits for, so a ring in the graph of who waits
for whom is a deadlock, and without a ring there is none (Coffman, Elphick and Shoshani 1971, ACM
Computing Surveys 3:2, "System deadlocks", for resources of which there is one each).
"""

from __future__ import annotations

import enum
import math
from collections.abc import Mapping
from dataclasses import dataclass

from grebe.mission.safety.states import Place

# A boat that comes so much nearer gets on [m].
NEARER_M = 0.5


class Stuck(enum.Enum):
    """What a boat does that waits: it waits on, goes before its turn, makes way and goes home, or
    gives up.
    """

    WAITS = "waits"
    GOES_FIRST = "goes first"
    GOES_HOME = "goes home"
    GIVES_UP = "gives up"


@dataclass(frozen=True, kw_only=True)
class Waiting:
    """What is known of a boat that waits: the numbers of the boats whose water is in its way, and
    of those whose mere wish is; the length of its way home [m], infinite for one that cannot make
    way so; and whether it is making way already.
    """

    claimed_by: frozenset[int]
    wished_by: frozenset[int] = frozenset()
    home_m: float = math.inf
    makes_way: bool = False

    @property
    def waits_for(self) -> frozenset[int]:
        """All for whom it waits."""
        return self.claimed_by | self.wished_by


@dataclass(frozen=True, kw_only=True)
class Approach:
    """How near a boat has come to the place `towards` which it goes [m], and when it last came
    nearer [s].
    """

    towards: Place | None = None
    nearest_m: float = math.inf
    since_s: float = math.inf

    def seen(self, place: Place, towards: Place | None, time_s: float) -> Approach:
        """The approach after the boat has been seen at a place."""
        away_m = math.inf if towards is None else math.dist(place, towards)
        if towards == self.towards and away_m > self.nearest_m - NEARER_M:
            return self
        return Approach(towards=towards, nearest_m=away_m, since_s=time_s)

    def idle_s(self, time_s: float) -> float:
        """For how long the boat has not come nearer."""
        return max(time_s - self.since_s, 0.0)


def ring(waits: Mapping[int, Waiting], boat: int) -> frozenset[int]:
    """Return the boats that wait for each other with this one, itself among them; empty where it
    is in no ring.
    """
    after = _waited_for(waits, boat)
    if boat not in after:
        return frozenset()
    return frozenset(one for one in after if boat in _waited_for(waits, one))


def who_makes_way(waits: Mapping[int, Waiting], among: frozenset[int]) -> int | None:
    """Return the boat of a ring that goes home: the nearest to its harbour, for no other lies on
    its way there; None where none can.
    """
    nearest = min(among, key=lambda boat: (waits[boat].home_m, boat), default=None)
    return nearest if nearest is not None and math.isfinite(waits[nearest].home_m) else None


def _waited_for(waits: Mapping[int, Waiting], boat: int) -> set[int]:
    """All for whom a boat waits, at first hand or through others."""
    found: set[int] = set()
    left = [boat]
    while left:
        waiting = waits.get(left.pop())
        new = set() if waiting is None else set(waiting.waits_for) - found
        found |= new
        left += sorted(new)
    return found
