"""The horizon: the parameters of each stage of the optimal control problem, and the plan.

A rule writes a `Horizon`, and `grebe.control.ocp` poses the problem; nothing here is solved.

The horizon has N stages and N + 1 nodes. Node k has the set that its cost measures the distance
to, the set that must contain it (softened by an L1 slack), its corridor, and the lines that keep it
apart from others. Stage k has the bounds of its duration and the weights of effort and time. Sets
are half-space rows (a_x, a_y, a_u, b), see `grebe.core.sets`. The row (0, 0, 0, 1) always holds: it
pads a set that has fewer sides than the problem has room for, and represents "no set".
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
# A stage's duration is a share of the span between its bounds. Every solver puts this price on the
# share's squared distance from one half: it determines the share if the bounds coincide, and is
# far below any cost.
DURATION_REGULARISATION = 1e-4


@dataclass(frozen=True, kw_only=True)
class HorizonShape:
    """The sizes for which a problem is built.

    `stages` is N; `set_rows` the half-spaces that a set may have (sides + 2 for the speed window);
    `corridor_rows` those of a corridor, 0 for none; `apart_rows` the number of others to keep apart
    from, one half-space each, 0 for none; `substeps` the Runge-Kutta steps in each stage.
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
    `thrust_bounds` (2, N, 2) [N], least and largest of each stage's thrusts, or None for the
    vessel's limits in every stage.
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
        # A slack without a price would drift; with one, a slack that is not needed stays at zero.
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
        """Least and largest thrusts of each stage (2, N, 2); by default the vessel's limits."""
        if self.thrust_bounds is not None:
            return self.thrust_bounds
        bounds = np.empty((2, self.shape.stages, 2))
        bounds[0], bounds[1] = least_n, most_n
        return bounds

    def attract(self, stage: int | slice, rows: NDArray[np.float64], weight: float) -> None:
        """Add the distance to a set to the cost of a stage or of several."""
        self.cost_sets[stage] = padded(rows, self.shape.set_rows)
        self.cost_weights[stage] = weight

    def require(self, node: int, rows: NDArray[np.float64], penalty: float) -> None:
        """Require a node to be in a set, at a price for each unit of violation."""
        self.entry_sets[node] = padded(rows, self.shape.set_rows)
        self.entry_penalties[node] = penalty

    def confine(self, node: int, rows: NDArray[np.float64]) -> None:
        """Require a node to be in a corridor."""
        self.corridors[node] = padded(rows, self.shape.corridor_rows)


def _no_rows(nodes: int, rows: int) -> NDArray[np.float64]:
    """Rows (nodes, rows, 4) that always hold."""
    filled = np.zeros((nodes, rows, len(NO_ROW)))
    filled[..., -1] = NO_ROW[-1]
    return filled


def padded(rows: NDArray[np.float64], count: int) -> NDArray[np.float64]:
    """Pad half-space rows to `count` with rows that always hold."""
    if len(rows) > count:
        raise ValueError(f"a set has {len(rows)} half-spaces, but the problem has room for {count}")
    filled = np.empty((count, len(NO_ROW)))
    filled[: len(rows)] = rows
    filled[len(rows) :] = NO_ROW
    return filled


@dataclass(frozen=True, kw_only=True)
class Plan:
    """A predicted trajectory, the result of a solve.

    `states` (N + 1, 6), `thrusts` (N, 2) [N], `durations` (N,) [s]. `costates` (N + 1, 6) is the
    change of the cost of the rest of the plan per unit of each state, None if the solver does not
    report it.
    """

    states: NDArray[np.float64]
    thrusts: NDArray[np.float64]
    durations: NDArray[np.float64]
    costates: NDArray[np.float64] | None = None

    @property
    def first_input(self) -> tuple[float, float]:
        """Thrusts (F_1, F_2) of the first stage, which a receding horizon applies."""
        return float(self.thrusts[0, 0]), float(self.thrusts[0, 1])

    @property
    def duration_s(self) -> float:
        """Duration of the plan [s]."""
        return float(np.sum(self.durations))

    def shifted(self, step_s: float) -> Plan:
        """Return the plan shifted by `step_s`, with its last thrusts held at the end.

        For stages of equal duration `step_s` this drops the first stage and repeats the last.
        States are interpolated linearly in time. Costates are dropped: the last sets of the paper's
        problems move on with the horizon, and their costs with them.
        """
        moments = np.concatenate([[0.0], np.cumsum(self.durations)]) + step_s
        states, thrusts, _ = self.sampled(moments)
        return Plan(states=states, thrusts=thrusts, durations=self.durations)

    def sampled(
        self, moments: NDArray[np.float64]
    ) -> tuple[NDArray[np.float64], NDArray[np.float64], NDArray[np.float64] | None]:
        """Return states, thrusts and costates at `moments` (m,) [s].

        States are (m, 6), thrusts (m - 1, 2) half-way between the times, costates (m, 6) or None if
        unknown. Beyond the plan's end, states and thrusts are its last ones and the costates zero,
        because nothing is planned there that could cost anything.
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
        """Thrusts planned at a time [s]; beyond the plan's end its last ones."""
        # Called ten times a second, so a scalar is looked up without making an array.
        stage = min(int(self._ends.searchsorted(moment_s, side="right")), len(self._ends) - 1)
        port, starboard = self.thrusts[stage].tolist()
        return port, starboard

    @cached_property
    def _ends(self) -> NDArray[np.float64]:
        """End time of each stage (N,) [s]."""
        return np.cumsum(self.durations)

    def _stage_at(self, moments: NDArray[np.float64]) -> NDArray[np.int64]:
        return np.minimum(np.searchsorted(self._ends, moments, side="right"), len(self._ends) - 1)

    def _shares_at(
        self, moments: NDArray[np.float64]
    ) -> tuple[NDArray[np.int64], NDArray[np.float64]]:
        """Stage of each of `moments` (m,) [s], and the share of it that has passed, (m, 1).

        The share is 0 before the first node and 1 beyond the last.
        """
        ends, durations = self._ends, self.durations
        stage = np.minimum(np.searchsorted(ends, moments), len(ends) - 1)
        span = durations[stage]
        gone = np.minimum(np.maximum(moments - ends[stage] + span, 0.0), span)
        return stage, (gone / np.where(span > 0, span, 1.0))[:, None]


def _between(
    nodes: NDArray[np.float64], stage: NDArray[np.int64], share: NDArray[np.float64]
) -> NDArray[np.float64]:
    """Interpolate values (N + 1, 6) at the nodes to a `share` (m, 1) of each `stage` (m,)."""
    return nodes[stage] + share * (nodes[stage + 1] - nodes[stage])


def rows_needed(sides: Sequence[int]) -> int:
    """Half-space rows needed for sets with these numbers of sides, plus two for the window."""
    return max(sides, default=4) + 2
