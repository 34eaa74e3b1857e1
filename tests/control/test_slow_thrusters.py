"""Thrusters with a lag: the thrust that they can give, and plans that account for it."""

from dataclasses import replace

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from grebe.control.controller import Controller
from grebe.control.rules.base import Situation
from grebe.control.rules.dual import Dual
from grebe.control.slow_thrusters import SlowThrusters
from grebe.control.solvers.builders import Fast, Ipopt
from grebe.control.tracker import Tracker
from grebe.core.events import Warned
from grebe.core.sets import rectangle
from grebe.core.vessel import PRESETS
from grebe.mission.trial import Conditions, meander, simulate
from grebe.simulation.plant import Plant

SPYBOAT, BENCHMARK = PRESETS["spyboat"], PRESETS["benchmark"]
AT_REST = (0.0, 0.0, 0.0, 0.0, 0.0, 0.0)
durations = st.lists(st.floats(0.05, 2.0), min_size=1, max_size=6).map(np.array)


def slow(vessel, now_n, lag_s):
    """A boat's thrusters with a lag, between its limits."""
    least, most = vessel.thrust_min_n, vessel.thrust_max_n
    return SlowThrusters(now_n=now_n, least_n=least, most_n=most, lag_s=lag_s)


@given(durations, st.floats(0.2, 2.0))
def test_the_reach_is_what_thrusters_give_under_the_largest_order(stages, lag_s):
    plant = Plant(replace(SPYBOAT, thruster_lag_s=lag_s), AT_REST)
    plant.command((SPYBOAT.thrust_max_n, SPYBOAT.thrust_min_n))
    least, most = slow(SPYBOAT, (0.0, 0.0), lag_s).reach(stages)
    for k, duration in enumerate(stages):
        pieces = 400
        given_n = []
        for _ in range(pieces):
            before = plant.thrusts
            plant.advance(duration / pieces)
            given_n.append(0.5 * np.add(before, plant.thrusts))
        port, starboard = np.mean(given_n, axis=0)
        assert most[k, 0] == pytest.approx(port, rel=1e-3)
        assert least[k, 1] == pytest.approx(starboard, rel=1e-3)


@given(durations, st.floats(0.05, 3.0), st.floats(-0.9, 0.9), st.floats(-0.9, 0.9))
def test_the_reach_lies_between_now_and_the_limits_and_grows(stages, lag_s, port, starboard):
    now = port * -SPYBOAT.thrust_min_n, starboard * -SPYBOAT.thrust_min_n
    least, most = slow(SPYBOAT, now, lag_s).reach(stages)
    assert np.all(least >= SPYBOAT.thrust_min_n)
    assert np.all(most <= SPYBOAT.thrust_max_n)
    assert np.all(least <= now)
    assert np.all(now <= most)
    assert np.all(np.diff(most, axis=0) >= -1e-9)
    assert np.all(np.diff(least, axis=0) <= 1e-9)


def test_both_solvers_keep_a_plan_within_the_reach():
    sets = [rectangle((0, 5), (0, 5), (1, 2)), rectangle((0, 5), (5, 10), (1, 2))]
    controller = Controller(BENCHMARK, sets, Dual())
    state = np.array([-3.0, -6.0, 1.0, 0.5, 0, 0])
    situation = Situation(state=tuple(state), target=0, ahead=sets, aims=sets)
    guess = controller.roll_out(state)
    free = Dual().propose(situation, controller.shape).horizon
    bound = Dual().propose(situation, controller.shape).horizon
    now = BENCHMARK.thrust_min_n / 2, BENCHMARK.thrust_min_n / 2
    bound.thrust_bounds = slow(BENCHMARK, now, 1.0).reach(guess.durations)
    plans = []
    for builder in (Fast(), Ipopt()):
        solver = builder.build(BENCHMARK, controller.shape)
        unbound = solver.solve(state, free, np.zeros(4), guess).plan.thrusts
        assert np.any(unbound > bound.thrust_bounds[1] + 0.1)
        solution = solver.solve(state, bound, np.zeros(4), guess)
        assert solution.solved
        plans.append(solution)
        assert np.all(solution.plan.thrusts <= bound.thrust_bounds[1] + 1e-6)
        assert np.all(solution.plan.thrusts >= bound.thrust_bounds[0] - 1e-6)
    assert plans[0].cost == pytest.approx(plans[1].cost, rel=1e-3)


def test_a_tracker_reports_slow_thrusters_only():
    quick, known = Tracker(SPYBOAT), Tracker(replace(SPYBOAT, thruster_lag_s=0.8))
    assert quick.thrusters(0.0) is None
    known.sent(0.0, (10.0, 0.0))
    thrusters = known.thrusters(0.8)
    assert thrusters is not None
    assert thrusters.now_n == pytest.approx((10.0 * (1 - np.exp(-1.0)), 0.0))
    assert "matches its model" in known.finding
    # An autopilot that holds a motion compensates for its thrusters itself.
    by_motion = Tracker(replace(SPYBOAT, thruster_lag_s=0.8), holds_motion=True)
    assert by_motion.thrusters(0.0) is None


def sail(model, boat):
    sets = meander(rows=3, columns=6)
    start = (-5.0, 2.0, 0.0, 0.0, 0.0, 0.0)
    return simulate(model, sets, Controller(model, sets), start, Conditions(boat=boat))


def test_a_lag_that_is_known_or_found_costs_little():
    late = replace(SPYBOAT, thruster_lag_s=1.0)
    base, known, found = sail(SPYBOAT, SPYBOAT), sail(late, late), sail(SPYBOAT, late)
    assert known.complete
    assert found.complete
    # Over several starts the median is 1.14 and 1.18, and the most 1.49 and 1.40, when a set is
    # missed; up to 2.18 if plans ignore the lag.
    assert known.duration_s < 1.6 * base.duration_s
    assert found.duration_s < 1.6 * base.duration_s
    corrected = [e for e in known.recorder.of(Warned) if e.code == "model_corrected"]
    assert not corrected
