"""Shortest paths, parts and trees of a graph agree with SciPy's."""

import numpy as np
import pytest
from scipy.sparse import coo_array
from scipy.sparse.csgraph import connected_components, dijkstra, minimum_spanning_tree

from grebe.planning.paths.graph import (
    distances,
    links_of,
    parts_of,
    shortest_paths,
    spanning_forest,
)

PLACES = 200


@pytest.fixture(scope="module")
def edges():
    """A sparse graph of several parts, each edge once, many of the same length."""
    rng = np.random.default_rng(3)
    pairs = np.unique(np.sort(rng.integers(0, PLACES, (220, 2)), axis=1), axis=0)
    low, high = pairs[pairs[:, 0] < pairs[:, 1]].T
    return low, high, rng.integers(1, 6, len(low)).astype(float)


@pytest.fixture(scope="module")
def links(edges):
    low, high, lengths = edges
    both = np.append(low, high), np.append(high, low)
    return links_of(*both, np.tile(lengths, 2), PLACES)


@pytest.fixture(scope="module")
def matrix(edges):
    low, high, lengths = edges
    ends = low.astype(np.int32), high.astype(np.int32)
    return coo_array((lengths, ends), shape=(PLACES, PLACES)).tocsr()


def test_distances_are_the_shortest_up_to_a_limit(links, matrix):
    begins = np.array([0, 7, 150])
    theirs = dijkstra(matrix, directed=False, indices=begins, limit=9.0)
    assert np.array_equal(distances(links, begins, 9.0), theirs)


def test_a_path_s_length_is_the_distance(links, matrix):
    far = dijkstra(matrix, directed=False, indices=3)
    end = int(np.argmax(np.where(np.isfinite(far), far, -1)))
    before, length, here = shortest_paths(links, 3, end), 0.0, end
    while here != 3:
        length += float(links.of(before[here], here))
        here = int(before[here])
    assert length == far[end]


def test_parts_are_numbered_as_they_are_met(links, matrix):
    count, part = parts_of(links)
    theirs = connected_components(matrix, directed=False)
    assert count == theirs[0]
    assert np.array_equal(part, theirs[1])


def test_the_trees_are_the_shortest_and_take_the_first_of_equal_edges(edges, matrix):
    low, high, lengths = edges
    kept = spanning_forest(low, high, lengths, PLACES)
    theirs = coo_array(minimum_spanning_tree(matrix))
    assert set(zip(low[kept], high[kept], strict=True)) == set(
        zip(theirs.row, theirs.col, strict=True)
    )


def test_links_among_some_places_are_those_of_the_matrix(links):
    kept = np.array([5, 2, 90, 41, 3, 17, 120, 0])
    assert np.array_equal(links.among(kept).dense(), links.dense()[kept][:, kept])


def test_the_largest_of_several_links_counts():
    links = links_of(np.array([0, 0, 1]), np.array([1, 1, 0]), np.array([1.0, 3.0, 2.0]), 3)
    assert links.dense().tolist() == [[0, 3, 0], [2, 0, 0], [0, 0, 0]]
    assert links.of(np.array([0, 2]), np.array([1, 1])).tolist() == [3.0, 0.0]
