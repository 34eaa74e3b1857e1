"""Flags against planted faults; the lag of a sensor; both in the survey file."""

import json

import numpy as np
import pytest
import shapely
from click.testing import CliRunner
from conftest import DATA, needs_tracks
from hypothesis import given, settings
from hypothesis import strategies as st

from grebe.cli.main import grebe
from grebe.core.errors import InputError, UsageError
from grebe.core.quantities import BUILTIN, quantities_of
from grebe.core.samples import Flag, Samples
from grebe.io.readers.limits import read_limits
from grebe.io.store import SurveyFile
from grebe.mapping.lag import Lag, Pass, estimate_lag, unlagged
from grebe.mapping.quality.control import check_quality
from grebe.mapping.quantity_map import possible

WATER = shapely.box(-10, -10, 2000, 50)
TRACKS = DATA / "tracks"


def record(n=900, **values):
    """A boat that goes north at 1 m/s, with a reading every second."""
    positions = np.column_stack([np.arange(float(n)), np.zeros(n)])
    rng = np.random.default_rng(1)
    calm = {
        "temperature_degc": 20 + 0.2 * np.sin(np.arange(n) / 60) + rng.normal(0, 0.01, n),
        "ph": 7.8 + rng.normal(0, 0.01, n),
        "conductivity_uscm": 400 + rng.normal(0, 0.5, n),
    }
    return Samples.of(
        times=1.6e9 + np.arange(float(n)),
        positions=positions,
        values=calm | values,
        quantities=BUILTIN,
    )


def flags_of(one, key, water=WATER):
    return check_quality(one, water).flags[key]


def test_a_clean_record_is_good():
    quality = check_quality(record(), WATER)
    assert all((flags == Flag.GOOD).all() for flags in quality.flags.values())
    assert not any(sum(found) for tests in quality.counts.values() for found in tests.values())


@given(st.integers(5, 890), st.sampled_from([-1, 1]))
@settings(max_examples=20, deadline=None)
def test_a_spike_is_found_and_its_neighbours_are_not(place, sign):
    one = record()
    one.values["ph"][place] += 2.0 * sign
    flags = flags_of(one, "ph")
    assert flags[place] == Flag.FAIL
    assert flags[place - 2] == Flag.GOOD
    # The rate of change flags the sample after a jump; nothing else is flagged.
    assert (flags != Flag.GOOD).sum() <= 3


def test_what_is_impossible_fails_and_what_is_unusual_is_suspect():
    one = record()
    one.values["temperature_degc"][100:103] = 60.0
    one.values["temperature_degc"][300:330] = 40.0
    flags = flags_of(one, "temperature_degc")
    assert (flags[100:103] == Flag.FAIL).all()
    assert (flags[301:329] == Flag.SUSPECT).all()


def test_a_stuck_sensor_is_found():
    one = record(2000)
    one.values["ph"][500:1700] = 7.7
    flags = flags_of(one, "ph")
    assert (flags[850:1350] >= Flag.SUSPECT).all()
    assert (flags[1500:1690] == Flag.FAIL).all()
    assert (flags[:500] == Flag.GOOD).all()


@pytest.mark.parametrize(("given", "stands_still"), [({}, True), ({"flat_fail_s": 900.0}, False)])
def test_a_sonde_may_hang_in_one_depth_and_its_battery_may_last(given, stands_still):
    """The sonde's own state may stand still unless a time is set, also after it is read back."""
    battery = {
        "battery_v": {
            "label": "Battery",
            "unit": "V",
            "cf_unit": "V",
            "span": [0, 20],
            "resolution": 0.1,
            "mapped": False,
            "limits": {"flat_suspect_s": 300.0, **given} if given else {},
        }
    }
    known = BUILTIN.extended(quantities_of(battery, {}, "ours"))
    tables = json.loads(json.dumps({key: one.as_table() for key, one in known.items()}))
    again = quantities_of(tables, {}, "the survey")
    assert again["battery_v"].limits == known["battery_v"].limits
    calm = record(sonde_depth_m=np.full(900, 0.5))
    one = Samples.of(
        times=calm.times,
        positions=calm.positions,
        values=dict(calm.values) | {"battery_v": np.full(900, 12.4)},
        quantities=again,
    )
    quality = check_quality(one, WATER, again)
    assert (quality.flags["sonde_depth_m"] == Flag.GOOD).all()
    assert (quality.flags["battery_v"] == Flag.GOOD).all() == stands_still


