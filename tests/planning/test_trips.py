"""Trips around a harbour: wedges, stretches cut out of trips that are too long, and exchanges."""

from itertools import pairwise
from types import SimpleNamespace

import numpy as np
import pytest
import shapely
from hypothesis import given, settings
from hypothesis import strategies as st

from grebe.core.frames import LocalFrame
from grebe.core.plan_settings import PlanSettings, SortieSettings
from grebe.core.vessel import PRESETS
from grebe.planning.paths.harbour_distances import around_the_harbour
from grebe.planning.planner import planner_of
from grebe.planning.region import Region
from grebe.planning.route.costs import window_cost
from grebe.planning.trips.endurance import endurance_of
from grebe.planning.trips.lake import depots_of, lake_of
from grebe.planning.trips.repaired_trips import predicted_trip_s, repaired
from grebe.planning.trips.trip_times import shortest_stretch, trip_s
from grebe.planning.trips.trips import HOT, improved_trips
from grebe.planning.trips.wedges import wedges

FRAME = LocalFrame(origin_lon_deg=3.17, origin_lat_deg=50.63)
WATER = shapely.box(0, 0, 800, 400) - shapely.box(350, 150, 450, 400)
HARBOUR = (5.0, 5.0)


@pytest.fixture(scope="module")
def lake():
    wanted = PlanSettings(
        cell_m=40.0, speed_min_mps=0.5, speed_max_mps=1.5, shore_margin_m=1.0,
        sorties=SortieSettings(minutes=60.0),
    )  # fmt: skip
    region = Region(name="lake", frame=FRAME, water=WATER)
    planner, _ = planner_of(region, PRESETS["blueboat"], wanted)
    found = lake_of(planner, planner.first_draft(quick=True), [HARBOUR])
    depots = depots_of(
        found, endurance_of(PRESETS["blueboat"], wanted, planner.travel.power_w), 1.0
    )
    return SimpleNamespace(lake=found, depots=depots, costs=found.costs)


def comes_home(costs, depots, route):
    """Whether a trip keeps its limit, both sailed completely and turned for home at any cell."""
    if len(route) == 0:
        return True
    spent = depots.out[0, route[0]]
    worst = spent + depots.home[0, route[0]]
    for before, cell in pairwise(route):
        spent += window_cost(costs, np.array([before, cell]), 0, 1)
        worst = max(worst, spent + depots.home[0, cell])
    return max(worst, spent + depots.back[0, route[-1]]) <= depots.limit_s + 1e-6


def test_the_ray_around_the_harbour_meets_every_cell_once(lake):
    wanted = lake.lake.wanted
    walk = around_the_harbour(lake.lake.draft.network, lake.lake.homes[0], wanted)
    assert sorted(walk.tolist()) == np.flatnonzero(wanted).tolist()


def test_cells_in_sight_of_the_harbour_are_met_by_their_bearing(lake):
    home, network = lake.lake.homes[0], lake.lake.draft.network
    walk = around_the_harbour(network, home, lake.lake.wanted)
    seen = walk[home.bends[walk] < 0]
    path = network.centres[seen] - np.array(home.place)
    turned = np.unwrap(np.arctan2(path[:, 1], path[:, 0]))
    assert np.all(np.diff(turned) >= -1e-9)


@pytest.mark.parametrize("count", [1, 2, 5, 9])
def test_wedges_hold_every_cell_once(lake, count):
    orders, harbours = wedges(lake.lake, lake.depots, count)
    assert len(orders) == len(harbours) <= count
    assert sorted(np.concatenate(orders).tolist()) == np.flatnonzero(lake.lake.wanted).tolist()


@settings(max_examples=30, deadline=None)
@given(share=st.floats(0.1, 1.1), count=st.integers(1, 6), data=st.data())
def test_what_is_left_of_a_trip_keeps_the_limit_and_no_shorter_stretch_would_do(
    lake, share, count, data
):
    orders, _ = wedges(lake.lake, lake.depots, count)
    order = data.draw(st.sampled_from(orders))
    whole_s = trip_s(lake.costs, lake.depots, 0, order, len(order))
    depots = lake.depots._replace(limit_s=share * whole_s)
    first, last = shortest_stretch(lake.costs, depots, 0, order)
    left = np.concatenate([order[:first], order[last:]])
    assert comes_home(lake.costs, depots, left)
    one_less = last - first - 1
    for i in range(len(order) - one_less + 1) if one_less >= 0 else ():
        rest = np.concatenate([order[:i], order[i + one_less :]])
        assert not comes_home(lake.costs, depots._replace(limit_s=depots.limit_s - 1e-3), rest)


@pytest.mark.parametrize("limit_s", [1500.0, 2500.0, 6000.0])
def test_exchanged_trips_hold_each_cell_once_and_keep_the_limit(lake, limit_s):
    """This includes cases with far more waiting cells than can be tried in each round."""
    depots = lake.depots._replace(limit_s=limit_s)
    members = np.flatnonzero(lake.lake.wanted)
    trips = [np.zeros(0, dtype=np.int64)] * 3
    harbours = np.zeros(3, dtype=np.int64)
    found, absent = improved_trips(lake.costs, depots, trips, harbours, 5_000)
    assert sorted([*np.concatenate(found).tolist(), *absent.tolist()]) == members.tolist()
    assert all(comes_home(lake.costs, depots, order) for order in found)
    room_s = 3 * limit_s - sum(trip_s(lake.costs, depots, 0, o, len(o)) for o in found)
    assert len(absent) == 0 or room_s < 0.25 * 3 * limit_s


def test_a_trip_that_is_a_little_too_long_gives_cells_to_one_that_has_room(lake):
    """All cells stay, each trip keeps the limit, and the result is None if no other has room."""
    orders, harbours = wedges(lake.lake, lake.depots, 3)
    found = improved_trips(lake.costs, lake.depots, orders, harbours, 50_000, HOT)[0]
    seconds = [
        predicted_trip_s(lake.lake, int(h), order) for h, order in zip(harbours, found, strict=True)
    ]
    limit_s = max(seconds) - 5.0
    assert min(seconds) < limit_s - 60.0
    again = repaired(lake.lake, lake.depots, found, harbours, limit_s)
    assert again is not None
    for h, order in zip(harbours, again, strict=True):
        assert predicted_trip_s(lake.lake, int(h), order) <= limit_s
    assert sorted(np.concatenate(again).tolist()) == sorted(np.concatenate(found).tolist())
    assert repaired(lake.lake, lake.depots, found, harbours, 0.9 * min(seconds)) is None
