"""The solvers in CasADi's wheel; only their users import CasADi."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

import casadi as ca
import numpy as np

from grebe.control.horizon import Horizon, Plan
from grebe.control.ocp import Problem
from grebe.control.solvers.base import Solution, Status

if TYPE_CHECKING:
    from numpy.typing import NDArray


def fatrop_solver(problem: Problem, most_iterations: int) -> CasadiSolver:
    """Return FATROP, which exploits the structure of the stages."""
    own = {"mu_init": 1e-2, "tol": 1e-5, "max_iter": most_iterations, "print_level": 0}
    structure = {"structure_detection": "auto", "equality": problem.equality}
    return CasadiSolver(problem, "fatrop", structure | {"fatrop": own})


def ipopt_solver(problem: Problem, most_iterations: int) -> CasadiSolver:
    """Return IPOPT, slow and reliable."""
    own = {"print_level": 0, "sb": "yes", "tol": 1e-8, "max_iter": most_iterations}
    return CasadiSolver(problem, "ipopt", {"ipopt": own})


class CasadiSolver:
    """A problem with one of CasADi's solvers, named by `plugin`, with its `options`."""

    def __init__(self, problem: Problem, plugin: str, options: dict[str, Any]) -> None:
        self._problem = problem
        common = {"expand": True, "print_time": False, "error_on_fail": False}
        self._solver = ca.nlpsol("solver", plugin, problem.nlp, common | options)
        self._bounds = {"lbg": problem.lower_g, "ubg": problem.upper_g}

    def solve(
        self,
        state: NDArray[np.float64],
        horizon: Horizon,
        weather: NDArray[np.float64],
        guess: Plan,
    ) -> Solution:
        """Solve; see `Solver.solve`."""
        problem = self._problem
        lower, upper = problem.bounds(horizon)
        answer = self._solver(
            x0=problem.guess(guess, horizon),
            p=problem.parameters(state, horizon, weather),
            lbx=lower,
            ubx=upper,
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
