"""The available solvers, as values that build them.

Each imports its solver only when it builds it, so a boat that is steered by `Fast` never loads
CasADi.
"""

from __future__ import annotations

from dataclasses import dataclass

from grebe.control.horizon import HorizonShape
from grebe.control.solvers.base import Solver
from grebe.core.vessel import Vessel


@dataclass(frozen=True, kw_only=True)
class Fast:
    """Structured SQP with compiled derivatives: the default."""

    most_iterations: int = 30

    def build(self, vessel: Vessel, shape: HorizonShape) -> Solver:
        """Return the solver; see `SolverBuilder`."""
        from grebe.control.solvers.fast.solver import FastSolver

        return FastSolver(vessel, shape, self.most_iterations)


@dataclass(frozen=True, kw_only=True)
class Fatrop:
    """FATROP through CasADi, an interior point that exploits the structure of the stages."""

    most_iterations: int = 120

    def build(self, vessel: Vessel, shape: HorizonShape) -> Solver:
        """Return the solver; see `SolverBuilder`."""
        from grebe.control.ocp import build
        from grebe.control.solvers.casadi import fatrop_solver

        return fatrop_solver(build(vessel, shape), self.most_iterations)


@dataclass(frozen=True, kw_only=True)
class Ipopt:
    """IPOPT through CasADi: slow and reliable, the reference for the other solvers."""

    most_iterations: int = 200

    def build(self, vessel: Vessel, shape: HorizonShape) -> Solver:
        """Return the solver; see `SolverBuilder`."""
        from grebe.control.ocp import build
        from grebe.control.solvers.casadi import ipopt_solver

        return ipopt_solver(build(vessel, shape), self.most_iterations)