def test_a_settling_sonde_is_found_and_a_gradient_is_not():
    one = record()
    since = np.arange(900.0)
    one.values["ph"][:] += 0.5 * np.exp(-since / 40)
    flags = flags_of(one, "ph")
    assert (flags[:100] == Flag.SUSPECT).all()
    assert (flags[200:] == Flag.GOOD).all()
    wavy = record()
    wavy.values["ph"][:] += 0.5 * np.cos(since / 50)
    assert (flags_of(wavy, "ph") == Flag.GOOD).all()


def test_samples_in_the_air_fail_for_all_quantities():
    one = record()
    one.values["conductivity_uscm"][400:410] = 2.0
    for key in ("temperature_degc", "ph"):
        flags = flags_of(one, key)
        assert (flags[400:410] == Flag.FAIL).all()
        assert (flags[397:400] == Flag.SUSPECT).all()
        assert flags[390] == Flag.GOOD


def test_an_inflow_of_thin_water_is_not_air():
    one = record()
    one.values["conductivity_uscm"][400:440] *= np.linspace(1, 0.05, 40)
    one.values["conductivity_uscm"][440:480] *= np.linspace(0.05, 1, 40)
    assert (flags_of(one, "ph") == Flag.GOOD).all()


def test_two_readings_in_one_second_are_both_checked():
    one = record()
    one.times[1::2] = one.times[::2]
    one.values["temperature_degc"][301] = 60.0
    flags = flags_of(one, "temperature_degc")
    assert flags[301] == Flag.FAIL
    assert flags[300] == Flag.GOOD


def test_times_that_stand_still_make_no_trouble():
    one = record()
    one.times[:] = one.times[0]
    assert (flags_of(one, "ph") == Flag.GOOD).all()


def test_positions_on_land_and_times_that_go_back_fail():
    one = record(water := 900)
    one.positions[20] = (20.0, 500.0)
    one.times[50] -= 30.0
    flags = flags_of(one, "ph")
    assert flags[20] == Flag.FAIL
    assert flags[50] == Flag.FAIL
    assert (flags == Flag.FAIL).sum() == 2
    assert water == len(flags)


def test_missing_values_are_missing_and_gaps_are_told():
    one = record()
    one.values["ph"][10:20] = np.nan
    one.times[600:] += 120.0
    quality = check_quality(one, WATER)
    assert (quality.flags["ph"][10:20] == Flag.MISSING).all()
    assert "1 gap in time, of 121 s" in quality.notes[0]


def test_limits_are_read_and_bad_ones_named(tmp_path):
    path = tmp_path / "limits.toml"
    path.write_text("[ph]\nsuspect_span = [7.0, 7.5]\nspike_fail = 0.5\n")
    limits = read_limits(path, BUILTIN)
    assert limits["ph"].limits.suspect_span == (7.0, 7.5)
    assert (flags_of(record(), "ph") == Flag.GOOD).all()
    quality = check_quality(record(), WATER, limits)
    assert (quality.flags["ph"] == Flag.SUSPECT).all()
    for text in ("[salt]\na = 1", "[ph]\nwrong = 1", "[ph]\nspike_fail = 'x'", "[ph"):
        path.write_text(text)
        with pytest.raises(InputError, match=r"limits\.toml"):
            read_limits(path, BUILTIN)


def lagged(times, truth, delay, tau, fine=0.05):
    """Readings of a signal (a function of time) by a sensor of this delay and time constant."""
    t = np.arange(times[0] - 200, times[-1] + fine, fine)
    said = np.empty_like(t)
    said[0] = truth(t[0] - delay)
    for i in range(1, len(t)):
        target = truth(t[i] - delay)
        said[i] = target + (said[i - 1] - target) * np.exp(-fine / tau) if tau else target
    return np.interp(times, t, said)


