"""The fast path against the oracle, on recorded instances of the paper's problem and of legs."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from benchmarks.common import BOAT, CELLS, print_head, print_row
from grebe.control.controller import Controller
from grebe.control.horizon import Horizon, HorizonShape, Plan
from grebe.control.rules.base import Rule
from grebe.control.rules.dual import Dual
from grebe.control.rules.lookahead import Lookahead
from grebe.control.solvers.base import Solution, Solver
from grebe.control.solvers.builders import Fast, Ipopt
from grebe.core.vessel import Vessel
from grebe.mission.trial import Conditions, simulate

# A solver's problem: state, horizon, weather and the plan to start from.
Asked = tuple[np.ndarray, Horizon, np.ndarray, Plan]

# The solver was tuned on the first sample only.
SAMPLES: tuple[tuple[Rule, int], ...] = ((Dual(), 7), (Dual(), 11), (Lookahead(), 13))
INSTANCES = 500
# Inputs are the same if they differ by at most this share of the thrust range.
NEAR = 0.01


@dataclass(frozen=True, kw_only=True)
class Agreement:
    """Shares of the instances, each from 0 to 1."""

    converged: float
    same_start: float
    from_our_plan: float
    best_found: float
    no_dearer: float


TOLD = {
    "converged": "converged",
    "same_start": "first input within 1 % of the thrust range of IPOPT's, same start",
    "from_our_plan": "the same, IPOPT started from our plan",
    "best_found": "the same, the cheaper of IPOPT's two",
    "no_dearer": "cost no higher than IPOPT's from the same start",
}


class Recorder:
    """Builds the fast solver, passes on the controller's problems to it and records them."""

    def __init__(self) -> None:
        self.asked: list[Asked] = []

    def build(self, vessel: Vessel, shape: HorizonShape) -> Recorder:
        self.inner = Fast().build(vessel, shape)
        return self

    def solve(
        self, state: np.ndarray, horizon: Horizon, weather: np.ndarray, guess: Plan
    ) -> Solution:
        self.asked.append((state, horizon, weather, guess))
        return self.inner.solve(state, horizon, weather, guess)


def agreement() -> None:
    """Compare the first input of the fast path with IPOPT's from the same start."""
    columns = [agreed(rule, seed) for rule, seed in SAMPLES]
    print_head(
        f"The fast path against the oracle, {INSTANCES} instances of each sample, %",
        "", *(f"`{type(rule).__name__.lower()}`, sample {seed}" for rule, seed in SAMPLES),
    )  # fmt: skip
    for name, what in TOLD.items():
        print_row(what, *(f"{100 * getattr(column, name):.1f}" for column in columns))


def agreed(rule: Rule, seed: int, instances: int = INSTANCES) -> Agreement:
    """How often the fast path and the oracle agree, on `instances` instances of a sample."""
    chosen = _recorded(rule, seed, instances)
    shape = chosen[0][1].shape
    fast, oracle = Fast().build(BOAT, shape), Ipopt().build(BOAT, shape)
    seen = [_compared(fast, oracle, asked) for asked in chosen]
    return Agreement(**dict(zip(TOLD, np.mean(seen, axis=0).tolist(), strict=True)))


def _recorded(rule: Rule, seed: int, instances: int) -> list[Asked]:
    """Instances drawn from twice as many, recorded in missions from random starts."""
    rng = np.random.default_rng(seed)
    asked: list[Asked] = []
    while len(asked) < 2 * instances:
        recorder = Recorder()
        controller = Controller(BOAT, CELLS, rule, solver=recorder)
        place = rng.uniform(-60, 60, 2)
        start = (*place, rng.uniform(-np.pi, np.pi), 0, 0, 0)
        simulate(BOAT, CELLS, controller, start, Conditions(limit_s=80, observes=False))
        asked += recorder.asked
    return [asked[i] for i in rng.choice(len(asked), instances, replace=False)]


def _compared(fast: Solver, oracle: Solver, asked: Asked) -> tuple[bool, ...]:
    """What holds for one instance, in the order of `Agreement`."""
    state, horizon, weather, guess = asked
    ours = fast.solve(state, horizon, weather, guess)
    exact = oracle.solve(state, horizon, weather, guess)
    refined = oracle.solve(state, horizon, weather, ours.plan)
    best = min(exact, refined, key=lambda one: (not one.solved, one.cost))
    near = [_apart(ours, other) < NEAR for other in (exact, refined, best)]
    return ours.solved, *near, ours.cost <= exact.cost * (1 + 1e-4) + 1e-4


def _apart(a: Solution, b: Solution) -> float:
    """The distance between two first inputs, as a share of the thrust range."""
    reach = BOAT.thrust_max_n - BOAT.thrust_min_n
    return float(np.abs(np.subtract(a.plan.first_input, b.plan.first_input)).max()) / reach
