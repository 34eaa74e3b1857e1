"""Trends over a series of surveys: exact for lines, and not found where there is none."""

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from scipy import stats

from grebe.core.errors import InputError
from grebe.mapping.series.trend import YEAR_S, adjusted, adjusted_for_family, fit_trend

PLACES, SD = 40, 0.1


def years(*values):
    return np.array(values) * YEAR_S


@given(st.integers(0, 10_000), st.integers(3, 9))
def test_a_line_is_found_exactly_and_without_doubt_but_the_maps(seed, count):
    rng = np.random.default_rng(seed)
    times = np.sort(rng.uniform(0, 20, count)) + np.arange(count)
    slopes = rng.normal(size=PLACES)
    mean = rng.normal(size=PLACES) + np.outer(times, slopes)
    found = fit_trend(years(*times), mean, np.full_like(mean, SD))
    assert found.slope == pytest.approx(slopes, abs=1e-9)
    assert found.of_mean.slope == pytest.approx(slopes.mean(), abs=1e-9)
    spread = np.sum((times - times.mean()) ** 2)
    assert found.sd == pytest.approx(SD / np.sqrt(spread), rel=1e-6)


def test_the_trend_of_the_mean_is_that_of_ordinary_least_squares():
    """Compared with scipy's regression, its standard error and its probability."""
    rng = np.random.default_rng(3)
    times = np.array([0.0, 1.1, 1.9, 3.2, 4.0, 5.3])
    mean = 0.2 * times[:, None] + rng.normal(0, 0.3, (6, 1)) + rng.normal(0, 0.1, (6, PLACES))
    found = fit_trend(years(*times), mean, np.full_like(mean, 0.01)).of_mean
    known = stats.linregress(times, mean.mean(axis=1))
    assert (found.slope, found.sd, found.p) == pytest.approx(
        (known.slope, known.stderr, known.pvalue), rel=1e-9
    )
    assert found.half_width == pytest.approx(stats.t.ppf(0.975, 4) * known.stderr)


@pytest.mark.parametrize("day_sd", [0.0, 0.5])
def test_water_without_a_trend_is_seldom_said_to_have_one(day_sd):
    """Whether or not the days differ as a whole, at most one of ten series calls any place
    changed: places that rise together with the day are one observation.
    """
    rng = np.random.default_rng(0)
    false = 0
    for _ in range(400):
        days = rng.normal(0, day_sd, (5, 1))
        mean = days + rng.normal(0, SD, (5, PLACES))
        found = fit_trend(years(0, 1, 2, 3, 4), mean, np.full_like(mean, SD), patches=float(PLACES))
        false += found.clear.any()
    assert false <= 40


def test_a_part_of_the_water_that_changes_is_found_and_the_rest_is_not():
    rng = np.random.default_rng(1)
    hits, wrong = 0.0, 0.0
    for _ in range(50):
        mean = rng.normal(0, SD, (6, PLACES))
        mean[:, :10] += 0.2 * np.arange(6)[:, None]
        found = fit_trend(
            years(*range(6)), mean, np.full_like(mean, SD), patches=float(PLACES)
        ).clear
        hits += found[:10].mean() / 50
        wrong += found[10:].mean() / 50
    assert hits > 0.8
    assert wrong < 0.05


def test_a_season_is_not_taken_for_a_trend_where_it_is_fitted():
    """Surveys that began in spring and ended in summer."""
    times = np.array([0.3, 0.6, 1.3, 1.6, 2.3, 2.6, 3.55])
    water = 5 * np.sin(2 * np.pi * times)[:, None] + 0.05 * times[:, None] + np.zeros(PLACES)
    sd = np.full_like(water, SD)
    assert abs(fit_trend(years(*times), water, sd).of_mean.slope - 0.05) > 0.2
    with_season = fit_trend(years(*times), water, sd, seasonal=True)
    assert with_season.of_mean.slope == pytest.approx(0.05, abs=1e-6)


@pytest.mark.parametrize(
    ("times", "seasonal", "says"),
    [
        ((0, 1), False, "needs surveys of 3 days"),
        ((1, 1, 1), False, "all of the same time, "),
        ((0, 1, 2), True, "6 surveys over 2 years"),
        ((0, 1, 2, 3, 4, 5), True, "same time of year"),
    ],
)
def test_too_little_to_tell_is_said(times, seasonal, says):
    mean = np.zeros((len(times), 3))
    with pytest.raises(InputError, match=says):
        fit_trend(years(*times), mean, mean, seasonal=seasonal)


@given(st.lists(st.floats(0, 1), min_size=1, max_size=30))
def test_adjusted_probabilities_are_those_of_scipy_and_of_the_definition(p):
    p = np.array(p)
    assert adjusted(p) == pytest.approx(stats.false_discovery_control(p), abs=1e-12)
    order = np.sort(p)
    for value, holm in zip(p, adjusted_for_family(p), strict=True):
        reached = order[order <= value]
        expected = max(min(1.0, one * (len(p) - k)) for k, one in enumerate(reached))
        assert holm == pytest.approx(expected)
