"""The fast solver, behind the common interface of solvers."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

import numpy as np

from grebe.control.horizon import DURATION_REGULARISATION, Horizon, HorizonShape, Plan
from grebe.control.solvers.base import Solution, Status
from grebe.control.solvers.fast import sqp
from grebe.core.motion import parameter_vector
from grebe.core.vessel import Vessel

if TYPE_CHECKING:
    from numpy.typing import NDArray

    Array = NDArray[np.float64]

# Largest change in the last step: metres, radians, shares of the thrust range.
TOLERANCE = 1e-2

_STATUS = {
    sqp.CONVERGED: Status.SOLVED,
    sqp.FEASIBLE: Status.FEASIBLE,
    sqp.FAILED: Status.NOT_CONVERGED,
}


class FastSolver:
    """Structured SQP with compiled derivatives; numba brings the compiler."""

    def __init__(self, vessel: Vessel, shape: HorizonShape, most_iterations: int) -> None:
        self._vessel = vessel
        self._shape = shape
        self._most_iterations = most_iterations
        self._limits = np.array([vessel.thrust_min_n, vessel.thrust_max_n])

    def solve(
        self,
        state: NDArray[np.float64],
        horizon: Horizon,
        weather: NDArray[np.float64],
        guess: Plan,
    ) -> Solution:
        """Solve; see `Solver.solve`."""
        low, high = horizon.duration_bounds.T
        span = high - low
        share = np.where(span > 0, (guess.durations - low) / np.where(span > 0, span, 1.0), 0.5)
        shares = np.minimum(np.maximum(share, 0.0), 1.0)
        bounds = horizon.bounds_of_thrusts(*self._limits)
        terms = sqp.Terms(
            p=parameter_vector(self._vessel, weather),
            substeps=self._shape.substeps,
            **_rows(horizon),
            effort=np.array([horizon.effort_weights, horizon.power_weights])
            / self._vessel.thrust_max_n**2,
            timing=np.array(
                [
                    low,
                    span,
                    horizon.time_weights,
                    horizon.duration_nominal,
                    horizon.duration_weights,
                ]
            ),
            limits=self._limits,
            bounds=bounds,
            regularisation=DURATION_REGULARISATION,
        )
        start = guess.states.astype(float)
        start[0] = state
        found = self._optimised(terms, start, np.column_stack([guess.thrusts, shares]), guess)
        ended, iterations, cost, states, inputs, costates = found
        plan = Plan(
            states=states,
            thrusts=np.minimum(np.maximum(inputs[:, :2], bounds[0]), bounds[1]),
            durations=low + np.minimum(np.maximum(inputs[:, 2], 0.0), 1.0) * span,
            costates=costates if np.isfinite(costates).all() else None,
        )
        finite = bool(np.isfinite(states).all() and np.isfinite(inputs).all())
        status = _STATUS[ended] if finite else Status.NOT_CONVERGED
        return Solution(plan=plan, status=status, cost=float(cost), iterations=int(iterations))

    def _optimised(
        self, terms: sqp.Terms, start: Array, inputs: Array, guess: Plan
    ) -> tuple[int, int, float, Array, Array, Array]:
        """The better of two optimisations: its end, iterations, cost, states, inputs and costates.

        The first starts from the guess's costates, if known. They belong to another problem and may
        mislead; if the first does not converge, the second starts from zero costates.
        """
        best: tuple[int, int, float, Array, Array, Array] | None = None
        for known in (guess.costates, None) if guess.costates is not None else (None,):
            states, tried = start.copy(), inputs.copy()
            costates = np.zeros_like(states) if known is None else known.copy()
            ended, iterations, cost = sqp.optimise(
                terms, states, tried, costates, self._most_iterations, TOLERANCE
            )
            if best is None or (ended, cost) < (best[0], best[2]):
                best = ended, iterations, cost, states, tried, costates
            if ended == sqp.CONVERGED:
                break
        assert best is not None
        return best


def _rows(horizon: Horizon) -> dict[str, Any]:
    """Gather the rows of cost sets, entry sets, corridors and separation, node by node.

    Rows that always hold are left out, and sets without weight or price.
    """
    n = horizon.shape.stages
    groups = (horizon.cost_sets, horizon.entry_sets, horizon.corridors, horizon.apart)
    width = max(group.shape[1] for group in groups)
    rows = np.zeros((n + 1, len(groups), width, 4))
    for i, group in enumerate(groups):
        rows[: len(group), i, : group.shape[1]] = group
    weight, price = np.zeros((n + 1, len(groups))), np.zeros((n + 1, len(groups)))
    weight[:n, 0] = horizon.cost_weights
    price[:, 1], price[:, 2] = horizon.entry_penalties, horizon.corridor_penalty
    price[:, 3] = horizon.apart_penalty
    rows[weight + price <= 0] = 0.0
    used = (rows[..., :3] != 0).any(axis=3)
    count = used.sum(axis=2)
    node, group = np.nonzero(count)
    return {
        "rows": rows[used],
        "first": np.concatenate([[0], np.cumsum(count[node, group])]),
        "node": node,
        "weight": weight[node, group],
        "price": price[node, group],
    }
