"""The horizon: what each stage of the optimal control problem is asked to do.

A rule writes a `Horizon`; `grebe.control.ocp` poses it; nothing here solves anything.

The horizon has N stages and N + 1 nodes. Node k carries the set that the cost measures its
distance to, the set that must hold it (softened by an L1 slack), the corridor to stay in, and the
lines that keep it apart from others; stage k carries the bounds of its duration and the weights of
effort and time. Sets are half-space rows (a_x, a_y, a_u, b), see `grebe.core.sets`. A row
(0, 0, 0, 1) holds always: it fills up a set with fewer sides than the problem has room for, and
stands for "no set".
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, field
from functools import cached_property
from typing import TYPE_CHECKING

import numpy as np

if TYPE_CHECKING:
    from numpy.typing import NDArray

NO_ROW = (0.0, 0.0, 0.0, 1.0)
# Price, in every solver, of the squared distance of a stage's share of its duration's span from
# one half; it keeps a share whose bounds coincide in the middle and is far below any cost.
DURATION_REGULARISATION = 1e-4


@dataclass(frozen=True, kw_only=True)
class HorizonShape:
    """The sizes that a problem is built for, once.

    `stages` N; `set_rows` half-spaces a set may have (sides + 2 for the speed window);
    `corridor_rows` half-spaces of the corridor, 0 for none; `apart_rows` others to keep apart from,
    a half-space for each, 0 for none; `substeps` Runge-Kutta steps in each stage.
    """

    stages: int
    set_rows: int = 6
    corridor_rows: int = 0
    apart_rows: int = 0
    substeps: int = 4

    def __post_init__(self) -> None:
        least = (self.stages, self.set_rows - 4, self.corridor_rows + 1, self.apart_rows + 1)
        if min(*least, self.substeps) < 1:
            raise ValueError(f"impossible shape: {self}")


@dataclass(kw_only=True)
class Horizon:
    """Parameters of every stage, filled in by a rule.

    Arrays, with N = shape.stages, R = shape.set_rows, C = shape.corridor_rows, A =
    shape.apart_rows:
    `cost_sets` (N, R, 4) and `cost_weights` (N,), the weight of the squared distance;
    `entry_sets` (N + 1, R, 4) and `entry_penalties` (N + 1,), cost of a unit of slack;
    `corridors` (N + 1, C, 4) and `corridor_penalty`; `apart` (N + 1, A, 4) and `apart_penalty`;
    `effort_weights` (N,) of the squared thrusts in units of full thrust, and `power_weights` (N,)
    [1/s] of the same times the stage's duration;
    `duration_bounds` (N, 2) [s], `time_weights` (N,) [1/s], and `duration_weights` (N,) [1/s^2]
    of the squared distance from `duration_nominal` (N,) [s];
    `thrust_bounds` (2, N, 2) [N], least and largest of each stage's thrusts, or None where they are
    the vessel's throughout.
    """

    shape: HorizonShape
    cost_sets: NDArray[np.float64] = field(init=False)
    cost_weights: NDArray[np.float64] = field(init=False)
    entry_sets: NDArray[np.float64] = field(init=False)
    entry_penalties: NDArray[np.float64] = field(init=False)
    corridors: NDArray[np.float64] = field(init=False)
    corridor_penalty: float = 1e3
    apart: NDArray[np.float64] = field(init=False)
    apart_penalty: float = 300.0
    effort_weights: NDArray[np.float64] = field(init=False)
    power_weights: NDArray[np.float64] = field(init=False)
    duration_bounds: NDArray[np.float64] = field(init=False)
    time_weights: NDArray[np.float64] = field(init=False)
    duration_nominal: NDArray[np.float64] = field(init=False)
    duration_weights: NDArray[np.float64] = field(init=False)
    thrust_bounds: NDArray[np.float64] | None = None

    def __post_init__(self) -> None:
        n, rows = self.shape.stages, self.shape.set_rows
        self.cost_sets = _no_rows(n, rows)
        self.cost_weights = np.zeros(n)
        self.entry_sets = _no_rows(n + 1, rows)
        # A slack that costs nothing would drift; one that is not needed stays at zero.
        self.entry_penalties = np.ones(n + 1)
        self.corridors = _no_rows(n + 1, self.shape.corridor_rows)
        self.apart = _no_rows(n + 1, self.shape.apart_rows)
        self.effort_weights = np.zeros(n)
        self.power_weights = np.zeros(n)
        self.duration_bounds = np.ones((n, 2))
        self.time_weights = np.zeros(n)
        self.duration_nominal = np.zeros(n)
        self.duration_weights = np.zeros(n)

    def bounds_of_thrusts(self, least_n: float, most_n: float) -> NDArray[np.float64]:
        """Least and largest thrusts of each stage (2, N, 2): its own, or the vessel's limits."""
        if self.thrust_bounds is not None:
            return self.thrust_bounds
        bounds = np.empty((2, self.shape.stages, 2))
        bounds[0], bounds[1] = least_n, most_n
        return bounds

    def attract(self, stage: int | slice, rows: NDArray[np.float64], weight: float) -> None:
        """Let the cost of a stage, or of several, measure the distance to a set."""
        self.cost_sets[stage] = padded(rows, self.shape.set_rows)
        self.cost_weights[stage] = weight

    def require(self, node: int, rows: NDArray[np.float64], penalty: float) -> None:
        """Ask that a node lie in a set, at a price for each unit of violation."""
        self.entry_sets[node] = padded(rows, self.shape.set_rows)
        self.entry_penalties[node] = penalty

    def confine(self, node: int, rows: NDArray[np.float64]) -> None:
        """Ask that a node lie in a corridor."""
        self.corridors[node] = padded(rows, self.shape.corridor_rows)


