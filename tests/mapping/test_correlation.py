"""Covariances summed by rows."""

import numpy as np

from grebe.mapping.covariance.correlation import lower_covariance

SIZE = 60
NONE = np.empty((0, 0))


def test_a_covariance_above_the_diagonal_is_never_what_the_memory_held_before():
    places = np.random.default_rng(1).uniform(0, 50, (SIZE, 2))
    distance = np.hypot(*(places[:, None] - places[None]).transpose(2, 0, 1))
    for _ in range(20):
        freed = [np.full((SIZE, SIZE), np.inf) for _ in range(5)]
        del freed
        found = lower_covariance(2, 1.0, 20.0, 1e-8, distance, 0.0, 1.0, NONE)
        assert not np.triu(found, 1).any()
        assert np.isfinite(found).all()
