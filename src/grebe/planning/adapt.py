"""Go where it pays: which places to measure next, within a budget of time.

A pure choice: what is known of the water is the covariance of its signal at the places that can be
gone to, given all that was measured, and how much each of them matters. A place is worth what a
reading there takes off the weighted variance all over the water, over the time that the way to it
adds; the best is taken, the covariance brought up to date, and so on until the time is spent. For
variance that is within 1 - 1/e of the best of as many places, for what one reading adds is less the
more are taken (Krause, Singh and Guestrin 2008, JMLR 9, on near-optimal sensor placements); the
way's cost makes a heuristic of it.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np

if TYPE_CHECKING:
    from numpy.typing import NDArray

    Array = NDArray[np.floating]

# A stop costs this much at least [s]: the readings of a second or two, and the turn.
LEAST_S = 2.0


@dataclass(frozen=True, kw_only=True)
class Worth:
    """What places (m, 2) are worth: `covariance` (m, m) of the signal there given what was
    measured, `noise` the variance of a reading, `weights` (m,) how much each place matters.
    """

    places: Array
    covariance: Array
    noise: float
    weights: Array


def chosen_places(
    worth: Worth, start: tuple[float, float], budget_s: float, pace_mps: float, turn_s: float
) -> tuple[list[int], Array]:
    """Return the places to go to, by their numbers, and the variance (m,) that is left then.

    The time of the way from the start through them, by cheapest insertion on straight legs at
    `pace_mps` with `turn_s` a stop, keeps the budget.
    """
    covariance = worth.covariance.copy()
    route: list[int] = []
    spent_s = 0.0
    open_ = np.ones(len(worth.places), dtype=bool)
    while open_.any():
        gains = _gains(covariance, worth.noise, worth.weights)
        added_s, at = _insertion_s(worth.places, route, start, pace_mps)
        added_s = np.maximum(added_s + turn_s, LEAST_S)
        allowed = open_ & (spent_s + added_s <= budget_s)
        if not allowed.any():
            break
        best = int(np.argmax(np.where(allowed, gains / added_s, -np.inf)))
        spent_s += float(added_s[best])
        route.insert(int(at[best]), best)
        open_[best] = False
        column = covariance[:, best].copy()
        covariance -= np.outer(column, column) / (column[best] + worth.noise)
    return route, np.maximum(np.diag(covariance), 0.0)


def _gains(covariance: Array, noise: float, weights: Array) -> Array:
    """What a reading at each place takes off the weighted variance of all."""
    return (weights @ covariance**2) / (np.diag(covariance) + noise)


def _insertion_s(
    places: Array, route: list[int], start: tuple[float, float], pace_mps: float
) -> tuple[Array, NDArray[np.int64]]:
    """The time that each place adds to a way at the best position of it, and that position."""
    way = np.array([start, *places[route]])
    away = np.hypot(*(places[:, None, :] - way[None, :, :]).transpose(2, 0, 1))
    legs = np.hypot(*np.diff(way, axis=0).T)
    between = away[:, :-1] + away[:, 1:] - legs[None, :]
    added = np.column_stack([between, away[:, -1]])
    position = np.argmin(added, axis=1)
    return added[np.arange(len(places)), position] / pace_mps, position
