"""A thruster that gives nothing: found by how the boat turns.

Three models compete: both thrusters work, port gives nothing, starboard gives nothing. Each
predicts the moment about the vertical axis, last row of Eq. (9); what it misses of the moment that
the yaw rate shows is squared and averaged. Both sides go through one low-pass filter, so that the
yaw rate need not be differentiated, and neither a lag nor noise is mistaken for a fault. A weak
thruster is not a dead one: the boat goes on as long as it turns more like a whole boat.
"""

from __future__ import annotations

import math
from dataclasses import dataclass

from grebe.core.dynamics import Weather
from grebe.core.vessel import Vessel
from grebe.mission.safety.states import Cause, Facts, Finding

# Time constants of the filter and of the average [s].
FILTER_S, AVERAGE_S = 1.5, 6.0
# A model without one thruster must miss this many times less than the whole one, for so long.
BETTER, PERSIST_S = 10.0, 3.0
# Smallest root mean square that counts, as a share of one thruster's full moment.
FLOOR_SHARE = 0.04
# Thrust factors (port, starboard) of the models: both, starboard alone, port alone.
MODELS = ((1.0, 1.0), (0.0, 1.0), (1.0, 0.0))
SIDES = ("", "port", "starboard")

Three = tuple[float, float, float]


@dataclass(frozen=True, kw_only=True)
class Turning:
    """Filtered yaw rate, filtered moments of the models [N m], and their averaged squared misses;
    `shown` that of the moment which the boat shows. `since_s`: since when a side seems dead.
    """

    time_s: float | None = None
    yaw_rate: float = 0.0
    moments: Three = (0.0, 0.0, 0.0)
    misses: Three = (0.0, 0.0, 0.0)
    shown: float = 0.0
    side: int = 0
    since_s: float = 0.0


def watched_turning(before: Turning, facts: Facts, vessel: Vessel) -> Turning:
    """Take an estimate, and the thrusts that led to it, into account."""
    yaw_rate = facts.state[5]
    if before.time_s is None:
        return Turning(time_s=facts.time_s, yaw_rate=yaw_rate)
    seconds = facts.time_s - before.time_s
    if seconds <= 0:
        return before
    share, keep = 1 - math.exp(-seconds / FILTER_S), math.exp(-seconds / AVERAGE_S)
    free = _free_moment(vessel, facts)
    port, starboard = facts.thrusts
    filtered: list[float] = []
    misses: list[float] = []
    seen = vessel.m33_kgm2 * (yaw_rate - before.yaw_rate) / FILTER_S
    for (a, b), old, missed in zip(MODELS, before.moments, before.misses, strict=True):
        moment = free + vessel.arm_m * (a * port - b * starboard)
        filtered.append(old + share * (moment - old))
        misses.append(keep * missed + (1 - keep) * (seen - filtered[-1]) ** 2)
    # What the thrusters turn the boat with, as it shows: nothing where weeds hold it.
    idle = filtered[0] - vessel.arm_m * _mean_difference(filtered, vessel)
    shown = keep * before.shown + (1 - keep) * (seen - idle) ** 2
    side = _dead_side((misses[0], misses[1], misses[2]), shown, vessel)
    return Turning(
        time_s=facts.time_s,
        yaw_rate=before.yaw_rate + share * (yaw_rate - before.yaw_rate),
        moments=(filtered[0], filtered[1], filtered[2]),
        misses=(misses[0], misses[1], misses[2]),
        shown=shown,
        side=side,
        since_s=before.since_s if side == before.side else facts.time_s,
    )


def dead_thruster(turning: Turning) -> Finding | None:
    """The thruster that gives nothing, if one does."""
    if turning.side == 0 or turning.time_s is None or turning.time_s - turning.since_s < PERSIST_S:
        return None
    name = SIDES[turning.side]
    return Finding(
        cause=Cause.THRUSTER,
        message=f"the boat turns as if its {name} thruster gave nothing",
    )


def _free_moment(vessel: Vessel, facts: Facts) -> float:
    """Moment [N m] of drag and of the coupling of surge and sway, without thrusters."""
    _, _, heading, surge, sway, yaw_rate = facts.state
    ahead, aside = _through(heading, facts.weather)
    drag = (vessel.n_r + vessel.n_rr * abs(yaw_rate)) * yaw_rate
    return vessel.yaw_coupling_kg * (surge - ahead) * (sway - aside) + drag


def _through(heading: float, weather: Weather) -> tuple[float, float]:
    """The current along and across the hull."""
    c, s = math.cos(heading), math.sin(heading)
    north, east = weather.current_north_mps, weather.current_east_mps
    return c * north + s * east, c * east - s * north


def _mean_difference(filtered: list[float], vessel: Vessel) -> float:
    """Filtered F_1 - F_2 [N], from the models' moments: each lacks one thruster."""
    port = (filtered[0] - filtered[1]) / vessel.arm_m
    starboard = (filtered[2] - filtered[0]) / vessel.arm_m
    return port - starboard


def _dead_side(misses: Three, shown: float, vessel: Vessel) -> int:
    floor = (FLOOR_SHARE * vessel.arm_m * vessel.thrust_max_n) ** 2
    if misses[0] < floor or shown < floor:
        return 0
    best = 1 if misses[1] < misses[2] else 2
    return best if BETTER * misses[best] < misses[0] else 0
