"""Every solver on one common set of problems; every rule on the targets that trip controllers."""

import numpy as np
import pytest

from grebe.control.controller import Controller, model_substeps
from grebe.control.horizon import HorizonShape
from grebe.control.ocp import build
from grebe.control.rules.base import Situation, dual, single
from grebe.control.settings import paper_settings, settings_for
from grebe.control.solvers.base import CasadiSolver
from grebe.control.solvers.fast.solver import FastSolver
from grebe.core.sets import rectangle
from grebe.core.vessel import vessel_named
from grebe.mission.trial import Conditions, fly

BOAT = vessel_named("benchmark")
SETTINGS = paper_settings()
SHAPE = HorizonShape(stages=15, substeps=model_substeps(BOAT, 1.0))
SOLVERS = {
    "fast": FastSolver(BOAT, SHAPE),
    "fatrop": CasadiSolver(build(BOAT, SHAPE), "fatrop"),
    "ipopt": CasadiSolver(build(BOAT, SHAPE), "ipopt"),
}
CELL = rectangle((0, 5), (0, 5), (1, 2))
NEXT = rectangle((5, 10), (0, 5), (1, 2))
SPECK = rectangle((20, 20.02), (2.5, 2.52), (1.5, 1.52))


def posed(state, sets, rule=dual):
    situation = Situation(state=state, target=0, ahead=sets, aims=sets)
    return np.array(state, dtype=float), rule(situation, SETTINGS, SHAPE).horizon, sets


def impossible():
    """Within the first second in a set that is 20 m ahead: the hard problem has no solution."""
    state, horizon, sets = posed((-20, 2.5, 0, 1.0, 0, 0), [CELL], single)
    horizon.require(1, CELL.halfspaces, SETTINGS.entry_penalty)
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
    guess = Controller(BOAT, sets, SETTINGS, solver=SOLVERS["fast"]).roll_out(state)
    found = {n: s.solve(state, horizon, np.zeros(4), guess) for n, s in SOLVERS.items()}
    assert all(solution.solved for solution in found.values())
    cheapest = min(solution.cost for solution in found.values())
    for name, solution in found.items():
        assert solution.cost <= cheapest * 1.01 + 0.01, name


def test_a_hard_problem_without_solution_pays_for_its_slack_and_has_a_plan():
    state, horizon, sets = PROBLEMS["infeasible"]
    guess = Controller(BOAT, sets, SETTINGS, solver=SOLVERS["fast"]).roll_out(state)
    solution = SOLVERS["fast"].solve(state, horizon, np.zeros(4), guess)
    missed_m = CELL.distance(solution.plan.states[1])
    assert 18.0 < missed_m < 20.0
    assert solution.cost > SETTINGS.entry_penalty * missed_m


AWKWARD = {
    "repeated": [CELL, CELL, CELL, NEXT],
    "overlapping": [rectangle((3 * k, 3 * k + 5), (0, 5), (1, 2)) for k in range(5)],
    "nested": [rectangle((0, 20), (0, 20), (1, 2)), rectangle((8, 12), (8, 12), (1, 2))],
    "not adjacent": [
        CELL,
        rectangle((30, 35), (20, 25), (1, 2)),
        rectangle((0, 5), (40, 45), (1, 2)),
    ],
    "behind each other": [rectangle((20, 25), (0, 5), (1, 2)), CELL, NEXT],
    "tiny": [rectangle((6 * k, 6 * k + 0.5), (0, 0.5), (1, 2)) for k in range(4)],
    "slow, then fast": [
        rectangle((0, 5), (0, 5), (0.2, 0.6)),
        rectangle((5, 10), (0, 5), (1.4, 2)),
    ],
}


@pytest.mark.slow
@pytest.mark.parametrize("targets", AWKWARD)
@pytest.mark.parametrize("rule", ["dual", "lookahead"])
def test_awkward_targets_are_reached(rule, targets):
    sets = AWKWARD[targets]
    pilot = Controller(BOAT, sets, settings_for(rule))
    flight = fly(BOAT, sets, pilot, (-10, 2.5, 0, 0, 0, 0), Conditions(limit_s=300))
    assert flight.complete
    assert flight.report.unsolved_steps == 0
