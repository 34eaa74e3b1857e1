"""The interface of rules: their input, their result, and the measure of progress.

A rule is a frozen value: its settings, the stages of its horizon, and `propose`, a pure function
of a `Situation`. It solves nothing. `Single`, `Dual` and `Lookahead` are built in; any object with
the members of `Rule` can steer (docs/how-to/add-a-rule.md).
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

# A step that brings the boat nearer by less than this is no progress: creeping is stalling too.
LEAST_PROGRESS = 0.05


@dataclass(frozen=True, kw_only=True)
class Decision:
    """The decision of a rule in a step.

    `target` is the index of Omega_x and `split` the stage N_x at which the plan should enter it.
    `entries` are the nodes at which the plan must be in the sets from the target on. If it misses
    the first, the controller also tries a fresh plan; if `entries` is empty, there is no such
    check. `memory` is private to the rule, which gets it back with the next situation.
    """

    target: int
    split: int
    entries: tuple[int, ...] = ()
    memory: object = None


@dataclass(frozen=True, kw_only=True)
class Situation:
    """The input of a rule.

    `state` (6,); `target` the index of Omega_x; `ahead` the sets from Omega_x on, at least
    one; `aims` the same sets shrunk by the margins, which the controller aims at;
    `last` and `plan` the decision and the plan of the last step, which was `elapsed_s` ago;
    `cruise_thrust_n` the thrust of each thruster at the middle of the speed window; `corridors`
    for each of the sets ahead the half-space rows of the polygon to stay in on the way to it,
    empty in open water.
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
        """d(x, Omega_x), to the set itself and not to the aim."""
        return self.ahead[0].distance(self.state)

    @property
    def memory(self) -> object:
        """Memory of the rule's last decision, if that had the same target; else None."""
        last = self.last
        return last.memory if last is not None and last.target == self.target else None


@dataclass(frozen=True, kw_only=True)
class Proposal:
    """The result of a rule: the horizon to solve, its decision, and a starting plan or None."""

    horizon: Horizon
    decision: Decision
    start: Plan | None


class Rule(Protocol):
    """Interface of a rule: the sizes of its horizon, and `propose`.

    `stages` is N; `step_s` is T, the time between two solves. No stage that the rule proposes
    lasts longer than `longest_stage_s`, which sets the model's integration step.
    """

    @property
    def stages(self) -> int:
        """N, the number of stages of the horizon."""
        ...

    @property
    def step_s(self) -> float:
        """T, the time between two solves [s]."""
        ...

    @property
    def longest_stage_s(self) -> float:
        """Longest duration of a stage [s]."""
        ...

    def propose(self, situation: Situation, shape: HorizonShape) -> Proposal:
        """Return the parameters of every stage; a pure function that does not modify its input."""
        ...


@dataclass(frozen=True, kw_only=True)
class Progress:
    """Progress towards the current target.

    `nearest` is the least distance to it so far (d, Definition 2), `idle` the number of steps
    since the boat last came nearer.
    """

    nearest: float
    idle: int = 0


def progress(situation: Situation, before: Progress | None) -> Progress:
    """Return the progress after a step; `before` is None for a new target."""
    distance = situation.distance
    if before is None or distance < before.nearest - LEAST_PROGRESS:
        return Progress(nearest=distance)
    return Progress(nearest=before.nearest, idle=before.idle + 1)


def reached_count(targets: Sequence[TargetSet], reached: int, state: Sequence[float]) -> int:
    """Return the number of sets reached once the boat has been in `state`. Definition 5.

    One state may reach several sets that overlap or repeat.
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
    """Return the last plan, shifted to the present, to start from; None if there is none."""
    return None if situation.plan is None else situation.plan.shifted(situation.elapsed_s)


def check_stages(stages: int, step_s: float) -> None:
    """Raise `UsageError` unless the horizon has 2 to 100 stages and a step of 0.05 to 10 s."""
    # Even 15.0 is refused, because `stages` is the size of arrays.
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