def _no_rows(nodes: int, rows: int) -> NDArray[np.float64]:
    """Rows (nodes, rows, 4) that all hold always."""
    filled = np.zeros((nodes, rows, len(NO_ROW)))
    filled[..., -1] = NO_ROW[-1]
    return filled


def padded(rows: NDArray[np.float64], count: int) -> NDArray[np.float64]:
    """Fill half-space rows up to `count` with rows that always hold."""
    if len(rows) > count:
        raise ValueError(f"a set has {len(rows)} half-spaces, the problem room for {count}")
    filled = np.empty((count, len(NO_ROW)))
    filled[: len(rows)] = rows
    filled[len(rows) :] = NO_ROW
    return filled


@dataclass(frozen=True, kw_only=True)
class Plan:
    """A predicted trajectory, the result of a solve.

    `states` (N + 1, 6), `thrusts` (N, 2) [N], `durations` (N,) [s]; `costates` (N + 1, 6) what
    the rest of the plan would cost more for a unit of each state, where the solver tells.
    """

    states: NDArray[np.float64]
    thrusts: NDArray[np.float64]
    durations: NDArray[np.float64]
    costates: NDArray[np.float64] | None = None

    @property
    def first_input(self) -> tuple[float, float]:
        """Thrusts (F_1, F_2) of the first stage: what a receding horizon applies."""
        return float(self.thrusts[0, 0]), float(self.thrusts[0, 1])

    @property
    def duration_s(self) -> float:
        """Time that the plan spans."""
        return float(np.sum(self.durations))

    def shifted(self, step_s: float) -> Plan:
        """Return the plan as it looks `step_s` later, its last thrusts held at the end.

        For stages of equal duration `step_s` this drops the first stage and repeats the
        last; states are moved along by linear interpolation in time. Costates are left behind: the
        last sets of the paper's problems move on with the horizon, and what they cost with them.
        """
        moments = np.concatenate([[0.0], np.cumsum(self.durations)]) + step_s
        states, thrusts, _ = self.sampled(moments)
        return Plan(states=states, thrusts=thrusts, durations=self.durations)

    def sampled(
        self, moments: NDArray[np.float64]
    ) -> tuple[NDArray[np.float64], NDArray[np.float64], NDArray[np.float64] | None]:
        """Return states (m, 6) at `moments` (m,) [s], the thrusts (m - 1, 2) half-way between them,
        and the costates (m, 6) where they are known. Beyond the plan's end state and thrusts are
        its last ones, and the costates nothing: nothing is planned to cost anything there.
        """
        stage, share = self._shares_at(moments)
        states = _between(self.states, stage, share)
        thrusts = self.thrusts[self._stage_at(0.5 * (moments[1:] + moments[:-1]))]
        if self.costates is None:
            return states, thrusts, None
        costates = _between(self.costates, stage, share)
        costates[moments > self._ends[-1] + 1e-9] = 0.0
        return states, thrusts, costates

    def thrusts_at(self, moment_s: float) -> tuple[float, float]:
        """Thrusts planned at a moment [s]; beyond the plan's end its last ones."""
        # Asked ten times a second: one number is found without an array of it.
        stage = min(int(self._ends.searchsorted(moment_s, side="right")), len(self._ends) - 1)
        port, starboard = self.thrusts[stage].tolist()
        return port, starboard

    @cached_property
    def _ends(self) -> NDArray[np.float64]:
        """When each stage ends (N,) [s]."""
        return np.cumsum(self.durations)

    def _stage_at(self, moments: NDArray[np.float64]) -> NDArray[np.int64]:
        return np.minimum(np.searchsorted(self._ends, moments, side="right"), len(self._ends) - 1)

    def _shares_at(
        self, moments: NDArray[np.float64]
    ) -> tuple[NDArray[np.int64], NDArray[np.float64]]:
        """In which stage each of `moments` (m,) [s] lies, and how much of it is over then, (m, 1):
        none before the first node, all beyond the last.
        """
        ends, durations = self._ends, self.durations
        stage = np.minimum(np.searchsorted(ends, moments), len(ends) - 1)
        span = durations[stage]
        gone = np.minimum(np.maximum(moments - ends[stage] + span, 0.0), span)
        return stage, (gone / np.where(span > 0, span, 1.0))[:, None]


def _between(
    nodes: NDArray[np.float64], stage: NDArray[np.int64], share: NDArray[np.float64]
) -> NDArray[np.float64]:
    """Values (N + 1, 6) at the nodes, interpolated to a `share` (m, 1) of each `stage` (m,)."""
    return nodes[stage] + share * (nodes[stage + 1] - nodes[stage])


def rows_needed(sides: Sequence[int]) -> int:
    """Rows of half-spaces for sets with these numbers of sides (two more for the window)."""
    return max(sides, default=4) + 2
