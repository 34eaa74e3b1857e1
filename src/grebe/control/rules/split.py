"""The split N_x of the paper's two rules, and how they leave a stall.

Departures from the paper are named here and justified in docs/theory.md.
"""

from __future__ import annotations

import math
from dataclasses import dataclass

from grebe.control.horizon import Horizon, HorizonShape
from grebe.control.rules.base import Decision, Progress, Situation, progress

# Control steps without progress towards Omega_x after which the split is counted down.
STALL_STEPS = 3


@dataclass(frozen=True, kw_only=True)
class Approach:
    """Memory of the paper's rules: the progress towards a target, and the state of a countdown.

    `committed`: the split is being counted down after a stall.
    """

    progress: Progress
    committed: bool = False


def split_stage(distance: float, epsilon: float, horizon: int) -> int:
    """N_x = ceil(N d / epsilon) within the fattened set, N outside (below Eq. 6)."""
    if distance > epsilon:
        return horizon
    return math.ceil(horizon * distance / epsilon)


def decide(situation: Situation, split: int, epsilon: float, horizon: int) -> Decision:
    """N_x as planned, or counted down from N once the approach has stalled.

    If N_x depends on d alone, a boat can postpone entry for ever: at rest in its cell it plans at
    every step to speed up N_x steps later, and facing away from the rim it has too few steps to
    turn. If the distance has not fallen for `STALL_STEPS`, the split is set to N and then counted
    down. This leaves time to turn, and each plan, shifted by a step, is feasible for the next
    problem.
    """
    memory, last = situation.memory, situation.last
    before = memory if isinstance(memory, Approach) else None
    now = progress(situation, before.progress if before else None)
    counting = before is not None and before.committed
    # From farther away, N steps may not be enough to arrive before the countdown ends.
    committed = situation.distance <= epsilon and (counting or now.idle >= STALL_STEPS)
    if committed:
        split = last.split - 1 if last is not None and counting and last.split > 1 else horizon
    memory = Approach(progress=now, committed=committed)
    return Decision(target=situation.target, split=split, memory=memory)


def fixed_steps(
    shape: HorizonShape, step_s: float, effort: float, split: int, later_effort: float
) -> Horizon:
    """Return a horizon of stages of duration T, with prices on effort before and after a split."""
    horizon = Horizon(shape=shape)
    horizon.duration_bounds[:] = step_s
    horizon.effort_weights[:split] = effort
    horizon.effort_weights[split:] = later_effort
    return horizon
