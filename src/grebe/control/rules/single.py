"""The rule `Single`: problem (5) of the paper, one set at a time."""

from __future__ import annotations

from dataclasses import dataclass

from grebe.control.horizon import HorizonShape
from grebe.control.rules.base import (
    Proposal,
    Situation,
    check_positive,
    check_stages,
    confine,
    shifted,
)
from grebe.control.rules.split import decide, fixed_steps


@dataclass(frozen=True, kw_only=True)
class Single:
    """Problem (5): every stage is drawn to Omega_x, and the last node must be in it.

    Departure: after a stall within `epsilon` of the set (metres beside metres per second) the
    node that must be in it is counted down from the last.

    `alpha` weights distance and `beta` effort (Eq. 2); `entry_penalty` is the price of a unit of
    slack on the set. Without a next set, effort that outweighs a small distance would let the boat
    hover just below the window, so `beta` is smaller than in `Dual`. `stages` is N and `step_s` T,
    which is also the duration of a stage. Raises `UsageError` for an invalid setting.
    """

    epsilon: float = 15.0
    alpha: float = 1.0
    beta: float = 0.01
    entry_penalty: float = 1e3
    stages: int = 15
    step_s: float = 1.0

    def __post_init__(self) -> None:
        check_stages(self.stages, self.step_s)
        check_positive(
            epsilon=self.epsilon,
            alpha=self.alpha,
            beta=self.beta,
            entry_penalty=self.entry_penalty,
        )

    @property
    def longest_stage_s(self) -> float:
        """Every stage lasts T."""
        return self.step_s

    def propose(self, situation: Situation, shape: HorizonShape) -> Proposal:
        """See `Rule.propose`."""
        decision = decide(situation, shape.stages, self.epsilon, shape.stages)
        horizon = fixed_steps(shape, self.step_s, self.beta, shape.stages, self.beta)
        aim = situation.aims[0].halfspaces
        for stage in range(shape.stages):
            horizon.attract(stage, aim, self.alpha)
        horizon.require(decision.split, aim, self.entry_penalty)
        confine(horizon, situation, [shape.stages])
        return Proposal(horizon=horizon, decision=decision, start=shifted(situation))
