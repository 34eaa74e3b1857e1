"""The contract of every rule; two rules are defined here, as a user would define them."""

import copy
import inspect
import re
import sys
import types
from dataclasses import dataclass, fields
from pathlib import Path

import numpy as np
import pytest
from conftest import states
from hypothesis import given
from hypothesis import strategies as st

from grebe.control.controller import Controller
from grebe.control.horizon import Horizon, HorizonShape, Plan
from grebe.control.rules.base import Decision, Proposal, Situation, confine, shifted
from grebe.control.rules.dual import Dual
from grebe.control.rules.lookahead import Lookahead
from grebe.control.rules.single import Single
from grebe.core.sets import rectangle
from grebe.core.vessel import HullMasses, Vessel, paper_masses, vessel_named
from grebe.mission.trial import Conditions, simulate

BOAT = vessel_named("benchmark")
HOW_TO = Path(__file__).resolve().parents[2] / "docs" / "how-to"


# docs/how-to/add-a-rule.md shows this class.
@dataclass(frozen=True, kw_only=True)
class Sprint:
    """To the current set alone, in the shortest time: every duration is free, nothing is held."""

    stages: int = 12
    step_s: float = 0.5
    longest_stage_s: float = 1.2

    def propose(self, situation: Situation, shape: HorizonShape) -> Proposal:
        aim = situation.aims[0].halfspaces
        horizon = Horizon(shape=shape)
        horizon.duration_bounds[:] = (0.005, self.longest_stage_s)
        horizon.duration_nominal[:] = 0.5
        horizon.duration_weights[:] = 0.1
        horizon.time_weights[:] = 1.0
        horizon.effort_weights[:] = 0.01
        for stage in range(shape.stages):
            horizon.attract(stage, aim, 0.1)
        horizon.require(shape.stages, aim, 100.0)
        confine(horizon, situation, [shape.stages])
        decision = Decision(target=situation.target, split=shape.stages)
        return Proposal(horizon=horizon, decision=decision, start=shifted(situation))


RULES = {"single": Single(), "dual": Dual(), "lookahead": Lookahead(), "a user's own": Sprint()}
CELLS = [rectangle((5 * i, 5 * i + 5), (0, 5), (1, 2)) for i in range(16)]
MIRRORED = [rectangle((5 * i, 5 * i + 5), (-5, 0), (1, 2)) for i in range(16)]
# East, heading, sway and yaw rate change sign.
MIRROR = np.array([1, -1, -1, 1, -1, -1])


def shape_of(rule):
    return HorizonShape(stages=rule.stages)


def ahead(state, cells=CELLS, count=16, **more):
    return Situation(state=state, target=0, ahead=cells[:count], aims=cells[:count], **more)


def arrays(value):
    return {
        field.name: np.asarray(getattr(value, field.name))
        for field in fields(value)
        if field.name != "shape" and getattr(value, field.name) is not None
    }


def assert_same(a, b):
    assert a.keys() == b.keys()
    for name, array in a.items():
        assert np.array_equal(array, b[name]), name


each_rule = pytest.mark.parametrize("rule", RULES.values(), ids=RULES)


@each_rule
@given(state=states(60), count=st.integers(1, 16))
def test_the_same_situation_gives_the_same_proposal_and_is_left_as_it_was(rule, state, count):
    shape = shape_of(rule)
    last = rule.propose(ahead(state, count=count), shape)
    plan = last.start or Plan(
        states=np.tile(state, (rule.stages + 1, 1)).astype(float),
        thrusts=np.ones((rule.stages, 2)),
        durations=np.full(rule.stages, 0.5),
    )
    situation = ahead(state, count=count, last=last.decision, plan=plan, elapsed_s=0.5)
    before = copy.deepcopy(situation)
    one, other = (rule.propose(situation, shape) for _ in range(2))
    assert_same(arrays(one.horizon), arrays(other.horizon))
    assert one.decision == other.decision
    assert_same(arrays(situation.plan), arrays(before.plan))
    assert situation.last == before.last
    assert situation.ahead == before.ahead


