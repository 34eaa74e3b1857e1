"""The rule `Lookahead`: a horizon of legs to the next sets, with free durations.

Problem (8) plans to stay in the second set. Here the horizon's stages are divided among legs to as
many of the next sets as they can resolve. Each leg ends with the entry into its set, and the total
time is minimised. The boat cannot stall, as docs/theory.md explains: a plan that reaches its sets
stays feasible as time passes, and its cost falls by the time that has passed.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass, replace
from typing import TYPE_CHECKING

import numpy as np

from grebe.control.horizon import Horizon, HorizonShape, Plan
from grebe.control.rules.base import (
    Decision,
    Progress,
    Proposal,
    Situation,
    check_not_negative,
    check_stages,
    confine,
    progress,
)
from grebe.core.errors import UsageError
from grebe.core.sets import TargetSet, footprints_of
from grebe.core.taut import taut_path

if TYPE_CHECKING:
    from numpy.typing import NDArray

    Array = NDArray[np.float64]

# Longest stage when stages are divided among legs [s]; the solver may stretch it to
# `LONGEST_STAGE_S`.
STAGE_S = 0.9
# A leg must be able to end well before the next solve [s]. Otherwise each solve postpones what
# could be done at once.
SHORTEST_LEG_S = 0.06
LONGEST_STAGE_S = 1.2
FEWEST_STAGES = 2
# A second costs 1; a unit of slack costs more than the seconds it could save.
ENTRY_PENALTY = 100.0
# The slack of a set beyond the horizon is distance still to travel. The price of a metre is
# `FAR_WORTH` times the seconds that it takes at the window's upper end, so that the boat goes on
# against a current. The surge is held at such a price that it exceeds the window by no more than
# `FAR_EXCESS_MPS` [m/s].
FAR_WORTH, FAR_EXCESS_MPS = 10.0, 0.01
# A large set at the horizon's end is entered where the shortest path touches it. `SEEN_BEYOND` is
# the number of sets on that path. `ENTRY_ROOM` is the largest distance of the entry from that
# point, as a share of the set's side. A side is large from `LARGE_SHARE` of the horizon on.
SEEN_BEYOND, ENTRY_ROOM, LARGE_SHARE = 6, 0.015, 0.25
# A point, unlike a large set, may be reached only after a turn, and the boat would race for an
# entry just beyond the horizon. For safety the point counts as this many times as far.
TURN_ROOM = 2.0
# The largest price of thrust. Above it, boats were mistaken for boats held by weeds.
MOST_THRIFT = 4.0
# Land is worse than a missed set. So is another boat, but avoiding it must not drive the boat
# ashore.
CORRIDOR_PENALTY, APART_PENALTY = 1000.0, 300.0
EFFORT = 0.005
HALF_TURN_S = 4.0
# Steps without progress after which the last plan is dropped. A loop takes fewer; a solver caught
# in a plan that pays for its slack never ends.
STALL_STEPS = 24
# The boat is held this far below the window's upper end, because the price `hold` yields a little.
HOLD_MARGIN_MPS = 0.02
# Largest speed astern: backing out of a corner is seamanship, backing to the next set is not.
BACKWARDS_MPS = 0.4
# Price of a stage's squared deviation from its duration in the last plan [1/s^2]. Without it the
# stages of one leg could trade time at no cost; at convergence it costs nothing.
PACING = 2.0


@dataclass(frozen=True, kw_only=True)
class Lookahead:
    """Legs to the next sets in minimum time, each entry softened by an L1 slack.

    The upper end of the window also bounds the surge on the way, so that the boat does not race
    between sets: `hold` is the price of the squared surge above it. The lower end is required only
    at entry, because turns are slow. `thrift` is the extra cost [s] of a second of one thruster at
    full thrust; at less thrust it falls with the square. It saves energy first in turns, where
    energy buys the least time, then by speed. `stages` is N; `step_s` is T, the time between two
    solves; the durations of the stages are free. Raises `UsageError` for an invalid setting.
    """

    hold: float = 50.0
    thrift: float = 0.0
    stages: int = 24
    step_s: float = 0.5

    def __post_init__(self) -> None:
        check_stages(self.stages, self.step_s)
        check_not_negative(hold=self.hold, thrift=self.thrift)
        if self.thrift > MOST_THRIFT:
            raise UsageError(
                f"thrift is {self.thrift:g}; give 0 to {MOST_THRIFT:g}: with more, a boat no "
                "longer makes headway."
            )

    @property
    def _dearest(self) -> float:
        """Cost of a second with both thrusters at full thrust.

        The penalties of a missed set, of land and of others are multiplied by it, because a second
        can cost this much.
        """
        return 1.0 + 2.0 * self.thrift

    @property
    def longest_stage_s(self) -> float:
        """The upper bound of every stage's duration."""
        return LONGEST_STAGE_S

    def propose(self, situation: Situation, shape: HorizonShape) -> Proposal:
        """See `Rule.propose`."""
        memory = situation.memory
        now = progress(situation, memory if isinstance(memory, Progress) else None)
        if now.idle >= STALL_STEPS:
            situation, now = replace(situation, plan=None), replace(now, idle=0)
        arrivals = _arrivals(situation)
        stages = _deal_out(arrivals, shape.stages)
        horizon = self._legs(situation, shape, stages)
        start = _start(situation, arrivals[: len(stages)], stages)
        horizon.duration_nominal[:] = start.durations
        horizon.duration_weights[:] = PACING
        nodes: list[int] = np.cumsum(stages).tolist()
        confine(horizon, situation, nodes)
        horizon.corridor_penalty = self._dearest * CORRIDOR_PENALTY
        horizon.apart_penalty = self._dearest * APART_PENALTY
        decision = Decision(
            target=situation.target, split=nodes[0], entries=tuple(nodes), memory=now
        )
        return Proposal(horizon=horizon, decision=decision, start=start)

    def _legs(self, situation: Situation, shape: HorizonShape, stages: Sequence[int]) -> Horizon:
        """The horizon with the stages of each leg and the set at its end."""
        horizon = Horizon(shape=shape)
        horizon.duration_bounds[:, 1] = LONGEST_STAGE_S
        horizon.time_weights[:] = 1.0
        horizon.effort_weights[:] = EFFORT
        horizon.power_weights[:] = self.thrift
        spans_m = shape.stages * LONGEST_STAGE_S * situation.aims[0].speed_max_mps
        entries, away_m = _entries(situation, len(stages), spans_m)
        node, (price, hold) = 0, self._prices(situation.aims[0], away_m < spans_m)
        for entry, target, count in zip(entries, situation.ahead, stages, strict=False):
            leg = slice(node, node + count)
            horizon.duration_bounds[leg, 0] = SHORTEST_LEG_S / count
            horizon.attract(leg, pace_rows(target), hold)
            node += count
            horizon.require(node, entry, price)
        return horizon

    def _prices(self, aim: TargetSet, within: bool) -> tuple[float, float]:
        """Prices of a unit of slack at an entry, and of the squared surge above the window.

        They depend on whether the entry is `within` the horizon.
        """
        if within:
            return self._dearest * ENTRY_PENALTY, self.hold
        price = self._dearest * FAR_WORTH / max(aim.speed_max_mps, HOLD_MARGIN_MPS)
        return price, max(self.hold, price * LONGEST_STAGE_S / (2 * FAR_EXCESS_MPS))


