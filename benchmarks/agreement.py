"""The fast path against the oracle, on recorded instances of the paper's problem and of legs."""

from __future__ import annotations

import numpy as np

from benchmarks.common import BOAT, CELLS, print_head, print_row
from grebe.control.controller import Controller
from grebe.control.rules.base import Rule
from grebe.control.rules.dual import Dual
from grebe.control.rules.lookahead import Lookahead
from grebe.control.solvers.builders import Fast, Ipopt
from grebe.mission.trial import Conditions, fly

# The solver was tuned on the first sample; the second was not looked at before, nor the third.
SAMPLES = ((Dual(), 7), (Dual(), 11), (Lookahead(), 13))


class Recorder:
    """Builds the fast solver, passes on what a controller asks it and keeps it."""

    def __init__(self) -> None:
        self.inner, self.asked = None, []

    def build(self, vessel, shape):
        self.inner = Fast().build(vessel, shape)
        return self

    def solve(self, state, horizon, weather, guess):
        self.asked.append((state, horizon, weather, guess))
        return self.inner.solve(state, horizon, weather, guess)


def agreement(instances: int = 500) -> None:
    """First input of the fast path against IPOPT from the same start, on recorded instances."""
    columns = [_compared(instances, rule, seed) for rule, seed in SAMPLES]
    print_head(
        f"The fast path against the oracle, {instances} instances of each sample, %",
        "", *(f"`{type(rule).__name__.lower()}`, sample {seed}" for rule, seed in SAMPLES),
    )  # fmt: skip
    for what in columns[0]:
        print_row(what, *(f"{100 * column[what] / instances:.1f}" for column in columns))


def _compared(instances: int, rule: Rule, seed: int) -> dict[str, int]:
    rng = np.random.default_rng(seed)
    asked = []
    while len(asked) < 2 * instances:
        recorder = Recorder()
        controller = Controller(BOAT, CELLS, rule, solver=recorder)
        place = rng.uniform(-60, 60, 2)
        start = (*place, rng.uniform(-np.pi, np.pi), 0, 0, 0)
        fly(BOAT, CELLS, controller, start, Conditions(limit_s=80, observes=False))
        asked += recorder.asked
    chosen = [asked[i] for i in rng.choice(len(asked), instances, replace=False)]
    shape = chosen[0][1].shape
    fast, oracle = Fast().build(BOAT, shape), Ipopt().build(BOAT, shape)
    reach = BOAT.thrust_max_n - BOAT.thrust_min_n
    same_start, near_optimum, best_found, solved, cheaper = 0, 0, 0, 0, 0
    for state, horizon, weather, guess in chosen:
        ours = fast.solve(state, horizon, weather, guess)
        exact = oracle.solve(state, horizon, weather, guess)
        refined = oracle.solve(state, horizon, weather, ours.plan)
        solved += ours.solved
        same_start += _apart(ours, exact) < 0.01 * reach
        near_optimum += _apart(ours, refined) < 0.01 * reach
        best = min(exact, refined, key=lambda one: (not one.solved, one.cost))
        best_found += _apart(ours, best) < 0.01 * reach
        cheaper += ours.cost <= exact.cost * (1 + 1e-4) + 1e-4
    return {
        "converged": solved,
        "first input within 1 % of the thrust range of IPOPT's, same start": same_start,
        "the same, IPOPT started from our plan": near_optimum,
        "the same, the cheaper of IPOPT's two": best_found,
        "cost no higher than IPOPT's from the same start": cheaper,
    }


def _apart(a, b) -> float:
    return float(np.abs(np.subtract(a.plan.first_input, b.plan.first_input)).max())
