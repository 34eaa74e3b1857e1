"""The time of a fleet whose boats sail one sortie each at the same time, then the next.

A boat that sets out from another harbour than before is first brought there by land. The time of a
sortie includes the path from its harbour to its first cell, and the path home.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass
from itertools import pairwise, zip_longest

from grebe.core.revision import PlanRevision, Sortie

# Time to bring a boat to another harbour by land [s].
MOVE_S = 1800.0
# Sorties that start within this distance of each other have the same harbour [m].
SAME_HARBOUR_M = 1.0


@dataclass(frozen=True, kw_only=True)
class BoatTime:
    """The prediction for one boat of a fleet: its number, its time under way [s], the number of its
    `sorties`, and how often it is moved to another harbour.
    """

    boat: int
    under_way_s: float
    sorties: int
    moves: int

    @property
    def time_s(self) -> float:
        """Time under way and by land [s]."""
        return self.under_way_s + MOVE_S * self.moves


def boat_times(revision: PlanRevision) -> list[BoatTime]:
    """Return the prediction for each boat, in the order of the boats' numbers."""
    return [
        BoatTime(
            boat=boat,
            under_way_s=sum(one.time_s for one in own),
            sorties=len(own),
            moves=sum(_moves(own)),
        )
        for boat, own in sorted(_sorties_of(revision).items())
    ]


def fleet_s(revision: PlanRevision) -> float:
    """Return the time until the last boat of a fleet is home [s]. Before each next round, all wait
    for the slowest boat of the round, including its transport by land.
    """
    takes_s = [
        [one.time_s + MOVE_S * moves for one, moves in zip(own, _moves(own), strict=True)]
        for own in _sorties_of(revision).values()
    ]
    return sum(max(at_once) for at_once in zip_longest(*takes_s, fillvalue=0.0))


def _sorties_of(revision: PlanRevision) -> dict[int, list[Sortie]]:
    """The sorties of each boat, in the order in which it sails them."""
    found: dict[int, list[Sortie]] = {}
    for one in revision.sorties:
        found.setdefault(one.boat, []).append(one)
    return found


def _moves(own: Sequence[Sortie]) -> list[bool]:
    """Whether a boat is brought to another harbour before each of its sorties."""
    places = [(one.start.north_m, one.start.east_m) for one in own]
    changes = [math.dist(*two) > SAME_HARBOUR_M for two in pairwise(places)]
    return [False, *changes]
