"""Go where it pays: which places to measure next, within a budget of time.

A pure choice: what is known of the water is the covariance of its signal at the places that can be
gone to, given all that was measured, and how much each of them matters. The boat reads on its way
too, so a place is worth what a reading there and the readings along the new legs take off the
weighted variance all over the water, over the time that the way to it adds; the best is taken, the
covariance brought up to date for all places that are now passed, and so on until the time is
spent. For variance it is within 1 - 1/e of the best of as many places, for what one reading adds is
less the more are taken (Krause, Singh and Guestrin 2008, JMLR 9, on near-optimal sensor
placements); the way's cost makes a heuristic of it.

Boats that explore together plan one after the other, each as if what the others have announced were
read already (sequential allocation: Singh, Krause, Guestrin and Kaiser 2009, JAIR 34, on efficient
informative sensing using multiple robots). What that loses on the best of all joint plans is
bounded as the single planner's own loss is.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from itertools import pairwise
from typing import TYPE_CHECKING

import numpy as np
from scipy.linalg import cho_factor, cho_solve
from scipy.spatial import KDTree

from grebe.planning.ways.place_ways import PlaceWays

if TYPE_CHECKING:
    from numpy.typing import NDArray

    Array = NDArray[np.floating]

# A place costs this much at least [s]: a reading or two.
LEAST_S = 2.0
# A leg's worth is told from so many points of it.
POINTS = 8
# The way is shortened after so many places.
SHORTENED_EACH = 10


@dataclass(frozen=True, kw_only=True)
class Worth:
    """What places (m, 2) are worth: `covariance` (m, m) of the signal there given what was
    measured, `noise` the variance of what is read while the boat passes one, `weights` (m,) how
    much each place matters, and `apart_m` how far two readings on the way are from each other that
    tell different things.
    """

    places: Array
    covariance: Array
    noise: float
    weights: Array
    apart_m: float


def once_read(worth: Worth, ways: PlaceWays, announced: Sequence[Array]) -> Worth:
    """Return what places are worth once others have read along ways (k, 2) that they announced."""
    passed = sorted({place for way in announced for place in ways.passed(way)})
    if not passed:
        return worth
    seen = worth.covariance[:, passed]
    system = worth.covariance[np.ix_(passed, passed)] + worth.noise * np.eye(len(passed))
    gone = seen @ cho_solve(cho_factor(system), seen.T)
    return replace(worth, covariance=worth.covariance - 0.5 * (gone + gone.T))


def chosen_places(
    worth: Worth, ways: PlaceWays, start: int, budget_s: float, pace_mps: float, turn_m: float
) -> tuple[list[int], Array]:
    """Return the places to go to, by their numbers, and the variance (m,) that is left then.

    The way from the place `start` through them keeps the budget at `pace_mps`; to be gone to a
    place must be worth its way and `turn_m` for each radian that the boat turns there.
    """
    chosen = _Choice(worth, ways, start)
    open_ = np.ones(len(worth.places), dtype=bool)
    open_[start] = False
    while open_.any():
        added_m, at = chosen.insertions()
        price_s = np.maximum((added_m + turn_m * chosen.turns(at)) / pace_mps, LEAST_S)
        allowed = open_ & (chosen.length_m + added_m <= budget_s * pace_mps)
        if not allowed.any():
            before = chosen.length_m
            chosen.shorten()
            if chosen.length_m < before - 1e-9:
                continue
            break
        # To some there may be no way: they cost without end, and are not allowed.
        worth_each = np.full(len(allowed), -np.inf)
        np.divide(chosen.gains(at), price_s, out=worth_each, where=allowed)
        best = int(np.argmax(worth_each))
        chosen.take(best, int(at[best]))
        open_[best] = False
        if len(chosen.route) % SHORTENED_EACH == 0:
            chosen.shorten()
    return chosen.route, chosen.left()


class _Choice:
    """The way chosen so far, and the covariance of the signal given what is read along it."""

    def __init__(self, worth: Worth, ways: PlaceWays, start: int) -> None:
        self._worth, self._ways, self._start = worth, ways, start
        self._tree = KDTree(worth.places)
        self._covariance = worth.covariance.copy()
        self._passed = {start}
        self.route: list[int] = []
        self._read(start)

    @property
    def _way(self) -> NDArray[np.int64]:
        """The places of the way, the start with them."""
        return np.array([self._start, *self.route])

    @property
    def length_m(self) -> float:
        """How long the way is."""
        way = self._way
        return float(self._ways.lengths_m[way[:-1], way[1:]].sum())

    def insertions(self) -> tuple[Array, NDArray[np.int64]]:
        """How much longer the way is with each place at the best position of it, and that."""
        way = self._way
        away = self._ways.lengths_m[:, way]
        legs = self._ways.lengths_m[way[:-1], way[1:]]
        added = np.column_stack([away[:, :-1] + away[:, 1:] - legs[None, :], away[:, -1]])
        position = np.argmin(added, axis=1)
        return added[np.arange(len(away)), position], position

    def turns(self, at: NDArray[np.int64]) -> Array:
        """By how much the boat turns at each place at its position, or before it where that is the
        last [rad].
        """
        places = self._worth.places
        way = self._way
        last = at == len(way) - 1
        corner = np.where(last, way[at], np.arange(len(places)))
        came_from = np.where(last, way[np.maximum(at - 1, 0)], way[at])
        goes_to = np.where(last, np.arange(len(places)), way[np.minimum(at + 1, len(way) - 1)])
        into, out = places[corner] - places[came_from], places[goes_to] - places[corner]
        cross = into[:, 0] * out[:, 1] - into[:, 1] * out[:, 0]
        return np.abs(np.arctan2(cross, np.sum(into * out, axis=1)))

    def gains(self, at: NDArray[np.int64]) -> Array:
        """What each place at its position takes off the weighted variance, with the readings on
        the legs to it and from it.
        """
        worth = self._worth
        one = worth.weights @ self._covariance**2 / (np.diag(self._covariance) + worth.noise)
        way = self._way
        last = at == len(way) - 1
        gains = one + self._on_leg(one, way[at])
        after = way[np.minimum(at + 1, len(way) - 1)]
        return gains + np.where(last, 0.0, self._on_leg(one, after))

    def _on_leg(self, one: Array, ends: NDArray[np.int64]) -> Array:
        """What is read on the legs between all places and `ends` (m,), as if straight."""
        places = self._worth.places
        shares = (np.arange(POINTS) + 0.5) / POINTS
        points = places[ends][:, None] + shares[None, :, None] * (places - places[ends])[:, None]
        met = self._tree.query(points.reshape(-1, 2))[1].reshape(-1, POINTS)
        length = self._ways.lengths_m[np.arange(len(places)), ends]
        return length / self._worth.apart_m * one[met].mean(axis=1)

    def take(self, place: int, position: int) -> None:
        """Go to a place too, and read on the way."""
        self.route.insert(position, place)
        way = [self._start, *self.route]
        for a, b in zip(
            way[position : position + 2], way[position + 1 : position + 3], strict=False
        ):
            for passed in self._ways.along(a, b):
                if passed not in self._passed:
                    self._passed.add(passed)
                    self._read(passed)

    def _read(self, place: int) -> None:
        column = self._covariance[:, place].copy()
        self._covariance -= np.outer(column, column) / (column[place] + self._worth.noise)

    def shorten(self) -> None:
        """Turn stretches of the way round for as long as that makes it shorter (2-opt)."""
        lengths = self._ways.lengths_m
        way = self._way
        found = True
        while found:
            found = False
            for i in range(1, len(way) - 1):
                ends = np.arange(i + 1, len(way))
                after = np.append(lengths[way[i], way[ends[:-1] + 1]], 0.0)
                cut = np.append(lengths[way[ends[:-1]], way[ends[:-1] + 1]], 0.0)
                gain = lengths[way[i - 1], way[i]] + cut - lengths[way[i - 1], way[ends]] - after
                best = int(np.argmax(gain))
                if gain[best] > 1e-9:
                    way[i : ends[best] + 1] = way[i : ends[best] + 1][::-1].copy()
                    found = True
        self.route = way[1:].tolist()

    def left(self) -> Array:
        """The variance that is left after what is read along the way as it now is."""
        way = [self._start, *self.route]
        met = {one for a, b in pairwise(way) for one in self._ways.along(a, b)}
        passed = sorted({self._start, *met})
        covariance, noise = self._worth.covariance, self._worth.noise
        seen = covariance[:, passed]
        system = covariance[np.ix_(passed, passed)] + noise * np.eye(len(passed))
        gone = np.einsum("ij,ji->i", seen, np.linalg.solve(system, seen.T))
        return np.maximum(np.diag(covariance) - gone, 0.0)
