"""The choice of the next places keeps the budget and makes the map surer than a random choice."""

from __future__ import annotations

from itertools import pairwise

import numpy as np
import pytest
import shapely
from hypothesis import given, settings
from hypothesis import strategies as st
from scipy.spatial.distance import cdist

from grebe.planning.paths.place_paths import place_paths
from grebe.planning.revisions.adapt import Worth, chosen_places, once_read

SIDE = np.linspace(0, 100, 11)
PLACES = np.array([(n, e) for n in SIDE for e in SIDE])
START, PACE, TURN_M = 0, 1.0, 1.0
PATHS = place_paths(PLACES, 10.0, shapely.box(-5, -5, 105, 105))


def worth(weights=None, known=()):
    """Places of a field with an exponential covariance, some of them measured already."""
    covariance = np.exp(-cdist(PLACES, PLACES) / 30.0)
    for k in known:
        column = covariance[:, k].copy()
        covariance -= np.outer(column, column) / (column[k] + 0.01)
    return Worth(
        places=PLACES,
        covariance=covariance,
        noise=0.01,
        weights=np.full(len(PLACES), 1 / len(PLACES)) if weights is None else weights,
        apart_m=15.0,
    )


def chosen(worth, budget_s):
    return chosen_places(worth, PATHS, START, budget_s, PACE, TURN_M)


def tour_s(route):
    return np.hypot(*np.diff(PLACES[[START, *route]], axis=0).T).sum() / PACE


def passed(route):
    """The places nearest to straight legs, found by following the legs in small steps."""
    met = set()
    for a, b in pairwise(PLACES[[START, *route]]):
        for share in np.linspace(0, 1, 41):
            met.add(int(np.argmin(np.hypot(*(PLACES - a - share * (b - a)).T))))
    return sorted(met)


def left_after(given, seen_at):
    seen = given.covariance[:, seen_at]
    system = given.covariance[np.ix_(seen_at, seen_at)] + given.noise * np.eye(len(seen_at))
    gone = np.einsum("ij,jk,ik->i", seen, np.linalg.inv(system), seen)
    return np.diag(given.covariance) - gone


@given(budget_s=st.floats(20, 600))
@settings(max_examples=20)
def test_the_tour_keeps_the_time_and_visits_no_place_twice(budget_s):
    route, _ = chosen(worth(), budget_s)
    assert tour_s(route) <= budget_s + 1e-9
    assert len(set(route)) == len(route)


def test_the_remaining_variance_is_that_after_the_readings_on_the_path():
    given = worth(known=(0, 60))
    route, left = chosen(given, 200.0)
    assert left.mean() == pytest.approx(left_after(given, passed(route)).mean(), rel=0.05)


def test_it_is_surer_than_places_taken_by_chance_in_the_same_time():
    given = worth(known=range(22))
    _, left = chosen(given, 300.0)
    rng, others = np.random.default_rng(0), []
    for _ in range(20):
        route = []
        for k in rng.permutation(len(PLACES)).tolist():
            if tour_s([*route, k]) > 300.0:
                break
            route.append(k)
        others.append(left_after(given, passed(route)).mean())
    assert left.mean() < min(others)


def test_it_goes_where_it_matters():
    weights = np.where(PLACES[:, 1] > 70, 1.0, 1e-6)
    route, _ = chosen(worth(weights), 260.0)
    assert np.mean(PLACES[passed(route), 1] > 60) > 0.6


def test_no_time_is_no_place():
    assert chosen(worth(), 0.5)[0] == []


def test_readings_on_the_path_count():
    """A place at the end of unknown water is worth more than one beside it at the end of known
    water, if the paths are equally long.
    """
    known = [k for k, (n, _) in enumerate(PLACES) if n == 0]
    route, _ = chosen(worth(known=known), 100.0)
    assert np.mean(PLACES[passed(route), 0] == 0) < 0.4


def test_ways_lead_around_land_and_along_the_water():
    water = shapely.box(-5, -5, 105, 105) - shapely.box(45, -5, 55, 85)
    places = PLACES[(PLACES[:, 0] < 44) | (PLACES[:, 0] > 56) | (PLACES[:, 1] > 86)]
    paths = place_paths(places, 10.0, water)
    across = np.flatnonzero(np.all(places == (40, 0), axis=1))[0]
    beyond = np.flatnonzero(np.all(places == (60, 0), axis=1))[0]
    shortest = 2 * np.hypot(5, 85) + 10
    assert shortest <= paths.lengths_m[across, beyond] <= 1.09 * shortest
    path = places[paths.along(int(across), int(beyond))]
    assert shapely.covers(water, shapely.LineString(path))
    beside = np.flatnonzero(np.all(places == (30, 40), axis=1))[0]
    assert paths.lengths_m[across, beside] == pytest.approx(np.hypot(10, 40))


def announced_path(route):
    return PLACES[[START, *route]]


def test_what_others_announce_counts_as_read():
    given = worth(known=(0, 60))
    path = announced_path([10, 120])
    after = once_read(given, PATHS, [path])
    seen_at = sorted(set(passed([10, 120])))
    assert np.diag(after.covariance) == pytest.approx(left_after(given, seen_at), rel=0.02)
    assert once_read(given, PATHS, []) is given


def test_two_boats_that_plan_one_after_the_other_do_not_read_the_same_places():
    """Both start at the same place. Together they leave less variance than two boats that know
    nothing of each other, or one that sails its path twice.
    """
    given = worth(known=range(22))
    first, _ = chosen(given, 200.0)
    second, left = chosen(once_read(given, PATHS, [announced_path(first)]), 200.0)
    # Both leave the same place, so both pass the places near it.
    both = set(passed(first)) & set(passed(second))
    assert len(both) < 0.35 * len(passed(second))
    assert set(passed(chosen(given, 200.0)[0])) == set(passed(first))
    seen = sorted({*passed(first), *passed(second)})
    assert left.mean() == pytest.approx(left_after(given, seen).mean(), rel=0.05)
    assert left.mean() < 0.9 * left_after(given, passed(first)).mean()
