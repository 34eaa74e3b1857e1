"""The settings that each mission draws."""

import numpy as np
import pytest
from scipy.stats import kstest, norm, uniform

from grebe.campaigns.certificate import Claim
from grebe.campaigns.settings import Campaign, Success
from grebe.campaigns.spread import spread_of
from grebe.core.errors import UsageError


def campaign(**spreads):
    drawn = {name: spread_of(name, value) for name, value in spreads.items()}
    return Campaign(name="c", success=Success(within_s=60.0), claim=Claim(), spreads=drawn)


def test_draws_follow_what_the_file_says():
    one = campaign(wind_n=[2, 6], rule={"choose": ["single", "dual"]})
    draws = [one.drawn(i) for i in range(2000)]
    assert kstest([d["wind_n"] for d in draws], uniform(2, 4).cdf).pvalue > 0.01
    assert np.mean([d["rule"] == "dual" for d in draws]) == pytest.approx(0.5, abs=0.05)


def test_a_normal_spread_is_normal_within_its_bounds():
    spread = spread_of("wind_n", {"mean": 1, "sd": 1, "low": 0})
    random = np.random.default_rng(2)
    draws = np.array([spread.draw(random) for _ in range(4000)])
    cut = norm(1, 1).cdf(0)
    assert draws.min() >= 0
    assert kstest(draws, lambda x: (norm(1, 1).cdf(x) - cut) / (1 - cut)).pvalue > 0.01


def test_one_more_spread_leaves_the_draws_of_the_others():
    few, more = campaign(wind_n=[0, 5]), campaign(wind_n=[0, 5], current_mps=[0, 1])
    for number in range(5):
        assert few.drawn(number)["wind_n"] == more.drawn(number)["wind_n"]
        assert few.drawn(number)["wind_to_deg"] == more.drawn(number)["wind_to_deg"]
    assert few.drawn(1) != few.drawn(2)


@pytest.mark.parametrize(
    ("name", "written"),
    [
        ("wind_n", [5, 1]),
        ("wind_n", "strong"),
        ("wind_n", {"mean": 1}),
        ("wind_n", {"choose": []}),
        ("wind_n", True),
        ("wind_n", {"mean": 1, "sd": 1}),
        ("mismatch", [0, 2]),
        ("rule", 3),
        ("tide_m", 1),
        ("wind_n", float("nan")),
    ],
)
def test_what_is_no_spread_is_refused_by_name(name, written):
    with pytest.raises(UsageError, match=name):
        campaign(**{name: written})
