"""What every rule shares: what it is asked, what it answers, and how progress is told.

A rule is a frozen value: its own settings, the stages of its horizon, and `propose`, a pure
function of a `Situation`. It solves nothing. `Single`, `Dual` and `Lookahead` are built in;
whatever has the members of `Rule` steers as well (docs/how-to/add-a-rule.md).
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass
from numbers import Integral
from typing import TYPE_CHECKING, Protocol

from grebe.control.horizon import Horizon, HorizonShape, Plan
from grebe.core.errors import UsageError
from grebe.core.sets import TargetSet

if TYPE_CHECKING:
    import numpy as np
    from numpy.typing import NDArray

# A step that brings the boat less than this nearer counts as none: creeping is stalling too.
LEAST_PROGRESS = 0.05


@dataclass(frozen=True, kw_only=True)
class Decision:
    """What a rule decided in a step.

    `target` is the index of Omega_x and `split` the stage N_x at which it is to be entered.
    `entries` are the nodes at which the plan has to be in the sets from the target on; where it
    is not in the first of them, the controller also tries a plan made afresh (empty: the rule
    asks for no such check). `memory` is the rule's own: it comes back with the next situation
    and nobody else reads it.
    """

    target: int
    split: int
    entries: tuple[int, ...] = ()
    memory: object = None


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

    @property
    def memory(self) -> object:
        """What the rule left in its last decision, if that was about the same target."""
        last = self.last
        return last.memory if last is not None and last.target == self.target else None


@dataclass(frozen=True, kw_only=True)
class Proposal:
    """What a rule answers: the horizon to solve, what it decided, and where to start from
    (None: the rule has no plan to start from).
    """

    horizon: Horizon
    decision: Decision
    start: Plan | None


class Rule(Protocol):
    """What a controller needs of a rule: the sizes of its horizon, and `propose`.

    `stages` is N; `step_s` is T, the time between two solves; no stage that the rule proposes
    lasts longer than `longest_stage_s`, for which the model's integration is made.
    """

    @property
    def stages(self) -> int:
        """N, how many stages the horizon has."""
        ...

    @property
    def step_s(self) -> float:
        """T, the time between two solves [s]."""
        ...

    @property
    def longest_stage_s(self) -> float:
        """What a stage may last at most [s]."""
        ...

    def propose(self, situation: Situation, shape: HorizonShape) -> Proposal:
        """Return the parameters of every stage; pure, and nothing of `situation` is changed."""
        ...


@dataclass(frozen=True, kw_only=True)
class Progress:
    """How near the boat has been to the current target (d, Definition 2) since it became the
    current one, and for how many steps it has not come nearer.
    """

    nearest: float
    idle: int = 0


def progress(situation: Situation, before: Progress | None) -> Progress:
    """Return the progress after a step; `before` is None when the target is new."""
    distance = situation.distance
    if before is None or distance < before.nearest - LEAST_PROGRESS:
        return Progress(nearest=distance)
    return Progress(nearest=before.nearest, idle=before.idle + 1)


def reached_count(targets: Sequence[TargetSet], reached: int, state: Sequence[float]) -> int:
    """Return how many sets are reached once the boat has been in `state`. Definition 5.

    Overlapping or repeated sets may be reached by one and the same state.
    """
    while reached < len(targets) and targets[reached].contains(state):
        reached += 1
    return reached


def confine(horizon: Horizon, situation: Situation, entries: Sequence[int]) -> None:
    """Keep each node in the corridor of its leg; `entries` are the nodes where legs end."""
    node = 1
    for rows, end in zip(situation.corridors, entries, strict=False):
        for k in range(node, end + 1):
            horizon.confine(k, rows)
        node = end + 1


def shifted(situation: Situation) -> Plan | None:
    """Return the last plan as it looks now, to start from; None where there is none."""
    return None if situation.plan is None else situation.plan.shifted(situation.elapsed_s)


def check_stages(stages: int, step_s: float) -> None:
    """Raise `UsageError` for a horizon that no boat can be steered with."""
    # Not even 15.0: it counts rows.
    if not isinstance(stages, Integral) or not 2 <= stages <= 100:
        raise UsageError(f"The horizon is {stages!r} stages; give a whole number from 2 to 100.")
    if not 0.05 <= step_s <= 10.0:
        raise UsageError(f"The control step is {step_s} s; give 0.05 to 10 s.")


def check_positive(**values: float) -> None:
    """Raise `UsageError` naming the first value that is not positive and finite."""
    for name, value in values.items():
        if not 0 < value < math.inf:
            raise UsageError(f"{name} is {value}; it must be positive and finite.")


def check_not_negative(**values: float) -> None:
    """Raise `UsageError` naming the first value that is negative or not a finite number."""
    for name, value in values.items():
        if not 0 <= value < math.inf:
            raise UsageError(f"{name} is {value}; it must be finite and not negative.")
