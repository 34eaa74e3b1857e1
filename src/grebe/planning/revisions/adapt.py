"""Choose the places to measure next, within a budget of time.

The choice is a pure function of the covariance of the signal at the places within reach, given all
measurements, and of a weight for each place. A place is worth the reduction of the weighted
variance over all the water, by a reading there and by the readings along the new legs, divided by
the time that the detour adds. The best place is taken, the covariance is updated for all places
that are now passed, and so on until the time is spent. For variance, this greedy choice reaches at
least 1 - 1/e of the best reduction by as many places, because each reading adds less the more are
taken (Krause, Singh and Guestrin 2008, JMLR 9, on near-optimal sensor placements). With the cost of
the path it is a heuristic.

Boats that explore together plan one after the other, each as if the readings that the others have
announced were taken already (sequential allocation: Singh, Krause, Guestrin and Kaiser 2009, JAIR
34, on efficient informative sensing using multiple robots). The loss against the best joint plan is
bounded like the single planner's own loss.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from itertools import pairwise
from typing import TYPE_CHECKING

import numpy as np
from scipy.linalg import cho_factor, cho_solve
from scipy.spatial import KDTree

from grebe.planning.paths.place_paths import PlacePaths

if TYPE_CHECKING:
    from numpy.typing import NDArray

    Array = NDArray[np.floating]

# The least cost of a place [s]: a reading or two.
LEAST_S = 2.0
# The worth of a leg is estimated from this many of its points.
POINTS = 8
# The path is shortened each time it has this many more places.
SHORTENED_EACH = 10


@dataclass(frozen=True, kw_only=True)
class Worth:
    """What determines the worth of `places` (m, 2).

    `covariance` (m, m): of the signal there, given the measurements; `noise`: the variance of what
    is read while the boat passes a place; `weights` (m,): how much each place matters; `apart_m`:
    the distance between two readings on the path that give different information.
    """

    places: Array
    covariance: Array
    noise: float
    weights: Array
    apart_m: float


def once_read(worth: Worth, paths: PlacePaths, announced: Sequence[Array]) -> Worth:
    """Return what places are worth once others have read along the paths (k, 2) they announced."""
    passed = sorted({place for tour in announced for place in paths.passed(tour)})
    if not passed:
        return worth
    seen = worth.covariance[:, passed]
    system = worth.covariance[np.ix_(passed, passed)] + worth.noise * np.eye(len(passed))
    gone = seen @ cho_solve(cho_factor(system), seen.T)
    return replace(worth, covariance=worth.covariance - 0.5 * (gone + gone.T))


def chosen_places(
    worth: Worth, paths: PlacePaths, start: int, budget_s: float, pace_mps: float, turn_m: float
) -> tuple[list[int], Array]:
    """Return the places to visit, by their numbers, and the variance (m,) that is left then.

    The path from the place `start` through them keeps the budget at `pace_mps`. The price of a
    place is the path that it adds, and `turn_m` for each radian that the boat turns there.
    """
    chosen = _Choice(worth, paths, start)
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
        # Places that no path leads to have an infinite price, and are not allowed.
        worth_each = np.full(len(allowed), -np.inf)
        np.divide(chosen.gains(at), price_s, out=worth_each, where=allowed)
        best = int(np.argmax(worth_each))
        chosen.take(best, int(at[best]))
        open_[best] = False
        if len(chosen.route) % SHORTENED_EACH == 0:
            chosen.shorten()
    return chosen.route, chosen.left()


class _Choice:
    """The path chosen so far, and the covariance of the signal given the readings along it."""

    def __init__(self, worth: Worth, paths: PlacePaths, start: int) -> None:
        self._worth, self._paths, self._start = worth, paths, start
        self._tree = KDTree(worth.places)
        self._covariance = worth.covariance.copy()
        self._passed = {start}
        self.route: list[int] = []
        self._read(start)

    @property
    def _tour(self) -> NDArray[np.int64]:
        """The places of the path, including the start."""
        return np.array([self._start, *self.route])

    @property
    def length_m(self) -> float:
        """Length of the path [m]."""
        tour = self._tour
        return float(self._paths.lengths_m[tour[:-1], tour[1:]].sum())

    def insertions(self) -> tuple[Array, NDArray[np.int64]]:
        """By how much each place at its best position lengthens the path [m], and that position."""
        tour = self._tour
        away = self._paths.lengths_m[:, tour]
        legs = self._paths.lengths_m[tour[:-1], tour[1:]]
        added = np.column_stack([away[:, :-1] + away[:, 1:] - legs[None, :], away[:, -1]])
        position = np.argmin(added, axis=1)
        return added[np.arange(len(away)), position], position

    def turns(self, at: NDArray[np.int64]) -> Array:
        """By how much the boat turns at each place at its position, or at the place before it if it
        is the last [rad].
        """
        places = self._worth.places
        tour = self._tour
        last = at == len(tour) - 1
        corner = np.where(last, tour[at], np.arange(len(places)))
        came_from = np.where(last, tour[np.maximum(at - 1, 0)], tour[at])
        goes_to = np.where(last, np.arange(len(places)), tour[np.minimum(at + 1, len(tour) - 1)])
        into, out = places[corner] - places[came_from], places[goes_to] - places[corner]
        cross = into[:, 0] * out[:, 1] - into[:, 1] * out[:, 0]
        return np.abs(np.arctan2(cross, np.sum(into * out, axis=1)))

    def gains(self, at: NDArray[np.int64]) -> Array:
        """The reduction of the weighted variance by each place at its position, including readings
        on the legs to it and from it.
        """
        worth = self._worth
        one = worth.weights @ self._covariance**2 / (np.diag(self._covariance) + worth.noise)
        tour = self._tour
        last = at == len(tour) - 1
        gains = one + self._on_leg(one, tour[at])
        after = tour[np.minimum(at + 1, len(tour) - 1)]
        return gains + np.where(last, 0.0, self._on_leg(one, after))

    def _on_leg(self, one: Array, ends: NDArray[np.int64]) -> Array:
        """The reduction by readings on the legs between all places and `ends` (m,), if straight."""
        places = self._worth.places
        shares = (np.arange(POINTS) + 0.5) / POINTS
        points = places[ends][:, None] + shares[None, :, None] * (places - places[ends])[:, None]
        met = self._tree.query(points.reshape(-1, 2))[1].reshape(-1, POINTS)
        length = self._paths.lengths_m[np.arange(len(places)), ends]
        return length / self._worth.apart_m * one[met].mean(axis=1)

    def take(self, place: int, position: int) -> None:
        """Insert a place into the path, and take the readings on its legs."""
        self.route.insert(position, place)
        tour = [self._start, *self.route]
        for a, b in zip(
            tour[position : position + 2], tour[position + 1 : position + 3], strict=False
        ):
            for passed in self._paths.along(a, b):
                if passed not in self._passed:
                    self._passed.add(passed)
                    self._read(passed)

    def _read(self, place: int) -> None:
        column = self._covariance[:, place].copy()
        self._covariance -= np.outer(column, column) / (column[place] + self._worth.noise)

    def shorten(self) -> None:
        """Reverse stretches of the path for as long as that makes it shorter (2-opt)."""
        lengths = self._paths.lengths_m
        tour = self._tour
        found = True
        while found:
            found = False
            for i in range(1, len(tour) - 1):
                ends = np.arange(i + 1, len(tour))
                after = np.append(lengths[tour[i], tour[ends[:-1] + 1]], 0.0)
                cut = np.append(lengths[tour[ends[:-1]], tour[ends[:-1] + 1]], 0.0)
                gain = (
                    lengths[tour[i - 1], tour[i]] + cut - lengths[tour[i - 1], tour[ends]] - after
                )
                best = int(np.argmax(gain))
                if gain[best] > 1e-9:
                    tour[i : ends[best] + 1] = tour[i : ends[best] + 1][::-1].copy()
                    found = True
        self.route = tour[1:].tolist()

    def left(self) -> Array:
        """The variance that is left after the readings along the current path."""
        tour = [self._start, *self.route]
        met = {one for a, b in pairwise(tour) for one in self._paths.along(a, b)}
        passed = sorted({self._start, *met})
        covariance, noise = self._worth.covariance, self._worth.noise
        seen = covariance[:, passed]
        system = covariance[np.ix_(passed, passed)] + noise * np.eye(len(passed))
        gone = np.einsum("ij,ji->i", seen, np.linalg.solve(system, seen.T))
        return np.maximum(np.diag(covariance) - gone, 0.0)
