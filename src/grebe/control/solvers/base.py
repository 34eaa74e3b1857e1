"""Solvers of the optimal control problem, behind one small interface.

`Solver.solve` takes what a rule wrote and a starting plan and returns a `Solution`; whether
it converged is a value, the caller decides what to do about it. A `SolverBuilder` makes the
solver for a vessel and a shape: `Fast`, `Fatrop` and `Ipopt` in `builders` are such values.
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
    """Makes a solver for a vessel and the sizes of a problem."""

    def build(self, vessel: Vessel, shape: HorizonShape) -> Solver:
        """Return a solver of problems of this shape; called once for each controller."""
        ...


@dataclass(frozen=True, kw_only=True)
class Built:
    """A solver that is there already, shared by controllers of one vessel and one shape."""

    solver: Solver

    def build(self, vessel: Vessel, shape: HorizonShape) -> Solver:  # noqa: ARG002
        """Return it; see `SolverBuilder`."""
        return self.solver
