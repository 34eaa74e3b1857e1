"""The optimal control problem: one parametric problem for every rule and every mode.

Problem (8) of the paper with cost (7), in a form that is always feasible ("form D"). The
dynamics are hard constraints. The sets that must contain a node are softened by one L1 slack a
node. Its price is above the multipliers of the hard problem, so both problems have the same
minimiser if the hard one is feasible. Everything that a rule decides is a parameter; durations are
variables between bounds that are parameters.

    min  sum_k  w_k D(z_k, C_k) + (beta_k + rho_k T_k) |F_k / F_max|^2 + theta_k T_k
         + sum_k eta_k (T_k - T0_k)^2 + sum_k pi_k s_k
    s.t. z_0 = z,  z_{k+1} = f(z_k, F_k, T_k),  A_k (x, y, u)_k <= b_k + s_k,  0 <= s_k

D(z, C) = sum_i max(0, a_i z - b_i)^2 over the rows of C: a generalised distance function
(Definition 2), and the squared Euclidean distance when C is a box.

This file states the problem as CasADi expressions, in the order by stages that structured
solvers need: z_0, F_0, sigma_0, s_0, z_1, ...
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING, Any

import casadi as ca
import numpy as np

from grebe.control.horizon import DURATION_REGULARISATION, Horizon, HorizonShape, Plan
from grebe.core.dynamics import rates, rk4
from grebe.core.vessel import Vessel

if TYPE_CHECKING:
    from numpy.typing import NDArray

STATES, THRUSTS, WEATHER = 6, 2, 4


@dataclass(frozen=True, kw_only=True)
class Problem:
    """A built problem: expressions, bounds and the layout of its vectors.

    `nlp` has x, p, f, g; `equality` marks the rows of g that are dynamics.
    """

    vessel: Vessel
    shape: HorizonShape
    nlp: dict[str, Any]
    lower_x: NDArray[np.float64]
    upper_x: NDArray[np.float64]
    lower_g: NDArray[np.float64]
    upper_g: NDArray[np.float64]
    equality: list[bool]

    @property
    def slacks(self) -> int:
        """Slack variables of a node: entry, and corridor and others if the shape has them."""
        return 1 + (self.shape.corridor_rows > 0) + (self.shape.apart_rows > 0)

    @property
    def stage_width(self) -> int:
        """Number of variables from one node to the next."""
        return STATES + THRUSTS + 1 + self.slacks

    def parameters(
        self, state: NDArray[np.float64], horizon: Horizon, weather: NDArray[np.float64]
    ) -> NDArray[np.float64]:
        """Lay out the parameter vector; the order is that of `_Parameters`."""
        low, high = horizon.duration_bounds.T
        efforts = [horizon.effort_weights, horizon.power_weights]
        stage = [horizon.cost_weights, *efforts, low, high - low]
        return np.concatenate(
            [
                state,
                weather,
                *stage,
                horizon.time_weights,
                horizon.duration_nominal,
                horizon.duration_weights,
                horizon.entry_penalties,
                [horizon.corridor_penalty, horizon.apart_penalty],
                horizon.cost_sets.ravel(),
                horizon.entry_sets.ravel(),
                horizon.corridors.ravel(),
                horizon.apart.ravel(),
            ]
        )

    def bounds(self, horizon: Horizon) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
        """Lower and upper bounds of the variables; a horizon may narrow those of the thrusts."""
        n, width = self.shape.stages, self.stage_width
        lower, upper = self.lower_x.copy(), self.upper_x.copy()
        for bound, thrusts in zip((lower, upper), self._thrust_bounds(horizon), strict=True):
            bound[: n * width].reshape(n, width)[:, STATES : STATES + THRUSTS] = thrusts
        return lower, upper

    def _thrust_bounds(self, horizon: Horizon) -> NDArray[np.float64]:
        return horizon.bounds_of_thrusts(self.vessel.thrust_min_n, self.vessel.thrust_max_n)

    def guess(self, plan: Plan, horizon: Horizon) -> NDArray[np.float64]:
        """Lay out a plan as the solver's starting point."""
        n, width = self.shape.stages, self.stage_width
        x = np.zeros(n * width + STATES + self.slacks)
        body = x[: n * width].reshape(n, width)
        low, high = horizon.duration_bounds.T
        span = np.where(high > low, high - low, 1.0)
        share = np.where(high > low, (plan.durations - low) / span, 0.5)
        body[:, :STATES] = plan.states[:-1]
        body[:, STATES : STATES + THRUSTS] = plan.thrusts
        body[:, STATES + THRUSTS] = np.clip(share, 0.01, 0.99)
        x[n * width : n * width + STATES] = plan.states[-1]
        return x

    def plan(self, x: NDArray[np.float64], horizon: Horizon) -> Plan:
        """Read the plan from a solution vector."""
        n, width = self.shape.stages, self.stage_width
        body = x[: n * width].reshape(n, width)
        low, high = horizon.duration_bounds.T
        last = x[n * width : n * width + STATES]
        thrusts = body[:, STATES : STATES + THRUSTS]
        return Plan(
            states=np.vstack([body[:, :STATES], last]),
            thrusts=np.clip(thrusts, *self._thrust_bounds(horizon)),
            durations=low + np.clip(body[:, STATES + THRUSTS], 0.0, 1.0) * (high - low),
        )


