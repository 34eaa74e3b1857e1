"""Solvers of the optimal control problem, behind one small interface.

`Solver.solve` takes what a rule wrote and a starting plan and returns a `Solution`; whether
it converged is a value, the caller decides what to do about it.
"""

from __future__ import annotations

import enum
from dataclasses import dataclass
from typing import TYPE_CHECKING, Any, Protocol

import casadi as ca
import numpy as np

from grebe.control.horizon import Horizon, Plan
from grebe.control.ocp import Problem

if TYPE_CHECKING:
    from numpy.typing import NDArray


class Status(enum.Enum):
    """How a solve ended; a feasible plan keeps the dynamics but is not the best one."""

    SOLVED = "solved"
    FEASIBLE = "feasible"
    NOT_CONVERGED = "not converged"


@dataclass(frozen=True, kw_only=True)
class Solution:
    """A plan, the status it comes with, its cost and the iterations spent."""

    plan: Plan
    status: Status
    cost: float
    iterations: int

    @property
    def solved(self) -> bool:
        """Whether the plan may be trusted and the next solve started from it."""
        return self.status is Status.SOLVED


class Solver(Protocol):
    """What a controller needs of a solver."""

    name: str

    def solve(
        self,
        state: NDArray[np.float64],
        horizon: Horizon,
        weather: NDArray[np.float64],
        guess: Plan,
    ) -> Solution:
        """Solve from `state` (6,) in `weather` (4,), starting at `guess`."""
        ...


FATROP_OPTIONS: dict[str, Any] = {
    "structure_detection": "auto",
    "fatrop": {"mu_init": 1e-2, "tol": 1e-5, "max_iter": 120, "print_level": 0},
}
IPOPT_OPTIONS: dict[str, Any] = {
    "ipopt": {"print_level": 0, "sb": "yes", "tol": 1e-8, "max_iter": 200},
}


class CasadiSolver:
    """A solver from CasADi's wheel: FATROP, which uses the stages, or IPOPT, the oracle."""

    def __init__(
        self, problem: Problem, name: str = "fatrop", most_iterations: int | None = None
    ) -> None:
        self.name = name
        self._problem = problem
        options: dict[str, Any] = {"expand": True, "print_time": False, "error_on_fail": False}
        if name == "fatrop":
            options |= FATROP_OPTIONS | {"equality": problem.equality}
        else:
            options |= IPOPT_OPTIONS
        if most_iterations is not None:
            options[name] = options[name] | {"max_iter": most_iterations}
        self._solver = ca.nlpsol("solver", name, problem.nlp, options)
        self._bounds = {
            "lbx": problem.lower_x,
            "ubx": problem.upper_x,
            "lbg": problem.lower_g,
            "ubg": problem.upper_g,
        }

    def solve(
        self,
        state: NDArray[np.float64],
        horizon: Horizon,
        weather: NDArray[np.float64],
        guess: Plan,
    ) -> Solution:
        """Solve; see `Solver.solve`."""
        problem = self._problem
        answer = self._solver(
            x0=problem.guess(guess, horizon),
            p=problem.parameters(state, horizon, weather),
            **self._bounds,
        )
        x = np.asarray(answer["x"]).ravel()
        stats = self._solver.stats()
        solved = bool(stats["success"]) and bool(np.all(np.isfinite(x)))
        return Solution(
            plan=problem.plan(x, horizon),
            status=Status.SOLVED if solved else Status.NOT_CONVERGED,
            cost=float(answer["f"]),
            iterations=int(stats["iter_count"]),
        )
