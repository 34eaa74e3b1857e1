"""The settings of the controller, in the paper's symbols, with their units."""

from __future__ import annotations

from dataclasses import dataclass, replace
from typing import Any, Literal, get_args

from grebe.core.errors import UsageError

RuleName = Literal["single", "dual", "lookahead"]
SolverName = Literal["fast", "fatrop", "ipopt"]
SINGLE_BETA = 0.01
RULES: tuple[RuleName, ...] = get_args(RuleName)
SOLVERS: tuple[SolverName, ...] = get_args(SolverName)


@dataclass(frozen=True, kw_only=True)
class ControlSettings:
    """What a field team or a researcher may turn.

    `rule` names the rule and `solver` the solver; `horizon` is N, in stages; `step_s` is T, the
    time between two solves and, for the paper's rules, the duration of a stage. `margin_m` and
    `speed_margin_mps` shrink the set that the controller aims at; whether a set is reached is
    judged on the set itself. `corridor_margin_m` is kept from the sides of a corridor.

    For `single` and `dual` alone: `epsilon` fattens the current target (Definition 8; metres
    beside metres per second), `alpha` weighs distance and `beta` effort (Eq. 2), `p` and `q`
    the current and the next target (Eq. 7), `entry_penalty` is the price of a unit of slack
    on the current set and `successor_penalty` on the next one (docs/theory.md says why they
    suffice, and why the second must be far below the first). For `lookahead` alone: `hold` is
    the price of the squared surge above the window on the way to a set.
    """

    rule: RuleName = "lookahead"
    solver: SolverName = "fast"
    horizon: int = 24
    step_s: float = 0.5
    epsilon: float = 15.0
    alpha: float = 1.0
    beta: float = 0.4
    p: float = 1.0
    q: float = 1.0
    margin_m: float = 0.1
    speed_margin_mps: float = 0.05
    corridor_margin_m: float = 0.3
    entry_penalty: float = 1e3
    successor_penalty: float = 100.0
    hold: float = 50.0

    def __post_init__(self) -> None:
        if self.rule not in RULES:
            raise UsageError(f"There is no rule {self.rule!r}; choose one of {', '.join(RULES)}.")
        if self.solver not in SOLVERS:
            raise UsageError(
                f"There is no solver {self.solver!r}; choose one of {', '.join(SOLVERS)}."
            )
        if not 2 <= self.horizon <= 100:
            raise UsageError(f"The horizon is {self.horizon} steps; give 2 to 100.")
        if not 0.05 <= self.step_s <= 10.0:
            raise UsageError(f"The control step is {self.step_s} s; give 0.05 to 10 s.")
        for name in ("epsilon", "alpha", "beta", "p", "q", "entry_penalty", "successor_penalty"):
            if not getattr(self, name) > 0:
                raise UsageError(f"{name} is {getattr(self, name)}; it must be positive.")
        for name in ("margin_m", "speed_margin_mps", "corridor_margin_m", "hold"):
            if not getattr(self, name) >= 0:
                raise UsageError(f"{name} is {getattr(self, name)}; it must not be negative.")


def paper_settings(rule: RuleName = "dual", **changes: Any) -> ControlSettings:
    """Return the paper's settings (section 6.3): N = 15, T = 1 s, with `changes` to any.

    `single` knows no next set: an effort that weighs more than a small distance would let it
    hover just below the window, so its weight is smaller.
    """
    own = {"rule": rule, "horizon": 15, "step_s": 1.0}
    if rule == "single":
        own["beta"] = SINGLE_BETA
    return replace(ControlSettings(), **(own | changes))


def settings_for(
    rule: RuleName, horizon: int | None = None, step_s: float | None = None, **changes: Any
) -> ControlSettings:
    """Return a rule's own defaults, with what the caller gives instead."""
    base = ControlSettings() if rule == "lookahead" else paper_settings(rule)
    return replace(
        base,
        horizon=base.horizon if horizon is None else horizon,
        step_s=base.step_s if step_s is None else step_s,
        **changes,
    )