def _entries(situation: Situation, legs: int, spans_m: float) -> tuple[list[Array], float]:
    """Half-spaces of the sets at the ends of the legs, and the distance of the first of them [m].

    If the horizon of `spans_m` ends at the first set, the boat would enter that at the nearest
    point and only then turn to the next. A large set is therefore narrowed to the surroundings of
    the point where the shortest path through it and the sets beyond touches it.
    """
    aims = situation.aims
    north, east = situation.state[0], situation.state[1]
    away_m = aims[0].footprint_distance(north, east)
    as_they_are = [aim.halfspaces for aim in aims[:legs]], away_m
    # A boat inside the set lacks only the speed, and may reach it anywhere.
    if legs > 1 or len(aims) == 1 or away_m == 0.0:
        return as_they_are
    shapes = footprints_of(aims[:SEEN_BEYOND])
    side_m = math.sqrt(shapes[0].area)
    if side_m < LARGE_SHARE * spans_m:
        return as_they_are
    path, room_m = taut_path((north, east), shapes), ENTRY_ROOM * side_m
    rows = aims[0].halfspaces.copy()
    normal = np.hypot(rows[:, 0], rows[:, 1])
    about = rows[:, :2] @ path[1] + room_m * normal
    rows[:, 3] = np.where(normal > 0, np.minimum(rows[:, 3], about), rows[:, 3])
    place_m = math.hypot(path[1, 0] - north, path[1, 1] - east) - room_m
    return [rows], TURN_ROOM * max(place_m, away_m)


def pace_rows(target: TargetSet) -> Array:
    """Half-spaces of the surge on the way: not above the window, and only slowly astern."""
    ceiling = target.speed_max_mps - HOLD_MARGIN_MPS
    return np.array([[0.0, 0.0, 1.0, ceiling], [0.0, 0.0, -1.0, BACKWARDS_MPS]])


