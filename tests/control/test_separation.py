"""Lines that keep a plan apart from others, and boats that use them to pass each other."""

import math

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from grebe.control.controller import Controller
from grebe.control.horizon import NO_ROW, Horizon, HorizonShape, Plan
from grebe.control.rules.dual import Dual
from grebe.control.rules.lookahead import Lookahead
from grebe.control.separation import MOST_OTHERS, REACH_M, AnnouncedPath, is_taken, keep_apart
from grebe.control.solvers.builders import Ipopt
from grebe.core.dynamics import CALM, rates, rk4
from grebe.core.sets import TargetSet
from grebe.core.vessel import PRESETS

BOAT = PRESETS["spyboat"]
STAGES, APART_M = 8, 9.0
SHAPE = HorizonShape(stages=STAGES, apart_rows=MOST_OTHERS)
places = st.tuples(st.floats(-40, 40), st.floats(-40, 40))
ways = st.lists(places, min_size=STAGES + 1, max_size=STAGES + 1).map(np.array)
seconds = st.floats(0.1, 3.0)


def plan_along(way, durations):
    states = np.zeros((len(way), 6))
    states[:, :2] = way
    return Plan(states=states, thrusts=np.zeros((STAGES, 2)), durations=durations)


@given(
    way=ways,
    durations=st.lists(seconds, min_size=STAGES, max_size=STAGES).map(np.array),
    others=st.lists(ways, min_size=1, max_size=5),
    elsewhere=places,
)
def test_who_is_beyond_the_lines_is_apart(way, durations, others, elsewhere):
    times_s = np.linspace(0.0, 12.0, STAGES + 1)
    announced = [AnnouncedPath(times_s=times_s, places=other) for other in others]
    horizon, plan = Horizon(shape=SHAPE), plan_along(way, durations)
    keep_apart(horizon, plan, announced, APART_M)
    nodes = np.concatenate([[0.0], np.cumsum(durations)])
    assert np.array_equal(horizon.apart[0], np.tile(NO_ROW, (MOST_OTHERS, 1)))
    for k in range(1, STAGES + 1):
        theirs = np.array([one.at(nodes[k : k + 1])[0] for one in announced])
        for row in horizon.apart[k]:
            if tuple(row) == NO_ROW:
                continue
            # No point of the disc about one of the others satisfies the row; all the water beyond
            # its tangent does.
            away = np.hypot(*(theirs - np.array(elsewhere)).T)
            inside = row[:2] @ np.array(elsewhere) <= row[3] - 1e-9
            reach = row[3] - theirs @ row[:2]
            assert np.hypot(*row[:2]) == pytest.approx(1.0)
            assert np.min(np.abs(reach + APART_M)) < 1e-9
            own = np.argmin(np.abs(reach + APART_M))
            assert not inside or away[own] >= APART_M - 1e-6


@given(way=ways, far=st.floats(APART_M + REACH_M + 85, 500))
def test_others_that_are_far_ask_for_nothing(way, far):
    horizon = Horizon(shape=SHAPE)
    keep_apart(
        horizon, plan_along(way, np.ones(STAGES)), [AnnouncedPath.at_rest((far, 0.0))], APART_M
    )
    assert np.array_equal(horizon.apart, Horizon(shape=SHAPE).apart)


@given(start=places, end=places, other=places)
def test_from_outside_the_disc_no_line_asks_to_be_elsewhere_at_once(start, end, other):
    """The tangents allow the boat's position, so that it need not stop before it has turned."""
    if math.dist(start, other) <= APART_M + 1e-6:
        return
    share = np.linspace(0.0, 1.0, STAGES + 1)[:, None]
    way = (1 - share) * np.array(start) + share * np.array(end)
    horizon = Horizon(shape=SHAPE)
    keep_apart(horizon, plan_along(way, np.ones(STAGES)), [AnnouncedPath.at_rest(other)], APART_M)
    for row in horizon.apart[:, 0]:
        if row[:2].any():
            # The first tangent passes through the start, the second through the end.
            held = [row[:2] @ np.array(one) <= row[3] + 1e-6 for one in (start, end)]
            assert any(held)


def square(north, east, half_m=2.0):
    corners = [(north - half_m, east - half_m), (north - half_m, east + half_m),
               (north + half_m, east + half_m), (north + half_m, east - half_m)]  # fmt: skip
    return TargetSet(vertices=corners, speed_min_mps=0.5, speed_max_mps=1.0)


