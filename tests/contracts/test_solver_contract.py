"""The contract of every solver, on a common set of problems; one solver is defined here."""

import subprocess
import sys
from dataclasses import dataclass

import numpy as np
import pytest

from grebe.control.controller import Controller
from grebe.control.horizon import HorizonShape
from grebe.control.rules.base import Situation
from grebe.control.rules.dual import Dual
from grebe.control.rules.single import Single
from grebe.control.solvers.base import Built, Solver
from grebe.control.solvers.builders import Fast, Fatrop, Ipopt
from grebe.control.turn_and_go import model_substeps
from grebe.core.sets import rectangle
from grebe.core.vessel import vessel_named

BOAT = vessel_named("benchmark")
DUAL = Dual()
SHAPE = HorizonShape(stages=15, substeps=model_substeps(BOAT, 1.0))


class Polished:
    """A user's own solver: FATROP, started from the plan of the fast solver."""

    def __init__(self, first: Solver, last: Solver) -> None:
        self.first, self.last = first, last

    def solve(self, state, horizon, weather, guess):
        found = self.first.solve(state, horizon, weather, guess)
        return self.last.solve(state, horizon, weather, found.plan if found.solved else guess)


@dataclass(frozen=True)
class Polish:
    def build(self, vessel, shape):
        return Polished(Fast().build(vessel, shape), Fatrop().build(vessel, shape))


BUILDERS = {"fast": Fast(), "fatrop": Fatrop(), "ipopt": Ipopt(), "a user's own": Polish()}
SOLVERS = {name: builder.build(BOAT, SHAPE) for name, builder in BUILDERS.items()}
CELL = rectangle((0, 5), (0, 5), (1, 2))
NEXT = rectangle((5, 10), (0, 5), (1, 2))
SPECK = rectangle((20, 20.02), (2.5, 2.52), (1.5, 1.52))


def posed(state, sets, rule=DUAL):
    situation = Situation(state=state, target=0, ahead=sets, aims=sets)
    return np.array(state, dtype=float), rule.propose(situation, SHAPE).horizon, sets


def start(sets, state):
    built = Built(solver=SOLVERS["fast"])
    return Controller(BOAT, sets, DUAL, solver=built).roll_out(state)


def impossible():
    """Require a set 20 m ahead within the first second: the hard problem is infeasible."""
    state, horizon, sets = posed((-20, 2.5, 0, 1.0, 0, 0), [CELL], Single())
    horizon.require(1, CELL.halfspaces, DUAL.entry_penalty)
    return state, horizon, sets


PROBLEMS = {
    "feasible": posed((-10, 2.5, 0, 1.0, 0, 0), [CELL, NEXT]),
    "infeasible": impossible(),
    "the same set twice": posed((-10, 2.5, 0, 1.0, 0, 0), [CELL, CELL]),
    "on the rim": posed((0, 2.5, 0, 1.0, 0, 0), [CELL, NEXT]),
    "a speck": posed((0, 2.5, 0, 1.0, 0, 0), [SPECK]),
    "far": posed((-100, 2.5, 0, 0, 0, 0), [CELL, NEXT]),
    "behind": posed((15, 2.5, 0, 0, 0, 0), [CELL]),
}


@pytest.mark.parametrize("problem", PROBLEMS)
def test_each_solver_finds_the_cheapest_plan_of_them_all(problem):
    state, horizon, sets = PROBLEMS[problem]
    guess = start(sets, state)
    found = {n: s.solve(state, horizon, np.zeros(4), guess) for n, s in SOLVERS.items()}
    assert all(solution.solved for solution in found.values())
    cheapest = min(solution.cost for solution in found.values())
    for name, solution in found.items():
        assert solution.cost <= cheapest * 1.01 + 0.01, name


def test_a_hard_problem_without_solution_pays_for_its_slack_and_has_a_plan():
    state, horizon, sets = PROBLEMS["infeasible"]
    guess = start(sets, state)
    solution = SOLVERS["fast"].solve(state, horizon, np.zeros(4), guess)
    missed_m = CELL.distance(solution.plan.states[1])
    assert 18.0 < missed_m < 20.0
    assert solution.cost > DUAL.entry_penalty * missed_m


@pytest.mark.parametrize("solver", SOLVERS)
@pytest.mark.parametrize("problem", PROBLEMS)
def test_a_solve_changes_nothing_that_it_is_given_and_keeps_the_limits(problem, solver):
    state, horizon, sets = PROBLEMS[problem]
    guess = start(sets, state)
    given = [state, guess.states, guess.thrusts, guess.durations, horizon.entry_sets]
    before = [array.copy() for array in given]
    plan = SOLVERS[solver].solve(state, horizon, np.zeros(4), guess).plan
    for array, copy in zip(given, before, strict=True):
        assert np.array_equal(array, copy)
    assert plan.states[0] == pytest.approx(state, abs=1e-6)
    assert plan.thrusts.min() >= BOAT.thrust_min_n
    assert plan.thrusts.max() <= BOAT.thrust_max_n


def test_a_user_s_own_solver_steers():
    controller = Controller(BOAT, [CELL, NEXT], DUAL, solver=Polish())
    assert controller.step((-10, 2.5, 0, 0, 0, 0)).status.is_solved


WITHOUT_CASADI = """
import sys
from grebe.control.controller import Controller
from grebe.core.sets import rectangle
from grebe.core.vessel import PRESETS
from grebe.mission.trial import simulate
cells = [rectangle((0, 5), (5 * k, 5 * k + 5), (1, 2)) for k in range(2)]
boat = PRESETS["benchmark"]
flight = simulate(boat, cells, Controller(boat, cells), (-8, 2, 0, 0, 0, 0))
assert flight.complete and len(flight.step_ms) > 5 and flight.report.unsolved_steps == 0
print("casadi" in sys.modules)
"""


def test_a_mission_with_the_fast_solver_never_loads_casadi():
    done = subprocess.run(
        [sys.executable, "-c", WITHOUT_CASADI], capture_output=True, text=True, check=True
    )
    assert done.stdout.strip() == "False"
