"""The rule `Lookahead`: a horizon of legs to the next sets, their durations free.

Problem (8) plans to sit in the second set; here the horizon's stages are dealt out to the
legs to as many of the next sets as they can resolve, each leg ends with the entry into its
set, and the total time is minimised. docs/theory.md says why it cannot lock up: a plan that
reaches its sets stays feasible as time passes, and its cost falls by the time that passed.
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
from grebe.core.taut import taut_way

if TYPE_CHECKING:
    from numpy.typing import NDArray

    Array = NDArray[np.float64]

# What a stage should at most span when stages are dealt out, and what it may span [s].
STAGE_S = 0.9
# A leg must be able to end well before the next solve: one that cannot lets the plan put off
# what could be done at once, and each solve puts it off again.
SHORTEST_LEG_S = 0.06
LONGEST_STAGE_S = 1.2
FEWEST_STAGES = 2
# Cost of a second is 1; a unit of slack costs more than any second it could save.
ENTRY_PENALTY = 100.0
# Of a set that lies beyond the horizon the slack is way that is still to come. A metre of it is
# worth so many times what it takes at the window's upper end, so that the boat goes on against a
# current; and the surge is held so dearly that it does not race for it by more than this [m/s].
FAR_WORTH, FAR_EXCESS_MPS = 10.0, 0.01
# Of a set at the horizon's end: how many sets the taut way leads through that says where it is
# entered, how near to that place it is asked to be, as a share of the set's side, and how large
# the side must be, as a share of the horizon, for the boat to be told.
SEEN_BEYOND, ENTRY_ROOM, LARGE_SHARE = 6, 0.015, 0.25
# A place, unlike a whole set, may be reached only after a turn: to be safe it counts as so many
# times as far, for the boat races for what the horizon just does not hold.
TURN_ROOM = 2.0
# The largest price of thrust: beyond it boats were taken for held by weeds.
MOST_THRIFT = 4.0
# Land is worse than a missed set; another boat is, but does not drive the boat ashore.
CORRIDOR_PENALTY, APART_PENALTY = 1000.0, 300.0
EFFORT = 0.005
HALF_TURN_S = 4.0
# Steps without coming nearer after which the last plan is dropped: a loop takes less, a solver
# that is caught in a plan which pays its slack takes for ever.
STALL_STEPS = 24
# How far below the window's upper end the boat is held: the price of `hold` yields a little.
HOLD_MARGIN_MPS = 0.02
# Backing out of a corner is seamanship; backing all the way to the next set is not.
BACKWARDS_MPS = 0.4
# Price of a stage's squared departure from the last plan's pace [1/s^2]. Stages of one leg
# would otherwise trade time among each other at no cost; at rest it costs nothing.
PACING = 2.0


@dataclass(frozen=True, kw_only=True)
class Lookahead:
    """Legs to the next sets in minimum time, each entry held by an L1 slack.

    The upper end of the window also bounds the surge on the way, so that the boat does not race
    between sets: `hold` is the price of the squared surge above it. The lower end is asked at
    entry alone, for turns are slow. `thrift` is what a second of one thruster at full thrust costs
    beside the second itself [s], and of less thrust by its square: energy is saved first where the
    boat turns, for there it buys the least time, then by speed. `stages` is N; `step_s` is T, the
    time between two solves; the durations of the stages are free. Raises `UsageError`.
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
                f"thrift is {self.thrift:g}; give 0 to {MOST_THRIFT:g}: a boat that saves more "
                "than that no longer makes way."
            )

    @property
    def _dearest(self) -> float:
        """What a second costs with both thrusters at full thrust; what is worth a second, a missed
        set or land, must be worth that.
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
        """The stages of each leg, and the set that it ends in."""
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
        """Prices of a unit of slack at an entry, and of the squared surge above the window, where
        the entry is within the horizon or beyond it.
        """
        if within:
            return self._dearest * ENTRY_PENALTY, self.hold
        price = self._dearest * FAR_WORTH / max(aim.speed_max_mps, HOLD_MARGIN_MPS)
        return price, max(self.hold, price * LONGEST_STAGE_S / (2 * FAR_EXCESS_MPS))


def _entries(situation: Situation, legs: int, spans_m: float) -> tuple[list[Array], float]:
    """Half-spaces of the sets that the legs end in, and how far away the first of them is [m].

    Where the horizon of `spans_m` ends at the first set, the boat would come in where it is nearest
    and only then turn to the next. Of a large set it is told where the way through the sets beyond
    lies instead: it is asked about the place where the taut way touches it.
    """
    aims = situation.aims
    north, east = situation.state[0], situation.state[1]
    away_m = aims[0].footprint_distance(north, east)
    as_they_are = [aim.halfspaces for aim in aims[:legs]], away_m
    # A boat that is in the set already lacks the speed alone, and may find it anywhere.
    if legs > 1 or len(aims) == 1 or away_m == 0.0:
        return as_they_are
    shapes = footprints_of(aims[:SEEN_BEYOND])
    side_m = math.sqrt(shapes[0].area)
    if side_m < LARGE_SHARE * spans_m:
        return as_they_are
    way, room_m = taut_way((north, east), shapes), ENTRY_ROOM * side_m
    rows = aims[0].halfspaces.copy()
    normal = np.hypot(rows[:, 0], rows[:, 1])
    about = rows[:, :2] @ way[1] + room_m * normal
    rows[:, 3] = np.where(normal > 0, np.minimum(rows[:, 3], about), rows[:, 3])
    place_m = math.hypot(way[1, 0] - north, way[1, 1] - east) - room_m
    return [rows], TURN_ROOM * max(place_m, away_m)


def pace_rows(target: TargetSet) -> Array:
    """Half-spaces of the surge on the way: not above the window, and hardly backwards."""
    ceiling = target.speed_max_mps - HOLD_MARGIN_MPS
    return np.array([[0.0, 0.0, 1.0, ceiling], [0.0, 0.0, -1.0, BACKWARDS_MPS]])


def _arrivals(situation: Situation) -> list[float]:
    """When each set ahead will be entered [s from now]: as last planned, else estimated."""
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
    """Stages for each leg, `STAGE_S` each at most; the last leg takes what is left over."""
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
    """A starting plan on the new stages: the last plan resampled, then along the centres."""
    times = [0.0]
    for end, count in zip(arrivals, stages, strict=True):
        begin = times[-1]
        stage_s = (end - begin) / count
        times += [begin + i * stage_s for i in range(1, count)]
        times.append(end)
    moments = np.array(times)
    states, thrusts, costates = _sample(situation, moments, np.array([0.0, *arrivals]))
    states[0] = situation.state
    return Plan(states=states, thrusts=thrusts, durations=np.diff(moments), costates=costates)


def _sample(situation: Situation, moments: Array, ends: Array) -> tuple[Array, Array, Array | None]:
    plan = situation.plan
    if plan is None:
        return *_along_centres(situation, situation.state, 0.0, moments, ends), None
    over = plan.duration_s - situation.elapsed_s
    states, thrusts, costates = plan.sampled(moments + situation.elapsed_s)
    beyond = moments > over + 1e-9
    if beyond.any():
        far_states, far_thrusts = _along_centres(
            situation, plan.states[-1], max(over, 0.0), moments, ends
        )
        states[beyond] = far_states[beyond]
        thrusts[beyond[1:]] = far_thrusts[beyond[1:]]
    return states, thrusts, costates


def _along_centres(
    situation: Situation, begin: Sequence[float], since: float, moments: Array, ends: Array
) -> tuple[Array, Array]:
    """Straight ways from `begin` at time `since` to the centres of the sets still ahead."""
    later = [i for i in range(1, len(ends)) if ends[i] > since + 1e-9]
    corners = np.array([begin[:2], *(situation.aims[i - 1].centre for i in later)])
    when = np.concatenate([[since], ends[later]])
    states = np.zeros((len(moments), 6))
    for axis in range(2):
        states[:, axis] = np.interp(moments, when, corners[:, axis])
    way = np.diff(corners, axis=0)
    bearings = np.unwrap(np.concatenate([[begin[2]], np.arctan2(way[:, 1], way[:, 0])]))[1:]
    leg = np.clip(np.searchsorted(when, moments - 1e-9) - 1, 0, len(bearings) - 1)
    states[:, 2] = bearings[leg]
    states[:, 3] = [_pace(situation.aims[max(later[i] - 1, 0)]) for i in leg]
    return states, np.full((len(moments) - 1, 2), situation.cruise_thrust_n)