class _Parameters:
    """Symbols of the parameter vector, in the order of `Problem.parameters`."""

    def __init__(self, shape: HorizonShape) -> None:
        n, rows = shape.stages, shape.set_rows
        self._all: list[ca.SX] = []
        self.state = self._vector("state", STATES)
        self.weather = self._vector("weather", WEATHER)
        self.cost_weight = self._vector("cost_weight", n)
        self.effort_weight = self._vector("effort_weight", n)
        self.power_weight = self._vector("power_weight", n)
        self.duration_min = self._vector("duration_min", n)
        self.duration_span = self._vector("duration_span", n)
        self.time_weight = self._vector("time_weight", n)
        self.duration_nominal = self._vector("duration_nominal", n)
        self.duration_weight = self._vector("duration_weight", n)
        self.entry_penalty = self._vector("entry_penalty", n + 1)
        self.corridor_penalty = self._vector("corridor_penalty", 1)
        self.apart_penalty = self._vector("apart_penalty", 1)
        self.cost_set = self._sets("cost_set", n, rows)
        self.entry_set = self._sets("entry_set", n + 1, rows)
        self.corridor = self._sets("corridor", n + 1, shape.corridor_rows)
        self.apart = self._sets("apart", n + 1, shape.apart_rows)
        self.vector = ca.vertcat(*self._all)

    def _vector(self, name: str, size: int) -> ca.SX:
        symbol = ca.SX.sym(name, size)
        self._all.append(symbol)
        return symbol

    def _sets(self, name: str, count: int, rows: int) -> list[ca.SX]:
        # NumPy is row-major and CasADi column-major, hence the transpose.
        return [self._vector(f"{name}{k}", 4 * rows).reshape((4, rows)).T for k in range(count)]


def build(vessel: Vessel, shape: HorizonShape) -> Problem:
    """Pose the problem for a vessel and a shape, without solving it."""
    return _Builder(vessel, shape).problem()


