"""The fit by which a dead thruster is found, against numpy's linear algebra."""

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from grebe.mission.safety.thrusters import AVERAGE_S, FILTER_S, _fitted


@given(st.integers(0, 10_000), st.floats(1e-3, 10.0))
def test_the_shares_are_those_of_least_squares_with_the_prior(seed, noise):
    rng = np.random.default_rng(seed)
    rows = rng.normal(size=(30, 6)) * rng.uniform(0.1, 5.0, 6)
    products = rows.T @ rows / len(rows)
    normal, right = products[:5, :5], products[:5, 5]
    said, unsure = rng.normal(size=5), rng.uniform(0.1, 2.0, 5)
    weight, prior = AVERAGE_S / FILTER_S / noise, np.diag(unsure**-2)
    information = weight * normal + prior
    expected = np.linalg.solve(information, weight * right + prior @ said)
    shares, sd, missed = _fitted(products, noise, said, unsure)
    assert shares == pytest.approx(expected, rel=1e-8, abs=1e-8)
    assert sd == pytest.approx(np.sqrt(np.diag(np.linalg.inv(information))), rel=1e-8)
    left = rows[:, 5] - rows[:, :5] @ shares
    assert missed == pytest.approx(np.mean(left**2), rel=1e-6)