def sail_together(ways, *, heed, rule=Lookahead, limit_s=90.0):
    """Sail boats along rows of squares, each with its own controller.

    Returns the least distance of two boats, the time of the last, the tracks, and whether all are
    done.
    """
    helms = [Controller(BOAT, [square(*place) for place in way[1:]], rule()) for way in ways]
    states = []
    for way in ways:
        (north, east), (to_north, to_east) = way[0], way[1]
        states.append(
            np.array([north, east, math.atan2(to_east - east, to_north - north), 0, 0, 0])
        )
    plans: list[AnnouncedPath] = [AnnouncedPath.at_rest(tuple(state[:2])) for state in states]
    tracks, time_s = [], 0.0
    while time_s < limit_s and not all(helm.done for helm in helms):
        for b, helm in enumerate(helms):
            helm.see(states[b])
            if helm.done:
                plans[b] = AnnouncedPath.at_rest(tuple(states[b][:2]))
                continue
            if heed:
                helm.heed([plan for a, plan in enumerate(plans) if a != b], APART_M)
            command = helm.step(states[b])
            plans[b] = AnnouncedPath.of_plan(command.plan, 0.0)
            for tenth in range(round(10 * helm.step_s)):
                thrusts = command.thrusts_at(tenth / 10)
                states[b] = np.array(
                    rk4(lambda z, f=thrusts: rates(BOAT, z, f, CALM.as_tuple()),
                        states[b].tolist(), 0.1, 2)
                )  # fmt: skip
        time_s += helms[0].step_s
        tracks.append([state[:2].copy() for state in states])
    tracks = np.array(tracks)
    least = min(
        float(np.hypot(*(tracks[:, a] - tracks[:, b]).T).min())
        for a in range(len(ways)) for b in range(a)
    )  # fmt: skip
    return least, time_s, tracks, all(helm.done for helm in helms)


HEAD_ON = [[(0, 0), (60, 0)], [(60, 0), (0, 0)]]
CROSSING = [[(0, -30), (0, 30)], [(-30, 0), (30, 0)]]


@pytest.mark.parametrize("ways", [HEAD_ON, CROSSING])
def test_boats_that_meet_pass_each_other_apart_and_without_stopping(ways):
    near, alone_s, _, _ = sail_together(ways, heed=False)
    least, time_s, tracks, done = sail_together(ways, heed=True)
    assert near < 3.0
    assert done
    # A plan keeps the distance at its nodes; between them a boat may come somewhat nearer.
    assert least > APART_M - 0.3
    # The path around a disc of 9 m is a few metres longer.
    assert time_s < alone_s + 15.0
    if ways is HEAD_ON:
        # Port to port: each has the other on its left.
        closest = int(np.argmin(np.hypot(*(tracks[:, 0] - tracks[:, 1]).T)))
        assert tracks[closest, 0, 1] > tracks[closest, 1, 1]


def test_the_paper_s_rule_keeps_apart_as_well():
    least, _, _, done = sail_together(CROSSING, heed=True, rule=Dual, limit_s=150.0)
    assert done
    assert least > APART_M - 0.5


def test_sets_beyond_one_that_another_lies_at_are_not_planned_for():
    """Otherwise the plan cannot reach its end, and postpones the sets that it could reach."""
    near = [square(8.0, 0.0, 1.0), square(12.0, 0.0, 1.0)]
    taken, beyond = square(24.0, 0.0, 1.0), square(45.0, 0.0, 1.0)
    helm, state = Controller(BOAT, [*near, taken, beyond]), np.zeros(6)
    other = AnnouncedPath.at_rest((24.0, 3.0))
    assert is_taken(taken, other, APART_M)
    assert not is_taken(square(24.0, 0.0, 8.0), other, APART_M)
    moving = AnnouncedPath(
        times_s=np.array([0.0, 20.0]), places=np.array([(24.0, 3.0), (24.0, 40.0)])
    )
    assert not is_taken(taken, moving, APART_M)
    for _ in range(60):
        helm.see(state)
        helm.heed([other], APART_M)
        command = helm.step(state)
        for tenth in range(5):
            thrusts = command.thrusts_at(tenth / 10)
            state = np.array(rk4(lambda z, f=thrusts: rates(BOAT, z, f, CALM.as_tuple()),
                                 state.tolist(), 0.1, 2))  # fmt: skip
        assert math.dist(state[:2], (24.0, 3.0)) > APART_M - 0.3
    assert helm.reached == 2
    # Once the other has left, the boat goes on.
    helm.heed([], APART_M)
    assert len(helm.step(state).plan.durations) == helm.rule.stages
    assert helm.targets[helm.reached] is taken


def test_a_step_with_nobody_near_is_the_same_to_the_digit():
    state = (0.0, 0.0, 0.3, 0.4, 0.0, 0.0)
    alone, one_of_many = (Controller(BOAT, [square(20, 5), square(30, 30)]) for _ in range(2))
    one_of_many.heed([AnnouncedPath.at_rest((300.0, 0.0))], APART_M)
    for _ in range(3):
        assert alone.step(state).thrusts == one_of_many.step(state).thrusts


def test_both_solvers_agree_on_a_plan_near_another_boat():
    helms = [Controller(BOAT, [square(25, 0), square(40, 0)], solver=solver)
             for solver in (None, Ipopt())]  # fmt: skip
    answers = []
    for helm in helms:
        helm.heed([AnnouncedPath.at_rest((14.0, -3.0))], APART_M)
        for _ in range(4):
            command = helm.step((0.0, 0.0, 0.0, 0.5, 0.0, 0.0))
        answers.append(command.plan)
    ours, theirs = answers
    assert ours.duration_s == pytest.approx(theirs.duration_s, rel=0.02)
    for plan in answers:
        assert np.hypot(*(plan.states[:, :2] - (14.0, -3.0)).T).min() > APART_M - 0.05
