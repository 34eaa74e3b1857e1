"""How long a fleet takes: its boats sail one sortie each at once, then the next one each.

A boat that sets out from another harbour than before is brought there by land first. What a sortie
takes holds the way from its harbour to its first cell, and the way home.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass
from itertools import pairwise, zip_longest

from grebe.core.revision import PlanRevision, Sortie

# What it takes to bring a boat to another harbour by land [s].
MOVE_S = 1800.0
# Sorties that set out so near to each other have one harbour [m].
SAME_HARBOUR_M = 1.0


@dataclass(frozen=True, kw_only=True)
class BoatTime:
    """What a boat of a fleet, by its number, is predicted to do: time [s] under way in so many
    `sorties`, and how often it is brought to another harbour.
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
    """Return what each boat is predicted to do, in the order of the boats' numbers."""
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
    """Return how long a fleet takes until the last boat is home [s]: all wait for the slowest of a
    round, the ways by land before it among it, until the next round begins.
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