def _arrivals(situation: Situation) -> list[float]:
    """Entry time of each set ahead [s from now]: as last planned, else estimated."""
    planned = _planned_arrivals(situation)
    arrivals: list[float] = []
    now = 0.0
    for i, target in enumerate(situation.aims):
        if i < len(planned):
            now = max(planned[i], now + SHORTEST_LEG_S)
        elif i == 0:
            now = _first_leg_s(situation.state, target)
        else:
            now += _leg_s(situation.aims[i - 1], target)
        arrivals.append(now)
    return arrivals


def _planned_arrivals(situation: Situation) -> list[float]:
    plan, last = situation.plan, situation.last
    if plan is None or last is None:
        return []
    ends = np.cumsum(plan.durations) - situation.elapsed_s
    gone = situation.target - last.target
    return [float(ends[node - 1]) for node in last.entries[gone:]]


def _first_leg_s(state: Sequence[float], target: TargetSet) -> float:
    north, east = target.centre
    bearing = math.atan2(east - state[1], north - state[0])
    off = abs(math.remainder(bearing - state[2], 2 * math.pi))
    way = target.footprint_distance(state[0], state[1])
    return way / _pace(target) + HALF_TURN_S * off / math.pi + 0.5


def _leg_s(a: TargetSet, b: TargetSet) -> float:
    return max(math.dist(a.centre, b.centre) / _pace(b), 0.5)


def _pace(target: TargetSet) -> float:
    return 0.5 * (target.speed_min_mps + target.speed_max_mps)


def _deal_out(arrivals: Sequence[float], total: int) -> list[int]:
    """Number of stages of each leg, of at most `STAGE_S` each; the last leg takes the rest."""
    stages: list[int] = []
    before = 0.0
    for arrival in arrivals:
        wanted = max(FEWEST_STAGES, math.ceil((arrival - before) / STAGE_S))
        left = total - sum(stages)
        if wanted > left:
            break
        stages.append(wanted)
        before = arrival
    if not stages:
        return [total]
    stages[-1] += total - sum(stages)
    return stages


def _start(situation: Situation, arrivals: Sequence[float], stages: Sequence[int]) -> Plan:
    """Starting plan on the new stages: the last plan resampled, then along the centres."""
    times = [0.0]
    for end, count in zip(arrivals, stages, strict=True):
        begin = times[-1]
        stage_s = (end - begin) / count
        times += [begin + i * stage_s for i in range(1, count)]
        times.append(end)
    times_s = np.array(times)
    states, thrusts, costates = _sample(situation, times_s, np.array([0.0, *arrivals]))
    states[0] = situation.state
    return Plan(states=states, thrusts=thrusts, durations=np.diff(times_s), costates=costates)


def _sample(situation: Situation, times_s: Array, ends: Array) -> tuple[Array, Array, Array | None]:
    plan = situation.plan
    if plan is None:
        return *_along_centres(situation, situation.state, 0.0, times_s, ends), None
    over = plan.duration_s - situation.elapsed_s
    states, thrusts, costates = plan.sampled(times_s + situation.elapsed_s)
    beyond = times_s > over + 1e-9
    if beyond.any():
        far_states, far_thrusts = _along_centres(
            situation, plan.states[-1], max(over, 0.0), times_s, ends
        )
        states[beyond] = far_states[beyond]
        thrusts[beyond[1:]] = far_thrusts[beyond[1:]]
    return states, thrusts, costates


def _along_centres(
    situation: Situation, begin: Sequence[float], since: float, times_s: Array, ends: Array
) -> tuple[Array, Array]:
    """Straight lines from `begin` at time `since` to the centres of the sets still ahead."""
    later = [i for i in range(1, len(ends)) if ends[i] > since + 1e-9]
    corners = np.array([begin[:2], *(situation.aims[i - 1].centre for i in later)])
    when = np.concatenate([[since], ends[later]])
    states = np.zeros((len(times_s), 6))
    for axis in range(2):
        states[:, axis] = np.interp(times_s, when, corners[:, axis])
    legs = np.diff(corners, axis=0)
    bearings = np.unwrap(np.concatenate([[begin[2]], np.arctan2(legs[:, 1], legs[:, 0])]))[1:]
    leg = np.clip(np.searchsorted(when, times_s - 1e-9) - 1, 0, len(bearings) - 1)
    states[:, 2] = bearings[leg]
    states[:, 3] = [_pace(situation.aims[max(later[i] - 1, 0)]) for i in leg]
    return states, np.full((len(times_s) - 1, 2), situation.cruise_thrust_n)
