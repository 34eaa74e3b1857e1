"""Find the smallest cells whose plan keeps a budget of time, or of energy as the time it lasts."""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import dataclass

from grebe.core.errors import PlanError

# The share of its budget that a plan must use, the share that is aimed at, and the most trials.
SHARE, AIM, TRIALS = 0.97, 0.985, 16
SMALLEST_CELL_M = 0.5
# The time of a plan falls with about this power of the cells' size.
POWER = 1.2
# A trial is no nearer than this share of the interval to either of two known sizes: the time of a
# plan jumps when the water holds one lane more or less.
LEAST_STEP = 0.15
# Cells that keep the budget are small enough within this factor of cells that do not.
NEAR = 1.005


@dataclass(frozen=True, kw_only=True)
class _Tried:
    """Cells of a size, and the time of their plan [s]."""

    cell_m: float
    time_s: float


def affordable_cell_m(
    spent_s: Callable[[float], float], budget_s: float, first_m: float, largest_m: float
) -> float:
    """Return the smallest size of cells whose plan keeps the budget, using at least `SHARE` of it.

    `spent_s` returns the time of the plan for a size [s]; the search begins with `first_m`. Raises
    `PlanError` when not even the largest cells keep the budget.
    """
    dear, best, cell_m = None, None, min(max(first_m, SMALLEST_CELL_M), largest_m)
    for trial in range(TRIALS):
        tried = _Tried(cell_m=cell_m, time_s=spent_s(cell_m))
        if tried.time_s > budget_s:
            dear = tried
        else:
            best = tried
        low_m = SMALLEST_CELL_M if dear is None else dear.cell_m
        if best is None:
            if low_m >= largest_m:
                break
        elif best.time_s >= SHARE * budget_s or best.cell_m <= NEAR * low_m:
            break
        cell_m = min(_next_m(dear, best, AIM * budget_s, halve=trial % 3 == 2), largest_m)
    if best is None:
        raise PlanError(
            f"No plan of this water takes less than {budget_s / 60:.1f} minutes; "
            "give more time or energy, or a part of the water."
        )
    return best.cell_m


def _next_m(dear: _Tried | None, best: _Tried | None, wanted_s: float, *, halve: bool) -> float:
    """The size to try next: one step by `POWER` while only too small or only large enough cells
    are known, else a point between the two by linear interpolation of logarithms, or half-way.
    """
    if dear is not None and best is not None:
        fall = math.log(dear.time_s / best.time_s)
        share = math.log(dear.time_s / wanted_s) / fall
        share = 0.5 if halve else min(max(share, LEAST_STEP), 1 - LEAST_STEP)
        return dear.cell_m * (best.cell_m / dear.cell_m) ** share
    if dear is not None:
        grown = (dear.time_s / wanted_s) ** (1 / POWER)
        return dear.cell_m * min(max(grown, 1.02), 2.0)
    assert best is not None
    shrunk = (best.time_s / wanted_s) ** (1 / POWER)
    return max(best.cell_m * min(shrunk, 0.98), SMALLEST_CELL_M)
