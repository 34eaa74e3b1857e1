"""Tests of plans that start from a simple motion of the boat."""

import pytest

from grebe.control.controller import Controller
from grebe.control.solvers.base import Built, Solution, Status
from grebe.core.dynamics import Weather
from grebe.core.sets import rectangle
from grebe.core.vessel import PRESETS


class NotCalled:
    """A solver that counts its calls and never converges."""

    calls = 0

    def solve(self, state, horizon, weather, guess):
        self.calls += 1
        return Solution(plan=guess, status=Status.NOT_CONVERGED, cost=0.0, iterations=0)


@pytest.mark.parametrize(
    "place", [(-9.7, -22.98, 0.761, 0.437, 0.29, 0.0), (-12.2, -22.1, 0, 0, 0, 0)]
)
def test_where_straight_lines_are_no_motion_of_the_boat_a_plan_starts_from_one_that_is(place):
    """A current and a wind that met in 1 of 200 random missions: no plan for three minutes."""
    weather = Weather(
        current_north_mps=-0.45, current_east_mps=-0.21,
        wind_force_north_n=-9.9, wind_force_east_n=1.2,
    )  # fmt: skip
    cells = [rectangle((5.0 * i, 5.0 * (i + 1)), (0, 5.0), (1, 2)) for i in range(2)]
    second = NotCalled()
    controller = Controller(PRESETS["benchmark"], cells, second_solver=Built(solver=second))
    assert controller.step(place, weather).status.is_solved
    assert second.calls == 0