def test_a_lag_is_undone():
    times = np.arange(0.0, 600.0)
    truth = lambda t: np.sin(t / 25)  # noqa: E731
    seen = lagged(times, truth, 4.0, 6.0)
    corrected = unlagged(times, seen, Lag(delay_s=4.0, tau_s=6.0))
    known = np.isfinite(corrected)
    assert known.sum() >= 595
    assert np.abs(seen - truth(times)).max() > 0.3
    assert np.abs(corrected - truth(times))[known].max() < 0.03


def test_nothing_is_invented_across_a_gap():
    times = np.concatenate([np.arange(0.0, 20.0), np.arange(600.0, 620.0)])
    values = np.where(times < 300, 5.0, 15.0)
    corrected = unlagged(times, values, Lag(delay_s=10.0))
    assert corrected[:10] == pytest.approx(5.0)
    assert np.isnan(corrected[10:20]).all()


@pytest.mark.parametrize("step", [1.0, 1.37, 2.0])
def test_noise_is_not_taken_for_a_lag(step):
    for seed in range(6):
        rng = np.random.default_rng(seed)
        times = np.arange(0.0, 800.0, step)
        runs = [
            Pass(
                times=times,
                positions=np.column_stack([place, np.zeros(len(times))]),
                values=np.sin(place / 60) + rng.normal(0, 0.3, len(times)),
            )
            for place in (times, 800 - times)
        ]
        assert not estimate_lag(*runs).advised


def test_no_lag_changes_nothing():
    values = np.array([1.0, np.nan, 3.0])
    assert np.array_equal(unlagged(np.arange(3.0), values, Lag()), values, equal_nan=True)
    with pytest.raises(ValueError, match="0 or more"):
        Lag(delay_s=-1.0)


def test_two_runs_in_opposite_directions_tell_the_lag():
    """There and back along a line at 1 m/s: the lag shifts the passes apart."""
    line = lambda x: np.sin(x / 20) + 0.5 * np.cos(x / 33)  # noqa: E731
    times = np.arange(0.0, 400.0)
    zero = np.zeros(400)
    passes = []
    for place in (times, 400 - times):
        seen = lagged(times, lambda t, p=place: line(np.interp(t, times, p)), 5.0, 0.0)
        passes.append(Pass(times=times, positions=np.column_stack([place, zero]), values=seen))
    found = estimate_lag(*passes)
    # A short time constant looks like a delay, so only their sum is determined.
    assert found.lag.delay_s + found.lag.tau_s == pytest.approx(5.0, abs=1.0)
    assert found.advised
    assert found.after < 0.2 * found.before
    far = Pass(times=times, positions=np.full((400, 2), 1e4), values=zero)
    with pytest.raises(ValueError, match="share only 0 places"):
        estimate_lag(passes[0], far)


def run(*arguments):
    done = CliRunner().invoke(grebe, [str(one) for one in arguments])
    if done.exception and not isinstance(done.exception, SystemExit):
        raise done.exception
    return done.stdout


# One track of each lake is mapped; `benchmarks.holdout` maps them all, with stricter checks.
MAPPED = {"China-catabot-20200915", "Sunapee-20200812-path-3"}
# The tracks also have oxygen saturation, chlorophyll, depths and more.
FOUR = {"temperature_degc", "dissolved_oxygen_mgl", "ph", "conductivity_uscm"}


