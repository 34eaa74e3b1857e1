"""The state filter: exact estimates are unchanged, noise is reduced, and no model is trusted more
than its predictions justify.
"""

from dataclasses import replace
from itertools import pairwise

import numpy as np
import pytest
import scipy.linalg

from grebe.control.state_filter import LEAST_S, LEAST_SHARE, StateFilter
from grebe.core.dynamics import Weather
from grebe.core.motion import parameter_vector
from grebe.core.vessel import PRESETS
from grebe.simulation.plant import Plant

BOAT = PRESETS["benchmark"]
EVERY_S, SUBSTEPS = 0.1, 4
VELOCITIES = np.array([0.0, 0.0, 0.0, 0.03, 0.03, 0.03])
ALL = np.array([0.05, 0.05, 0.01, 0.03, 0.03, 0.03])


def sail(noise, *, seconds=60, boat=BOAT, weather=None, drift_m=0.0, seed=5):
    """A filter after a drive with changing orders; true, estimated and filtered states (n, 6).

    The true boat is `boat`; `drift_m` is the random walk of its measured positions in a second.
    """
    rng = np.random.default_rng(seed)
    weather = weather or Weather()
    plant, one = Plant(boat, (0.0,) * 6, weather), StateFilter()
    p = parameter_vector(BOAT, np.array(weather.as_tuple()))
    true, seen, believed, thrusts = [], [], [], (0.0, 0.0)
    off = np.zeros(2)
    for i in range(round(seconds / EVERY_S)):
        true.append(np.array(plant.state))
        off = off + drift_m * np.sqrt(EVERY_S) * rng.normal(size=2)
        estimate = true[-1] + rng.normal(size=6) * noise
        estimate[:2] += off
        seen.append(tuple(estimate.tolist()))
        if i:
            one.see(p, seen[-2], thrusts, seen[-1], EVERY_S, SUBSTEPS)
        believed.append(one.filtered(seen[-1]))
        if i % 20 == 0:
            thrusts = tuple((rng.uniform(-0.2, 0.9, 2) * boat.thrust_max_n).tolist())
            plant.command(thrusts)
        plant.advance(EVERY_S)
    return one, np.array(true), np.array(seen), believed


def root_mean_square(errors):
    return np.sqrt(np.mean(np.square(errors[200:]), axis=0))


def test_exact_estimates_are_taken_as_they_come():
    _, _, seen, believed = sail(np.zeros(6))
    assert [tuple(one) for one in seen.tolist()] == believed


def test_the_noise_is_learned():
    one, *_ = sail(ALL)
    assert np.sqrt(one.variances) == pytest.approx(ALL, rel=0.35)


@pytest.mark.parametrize(("noise", "share"), [(VELOCITIES, 0.4), (ALL, 0.7)])
@pytest.mark.parametrize("current", [0.0, 0.3])
def test_what_is_believed_is_nearer_the_truth_than_what_is_seen(noise, share, current):
    _, true, _, believed = sail(noise, weather=Weather(current_east_mps=current))
    left = root_mean_square(np.array(believed) - true)
    assert np.all(left[3:] < share * noise[3:])
    assert np.all(left[:3] <= np.maximum(noise[:3], 1e-3))


def test_a_model_that_foretells_badly_is_not_believed():
    heavy = replace(
        BOAT, m11_kg=1.5 * BOAT.m11_kg, m22_kg=1.5 * BOAT.m22_kg, m33_kgm2=2.0 * BOAT.m33_kgm2
    )
    _, true, _, believed = sail(ALL, boat=heavy)
    assert np.all(root_mean_square(np.array(believed) - true)[3:] < 1.1 * ALL[3:])


def test_positions_that_wander_tell_no_velocity():
    _, true, _, believed = sail(VELOCITIES, drift_m=0.3)
    assert np.all(root_mean_square(np.array(believed) - true)[3:] < 0.7 * VELOCITIES[3:])


def test_after_a_gap_the_next_estimate_is_taken_as_it_comes():
    one, *_ = sail(ALL)
    jumped = (50.0, 50.0, 1.0, 0.0, 0.0, 0.0)
    assert one.filtered(jumped) != jumped
    one.forget()
    assert one.filtered(jumped) == jumped


def test_a_wild_estimate_is_taken_as_it_comes_and_spoils_nothing():
    rng, one = np.random.default_rng(4), StateFilter()
    p = parameter_vector(BOAT, np.zeros(4))
    seen = (rng.normal(size=(600, 6)) * ALL).tolist()
    seen[400][0] += 20.0
    before = np.zeros(6)
    for i, (last, now) in enumerate(pairwise(map(tuple, seen)), 1):
        one.see(p, last, (0.0, 0.0), now, EVERY_S, SUBSTEPS)
        believed = one.filtered(now)
        assert abs(believed[3]) < 4 * ALL[3]
        if i == 399:
            before = one.variances.copy()
        if i == 400:
            assert believed == now
    assert np.sqrt(one.variances) == pytest.approx(np.sqrt(before), rel=0.5)
    assert one.filtered(tuple(seen[-1])) != tuple(seen[-1])


def test_nothing_is_believed_of_the_noise_at_once():
    _, _, seen, believed = sail(ALL, seconds=0.9 * LEAST_S)
    assert [tuple(one) for one in seen.tolist()] == believed


def gain_at_rest(seen, element):
    """Gain of the filter on one element of the last estimate, for a boat at rest."""
    p, moved = parameter_vector(BOAT, np.zeros(4)), 1e-6
    ends = []
    for shift in (0.0, moved):
        one, last = StateFilter(), list(seen[-1])
        last[element] += shift
        for before, after in pairwise([*seen[:-1], tuple(last)]):
            one.see(p, before, (0.0, 0.0), after, EVERY_S, SUBSTEPS)
        ends.append(one.filtered(seen[-1])[element])
    return (ends[1] - ends[0]) / moved, one.variances


def test_at_rest_it_is_the_steady_kalman_filter():
    """Its gains are those of SciPy's solution of the discrete algebraic Riccati equation.

    (Simon 2006, ch. 7), for the learned noise and a boat at rest.
    """
    rng = np.random.default_rng(2)
    seen = [tuple((rng.normal(size=6) * ALL).tolist()) for _ in range(900)]
    gains, learned = zip(*(gain_at_rest(seen, i) for i in range(6)), strict=True)
    rates = np.array([BOAT.x_u / BOAT.m11_kg, BOAT.y_v / BOAT.m22_kg, BOAT.n_r / BOAT.m33_kgm2])
    decay = np.exp(EVERY_S * rates)
    slopes = np.diag([1.0, 1.0, 1.0, *decay])
    slopes[range(3), range(3, 6)] = (decay - 1.0) / rates
    measured = learned[0]
    model = np.diag(LEAST_SHARE * measured)
    ahead = scipy.linalg.solve_discrete_are(slopes.T, np.eye(6), model, np.diag(measured))
    steady = np.diag(ahead @ np.linalg.inv(ahead + np.diag(measured)))
    assert np.array(gains) == pytest.approx(steady, rel=0.25)
