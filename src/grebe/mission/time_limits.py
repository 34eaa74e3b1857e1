"""The time that a boat is allowed to reach a target."""

from __future__ import annotations

from collections.abc import Sequence

from grebe.core.sets import TargetSet

# The time limit for a target: the longer of this time [s] and ten times the straight passage at
# the lowest speed of the target's window. A target that is not reached in time is given up.
SHORTEST_TIME_LIMIT_S = 180.0
TIME_LIMIT_FACTOR = 10.0
SLOWEST_MPS = 0.2


def target_time_limit_s(target: TargetSet, state: Sequence[float]) -> float:
    """Return the time [s] within which a target must be reached from a state."""
    distance_m = target.footprint_distance(state[0], state[1])
    slowest = max(target.speed_min_mps, SLOWEST_MPS)
    return max(SHORTEST_TIME_LIMIT_S, TIME_LIMIT_FACTOR * distance_m / slowest)
