"""Half-planes in the horizon that keep the boat apart from others' announced positions.

The disc of another boat has the kept distance as its radius, about the other's position at the time
of a node. At each node a line separates the boat from this disc. If the last plan is clear of the
disc, the line faces it. If the plan leads through it, the lines are tangents of the disc on the
side on which to pass it, so that the boat can keep to them without stopping. docs/theory.md
explains what this guarantees and what it does not: the claims of `mission.safety.traffic` hold
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

# The nearest others, at most this many, have a row in each node.
MOST_OTHERS = 3
# A node farther than this from another's disc has no row, because a solve does not move it there.
REACH_M = 10.0
# Boats nearer to each other than this are treated as being at one position.
SAME_M = 1e-6
# A plan that leads past the disc's centre within this share of its radius has not chosen a side
# yet; it passes to starboard, as all boats do that meet.
NO_SIDE = 0.25


@dataclass(frozen=True, kw_only=True)
class AnnouncedPath:
    """Announced positions of another boat: `places` (n, 2) [m] at `times_s` (n,) [s from now].

    `times_s` ascend. Before the first the boat is at the first place, after the last at the last.
    """

    times_s: NDArray[np.float64]
    places: NDArray[np.float64]

    @classmethod
    def at_rest(cls, place: tuple[float, float]) -> AnnouncedPath:
        """A boat that holds its position."""
        return cls(times_s=np.zeros(1), places=np.array([place], dtype=float))

    @classmethod
    def of_plan(cls, plan: Plan, age_s: float) -> AnnouncedPath:
        """A boat that follows a plan made `age_s` ago."""
        times_s = np.concatenate([[0.0], np.cumsum(plan.durations)]) - age_s
        return cls(times_s=times_s, places=plan.states[:, :2])

    def at(self, times_s: NDArray[np.float64]) -> NDArray[np.float64]:
        """Positions (m, 2) at other times (m,) [s from now]."""
        axes = [np.interp(times_s, self.times_s, axis) for axis in self.places.T]
        return np.column_stack(axes)


def keep_apart(
    horizon: Horizon, start: Plan, others: Sequence[AnnouncedPath], apart_m: float
) -> None:
    """Require each node to be `apart_m` from the others' positions at its time in `start`.

    Only the nearest others count, as many as the horizon has rows for.
    """
    times_s = np.concatenate([[0.0], np.cumsum(start.durations)])
    offsets = [start.states[:, :2] - other.at(times_s) for other in others]
    offsets.sort(key=lambda away: float(np.hypot(*away.T).min()))
    horizon.apart[:] = NO_ROW
    for row, away in enumerate(offsets[: horizon.shape.apart_rows]):
        normals = _normals(away, apart_m)
        # n (p - q) >= D about q, the other's position; p - q is known for the start's p.
        beyond = apart_m + np.sum(normals * (start.states[:, :2] - away), axis=1)
        near = np.hypot(*away.T) < apart_m + REACH_M
        # The boat's present position cannot be changed.
        near[0] = False
        horizon.apart[near, row, :2] = -normals[near]
        horizon.apart[near, row, 3] = -beyond[near]


def is_taken(target: TargetSet, other: AnnouncedPath, apart_m: float) -> bool:
    """Return whether the whole set is always within `apart_m` of another's announced positions.

    Nobody who keeps that distance can then enter it.
    """
    reach = np.asarray(target.vertices)[:, None] - other.places
    return bool(np.hypot(reach[..., 0], reach[..., 1]).max() < apart_m)


def _normals(away: Array, apart_m: float) -> Array:
    """Unit normals (N + 1, 2) of the separating lines, pointing away from the other.

    `away` (N + 1, 2) is the boat's position relative to the other in the starting plan.
    """
    # Two boats at one position have no direction between them; any will do.
    away = np.where(np.hypot(*away.T)[:, None] < SAME_M, (SAME_M, 0.0), away)
    distance = np.hypot(*away.T)
    facing = away / distance[:, None]
    nearest = int(np.argmin(distance))
    if distance[nearest] >= apart_m:
        return facing
    if distance[0] <= apart_m:
        # Too near already: back to the side on which the boat is.
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
    """Normal of the disc's tangent through a point outside.

    `facing` points from the disc's centre to the point, `aside` to the tangent's side; `cosine` is
    the disc's radius over the point's distance.
    """
    return cosine * facing + np.sqrt(1.0 - cosine**2) * aside


def _right_of(direction: Array) -> Array:
    """The direction to the right of one, (north, east)."""
    return np.array([-direction[1], direction[0]])
