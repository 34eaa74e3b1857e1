"""Detects a boat that is stuck: thrust without motion, or water that is too shallow."""

from __future__ import annotations

import math
from dataclasses import dataclass

from grebe.core.vessel import Vessel, steady_rate
from grebe.mission.safety.settings import SafetySettings
from grebe.mission.safety.states import Cause, Facts, Finding, Place

# A boat that has moved this far is not stuck [m].
MOVED_M = 1.0
# A boat is stuck once it is `BEHIND_M` [m] behind the distance that its thrust should have given,
# and has not moved away for `BEHIND_S` [s].
BEHIND_M, BEHIND_S = 6.0, 8.0
# A moving boat has more than this share of the speed that its thrust would give.
MOVING_SHARE = 0.35
# A boat that turns on the spot faster than this is moving [rad/s].
TURNING = 0.1
# The number of shallow readings in a row that count: a single one may be a fish.
SHALLOW_READINGS = 2
# A boat that does not move in less than this multiple of the least depth has probably touched
# ground.
GROUND_FACTOR = 2.0


@dataclass(frozen=True, kw_only=True)
class Motion:
    """The motion of a boat: since when, and from which place, it has not moved away, and how far it
    has fallen behind its thrust [m].
    """

    since_s: float | None = None
    place: Place = (0.0, 0.0)
    behind_m: float = 0.0
    time_s: float = 0.0
    shallow: int = 0
    depth_m: float | None = None


def updated_motion(before: Motion, facts: Facts, vessel: Vessel, least_depth_m: float) -> Motion:
    """Return the motion, updated with an estimate."""
    shallow, depth = before.shallow, before.depth_m
    if facts.depth_m is not None:
        depth = facts.depth_m
        shallow = shallow + 1 if depth < least_depth_m else 0
    away = math.hypot(facts.place[0] - before.place[0], facts.place[1] - before.place[1])
    if before.since_s is None or away > MOVED_M:
        return Motion(
            since_s=facts.time_s,
            place=facts.place,
            time_s=facts.time_s,
            shallow=shallow,
            depth_m=depth,
        )
    return Motion(
        since_s=before.since_s,
        place=before.place,
        behind_m=before.behind_m + _missed_m(facts, vessel, facts.time_s - before.time_s),
        time_s=facts.time_s,
        shallow=shallow,
        depth_m=depth,
    )


def _missed_m(facts: Facts, vessel: Vessel, seconds: float) -> float:
    """Return the distance [m] that the thrust should have given in still water; 0 if the boat
    moves.
    """
    _, _, _, surge, sway, yaw_rate = facts.state
    force = abs(sum(facts.thrusts))
    speed = steady_rate(-vessel.x_u, -vessel.x_uu, force) if force > 0 else 0.0
    moves = math.hypot(surge, sway) > MOVING_SHARE * speed or abs(yaw_rate) > TURNING
    return 0.0 if moves else speed * seconds


def held_fast(motion: Motion, settings: SafetySettings) -> Finding | None:
    """Return what holds the boat; None if nothing does."""
    depth = motion.depth_m
    if motion.shallow >= SHALLOW_READINGS:
        return Finding(
            cause=Cause.SHALLOW,
            message=f"the water is {depth:.2f} m deep, less than {settings.least_depth_m:g} m",
        )
    if motion.since_s is None:
        return None
    seconds = motion.time_s - motion.since_s
    if motion.behind_m < BEHIND_M or seconds < BEHIND_S:
        return None
    if depth is not None and depth < GROUND_FACTOR * settings.least_depth_m:
        return Finding(
            cause=Cause.SHALLOW,
            message=f"thrust without motion for {seconds:.0f} s in {depth:.2f} m of water",
        )
    return Finding(cause=Cause.WEEDS, message=f"thrust without motion for {seconds:.0f} s")
