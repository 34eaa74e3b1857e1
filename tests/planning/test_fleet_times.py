"""The time of a fleet: rounds of one sortie per boat, and transport by land between harbours."""

from __future__ import annotations

import pytest
import shapely
from conftest import FRAME

from grebe.core.revision import Sortie, first_revision
from grebe.core.sets import sets_of
from grebe.core.survey import Pose, Survey, Target
from grebe.planning.fleets.fleet_times import MOVE_S, boat_times, fleet_s

HERE, THERE = Pose(north_m=0.0, east_m=0.0), Pose(north_m=0.0, east_m=80.0)


def plan_of(*sorties):
    """A plan of sorties with one target each, given as boat, harbour and time [s]."""
    ring = ((0.0, 0.0), (5.0, 0.0), (5.0, 5.0), (0.0, 5.0))
    sets = sets_of([ring] * len(sorties), [(0.0, 1.0)] * len(sorties))
    targets = tuple(
        Target(seq=k, kind="cell", cell=shapely.box(0, 0, 5, 5), set=one)
        for k, one in enumerate(sets, 1)
    )
    survey = Survey(name="x", frame=FRAME, water=shapely.box(0, 0, 90, 90), targets=targets)
    return first_revision(
        survey,
        [
            Sortie(number=k, first=k, last=k, start=start, time_s=time_s, energy_wh=1.0, boat=boat)
            for k, (boat, start, time_s) in enumerate(sorties, 1)
        ],
    )


def test_boats_that_sail_at_once_take_as_long_as_the_slowest_of_each_round():
    plan = plan_of((1, HERE, 100.0), (2, HERE, 300.0), (1, HERE, 500.0), (2, HERE, 50.0))
    assert fleet_s(plan) == pytest.approx(300.0 + 500.0)
    assert [one.time_s for one in boat_times(plan)] == [600.0, 350.0]


def test_one_sortie_each_takes_as_long_as_the_longest():
    assert fleet_s(plan_of((1, HERE, 100.0), (2, THERE, 130.0))) == pytest.approx(130.0)


def test_a_boat_that_changes_its_harbour_is_brought_there_first():
    plan = plan_of((1, HERE, 100.0), (1, THERE, 100.0), (1, THERE, 100.0), (2, HERE, 900.0))
    one, two = boat_times(plan)
    assert (one.moves, one.sorties, one.under_way_s) == (1, 3, 300.0)
    assert one.time_s == pytest.approx(300.0 + MOVE_S)
    assert two.moves == 0
    assert fleet_s(plan) == pytest.approx(900.0 + (MOVE_S + 100.0) + 100.0)


def test_a_boat_that_goes_back_is_brought_twice():
    plan = plan_of((1, HERE, 10.0), (1, THERE, 10.0), (1, HERE, 10.0))
    assert boat_times(plan)[0].moves == 2
