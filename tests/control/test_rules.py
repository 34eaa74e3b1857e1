"""Definitions 5 and 6, Eq. (6), N_x, and the rules as pure functions, without a solver."""

import numpy as np
import pytest
from conftest import states
from hypothesis import given
from hypothesis import strategies as st

from grebe.control.controller import Margins
from grebe.control.horizon import NO_ROW, HorizonShape, Plan
from grebe.control.rules.base import Decision, Progress, Situation, reached_count
from grebe.control.rules.dual import Dual
from grebe.control.rules.lookahead import ENTRY_PENALTY, LONGEST_STAGE_S, Lookahead
from grebe.control.rules.single import Single
from grebe.control.rules.split import STALL_STEPS, Approach, split_stage
from grebe.core.errors import UsageError
from grebe.core.sets import rectangle

FIRST = rectangle((0, 5), (0, 5), (1, 2))
SECOND = rectangle((5, 10), (0, 5), (1, 2))
DUAL, SINGLE = Dual(), Single()
SHAPE = HorizonShape(stages=15)


def situation(state, *, sets=(FIRST, SECOND), last=None):
    return Situation(state=state, target=0, ahead=sets, aims=sets, last=last)


def answer(rule, at):
    proposal = rule.propose(at, SHAPE)
    return proposal.horizon, proposal.decision


def at_distance(d):
    """A state in the speed window, d metres south of the first set."""
    return (-d, 2.5, 0.0, 1.5, 0.0, 0.0)


def is_open(rows):
    return np.array_equal(rows, np.tile(NO_ROW, (len(rows), 1)))


def test_split_is_the_horizon_on_the_rim_and_zero_inside():
    """Remark 10."""
    assert split_stage(DUAL.epsilon, DUAL.epsilon, 15) == 15
    assert split_stage(0.0, DUAL.epsilon, 15) == 0
    assert split_stage(DUAL.epsilon * 1.001, DUAL.epsilon, 15) == 15


@given(st.floats(0, 50), st.floats(0, 50), st.integers(2, 60))
def test_split_grows_with_distance_and_stays_in_the_horizon(a, b, n):
    near, far = sorted((a, b))
    assert 0 <= split_stage(near, 15.0, n) <= split_stage(far, 15.0, n) <= n


def test_definition_5_counts_in_order_only():
    inside_second = (7, 2.5, 0, 1.5, 0, 0)
    assert reached_count([FIRST, SECOND], 0, inside_second) == 0
    assert reached_count([FIRST, SECOND], 0, (2, 2, 0, 1.5, 0, 0)) == 1
    assert reached_count([FIRST, SECOND], 1, inside_second) == 2


def test_one_state_may_reach_overlapping_sets_at_once():
    assert reached_count([FIRST, FIRST, SECOND], 0, (5, 2, 0, 1.5, 0, 0)) == 3


def test_a_set_is_not_reached_out_of_its_speed_window():
    assert reached_count([FIRST], 0, (2, 2, 0, 0.5, 0, 0)) == 0


def test_single_draws_every_stage_to_the_current_set():
    horizon, decision = answer(SINGLE, situation(at_distance(40)))
    assert decision.split == 15
    assert all(np.array_equal(rows, FIRST.halfspaces) for rows in horizon.cost_sets)
    assert np.array_equal(horizon.entry_sets[15], FIRST.halfspaces)


def test_dual_outside_the_fattened_set_is_single():
    """Eq. (6), second case."""
    far = situation(at_distance(40))
    one, _ = answer(SINGLE, far)
    two, _ = answer(DUAL, far)
    assert np.array_equal(one.cost_sets, two.cost_sets)
    assert np.array_equal(one.entry_sets, two.entry_sets)


def test_dual_inside_it_splits_cost_and_constraints():
    """Eqs. (6) to (8), first case: d = 7 gives N_x = 7."""
    rule = Dual(p=2.0, q=3.0, alpha=0.5)
    horizon, decision = answer(rule, situation(at_distance(7)))
    assert decision.split == 7
    assert np.array_equal(horizon.cost_sets[6], FIRST.halfspaces)
    assert np.array_equal(horizon.cost_sets[7], SECOND.halfspaces)
    assert horizon.cost_weights[6] == pytest.approx(1.0)
    assert horizon.cost_weights[7] == pytest.approx(1.5)
    assert np.array_equal(horizon.entry_sets[7], FIRST.halfspaces)
    assert np.array_equal(horizon.entry_sets[15], SECOND.halfspaces)


def test_the_last_set_has_no_successor():
    horizon, decision = answer(DUAL, situation(at_distance(7), sets=(FIRST,)))
    assert decision.split == 7
    assert is_open(horizon.entry_sets[15])
    assert np.all(horizon.cost_weights[7:] == 0)


def test_on_the_rim_the_last_node_is_asked_to_be_in_one_set_only():
    horizon, decision = answer(DUAL, situation(at_distance(15)))
    assert decision.split == 15
    assert np.array_equal(horizon.entry_sets[15], FIRST.halfspaces)


@given(states(40))
def test_the_fixed_rules_keep_the_paper_s_step(state):
    for rule in (SINGLE, DUAL):
        horizon, _ = answer(rule, situation(state))
        assert np.all(horizon.duration_bounds == DUAL.step_s)
        assert np.all(horizon.time_weights == 0)


