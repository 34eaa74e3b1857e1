"""Differences between two passes over one place, distinguished from those between places."""

from dataclasses import replace

import numpy as np
import pytest
import shapely
from hypothesis import given
from hypothesis import strategies as st

from grebe.mapping.covariance.models import KINDS, CovarianceModel, Fleeting, correlations, slopes
from grebe.mapping.covariance.posterior import Posterior, fit_rough, fit_smooth
from grebe.mapping.fields.joining import EXACT_LIMIT
from grebe.mapping.fields.kriging import Moments, Passing, krige, krige_moments
from grebe.mapping.grid import make_grid
from grebe.mapping.methods.averaged import Averaged
from grebe.mapping.methods.base import Domain, Readings
from grebe.mapping.methods.kriging import Kriging
from grebe.mapping.methods.passes import Passes, fit_passes
from grebe.mapping.proof.calibration import Calibration, for_few
from grebe.mapping.way import REACH_M, half_cell_m, off_the_way, passed

SPACE = CovarianceModel(kind="matern32", sill=1.0, range_m=25.0, nugget=1e-3)
FLEETING = Fleeting(variance=0.3, memory_s=60.0)
WATER = shapely.box(0, 0, 100, 100)
DOMAIN = Domain(WATER, make_grid(WATER, 4.0))


def lanes(spacing_m=10.0, step_m=2.0):
    """Places and times on lanes over a square of 100 m, at 1 m/s: back and forth, three across."""
    way = []
    for i, east in enumerate(np.arange(5.0, 100.0, spacing_m)):
        north = np.arange(5.0, 96.0, step_m)[:: 1 if i % 2 == 0 else -1]
        way.append(np.column_stack([north, np.full(len(north), east)]))
    for i, north in enumerate((20.0, 50.0, 80.0)):
        east = np.arange(5.0, 96.0, step_m)[:: -1 if i % 2 == 0 else 1]
        way.append(np.column_stack([np.full(len(east), north), east]))
    places = np.concatenate(way)
    return places, step_m * np.arange(len(places))


def drawn(seed, space=SPACE, fleeting=FLEETING):
    """Readings along the lanes, the sum of a field, a process in time and noise; and the field."""
    rng = np.random.default_rng(seed)
    places, times = lanes()
    far = np.hypot(*(places[:, None] - places[None]).transpose(2, 0, 1))
    root = np.linalg.cholesky(space.covariance(far) + 1e-9 * np.eye(len(places)))
    field = root @ rng.normal(size=len(places))
    course = fleeting.draws(times, 1, rng)[0]
    noise = rng.normal(0, np.sqrt(space.nugget), len(places))
    return Readings(positions=places, values=field + course + noise, times=times), field, course


@pytest.mark.parametrize("kind", KINDS)
def test_slopes_are_the_derivatives_of_the_correlation(kind):
    x = np.linspace(0.01, 3.0, 50)
    x = x[np.abs(x - 1) > 1e-3]
    step = 1e-6
    grown = correlations(kind, x * np.exp(-step)) - correlations(kind, x * np.exp(step))
    found, there = slopes(kind, x)
    assert np.allclose(found, grown / (2 * step), atol=1e-6)
    assert np.array_equal(there, correlations(kind, x))


@given(
    at=st.tuples(*[st.floats(low, high) for low, high in
                   ((-3, -0.5), (-2, 2), (-8, -1), (-6, 1), (-5, 0), (-2, 2))]),
    kind=st.sampled_from(("exponential", "matern32")),
)  # fmt: skip
def test_the_posterior_s_slope_is_its_derivative(at, kind):
    readings, *_ = drawn(0)
    some = slice(0, 120, 2)
    times = readings.times[some]
    slow = np.exp(-np.abs(times[:, None] - times[None]) / 500)
    problem = Posterior.of(
        readings.positions[some], readings.values[some], kind, 0.01, (slow,), times
    )
    at = np.array(at)
    density, slope = problem.density_and_slope(at)
    assert density == pytest.approx(problem.log_density(at), abs=1e-6)
    for i, one in enumerate(1e-5 * np.eye(len(at))):
        rise = (problem.log_density(at + one) - problem.log_density(at - one)) / 2e-5
        assert slope[i] == pytest.approx(rise, rel=1e-4, abs=1e-4)


