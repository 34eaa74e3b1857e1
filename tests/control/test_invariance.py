"""Definition 1 and Psi: counterexamples with proofs, and the claims that a search may make."""

import math

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from grebe.control.invariance import FreeBounds, SetCheck
from grebe.core.dynamics import rates, rk4
from grebe.core.errors import UsageError
from grebe.core.sets import rectangle
from grebe.core.vessel import vessel_named

BOAT = vessel_named("benchmark")
FREE = FreeBounds(sway_mps=0.1, yaw_rate_radps=0.2)


def cell(window):
    return rectangle((0.0, 5.0), (0.0, 5.0), window)


def after(state, thrusts, step_s=1.0):
    return rk4(lambda z: rates(BOAT, z, thrusts), state, step_s, 50)


@pytest.fixture(scope="module")
def found():
    return SetCheck(BOAT, cell((1.0, 2.0)), 1.0).search(FREE, states=256)


def test_a_cell_with_the_paper_s_window_is_not_control_invariant(found):
    """So the hypotheses of Lemmas 4 and 7 do not hold for the paper's sets."""
    assert found.counterexample is not None
    assert found.counterexample.proven
    assert not found.holds_as_far_as_seen
    assert found.kept < found.states


@settings(deadline=None, max_examples=200)
@given(port=st.floats(-10, 20), starboard=st.floats(-10, 20))
def test_no_input_refutes_the_counterexample(found, port, starboard):
    """An independent model with a finer step agrees with the proof."""
    state = found.counterexample.state
    target = cell((1.0, 2.0))
    assert target.contains(state)
    excess = found.counterexample.least_excess - found.counterexample.between
    assert target.distance(after(state, (port, starboard))) > excess > 0


def test_a_slow_window_around_rest_keeps_every_state_that_was_tried():
    """Within one second the boat can turn back: contractive, as far as 512 states show."""
    boat = vessel_named("spyboat")
    search = SetCheck(boat, cell((-0.3, 0.3)), 1.0).search(FREE, states=512)
    assert search.holds_as_far_as_seen
    assert search.kept_inside == search.states
    assert search.worst_excess < 0


def test_the_least_excess_is_no_larger_than_any_input_s():
    check = SetCheck(BOAT, cell((1.0, 2.0)), 1.0)
    state = np.array([4.0, 2.5, 0.3, 1.5, 0.05, -0.1])
    least, best = check.least_excess(state)
    rows = cell((1.0, 2.0)).halfspaces

    def excess(thrusts):
        z = np.array(after(state, thrusts))[[0, 1, 3]]
        return np.max(rows[:, :3] @ z - rows[:, 3])

    assert excess(best) == pytest.approx(least, abs=1e-4)
    rng = np.random.default_rng(0)
    assert all(excess(pair) >= least - 1e-3 for pair in rng.uniform(-10, 20, (300, 2)))


def test_every_witness_of_psi_stays_in_the_set():
    check = SetCheck(BOAT, cell((1.0, 2.0)), 1.0)
    tried = np.random.default_rng(1).uniform(-10, 20, (40, 2))
    witnesses = [(thrusts, check.witness(thrusts, FREE)) for thrusts in tried]
    found = [(thrusts, state) for thrusts, state in witnesses if state is not None]
    assert len(found) > 10
    for thrusts, state in found:
        assert cell((1.0, 2.0)).contains(state)
        assert cell((1.0, 2.0)).distance(after(state, thrusts)) < 1e-4


def test_psi_is_most_of_u_but_not_all_of_it():
    """Full ahead carries every state of [1, 2] m/s out of the window; half of it does not."""
    check = SetCheck(BOAT, cell((1.0, 2.0)), 1.0)
    assert check.witness(np.array([-10.0, -10.0]), FREE) is None
    assert check.witness(np.array([15.0, 15.0]), FREE) is not None
    assert 0.7 < check.input_share(FREE, grid=11) < 0.95


def test_psi_of_a_set_that_holds_rest_contains_rest():
    assert SetCheck(BOAT, cell((-0.5, 1.0)), 1.0).witness(np.zeros(2), FREE) is not None


@pytest.mark.parametrize("step_s", [0.0, -1.0, math.nan])
def test_an_impossible_step_is_refused(step_s):
    with pytest.raises(UsageError):
        SetCheck(BOAT, cell((1.0, 2.0)), step_s)


def test_impossible_bounds_are_refused():
    with pytest.raises(UsageError):
        FreeBounds(sway_mps=-0.1)
