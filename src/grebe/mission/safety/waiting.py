"""Deadlocks among waiting boats: boats that wait for each other in a ring wait for ever.

A waiting boat can go on only once all boats that it waits for have moved. A ring in the graph of
who waits for whom is therefore a deadlock, and without a ring there is none (Coffman, Elphick and
Shoshani 1971, ACM Computing Surveys 3:2, "System deadlocks", for single-unit resources).
"""

from __future__ import annotations

import enum
import math
from collections.abc import Mapping
from dataclasses import dataclass

from grebe.mission.safety.states import Place

# A boat makes progress if it comes this much nearer [m].
NEARER_M = 0.5


class Stuck(enum.Enum):
    """What a waiting boat does: it waits on, goes before its turn, goes home to give way, or gives
    up.
    """

    WAITS = "waits"
    GOES_FIRST = "goes first"
    GOES_HOME = "goes home"
    GIVES_UP = "gives up"


@dataclass(frozen=True, kw_only=True)
class Waiting:
    """What is known of a waiting boat.

    `claimed_by` are the numbers of the boats whose claims are on its path, and `wished_by` those of
    boats that only wish to go there. `home_m` is the length of its route home [m], infinite if it
    cannot give way by going home. `gives_way`: it is giving way already.
    """

    claimed_by: frozenset[int]
    wished_by: frozenset[int] = frozenset()
    home_m: float = math.inf
    gives_way: bool = False

    @property
    def waits_for(self) -> frozenset[int]:
        """All boats for which it waits."""
        return self.claimed_by | self.wished_by


@dataclass(frozen=True, kw_only=True)
class Approach:
    """The least distance of a boat to the place `towards` which it goes [m], and when it last came
    nearer [s].
    """

    towards: Place | None = None
    nearest_m: float = math.inf
    since_s: float = math.inf

    def seen(self, place: Place, towards: Place | None, time_s: float) -> Approach:
        """Return the approach, updated with the boat's present place."""
        away_m = math.inf if towards is None else math.dist(place, towards)
        if towards == self.towards and away_m > self.nearest_m - NEARER_M:
            return self
        return Approach(towards=towards, nearest_m=away_m, since_s=time_s)

    def idle_s(self, time_s: float) -> float:
        """Return for how long the boat has not come nearer [s]."""
        return max(time_s - self.since_s, 0.0)


def ring(waits: Mapping[int, Waiting], boat: int) -> frozenset[int]:
    """Return the boats in a ring of waiting with this one, including itself; empty if it is in no
    ring.
    """
    after = _waited_for(waits, boat)
    if boat not in after:
        return frozenset()
    return frozenset(one for one in after if boat in _waited_for(waits, one))


def who_gives_way(waits: Mapping[int, Waiting], among: frozenset[int]) -> int | None:
    """Return the boat of a ring that goes home: the one nearest to its harbour, because no other is
    on its route there; None if no boat can.
    """
    nearest = min(among, key=lambda boat: (waits[boat].home_m, boat), default=None)
    return nearest if nearest is not None and math.isfinite(waits[nearest].home_m) else None


def _waited_for(waits: Mapping[int, Waiting], boat: int) -> set[int]:
    """Return all boats for which a boat waits, directly or through others."""
    found: set[int] = set()
    left = [boat]
    while left:
        waiting = waits.get(left.pop())
        new = set() if waiting is None else set(waiting.waits_for) - found
        found |= new
        left += sorted(new)
    return found