def test_a_course_has_the_process_s_covariance():
    times = np.array([0.0, 200.0, 30.0, 31.0])
    courses = FLEETING.draws(times, 40_000, np.random.default_rng(0))
    assert np.allclose(np.cov(courses.T), FLEETING.covariance(times, times), atol=0.01)


def test_what_is_carried_is_the_matrix_product():
    rng = np.random.default_rng(3)
    times = rng.permutation(np.concatenate([rng.uniform(0, 900, 60), [5.0, 5.0]]))
    weights = rng.normal(size=(62, 2))
    at = np.concatenate([rng.uniform(-50, 950, 40), times[:5]])
    expected = FLEETING.covariance(at, times) @ weights
    assert np.allclose(FLEETING.carried(times, weights, at), expected, atol=1e-12)


def test_the_mean_of_many_samples_is_that_of_the_whole_system():
    readings, *_ = drawn(8)
    targets = np.random.default_rng(2).uniform(0, 100, (3_000, 2))
    when = np.random.default_rng(3).uniform(0, 1_000, len(targets))
    passing = Passing(
        fleeting=FLEETING, at_samples=readings.times, at_targets=when,
        share=np.full(len(targets), 0.7),
    )  # fmt: skip
    given = (readings.positions, readings.values, targets, SPACE)
    whole = krige(*given, neighbours=len(readings), passing=passing)
    assert len(readings) > EXACT_LIMIT
    assert np.allclose(krige(*given, passing=passing).mean, whole.mean, atol=1e-7)


def test_kriging_in_place_and_time_is_the_solution_of_the_whole_system():
    readings, *_ = drawn(1)
    some = slice(0, 200, 3)
    at, values, times = readings.positions[some], readings.values[some], readings.times[some]
    targets = np.array([[33.0, 41.0], [70.0, 15.0], [50.0, 52.0]])
    when, share = np.array([100.0, 333.0, 40.0]), np.array([1.0, 0.4, 0.0])
    found = krige(
        at, values, targets, SPACE,
        passing=Passing(fleeting=FLEETING, at_samples=times, at_targets=when, share=share),
    )  # fmt: skip

    def apart(a, b):
        return np.hypot(*(a[:, None] - b[None]).transpose(2, 0, 1))

    system = SPACE.covariance(apart(at, at)) + FLEETING.covariance(times, times)
    system += (SPACE.nugget + 1e-9) * np.eye(len(at))
    near = SPACE.covariance(apart(at, targets)) + share * FLEETING.covariance(times, when)
    ones = np.ones(len(at))
    mean = ones @ np.linalg.solve(system, values) / (ones @ np.linalg.solve(system, ones))
    expected = mean + near.T @ np.linalg.solve(system, values - mean)
    missing = 1 - near.T @ np.linalg.solve(system, ones)
    variance = SPACE.sill + FLEETING.variance - np.sum(near * np.linalg.solve(system, near), axis=0)
    variance += missing**2 / (ones @ np.linalg.solve(system, ones))
    assert np.allclose(found.mean, expected, atol=1e-6)
    assert np.allclose(found.variance, variance, atol=1e-6)


