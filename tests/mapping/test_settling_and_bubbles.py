"""Settling is found at any pace, and a gradient is not; bubbles are distinguished from water."""

import numpy as np
import pytest
from conftest import CHINA, TRACKS, needs_tracks

from grebe.core.quantities import BUILTIN
from grebe.io.readers.track import read_track
from grebe.mapping.quality.bubbles import bubbles
from grebe.mapping.quality.control import check_quality
from grebe.mapping.quality.settling import settling_times
from grebe.workflow.tracks import samples_of_track, survey_of_track

N = 4000
T = np.arange(float(N))
MOVING = np.column_stack([T, 0 * T])


def water(seed, length=60.0, sd=1.0):
    """A record of correlated water along a track."""
    rng = np.random.default_rng(seed)
    white = rng.normal(size=N + 600)
    kernel = np.exp(-0.5 * (np.arange(-300, 301) / length) ** 2)
    field = np.convolve(white, kernel, "valid")[:N]
    return sd * field / field.std() + rng.normal(0, 0.02 * sd, N)


@pytest.mark.parametrize("tau", [20.0, 60.0, 240.0])
def test_a_start_that_belongs_to_no_later_water_is_settling(tau):
    value = water(1) + 15 * np.exp(-T / tau)
    found = settling_times({"ph": value}, T, MOVING)
    assert found["ph"] == pytest.approx(3 * tau, rel=0.3)


def test_a_still_boat_tells_what_a_moving_one_cannot():
    still = np.where(T[:, None] < 300, 0.0, MOVING - 300)
    drift = 2.5 * np.exp(-T / 80)
    calm = np.where(T < 300, 0.0, water(2)) + drift
    assert settling_times({"ph": calm}, T, still)
    assert not settling_times({"ph": calm - drift}, T, still)


def test_gradients_at_the_start_are_water():
    for seed in range(30):
        assert not settling_times({"ph": water(seed), "orp_mv": water(seed + 99)}, T, MOVING)


def flagged(samples, first):
    columns = {
        key: column[first:] for key, column in samples.values.items() if BUILTIN[key].on_sonde
    }
    return settling_times(columns, samples.times[first:], samples.positions[first:])


@needs_tracks
def test_real_records_cut_later_have_settled():
    for path in sorted(TRACKS.glob("*.csv")):
        raw = read_track(path, header_from=None if path == CHINA else CHINA)
        samples = samples_of_track(raw, survey_of_track(raw, "x"))
        n = len(samples)
        for first in np.random.default_rng(11).integers(n // 10, 7 * n // 10, 20):
            assert not flagged(samples, first), (path.name, first)
        if path == CHINA:
            assert "ph" in flagged(samples, 0)


def planted(depth, at, seconds, ramp=1.0):
    shape = np.clip((T - at) / ramp, 0, 1) * np.clip((at + seconds - T) / ramp, 0, 1)
    return shape, 200 * (1 + 0.002 * water(5)) * (1 - depth * shape)


@pytest.mark.parametrize("depth", [0.04, 0.1])
@pytest.mark.parametrize("seconds", [30.0, 240.0])
def test_a_bubble_is_found_from_end_to_end(depth, seconds):
    shape, value = planted(depth, 1000.0, seconds)
    found = bubbles(value, [20 + 0.2 * water(6)], T)
    assert found[shape > 0.6].mean() > 0.95
    assert not found[(T < 995) | (1005 + seconds < T)].any()


def test_other_water_is_no_bubble():
    shape, value = planted(0.08, 1000.0, 200.0, ramp=6.0)
    assert not bubbles(value, [20 + 0.1 * water(6) + 2 * shape], T).any()
    assert not bubbles(planted(0.08, 1000.0, 9000.0)[1], [20 + 0.1 * water(6)], T).any()


def test_noise_is_no_rate_of_change():
    rng = np.random.default_rng(0)
    raw = read_track_like(20 + rng.normal(0, 0.35, N))
    counts = check_quality(raw, survey_hull(raw)).counts["temperature_degc"]
    assert sum(counts["rate of change"]) <= N / 1000
    assert sum(counts["spike"]) <= N / 1000


def read_track_like(values):
    from grebe.core.samples import Samples

    return Samples.of(
        times=1.6e9 + T, positions=MOVING, values={"temperature_degc": values}, quantities=BUILTIN
    )


def survey_hull(samples):
    import shapely

    return shapely.box(-10, -10, N + 10, 10)
