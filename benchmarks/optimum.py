"""The yardstick: the minimum time for the same sets in the same order, planned all at once.

Every leg has its own stages and every stage its own duration, so that the thrusts may switch
at any time; the entry into each set is required at the end of its leg at a price far above
any time it could save. With `held` the surge stays below the window's top on the way too, as
`lookahead` keeps it, at the same price: a yardstick for the same task. Without, the boat may
race between sets. FATROP solves it from a flown track.
"""

from __future__ import annotations

from itertools import pairwise

import numpy as np

from grebe.control.horizon import Horizon, HorizonShape, Plan
from grebe.control.rules.lookahead import Lookahead, pace_rows
from grebe.control.solvers.builders import Fatrop

STAGES_A_LEG = 5
MOST_ITERATIONS = 1000


def optimum(vessel, targets, flight, substeps: int, *, held: bool) -> tuple[float, float, bool]:
    """Minimum time [s], the largest violation of a set, and whether the solver converged."""
    legs = len(targets)
    n = STAGES_A_LEG * legs
    shape = HorizonShape(stages=n, set_rows=len(targets[0].halfspaces), substeps=substeps)
    solver = Fatrop(most_iterations=MOST_ITERATIONS).build(vessel, shape)
    horizon = Horizon(shape=shape)
    horizon.duration_bounds[:] = (0.01, 3.0)
    horizon.time_weights[:] = 1.0
    horizon.effort_weights[:] = 1e-5
    for leg, target in enumerate(targets):
        horizon.require(STAGES_A_LEG * (leg + 1), target.halfspaces, 1e3)
        if held:
            for stage in range(STAGES_A_LEG * leg, STAGES_A_LEG * (leg + 1)):
                horizon.attract(stage, pace_rows(target), Lookahead().hold)
    guess = _flown(vessel, targets, flight)
    state = guess.states[0]
    solution = None
    # A pull towards the last pace, loosened step by step, leads to the unpulled optimum.
    for pull in (2.0, 0.2, 0.0):
        horizon.duration_nominal[:] = guess.durations
        horizon.duration_weights[:] = pull
        solution = solver.solve(state, horizon, np.zeros(4), guess)
        if solution.solved:
            guess = solution.plan
    plan = guess
    worst = max(targets[leg].distance(plan.states[STAGES_A_LEG * (leg + 1)]) for leg in range(legs))
    return plan.duration_s, worst, bool(solution and solution.solved)


def _flown(vessel, targets, flight) -> Plan:
    track = np.array(flight.track)
    times, states = track[:, 0], track[:, 1:]
    entries, reached = [0.0], 0
    for t, z in zip(times, states, strict=True):
        while reached < len(targets) and targets[reached].contains(z):
            entries.append(max(t, entries[-1] + 0.1))
            reached += 1
    moments = np.concatenate(
        [np.linspace(a, b, STAGES_A_LEG, endpoint=False) for a, b in pairwise(entries)]
        + [[entries[-1]]]
    )
    sampled = np.column_stack([np.interp(moments, times, column) for column in states.T])
    cruise = 0.5 * vessel.surge_drag_n(1.5)
    return Plan(
        states=sampled,
        thrusts=np.full((len(moments) - 1, 2), cruise),
        durations=np.diff(moments),
    )