def test_a_stalled_split_is_counted_down_from_the_horizon():
    """At rest in the cell, d = 1 and N_x = 1 for ever: the deadlock of the paper's rule."""
    at_rest = (2.5, 2.5, 0.0, 0.0, 0.0, 0.0)
    last, splits = None, []
    for _ in range(STALL_STEPS + 16):
        _, last = answer(DUAL, situation(at_rest, last=last))
        splits.append(last.split)
    assert splits[: STALL_STEPS + 1] == [1, 1, 1, 15]
    assert splits[STALL_STEPS : STALL_STEPS + 15] == list(range(15, 0, -1))


def test_a_count_down_ends_with_its_target():
    memory = Approach(progress=Progress(nearest=0.1, idle=9), committed=True)
    last = Decision(target=7, split=4, memory=memory)
    _, decision = answer(DUAL, situation(at_distance(7), last=last))
    assert decision.split == 7
    assert not decision.memory.committed


def test_settings_out_of_bounds_are_refused():
    for kind, wrong in (
        (Lookahead, {"stages": 1}),
        (Lookahead, {"hold": -1.0}),
        (Single, {"step_s": 0.0}),
        (Single, {"beta": float("nan")}),
        (Dual, {"epsilon": -1.0}),
        (Margins, {"set_m": -0.1}),
    ):
        with pytest.raises(UsageError):
            kind(**wrong)


def test_a_plan_whose_last_stage_lasts_no_time_ends_where_it_ends():
    states = np.array([np.full(6, 0.0), np.full(6, 1.0), np.full(6, 5.0)])
    plan = Plan(states=states, thrusts=np.zeros((2, 2)), durations=np.array([1.0, 0.0]))
    found, _, _ = plan.sampled(np.array([0.5, 1.5, 9.0]))
    assert found[:, 0].tolist()[0] == 0.5
    assert found[1:, 0].tolist() == [1.0, 1.0]


@given(st.floats(0.1, 3.0), st.integers(2, 10))
def test_a_plan_shifted_by_its_step_drops_the_first_stage(step, n):
    states = np.arange((n + 1) * 6, dtype=float).reshape(n + 1, 6)
    thrusts = np.arange(2 * n, dtype=float).reshape(n, 2)
    plan = Plan(states=states, thrusts=thrusts, durations=np.full(n, step))
    later = plan.shifted(step)
    assert later.states[:-1] == pytest.approx(states[1:])
    assert later.thrusts[:-1] == pytest.approx(thrusts[1:])
    assert later.thrusts[-1] == pytest.approx(thrusts[-1])


CELLS = [rectangle((5 * i, 5 * i + 5), (0, 5), (1, 2)) for i in range(16)]
LONG = HorizonShape(stages=32)


def ahead_of(state, cells=CELLS, **more):
    return Lookahead().propose(
        Situation(state=state, target=0, ahead=cells, aims=cells, **more), LONG
    )


def test_lookahead_deals_its_stages_to_the_next_sets():
    proposal = ahead_of(at_distance(1))
    entries = proposal.decision.entries
    assert len(entries) >= 6
    assert entries[-1] == 32
    for node, cell in zip(entries, CELLS, strict=False):
        assert np.array_equal(proposal.horizon.entry_sets[node], cell.halfspaces)
        assert proposal.horizon.entry_penalties[node] == ENTRY_PENALTY


def test_lookahead_minimises_time_and_lets_durations_go():
    horizon = ahead_of(at_distance(1)).horizon
    assert np.all(horizon.time_weights == 1)
    assert np.all(horizon.duration_bounds[:, 0] < horizon.duration_bounds[:, 1])


@given(states(100), st.integers(1, 16))
def test_lookahead_s_start_is_of_the_horizon_s_size_from_any_state(state, count):
    proposal = ahead_of(state, CELLS[:count])
    assert proposal.start.states.shape == (33, 6)
    assert proposal.start.states[0] == pytest.approx(state)
    assert np.all(proposal.start.durations > 0)
    assert proposal.decision.entries[-1] == 32


def test_lookahead_goes_on_from_its_last_plan():
    """Half a second later the next entry is planned half a second earlier."""
    first = ahead_of(at_distance(6))
    later = ahead_of(at_distance(5.2), last=first.decision, plan=first.start, elapsed_s=0.5)
    due = [p.start.durations[: p.decision.entries[0]].sum() for p in (first, later)]
    assert due[1] == pytest.approx(due[0] - 0.5, abs=1e-6)


def test_a_set_too_far_for_the_horizon_takes_all_of_it():
    proposal = ahead_of((-500.0, 2.5, 0, 0, 0, 0))
    assert proposal.decision.entries == (32,)
    assert np.all(proposal.horizon.duration_bounds[:, 1] == LONGEST_STAGE_S)


def test_each_mode_of_the_dual_rule_has_its_whole_cost_weighed():
    """Eq. (7): p and q multiply both distance and effort.

    So a common factor of p, q and the price of a set's slack changes nothing.
    """
    one, _ = answer(Dual(p=3.0, q=5.0), situation(at_distance(7.0)))
    split = split_stage(7.0, Dual().epsilon, 15)
    assert 0 < split < 15
    assert one.effort_weights[:split] == pytest.approx(3.0 * Dual().beta)
    assert one.effort_weights[split:] == pytest.approx(5.0 * Dual().beta)


@pytest.mark.parametrize("bad", [{"alpha": np.inf}, {"beta": np.nan}, {"stages": 15.0}])
@pytest.mark.parametrize("rule", [Single, Dual])
def test_weights_that_only_fail_at_sea_are_refused(rule, bad):
    with pytest.raises(UsageError):
        rule(**bad)
