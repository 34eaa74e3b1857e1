"""Rules: from where the boat is and what lies ahead to the parameters of the stages.

Each rule is a pure function of a `Situation`; none solves anything. `single` is problem
(5) of the paper, `dual` is problem (8) with cost (7). Departures from the paper's letter
are named here and argued in docs/theory.md.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from typing import TYPE_CHECKING

from grebe.control.horizon import Horizon, HorizonShape, Plan
from grebe.control.settings import ControlSettings
from grebe.core.sets import TargetSet

if TYPE_CHECKING:
    import numpy as np
    from numpy.typing import NDArray


# Control steps without coming nearer to Omega_x after which the split is counted down.
STALL_STEPS = 3
# A step that brings the boat less than this nearer counts as none: creeping is stalling too.
LEAST_PROGRESS = 0.05


@dataclass(frozen=True, kw_only=True)
class Decision:
    """What a rule decided, and what it must remember for the next step.

    The target's index, the split N_x, the smallest d(x, Omega_x) so far, the steps since it
    last fell, whether the split is being counted down after a stall, and, for a horizon of
    legs, the nodes at which the sets from the target on are entered.
    """

    target: int
    split: int
    nearest: float
    idle: int = 0
    committed: bool = False
    entries: tuple[int, ...] = ()


@dataclass(frozen=True, kw_only=True)
class Situation:
    """What a rule may look at.

    `state` (6,); `target` the index of Omega_x; `ahead` the sets from Omega_x on, at least
    one; `aims` the same sets shrunk by the margins, which the controller aims at;
    `last` and `plan` the decision and the plan of the last step, which was `elapsed_s` ago;
    `cruise_thrust_n` what each thruster gives at the pace of the window; `corridors` for each
    of the sets ahead the half-space rows of the polygon to stay in on the way to it, empty where
    all is open water.
    """

    state: Sequence[float]
    target: int
    ahead: Sequence[TargetSet]
    aims: Sequence[TargetSet]
    last: Decision | None = None
    plan: Plan | None = None
    elapsed_s: float = 0.0
    cruise_thrust_n: float = 0.0
    corridors: Sequence[NDArray[np.float64]] = ()

    @property
    def distance(self) -> float:
        """d(x, Omega_x), on the set itself and not on the aim."""
        return self.ahead[0].distance(self.state)


@dataclass(frozen=True, kw_only=True)
class Proposal:
    """What a rule answers: the horizon to solve, what it decided, and where to start from
    (None: the rule has no plan to start from).
    """

    horizon: Horizon
    decision: Decision
    start: Plan | None


Rule = Callable[[Situation, ControlSettings, HorizonShape], Proposal]


def reached_count(targets: Sequence[TargetSet], reached: int, state: Sequence[float]) -> int:
    """Return how many sets are reached once the boat has been in `state`. Definition 5.

    Overlapping or repeated sets may be reached by one and the same state.
    """
    while reached < len(targets) and targets[reached].contains(state):
        reached += 1
    return reached


def split_stage(distance: float, epsilon: float, horizon: int) -> int:
    """N_x = ceil(N d / epsilon) within the fattened set, N outside (below Eq. 6)."""
    if distance > epsilon:
        return horizon
    return math.ceil(horizon * distance / epsilon)


def single(situation: Situation, settings: ControlSettings, shape: HorizonShape) -> Proposal:
    """Problem (5): every stage is drawn to Omega_x, the last node must lie in it.

    Departure: after a stall the node that must lie in it is counted down from the last.
    """
    decision = _decide(situation, shape.stages, settings.epsilon, shape.stages)
    horizon = _fixed_steps(settings, shape)
    aim = situation.aims[0].halfspaces
    for stage in range(shape.stages):
        horizon.attract(stage, aim, settings.alpha)
    horizon.require(decision.split, aim, settings.entry_penalty)
    confine(horizon, situation, [shape.stages])
    return Proposal(horizon=horizon, decision=decision, start=_shifted(situation))


def confine(horizon: Horizon, situation: Situation, entries: Sequence[int]) -> None:
    """Keep each node in the corridor of its leg; `entries` are the nodes where legs end."""
    node = 1
    for rows, end in zip(situation.corridors, entries, strict=False):
        for k in range(node, end + 1):
            horizon.confine(k, rows)
        node = end + 1


def dual(situation: Situation, settings: ControlSettings, shape: HorizonShape) -> Proposal:
    """Problem (8): N_x stages for Omega_x, the others for its successor.

    Departures: the last target has no successor, so nothing is asked after N_x; with
    N_x = N node N is asked to lie in Omega_x alone; a split that has stalled is counted
    down from N.
    """
    n = shape.stages
    planned = split_stage(situation.distance, settings.epsilon, n)
    decision = _decide(situation, planned, settings.epsilon, n)
    split = decision.split
    horizon = _fixed_steps(settings, shape)
    aim = situation.aims[0].halfspaces
    for stage in range(split):
        horizon.attract(stage, aim, settings.p * settings.alpha)
    if split > 0:
        horizon.require(split, aim, settings.entry_penalty)
    if len(situation.aims) > 1 and split < n:
        _lead_on(horizon, split, situation.aims[1].halfspaces, settings)
    confine(horizon, situation, [split, n])
    return Proposal(horizon=horizon, decision=decision, start=_shifted(situation))


def _lead_on(horizon: Horizon, split: int, rows: NDArray, settings: ControlSettings) -> None:
    """Second mode: the stages from N_x on belong to Omega_x+."""
    n = horizon.shape.stages
    for stage in range(split, n):
        horizon.attract(stage, rows, settings.q * settings.alpha)
    horizon.require(n, rows, settings.successor_penalty)


def _decide(situation: Situation, split: int, epsilon: float, horizon: int) -> Decision:
    """N_x as planned, or counted down from N once the approach has stalled.

    With N_x a function of d alone a boat can put entry off for ever: at rest in its cell it
    plans at every step to speed up N_x steps later, and facing away from the rim it has too
    few steps to turn. Where the distance has not fallen for `STALL_STEPS`, the split is
    set to N and then counted down: time enough to turn, and each plan, shifted by a step,
    is feasible for the next problem.
    """
    idle, nearest = progress(situation)
    last = situation.last
    counting = last is not None and last.target == situation.target and last.committed
    # From afar N steps may not be enough: there the count would end before the way does.
    committed = situation.distance <= epsilon and (counting or idle >= STALL_STEPS)
    if committed:
        split = last.split - 1 if last is not None and counting and last.split > 1 else horizon
    return Decision(
        target=situation.target, split=split, nearest=nearest, idle=idle, committed=committed
    )


def progress(situation: Situation) -> tuple[int, float]:
    """Steps since the boat last came nearer to Omega_x, and how near it has been."""
    last, distance = situation.last, situation.distance
    if last is None or last.target != situation.target:
        return 0, distance
    if distance < last.nearest - LEAST_PROGRESS:
        return 0, distance
    return last.idle + 1, last.nearest


def _shifted(situation: Situation) -> Plan | None:
    return None if situation.plan is None else situation.plan.shifted(situation.elapsed_s)


def _fixed_steps(settings: ControlSettings, shape: HorizonShape) -> Horizon:
    horizon = Horizon(shape=shape)
    horizon.duration_bounds[:] = settings.step_s
    horizon.effort_weights[:] = settings.beta
    return horizon