@pytest.mark.parametrize("every", [2, 1])
def test_several_moments_are_solved_as_each_by_itself(every):
    """Solved as one system, and by tiles."""
    readings, *_ = drawn(8)
    some = slice(None, None, every)
    at, values, times = readings.positions[some], readings.values[some], readings.times[some]
    targets = np.random.default_rng(2).uniform(0, 100, (2_500, 2))
    moments = np.array([0.0, 411.0, 900.0])
    several = krige_moments(
        at, values, targets, SPACE, Moments(fleeting=FLEETING, at_samples=times, at=moments)
    )
    assert len(several) == 3
    assert (len(at) > EXACT_LIMIT) == (every == 1)
    for moment, found in zip(moments, several, strict=True):
        passing = Passing(
            fleeting=FLEETING, at_samples=times, at_targets=np.full(len(targets), moment),
            share=np.ones(len(targets)),
        )  # fmt: skip
        alone = krige(at, values, targets, SPACE, passing=passing)
        assert np.allclose(found.mean, alone.mean, atol=1e-9)
        assert np.allclose(found.variance, alone.variance, atol=1e-9)


def test_a_fit_tells_what_passes_differ_by():
    found = []
    for seed in range(5):
        readings, *_ = drawn(seed)
        fit, fleeting = fit_passes(readings.positions, readings.values, readings.times, "matheron")
        found.append((fleeting.variance, fleeting.memory_s, fit.model.range_m))
    # A single field of a few ranges shows its own range and not the process's: take a median.
    ratio = np.median(found, axis=0) / (FLEETING.variance, FLEETING.memory_s, SPACE.range_m)
    assert (np.abs(np.log(ratio)) < np.log(1.5)).all(), ratio


def test_where_passes_agree_hardly_any_is_found():
    for seed in range(3):
        readings, *_ = drawn(seed, fleeting=Fleeting(variance=0.0, memory_s=60.0))
        _, fleeting = fit_passes(readings.positions, readings.values, readings.times, "matheron")
        assert fleeting.variance < 0.02 * SPACE.sill


def test_between_passes_that_disagree_it_errs_less_than_a_smooth_field_of_place_alone():
    places = np.random.default_rng(9).uniform(15, 85, (200, 2))
    errors = {"alone": [], "passes": []}
    for seed in range(4):
        readings, field, _ = drawn(10 + seed)
        truth = krige(readings.positions, field, places, replace(SPACE, nugget=0.0)).mean
        for name, method in (("alone", Kriging(fit_covariance=fit_smooth)), ("passes", Passes())):
            found = method.fit(readings, DOMAIN).mean(places)
            errors[name].append(np.sqrt(np.mean((found - truth) ** 2)))
    for alone, passes in zip(errors["alone"], errors["passes"], strict=True):
        assert passes < alone
    assert np.mean(errors["passes"]) < 0.9 * np.mean(errors["alone"])


def test_its_intervals_hold_water_of_another_moment():
    """The field and the process in time are drawn at places and times without readings."""
    z = []
    for seed in range(6):
        rng = np.random.default_rng(seed)
        places, times = lanes()
        others = rng.uniform(10, 90, (40, 2))
        all_places = np.concatenate([places, others])
        far = np.hypot(*(all_places[:, None] - all_places[None]).transpose(2, 0, 1))
        root = np.linalg.cholesky(SPACE.covariance(far) + 1e-9 * np.eye(len(all_places)))
        field = root @ rng.normal(size=len(all_places))
        later = 5_000.0
        course = FLEETING.draws(np.append(times, later), 1, rng)[0]
        values = field[: len(places)] + course[:-1] + rng.normal(0, 0.03, len(places))
        readings = Readings(positions=places, values=values, times=times, moment_s=later)
        found = Passes().fit(readings, DOMAIN)
        z.append((found.mean(others) - field[len(places) :] - course[-1]) / found.sd(others))
    # All places of a draw share one process in time: six of these, and some hundred fields.
    assert np.mean(np.abs(z) < 1.96) > 0.85


