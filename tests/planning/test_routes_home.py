"""The path home."""

import itertools
import math

import numpy as np
import pytest
import shapely
from conftest import region_of
from hypothesis import assume, given
from hypothesis import strategies as st

from grebe.core.errors import PlanError
from grebe.core.plan_settings import PlanSettings
from grebe.core.vessel import PRESETS
from grebe.planning.paths.routes_home import path_length_m, routes_home, transit_survey
from grebe.planning.planner import plan_survey

ELL = shapely.Polygon([(0, 0), (60, 0), (60, 20), (20, 20), (20, 60), (0, 60)])
HOME = (5.0, 55.0)
PATHS = routes_home(ELL, HOME)


def test_the_path_round_a_corner_is_as_short_as_the_clearance_allows():
    path = PATHS.path_from((55.0, 5.0))
    corner = np.array([20.0, 20.0]) - PATHS.clearance_m
    shortest = math.dist((55.0, 5.0), corner) + math.dist(corner, HOME)
    assert path_length_m(path) == pytest.approx(shortest, rel=0.02)
    assert tuple(path[0]) == (55.0, 5.0)
    assert tuple(path[-1]) == HOME


def test_home_in_sight_is_a_straight_line():
    assert len(PATHS.path_from((5.0, 10.0))) == 2


@given(place=st.tuples(st.floats(0, 60), st.floats(0, 60)))
def test_every_route_home_lies_in_the_water(place):
    assume(ELL.covers(shapely.Point(place)))
    assert ELL.buffer(1e-6).covers(shapely.LineString(PATHS.path_from(place)))


@given(place=st.tuples(st.floats(0.2, 59.8), st.floats(0.2, 59.8)))
def test_the_hull_of_neighbouring_transits_and_their_corridor_is_water(place):
    assume(ELL.buffer(-0.2).covers(shapely.Point(place)))
    survey = transit_survey(SURVEY, PATHS, (*place, 0.0, 0.0, 0.0, 0.0), 1.5)
    water = ELL.buffer(1e-4)
    footprints = [one.set.polygon for one in survey.targets]
    for corridor in survey.corridors:
        assert water.covers(corridor)
    for a, b in itertools.pairwise(footprints):
        assert water.covers(shapely.union(a, b).convex_hull)
    assert survey.targets[-1].set.covers(*HOME)


def test_an_island_is_gone_round():
    lake = shapely.box(0, 0, 60, 60).difference(shapely.box(20, 20, 40, 40))
    path = routes_home(lake, (5.0, 30.0)).path_from((55.0, 30.0))
    assert len(path) > 2
    assert lake.covers(shapely.LineString(path))


def test_a_home_on_land_is_refused():
    with pytest.raises(PlanError, match="is not in the survey's water") as refused:
        routes_home(ELL, (50.0, 50.0))
    assert refused.value.settings == ("home",)


def test_a_coast_of_very_many_corners_is_looked_through_all_the_same():
    turn = np.linspace(0, 2 * np.pi, 3000, endpoint=False)
    radius = 200 + 3 * np.sin(40 * turn) + 60 * np.sin(3 * turn)
    lake = shapely.Polygon(np.column_stack([radius * np.cos(turn), radius * np.sin(turn)]))
    paths = routes_home(lake, (150.0, 0.0))
    assert shapely.get_num_coordinates(paths.room) < 600
    assert lake.covers(shapely.LineString(paths.path_from((-100.0, 100.0))))


SURVEY = plan_survey(
    region_of(list(ELL.exterior.coords[:-1])), PRESETS["spyboat"], PlanSettings(cell_m=20.0)
)
