"""Keeping apart from others in the horizon: half-planes by where they have announced to be.

At each node the boat has to be beyond a line that has the other's disc - the distance that is kept,
about the place where the other is going to be at that node's time - on its far side. Where the last
plan is clear of the disc the line faces it; where it leads through, the lines are tangents of the
disc on the side on which it is to be passed, which the boat can keep to without having to stop.
docs/theory.md says what follows, and what does not: the claims of `mission.safety.traffic` hold
whether or not a plan keeps apart.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np

from grebe.control.horizon import NO_ROW, Horizon, Plan
from grebe.core.sets import TargetSet

if TYPE_CHECKING:
    from numpy.typing import NDArray

    Array = NDArray[np.float64]

# So many of the others, the nearest, have a row of their own in each node.
MOST_OTHERS = 3
# A node that is farther from another's disc than this has no row: a solve does not move it there.
REACH_M = 10.0
# Boats so near to each other are in one place.
SAME_M = 1e-6
# A plan that leads through so much of the disc's middle has no side yet, and takes the starboard
# one, as all boats do that meet.
NO_SIDE = 0.25


@dataclass(frozen=True, kw_only=True)
class Announced:
    """Where another boat is going to be: `places` (n, 2) [m] at `moments` (n,) [s from now], in
    rising order. It is at the first of them before, and lies at the last one after.
    """

    moments: NDArray[np.float64]
    places: NDArray[np.float64]

    @classmethod
    def lying(cls, place: tuple[float, float]) -> Announced:
        """A boat that stays where it is."""
        return cls(moments=np.zeros(1), places=np.array([place], dtype=float))

    @classmethod
    def of_plan(cls, plan: Plan, age_s: float) -> Announced:
        """A boat that follows a plan that was made so long ago."""
        moments = np.concatenate([[0.0], np.cumsum(plan.durations)]) - age_s
        return cls(moments=moments, places=plan.states[:, :2])

    def at(self, moments: NDArray[np.float64]) -> NDArray[np.float64]:
        """Where it is at other moments (m,) [s from now], (m, 2)."""
        axes = [np.interp(moments, self.moments, axis) for axis in self.places.T]
        return np.column_stack(axes)


def keep_apart(horizon: Horizon, start: Plan, others: Sequence[Announced], apart_m: float) -> None:
    """Ask that each node be `apart_m` from where the others are at its time, as `start` has it.

    Only the nearest count, as many as the horizon has rows for.
    """
    moments = np.concatenate([[0.0], np.cumsum(start.durations)])
    ways = [start.states[:, :2] - other.at(moments) for other in others]
    ways.sort(key=lambda away: float(np.hypot(*away.T).min()))
    horizon.apart[:] = NO_ROW
    for row, away in enumerate(ways[: horizon.shape.apart_rows]):
        normals = _normals(away, apart_m)
        # n (p - q) >= D about q, the other's place, p - q being known for the start's p.
        beyond = apart_m + np.sum(normals * (start.states[:, :2] - away), axis=1)
        near = np.hypot(*away.T) < apart_m + REACH_M
        # Where the boat is now cannot be changed any more.
        near[0] = False
        horizon.apart[near, row, :2] = -normals[near]
        horizon.apart[near, row, 3] = -beyond[near]


def is_taken(target: TargetSet, other: Announced, apart_m: float) -> bool:
    """Whether nobody can come into a set that keeps `apart_m` from where another is going to be,
    whenever that is.
    """
    reach = np.asarray(target.vertices)[:, None] - other.places
    return bool(np.hypot(reach[..., 0], reach[..., 1]).max() < apart_m)


def _normals(away: Array, apart_m: float) -> Array:
    """Unit normals (N + 1, 2), away from the other, of the lines beyond which a boat has to be that
    would be at `away` (N + 1, 2) from it.
    """
    # Two in one place have no direction between them: any will do.
    away = np.where(np.hypot(*away.T)[:, None] < SAME_M, (SAME_M, 0.0), away)
    distance = np.hypot(*away.T)
    facing = away / distance[:, None]
    nearest = int(np.argmin(distance))
    if distance[nearest] >= apart_m:
        return facing
    if distance[0] <= apart_m:
        # Too near already: back to the side on which it is.
        return np.where((distance < apart_m)[:, None], facing[0], facing)
    to_starboard = _right_of(-facing[0])
    lateral = float(to_starboard @ away[nearest])
    side = 1.0 if lateral > -NO_SIDE * apart_m else -1.0
    normals = np.tile(
        _tangent(facing[0], side * to_starboard, apart_m / distance[0]), (len(away), 1)
    )
    if distance[-1] > apart_m:
        leaving = side * _right_of(facing[-1])
        normals[nearest + 1 :] = _tangent(facing[-1], leaving, apart_m / distance[-1])
    return normals


def _tangent(facing: Array, aside: Array, cosine: float) -> Array:
    """Normal of the disc's tangent through a place outside: `facing` points from the disc's centre
    to it, `aside` to the tangent's side; `cosine` is the disc's radius over the place's distance.
    """
    return cosine * facing + np.sqrt(1.0 - cosine**2) * aside


def _right_of(direction: Array) -> Array:
    """The direction to the right of one, (north, east)."""
    return np.array([-direction[1], direction[0]])