def test_on_the_way_the_map_is_what_was_read_and_beside_it_what_all_passes_say():
    readings, field, course = drawn(4)
    found = Passes().fit(readings, DOMAIN)
    on = found.mean(readings.positions[::7])
    # At crossings two passes are equally near.
    assert np.median(np.abs(on - (field + course)[::7])) < 0.05
    when, away = passed(readings.positions, readings.times, readings.positions[::7])
    assert np.allclose(away, 0, atol=1e-9)
    assert np.mean(np.isclose(when, readings.times[::7])) > 0.9


def test_draws_have_the_field_s_mean_and_sd():
    readings, *_ = drawn(5)
    field = Averaged().fit(readings, DOMAIN)
    places = np.random.default_rng(1).uniform(5, 95, (30, 2))
    draws = field.draws(places, 400, 0)
    sd = field.sd(places)
    assert np.mean(np.abs(draws.mean(axis=0) - field.mean(places)) / sd) < 0.15
    assert np.mean(draws.std(axis=0) / sd) == pytest.approx(1.0, abs=0.12)


def test_a_mean_s_uncertainty_holds_what_its_members_differ_by():
    readings, *_ = drawn(6)
    both = Averaged().fit(readings, DOMAIN)
    places = DOMAIN.grid.nodes[::11]
    rough, smooth = both.fields
    assert np.allclose(both.mean(places), (rough.mean(places) + smooth.mean(places)) / 2)
    half_apart = np.abs(rough.mean(places) - smooth.mean(places)) / 2
    assert (both.sd(places) >= half_apart - 1e-9).all()


def test_without_times_the_rough_covariance_is_left():
    readings, *_ = drawn(7)
    timeless = Readings(positions=readings.positions, values=readings.values)
    places = DOMAIN.grid.nodes[::17]
    alone = Kriging(fit_covariance=fit_rough).fit(timeless, DOMAIN)
    assert np.array_equal(Averaged().fit(timeless, DOMAIN).mean(places), alone.mean(places))
    with pytest.raises(ValueError, match="times"):
        Passes().fit(timeless, DOMAIN)


def test_nobody_knows_the_way_between_readings_far_apart():
    """A line of 100 m was left out between two others, and a straight path would join them."""
    south, north = np.arange(0.0, 100.0), np.arange(100.0, 0.0, -1.0)
    way = np.concatenate(
        [np.column_stack([south, 0 * south]), np.column_stack([south, 0 * south + 20])]
    )
    times = np.concatenate([np.arange(100.0), np.arange(200.0, 300.0)])
    line = np.column_stack([north[10:-10], np.full(80, 10.0)])
    assert np.allclose(off_the_way(way, line), 10.0)
    _, away = passed(way, times, line)
    assert np.allclose(away, 10.0)
    # A gap that is short enough belongs to the path.
    gap = np.delete(way, slice(30, 60), axis=0)
    assert np.allclose(off_the_way(gap, way[30:60]), 0.0)
    when, away = passed(gap, np.delete(times, slice(30, 60)), way[30:60])
    assert np.allclose(when, times[30:60])
    assert np.allclose(away, 0.0)


def test_a_node_whose_cell_the_way_crosses_is_on_it():
    way = np.column_stack([np.arange(100.0), np.zeros(100)])
    places = np.column_stack([np.full(4, 50.0), [0.0, 2.0, 3.0, 300.0]])
    factors = Calibration(on_way=0.5, off_way=2.0, way=way, wide_m=half_cell_m(2 * np.sqrt(2)))
    on, edge, beside, far = factors.factor(places)
    assert on == edge == 0.5
    assert 0.5 < beside < far
    assert far == pytest.approx(2.0)
    assert half_cell_m(100.0) == REACH_M


def test_few_lines_tell_less_of_how_wide_an_interval_must_be():
    """Student's quantiles for 4 and for 100 degrees of freedom, from a table."""
    assert for_few(5) == pytest.approx(2.776 / 1.96, rel=1e-3)
    assert for_few(101) == pytest.approx(1.984 / 1.96, rel=1e-3)
