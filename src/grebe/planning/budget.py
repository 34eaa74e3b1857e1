"""Find the smallest cells whose plan keeps a budget of time, or of energy as the time it lasts."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass, replace
from typing import Protocol

import numpy as np

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
NEAR = 1.01
# Smaller cells beyond a jump are sought among this many sizes, up to so many lanes more across the
# water; no more of them than this are planned in full. With many lanes the jumps are small.
SIZES, LANES, FULL_TRIALS, MANY_LANES = 12, 2, 5, 40
# The ratio of a full plan's time to a quick one's is corrected in at most this many full plans.
CORRECTIONS = 3


class Spent(Protocol):
    """The time of the plan for a size of cells [s]; a quick plan's may be longer."""

    def __call__(self, cell_m: float, *, quick: bool) -> float:
        """Plan with cells of this size."""
        ...


@dataclass(frozen=True, kw_only=True)
class _Tried:
    """Cells of a size, and the time of their plan [s]."""

    cell_m: float
    time_s: float


def affordable_cell_m(
    spent_s: Spent,
    budget_s: float,
    first_m: float,
    largest_m: float,
    *,
    many_below_m: float = 0.0,
) -> float:
    """Return a size of cells whose plan keeps the budget and uses as much of it as any found.

    The search begins with `first_m`. Cells smaller than `many_below_m` are so many that trials are
    quick plans, whose times are corrected by the ratio of a full plan's to a quick one's. Raises
    `PlanError` when not even the largest cells keep the budget.
    """
    search = _Search(spent_s, budget_s, largest_m, many_below_m, ratio=1.0)
    tried = [search.planned(search.at_the_edge(first_m))]
    while len(tried) < CORRECTIONS and tried[-1].cell_m < many_below_m:
        if search.is_enough(tried):
            break
        ratio = tried[-1].time_s / spent_s(tried[-1].cell_m, quick=True)
        search = replace(search, ratio=ratio)
        tried.append(search.planned(search.at_the_edge(tried[-1].cell_m)))
    beyond = iter(() if search.is_enough(tried) else search.beyond_jumps(tried[-1].cell_m))
    while not search.is_enough(tried) and (cell_m := next(beyond, None)) is not None:
        tried.append(search.planned(cell_m))
    kept = [one for one in tried if one.time_s <= budget_s] or [search.keeping(tried[-1])]
    return max(kept, key=lambda one: one.time_s).cell_m


@dataclass(frozen=True)
class _Search:
    """A search among sizes of cells, in which a quick plan counts for `ratio` of its time."""

    spent_s: Spent
    budget_s: float
    largest_m: float
    many_below_m: float
    ratio: float

    def planned(self, cell_m: float) -> _Tried:
        """Cells of a size and the time of their full plan."""
        return _Tried(cell_m=cell_m, time_s=self.spent_s(cell_m, quick=False))

    def is_enough(self, tried: Sequence[_Tried]) -> bool:
        """Whether a plan among those tried keeps the budget and leaves little of it."""
        return any(SHARE * self.budget_s <= one.time_s <= self.budget_s for one in tried)

    def keeping(self, tried: _Tried) -> _Tried:
        """The next larger cells whose full plan keeps the budget."""
        while tried.time_s > self.budget_s:
            if tried.cell_m >= self.largest_m:
                raise _too_short(self.budget_s)
            grown = max((tried.time_s / self.budget_s) ** (1 / POWER), NEAR)
            tried = self.planned(min(tried.cell_m * grown, self.largest_m))
        return tried

    def _trial(self, cell_m: float) -> _Tried:
        many = cell_m < self.many_below_m
        time_s = self.spent_s(cell_m, quick=many) * (self.ratio if many else 1.0)
        return _Tried(cell_m=cell_m, time_s=time_s)

    def at_the_edge(self, first_m: float) -> float:
        """Cells that use at least `SHARE` of the budget, or next to cells that exceed it."""
        largest_m, aimed_s = self.largest_m, AIM * self.budget_s
        dear, best, cell_m = None, None, min(max(first_m, SMALLEST_CELL_M), largest_m)
        for trial in range(TRIALS):
            tried = self._trial(cell_m)
            if tried.time_s > self.budget_s:
                dear = tried
            else:
                best = tried
            low_m = SMALLEST_CELL_M if dear is None else dear.cell_m
            if best is None:
                if low_m >= largest_m:
                    break
            elif best.time_s >= SHARE * self.budget_s or best.cell_m <= NEAR * low_m:
                break
            cell_m = min(_next_m(dear, best, aimed_s, halve=trial % 3 == 2), largest_m)
        if best is None:
            return largest_m
        return best.cell_m

    def beyond_jumps(self, edge_m: float) -> list[float]:
        """Smaller cells that may keep the budget although larger ones do not, best first.

        The time jumps up where one more lane begins to fit into the water, and falls again as that
        lane grows to full width. Quick plans show where it falls low enough.
        """
        if self.largest_m > MANY_LANES * edge_m:
            return []
        least_m = max(edge_m / (1 + LANES * edge_m / self.largest_m), SMALLEST_CELL_M)
        ratio = self.planned(edge_m).time_s / self.spent_s(edge_m, quick=True)
        sizes = np.geomspace(edge_m, least_m, SIZES)[1:].tolist()
        sizes.sort(
            key=lambda size: abs(ratio * self.spent_s(size, quick=True) - AIM * self.budget_s)
        )
        return sizes[:FULL_TRIALS]


def _too_short(budget_s: float) -> PlanError:
    return PlanError(
        f"No plan of this water takes less than {budget_s / 60:.1f} minutes; "
        "give more time or energy, or a part of the water."
    )


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
