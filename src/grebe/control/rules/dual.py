"""The rule `Dual`: problem (8) with cost (7), the paper's controller with two modes."""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING

from grebe.control.horizon import Horizon, HorizonShape
from grebe.control.rules.base import (
    Proposal,
    Situation,
    check_positive,
    check_stages,
    confine,
    shifted,
)
from grebe.control.rules.split import decide, fixed_steps, split_stage

if TYPE_CHECKING:
    import numpy as np
    from numpy.typing import NDArray


@dataclass(frozen=True, kw_only=True)
class Dual:
    """Problem (8): N_x stages for Omega_x, the others for its successor.

    Departures: the last target has no successor, so nothing is required after N_x; if N_x = N,
    node N is required to be in Omega_x only; a split that has stalled is counted down from N.

    `epsilon` fattens the current target (Definition 8; metres beside metres per second),
    `alpha` weights distance and `beta` effort (Eq. 2), `p` and `q` the current and the next
    target (Eq. 7). `entry_penalty` is the price of a unit of slack on the current set,
    `successor_penalty` on the next one; docs/theory.md explains why they suffice, and why the
    second must be far below the first. `stages` is N and `step_s` T, which is also the duration of
    a stage; the defaults are those of section 6.3. Raises `UsageError` for an invalid setting.
    """

    epsilon: float = 15.0
    alpha: float = 1.0
    beta: float = 0.4
    p: float = 1.0
    q: float = 1.0
    entry_penalty: float = 1e3
    successor_penalty: float = 100.0
    stages: int = 15
    step_s: float = 1.0

    def __post_init__(self) -> None:
        check_stages(self.stages, self.step_s)
        check_positive(epsilon=self.epsilon, alpha=self.alpha, beta=self.beta, p=self.p, q=self.q)
        check_positive(entry_penalty=self.entry_penalty, successor_penalty=self.successor_penalty)

    @property
    def longest_stage_s(self) -> float:
        """Every stage lasts T."""
        return self.step_s

    def propose(self, situation: Situation, shape: HorizonShape) -> Proposal:
        """See `Rule.propose`."""
        n = shape.stages
        planned = split_stage(situation.distance, self.epsilon, n)
        decision = decide(situation, planned, self.epsilon, n)
        split = decision.split
        horizon = fixed_steps(shape, self.step_s, self.p * self.beta, split, self.q * self.beta)
        aim = situation.aims[0].halfspaces
        for stage in range(split):
            horizon.attract(stage, aim, self.p * self.alpha)
        if split > 0:
            horizon.require(split, aim, self.entry_penalty)
        if len(situation.aims) > 1 and split < n:
            self._lead_on(horizon, split, situation.aims[1].halfspaces)
        confine(horizon, situation, [split, n])
        return Proposal(horizon=horizon, decision=decision, start=shifted(situation))

    def _lead_on(self, horizon: Horizon, split: int, rows: NDArray[np.float64]) -> None:
        """Second mode: the stages from N_x on belong to Omega_x+."""
        n = horizon.shape.stages
        for stage in range(split, n):
            horizon.attract(stage, rows, self.q * self.alpha)
        horizon.require(n, rows, self.successor_penalty)