@needs_tracks
@pytest.mark.slow
def test_every_real_track_is_imported_and_checked_and_those_mapped_are_validated(tmp_path):
    """The sonde's settling is found where the record shows it, and only there."""
    header = TRACKS / "China-catabot-20200915.csv"
    settling = {}
    for track in sorted(TRACKS.glob("*.csv")):
        path = tmp_path / f"{track.stem}.gpkg"
        extra = () if track == header else ("--header-from", header)
        run("import", track, "-o", path, *extra)
        found = json.loads(run("check", path, "--json"))["found"]
        settles = {key: sum(tests.get("settling", ())) for key, tests in found.items()}
        settling[track.stem] = {key for key in FOUR & set(settles) if settles[key] > 0}
        if track.stem not in MAPPED:
            continue
        maps = json.loads(run("map", path, "--out", tmp_path / track.stem, "--resolution", 4,
                              "--json"))["maps"]  # fmt: skip
        assert {one["quantity"] for one in maps} >= FOUR | {"chlorophyll_rfu"}
        for one in maps:
            check = one["validation"]
            most = 1.0 if one["quantity"] in FOUR else 1.1
            assert check["rmse"] < most * check["nearest_rmse"]
            assert one["sd_factors"]["off_way"] >= 1.0
    assert settling == {
        # Oxygen falls while the boat holds its position, and pH begins far below all later values.
        "China-catabot-20200915": {"dissolved_oxygen_mgl", "ph"},
        "Sunapee-20200517-longpath-05ms": set(),
        "Sunapee-20200517-longpath-1ms": set(),
        # The record begins minutes after the sonde was put in.
        "Sunapee-20200812-path-3": set(),
    }
    passes = [tmp_path / f"Sunapee-20200517-longpath-{one}.gpkg" for one in ("05ms", "1ms")]
    lags = json.loads(run("lag", *passes, "--json"))
    # The water changed between the runs by more than any lag would: correcting gains nothing.
    assert all(not one["advised"] for one in lags.values())


@needs_tracks
def test_flags_and_lags_are_stored_and_the_values_stay(tmp_path):
    path = tmp_path / "s.gpkg"
    run("import", TRACKS / "China-catabot-20200915.csv", "-o", path)
    with SurveyFile.open(path) as file:
        before = file.samples()
    run("check", path, "--lag", "ph=5,2", "--sensors", "YSI EXO2")
    with SurveyFile.open(path) as file:
        after, meta = file.samples(), file.meta()
    for key, column in before.values.items():
        assert np.array_equal(column, after.values[key], equal_nan=True)
    assert (after.flags["ph"] == Flag.SUSPECT).sum() > 50
    assert json.loads(meta["lags"])["ph"] == {"delay_s": 5.0, "tau_s": 2.0}
    assert meta["sensors"] == "YSI EXO2"
    run("check", path, "--lag", "temperature_degc=3")
    run("check", path, "--lag", "ph=0")
    with SurveyFile.open(path) as file:
        assert json.loads(file.meta()["lags"]) == {
            "temperature_degc": {"delay_s": 3.0, "tau_s": 0.0}
        }
    for bad in ("salt=1", "ph=x", "ph"):
        with pytest.raises(UsageError, match="--lag"):
            run("check", path, "--lag", bad)


@pytest.mark.parametrize(
    ("key", "accuracy"),
    [
        ("turbidity_ntu", 0.5),
        ("dissolved_oxygen_mgl", 0.1),
        ("oxygen_saturation_percent", 1.0),
        ("nitrate_mgl", 2.0),
        ("chlorophyll_ugl", 1.0),
    ],
)
def test_readings_a_little_below_zero_are_kept(key, accuracy):
    """Without them, the mean of water that has nothing of it would be 0.8 sd too high."""
    sd = 0.3 * accuracy
    values = np.random.default_rng(4).normal(0.0, sd, 900).clip(-0.99 * accuracy)
    values[[300, 600]] = -1.2 * accuracy, -20 * accuracy
    flags = flags_of(record(**{key: values}), key)
    assert flags[300] == Flag.SUSPECT
    assert flags[600] == Flag.FAIL
    good = values[flags == Flag.GOOD]
    assert len(good) == 898
    assert abs(good.mean()) < 0.1 * sd < 0.7 * sd < good[good > 0].mean()


def test_a_map_is_below_zero_only_where_readings_are():
    turbidity, temperature = BUILTIN["turbidity_ntu"], BUILTIN["temperature_degc"]
    mean = np.array([-0.3, 0.2])
    assert possible(mean, turbidity, np.array([0.1, 2.0])).tolist() == [0.0, 0.2]
    assert possible(mean, turbidity, np.array([-0.1, 2.0])).tolist() == [-0.1, 0.2]
    assert possible(mean, temperature, np.array([0.1, 2.0])).tolist() == [-0.3, 0.2]
