"""The interface of the solvers of the optimal control problem.

`Solver.solve` takes a rule's horizon and a starting plan and returns a `Solution`. Its status says
whether it converged; the caller decides what to do if not. A `SolverBuilder` makes the solver for
a vessel and a shape: `Fast`, `Fatrop` and `Ipopt` in `builders` are such values.
"""

from __future__ import annotations

import enum
from dataclasses import dataclass
from typing import TYPE_CHECKING, Protocol

from grebe.control.horizon import Horizon, HorizonShape, Plan
from grebe.core.vessel import Vessel

if TYPE_CHECKING:
    import numpy as np
    from numpy.typing import NDArray


class Status(enum.Enum):
    """Outcome of a solve; a feasible plan satisfies the dynamics but is not optimal."""

    SOLVED = "solved"
    FEASIBLE = "feasible"
    NOT_CONVERGED = "not converged"


@dataclass(frozen=True, kw_only=True)
class Solution:
    """A plan, its status, its cost and the number of iterations."""

    plan: Plan
    status: Status
    cost: float
    iterations: int

    @property
    def solved(self) -> bool:
        """Whether the plan may be trusted and the next solve started from it."""
        return self.status is Status.SOLVED


class Solver(Protocol):
    """Interface of a solver."""

    def solve(
        self,
        state: NDArray[np.float64],
        horizon: Horizon,
        weather: NDArray[np.float64],
        guess: Plan,
    ) -> Solution:
        """Solve from `state` (6,) in `weather` (4,), starting at `guess`."""
        ...


class SolverBuilder(Protocol):
    """Interface of a builder, which makes a solver for a vessel and the sizes of a problem."""

    def build(self, vessel: Vessel, shape: HorizonShape) -> Solver:
        """Return a solver for problems of this shape."""
        ...


@dataclass(frozen=True, kw_only=True)
class Built:
    """A builder that returns an existing solver, shared by controllers of one vessel and shape."""

    solver: Solver

    def build(self, vessel: Vessel, shape: HorizonShape) -> Solver:  # noqa: ARG002
        """Return the solver; see `SolverBuilder`."""
        return self.solver
