"""Where it pays to go next: what is chosen keeps the time and makes the map surer than chance."""

from __future__ import annotations

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from scipy.spatial.distance import cdist

from grebe.planning.adapt import Worth, chosen_places

SIDE = np.linspace(0, 100, 11)
PLACES = np.array([(n, e) for n in SIDE for e in SIDE])
START, PACE, TURN_S = (0.0, 0.0), 1.0, 1.0


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
    )


def way_s(route):
    way = np.array([START, *PLACES[route]])
    return np.hypot(*np.diff(way, axis=0).T).sum() / PACE + TURN_S * len(route)


@given(budget_s=st.floats(20, 600))
@settings(max_examples=20)
def test_the_way_keeps_the_time_and_no_place_is_visited_twice(budget_s):
    route, _ = chosen_places(worth(), START, budget_s, PACE, TURN_S)
    assert way_s(route) <= budget_s + 1e-9
    assert len(set(route)) == len(route)


def test_what_is_left_is_what_readings_there_leave():
    given = worth(known=(0, 60))
    route, left = chosen_places(given, START, 200.0, PACE, TURN_S)
    seen = given.covariance[:, route]
    system = given.covariance[np.ix_(route, route)] + given.noise * np.eye(len(route))
    exact = np.diag(given.covariance) - np.einsum("ij,jk,ik->i", seen, np.linalg.inv(system), seen)
    assert left == pytest.approx(exact, abs=1e-8)


def test_it_is_surer_than_places_taken_by_chance_in_the_same_time():
    given = worth(known=range(22))
    _, left = chosen_places(given, START, 300.0, PACE, TURN_S)
    rng, others = np.random.default_rng(0), []
    for _ in range(20):
        route = []
        for k in rng.permutation(len(PLACES)).tolist():
            if way_s([*route, k]) > 300.0:
                break
            route.append(k)
        seen = given.covariance[:, route]
        system = given.covariance[np.ix_(route, route)] + given.noise * np.eye(len(route))
        gone = np.einsum("ij,jk,ik->i", seen, np.linalg.inv(system), seen)
        others.append(np.mean(np.diag(given.covariance) - gone))
    assert left.mean() < min(others)


def test_it_goes_where_it_matters():
    weights = np.where(PLACES[:, 1] > 70, 1.0, 1e-6)
    route, _ = chosen_places(worth(weights), START, 260.0, PACE, TURN_S)
    assert np.mean(PLACES[route, 1] > 60) > 0.7


def test_no_time_is_no_place():
    assert chosen_places(worth(), START, 0.5, PACE, TURN_S)[0] == []