@each_rule
@given(state=states(60), count=st.integers(1, 16))
def test_a_proposal_has_the_sizes_of_its_shape(rule, state, count):
    proposal = rule.propose(ahead(state, count=count), shape_of(rule))
    blank = Horizon(shape=shape_of(rule))
    for name, array in arrays(proposal.horizon).items():
        assert array.shape == np.shape(getattr(blank, name)), name
        assert np.isfinite(array).all(), name
    # The limits of the thrusters are the controller's business, not the rule's.
    assert proposal.horizon.thrust_bounds is None
    bounds = proposal.horizon.duration_bounds
    assert np.all((bounds[:, 0] > 0) & (bounds[:, 0] <= bounds[:, 1]))
    assert np.all(bounds[:, 1] <= rule.longest_stage_s)
    decision = proposal.decision
    assert decision.target == 0
    assert 0 <= decision.split <= rule.stages
    assert all(0 < node <= rule.stages for node in decision.entries)
    assert list(decision.entries) == sorted(set(decision.entries))
    if proposal.start is not None:
        assert proposal.start.states.shape == (rule.stages + 1, 6)


def excess(rows, place):
    """Largest a z - b over the rows, at (x, y, u)."""
    return np.max(rows[..., :3] @ place - rows[..., 3], axis=-1)


@each_rule
@given(state=states(40))
def test_a_mirrored_situation_gives_a_mirrored_horizon(rule, state):
    """Sets are compared by their extent: a mirror image has its sides in another order."""
    shape = shape_of(rule)
    one = rule.propose(ahead(state), shape)
    other = rule.propose(ahead(tuple(MIRROR * state), MIRRORED), shape)
    assert one.decision.split == other.decision.split
    assert one.decision.entries == other.decision.entries
    for name in ("cost_weights", "effort_weights", "entry_penalties", "time_weights"):
        assert np.array_equal(getattr(one.horizon, name), getattr(other.horizon, name))
    assert one.horizon.duration_bounds == pytest.approx(other.horizon.duration_bounds)
    for place in ((0.0, 0.0, 1.5), (12.0, 3.0, 0.5), (30.0, -7.0, 2.5)):
        flipped = np.array(place) * (1, -1, 1)
        for name in ("cost_sets", "entry_sets"):
            here = excess(getattr(one.horizon, name), np.array(place))
            there = excess(getattr(other.horizon, name), flipped)
            assert here == pytest.approx(there, abs=1e-9)


@each_rule
def test_every_rule_completes_a_small_mission(rule):
    cells = CELLS[:4]
    pilot = Controller(BOAT, cells, rule)
    flight = simulate(BOAT, cells, pilot, (-10, 2.5, 0, 0, 0, 0), Conditions(limit_s=120))
    assert flight.complete
    assert flight.report.unsolved_steps == 0


@pytest.mark.parametrize(
    ("page", "shown"), [("add-a-rule.md", "Sprint"), ("add-a-vessel.md", "punt")]
)
def test_the_how_tos_show_the_code_that_is_sailed_here(page, shown):
    """The code block of each page runs by itself and contains the source that is tested here."""
    text = (HOW_TO / page).read_text()
    code = re.search(r"```python\n(.*?)```", text, re.DOTALL).group(1)
    assert inspect.getsource(globals()[shown]) in code
    module = types.ModuleType(shown)
    sys.modules[shown] = module
    exec(compile(code, page, "exec", dont_inherit=True), vars(module))
    assert vars(module)[shown]()


# docs/how-to/add-a-vessel.md shows this boat.
def punt() -> Vessel:
    masses: HullMasses = paper_masses(
        mass_kg=22, length_m=1.4, width_m=0.8, depth_m=0.1, propeller_distance_m=0.6
    )
    return Vessel(
        name="punt",
        m11_kg=masses.m11_kg,
        m22_kg=masses.m22_kg,
        m33_kgm2=masses.m33_kgm2,
        x_u=-15.0,
        y_v=-60.0,
        n_r=-10.0,
        arm_m=0.3,
        thrust_max_n=25.0,
        thrust_min_n=-12.0,
        source="Drag from a towing test of our own.",
    )


def test_a_user_s_own_vessel_flies():
    boat, cells = punt(), CELLS[:4]
    flight = simulate(boat, cells, Controller(boat, cells), (-10, 2.5, 0, 0, 0, 0))
    assert flight.complete
    assert flight.report.unsolved_steps == 0


CELL, NEXT = CELLS[0], CELLS[1]
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
@pytest.mark.parametrize("rule", [Dual(), Lookahead()], ids=repr)
def test_awkward_targets_are_reached(rule, targets):
    sets = AWKWARD[targets]
    pilot = Controller(BOAT, sets, rule)
    flight = simulate(BOAT, sets, pilot, (-10, 2.5, 0, 0, 0, 0), Conditions(limit_s=300))
    assert flight.complete
    assert flight.report.unsolved_steps == 0