class _Builder:
    """Collects variables, bounds, constraints and cost, stage by stage."""

    def __init__(self, vessel: Vessel, shape: HorizonShape) -> None:
        self.vessel = vessel
        self.shape = shape
        self.p = _Parameters(shape)
        self.x: list[ca.SX] = []
        self.lower_x: list[float] = []
        self.upper_x: list[float] = []
        self.g: list[ca.SX] = []
        self.lower_g: list[float] = []
        self.upper_g: list[float] = []
        self.equality: list[bool] = []
        self.cost: ca.SX = ca.SX(0)

    def problem(self) -> Problem:
        state = self._state(0)
        for k in range(self.shape.stages):
            thrusts, duration = self._inputs(k)
            slacks = self._slack_variables(k)
            following = self._state(k + 1, register=False)
            self._dynamics(state, thrusts, duration, following)
            if k == 0:
                self._constrain(state - self.p.state, 0.0, 0.0)
            self._sets(k, state, slacks)
            self._stage_cost(k, state, thrusts, duration)
            self._register_state(following)
            state = following
        slacks = self._slack_variables(self.shape.stages)
        self._sets(self.shape.stages, state, slacks)
        return Problem(
            vessel=self.vessel,
            shape=self.shape,
            nlp={
                "x": ca.vertcat(*self.x),
                "p": self.p.vector,
                "f": self.cost,
                "g": ca.vertcat(*self.g),
            },
            lower_x=np.array(self.lower_x),
            upper_x=np.array(self.upper_x),
            lower_g=np.array(self.lower_g),
            upper_g=np.array(self.upper_g),
            equality=self.equality,
        )

    def _variable(self, symbol: ca.SX, lower: float, upper: float) -> ca.SX:
        self.x.append(symbol)
        self.lower_x += [lower] * symbol.numel()
        self.upper_x += [upper] * symbol.numel()
        return symbol

    def _constrain(self, expression: ca.SX, lower: float, upper: float) -> None:
        self.g.append(expression)
        self.lower_g += [lower] * expression.numel()
        self.upper_g += [upper] * expression.numel()
        self.equality += [lower == upper] * expression.numel()

    def _state(self, k: int, *, register: bool = True) -> ca.SX:
        state = ca.SX.sym(f"z{k}", STATES)
        if register:
            self._register_state(state)
        return state

    def _register_state(self, state: ca.SX) -> None:
        self._variable(state, -np.inf, np.inf)

    def _inputs(self, k: int) -> tuple[ca.SX, ca.SX]:
        limits = self.vessel.thrust_min_n, self.vessel.thrust_max_n
        thrusts = self._variable(ca.SX.sym(f"F{k}", THRUSTS), *limits)
        share = self._variable(ca.SX.sym(f"sigma{k}"), 0.0, 1.0)
        self.cost += DURATION_REGULARISATION * (share - 0.5) ** 2
        return thrusts, self.p.duration_min[k] + share * self.p.duration_span[k]

    def _slack_variables(self, k: int) -> list[ca.SX]:
        prices = [self.p.entry_penalty[k]]
        if self.shape.corridor_rows:
            prices.append(self.p.corridor_penalty)
        if self.shape.apart_rows:
            prices.append(self.p.apart_penalty)
        slacks = [self._variable(ca.SX.sym(f"s{k}_{i}"), 0.0, np.inf) for i in range(len(prices))]
        for price, slack in zip(prices, slacks, strict=True):
            self.cost += price * slack
        return slacks

    def _dynamics(self, state: ca.SX, thrusts: ca.SX, duration: ca.SX, following: ca.SX) -> None:
        weather = ca.vertsplit(self.p.weather)
        inputs = ca.vertsplit(thrusts)

        def derivative(z: Any) -> list[ca.SX]:
            return rates(self.vessel, z, inputs, weather, cos=ca.cos, sin=ca.sin)

        predicted = rk4(derivative, ca.vertsplit(state), duration, self.shape.substeps)
        self._constrain(following - ca.vertcat(*predicted), 0.0, 0.0)

    def _sets(self, k: int, state: ca.SX, slacks: list[ca.SX]) -> None:
        self._constrain(_excess(self.p.entry_set[k], state) - slacks[0], -np.inf, 0.0)
        if self.shape.corridor_rows:
            self._constrain(_excess(self.p.corridor[k], state) - slacks[1], -np.inf, 0.0)
        if self.shape.apart_rows:
            self._constrain(_excess(self.p.apart[k], state) - slacks[-1], -np.inf, 0.0)

    def _stage_cost(self, k: int, state: ca.SX, thrusts: ca.SX, duration: ca.SX) -> None:
        outside = ca.fmax(_excess(self.p.cost_set[k], state), 0.0)
        effort = ca.sumsqr(thrusts / self.vessel.thrust_max_n)
        self.cost += self.p.cost_weight[k] * ca.sumsqr(outside)
        self.cost += (self.p.effort_weight[k] + self.p.power_weight[k] * duration) * effort
        self.cost += self.p.time_weight[k] * duration
        self.cost += self.p.duration_weight[k] * (duration - self.p.duration_nominal[k]) ** 2


def _excess(rows: ca.SX, state: ca.SX) -> ca.SX:
    """A z - b for each half-space row, positive outside."""
    position_and_surge = ca.vertcat(state[0], state[1], state[3])
    return rows[:, :3] @ position_and_surge - rows[:, 3]
