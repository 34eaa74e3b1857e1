"""The cells that the benchmarks sail, and how their tables are printed."""

from __future__ import annotations

import numpy as np

from grebe.control.controller import Command, Controller, StepStatus
from grebe.control.rules.base import Rule
from grebe.control.solvers.base import SolverBuilder
from grebe.core.vessel import PRESETS
from grebe.mission.trial import Conditions, Trial, meander, simulate

BOAT = PRESETS["benchmark"]
START = (-10.0, 2.5, 0.0, 0.0, 0.0, 0.0)
CELLS = meander()


def grebe_flight(
    rule: Rule, solver: SolverBuilder | None = None, boat=BOAT, cells=CELLS, start=START
) -> Trial:
    """Sail with Grebe's controller, compiled and built beforehand."""
    warm = Controller(boat, cells[:2], rule, solver=solver)
    simulate(boat, cells[:2], warm, start, Conditions(limit_s=5.0))
    return simulate(boat, cells, Controller(boat, cells, rule, solver=solver), start)


def told(thrusts, reached: int, *, solved: bool = True) -> Command:
    """A peer's command: thrusts until the next step, without a plan behind them."""
    status = StepStatus.SOLVED if solved else StepStatus.LAST_PLAN
    return Command(thrusts=thrusts, plan=None, status=status, target=reached, split=0)


def print_row(*cells: object) -> None:
    print("| " + " | ".join(map(str, cells)) + " |", flush=True)


def print_head(title: str, *names: str) -> None:
    print(f"\n## {title}\n")
    print_row(*names)
    print_row(*["---"] * len(names))


def median_p95_max(step_ms: list[float]) -> list[float]:
    ms = np.array(step_ms)
    return [float(np.median(ms)), float(np.percentile(ms, 95)), float(np.max(ms))]
